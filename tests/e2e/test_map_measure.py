"""`wallkit map measure` and `tree`."""

from __future__ import annotations

import pytest

from tests.e2e.conftest import Done
from tests.maps.drawn import box, placed, ring, robot
from wallkit.cli.app import main

FLOOR = "0.05 0.05  3.95 0.05  3.95 2.95  0.05 2.95"
HEADER = f'<wk:map format="1.0" units="m rad" level="1"><wk:room id="hall" floor="{FLOOR}"/></wk:map>'
ROOM = robot(
    HEADER,
    *ring("w", 0, 0, 4, 3),
    box("desk", "1 0.6 0.7", at="0 0 0.35", wk_class="furniture"),
    placed("desk", "2 2 0"),
    box("lamp", "0.1 0.1 0.3", at="0 0 0.15", wk_class="furniture"),
    placed("lamp", "0 0 0.7", parent="desk"),
)


@pytest.fixture
def run_here(tmp_path, monkeypatch, capsys):
    """Runs `wallkit map WORDS...` in this process and in a folder with room.urdf."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "room.urdf").write_bytes(ROOM)

    def run(*words: object) -> Done:
        with pytest.raises(SystemExit) as ended:
            main(["map", *(str(word) for word in words)])
        streams = capsys.readouterr()
        return Done(int(ended.value.code or 0), streams.out, streams.err)

    return run


def test_measure_says_distance_width_and_angle(run_here):
    done = run_here("measure", "room.urdf", "w_s", "w_n")
    assert done.code == 0
    assert "surfaces  2.900 m" in done.out
    assert "clear     2.900 m, along 4.100 m" in done.out
    found = run_here("measure", "room.urdf", "w_s", "w_w", "--json").json
    assert found["angle_rad"] == pytest.approx(1.5707963, abs=1e-6)
    assert run_here("measure", "room.urdf", "--", "-1,1", "2,1").out.splitlines()[1].startswith("frames    3.000 m")


def test_measure_says_how_large_a_room_is(run_here):
    done = run_here("measure", "room.urdf", "--area", "hall")
    assert "area      11.310 m2, perimeter 13.600 m" in done.out
    assert "free      10.710 m2" in done.out
    assert run_here("measure", "room.urdf", "desk").out.startswith("link desk\nsize      1.000 x 0.600 m, 0.700 m high")


def test_measure_says_what_it_cannot_do(run_here):
    for words, said in (
        (("room.urdf",), "name one thing"),
        (("room.urdf", "w_s", "--area", "hall"), "name one thing"),
        (("room.urdf", "w_x", "w_s"), "did you mean 'w_"),
        (("room.urdf", "--area", "w_s"), "there is no 'room:w_s'"),
    ):
        done = run_here("measure", *words)
        assert (done.code, done.out) == (2, ""), words
        assert said in done.err


def test_tree_shows_what_hangs_on_what(run_here):
    lines = run_here("tree", "room.urdf").out.splitlines()
    assert lines[0] == "map"
    assert lines[-2:] == ["└─ desk [furniture]", "   └─ lamp [furniture]"]
    assert len(lines) == 7
    assert len(run_here("tree", "room.urdf", "--depth", "1").out.splitlines()) == 6
