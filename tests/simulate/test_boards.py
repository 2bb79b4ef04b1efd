"""Boards before a camera: their corners are found where the truth says."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from wallkit.calib.board_pose import pose_of_board
from wallkit.calib.boards import board_from
from wallkit.calib.detect import find_corners
from wallkit.errors import SimulationError
from wallkit.pipelines.simulate_boards import BoardRequest, board_picture, captures
from wallkit.pipelines.simulate_units import unit_of
from wallkit.simulate.board_room import BoardPoses
from wallkit.simulate.photo import PERFECT
from wallkit.simulate.robot import robot_from_urdf
from wallkit.simulate.scenario import CameraSetup, Scenario

BOARD = board_from("charuco:7x5:0.1:0.075:5X5_100")
LENS = CameraSetup("front", D=(-0.2, 0.05, 0.001, -0.001, 0.0), K=(420.0, 425.0, 311.3, 246.8), photo=PERFECT)


PLATE = "calib/boards/chessboard-plate-610x850.toml"


@pytest.mark.parametrize("words", ["chessboard:6x4:0.05", "charuco:7x5:0.1:0.075:5X5_100", PLATE])
def test_the_printed_corners_are_where_the_board_has_them(words):
    """On the flat picture of the plate, corners found in pixels are the board's own metres."""
    board = board_from(words)
    texture = board_picture(board)
    grey = cv2.resize(texture.pixels[..., 0], None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    found = find_corners(grey, board)
    scale = np.array(texture.size_m) / grey.shape[::-1]
    # the picture may begin before the plate does, so that squares begin where pixels do
    begin = np.array(
        [-texture.begins_m[0], texture.begins_m[1] + np.ptp(board.plate_corners[:, 1]) - texture.size_m[1]]
    )
    metres = (found.pixels + 0.5) * scale + board.plate_corners[0, :2] + begin
    np.testing.assert_allclose(metres, board.object_points[found.ids, :2], atol=0.2e-3)


def test_corners_in_simulated_pictures_are_where_the_truth_projects_them(gl):
    poses = BoardPoses(4, 0.7, 1.1, 35.0, anywhere=True)
    request = BoardRequest(BOARD, Scenario(cameras=(LENS,)), poses, seed=1)
    robot = robot_from_urdf()
    unit = unit_of(robot, LENS)
    off = []
    for held in list(captures(request, robot, unit))[::4]:
        found = find_corners(cv2.cvtColor(held.image, cv2.COLOR_RGB2GRAY), BOARD)
        T = held.T_camera_board
        points = BOARD.object_points[found.ids] @ T[:3, :3].T + T[:3, 3]
        off.append(found.pixels - unit.true.project(points))
    errors = np.concatenate(off)
    assert len(errors) > 60
    assert np.abs(errors.mean(axis=0)).max() < 0.02
    assert np.sqrt((errors**2).mean()) < 0.1


def test_a_board_in_pictures_is_as_large_and_as_far_as_it_truly_is(gl):
    """What the renderer does to squares that pixels cut: 0.3 to 1.4 mm per metre of board, half a millimetre of distance."""
    board, setup = board_from(PLATE), CameraSetup("front", photo=PERFECT)
    robot = robot_from_urdf()
    unit = unit_of(robot, setup)
    request = BoardRequest(board, Scenario(cameras=(setup,)), BoardPoses(24, 0.7, 2.2, anywhere=True), seed=4)
    far, stretch = [], []
    for held in list(captures(request, robot, unit))[::4]:
        found = find_corners(cv2.cvtColor(held.image, cv2.COLOR_RGB2GRAY), board)
        points, T = board.object_points[found.ids], held.T_camera_board
        pose = pose_of_board(unit.true, points, found.pixels)
        far.append(T[:3, 2] @ (pose.T_camera_board[:3, 3] - T[:3, 3]))
        rays = unit.true.unproject(found.pixels)
        hit = rays * ((T[:3, 2] @ T[:3, 3]) / (rays @ T[:3, 2]))[:, None]
        off = ((hit - T[:3, 3]) @ T[:3, :3] - points)[:, :2]
        stretch.append([np.polyfit(points[:, axis], off[:, axis], 1)[0] for axis in (0, 1)])
    assert abs(np.mean(far)) < 0.25e-3
    assert np.abs(np.mean(stretch, axis=0)).max() < 0.15e-3


def test_a_board_that_cannot_be_seen_whole_is_refused(gl):
    huge = board_from("chessboard:9x6:0.9")
    request = BoardRequest(huge, Scenario(cameras=(LENS,)), BoardPoses(3, 0.5, 0.6), seed=0)
    robot = robot_from_urdf()
    with pytest.raises(SimulationError, match="0 of 3 poses"):
        next(captures(request, robot, unit_of(robot, LENS)))
