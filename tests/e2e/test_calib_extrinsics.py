"""The installed command on a log drawn here: a board before a robot with a known mounting and clocks that differ."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from tests.e2e.board_log import BOARD, TAU_S, T, middle_first, picture
from wallkit.calib.extrinsics.rigid import angle_between
from wallkit.calib.extrinsics.worlds import board_at
from wallkit.calib.files.store import read_calibration


@pytest.mark.long
def test_a_log_is_calibrated(wallkit, board_log, tmp_path):
    (tmp_path / "board.toml").write_text(BOARD.toml())
    words = ("--board", "board.toml", "--sigma-range", "8mm")
    done = wallkit("calib", "extrinsics", board_log, *words, "-o", "out.toml", "--json", "-q")
    assert done.code == 0, done.err
    found = done.json
    assert found["kind"] == "full"
    assert len(found["views"]) == 14
    stored = read_calibration(tmp_path / "out.toml")
    assert np.degrees(angle_between(stored.T_camera_lidar, T)) < 0.6
    assert np.linalg.norm(stored.T_camera_lidar[:3, 3] - T[:3, 3]) < 0.02
    assert stored.lidar_frame == "laser"
    assert stored.pixel_error_95_at(3.0) < 20
    clock = found["time_offset"]
    assert clock["verdict"] == "known"
    assert clock["tau_s"] == pytest.approx(TAU_S, abs=0.006)
    assert stored.time_offset_ns == pytest.approx(TAU_S * 1e9, abs=6e6)
    assert stored.provenance.inputs.keys() == {"log.mcap"}


@pytest.mark.long
def test_the_page_says_what_a_user_needs(wallkit, board_log, tmp_path):
    (tmp_path / "board.toml").write_text(BOARD.toml())
    done = wallkit("calib", "extrinsics", board_log, "--board", "board.toml")
    assert done.code == 0, done.err
    for words in (
        "T_camera_lidar",
        "roll",
        "height",
        "at 3 m a LiDAR point lands within",
        "next      hold the board",
        "clocks",
    ):
        assert words in done.out
    assert "20 mm is assumed" in done.err


@pytest.mark.long
@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--board", "chessboard:9x7:0.07"), "did you mean --board chessboard:8x6:0.07"),
        (("--board", "chessboard:8x6:0.07", "--hold"), "--hold needs a transform"),
        (("--board", "chessboard:8x6:0.07", "--sigma-range", "vlp-61"), "did you mean 'vlp-16'"),
        (("--board", "chessboard:8x6:0.07", "--scan", "/points"), "no topic '/points'"),
    ],
)
def test_mistakes_have_one_clear_message_and_leave_no_file(wallkit, board_log, tmp_path, words, said):
    done = wallkit("calib", "extrinsics", board_log, *words, "-o", "out.toml", "-q")
    assert done.code == 2
    assert said in done.err
    assert "Traceback" not in done.err
    assert not (tmp_path / "out.toml").exists()


def test_pictures_of_another_size_and_an_empty_scan(wallkit, tmp_path):
    (tmp_path / "pictures").mkdir()
    (tmp_path / "scans").mkdir()
    cv2.imwrite(str(tmp_path / "pictures" / "1.png"), np.zeros((240, 320), np.uint8))
    (tmp_path / "scans" / "1.csv").write_text("x,y\n0,0\n0,0\n")
    (tmp_path / "camera.yaml").write_text(
        "image_width: 640\nimage_height: 480\ndistortion_model: plumb_bob\n"
        "camera_matrix: {rows: 3, cols: 3, data: [520, 0, 320, 0, 520, 240, 0, 0, 1]}\n"
        "distortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}\n"
    )
    words = (
        "extrinsics",
        "pictures",
        "--scans",
        "scans",
        "--camera",
        "camera.yaml",
        "--board",
        "chessboard:8x6:0.07",
        "-q",
    )
    done = wallkit("calib", *words)
    assert done.code == 2
    assert "320 x 240 px, the calibration is for 640 x 480" in done.err
    pose = middle_first(board_at(0, 0, 1.2, pitch_deg=20, yaw_deg=20))
    cv2.imwrite(str(tmp_path / "pictures" / "1.png"), picture(pose, np.random.default_rng(0)))
    done = wallkit("calib", *words)
    assert done.code == 2
    assert "the scan is empty" in done.err
