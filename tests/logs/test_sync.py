"""Frames say where the robot was at every sweep's stamp; whatever did not become one is counted with its reason."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.logs.drawn import SECOND_NS, START_NS, drive, log_of, on_walls, pose_at, sweep, write
from wallkit.core.types import CameraImage, Odometry, PointCloud, Transform
from wallkit.errors import LogError
from wallkit.logs.eyes import Eyes
from wallkit.logs.odometry import OdometryBuffer
from wallkit.logs.reader import open_log
from wallkit.logs.rig import CameraTopic, Wanted, find_rig
from wallkit.logs.sync import SyncConfig, SyncReport, synchronise

MOTION = drive()
MOUNT = np.array([0.15, 0.1, -0.6])
DRIVE = log_of(MOTION, seconds=4, mount=MOUNT, interval_s=0.1 / 360)


def frames_of(tmp_path, messages, config=None, *, wanted=None, log_offset_ns=0, **window):
    log = open_log([write(tmp_path / "log.mcap", messages, log_offset_ns=log_offset_ns)])
    report = SyncReport()
    frames = list(synchronise(log, find_rig(log, wanted), config, report=report, **window))
    assert report.frames == len(frames)
    assert report.scans == report.frames + sum(report.scans_dropped.values())
    return frames, report


def scans(messages):
    return [m for m in messages if m[1] == "/scan"]


def without(messages, topic, start_s, end_s):
    low, high = START_NS + start_s * SECOND_NS, START_NS + end_s * SECOND_NS
    return [m for m in messages if m[1] != topic or not low < m[0] < high]


def test_frames_lie_where_the_robot_was(tmp_path):
    """The whole way: file, odometry, mount, motion during the sweep. Points end on the walls of the room."""
    frames, report = frames_of(tmp_path, DRIVE)
    assert [f.stamp_ns for f in frames] == [s for s, _, _ in scans(DRIVE)]
    for frame in frames:
        truth = pose_at(MOTION, frame.stamp_ns)
        np.testing.assert_allclose(frame.odometry, truth, atol=1e-9)
        # 50 Hz odometry interpolated: acceleration / 8 * step^2 is 0.05 mm here
        assert on_walls(truth, frame.points.xyz_m[:, :2]).max() < 2e-4
        np.testing.assert_allclose(frame.points.origin_m, MOUNT[:2])
        assert frame.views == ()
    assert report.lines() == []
    assert report.share_dropped == 0


def test_odometry_is_interpolated_linearly_along_the_shorter_turn(tmp_path):
    odometry = [(START_NS, np.array([0.0, 0, 3.1])), (START_NS + SECOND_NS, np.array([1.0, 2, -3.1]))]
    messages = [(s, "/odom", Odometry(s, p)) for s, p in odometry]
    at = START_NS + SECOND_NS // 4
    messages += [DRIVE[0], (at, "/scan", sweep(MOTION, at))]
    frames, _ = frames_of(tmp_path, messages)
    yaw = 3.1 + (2 * np.pi - 6.2) / 4  # the shorter turn leads over pi
    np.testing.assert_allclose(frames[0].odometry[:2], [0.25, 0.5], atol=1e-9)
    np.testing.assert_allclose(np.exp(1j * frames[0].odometry[2]), np.exp(1j * yaw), atol=1e-9)


@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.integers(-10 * 86400, 10 * 86400), st.randoms(use_true_random=False))
def test_record_time_does_not_matter(tmp_path, offset_s, random):
    """Days between record time and stamps, and messages recorded up to 0.3 s after their stamp, change no frame."""
    expected, _ = frames_of(tmp_path, DRIVE)
    late = [(stamp + round(random.uniform(0, 0.3) * SECOND_NS), topic, value) for stamp, topic, value in DRIVE]
    late = [(s, t, v) for s, t, v in sorted(late, key=lambda m: m[0])]
    ordered = {"/odom": [], "/scan": [], "/tf_static": []}
    for _, topic, value in DRIVE:
        ordered[topic].append(value)
    # each topic in its own order, as one publisher sends it
    shuffled = [(stamp, topic, ordered[topic].pop(0)) for stamp, topic, _ in late]
    found, _ = frames_of(tmp_path, shuffled, log_offset_ns=offset_s * SECOND_NS)
    assert len(found) == len(expected)
    for a, b in zip(found, expected, strict=True):
        assert a.stamp_ns == b.stamp_ns
        np.testing.assert_array_equal(a.points.xyz_m, b.points.xyz_m)
        np.testing.assert_array_equal(a.odometry, b.odometry)
        assert a.odometry_gap_s == b.odometry_gap_s


def test_sweeps_outside_odometry_are_dropped_and_do_not_count_as_loss(tmp_path):
    cut = [m for m in DRIVE if m[1] != "/odom" or START_NS + 0.5 * SECOND_NS < m[0] < START_NS + 3.5 * SECOND_NS]
    frames, report = frames_of(tmp_path, cut)
    assert report.scans_dropped == {"before the first odometry": 3, "odometry ends before the sweep does": 3}
    assert report.at_the_ends == 6
    assert report.share_dropped == 0
    assert len(frames) == 14


def test_a_long_silence_of_odometry_is_loss(tmp_path):
    frames, report = frames_of(tmp_path, without(DRIVE, "/odom", 1.0, 3.0))
    assert report.scans_dropped == {"no odometry for more than 1 s around it": 10}
    assert report.share_dropped == 0.5
    after = next(f for f in frames if f.stamp_ns >= START_NS + 3 * SECOND_NS)
    assert after.odometry_gap_s == pytest.approx(2.0)
    assert report.odometry_gap_max_s == pytest.approx(2.0)
    frames, report = frames_of(tmp_path, without(DRIVE, "/odom", 1.0, 3.0), SyncConfig(odometry_gap_max_s=2.5))
    assert len(frames) == 20


def test_a_hole_in_the_recording_is_told_by_the_gap(tmp_path):
    """A kidnapped robot: nothing was recorded for a while, then everything goes on."""
    hole = without(without(DRIVE, "/odom", 1.0, 3.0), "/scan", 0.9, 3.0)
    frames, report = frames_of(tmp_path, hole)
    assert report.share_dropped == 0
    gaps = [f.odometry_gap_s for f in frames]
    assert max(gaps) == pytest.approx(2.0)
    assert sum(g > 1 for g in gaps) == 1


def test_a_sweep_at_an_odometry_stamp_needs_no_bridge(tmp_path):
    """Scans and odometry with the same stamps, seconds apart, as in old logs: exact, and no gap to cross."""
    stamps = [START_NS + k * 5 * SECOND_NS for k in range(4)]
    odometry = [(s, "/odom", Odometry(s, pose_at(MOTION, s))) for s in stamps]
    sweeps = [(s, "/scan", sweep(MOTION, s)) for s in stamps]
    frames, _ = frames_of(tmp_path, [DRIVE[0], *sorted([*odometry, *sweeps], key=lambda m: m[0])])
    assert len(frames) == 4
    assert [f.odometry_gap_s for f in frames] == pytest.approx([0, 5, 5, 5])


def test_repeated_and_backward_stamps_are_left_out(tmp_path):
    odom = [m for m in DRIVE if m[1] == "/odom"]
    extra = [(odom[9][0] + 1, "/odom", replace(odom[9][2], pose=np.array([9.0, 9, 9])))]
    extra += [(odom[20][0] + 1, "/odom", replace(odom[3][2], pose=np.array([9.0, 9, 9])))]
    scan = scans(DRIVE)
    extra += [(scan[5][0] + 1, "/scan", scan[5][2]), (scan[8][0] + 1, "/scan", scan[2][2])]
    frames, report = frames_of(tmp_path, sorted([*DRIVE, *extra], key=lambda m: m[0]))
    assert report.odometry_dropped == {"repeated stamp": 1, "stamp goes back": 1}
    assert report.scans_dropped == {"repeated stamp": 1, "stamp goes back": 1}
    for frame in frames:
        np.testing.assert_allclose(frame.odometry, pose_at(MOTION, frame.stamp_ns), atol=1e-9)


def test_sweeps_of_another_lidar_or_without_returns_are_dropped(tmp_path):
    scan = scans(DRIVE)
    blind = replace(scan[4][2], stamp_ns=scan[4][0] + 7, ranges_m=np.full(360, np.nan, np.float32))
    other = replace(scan[5][2], stamp_ns=scan[5][0] + 7, frame_id="rear")
    extra = [(value.stamp_ns, "/scan", value) for value in (blind, other)]
    _, report = frames_of(tmp_path, sorted([*DRIVE, *extra], key=lambda m: m[0]))
    assert report.scans_dropped == {"no return between the range limits": 1, "frame 'rear' is not 'laser'": 1}


def test_clocks_that_never_meet_are_an_error_not_an_empty_result(tmp_path):
    late = [(s, t, replace(v, stamp_ns=v.stamp_ns + 3600 * SECOND_NS) if t == "/odom" else v) for s, t, v in DRIVE]
    with pytest.raises(LogError, match=r"none of the 20 sweeps has odometry: 20 sweeps dropped: before the") as error:
        frames_of(tmp_path, late)
    assert "header stamps: " in str(error.value)
    with pytest.raises(LogError, match="no sweep on /scan in the chosen time"):
        frames_of(tmp_path, DRIVE, start_ns=START_NS + 100 * SECOND_NS)


def test_start_and_end_choose_sweeps_not_odometry(tmp_path):
    low, high = START_NS + SECOND_NS, START_NS + 2 * SECOND_NS
    expected, _ = frames_of(tmp_path, DRIVE)
    frames, report = frames_of(tmp_path, DRIVE, start_ns=low, end_ns=high)
    assert [f.stamp_ns for f in frames] == [f.stamp_ns for f in expected if low <= f.stamp_ns < high]
    assert report.scans == 5
    np.testing.assert_array_equal(frames[0].odometry, expected[5].odometry)


def images(offset_ns, every_ns=SECOND_NS // 10, until_s=4.0):
    stamps = range(START_NS + offset_ns, START_NS + round(until_s * SECOND_NS), every_ns)
    return [(s, "/camera", CameraImage(s, "cam", "jpeg", str(s).encode())) for s in stamps]


CAMERA = Wanted(cameras=(CameraTopic("/camera"),))
SWEEP_NS = SECOND_NS // 10 * 359 // 360


def test_the_image_nearest_to_the_middle_of_the_sweep(tmp_path):
    pictures = images(offset_ns=30_000_000, until_s=4.2)
    messages = sorted([*DRIVE, *pictures], key=lambda m: m[0])
    frames, report = frames_of(tmp_path, messages, wanted=CAMERA)
    assert report.frames_without_image == 0
    assert report.images == len(frames)
    for frame in frames:
        (view,) = frame.views
        _, nearest = min((abs(s - frame.stamp_ns - SWEEP_NS // 2), s) for s, _, _ in pictures)
        assert view.image.stamp_ns == view.moment_ns == nearest
        # acceleration / 8 * step^2, as for points
        np.testing.assert_allclose(view.odometry, pose_at(MOTION, nearest), atol=2e-4)
    _, report = frames_of(tmp_path, messages, SyncConfig(image_tolerance_s=0.01), wanted=CAMERA)
    assert report.frames_without_image == 20


def test_two_cameras_and_a_clock_that_is_ahead(tmp_path):
    """t_camera = t_lidar + offset: the image belongs to an earlier moment than it says."""
    ahead_ns = 300_000_000
    left = images(offset_ns=50_000_000, until_s=4.2)
    right = [(s + ahead_ns, "/right", CameraImage(s + ahead_ns, "right", "jpeg", b"")) for s, _, _ in left]
    messages = sorted([*DRIVE, *left, *right], key=lambda m: m[0])
    both = Wanted(cameras=(CameraTopic("/camera"), CameraTopic("/right", ahead_ns)))
    frames, report = frames_of(tmp_path, messages, wanted=both)
    assert report.images == 2 * len(frames)
    for frame in frames:
        first, second = frame.views
        assert (first.topic, second.topic) == ("/camera", "/right")
        assert first.moment_ns == second.moment_ns == second.image.stamp_ns - ahead_ns
        np.testing.assert_array_equal(first.odometry, second.odometry)


@pytest.mark.parametrize("late_s", [0.0, 0.2, 0.8])
@pytest.mark.parametrize("rate_hz", [10, 60])
def test_a_fast_camera_and_sweeps_that_are_recorded_late(tmp_path, rate_hz, late_s):
    """The image nearest in time is as near as the camera's rate allows, though many came since."""
    late_ns = round((0.1 + late_s) * SECOND_NS)
    pictures = images(offset_ns=7_000_000, every_ns=SECOND_NS // rate_hz, until_s=5.2)
    late = [(s + late_ns if topic == "/scan" else s, topic, value) for s, topic, value in DRIVE]
    frames, report = frames_of(tmp_path, sorted([*late, *pictures], key=lambda m: m[0]), wanted=CAMERA)
    assert len(frames) == 20
    assert report.frames_without_image == 0
    for frame in frames:
        middle_ns = frame.stamp_ns + SWEEP_NS // 2
        nearest_ns = min((s for s, _, _ in pictures), key=lambda s: abs(s - middle_ns))
        assert frame.views[0].moment_ns == nearest_ns


def test_a_camera_that_dies_stops_no_frame(tmp_path):
    pictures = images(offset_ns=0, until_s=1.0)
    messages = sorted([*DRIVE, *pictures], key=lambda m: m[0])
    frames, report = frames_of(tmp_path, messages, SyncConfig(lookahead_s=0.5), wanted=CAMERA)
    assert len(frames) == 20
    assert report.frames_without_image == 15
    assert [f.stamp_ns for f in frames] == sorted(f.stamp_ns for f in frames)


def test_odometry_of_a_transform(tmp_path):
    def matrix(pose):
        c, s = np.cos(pose[2]), np.sin(pose[2])
        return np.array([[c, -s, 0, pose[0]], [s, c, 0, pose[1]], [0, 0, 1, 0], [0, 0, 0, 1]])

    links = [
        (s, "/tf", (Transform(s, "odom", "base_link", matrix(v.pose)), Transform(s, "map", "odom", np.eye(4))))
        for s, t, v in DRIVE
        if t == "/odom"
    ]
    messages = sorted([*[m for m in DRIVE if m[1] != "/odom"], *links], key=lambda m: m[0])
    expected, _ = frames_of(tmp_path, DRIVE)
    frames, _ = frames_of(tmp_path, messages, wanted=Wanted(odometry="odom->base_link"))
    for a, b in zip(frames, expected, strict=True):
        np.testing.assert_allclose(a.points.xyz_m, b.points.xyz_m, atol=1e-6)


def test_a_cloud_is_sliced_at_the_height_asked_for(tmp_path):
    def cloud(stamp_ns):
        scan = sweep(MOTION, stamp_ns)
        ring = np.stack([scan.ranges_m * np.cos(scan.angles_rad), scan.ranges_m * np.sin(scan.angles_rad)], axis=-1)
        low = np.hstack([ring, np.full((360, 1), 0.3)])
        high = np.hstack([ring * 0.5, np.full((360, 1), 1.5)])
        return PointCloud(stamp_ns, "laser", np.vstack([low, high]).astype(np.float32))

    static = (START_NS, "/tf_static", (Transform(START_NS, "base_link", "laser", np.eye(4), is_static=True),))
    messages = [
        static,
        *[m if m[1] == "/odom" else (m[0], "/points", cloud(m[0])) for m in DRIVE if m[1] != "/tf_static"],
    ]
    frames, _ = frames_of(tmp_path, messages)
    assert len(frames) == 20
    for frame in frames:
        assert on_walls(pose_at(MOTION, frame.stamp_ns), frame.points.xyz_m[:, :2]).max() < 1e-5
    frames, _ = frames_of(tmp_path, messages, SyncConfig(slice_low_m=1.4, slice_high_m=1.6))
    assert on_walls(pose_at(MOTION, frames[0].stamp_ns), frames[0].points.xyz_m[:, :2]).max() > 0.5


def test_the_whole_cloud_is_moved_as_the_slice_of_it_is(tmp_path):
    """A LiDAR turns once in 0.1 s while the robot drives and turns: all of a frame's cloud is on the walls of the room."""

    def cloud(stamp_ns):
        scan = sweep(MOTION, stamp_ns, mount=MOUNT, interval_s=0.1 / 360)
        ring = np.stack([scan.ranges_m * np.cos(scan.angles_rad), scan.ranges_m * np.sin(scan.angles_rad)], axis=-1)
        rings = [np.column_stack([ring, np.full(360, z)]) for z in (0.3, 0.6, 1.5)]
        offsets = np.tile(np.arange(360) * (0.1 / 360), 3)
        return PointCloud(stamp_ns, "laser", np.vstack(rings).astype(np.float32), offsets_s=offsets.astype(np.float32))

    messages = [(m[0], "/points", cloud(m[0])) if m[1] == "/scan" else m for m in DRIVE]
    messages = sorted([*messages, *images(offset_ns=0, until_s=4.2)], key=lambda m: m[0])
    frames, _ = frames_of(tmp_path, messages, wanted=CAMERA)
    assert len(frames) == 20
    for frame in frames:
        assert frame.cloud_m.dtype == np.float32
        # 50 Hz odometry interpolated, as for points
        assert on_walls(pose_at(MOTION, frame.stamp_ns), frame.cloud_m[:, :2]).max() < 2e-4
        in_time = np.argsort(frame.points.offsets_s)
        np.testing.assert_allclose(frame.cloud_m[:360], frame.points.xyz_m[in_time], atol=2e-5)
        np.testing.assert_allclose(frame.cloud_m[[0, 360, 720], 2], [0.3, 0.6, 1.5], atol=1e-6)


@given(st.lists(st.integers(0, 50), min_size=2, max_size=40), st.integers(0, 50), st.integers(0, 50))
def test_the_buffer_answers_as_if_it_held_everything(stamps, forget, at):
    """Against the plain formula over the whole history."""
    buffer = OdometryBuffer()
    kept = []
    for stamp in stamps:
        buffer.add(stamp, np.array([stamp, -stamp, 0.0]))
        if not kept or stamp > kept[-1]:
            kept.append(stamp)
    assert sum(buffer.dropped.values()) == len(stamps) - len(kept)
    buffer.forget_before(forget)
    if not max(forget, kept[0]) <= at <= kept[-1]:
        return
    np.testing.assert_allclose(buffer.poses_at(np.array([at])), [[at, -at, 0]], atol=1e-9)
    bridged = [b - a for a, b in pairwise(kept) if a < at < b]
    assert buffer.gap_between(at, at) == max(bridged, default=0)
    high = next((k for k, s in enumerate(kept) if s >= at), len(kept))
    history = [b - a for a, b in pairwise(kept[: high + 1])]
    assert buffer.take_gap(at) == max(history, default=0)
    assert buffer.take_gap(at) <= max(bridged, default=0)


def test_memory_does_not_grow_with_the_log(tmp_path, monkeypatch):
    """Buffers hold what is in flight: at most a lookahead of odometry, whatever the length of the log."""
    sizes = []
    original = OdometryBuffer.add

    def watched(self, stamp_ns, pose):
        original(self, stamp_ns, pose)
        sizes.append(len(self._stamps))

    monkeypatch.setattr(OdometryBuffer, "add", watched)
    odometry = [(START_NS + k * SECOND_NS // 50, k) for k in range(3000)]
    messages = [(s, "/odom", Odometry(s, np.array([k * 0.001, 0, 0]))) for s, k in odometry]
    messages = sorted([DRIVE[0], *messages, *scans(DRIVE)], key=lambda m: m[0])
    frames_of(tmp_path, messages, SyncConfig(lookahead_s=1.0))
    assert len(sizes) == 3000
    assert max(sizes) < 100


def test_images_are_held_no_longer_than_a_sweep_may_ask_for_them(tmp_path, monkeypatch):
    """Of a camera at 100 Hz, with a sweep every 0.2 s: those since a tolerance before the last sweep."""
    held = []
    original = Eyes.take

    def watched(self, topic, image):
        taken = original(self, topic, image)
        held.append(len(list(self.held)))
        return taken

    monkeypatch.setattr(Eyes, "take", watched)
    pictures = images(offset_ns=0, every_ns=SECOND_NS // 100, until_s=4.2)
    frames_of(tmp_path, sorted([*DRIVE, *pictures], key=lambda m: m[0]), wanted=CAMERA)
    assert len(held) == 420
    assert max(held[:380]) <= 20 + 6 + 1
    # nothing asks any more: a second and the tolerance
    assert max(held) <= 106 + 2
