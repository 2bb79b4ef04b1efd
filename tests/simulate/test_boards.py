"""Boards before a camera: their corners are found where the truth says."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from wallkit.calib.board.boards import board_from, opencv_board
from wallkit.calib.board.detect import find_corners
from wallkit.calib.board.pose import pose_of_board
from wallkit.calib.extrinsics.scan_files import read_scan
from wallkit.errors import SimulationError
from wallkit.pipelines.bench.boards import recoveries
from wallkit.pipelines.simulate.boards import BoardRequest, board_picture, captures, pcd_from_cloud
from wallkit.pipelines.simulate.units import unit_of
from wallkit.simulate.board_room import BOARD as BOARD_BODY
from wallkit.simulate.board_room import STAND, BoardPoses, board_room
from wallkit.simulate.photo import PERFECT
from wallkit.simulate.robot import robot_from_urdf
from wallkit.simulate.scanner import Rings, Scanner, cloud, perfect
from wallkit.simulate.scenario import CameraSetup, Scenario
from wallkit.simulate.scene import Scene
from wallkit.simulate.world import upright

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
    for held in captures(request, robot, unit, each=1):
        found = find_corners(cv2.cvtColor(held.image, cv2.COLOR_RGB2GRAY), BOARD)
        T = held.T_camera_board
        points = BOARD.object_points[found.ids] @ T[:3, :3].T + T[:3, 3]
        off.append(found.pixels - unit.true.project(points))
    errors = np.concatenate(off)
    assert len(errors) > 60
    assert np.abs(errors.mean(axis=0)).max() < 0.02
    assert np.sqrt((errors**2).mean()) < 0.1


def test_small_charuco_squares_are_refined_in_more_than_opencvs_single_pixel(gl):
    """Markers of 3/4 of a square begin two pixels from the corners of squares of 14 px."""
    from cv2 import aruco

    board = board_from("charuco:10x7:0.039:0.03:5X5_100")
    request = BoardRequest(board, Scenario(cameras=(LENS,)), BoardPoses(6, 0.8, 1.2, 30.0, anywhere=True), seed=1)
    robot = robot_from_urdf()
    unit = unit_of(robot, LENS)
    own, opencvs = [], []
    for held in captures(request, robot, unit, each=1):
        grey = cv2.cvtColor(held.image, cv2.COLOR_RGB2GRAY)
        found, T = find_corners(grey, board), held.T_camera_board
        if found is None:
            continue
        truth = unit.true.project(board.object_points @ T[:3, :3].T + T[:3, 3])
        own.append(found.pixels - truth[found.ids])
        pixels, ids, _, _ = aruco.CharucoDetector(opencv_board(board)).detectBoard(grey)
        opencvs.append(pixels.reshape(-1, 2) - truth[ids.ravel()])
    rms = [float(np.sqrt((np.concatenate(errors) ** 2).mean())) for errors in (own, opencvs)]
    assert len(np.concatenate(own)) > 60
    assert rms[0] < 0.8 * rms[1], rms


@pytest.mark.long
def test_a_board_in_pictures_is_as_large_and_as_far_as_it_truly_is(gl):
    """What the renderer does to squares that pixels cut: 0.3 to 1.4 mm per metre of board, half a millimetre of distance."""
    board, setup = board_from(PLATE), CameraSetup("front", photo=PERFECT)
    robot = robot_from_urdf()
    unit = unit_of(robot, setup)
    request = BoardRequest(board, Scenario(cameras=(setup,)), BoardPoses(24, 0.7, 2.2, anywhere=True), seed=4)
    far, stretch = [], []
    for held in captures(request, robot, unit, each=1):
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


PERFECT_LIDAR = [
    *("lidar.scanner.sigma_m=0", "lidar.scanner.sigma_per_m=0", "lidar.scanner.grazing=0", "lidar.scanner.quantum_m=0"),
    *("lidar.scanner.dropout=0", "lidar.scanner.grazing_dropout=0", "lidar.scanner.divergence_rad=0"),
]


@pytest.mark.long
def test_without_noise_of_ranges_the_truth_is_recovered(gl):
    """What is left is the camera's noise; before squares began where pixels do, forward was half a millimetre off."""
    words = [*PERFECT_LIDAR, "lidar.frame=laser"]
    (found,) = recoveries(board_from(PLATE), [5], poses=20, robot_path=Path("calib/robot.urdf"), words=words)
    assert found.used == found.held == 20
    assert np.degrees(np.abs(found.off[:3])).max() < 0.1
    assert np.abs(found.off[4:]).max() < 2e-3
    assert abs(found.off[3]) < 0.3e-3


@pytest.mark.long
@pytest.mark.parametrize(("frame", "rings"), [("laser", None), ("lidar_3d", Rings(16, 0.6))])
def test_calibration_recovers_what_a_capture_was_made_with(gl, frame, rings):
    """Within its own 95 % intervals: of eighteen, fewer than fourteen once in five thousand times."""
    settings = {"poses": 10, "rings": rings, "robot_path": Path("calib/robot.urdf"), "words": [f"lidar.frame={frame}"]}
    found = list(recoveries(board_from(PLATE), [1, 2, 3], **settings))
    assert sum(int(r.covered.sum()) for r in found) >= 14
    assert sum(r.used for r in found) >= 28
    assert max(r.rms_px for r in found) < 0.1
    assert max(r.bias_px for r in found) < 0.01


def test_a_cloud_is_on_what_is_there_and_is_read_back_from_its_file(tmp_path):
    """Rings of a perfect LiDAR in the empty room: every return is on a wall, the floor or the ceiling."""
    size = (0.6, 0.8)
    scene = Scene(board_room(size, ""))
    T = upright(-1.5, 0.0, 0.0)
    T[2, 3] = 0.7
    scene.place({BOARD_BODY: upright(30.0, 0, 0, 1.0), STAND: upright(30.0, 1, 0, 1.0)})
    rings = Rings(8, 1.0)
    made = cloud(np.random.default_rng(0), perfect(Scanner(fov_rad=6.28)), rings, scene, 0, T)
    at = made.points_m.astype(np.float64) @ T[:3, :3].T + T[:3, 3]
    off = np.min(np.abs(np.column_stack([np.abs(at[:, :2]) - 4.0, at[:, 2], at[:, 2] - 2.8])), axis=1)
    assert off.max() < 1e-5
    elevations = np.arctan2(made.points_m[:, 2], np.hypot(*made.points_m[:, :2].T))
    np.testing.assert_allclose(elevations, rings.elevations_rad[made.rings], atol=1e-5)
    path = tmp_path / "pose000.pcd"
    path.write_bytes(pcd_from_cloud(made))
    read = read_scan(path)
    np.testing.assert_array_equal(read.points_m, made.points_m)
    np.testing.assert_array_equal(read.rings, made.rings)


def test_a_board_that_cannot_be_seen_whole_is_refused(gl):
    huge = board_from("chessboard:9x6:0.9")
    lens = CameraSetup("front", K=LENS.K)
    request = BoardRequest(huge, Scenario(cameras=(lens,)), BoardPoses(3, 0.5, 0.6), seed=0)
    robot = robot_from_urdf()
    with pytest.raises(SimulationError, match="0 of 3 poses"):
        next(captures(request, robot, unit_of(robot, lens)))
