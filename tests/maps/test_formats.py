"""Every output format says the same findings, at the same bytes, and nothing in a file can break it."""

from __future__ import annotations

import dataclasses
import json
import re
import unicodedata
from xml.etree import ElementTree

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.maps.drawn import HEAD, box, placed, robot
from wallkit.cli import common
from wallkit.cli.map.group import validate as validate_command
from wallkit.maps.document import Document, Edit, apply_edits
from wallkit.maps.findings.formats import DOCUMENTS, TEXTS, github_from, json_from, junit_from
from wallkit.maps.findings.judged import Judged
from wallkit.maps.findings.sarif import LEVELS, sarif_from
from wallkit.maps.findings.text import WIDTH, marked_line, printable, text_from
from wallkit.maps.rules import RULES, validate
from wallkit.maps.xml import parse

# a comma (error, safe fix), a duplicate link (error, moderate fix) and a wide character before both on the line
FAULTY = robot(
    '<!-- 壁 é --><link name="a"><collision><geometry><box size="1,2,3"/></geometry></collision></link>',
    placed("a", "0 0 0"),
)
DUPLICATE = robot(box("a", "1 1 1"), box("a", "1 1 1"), placed("a", "0 0 0"))


def judged(data: bytes, source: str = "map.urdf", *, is_strict: bool = False, **options: object) -> Judged:
    report = validate(data, source=source, **options)
    return Judged(report.map.document if report.map else parse(data, source), report, is_strict=is_strict)


def only(findings, code):
    (finding,) = [f for f in findings if code in (getattr(f, "code", None), f.get("rule") if type(f) is dict else None)]
    return finding


def sarif_results(document, code):
    return [result for result in document["runs"][0]["results"] if result["ruleId"] == code]


# -------------------------------------------------------------------------------------------------- every format


def test_the_command_offers_every_format():
    (option,) = [p for p in validate_command.params if p.name == "format_name"]
    assert set(option.type.choices) == {*TEXTS, *DOCUMENTS}


@pytest.mark.parametrize("name", [*TEXTS, *DOCUMENTS])
@pytest.mark.parametrize(
    "data",
    [b"", b"\0", b"<robot", b"\xff\xfe<", FAULTY, DUPLICATE, FAULTY.replace(b"\n", b"\r\n"), b"\xef\xbb\xbf" + FAULTY],
    ids=["empty", "nul", "torn", "utf16", "faulty", "duplicate", "crlf", "bom"],
)
def test_a_format_says_the_same_bytes_twice_and_takes_any_file(name, data):
    once, twice = (written(name, judged(data)) for _ in range(2))
    assert once == twice
    assert "map.urdf" in once


def written(name: str, *files: Judged) -> str:
    return TEXTS[name](files) if name in TEXTS else json.dumps(common.plain(DOCUMENTS[name](files)), allow_nan=False)


@given(st.binary(max_size=60))
def test_no_bytes_break_a_format(data):
    file = judged(HEAD.encode() + data)
    for name in (*TEXTS, *DOCUMENTS):
        assert written(name, file)


def test_figures_that_do_not_exist_are_null_in_json():
    file = judged(FAULTY)
    nan = tuple(dataclasses.replace(f, xyz=(float("nan"), 1.0)) for f in file.report.findings)
    file = dataclasses.replace(file, report=dataclasses.replace(file.report, findings=nan))
    assert json.loads(written("json", file))["findings"][0]["xyz"] == [None, 1.0]
    assert sarif_results(json.loads(written("sarif", file)), "WK-S023")[0]["properties"]["xyz"] == [None, 1.0]


@pytest.mark.long
@pytest.mark.data
def test_every_faulty_file_can_be_written_in_every_format(data):
    files = [judged(path.read_bytes(), path.name) for path in sorted((data / "maps/malformed").glob("*/*.urdf"))]
    assert len(files) == 69
    total = sum(len(file.report.findings) for file in files)
    assert total > 60
    assert len(json_from(files)["findings"]) == len(sarif_from(files)["runs"][0]["results"]) == total
    for file in files:
        suite = ElementTree.fromstring(junit_from([file]))[0]
        assert (suite.get("failures") != "0") == (file.report.count("error") > 0)


# ------------------------------------------------------------------------------------------------------- text


def test_a_finding_in_text_has_its_line_the_mark_below_it_and_the_way_on():
    first, *rest = text_from([judged(FAULTY, select=["S023"])]).splitlines()
    assert first == "map.urdf:3:60: error WK-S023: size of <box> has a comma: '1,2,3'"
    line, marks, hint, why = rest[:4]
    assert line.startswith("   3 | <!-- 壁 é -->")
    # the wide character takes two columns of the terminal
    assert marks.index("^") == line.index("1,2,3") + 1
    assert marks.count("^") == len("1,2,3")
    assert hint.startswith("  hint:  ")
    assert hint.endswith("[fix: safe]")
    assert why == "  why:   wallkit map explain WK-S023"
    assert rest[-1].startswith("1 error, 0 warnings, 0 infos; ")


def test_the_other_place_of_a_duplicate_is_named():
    text = text_from([judged(DUPLICATE)])
    assert "see also: 3:13 first defined here" in text
    assert "  why:   wallkit map explain WK-G001" in text


def test_rules_that_could_not_run_are_named_with_the_reason():
    file = judged(FAULTY)
    error = only(file.report.findings, "WK-S023")
    skipped = len(file.report.skipped)
    assert skipped > 0
    said = f"map.urdf: {skipped} rules could not run because of WK-S023 at {error.line}:{error.column}"
    assert said in text_from([file]).splitlines()
    assert [s["reason"] for s in json_from([file])["files"][0]["skipped"]] == [f"WK-S023 at {error.line}:60"] * skipped


def cells(text: str) -> str:
    """One letter per column of a terminal: wide characters take two, accents that join the one before none."""
    widths = (0 if unicodedata.combining(c) else 2 if unicodedata.east_asian_width(c) in "WF" else 1 for c in text)
    return "".join(c * width for c, width in zip(text, widths, strict=True))


@given(st.text("ab<\t壁ｗ\u0301\u3099é", min_size=1, max_size=400), st.data())
def test_marks_stand_below_what_is_marked(text, data):
    start = data.draw(st.integers(0, len(text) - 1))
    end = data.draw(st.integers(start + 1, len(text)))
    shown, marks = marked_line(Document("map", text.encode()), 1, start + 1, end + 1)
    assert re.fullmatch(r" *\^+", marks)
    assert len(shown) <= WIDTH + 2
    marked, expected = cells(shown)[marks.index("^") : len(marks)], cells(printable(text[start:end]))
    if expected:
        assert marked == expected[: len(marked)]
        assert len(marked) == len(expected) or len(shown.strip("…")) == WIDTH


def test_nothing_in_a_file_reaches_the_terminal_but_letters():
    evil = (
        robot('<link name="\u202eevil\u009b31m"><collision/></link>', '<link name="\u202eevil\u009b31m"/>')
        + b"\x1b]0;title\x07"
    )
    for name in ("text", "junit"):
        text = written(name, judged(evil), judged(evil.replace(b"\x1b]0;title\x07", b"")))
        assert not re.search("[\x00-\x09\x0b-\x1f\x7f-\x9f\u202e]", text)


def test_paint_is_given_the_severity_and_changes_only_what_it_paints():
    seen = []

    def paint(text, severity):
        seen.append(severity)
        return f"<{text}>"

    file = judged(FAULTY)
    painted = text_from([file], paint=paint)
    assert "<error WK-S023>: size" in painted
    assert set(seen) == {finding.severity for finding in file.report.findings}
    assert text_from([file], paint=lambda text, _: text) == text_from([file])


# ------------------------------------------------------------------------------------------------ JSON and SARIF


@pytest.mark.parametrize("data", [FAULTY, DUPLICATE], ids=["faulty", "duplicate"])
def test_the_edits_in_json_are_the_repair(data):
    file = judged(data)
    fixable = [f for f in file.report.findings if f.fix]
    assert fixable
    for finding in fixable:
        rows = json_from([file])["findings"]
        (row,) = [row for row in rows if row["fingerprint"] == finding.fingerprint]
        edits = [Edit(e["offset"], e["length"], e["text"].encode()) for e in row["fix"]["edits"]]
        assert apply_edits(data, edits) == apply_edits(data, finding.fix.edits)
        assert row["fix"]["class"] == finding.fix.kind == RULES[finding.code].fix


def test_json_places_are_bytes_lines_and_columns_of_the_same_text():
    row = only(json_from([judged(FAULTY)])["findings"], "WK-S023")
    assert FAULTY[row["byteOffset"] :][: row["byteLength"]] == b"1,2,3"
    line = FAULTY.decode().splitlines()[row["line"] - 1]
    assert line[row["column"] - 1 : row["endColumn"] - 1] == "1,2,3"
    assert row["xpath"] == "/robot/link[@name='a']/collision/geometry/box"


@pytest.mark.parametrize("head", [b"", b"\xef\xbb\xbf"], ids=["plain", "bom"])
@pytest.mark.parametrize("data", [FAULTY, DUPLICATE], ids=["faulty", "duplicate"])
def test_sarif_regions_are_characters_of_the_text(head, data):
    file = judged(head + data)
    text = data.decode()
    for finding in file.report.findings:
        if finding.code == "WK-X004":
            continue
        (result,) = [
            r
            for r in sarif_results(sarif_from([file]), finding.code)
            if r["partialFingerprints"]["wallkit/v1"] == finding.fingerprint
        ]
        region = result["locations"][0]["physicalLocation"]["region"]
        marked = text[region["charOffset"] :][: region["charLength"]]
        assert marked == (head + data)[finding.offset :][: finding.length].decode()
        lines = text[: region["charOffset"]].split("\n")
        assert (region["startLine"], region["startColumn"]) == (len(lines), len(lines[-1]) + 1)
        if not finding.fix:
            continue
        repaired = text
        for change in reversed(result["fixes"][0]["artifactChanges"][0]["replacements"]):
            deleted = change["deletedRegion"]
            at, end = deleted["charOffset"], deleted["charOffset"] + deleted["charLength"]
            repaired = repaired[:at] + change["insertedContent"]["text"] + repaired[end:]
        assert head + repaired.encode() == apply_edits(head + data, finding.fix.edits)


def test_sarif_names_the_rules_it_ran_and_those_that_could_not():
    file = judged(FAULTY)
    (run,) = sarif_from([file])["runs"]
    rules = run["tool"]["driver"]["rules"]
    assert [rule["id"] for rule in rules] == list(file.report.checked)
    for result in run["results"]:
        assert rules[result["ruleIndex"]]["id"] == result["ruleId"]
        assert result["level"] in LEVELS.values()
    notes = run["invocations"][0]["toolExecutionNotifications"]
    assert [note["associatedRule"]["id"] for note in notes] == [skip.code for skip in file.report.skipped]


def test_sarif_keeps_what_was_ignored_or_accepted_as_suppressed():
    ignoring = FAULTY.replace(
        b"</robot>", b'<link name="c d"><wk:ignore rule="S015" reason="painted on it"/></link></robot>'
    )
    file = judged(ignoring)
    accepted = file.accepting({only(file.report.findings, "WK-S023").fingerprint})
    document = sarif_from([accepted])
    kinds = {code: [s["kind"] for r in sarif_results(document, code) for s in r["suppressions"]] for code in RULES}
    assert kinds["WK-S015"] == ["inSource"]
    assert kinds["WK-S023"] == ["external"]
    assert sum(map(len, kinds.values())) == 2


def test_absolute_and_relative_paths_become_uris():
    for source, uri in (("a b/floor.urdf", "a%20b/floor.urdf"), ("/a b/floor.urdf", "file:///a%20b/floor.urdf")):
        result = sarif_from([judged(FAULTY, source)])["runs"][0]["results"][0]
        assert result["locations"][0]["physicalLocation"]["artifactLocation"]["uri"] == uri


# --------------------------------------------------------------------------------------------- JUnit and GitHub


def test_junit_has_a_case_for_every_rule_and_counts_what_fails():
    for is_strict, severities in ((False, {"error"}), (True, {"error", "warning"})):
        file = judged(FAULTY, is_strict=is_strict)
        (suite,) = ElementTree.fromstring(junit_from([file]))
        failing = {f.code for f in file.report.findings if f.severity in severities}
        assert {case.get("name") for case in suite if case.find("failure") is not None} == failing
        assert int(suite.get("failures")) == len(failing) > 0
        assert int(suite.get("skipped")) == len(suite.findall("testcase/skipped")) == len(file.report.skipped)
        assert int(suite.get("tests")) == len(suite) == len(file.report.checked) + len(file.report.skipped)
    assert "map.urdf:3:60: size of <box>" in suite.find("testcase[@name='WK-S023']/failure").text


def test_github_lines_are_commands_with_nothing_left_to_misread():
    file = judged(FAULTY.replace(b'"a"', b'"100%"'), "a,b:c.urdf")
    lines = github_from([file]).splitlines()
    assert len(lines) == len(file.report.grouped) + len(file.skipped_by_reason)
    for line in lines:
        assert re.fullmatch(r"::(error|warning|notice) file=a%2Cb%3Ac\.urdf,[^:]*::[^\n]+", line)
    assert any("line=3,col=63,endLine=3,endColumn=68,title=WK-S023::size of <box>" in line for line in lines)
    assert any("'100%25'" in line for line in lines)


# --------------------------------------------------------------------------------------------------- verdicts


def test_a_file_is_good_when_nothing_fails_and_nothing_was_kept_from_running():
    assert judged(robot()).is_good
    assert not judged(FAULTY).is_good
    warned = robot('<link name="a b"/>', placed("a b", "0 0 0"))
    assert judged(warned).is_good
    assert not judged(warned, is_strict=True).is_good
    # nothing selected has a finding, but nothing selected ran either
    blind = judged(FAULTY, select=["G"])
    assert blind.report.findings == ()
    assert not blind.is_good


def test_what_is_accepted_no_longer_fails_and_what_waited_for_it_neither():
    file = judged(FAULTY)
    left = file.accepting({f.fingerprint for f in file.report.findings if f.severity == "error"})
    assert [f.code for f in left.accepted] == ["WK-S023"]
    assert "error" not in {f.severity for f in left.report.findings}
    assert left.is_good
    assert not file.accepting(set()).is_good


def test_an_accepted_finding_is_known_again_wherever_it_moves():
    before = {f.fingerprint for f in judged(FAULTY).report.findings}
    moved = FAULTY.replace(b'<link name="map"/>', b'\n\n<!-- new -->\n<link name="map"/>')
    assert {f.fingerprint for f in judged(moved).report.findings} == before
