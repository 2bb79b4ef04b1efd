"""`wallkit map fmt`, `diff` and `merge`: exit codes, streams and files."""

from __future__ import annotations

import json

import pytest

from tests.e2e.conftest import Done
from tests.maps.drawn import box, placed, ring, robot
from wallkit.cli.app import main

HEADER = '<wk:map format="1.0" units="m rad" level="1" scan_plane="0.30"/>'
DESK = box("desk", "1 0.6 0.7", at="0 0 0.35", wk_class="furniture")
ROOM = robot(HEADER, "<!-- four walls -->", *ring("w", 0, 0, 4, 3), DESK, placed("desk", "2 2 0"))
MOVED = ROOM.replace(b'xyz="2 2 0"', b'xyz="2 1.5 0"')
RAISED = ROOM.replace(b'scan_plane="0.30"', b'scan_plane="0.4"')


@pytest.fixture
def run_here(tmp_path, monkeypatch, capsys):
    """Runs `wallkit map WORDS...` in this process and in a folder with a.urdf, b.urdf (desk moved), c.urdf and torn.urdf."""
    monkeypatch.chdir(tmp_path)
    for name, data in (("a", ROOM), ("b", MOVED), ("c", RAISED), ("torn", ROOM[:200])):
        (tmp_path / f"{name}.urdf").write_bytes(data)

    def run(*words: object) -> Done:
        with pytest.raises(SystemExit) as ended:
            main(["map", *(str(word) for word in words)])
        streams = capsys.readouterr()
        return Done(int(ended.value.code or 0), streams.out, streams.err)

    return run


def test_fmt_checks_then_writes_then_is_content(run_here, tmp_path):
    assert run_here("fmt", "--check", "a.urdf").code == 1
    assert (tmp_path / "a.urdf").read_bytes() == ROOM
    patch = run_here("fmt", "a.urdf", "--dry-run")
    assert patch.code == 0
    assert patch.out.startswith("--- a/a.urdf")
    assert (tmp_path / "a.urdf").read_bytes() == ROOM
    assert run_here("fmt", "a.urdf").code == 0
    done = (tmp_path / "a.urdf").read_bytes()
    assert b"<!-- four walls -->" in done
    assert run_here("fmt", "--check", "a.urdf").code == 0
    assert run_here("fmt", "a.urdf").code == 0
    assert (tmp_path / "a.urdf").read_bytes() == done


def test_fmt_writes_none_when_one_cannot_be_read(run_here, tmp_path):
    done = run_here("fmt", "a.urdf", "torn.urdf")
    assert (done.code, done.out) == (2, "")
    assert "torn.urdf:" in done.err
    assert (tmp_path / "a.urdf").read_bytes() == ROOM


def test_diff_exits_with_its_verdict_and_says_it(run_here, tmp_path):
    same = run_here("diff", "a.urdf", "a.urdf")
    assert (same.code, same.out) == (0, "a.urdf and a.urdf mean the same\n")
    done = run_here("diff", "a.urdf", "b.urdf")
    assert (done.code, done.out) == (1, "desk moved 50.0 cm (y -0.500)\n")
    assert run_here("diff", "a.urdf", "b.urdf", "--tolerance", "0.6").code == 0
    (change,) = json.loads(run_here("diff", "a.urdf", "c.urdf", "--json").out)["changes"]
    assert (change["field"], change["before"], change["after"]) == ("scan_plane", "0.3", "0.4")
    assert run_here("diff", "a.urdf", "none.urdf").code == 2
    assert run_here("diff", "a.urdf", "torn.urdf").code == 2


def test_merge_writes_both_changes(run_here, tmp_path):
    done = run_here("merge", "a.urdf", "b.urdf", "c.urdf", "-o", "m.urdf")
    assert done.code == 0
    assert "taken from B: t: scan_plane 0.3 -> 0.4 m" in done.out
    assert (tmp_path / "m.urdf").read_bytes() == MOVED.replace(b'scan_plane="0.30"', b'scan_plane="0.4"')
    refused = run_here("merge", "a.urdf", "b.urdf", "c.urdf", "-o", "m.urdf")
    assert (refused.code, refused.out) == (2, "")
    assert run_here("merge", "a.urdf", "b.urdf", "c.urdf").code == 2


def test_merge_lists_conflicts_and_writes_only_when_told_whose_to_take(run_here, tmp_path):
    (tmp_path / "d.urdf").write_bytes(ROOM.replace(b'xyz="2 2 0"', b'xyz="1 1 0"'))
    done = run_here("merge", "a.urdf", "b.urdf", "d.urdf", "-o", "m.urdf")
    assert done.code == 1
    assert "2 1.5 0" in done.out
    assert "1 1 0" in done.out
    assert not (tmp_path / "m.urdf").exists()
    rows = json.loads(run_here("merge", "a.urdf", "b.urdf", "d.urdf", "--dry-run", "--json").out)
    assert (len(rows["conflicts"]), rows["merged"]) == (1, False)
    assert run_here("merge", "a.urdf", "b.urdf", "d.urdf", "-o", "m.urdf", "--theirs", "--dry-run").code == 0
    assert not (tmp_path / "m.urdf").exists()
    for flag, data in (("--ours", MOVED), ("--theirs", (tmp_path / "d.urdf").read_bytes())):
        assert run_here("merge", "a.urdf", "b.urdf", "d.urdf", "-o", "m.urdf", "--overwrite", flag).code == 0
        assert (tmp_path / "m.urdf").read_bytes() == data


def test_merge_refuses_to_leave_something_hanging(run_here, tmp_path):
    """A removes the desk, B puts a lamp on it."""
    desk = (DESK + "\n" + placed("desk", "2 2 0")).encode()
    lamp = box("lamp", "0.1 0.1 0.3", wk_class="furniture") + placed("lamp", "0 0 0.7", parent="desk")
    (tmp_path / "gone.urdf").write_bytes(ROOM.replace(desk, b""))
    (tmp_path / "lamp.urdf").write_bytes(ROOM.replace(b"</robot>", lamp.encode() + b"</robot>"))
    done = run_here("merge", "a.urdf", "gone.urdf", "lamp.urdf", "-o", "m.urdf", "--ours")
    assert done.code == 1
    assert "broken by the merge: WK-G004" in done.out
    assert not (tmp_path / "m.urdf").exists()


def test_merge_follows_what_the_verb_renamed(run_here, tmp_path):
    """`map rename` also renames the joint and the parts that are named after the link."""
    assert run_here("rename", "c.urdf", "desk", "table").code == 0
    for ours, theirs in (("b", "c"), ("c", "b")):
        done = run_here("merge", "a.urdf", f"{ours}.urdf", f"{theirs}.urdf", "-o", "m.urdf", "--overwrite")
        assert done.code == 0, done.out
        data = (tmp_path / "m.urdf").read_bytes()
        assert b"desk" not in data
        assert b'xyz="2 1.5 0"' in data
