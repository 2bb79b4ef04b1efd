"""The logs that people really record: what must come out of each is written in the data folder's README."""

from __future__ import annotations

import numpy as np
import pytest

from wallkit.core.geometry import pose_from_matrix
from wallkit.errors import LogError
from wallkit.logs.convert import convert_log
from wallkit.logs.frames import FrameTree
from wallkit.logs.info import describe
from wallkit.logs.mount import transforms_from_urdf
from wallkit.logs.reader import open_log
from wallkit.logs.rig import Wanted, find_rig
from wallkit.logs.sync import SyncReport, synchronise
from wallkit.logs.topics import pick_truth
from wallkit.logs.trajectories import trajectory_of

pytestmark = pytest.mark.data
MIT = "mit_rss/localization_bag1_2022-03-29-19-23-29.bag"
OLIN = "olin_tb4/macfirst_floor_take_2"


def frames_of(path, wanted=None):
    log = open_log([path])
    report = SyncReport()
    return list(synchronise(log, find_rig(log, wanted), report=report)), report, log


@pytest.mark.parametrize(
    ("name", "scans", "beams", "gap_s"),
    [
        ("carmen/csail", 406, 361, 0.222),
        ("carmen/intel", 910, 180, 3.31),
        ("carmen/aces", 440, 180, 3.03),
        ("carmen/freiburg-101", 292, 360, 1.009),
        ("carmen/seattle", 241, 361, 5.74),
        ("wean/wean1", 713, 180, 0.831),
        ("robustness/kidnapped_150s_to_210s", 341, 361, 60.391),
    ],
)
def test_every_sweep_becomes_a_frame(data, name, scans, beams, gap_s):
    frames, report, log = frames_of(data / f"logs/{name}.mcap")
    assert len(frames) == report.scans == scans
    assert report.odometry_gap_max_s == pytest.approx(gap_s, abs=1e-3)
    assert sum(f.odometry_gap_s > 10 for f in frames) == (name == "robustness/kidnapped_150s_to_210s")
    assert np.all(np.diff([f.stamp_ns for f in frames]) > 0)
    assert all(len(f.points.beams) + len(f.points.misses_rad) == beams for f in frames)
    assert not log.loss


@pytest.mark.parametrize("name", ["csail", "intel"])
def test_truth_is_the_same_as_in_the_tum_file(data, name):
    log = open_log([data / f"logs/carmen/{name}.mcap"])
    truth = trajectory_of(log, pick_truth(log))
    tum = np.loadtxt(data / f"logs/carmen/{name}.gt.tum")
    np.testing.assert_allclose(truth.stamps_ns * 1e-9, tum[:, 0], atol=1e-5)
    np.testing.assert_allclose(truth.poses[:, :2], tum[:, 1:3], atol=1e-5)
    yaw = 2 * np.arctan2(tum[:, 6], tum[:, 7])
    np.testing.assert_allclose(np.exp(1j * truth.poses[:, 2]), np.exp(1j * yaw), atol=1e-5)


@pytest.mark.parametrize(
    "name", ["log_time_plus_8days", "unchunked", "empty_profile", "no_index_no_summary", "trailing_garbage"]
)
def test_odd_files_give_the_same_frames(data, name):
    expected, _, _ = frames_of(data / "logs/carmen/csail.mcap")
    found, _, _ = frames_of(data / f"logs/robustness/{name}.mcap")
    assert len(found) == len(expected)
    for a, b in zip(found, expected, strict=True):
        assert (a.stamp_ns, a.odometry_gap_s) == (b.stamp_ns, b.odometry_gap_s)
        np.testing.assert_array_equal(a.odometry, b.odometry)
        np.testing.assert_array_equal(a.points.xyz_m, b.points.xyz_m)
        np.testing.assert_array_equal(a.points.misses_rad, b.points.misses_rad)


def test_the_mount_as_words_is_the_mount_of_tf_static(data):
    expected, _, _ = frames_of(data / "logs/carmen/csail.mcap")
    with pytest.raises(LogError, match="--lidar-pose"):
        frames_of(data / "logs/robustness/no_tf_static.mcap")
    found, _, _ = frames_of(data / "logs/robustness/no_tf_static.mcap", Wanted(lidar_pose="0,0,0"))
    np.testing.assert_array_equal(found[200].points.xyz_m, expected[200].points.xyz_m)


@pytest.mark.parametrize(
    ("name", "frames", "lost"), [("truncated_60pct", 146, "file ends inside"), ("bitflip_mid_chunk", 245, "chunk")]
)
def test_broken_files_give_what_is_whole(data, name, frames, lost):
    found, _, log = frames_of(data / f"logs/robustness/{name}.mcap")
    assert len(found) == frames
    assert lost in log.loss.lines()[0]
    assert log.loss


@pytest.mark.parametrize(("name", "words"), [("no_scan", "LiDAR scan"), ("no_odom", "no odometry topic")])
def test_what_is_missing_is_said(data, name, words):
    path = data / f"logs/robustness/{name}.mcap"
    with pytest.raises(LogError, match=words):
        frames_of(path)
    info = describe(open_log([path]))
    assert not info.can_localize
    assert words in info.reasons[0]


def test_transforms_can_stand_in_for_odometry_when_named(data):
    expected, _, _ = frames_of(data / "logs/carmen/csail.mcap")
    found, _, _ = frames_of(data / "logs/robustness/no_odom.mcap", Wanted(odometry="odom->base_link"))
    np.testing.assert_allclose(found[300].odometry, expected[300].odometry, atol=1e-9)


def test_a_turtlebot_whose_lidar_looks_sideways(data):
    """rosbag2 SQLite without definitions, 35 static transforms of three publishers; the LiDAR is turned by 90 deg."""
    frames, report, log = frames_of(data / "logs" / OLIN)
    rig = find_rig(log)
    assert (rig.base_frame, rig.lidar_frame) == ("base_link", "rplidar_link")
    assert pose_from_matrix(rig.mount.matrix)[2] == pytest.approx(np.pi / 2, abs=1e-3)
    assert (len(frames), report.scans) == (354, 357)
    assert report.share_dropped == 0
    assert len(log.static.transforms) == 35
    turns = np.abs(np.diff(np.unwrap([f.odometry[2] for f in frames])))
    assert turns.max() > 0.1  # it turns fast enough for the motion during a sweep to matter


def test_the_same_turtlebot_by_its_urdf(data):
    """With /tf_static ignored, the robot_description leads to the same mount."""
    log = open_log([data / "logs" / OLIN])
    (text,) = log.static.robot_descriptions.values()
    by_urdf = FrameTree(transforms_from_urdf(text, "robot_description")).lookup("base_link", "rplidar_link")
    np.testing.assert_allclose(by_urdf, find_rig(log).mount.matrix, atol=1e-6)


def test_a_racing_car_without_transforms(data):
    path = data / "logs" / MIT
    with pytest.raises(LogError, match="sits on the robot 'base_link'"):
        frames_of(path)
    frames, report, _ = frames_of(path, Wanted(lidar_pose="0.275,0,0"))
    assert (len(frames), report.scans, report.share_dropped) == (278, 281, 0)
    assert all(len(f.points.beams) + len(f.points.misses_rad) > 1070 for f in frames)


@pytest.mark.parametrize(("name", "frames"), [("target_before", 856), ("target_after", 728)])
def test_kidnapped_robots_recorded_eight_days_late(data, name, frames):
    """A recorded localizer's map->odom is no truth; scans are in the base frame; stamps are 8 days before record time."""
    found, report, log = frames_of(data / f"logs/okazaki_kidnap/2018/dec13/{name}.bag")
    assert len(found) == frames
    assert report.share_dropped == 0
    assert pick_truth(log) is None
    info = describe(log)
    assert info.can_localize
    scan = next(t for t in info.topics if t.topic == "/scan")
    assert scan.clock_offset_s[0] > 8 * 86400
    assert info.duration_s < 100


def test_people_without_odometry(data):
    with pytest.raises(LogError, match="no topic that could be odometry"):
        frames_of(data / "logs/leg_tracker/demo_stationary_simple_environment.bag")


@pytest.mark.parametrize("name", [OLIN, MIT])
def test_converted_logs_give_the_same_frames(data, tmp_path, name):
    wanted = Wanted(lidar_pose="0,0,0.1")
    expected, _, log = frames_of(data / "logs" / name, wanted)
    report = convert_log(log, tmp_path / "out.mcap")
    assert not report.skipped
    found, _, _ = frames_of(tmp_path / "out.mcap", wanted)
    assert len(found) == len(expected)
    np.testing.assert_array_equal(found[100].points.xyz_m, expected[100].points.xyz_m)
    np.testing.assert_array_equal(found[100].odometry, expected[100].odometry)
