"""One candidate is taken, several are listed with rate and frame, none is guessed."""

from __future__ import annotations

import numpy as np
import pytest

from tests.logs.drawn import SECOND_NS, START_NS, drive, log_of, pose_at, write
from wallkit.core.types import CameraImage, Odometry, PointCloud, StampedPose, Transform
from wallkit.errors import LogError
from wallkit.logs.reader import open_log
from wallkit.logs.topics import (
    is_truth_name,
    pick_image,
    pick_initial_pose,
    pick_odometry,
    pick_scan,
    pick_truth,
)
from wallkit.logs.trajectories import first_pose, trajectory_of

DRIVE = log_of(drive(), seconds=1)
SCANS = [(s, t, v) for s, t, v in DRIVE if t == "/scan"]
ODOMETRY = [(s, t, v) for s, t, v in DRIVE if t == "/odom"]
COVARIANCE = np.eye(3)


def renamed(messages, topic):
    return [(s, topic, v) for s, _, v in messages]


def log_with(tmp_path, *groups):
    return open_log([write(tmp_path / "log.mcap", sorted((m for g in groups for m in g), key=lambda m: m[0]))])


def poses(topic, covariance=None):
    return [(s, topic, StampedPose(s, "map", v.pose, covariance)) for s, _, v in ODOMETRY]


def images(topic):
    return [(START_NS + k, topic, CameraImage(START_NS + k, "cam", "jpeg", b"x")) for k in range(3)]


def links(parent, child):
    return [(s, "/tf", (Transform(s, parent, child, np.eye(4)),)) for s, _, _ in ODOMETRY]


def test_the_only_candidate_is_taken(tmp_path):
    log = log_with(tmp_path, DRIVE)
    assert pick_scan(log).topic == "/scan"
    assert str(pick_odometry(log)) == "/odom"
    assert pick_truth(log) is None
    assert pick_image(log) is None
    assert pick_initial_pose(log) is None


def test_several_candidates_are_listed_with_type_rate_frame_and_flag(tmp_path):
    log = log_with(tmp_path, DRIVE, renamed(SCANS, "/scan_rear"))
    with pytest.raises(LogError) as error:
        pick_scan(log)
    text = str(error.value)
    assert "/scan  sensor_msgs/msg/LaserScan  5.0 Hz  frame laser" in text
    assert "/scan_rear  sensor_msgs/msg/LaserScan  5.0 Hz  frame laser" in text
    assert "--scan /scan" in text
    assert pick_scan(log, "scan_rear").topic == "/scan_rear"


def test_a_name_that_is_none_gets_the_closest(tmp_path):
    log = log_with(tmp_path, DRIVE)
    with pytest.raises(LogError, match="did you mean '/scan'"):
        pick_scan(log, "/scann")
    with pytest.raises(LogError, match="no topic '/odom' that could be LiDAR scan"):
        pick_scan(log, "/odom")
    with pytest.raises(LogError, match="the log has no topic that could be ground truth"):
        pick_truth(log_with(tmp_path, SCANS), "/gt")


def test_what_is_missing_is_said_with_what_is_there(tmp_path):
    with pytest.raises(LogError, match=r"no topic that could be LiDAR scan; it holds /odom \(nav_msgs/msg/Odometry\)"):
        pick_scan(log_with(tmp_path, ODOMETRY))
    with pytest.raises(LogError, match="no topic that could be odometry"):
        pick_odometry(log_with(tmp_path, SCANS))


def test_clouds_are_scans_only_where_there_is_no_scan(tmp_path):
    cloud = [(START_NS, "/points", PointCloud(START_NS, "lidar", np.ones((2, 3), np.float32)))]
    assert pick_scan(log_with(tmp_path, DRIVE, cloud)).topic == "/scan"
    assert pick_scan(log_with(tmp_path, DRIVE, cloud), "/points").topic == "/points"
    assert pick_scan(log_with(tmp_path, ODOMETRY, cloud)).topic == "/points"


@pytest.mark.parametrize("topic", ["/ground_truth/pose", "/groundtruth", "/gt_pose", "/base/truth", "/robot/GT"])
def test_names_of_truth(topic, tmp_path):
    assert is_truth_name(topic)
    log = log_with(tmp_path, DRIVE, poses(topic))
    assert str(pick_truth(log)) == topic
    assert str(pick_odometry(log_with(tmp_path, DRIVE, renamed(ODOMETRY, topic)))) == "/odom"


@pytest.mark.parametrize("topic", ["/amcl_pose", "/pose", "/length", "/wifi_strength", "/agt"])
def test_names_of_no_truth(topic, tmp_path):
    assert not is_truth_name(topic)
    log = log_with(tmp_path, DRIVE, poses(topic, COVARIANCE))
    assert pick_truth(log) is None
    assert str(pick_truth(log, topic)) == topic


def test_initial_pose_and_images_by_name_and_type(tmp_path):
    log = log_with(
        tmp_path, DRIVE, poses("/initialpose", COVARIANCE)[:1], images("/camera/color"), images("/camera/depth")
    )
    assert pick_initial_pose(log).topic == "/initialpose"
    np.testing.assert_allclose(first_pose(log, pick_initial_pose(log)).pose, ODOMETRY[0][2].pose, atol=1e-9)
    assert pick_image(log).topic == "/camera/color"
    assert pick_image(log, "/camera/depth").topic == "/camera/depth"


def test_transforms_are_odometry_only_when_named(tmp_path):
    log = log_with(tmp_path, SCANS, links("odom", "base_link"), links("map", "odom"))
    with pytest.raises(LogError, match="--odom 'odom->base_link'"):
        pick_odometry(log)
    track = pick_odometry(log, "odom->base_link")
    assert (track.topics, track.parent, track.child) == (("/tf",), "odom", "base_link")
    with pytest.raises(LogError, match="TF has no transform odom->base; it holds odom->base_link, map->odom"):
        pick_odometry(log, "odom->base")


def test_a_localizers_transform_is_truth_only_when_named(tmp_path):
    def link(parent, child, pose):
        c, s = np.cos(pose[2]), np.sin(pose[2])
        matrix = np.array([[c, -s, 0, pose[0]], [s, c, 0, pose[1]], [0, 0, 1, 0], [0, 0, 0, 1]])
        return lambda stamp: (stamp, "/tf", (Transform(stamp, parent, child, matrix),))

    correction = np.array([1.0, -2.0, np.pi / 2])
    moving = [link("odom", "base_link", v.pose)(s) for s, _, v in ODOMETRY]
    fixed = [link("map", "odom", correction)(s) for s, _, _ in ODOMETRY]
    log = log_with(tmp_path, SCANS, moving, fixed)
    assert pick_truth(log) is None
    truth = trajectory_of(log, pick_truth(log, "map->base_link"))
    x, y, _ = np.array([pose_at(drive(), int(s)) for s in truth.stamps_ns]).T
    np.testing.assert_allclose(truth.poses[:, :2], np.stack([1 - y, -2 + x], axis=-1), atol=1e-9)
    assert truth.frame_id == "map"
    np.testing.assert_allclose(trajectory_of(log, pick_odometry(log, "odom->base_link")).poses[:, 0], x, atol=1e-9)


def test_a_trajectory_ascends_and_is_never_empty(tmp_path):
    twice = [*ODOMETRY, (ODOMETRY[-1][0] + 1, "/odom", Odometry(START_NS, np.ones(3)))]
    log = log_with(tmp_path, twice)
    track = pick_odometry(log)
    trajectory = trajectory_of(log, track)
    assert len(trajectory) == len(ODOMETRY)
    assert np.all(np.diff(trajectory.stamps_ns) > 0)
    assert len(trajectory_of(log, track, start_ns=START_NS + SECOND_NS // 2)) == 26
    with pytest.raises(LogError, match="no pose in the chosen time"):
        trajectory_of(log, track, start_ns=START_NS + 100 * SECOND_NS)
