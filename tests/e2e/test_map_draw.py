"""`wallkit map show`: files, streams and refusals."""

from __future__ import annotations

from xml.etree import ElementTree

import pytest

from tests.e2e.conftest import Done
from tests.maps.drawn import box, placed, ring, robot
from wallkit.cli.app import main

HEADER = '<wk:map format="1.0" units="m rad" level="1" scan_plane="0.3"/>'
ROOM = robot(
    HEADER,
    *ring("w", 0, 0, 4, 3),
    box("desk", "1 0.6 0.7", at="0 0 0.35", wk_class="furniture"),
    placed("desk", "2 2 0"),
)
PNG = b"\x89PNG\r\n\x1a\n"


@pytest.fixture
def run_here(tmp_path, monkeypatch, capsys):
    """Runs `wallkit map WORDS...` in this process and in a folder with room.urdf and broken.urdf."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setenv("LINES", "40")
    (tmp_path / "room.urdf").write_bytes(ROOM)
    (tmp_path / "broken.urdf").write_bytes(ROOM.replace(b'class="furniture"', b'class="furniture" colour="red"'))
    (tmp_path / "torn.urdf").write_bytes(ROOM[:300])

    def run(*words: object) -> Done:
        with pytest.raises(SystemExit) as ended:
            main(["map", *(str(word) for word in words)])
        streams = capsys.readouterr()
        return Done(int(ended.value.code or 0), streams.out, streams.err)

    return run


def test_show_writes_what_the_suffix_says_and_never_over_something(run_here, tmp_path):
    assert run_here("show", "room.urdf", "-o", "plan.svg").code == 0
    assert run_here("show", "room.urdf", "-o", "plan.png").code == 0
    ids = {element.get("id") for element in ElementTree.parse(tmp_path / "plan.svg").iter()}
    assert {"w_n", "w_s", "w_e", "w_w", "desk"} <= ids
    assert (tmp_path / "plan.png").read_bytes().startswith(PNG)
    before = (tmp_path / "plan.svg").read_bytes()
    done = run_here("show", "room.urdf", "-o", "plan.svg", "--z", "lidar")
    assert (done.code, done.out) == (2, "")
    assert "--overwrite" in done.err
    assert (tmp_path / "plan.svg").read_bytes() == before
    assert run_here("show", "room.urdf", "-o", "plan.svg", "--z", "lidar", "--overwrite").code == 0
    assert (tmp_path / "plan.svg").read_bytes() != before


def test_show_without_a_file_prints_letters_when_piped(run_here):
    done = run_here("show", "room.urdf")
    assert done.code == 0
    assert done.out.splitlines()[0].startswith("###")
    assert "f furniture" in done.out
    assert "\x1b" not in done.out
    assert "furniture" not in run_here("show", "room.urdf", "--z", "1.0").out
    assert "\x1b[" in run_here("show", "room.urdf", "--color", "always").out


def test_show_marks_findings_even_of_a_map_with_errors(run_here, tmp_path):
    refused = run_here("show", "broken.urdf", "-o", "plan.svg")
    assert refused.code == 2
    assert "WK-S011" in refused.err
    done = run_here("show", "broken.urdf", "-o", "plan.svg", "--findings")
    assert done.code == 0
    assert "WK-S011" in (tmp_path / "plan.svg").read_text()
    assert "WK-S011" in run_here("show", "broken.urdf", "--findings").out


def test_show_says_what_it_cannot_do(run_here, tmp_path):
    for words, said in (
        (("none.urdf",), "cannot read the map"),
        (("torn.urdf",), "WK-X001"),
        (("torn.urdf", "--findings"), "WK-X001"),
        (("room.urdf", "-o", "plan.pdf"), "end it in .svg or .png"),
        (("room.urdf", "--z", "high"), "'high' is no length: metres, or 900mm"),
        (("room.urdf", "-o", "no/such/plan.svg"), "cannot be written"),
    ):
        done = run_here("show", *words)
        assert (done.code, done.out) == (2, ""), words
        assert said in done.err
        assert "Traceback" not in done.err
    assert not list(tmp_path.glob("*.p*g"))


def test_a_dry_run_writes_nothing(run_here, tmp_path):
    done = run_here("show", "room.urdf", "-o", "plan.svg", "--dry-run")
    assert (done.code, done.out) == (0, "would write plan.svg\n")
    assert not (tmp_path / "plan.svg").exists()
