"""The editing verbs of `wallkit map`: patches, words, warnings, refusals; and a restroom built by commands alone."""

from __future__ import annotations

import subprocess

import numpy as np
import pytest

from tests.e2e.conftest import Done
from tests.maps.floor import CUT, FLOOR, JUDGED, SPLIT
from wallkit.cli.app import main
from wallkit.maps.document import wk
from wallkit.maps.edit.verbs import VERBS
from wallkit.maps.read import load_map
from wallkit.maps.rules import RULES, validate
from wallkit.maps.rules.base import Problem, Rule

EXAMPLES: dict[str, tuple[bytes, list[str]]] = {
    "add wall": (FLOOR, ["wall_x", "--from", "3,3.6", "--to", "4.05,3.6", "--thickness", "10cm", "--height", "2.5"]),
    "add door": (FLOOR, ["--in", "wall_e", "--at", "0.5", "--width", "900mm", "--swing", "in", "--hinge", "right"]),
    "add window": (FLOOR, ["--in", "wall_n", "--at", "1", "--width", "1.2"]),
    "add fixture": (FLOOR, ["trash", "bin", "--pose", "1,1,90deg"]),
    "add room": (
        FLOOR.replace(b'id="hall"', b'id="h"').replace(b"hall", b"h"),
        ["nook", "--floor", "9 9  10 9  10 10"],
    ),
    "add class": (FLOOR, ["locker", "--seg", "7", "--seg", "8", "--movable"]),
    "array": (FLOOR, ["urinal_1", "--count", "3", "--pitch", "-75cm"]),
    "move": (FLOOR, ["sink_1", "--by", "0.1,0"]),
    "rotate": (FLOOR, ["sink_1", "--by", "180deg"]),
    "rename": (FLOOR, ["wall_mid", "wall_m"]),
    "remove": (FLOOR, ["sink_1", "urinal_1"]),
    "reparent": (FLOOR, ["sink_1", "--to", "wall_e"]),
    "snap": (FLOOR.replace(b'4.05 0 0" rpy="0 0 1.5707963', b'4.05 0 0" rpy="0 0 1.5657963'), []),
    "cut": (FLOOR, ["wall_s", "--at", "0.5", "--width", "1", "--height", "2.1"]),
    "fill": (CUT, ["p1"]),
    "split": (FLOOR, ["wall_mid", "--at", "2.5"]),
    "join": (SPLIT, ["wall_mid", "wall_mid_b"]),
    "adopt": (FLOOR.replace(b'<wk:object class="sink"/>', b""), []),
    "scale": (FLOOR, ["1000"]),
    "origin": (FLOOR, ["--to", "1,0,90deg"]),
    "set": (FLOOR, ["door_1", "prior=closed:0.5 open:0.5", "upper=1.2"]),
}


@pytest.fixture
def run_here(tmp_path, monkeypatch, capsys):
    """Runs `wallkit map WORDS...` in an empty folder and in this process."""
    monkeypatch.chdir(tmp_path)

    def run(*words: object) -> Done:
        with pytest.raises(SystemExit) as ended:
            main(["map", *(str(word) for word in words)])
        streams = capsys.readouterr()
        return Done(int(ended.value.code or 0), streams.out, streams.err)

    return run


def test_every_verb_has_an_example():
    assert set(EXAMPLES) == set(VERBS)


@pytest.mark.parametrize("verb", VERBS)
def test_a_dry_run_prints_the_patch_of_what_a_run_writes(verb, run_here, tmp_path):
    data, words = EXAMPLES[verb]
    file = tmp_path / "t.urdf"
    file.write_bytes(data)
    command = [*verb.split(), "t.urdf", *words]
    dry = run_here(*command, "--dry-run")
    assert (dry.code, file.read_bytes()) == (0, data)
    assert run_here(*command, "--dry-run") == dry
    (tmp_path / "the.patch").write_text(dry.out)
    document = run_here(*command, "--dry-run", "--json").json
    assert document["written"] is False
    done = run_here(*command)
    after = file.read_bytes()
    assert done.code == 0
    assert after != data
    assert done.out.splitlines() == document["changes"]
    # the words of the dry run stand on the other stream, beside the same warnings
    assert done.out.splitlines() + done.err.splitlines() == dry.err.splitlines()
    assert len(done.err.splitlines()) == min(len(document["findings"]), 5) + (len(document["findings"]) > 5)
    file.write_bytes(data)
    subprocess.run(["git", "apply", "the.patch"], cwd=tmp_path, check=True)
    assert file.read_bytes() == after
    assert [path.name for path in tmp_path.iterdir() if path.name.startswith(".")] == []


def test_a_restroom_is_built_by_commands_alone(run_here, tmp_path):
    """new, add and array: at the end no error and no warning, and everything where it was put."""
    file = "wc.wkmap.urdf"
    for words in (
        ("new", file, "--template", "room", "--size", "6,4", "--name", "wc"),
        ("rename", file, "room", "wc"),
        ("set", file, "wc", "kind=restroom"),
        ("add", "wall", file, "wall_in", "--from", "3.6,-0.06", "--to", "3.6,4.06"),
        ("set", file, "wc", "floor=0 0  3.54 0  3.54 4  0 4"),
        ("add", "room", file, "lobby", "--kind", "lobby", "--at", "5,2"),
        ("add", "door", file, "door_in", "--in", "wall_in", "--at", "0.4", "--width", "0.9", "--swing", "lobby"),
        ("add", "window", file, "--in", "wall_n", "--at", "4.4", "--width", "1.2"),
        ("add", "fixture", file, "urinal", "--in", "wall_w", "--at", "0.9"),
        ("array", file, "urinal_1", "--count", "4", "--pitch", "0.75"),
        ("add", "fixture", file, "sink", "--in", "wall_in", "--at", "2.2", "--side", "wc"),
        ("array", file, "sink_1", "--count", "2", "--pitch", "80cm"),
        ("add", "fixture", file, "mirror", "--in", "wall_in", "--at", "2.6", "--side", "wc", "--size", "0.006,1.4,0.8"),
        ("add", "fixture", file, "trash", "--pose", "3.3,3.7"),
        ("cut", file, "wall_e", "--at", "2.5", "--width", "1", "--height", "2.1"),
        ("add", "door", file, "exit", "--in", "wall_e", "--opening", "p1", "--swing", "out"),
    ):
        done = run_here(*words)
        assert done.code == 0, (words, done.err)
    report = validate(tmp_path / file, select=JUDGED)
    assert [f.message for f in report.findings if f.severity != "info"] == []
    listed = {row["link"]: row for row in run_here("ls", file, "--json").json["elements"]}
    assert listed["urinal_4"]["y_m"] - listed["urinal_1"]["y_m"] == pytest.approx(3 * 0.75)
    assert listed["door_in"]["rooms"] == ["wc", "lobby"]
    assert run_here("validate", file, "--strict", "--select", ",".join(JUDGED)).code == 0


@pytest.mark.parametrize(
    ("template", "more"),
    [
        ("room", ("--size", "5,4")),
        ("room", ("--size", "1.2,1", "--thickness", "8cm")),
        ("room", ("--size", "20,30", "--height", "4")),
        ("corridor", ("--size", "12,2")),
        ("corridor", ("--size", "60,1.2")),
        ("restroom", ()),
        ("restroom", ("--size", "3,3", "--toilets", "0", "--urinals", "0", "--sinks", "0")),
        ("restroom", ("--size", "8,4.5", "--toilets", "5", "--urinals", "4", "--sinks", "4", "--corridor", "1.5")),
        ("restroom", ("--size", "4,4", "--toilets", "1", "--urinals", "1", "--sinks", "1", "--thickness", "0.2")),
    ],
)
def test_a_template_is_valid_without_a_warning(template, more, run_here, tmp_path):
    done = run_here("new", "a.wkmap.urdf", "--template", template, *more)
    assert done.code == 0, done.err
    report = validate(tmp_path / "a.wkmap.urdf")
    assert [f.message for f in report.findings if f.severity != "info"] == []
    assert report.skipped == ()


def test_a_dry_run_of_new_prints_a_patch_that_makes_the_file(run_here, tmp_path):
    done = run_here("new", "a.wkmap.urdf", "--template", "restroom", "--dry-run")
    assert not (tmp_path / "a.wkmap.urdf").exists()
    (tmp_path / "the.patch").write_text(done.out)
    subprocess.run(["git", "apply", "the.patch"], cwd=tmp_path, check=True)
    made = (tmp_path / "a.wkmap.urdf").read_bytes()
    assert run_here("new", "a.wkmap.urdf", "--template", "restroom", "--overwrite").code == 0
    assert (tmp_path / "a.wkmap.urdf").read_bytes() == made


def test_an_empty_template_says_that_it_is_ambiguous_on_purpose(run_here, tmp_path, monkeypatch):
    def always(context):
        yield Problem(context.root.find(wk("map")), "all poses are ambiguous")

    monkeypatch.setitem(RULES, "WK-L003", Rule("WK-L003", "error", always))
    done = run_here("new", "a.wkmap.urdf")
    assert "WK-L003 ignored for now: as yet nothing stands in it" in done.out
    report = validate(tmp_path / "a.wkmap.urdf", select=["L003", "S", "X"])
    assert [finding.code for finding in report.findings] == []
    assert [finding.code for finding in report.ignored] == ["WK-L003"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("new", "t.urdf"), "exists"),
        (("new", "n.urdf", "--size", "1,4"), "the door needs 1.2 m, there are 1 m"),
        (("new", "n.urdf", "--size", "5"), "'5' has 1 numbers, 2 are wanted"),
        (("new", "n.urdf", "--size", "-5,4"), "a length of -5 m"),
        (("new", "n.urdf", "--template", "restroom", "--toilets", "9"), "9 toilets need"),
        (("new", "n.urdf", "--scan-plane", "3"), "the scan plane is 3 m up"),
        (("move", "t.urdf", "sink_1"), "one of --by X,Y, --to X,Y and --along M"),
        (("move", "t.urdf", "sink_1", "--by", "1,x"), "'x' is no length: metres, or 900mm"),
        (("move", "t.urdf", "sink_1", "--by", "1,nan"), "'nan' is no length"),
        (("rotate", "t.urdf", "sink_1", "--by", "90"), "90 rad is 14.3 turns"),
        (("add", "fixture", "t.urdf", "sink", "--pose", "1,1,90"), "degrees are written 90deg"),
        (("array", "t.urdf", "sink_1", "--count", "2"), "one of --pitch M and --step X,Y"),
        (("set", "t.urdf", "sink_1", "class"), "'class' is not KEY=VALUE"),
        (("adopt", "t.urdf", "--class", "sink_1"), "'sink_1' is not NAME=CLASS"),
        (("cut", "t.urdf", "wall_s", "--at", "1"), "say where"),
        (("add", "door", "t.urdf", "--in", "wall_s"), "say where"),
        (("add", "room", "t.urdf", "x", "--floor", "1 2 3"), "no list of corners"),
        (("origin", "t.urdf", "--to", "1,2", "--to-corner"), "the same thing twice"),
        (("snap", "t.urdf", "--no-gaps", "--no-angles"), "nothing is left to do"),
        (("move", "none.urdf", "a", "--by", "1,1"), "cannot read the map"),
        (("move", "broken.urdf", "a", "--by", "1,1"), "broken.urdf:1:1: cannot be parsed"),
    ],
)
def test_what_cannot_be_done_is_said_and_nothing_is_written(words, said, run_here, tmp_path):
    (tmp_path / "t.urdf").write_bytes(FLOOR)
    (tmp_path / "broken.urdf").write_bytes(b"<robot")
    done = run_here(*words)
    assert (done.code, done.out) == (2, "")
    assert said in done.err
    assert "Traceback" not in done.err
    assert (tmp_path / "t.urdf").read_bytes() == FLOOR
    assert {path.name for path in tmp_path.iterdir()} == {"t.urdf", "broken.urdf"}


@pytest.mark.parametrize("yaw", ["1.57", "1.5708", "90deg", "1.5707963267948966rad"])
def test_a_rounded_right_angle_is_a_right_angle(yaw, run_here, tmp_path):
    (tmp_path / "t.urdf").write_bytes(FLOOR)
    assert run_here("add", "fixture", "t.urdf", "furniture", "desk", "--pose", f"1.5,3,{yaw}").code == 0
    assert load_map(tmp_path / "t.urdf").joints["at_desk"].T_parent_child[:2, :2] == pytest.approx(
        np.array([[0, -1], [1, 0]]), abs=1e-5
    )


def test_an_edit_warns_of_what_it_breaks_and_of_nothing_else(run_here, tmp_path):
    (tmp_path / "t.urdf").write_bytes(FLOOR.replace(b'class="sink"', b'class="snk"'))
    done = run_here("move", "t.urdf", "urinal_1", "--by", "-0.03,0")
    assert done.code == 0
    assert done.err.startswith("warning: t.urdf:")
    assert done.err.count("warning:") == 1
    assert "new error WK-E010: urinal 'urinal_1' stands 30 mm deep in 'wall_w.run'" in done.err
    assert run_here("move", "t.urdf", "urinal_1", "--by", "0.03,0").err == ""


def test_opening_and_door_move_along_their_wall(run_here, tmp_path):
    (tmp_path / "t.urdf").write_bytes(FLOOR)
    done = run_here("move", "t.urdf", "d1", "--along", "30cm")
    assert done.out.splitlines() == [
        "opening d1: along 1 1.9 -> 1.3 2.2 in wall_mid",
        "door_1: with it, at 1.31 0.05 0 in wall_mid",
    ]
    assert run_here("validate", "t.urdf", "--strict", "--select", ",".join(JUDGED)).code == 0
    assert "would overlap" not in run_here("move", "t.urdf", "d1", "--along", "-0.3").err
    assert "'door_1' fills opening 'd1'" in run_here("move", "t.urdf", "door_1", "--along", "0.3").err
