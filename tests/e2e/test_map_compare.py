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
