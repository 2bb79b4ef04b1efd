"""`wallkit map`: exit codes, streams and files of its verbs, on maps drawn here."""

from __future__ import annotations

import json
import subprocess
from xml.etree import ElementTree

import pytest

from tests.e2e.conftest import Done
from tests.maps.drawn import box, placed, robot
from tests.maps.flat import flat_draft
from wallkit.cli.app import main
from wallkit.maps.draft.write import write_draft

HEADER = '<wk:map format="1.0" units="m rad" level="1" scan_plane="0.3">{}</wk:map>'
ROOM = '<wk:room id="hall" kind="hall" floor="0 0 4 0 4 3 0 3"/>'
SELECT = ("--select", "schema")
CLEAN = robot(
    HEADER.format(ROOM),
    box("bench", "1 0.4 0.4", at="0 0 0.2", wk_class="furniture"),
    placed("bench", "2 1 0", "0 0 1.570796"),
    box("pillar", "0.3 0.3 2.5", at="0 0 1.25", wk_class="column"),
    placed("pillar", "6 1 0"),
)
COMMA = CLEAN.replace(b"1 0.4 0.4", b"1,0.4,0.4")
SUFFIX = CLEAN.replace(b"1 0.4 0.4", b"1000mm 0.4 0.4")
WARNED = CLEAN.replace(b'"bench"', b'"the bench"')


@pytest.fixture
def here(tmp_path):
    """The folder the commands run in, with one file of each kind."""
    for name, data in (("clean", CLEAN), ("comma", COMMA), ("suffix", SUFFIX), ("warned", WARNED)):
        (tmp_path / f"{name}.urdf").write_bytes(data)
    return tmp_path


@pytest.fixture
def run_here(here, monkeypatch, capsys):
    """Runs `wallkit WORDS...` in that folder and in this process: most verbs take less time than starting one."""
    monkeypatch.chdir(here)

    def run(*words: object) -> Done:
        with pytest.raises(SystemExit) as ended:
            main([str(word) for word in words])
        streams = capsys.readouterr()
        return Done(int(ended.value.code or 0), streams.out, streams.err)

    return run


# ---------------------------------------------------------------------------------------------------- validate


def test_validate_exits_with_its_verdict(run_here, here):
    assert run_here("map", "validate", "clean.urdf", *SELECT, "--strict").code == 0
    assert run_here("map", "validate", "warned.urdf", *SELECT).code == 0
    assert run_here("map", "validate", "warned.urdf", *SELECT, "--strict").code == 1
    assert run_here("map", "validate", "clean.urdf", "comma.urdf", *SELECT).code == 1


def test_validate_says_what_it_could_not_do(run_here, here):
    for words, said in (
        (("none.urdf",), "Error: none.urdf: cannot read the map: No such file"),
        (("clean.urdf", "--select", "Z9"), "no map rule begins with 'Z9'"),
        (("clean.urdf", "--write-baseline"), "say where to"),
        (("clean.urdf", "--baseline", "clean.urdf"), "clean.urdf: is no baseline"),
        (("clean.urdf", "--set", "rules.dept=3"), "did you mean 'depth'?"),
        ((), "no file is named, and none here ends in .wkmap.urdf"),
    ):
        done = run_here("map", "validate", *words)
        assert (done.code, done.out) == (2, ""), words
        assert said in done.err
        assert "Traceback" not in done.err


def test_validate_prints_the_finding_with_line_mark_hint_and_sums(run_here, here):
    done = run_here("map", "validate", "comma.urdf", *SELECT)
    line = COMMA.decode().splitlines()[3]
    column = line.index("1,0.4") + 1
    first, shown, marks, hint, why, *_, skipped, sums = done.out.splitlines()
    assert first == f"comma.urdf:4:{column}: error WK-S023: size of <box> has a comma: '1,0.4,0.4'"
    assert marks.index("^") == shown.index("1,0.4,0.4")
    assert hint.endswith("[fix: safe]")
    assert why == "  why:   wallkit map explain WK-S023"
    assert skipped.endswith(f"could not run because of WK-S023 at 4:{column}")
    assert sums.startswith("1 error, 0 warnings, 0 infos; ")
    assert done.err == ""


def test_validate_without_files_takes_the_settings_map_then_those_lying_here(run_here, here):
    (here / "b.wkmap.urdf").write_bytes(CLEAN)
    (here / "a.wkmap.urdf").write_bytes(COMMA)
    files = [row["file"] for row in run_here("map", "validate", "--json").json["files"]]
    assert files == ["a.wkmap.urdf", "b.wkmap.urdf"]
    (here / "wallkit.toml").write_text('map = "warned.urdf"\n')
    assert [row["file"] for row in run_here("map", "validate", "--json").json["files"]] == ["warned.urdf"]


def test_validate_takes_its_limits_from_the_settings(run_here, here):
    """A chain of one joint is deeper than depth 1 only where that is asked for."""
    chain = CLEAN.replace(
        b'type="fixed"><parent link="map"/><child link="pillar"/>',
        b'type="fixed"><parent link="bench"/><child link="pillar"/>',
    )
    (here / "chain.urdf").write_bytes(chain)
    assert run_here("map", "validate", "chain.urdf", "--select", "G009", "--strict").code == 0
    (here / "wallkit.toml").write_text("[rules]\ndepth = 1\n")
    assert run_here("map", "validate", "chain.urdf", "--select", "G009", "--strict").code == 1


def test_every_format_is_one_document_of_its_kind(run_here, here):
    words = ("map", "validate", "comma.urdf", "warned.urdf", *SELECT, "--format")
    assert run_here(*words, "json").json["schema"] == 1
    sarif = run_here(*words, "sarif").json
    assert (sarif["version"], len(sarif["runs"])) == ("2.1.0", 1)
    suites = ElementTree.fromstring(run_here(*words, "junit").out)
    assert [suite.get("name") for suite in suites] == ["comma.urdf", "warned.urdf"]
    assert run_here(*words, "github").out.startswith("::error file=comma.urdf,line=4,")


def test_colour_where_it_is_asked_for(run_here, here):
    painted = run_here("map", "validate", "comma.urdf", *SELECT, "--color", "always")
    assert "\x1b[31merror WK-S023" in painted.out


def test_a_baseline_accepts_what_is_there_and_nothing_new(run_here, here):
    words = ("map", "validate", "warned.urdf", *SELECT, "--strict", "--baseline", "sub/accepted.json")
    (here / "sub").mkdir()
    assert run_here(*words, "--write-baseline").code == 0
    # the same finding on another line is the same finding, a second one is not
    (here / "warned.urdf").write_bytes(WARNED.replace(b"<wk:map", b"\n\n<wk:map"))
    done = run_here(*words)
    assert (done.code, "1 in the baseline" in done.out) == (0, True)
    (here / "warned.urdf").write_bytes(WARNED.replace(b'"pillar"', b'"the pillar"'))
    done = run_here(*words)
    assert (done.code, done.out.count("WK-S015: ")) == (1, 1)
    (here / "warned.urdf").write_bytes(CLEAN)
    assert "sub/accepted.json: 1 finding no longer there" in run_here(*words).err
    # a baseline of another file says nothing about this one
    (here / "other.urdf").write_bytes(WARNED)
    assert run_here("map", "validate", "other.urdf", *words[3:]).code == 1


# ------------------------------------------------------------------------------------------- explain and rules


def test_explain_and_rules_tell_of_the_same_rules(run_here):
    rows = run_here("map", "rules", "--json").json["rules"]
    table = run_here("map", "rules").out.splitlines()
    assert [line.split()[0] for line in table[1:]] == [row["rule"] for row in rows]
    row = next(row for row in rows if row["rule"] == "WK-G001")
    done = run_here("map", "explain", "g001", "WK-S023")
    assert done.out.startswith(f"WK-G001 {row['title']}\n")
    assert "\nWK-S023 " in done.out
    assert {row["rule"][:4] for row in run_here("map", "rules", "G", "--json").json["rules"]} == {"WK-G"}
    missing = run_here("map", "explain", "G999")
    assert (missing.code, missing.out) == (2, "")
    assert "there is no map rule 'G999'" in missing.err


# --------------------------------------------------------------------------------------------------------- fix


def test_fix_makes_safe_repairs_once(run_here, here):
    done = run_here("map", "fix", "comma.urdf", "suffix.urdf")
    assert (here / "comma.urdf").read_bytes() == CLEAN
    assert (here / "suffix.urdf").read_bytes() == SUFFIX
    assert "comma.urdf:4:" in done.out
    assert "comma.urdf: 1 fixed" in done.out
    assert done.code == 1
    assert run_here("map", "fix", "comma.urdf").out.startswith("comma.urdf: 0 fixed")
    run_here("map", "fix", "suffix.urdf", "--fix", "moderate")
    assert (here / "suffix.urdf").read_bytes() == CLEAN.replace(b"1 0.4 0.4", b"1 0.4 0.4")


def test_a_dry_run_prints_the_patch_that_makes_the_repair(run_here, here):
    done = run_here("map", "fix", "suffix.urdf", "comma.urdf", "--fix", "moderate", "--dry-run")
    assert (here / "suffix.urdf").read_bytes() == SUFFIX
    (here / "the.patch").write_text(done.out)
    subprocess.run(["git", "apply", "the.patch"], cwd=here, check=True)
    assert (here / "suffix.urdf").read_bytes() == (here / "comma.urdf").read_bytes() == CLEAN
    assert "suffix.urdf: 1 would be fixed" in done.err


def test_risky_repairs_are_only_ever_shown(run_here, here):
    done = run_here("map", "fix", "comma.urdf", "--fix", "risky")
    assert (done.code, (here / "comma.urdf").read_bytes()) == (2, COMMA)
    assert "add --dry-run" in done.err


def test_fix_keeps_links_and_permissions(run_here, here):
    (here / "link.urdf").symlink_to("comma.urdf")
    (here / "comma.urdf").chmod(0o640)
    run_here("map", "fix", "link.urdf")
    assert (here / "link.urdf").is_symlink()
    assert (here / "comma.urdf").read_bytes() == CLEAN
    assert (here / "comma.urdf").stat().st_mode & 0o777 == 0o640
    assert sorted(path.name for path in here.iterdir() if path.name.startswith(".")) == []


# ------------------------------------------------------------------------------------------------- info and ls


def test_info_tells_what_was_drawn(run_here, here):
    found = run_here("map", "info", "clean.urdf", "--json").json
    assert found["classes"] == {"column": 1, "furniture": 1}
    assert found["rooms"] == [{"id": "hall", "kind": "hall", "area_m2": 12.0}]
    # the bench is turned by 90 degrees: 1 m along y at x = 2; the pillar ends at x = 6.15
    assert found["extent_m"] == pytest.approx([1.8, 0.5, 0.0, 6.15, 1.5, 2.5], abs=1e-4)
    assert (found["scan_plane_m"], found["links"], found["joints"]) == (0.3, 3, {"fixed": 2})
    lines = run_here("map", "info", "clean.urdf").out.splitlines()
    assert lines[0] == "map      t (clean.urdf)"
    assert "rooms    hall (hall, 12.0 m2)" in lines


def test_ls_lists_by_class_and_by_room(run_here, here):
    def links(*words):
        return [row["link"] for row in run_here("map", "ls", "clean.urdf", "--json", *words).json["elements"]]

    assert links() == ["bench", "pillar"]
    assert links("--room", "hall") == ["bench"]
    assert links("--room", "hall", "--class", "column") == []
    row = run_here("map", "ls", "clean.urdf", "--class", "furniture").out.splitlines()[1].split()
    assert row == ["bench", "furniture", "2.000", "1.000", "1.5708", "0.00", "...", "0.40", "map", "fixed", "hall"]
    for words, said in ((("--class", "colum"), "'column'"), (("--room", "hal"), "'hall'")):
        done = run_here("map", "ls", "clean.urdf", *words)
        assert (done.code, done.out) == (2, "")
        assert f"did you mean {said}?" in done.err


def test_info_and_ls_refuse_an_unsound_map_with_its_first_error(run_here, here):
    for verb in ("info", "ls"):
        done = run_here("map", verb, "comma.urdf")
        assert (done.code, done.out) == (2, "")
        assert "comma.urdf:4:" in done.err
        assert "WK-S023" in done.err


# ------------------------------------------------------------------------------------------------------ import

BOXES = """name,class,x,y,z,yaw,sx,sy,sz
wall_a,wall,2,0,1.25,0,4,0.1,2.5
wall_b,wall,2,3,1.25,0,4,0.1,2.5
"""


def test_import_writes_a_map_that_validates(run_here, here):
    (here / "boxes.csv").write_text(BOXES)
    dry = run_here("map", "import", "boxes.csv", "-o", "new.wkmap.urdf", "--units", "m", "--dry-run")
    assert (dry.code, (here / "new.wkmap.urdf").exists()) == (0, False), dry.err
    assert "would write new.wkmap.urdf: level 1, " in dry.out
    done = run_here("map", "import", "boxes.csv", "-o", "new.wkmap.urdf", "--units", "m", "--scan-plane", "0.4")
    assert done.code == 0
    assert "import.read" in done.out
    assert run_here("map", "validate", "new.wkmap.urdf", *SELECT).code == 0
    assert run_here("map", "info", "new.wkmap.urdf", "--json").json["scan_plane_m"] == 0.4
    again = run_here("map", "import", "boxes.csv", "-o", "new.wkmap.urdf", "--units", "m")
    assert (again.code, "new.wkmap.urdf: exists" in again.err) == (2, True)
    assert run_here("map", "import", "boxes.csv", "-o", "new.wkmap.urdf", "--units", "cm", "--overwrite").code != 2


def test_import_says_what_it_cannot_do(run_here, here):
    (here / "boxes.csv").write_text(BOXES)
    (here / "what.txt").write_text("hello\n")
    for words, said in (
        (("boxes.csv",), "say where to"),
        (("none.csv", "-o", "a.urdf"), "cannot read it"),
        (("what.txt", "-o", "a.urdf"), "nothing in it tells its format"),
        (("boxes.csv", "-o", "a.urdf", "--format", "xls"), "there is no importer 'xls'"),
    ):
        done = run_here("map", "import", *words)
        assert (done.code, done.out) == (2, ""), words
        assert said in done.err


@pytest.mark.data
def test_a_building_of_three_levels_becomes_three_maps(run_here, data, tmp_path):
    hotel = data / "maps/rmf/hotel.building.yaml"
    one = run_here("map", "import", hotel, "-o", "hotel.wkmap.urdf")
    assert (one.code, "is one file for 3 levels (L1, L2, L3)" in one.err) == (2, True)
    done = run_here("map", "import", hotel, "-o", "hotel", "--json")
    assert done.code == 0
    files = [row["file"] for row in done.json["files"]]
    assert files == [f"hotel/hotel_L{n}.wkmap.urdf" for n in (1, 2, 3)]
    assert run_here("map", "validate", *files, *SELECT).code == 0
    codes = {note["code"] for note in done.json["notes"]}
    assert codes >= {"import.read", "import.guessed", "import.skipped"}


@pytest.mark.data
def test_a_drawing_in_the_wrong_unit_is_a_bad_verdict_until_the_unit_is_given(run_here, data):
    pytest.importorskip("ezdxf", reason="the extra wallkit[dxf] is not installed")
    drawing = data / "maps/dxf/bishop_overland_floorplan.dxf"
    done = run_here("map", "import", drawing, "-o", "a.wkmap.urdf", "--dry-run", "--json")
    assert done.code == 1
    assert [note["code"] for note in done.json["notes"] if note["severity"] == "error"] == ["WK-E041"]
    assert run_here("map", "import", drawing, "-o", "a.wkmap.urdf", "--dry-run", "--units", "in").code == 0


@pytest.mark.data
def test_the_example_is_sound_and_is_listed(run_here, data):
    example = data / "maps/wkmap_example/restroom.wkmap.urdf"
    done = run_here("map", "validate", example, *SELECT, "--strict", "--json")
    assert (done.code, done.json["findings"]) == (0, [])
    rows = run_here("map", "ls", example, "--room", "restroom_m", "--json").json["elements"]
    assert {row["link"] for row in rows} >= {"wall_n", "wall_mid", "door_m", "toilet_1", "sink_1", "window_n"}
    assert "wall_s" not in {row["link"] for row in rows}


@pytest.mark.long
@pytest.mark.data
def test_no_faulty_file_brings_a_traceback(wallkit, data):
    files = sorted((data / "maps/malformed").glob("*/*.urdf"))
    done = wallkit("map", "validate", *files, "--json")
    assert (done.code, done.err) == (1, "")
    assert [row["file"] for row in done.json["files"]] == [str(path) for path in files]
    assert json.loads(done.out)["findings"]


# ------------------------------------------------------------------------------------------------------ export


@pytest.fixture
def flat_here(here):
    (here / "flat.wkmap.urdf").write_bytes(write_draft(flat_draft()))
    return here


def test_export_writes_whole_files_and_says_what_is_lost(run_here, flat_here):
    dry = run_here("map", "export", "flat.wkmap.urdf", "-o", "out/flat.yaml", "--dry-run")
    assert (dry.code, dry.err) == (0, "")
    assert "would write out/flat.pgm" in dry.out.replace("\\", "/")
    assert not (flat_here / "out").exists()
    done = run_here("map", "export", "flat.wkmap.urdf", "-o", "out/flat.yaml", "--doors", "open", "--json")
    assert done.code == 0
    assert sorted(path.name for path in (flat_here / "out").iterdir()) == ["flat.pgm", "flat.yaml"]
    assert [note["code"] for note in done.json["notes"]] == ["export.wrote", "export.taken", "export.lost"]
    assert {file["bytes"] for file in done.json["files"]} == {p.stat().st_size for p in (flat_here / "out").iterdir()}


@pytest.mark.parametrize("out", ["a.yaml", "a.urdf", "a.svg", "a.geojson", "a.sdf", "a.building.yaml"])
def test_export_replaces_only_what_it_is_told_to(run_here, flat_here, out):
    words = ("map", "export", "flat.wkmap.urdf", "-o", out)
    assert run_here(*words).code == 0
    before = (flat_here / out).read_bytes()
    again = run_here(*words)
    assert (again.code, again.err.count("exists")) == (2, 1)
    assert run_here(*words, "--overwrite").code == 0
    assert (flat_here / out).read_bytes() == before
    assert not list(flat_here.glob(".*partial*"))


def test_export_of_fields_keeps_to_its_folder(run_here, flat_here):
    words = ("map", "export", "flat.wkmap.urdf", "-o", "fields", "--format", "fields", "--resolution", "0.1")
    assert run_here(*words).code == 0
    assert {"fields.npz", "fields.json", "all.png", "door.png"} <= {p.name for p in (flat_here / "fields").iterdir()}
    # at 1.5 m there is no toilet: its old picture goes
    assert (flat_here / "fields/toilet.png").exists()
    assert run_here(*words, "--z", "1.5", "--overwrite").code == 0
    assert not (flat_here / "fields/toilet.png").exists()
    (flat_here / "fields/notes.txt").write_text("mine")
    refused = run_here(*words, "--overwrite")
    assert refused.code == 2
    assert "notes.txt" in refused.err
    assert (flat_here / "fields/notes.txt").read_text() == "mine"


def test_export_says_what_it_cannot_do(run_here, flat_here):
    (flat_here / "file").write_text("")
    (flat_here / "broken.urdf").write_text("<robot>")
    for words, says in (
        (("flat.wkmap.urdf",), "say where to"),
        (("flat.wkmap.urdf", "-o", "flat"), "its suffix does not tell the format"),
        (("flat.wkmap.urdf", "-o", "a.yaml", "--format", "xls"), "there is no exporter 'xls'"),
        (("flat.wkmap.urdf", "-o", "flat.wkmap.urdf", "--overwrite"), "is the map itself"),
        (("flat.wkmap.urdf", "-o", "a.sdf", "--z", "0.3"), "no use for --z"),
        (("flat.wkmap.urdf", "-o", "a.yaml", "--z", "7"), "nothing of the map is cut at 7 m"),
        (("flat.wkmap.urdf", "-o", "file", "--format", "fields"), "is a file"),
        (("flat.wkmap.urdf", "-o", "file/a.sdf"), "cannot be written"),
        (("missing.urdf", "-o", "a.sdf"), "cannot read the map"),
        (("broken.urdf", "-o", "a.sdf"), "WK-X001"),
    ):
        done = run_here("map", "export", *words)
        assert done.code == 2, words
        assert says in done.err, (words, done.err)
        assert "Traceback" not in done.err
