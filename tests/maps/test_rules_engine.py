"""The rule engine: order and skipping, selection, inline ignores, places, determinism, and examples that hold."""

from __future__ import annotations

import datetime
import random
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.maps.drawn import box, many_walls, placed, robot
from wallkit.errors import ConfigError, MapError
from wallkit.maps.document import apply_edits
from wallkit.maps.rules import PROFILES, RULES, explain, validate
from wallkit.maps.rules.base import PREREQUISITES
from wallkit.maps.rules.docs import doc_of, file_from_example, is_file

UNUSED_AND_USED = (
    '<link name="a b"><wk:ignore rule="WK-S015" reason="painted on the door"/></link>',
    placed("a b", "0 0 0"),
)


def codes(report, severity=None):
    return sorted({f.code for f in report.findings if severity is None or f.severity == severity})


# ---------------------------------------------------------------------------------------- every rule


@pytest.mark.parametrize("code", RULES)
def test_the_documented_example_of_a_rule_raises_it_and_its_good_twin_does_not(code):
    doc = doc_of(RULES[code])
    assert doc.title.endswith(".")
    assert doc.bad
    assert doc.good
    for example, raises in ((doc.bad, True), (doc.good, False)):
        if is_file(example):
            report = validate(file_from_example(example))
            assert (code in codes(report)) == raises, [str(f) for f in report.findings]
            assert code in report.checked or code == "WK-S016"


@pytest.mark.parametrize("code", RULES)
def test_explaining_a_rule_tells_title_severity_and_examples(code):
    text = explain(code.removeprefix("WK-").lower())
    doc = doc_of(RULES[code])
    assert text.startswith(f"{code} {doc.title}\n")
    assert RULES[code].severity in text.splitlines()[2]
    assert doc.bad.splitlines()[0] in text


def test_the_repair_of_an_example_removes_its_finding_and_breaks_nothing_that_was_sound():
    repaired = []
    for code, rule in RULES.items():
        example = doc_of(rule).bad
        if rule.fix is None or not is_file(example):
            continue
        before = validate(file_from_example(example))
        findings = [f for f in before.findings if f.code == code and f.fix is not None]
        if not findings:
            continue
        assert {f.fix.kind for f in findings} == {rule.fix}
        after = validate(apply_edits(file_from_example(example), findings[0].fix.edits))
        assert sum(f.code == code for f in after.findings) == len(findings) - 1, code
        assert not set(codes(after, "error")) & set(before.checked) - set(codes(before, "error")), code
        repaired.append(code)
    assert {"WK-X002", "WK-S002", "WK-S023", "WK-S024", "WK-G001", "WK-G004", "WK-G021", "WK-G023"} <= set(repaired)


# --------------------------------------------------------------------------------------- order, skipping


def test_an_error_skips_what_builds_on_it_and_says_so():
    report = validate(robot(box("a", "1 1 x"), placed("a", "0 0 0")))
    assert codes(report, "error") == ["WK-S021"]
    skipped = {skip.code: skip.reason for skip in report.skipped}
    expected = {code for code, rule in RULES.items() if "S" in PREREQUISITES[code[3]] and not rule.needs_log}
    assert set(skipped) == expected
    (error,) = (f for f in report.findings if f.code == "WK-S021")
    assert set(skipped.values()) == {f"WK-S021 at {error.line}:{error.column}"}
    assert not expected & set(report.checked)
    assert not report.is_clean


def test_an_error_that_leaves_sound_ground_skips_nothing():
    report = validate(b'<robot><link name="a"/><link name="a"/></robot>')
    assert codes(report, "error") == ["WK-G001", "WK-S003"]
    assert not [skip for skip in report.skipped if skip.code.startswith("WK-G")]


def test_what_is_selected_still_waits_for_what_it_builds_on():
    unsound = robot('<link name="a"><collision/></link>', placed("a", "0 0 0"))
    report = validate(unsound, select=["G001"])
    assert report.findings == ()
    assert [skip.code for skip in report.skipped] == ["WK-G001"]
    assert report.skipped[0].reason.startswith("WK-S020")
    assert codes(validate(unsound, select=["S"], ignore=["WK-S020", "S004"])) == []
    assert validate(b"<broken", select=["S"]).map is None


def test_an_unselected_rule_that_blocks_nothing_does_not_run(monkeypatch):
    def never(context):
        raise AssertionError("it ran")

    monkeypatch.setitem(RULES, "WK-L003", replace(RULES["WK-L003"], check=never))
    assert "WK-L003" not in validate(robot(box("a", "4 0.1 2"), placed("a", "0 0 1")), ignore=["L003"]).checked


def test_selectors_that_name_no_rule_are_refused():
    for selector in ("Z", "WK-G999", "", "WK-"):
        with pytest.raises(ConfigError, match="no map rule"):
            validate(robot(), select=[selector])
    with pytest.raises(ConfigError):
        explain("WK-G999")
    for selectors in PROFILES.values():
        validate(robot(), select=selectors)


def test_a_file_that_cannot_be_opened_is_one_clear_error(tmp_path):
    with pytest.raises(MapError, match="cannot read the map"):
        validate(tmp_path / "none.urdf")


# --------------------------------------------------------------------------------------- inline ignores


def test_an_inline_ignore_takes_out_its_rule_inside_its_element_only():
    elsewhere = ('<link name="c d"/>', placed("c d", "0 0 0"))
    report = validate(robot(*UNUSED_AND_USED, *elsewhere), select=["S015", "S016"])
    assert [f.code for f in report.ignored] == ["WK-S015"]
    # the link of the second, and both joints, which stand outside the first
    assert [f.message.split("'")[1] for f in report.findings] == ["at_a b", "c d", "at_c d"]


def test_an_ignore_without_reason_is_not_honoured_and_an_ended_one_not_any_more():
    text = robot('<link name="a b"><wk:ignore rule="WK-S015" reason="x" until="2026-06-30"/></link>')
    assert codes(validate(text, select=["S015", "S016"], today=datetime.date(2026, 6, 30))) == []
    assert codes(validate(text, select=["S015", "S016"], today=datetime.date(2026, 7, 1))) == ["WK-S015"]
    assert "WK-S015" in codes(validate(robot('<link name="a b"><wk:ignore rule="WK-S015" reason=" "/></link>')))


def test_an_unused_ignore_is_told_but_not_when_its_rule_could_not_run():
    text = '<link name="a"><wk:ignore rule="WK-G010 WK-S015" reason="x"/></link>'
    report = validate(robot(text, placed("a", "0 0 0")))
    assert [f.message for f in report.findings if f.code == "WK-S016"] == [
        "nothing of WK-G010 is found here to ignore",
        "nothing of WK-S015 is found here to ignore",
    ]
    blocked = validate(robot(text, '<link name="b"><collision/></link>'))
    assert [f.message for f in blocked.findings if f.code == "WK-S016"] == [
        "nothing of WK-S015 is found here to ignore"
    ]


def test_an_ignored_error_still_leaves_no_ground_for_later_groups():
    text = robot('<link name="a"><wk:ignore rule="S020" reason="x"/><collision/></link>')
    report = validate(text)
    assert "WK-S020" not in codes(report)
    assert {skip.code for skip in report.skipped} >= {"WK-G001"}


# ------------------------------------------------------------------------------------------ places, order


def test_a_finding_marks_its_bytes_and_carries_everything():
    data = robot('<link name="ä"/><link name="ä"/>', placed("ä", "0 0 0"))
    (finding,) = validate(data, source="maps/a.urdf", select=["G001"]).findings
    assert (finding.file, finding.line, finding.column, finding.end_column) == ("maps/a.urdf", 3, 29, 30)
    assert data[finding.offset : finding.offset + finding.length].decode() == "ä"
    assert finding.xpath == "/robot/link[3]"
    (related,) = finding.related
    assert (related.message, related.line, related.column) == ("first defined here", 3, 13)
    assert str(finding).startswith("maps/a.urdf:3:29: error WK-G001 there are two links 'ä'")
    repaired = apply_edits(data, finding.fix.edits)
    assert repaired == data.replace(
        '<link name="ä"/><link name="ä"/>'.encode(), '<link name="ä"/><link name="ä_2"/>'.encode()
    )


def test_fingerprints_outlive_new_lines_and_tell_findings_apart():
    pieces = [f'<link name="l {k}"/>' for k in range(3)]
    plain, moved = (validate(robot(*more, *pieces), select=["S015"]).findings for more in ([], ["<!-- -->\n\n"]))
    assert [f.fingerprint for f in plain] == [f.fingerprint for f in moved]
    assert [f.line for f in plain] != [f.line for f in moved]
    assert len({f.fingerprint for f in plain}) == 3


def test_findings_come_in_order_of_the_file_and_always_the_same():
    pieces = ['<link name="x y" q="1"/>', '<link name="z w"><collision/></link>', "<lnk/>"]
    report = validate(robot(*pieces))
    order = [(f.line, f.column, f.code) for f in report.findings]
    assert order == sorted(order)
    assert validate(robot(*pieces)) == report or validate(robot(*pieces)).findings == report.findings


def test_more_than_twenty_findings_of_a_rule_are_shown_as_one():
    pieces = [f'<link name="l {k}"/>' for k in range(21)]
    report = validate(robot(*pieces), select=["S015"])
    assert len(report.findings) == 21
    (shown,) = report.grouped
    assert shown.count == 21
    assert shown.message.endswith("(and 20 more of WK-S015)")
    fewer = validate(robot(*pieces[1:]), select=["S015"])
    assert fewer.grouped == fewer.findings


# -------------------------------------------------------------------------------------------- real files


@pytest.mark.data
def test_the_example_is_clean_and_the_apartment_has_its_two_stray_elements(data):
    report = validate(data / "maps/wkmap_example/restroom.wkmap.urdf", select=["X", "S", "G"])
    assert report.findings == ()
    assert report.skipped == ()
    apartment = validate(data / "maps/urdf_maps/iai_apartment/apartment.urdf", select=["X", "S", "G"])
    assert codes(apartment, "error") == []
    assert [(f.code, f.line) for f in apartment.findings if f.severity == "warning"] == [
        ("WK-S012", 8),
        ("WK-S012", 2075),
    ]


# -------------------------------------------------------------------------------------------- any bytes


@settings(max_examples=150, deadline=None)
@given(st.binary(max_size=120))
def test_no_bytes_make_the_rules_raise(data):
    report = validate(data)
    assert report.findings
    assert report.count("error") > 0


WORDS = ["1 2 3", "nan", "", "1e400", "-1", "a b", "map", "a", "é", "fixed", "revolute", "1,2", "2mm", "&amp;", "${x}"]
BITS = [
    *("link", "joint", "robot", "collision", "geometry", "box", "origin", "limit", "mimic", "axis", "parent", "child"),
    *(
        "wk:map",
        "wk:room",
        "wk:object",
        "wk:opening",
        "wk:state",
        "wk:ignore",
        "wk:class",
        "wk:check",
        "x:y",
        "nonsense",
    ),
]
KEYS = [
    *("name", "type", "link", "joint", "xyz", "rpy", "size", "lower", "upper", "class", "rule", "reason", "until"),
    *("id", "floor", "along", "z", "rest", "prior", "format", "units", "seg", "multiplier", "filename", "xmlns"),
]


@settings(max_examples=300, deadline=None)
@given(st.integers(0, 2**31))
def test_no_arrangement_of_the_formats_own_words_makes_the_rules_raise(seed):
    rng = random.Random(seed)

    def element(depth):
        keys = rng.sample(KEYS, rng.randrange(4))
        attributes = "".join(f' {key}="{rng.choice(WORDS)}"' for key in keys)
        inner = "".join(element(depth + 1) for _ in range(rng.randrange(4))) if depth < 4 else ""
        name = rng.choice(BITS)
        return f"<{name}{attributes}>{inner}</{name}>"

    data = robot(*(element(0) for _ in range(6)))
    report = validate(data)
    for finding in report.findings:
        assert 0 <= finding.offset <= finding.offset + finding.length <= len(data)
        assert finding.line is not None
        if finding.fix is not None:
            apply_edits(data, finding.fix.edits)


def test_a_thousand_walls_pass_the_first_groups():
    assert codes(validate(many_walls(1000), select=["X", "S", "G"])) == ["WK-S004"]
