"""Inputs that cannot give a transform: each has one clear message, and no file is left."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from tests.e2e.board_log import BOARD, middle_first, picture, pose_at, scan_of, stations
from wallkit.calib.extrinsics.worlds import board_at
from wallkit.cli.calib.extrinsics import extrinsics
from wallkit.errors import WallkitError

ROBOT = Path(__file__).parents[2] / "calib" / "robot.urdf"
CAMERA = """image_width: 640
image_height: 480
distortion_model: plumb_bob
camera_matrix: {rows: 3, cols: 3, data: [520, 0, 320, 0, 520, 240, 0, 0, 1]}
distortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}
"""
POSES = [(0.0, 0.05, 1.2, 20, 20), (0.1, 0.05, 1.5, -20, 15), (-0.1, 0.05, 1.3, 10, -25), (0.0, 0.0, 1.4, 25, -10)]


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """Four pictures and scans of a board."""
    folder = tmp_path_factory.mktemp("sound")
    rng = np.random.default_rng(0)
    for name in ("pictures", "scans"):
        (folder / name).mkdir()
    for i, (x, y, z, pitch, yaw) in enumerate(POSES):
        pose = middle_first(board_at(x, y, z, pitch_deg=pitch, yaw_deg=yaw))
        cv2.imwrite(str(folder / "pictures" / f"{i}.png"), picture(pose, rng))
        scan = scan_of(pose, 0, rng)
        np.savez(folder / "scans" / f"{i}.npz", ranges=scan.ranges_m, angles=scan.angles_rad)
    return folder


def message(folder, monkeypatch, pictures="pictures", scans="scans", *, camera=CAMERA, words=()):
    """What the user is told."""
    monkeypatch.chdir(folder)
    Path("camera.yaml").write_text(camera)
    Path("board.toml").write_text(BOARD.toml())
    board = () if "--board" in words else ("--board", "board.toml")
    given = [pictures, "--scans", scans, "--camera", "camera.yaml", "-q", "-o", "out.toml", *board, *words]
    done = CliRunner().invoke(extrinsics, given)
    assert isinstance(done.exception, WallkitError), done.output + repr(done.exception)
    assert not Path("out.toml").exists()
    return str(done.exception)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("distortion_model: plumb_bob\n", ""), "distortion_model"),
        (("520, 0, 320", ".nan, 0, 320"), "not finite"),
        (("[0, 0, 0, 0, 0]", "[0, .nan, 0, 0, 0]"), "not finite"),
        (("image_width: 640", "image_width: 1280"), "640 x 480 px, the calibration is for 1280 x 480"),
    ],
)
def test_a_camera_file_that_cannot_be(sound, monkeypatch, change, said):
    assert said in message(sound, monkeypatch, camera=CAMERA.replace(*change))


@pytest.mark.parametrize(
    ("board", "said"),
    [
        ("chessboard:10x7:0.07", "did you mean --board chessboard:8x6:0.07"),
        ("chessboard:6x5:0.07", "did you mean --board chessboard:8x6:0.07"),
        ("charuco:7x10:0.025:0.018:5X5_100", "plain chessboard"),
    ],
)
def test_the_wrong_pattern(sound, monkeypatch, board, said):
    assert said in message(sound, monkeypatch, words=("--board", board))


def test_swapped_frames(sound, monkeypatch):
    words = ("--urdf", str(ROBOT), "--lidar", "front_camera_optical", "--camera-frame", "laser")
    said = message(sound, monkeypatch, words=words)
    assert "the z axis of 'laser' points up: it is no optical frame" in said


def test_pictures_of_two_sizes(sound, tmp_path, monkeypatch):
    for i in range(2):
        grey = cv2.imread(str(sound / "pictures" / f"{i}.png"), 0)
        cv2.imwrite(str(tmp_path / f"{i}.png"), grey if i == 0 else cv2.resize(grey, (320, 240)))
    said = message(sound, monkeypatch, str(tmp_path))
    assert "320 x 240 px, the calibration is for 640 x 480" in said


def test_a_board_that_is_cut_off(sound, tmp_path, monkeypatch):
    for i in range(3):
        grey = cv2.imread(str(sound / "pictures" / f"{i}.png"), 0)
        grey[:, 330 - 20 * i :] = 110
        cv2.imwrite(str(tmp_path / f"{i}.png"), grey)
    assert "cut off" in message(sound, monkeypatch, str(tmp_path))


def test_corners_that_opencv_makes_up_are_no_board():
    """A board whose right third is hidden: the search of OpenCV puts the last columns on the bare wall."""
    from wallkit.calib.board.detect import find_corners, find_quickly

    rng = np.random.default_rng(0)
    whole = picture(pose_at(stations(3), 0.0), rng)
    cut = whole.copy()
    cut[:, 330:] = 110
    assert find_corners(whole, BOARD) is not None
    assert find_corners(cut, BOARD) is None
    assert find_quickly(cut, BOARD, is_thorough=True) is None


def test_no_board_in_the_scans(sound, tmp_path, monkeypatch):
    angles = np.linspace(-np.pi, np.pi, 720, endpoint=False)
    for i in range(4):
        np.savez(tmp_path / f"{i}.npz", ranges=np.full(720, 6.0), angles=angles)
    said = message(sound, monkeypatch, scans=str(tmp_path))
    assert "the board was found in 0 of 4 scans" in said


def test_an_empty_scan(sound, tmp_path, monkeypatch):
    angles = np.linspace(-np.pi, np.pi, 720, endpoint=False)
    for i in range(4):
        np.savez(tmp_path / f"{i}.npz", ranges=np.full(720, np.inf), angles=angles)
    assert "the scan is empty" in message(sound, monkeypatch, scans=str(tmp_path))
