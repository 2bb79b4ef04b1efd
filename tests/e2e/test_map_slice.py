"""`wallkit map slice`, `compat`, `validate --labels` and `validate floor.yaml`: exit codes, streams and files."""

from __future__ import annotations

import json

import pytest

from tests.e2e.conftest import Done
from tests.maps.drawn import box, placed, ring, robot
from wallkit.cli.app import main

ROOM = robot(
    '<wk:map format="1.0" units="m rad" level="1" scan_plane="0.3"/>',
    *ring("r", 0, 0, 4, 3),
    box("sink", "0.4 0.5 0.2", at="0.2 0 0.8", wk_class="sink"),
    placed("sink", "0.05 1.5 0"),
    box("bin", "0.3 0.3 0.33", at="0 0 0.165", wk_class="trash"),
    placed("bin", "2 1 0"),
)


@pytest.fixture
def run_here(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "room.urdf").write_bytes(ROOM)

    def run(*words: object) -> Done:
        with pytest.raises(SystemExit) as ended:
            main([str(word) for word in words])
        streams = capsys.readouterr()
        return Done(int(ended.value.code or 0), streams.out, streams.err)

    return run


def test_slice_says_what_is_seen_what_is_not_and_what_a_tilt_changes(run_here):
    done = run_here("map", "slice", "room.urdf")
    assert (done.code, done.err) == (0, "")
    assert "in the plane: 5 of 6 elements" in done.out
    assert "sink  sink   0.70 ... 0.90  above" in done.out
    assert "closed floor, doors closed: 1 (11.2 m2)" in done.out
    assert done.out.endswith("from 0.25 to 0.35 m:\n  bin (trash) begins or ends at 0.33 m\n")


def test_slice_as_json_at_another_height_with_its_picture(run_here, tmp_path):
    done = run_here("map", "slice", "room.urdf", "--z", "0.8", "--json", "-o", "seen.svg")
    table = json.loads(done.out)
    assert [row["link"] for row in table["out"]] == ["bin"]
    assert table["out"][0]["z_m"][0] == pytest.approx([0, 0.33])
    assert table["closed_area_m2"] == pytest.approx([3.9 * 2.9 - 0.4 * 0.5])
    assert table["changes"] == []
    assert (tmp_path / "seen.svg").read_bytes().startswith(b"<")
    assert run_here("map", "slice", "room.urdf", "-o", "seen.svg").code == 2


def test_compat_exits_with_its_verdict(run_here, tmp_path):
    good = run_here("map", "compat", "room.urdf", "--run")
    assert good.code == 0
    assert "yourdfpy 0.0.60: loads it\n" in good.out
    assert "yourdfpy here: loaded: 7 links in the same places" in good.out
    (tmp_path / "pill.urdf").write_bytes(
        ROOM.replace(b'<box size="0.3 0.3 0.33"/>', b'<capsule radius="1" length="1"/>')
    )
    bad = run_here("map", "compat", "pill.urdf", "--json")
    assert bad.code == 1
    outcomes = {row["program"].split()[0]: row["outcome"] for row in json.loads(bad.out)["programs"]}
    assert outcomes == {"yourdfpy": "refuses", "urdfdom": "differs", "MuJoCo": "loads"}


def test_validate_compares_with_labels_and_refuses_what_is_none(run_here, tmp_path):
    (tmp_path / "labels.txt").write_text("wall\nsink\ntrash\n")
    words = ("map", "validate", "room.urdf", "--select", "C", "--labels")
    assert run_here(*words, "labels.txt").code == 0
    (tmp_path / "labels.txt").write_text("wall\nsinks\n")
    done = run_here(*words, "labels.txt")
    assert done.code == 1
    assert "class 'sink' is none of the model's 2 labels" in done.out
    assert "did you mean 'sinks'?" in done.out
    refused = run_here(*words, "room.urdf")
    assert (refused.code, refused.out) == (2, "")
    assert refused.err.startswith("Error: room.urdf: class 0 is")


def test_validate_and_fix_take_a_map_server_yaml(run_here, tmp_path):
    import cv2
    import numpy as np

    image = np.full((9, 9), 205, np.uint8)
    image[2:5] = 254
    image[0] = 0
    cv2.imwrite(str(tmp_path / "floor.pgm"), image)
    path = tmp_path / "floor.yaml"
    path.write_text("image: floor.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nfree_thresh: 0.25  # nav2\n")
    done = run_here("map", "validate", "floor.yaml")
    assert done.code == 1
    assert done.out.startswith("floor.yaml:4:14: error WK-R002: free_thresh 0.25 turns 45 unknown cells")
    assert run_here("map", "fix", "floor.yaml", "--fix", "moderate").code == 0
    assert path.read_text().endswith("free_thresh: 0.196  # nav2\n")
    assert run_here("map", "validate", "floor.yaml").code == 0
    assert (
        run_here("map", "fix", "floor.yaml", "--fix", "moderate").out
        == "floor.yaml: 0 fixed, 0 errors and 0 warnings left\n"
    )
