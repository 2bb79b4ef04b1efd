"""The board in a scan and in a cloud, drawn into a room, with and without a guess."""

from __future__ import annotations

import numpy as np
import pytest

from wallkit.calib.extrinsics.cloud_board import find_patch, side_faces
from wallkit.calib.extrinsics.rigid import rotation_from_vector
from wallkit.calib.extrinsics.scan_board import find_trace, returns_of, returns_of_points, traces_without_guess
from wallkit.calib.extrinsics.sightings import BoardPose
from wallkit.calib.extrinsics.worlds import UPRIGHT, World, board_at, hits
from wallkit.core.types import Scan

PLATE = np.array([(-0.4, -0.3, 0), (0.4, -0.3, 0), (0.4, 0.3, 0), (-0.4, 0.3, 0)])
T = np.eye(4)
T[:3, :3], T[:3, 3] = UPRIGHT, (0.03, 0.08, -0.06)


def pose(*where, **turns):
    return BoardPose(board_at(*where, **turns), np.eye(6) * 1e-8)


def room_scan(rng, board, *, sigma=0.01, step_deg=0.5):
    """A scan of a 6 x 5 m room with the board in it: the nearer of wall and board for every beam."""
    azimuth = np.radians(np.arange(-179.9, 180.0, step_deg))
    c, s = np.cos(azimuth), np.sin(azimuth)
    with np.errstate(divide="ignore"):
        ranges = np.minimum(np.where(c > 0, 4.0, -2.0) / c, np.where(s > 0, 2.5, -2.5) / s)
    L = np.linalg.inv(T) @ board.T_camera_board
    beams = np.column_stack([c, s, np.zeros_like(c)])
    along = (L[:3, 2] @ L[:3, 3]) / (beams @ L[:3, 2])
    on = (beams * along[:, None] - L[:3, 3]) @ L[:3, :2]
    met = (along > 0.1) & (np.abs(on) <= (0.4, 0.3)).all(axis=1)
    ranges = np.where(met & (along < ranges), along, ranges) + rng.normal(0, sigma, len(ranges))
    return beams * ranges[:, None], met


def test_finds_the_board_near_a_guess():
    rng = np.random.default_rng(0)
    board = pose(0.1, 0.05, 1.5, pitch_deg=10, yaw_deg=25)
    points, met = room_scan(rng, board)
    guess = T.copy()
    guess[:3, :3] = rotation_from_vector([0, 0.03, 0]) @ T[:3, :3]
    guess[:3, 3] += 0.03
    trace = find_trace(returns_of_points(points), board, PLATE, guess, sigma_range_m=0.01)
    assert trace.why == ""
    found = {tuple(p) for p in np.round(trace.points_m, 9)}
    true = {tuple(p) for p in np.round(points[met], 9)}
    assert found <= true
    assert len(found) > 0.9 * len(true)


def test_noise_does_not_tear_a_board_into_pieces():
    """A hundred noisy beams on a board have a jump of four sigmas somewhere in half of the scans; the line stays whole."""
    rng = np.random.default_rng(3)
    board = pose(0.1, 0.05, 1.8, pitch_deg=10, yaw_deg=-35)
    whole = []
    for _ in range(60):
        points, met = room_scan(rng, board, sigma=0.015, step_deg=0.25)
        trace = find_trace(returns_of_points(points), board, PLATE, T, sigma_range_m=0.01)
        whole.append(trace.why == "" and len(trace.points_m) > 0.85 * met.sum())
    assert sum(whole) >= 59


@pytest.mark.parametrize("turn_deg", [0.0, 140.0])
def test_finds_every_board_from_nothing(turn_deg):
    """However the LiDAR is turned about its axis, the boards of a capture tell."""
    rng = np.random.default_rng(1)
    poses = [
        pose(x, 0.05, z, pitch_deg=p, yaw_deg=w)
        for x, z, p, w in [
            (0, 1.2, 10, 30),
            (0.3, 1.6, -10, -30),
            (-0.3, 1.4, 0, 15),
            (0.1, 2.0, 15, -15),
            (0, 1.0, -15, 0),
        ]
    ]
    spin = rotation_from_vector([0, 0, np.radians(turn_deg)])
    scans, truth = [], []
    for board in poses:
        points, met = room_scan(rng, board)
        scans.append(returns_of_points(points @ spin))
        truth.append(points[met] @ spin)
    traces, found = traces_without_guess(scans, poses, PLATE, sigma_range_m=0.01)
    assert [t.why for t in traces] == [""] * 5
    for trace, true in zip(traces, truth, strict=True):
        middle = trace.points_m.mean(axis=0) - true.mean(axis=0)
        assert np.linalg.norm(middle) < 0.03
    heading = found[:3, :3].T @ UPRIGHT @ spin
    assert np.degrees(np.arccos((np.trace(heading) - 1) / 2)) < 4


def test_reasons_when_it_is_not_there():
    rng = np.random.default_rng(2)
    points, _ = room_scan(rng, pose(0, 0.05, 1.5, pitch_deg=0, yaw_deg=0))
    high = find_trace(
        returns_of_points(points), pose(0, -1.0, 1.5, pitch_deg=0, yaw_deg=0), PLATE, T, sigma_range_m=0.01
    )
    assert "above or below" in high.why
    away = find_trace(
        returns_of_points(points), pose(0, 0.05, 2.6, pitch_deg=0, yaw_deg=0), PLATE, T, sigma_range_m=0.01
    )
    assert "the least" in away.why
    noisy, _ = room_scan(rng, pose(0, 0.05, 1.5, pitch_deg=0, yaw_deg=0), sigma=0.012)
    strict = find_trace(
        returns_of_points(noisy), pose(0, 0.05, 1.5, pitch_deg=0, yaw_deg=0), PLATE, T, sigma_range_m=0.002
    )
    assert "scatter" in strict.why


def test_returns_leave_out_what_is_none():
    ranges = np.array([np.nan, np.inf, 0.0, 0.05, 1.0, 1.0, 1.0, 9.0, 2.0], np.float32)
    scan = Scan(0, "laser", ranges, np.arange(9, dtype=np.float32) * 0.01, 1e-3, 0.1, 8.0)
    found = returns_of(scan)
    assert len(found.ranges_m) == 4
    assert found.dropped["no return"] == 5
    np.testing.assert_allclose(found.offsets_s, [4e-3, 5e-3, 6e-3, 8e-3])


def test_a_mixed_pixel_between_two_surfaces_is_dropped():
    ranges = np.array([1.0, 1.0, 1.0, 1.5, 2.0, 2.0, 2.0])
    azimuth = np.arange(7) * 0.01
    points = np.column_stack([ranges * np.cos(azimuth), ranges * np.sin(azimuth), np.zeros(7)])
    found = returns_of_points(points)
    assert found.dropped["mixed pixel"] == 1
    assert 1.5 not in np.round(found.ranges_m, 6)


def cloud(rng, board):
    """16 rings: the board, a wall behind it and a floor below."""
    world = World(is_planar=False)
    on_board = hits(world, T, board.T_camera_board, rng)
    beams = world.directions
    wall = beams * (4.0 / beams[:, :1])
    wall = wall[(np.abs(wall[:, 1]) < 3) & (np.abs(wall[:, 2]) < 2)]
    rings = np.digitize(np.degrees(np.arcsin(on_board[:, 2] / np.linalg.norm(on_board, axis=1))), np.arange(-14, 16, 2))
    points = np.concatenate([on_board, wall + rng.normal(0, 0.005, wall.shape)])
    return points, np.concatenate([rings, np.full(len(wall), 99)]), len(on_board)


def test_finds_the_plate_in_a_room_without_a_guess():
    rng = np.random.default_rng(3)
    board = pose(0.1, 0.05, 1.5, pitch_deg=15, yaw_deg=25)
    points, rings, count = cloud(rng, board)
    patch = find_patch(points, np.array([0.8, 0.6]), rings=rings)
    assert patch.why == ""
    assert len(patch.points_m) == pytest.approx(count, rel=0.03)
    near = find_patch(points, np.array([0.8, 0.6]), rings=rings, guess=(board, PLATE, T))
    assert len(near.points_m) == pytest.approx(count, rel=0.03)


def test_a_room_without_a_plate_has_none():
    rng = np.random.default_rng(4)
    points, _, count = cloud(rng, pose(0, 0.05, 1.5, pitch_deg=0, yaw_deg=0))
    assert "no plane of 0.80 x 0.60 m" in find_patch(points[count:], np.array([0.8, 0.6])).why


def test_sides_lie_on_the_sides():
    rng = np.random.default_rng(5)
    board = pose(0.1, 0.05, 1.2, pitch_deg=15, yaw_deg=25, roll_deg=30)
    points, rings, _ = cloud(rng, board)
    patch = find_patch(points, np.array([0.8, 0.6]), rings=rings)
    faces = side_faces(patch, board, PLATE, T)
    assert len(faces) >= 2
    board_from_lidar = np.linalg.inv(board.T_camera_board) @ T
    for face in faces:
        on_board = face.points_m @ board_from_lidar[:3, :3].T + board_from_lidar[:3, 3]
        off = on_board @ face.normal - face.offset_m
        assert np.abs(off).max() < 0.08
        assert abs(off.mean()) < 0.03
