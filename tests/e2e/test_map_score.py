"""`wallkit map score` and `probe`: exit codes, streams and files, on a room drawn here."""

from __future__ import annotations

import json

import pytest

from tests.maps.drawn import box, placed, ring, robot
from wallkit.cli.app import main

ROOM = robot(
    '<wk:map format="1.0" units="m rad" level="1" scan_plane="0.3"/>',
    *ring("wall", 0, 0, 8, 5),
    box("p", "1.2 1.2 2", at="0 0 1", wk_class="column"),
    placed("p", "2.3 1.6 0"),
)


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    (tmp_path / "room.urdf").write_bytes(ROOM)
    (tmp_path / "flat.urdf").write_bytes(ROOM.replace(b' scan_plane="0.3"', b""))
    monkeypatch.chdir(tmp_path)

    def call(*words: object) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as ended:
            main([str(word) for word in words])
        streams = capsys.readouterr()
        return int(ended.value.code or 0), streams.out, streams.err

    return call


def test_score_says_it_in_words_json_and_a_picture(run, tmp_path):
    code, out, _ = run("map", "score", "room.urdf", "--poses", 80, "-o", "heat.svg")
    lines = out.splitlines()
    assert code == 0
    assert "poses are ambiguous by ranges alone" in lines[0]
    assert any("range 12 m (default), robot radius 0.25 m (default)" in line for line in lines)
    svg = (tmp_path / "heat.svg").read_text()
    assert "unique" in svg
    assert "of the floor is ambiguous" in svg
    code, out, _ = run("map", "score", "room.urdf", "--poses", 80, "--json", "--set", "rules.max_range_m=9")
    document = json.loads(out)
    assert document["robot"]["max_range_m"] == 9
    assert document["plain"]["typical_modes"] == 1
    assert document["poses"] <= 80
    assert document["seen_from"]["column"] > 0.9


def test_score_and_probe_say_what_they_cannot_do(run, tmp_path):
    (tmp_path / "there.png").write_bytes(b"")
    for words, said in (
        (("score", "none.urdf"), "none.urdf"),
        (("score", "flat.urdf"), "the height of the LiDAR's plane is unknown"),
        (("score", "room.urdf", "-o", "heat.pdf"), "is no picture's name"),
        (("score", "room.urdf", "-o", "there.png"), "exists"),
        (("score", "room.urdf", "--set", "rules.robot_radius_m=4"), "fits nowhere"),
        (("probe", "room.urdf", 2.3, 1.6, 0), "is inside 'p', a column"),
        (("probe", "room.urdf", -20, 1.6, 0), "is outside"),
    ):
        code, out, err = run("map", *words)
        assert (code, out) == (2, ""), words
        assert said in err
        assert "Traceback" not in err


def test_probe_lists_what_is_met(run, tmp_path):
    code, out, _ = run("map", "probe", "room.urdf", 6, 3.5, "-1.57", "-o", "scan.png")
    assert code == 0
    assert out.startswith("beams meet: wall ")
    assert "column" in out
    assert (tmp_path / "scan.png").read_bytes().startswith(b"\x89PNG")
    code, out, _ = run("map", "probe", "room.urdf", 6, 3.5, 0, "--json")
    beams = json.loads(out)["beams"]
    ahead = min(beams, key=lambda beam: abs(beam["bearing_rad"]))
    assert ahead["link"] == "wall_e"
    assert ahead["range_m"] == pytest.approx(1.95)
