"""A sweep is moved to one moment exactly where the physics says, and every beam is accounted for."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.logs.drawn import ROOM_M, SECOND_NS, START_NS, on_walls, pose_at, sweep
from wallkit.core.geometry import compose, matrix_from_pose, wrap_angle
from wallkit.core.types import Scan
from wallkit.logs.mount import matrix_from_words
from wallkit.logs.sweep import beam_times, points_from_scan, sweep_span

LIMITS = {"range_min_m": 0.0, "range_max_m": 100.0}
# float32 ranges and points of a 3 m room
FLOAT32_M = 2e-6


def poses_of(motion):
    return lambda stamps: np.array([pose_at(motion, int(s)) for s in stamps])


def scan_of(ranges, **changes):
    angles = np.linspace(-1, 1, len(ranges)).astype(np.float32)
    fields = {"beam_interval_s": 0.0, "range_min_m": 0.1, "range_max_m": 10.0} | changes
    return Scan(START_NS, "laser", np.array(ranges, np.float32), angles, **fields)


def still(stamps):
    return np.zeros((len(stamps), 3))


@pytest.mark.parametrize("is_clockwise", [False, True])
def test_turning_in_place_in_a_square_room_puts_every_point_on_a_wall(is_clockwise):
    def turn(t):
        return (0.3, -0.2, 2.0 * t)

    angles = np.deg2rad(np.arange(-180, 180, 1.0)) * (-1 if is_clockwise else 1)
    scan = sweep(turn, START_NS, angles=angles, interval_s=0.1 / 360)
    pose = pose_at(turn, START_NS)

    corrected = points_from_scan(scan, np.eye(4), poses_of(turn), **LIMITS)
    raw = points_from_scan(scan, np.eye(4), still, **LIMITS)

    assert on_walls(pose, corrected.xyz_m[:, :2]).max() < FLOAT32_M
    assert on_walls(pose, raw.xyz_m[:, :2]).max() > 0.2  # 0.2 rad at 3 m: without the correction the room is bent


@given(
    st.floats(-2, 2), st.floats(-2, 2), st.floats(-3, 3), st.floats(-1, 1), st.floats(-1, 1), st.floats(-np.pi, np.pi)
)
@settings(max_examples=30, deadline=None)
def test_any_motion_and_any_mount_put_every_point_on_a_wall(vx, vy, turn, x, y, yaw):
    def motion(t):
        return (vx * t, vy * t, turn * t)

    mount = np.array([x, y, yaw])
    scan = sweep(motion, START_NS, mount=mount, interval_s=0.1 / 360)
    points = points_from_scan(scan, matrix_from_pose(mount), poses_of(motion), **LIMITS)
    assert on_walls(np.zeros(3), points.xyz_m[:, :2]).max() < 1e-5
    np.testing.assert_allclose(points.origin_m, mount[:2])


def test_zero_interval_is_exact_and_asks_for_no_pose():
    def never(stamps):
        raise AssertionError("asked for a pose")

    mount = np.array([0.2, -0.1, 0.7])
    scan = sweep(lambda t: (0.5, 0.1, 0.3), START_NS, mount=mount)
    points = points_from_scan(scan, matrix_from_pose(mount), never, **LIMITS)
    expected = np.stack([scan.ranges_m * np.cos(scan.angles_rad), scan.ranges_m * np.sin(scan.angles_rad)], axis=-1)
    c, s = np.cos(0.7), np.sin(0.7)
    np.testing.assert_allclose(points.xyz_m[:, :2], expected @ [[c, s], [-s, c]] + mount[:2], atol=FLOAT32_M)


def test_upside_down_lidar_sees_left_as_right():
    scan = sweep(lambda t: (1.0, 0.5, 0.0), START_NS)
    flipped = Scan(scan.stamp_ns, "laser", scan.ranges_m, -scan.angles_rad, 0.0, scan.range_min_m, scan.range_max_m)
    upright = points_from_scan(scan, np.eye(4), still, **LIMITS)
    hanging = points_from_scan(flipped, matrix_from_words(f"0,0,0,{np.pi},0,0"), still, **LIMITS)
    np.testing.assert_allclose(hanging.xyz_m, upright.xyz_m, atol=1e-5)


def test_tilted_lidar_points_get_their_height():
    tilt = 0.2
    scan = scan_of([2.0])
    scan = Scan(START_NS, "laser", np.float32([2.0]), np.float32([0.0]), 0.0, 0.1, 10.0)
    points = points_from_scan(scan, matrix_from_words(f"0,0,0.5,0,{tilt},0"), still, **LIMITS)
    np.testing.assert_allclose(points.xyz_m, [[2 * np.cos(tilt), 0, 0.5 - 2 * np.sin(tilt)]], atol=1e-6)
    np.testing.assert_allclose(points.ranges_m, 2.0)


def test_every_beam_is_a_return_a_miss_or_counted():
    scan = scan_of([np.nan, np.inf, -np.inf, 0.0, 0.05, 0.1, 5.0, 10.0, 12.0, 7.0])
    points = points_from_scan(scan, np.eye(4), still, range_min_m=0.0, range_max_m=6.0)
    np.testing.assert_array_equal(points.beams, [5, 6])
    np.testing.assert_allclose(points.misses_rad, scan.angles_rad[[1, 7, 8, 9]])
    assert points.dropped == {"not a number": 1, "zero": 1, "below minimum range": 2, "beyond used range": 1}
    assert points.range_max_m == 6.0


@given(st.lists(st.one_of(st.floats(width=32), st.sampled_from([0.0, 0.1, 10.0])), min_size=1, max_size=30))
def test_beams_add_up(ranges):
    scan = scan_of(ranges)
    points = points_from_scan(scan, np.eye(4), still, **LIMITS)
    lost = sum(n for reason, n in points.dropped.items() if reason != "beyond used range")
    assert len(points.beams) + len(points.misses_rad) + lost == len(ranges)
    assert np.isfinite(points.xyz_m).all()


def test_misses_turn_with_the_robot():
    scan = scan_of([np.inf] * 11, beam_interval_s=0.01)
    points = points_from_scan(
        scan, matrix_from_pose([0, 0, 0.5]), lambda s: np.stack([0 * s, 0 * s, (s - START_NS) * 1e-9], -1), **LIMITS
    )
    np.testing.assert_allclose(points.misses_rad, scan.angles_rad + 0.5 + 0.01 * np.arange(11), atol=1e-6)


def test_times_of_points_beat_the_interval_and_may_lie_before_the_stamp():
    offsets = np.float32([-0.02, 0.0, 0.01])
    scan = scan_of([1, 2, 3], offsets_s=offsets, beam_interval_s=9.0)
    np.testing.assert_allclose((beam_times(scan) - START_NS) / SECOND_NS, offsets, atol=1e-9)
    assert sweep_span(scan) == (START_NS - 20_000_000, START_NS + 10_000_000)


def test_moving_the_robot_moves_no_point_in_its_own_frame():
    """A static room seen from two places: T_map_base maps both point sets onto the same walls."""
    for pose in ([0, 0, 0], [1.5, -2.0, 2.5]):
        scan = sweep(lambda t, p=pose: tuple(p), START_NS)
        points = points_from_scan(scan, np.eye(4), still, **LIMITS)
        assert on_walls(np.array(pose, float), points.xyz_m[:, :2]).max() < FLOAT32_M
        assert points.ranges_m.max() <= 2 * np.sqrt(2) * ROOM_M


def test_the_drawn_room_is_a_room():
    scan = sweep(lambda t: (0, 0, 0), START_NS, angles=np.array([0, np.pi / 4]))
    np.testing.assert_allclose(scan.ranges_m, [ROOM_M, ROOM_M * np.sqrt(2)], rtol=1e-6)
    assert wrap_angle(compose([0, 0, 1], [0, 0, 1]))[2] == pytest.approx(2)
