"""A board waved before both sensors, with clocks that differ by a known amount."""

from __future__ import annotations

import numpy as np
import pytest

from wallkit.calib.extrinsics.coarse_offset import coarse_offset, traces_at
from wallkit.calib.extrinsics.time_offset import BoardTrack, TimedTrace, poses_at, time_offset
from wallkit.calib.extrinsics.worlds import UPRIGHT, World, board_at, hits
from wallkit.core.types import PointCloud, Scan

PLATE = np.array([[-0.4, -0.3, 0], [0.4, -0.3, 0], [0.4, 0.3, 0], [-0.4, 0.3, 0]])
T = np.eye(4)
T[:3, :3], T[:3, 3] = UPRIGHT, (0.03, 0.08, -0.06)
IMAGE_NS, SCAN_NS = 50_000_000, 100_000_000


def waved(seconds, *, amplitude=0.3):
    """The board at a time [s]: it swings towards the sensors and away, turning as it goes."""
    return board_at(
        0.1 * np.sin(0.7 * seconds),
        0.05,
        1.6 + amplitude * np.sin(2.1 * seconds),
        pitch_deg=20 * np.sin(1.3 * seconds) * amplitude / 0.3,
        yaw_deg=25 * np.sin(0.9 * seconds) * amplitude / 0.3,
    )


def recorded(tau_s, *, amplitude=0.3, seed=0, seconds=12.0):
    """Images and scans of it; the camera's clock shows tau more than the LiDAR's."""
    rng = np.random.default_rng(seed)
    true_ns = np.arange(0, int(seconds * 1e9), IMAGE_NS)
    track = BoardTrack(true_ns + round(tau_s * 1e9), np.array([waved(t / 1e9, amplitude=amplitude) for t in true_ns]))
    world = World(beam_deg=1.0)
    traces = []
    for begin in range(200_000_000, int(seconds * 1e9) - 300_000_000, SCAN_NS):
        points = hits(world, T, waved(begin / 1e9, amplitude=amplitude), rng)
        traces.append(TimedTrace(points, np.full(len(points), begin, dtype=np.int64)))
    return track, traces


def recorded_room(tau_s, *, seconds=12.0):
    """The same, but whole scans of a room with walls 4 m away."""
    track, _ = recorded(tau_s, seconds=seconds)
    rng = np.random.default_rng(1)
    angles = np.radians(np.arange(-180.0, 180.0, 1.0))
    world, scans = World(beam_deg=1.0), []
    for begin in range(200_000_000, int(seconds * 1e9) - 300_000_000, SCAN_NS):
        ranges = 4.0 / np.maximum(np.abs(np.cos(angles)), np.abs(np.sin(angles))) + rng.normal(0, 0.01, 360)
        points = hits(world, T, waved(begin / 1e9), rng)
        beams = np.round(np.degrees(np.arctan2(points[:, 1], points[:, 0]))).astype(int) + 180
        ranges[beams] = np.linalg.norm(points, axis=1)
        scans.append(Scan(begin, "laser", ranges.astype(np.float32), angles.astype(np.float32), 0.0, 0.1, 12.0))
    return track, scans


@pytest.mark.parametrize("tau_ms", [-60.0, 0.0, 35.0])
def test_offset_within_its_own_interval(tau_ms):
    track, traces = recorded(tau_ms / 1e3)
    found = time_offset(track, traces, T, sigma_range_m=0.01)
    assert found.verdict == "known"
    assert found.sigma_s < 0.003
    assert abs(found.tau_s * 1e3 - tau_ms) < 3.5 * found.sigma_s * 1e3 + 0.3
    assert f"{found.tau_s * 1e3:+.1f}" in found.words


@pytest.mark.long
def test_sigma_is_the_scatter_between_captures():
    errors, sigmas = [], []
    for seed in range(24):
        track, traces = recorded(0.02, seed=seed, seconds=6.0)
        found = time_offset(track, traces, T, sigma_range_m=0.01)
        errors.append(found.tau_s - 0.02)
        sigmas.append(found.sigma_s)
    assert np.std(errors) == pytest.approx(np.mean(sigmas), rel=0.5)


def test_a_still_board_says_nothing():
    track, traces = recorded(0.02, amplitude=0.001)
    found = time_offset(track, traces, T, sigma_range_m=0.01)
    assert found.verdict == "cannot tell"
    assert np.isinf(found.sigma_s)
    assert "move it" in found.words


def test_poses_between_images():
    track, _ = recorded(0.0)
    between = np.array([525_000_000], dtype=np.int64)
    poses, velocity = poses_at(track, between)
    np.testing.assert_allclose(poses[0], waved(0.525), atol=4e-4)
    speed = (waved(0.526)[:3, 3] - waved(0.524)[:3, 3]) / 0.002
    np.testing.assert_allclose(velocity[0, 3:], speed, atol=5e-3)
    gappy = BoardTrack(track.stamps_ns[::5], track.poses[::5])
    assert np.isnan(poses_at(gappy, between)[0]).all()


def recorded_clouds(tau_s, *, has_times, seconds=12.0):
    """Clouds of 16 rings that take 100 ms a turn, from behind the robot to the left and round."""
    track, _ = recorded(tau_s, seconds=seconds)
    rng = np.random.default_rng(2)
    world, clouds = World(is_planar=False, beam_deg=1.0), []
    wall = np.column_stack([np.full(400, 4.0), np.linspace(-3, 3, 400), np.tile(np.linspace(-1, 1, 20), 20)])
    for begin in range(200_000_000, int(seconds * 1e9) - 300_000_000, SCAN_NS):
        # the board is ahead, half a turn after the stamp
        points = np.concatenate([hits(world, T, waved(begin / 1e9 + 0.05), rng), wall])
        after = (np.arctan2(points[:, 1], points[:, 0]) + np.pi) / (2 * np.pi) * 0.1
        offsets = after.astype(np.float32) if has_times else None
        clouds.append(PointCloud(begin, "lidar", points.astype(np.float32), offsets_s=offsets))
    return track, clouds


@pytest.mark.parametrize(("tau_ms", "has_times"), [(-30.0, True), (300.0, True), (20.0, False)])
def test_offsets_of_clouds(tau_ms, has_times):
    """With times of the returns the offset is that of the clocks; without them half a turn of the LiDAR is in it."""
    track, clouds = recorded_clouds(tau_ms / 1e3, has_times=has_times)
    coarse = coarse_offset(track, clouds, T, PLATE, sigma_range_m=0.01)
    traces = traces_at(track, clouds, T, PLATE, coarse, sigma_range_m=0.01)
    found = time_offset(track, traces, T, sigma_range_m=0.01, start_s=coarse)
    expected = tau_ms + (0 if has_times else 50)
    assert found.verdict == "known"
    assert found.sigma_s < 0.003
    assert abs(found.tau_s * 1e3 - expected) < 3.5 * found.sigma_s * 1e3 + 1.0


@pytest.mark.parametrize("tau_ms", [30.0, 150.0, -400.0])
def test_large_offsets_are_found_from_nothing(tau_ms):
    """A room with the board in it, scanned whole: the coarse search finds offsets far beyond the fine one's reach."""
    track, scans = recorded_room(tau_ms / 1e3)
    coarse = coarse_offset(track, scans, T, PLATE, sigma_range_m=0.01)
    assert coarse == pytest.approx(tau_ms / 1e3, abs=0.05)
    traces = traces_at(track, scans, T, PLATE, coarse, sigma_range_m=0.01)
    found = time_offset(track, traces, T, sigma_range_m=0.01, start_s=coarse)
    assert found.verdict == "known"
    assert abs(found.tau_s * 1e3 - tau_ms) < 3.5 * found.sigma_s * 1e3 + 1.0


def test_a_board_that_only_approaches_cannot_separate_clock_and_place():
    """At one speed, every millisecond is a millimetre: tau and the shift along the way are one."""
    rng = np.random.default_rng(0)
    stamps = np.arange(0, 4_000_000_000, IMAGE_NS)
    poses = [board_at(0.0, 0.05, 1.0 + 0.3 * t / 1e9, pitch_deg=0, yaw_deg=0) for t in stamps]
    track = BoardTrack(stamps, np.array(poses))
    traces = []
    for begin in range(200_000_000, 3_700_000_000, SCAN_NS):
        pose = board_at(0.0, 0.05, 1.0 + 0.3 * begin / 1e9, pitch_deg=0, yaw_deg=0)
        points = hits(World(beam_deg=1.0), T, pose, rng)
        traces.append(TimedTrace(points, np.full(len(points), begin, dtype=np.int64)))
    found = time_offset(track, traces, T, sigma_range_m=0.01)
    assert found.verdict == "cannot separate"
    assert "would look the same" in found.words
