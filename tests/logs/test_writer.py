"""Result files: read back by us, by rosbags and by the mcap library; whole or not there; the same bytes twice."""

from __future__ import annotations

import json

import numpy as np
import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from tests.logs.drawn import SECOND_NS, START_NS
from wallkit.core.geometry import compose, relative
from wallkit.core.types import Estimate, Health, OccupancyGrid, Odometry, StampedPose, Trajectory
from wallkit.errors import OutputError
from wallkit.logs.annotations import Drawn
from wallkit.logs.frames import moving_transforms
from wallkit.logs.layout import foxglove_layout, write_layout
from wallkit.logs.reader import open_log
from wallkit.logs.results import ResultWriter
from wallkit.logs.topics import pick_truth
from wallkit.logs.trajectories import trajectory_of
from wallkit.logs.writer import LATCHED_QOS, McapWriter

STEPS = 12
STAMPS = START_NS + np.arange(STEPS, dtype=np.int64) * SECOND_NS // 10 + 7
POSES = np.stack([np.linspace(0, 2, STEPS), np.sin(np.linspace(0, 1, STEPS)), np.linspace(3.0, 3.3, STEPS)], axis=-1)
ODOMETRY = compose([1.0, -1.0, 0.5], POSES)
COVARIANCE = np.diag([0.01, 0.02, 0.03])
SQUARE = np.array([[10.0, 20.0], [30.0, 20.0], [30.0, 40.0]])
BLUE = (0.0, 0.0, 1.0, 0.5)
GRID = OccupancyGrid(np.arange(-1, 11, dtype=np.int8).reshape(3, 4), 0.05, np.array([1.0, 2.0, 0.3]))


def write_results(path):
    rng = np.random.default_rng(1)
    with ResultWriter(path, base="base_footprint") as result:
        result.metadata({"version": "1", "config": "{}"})
        result.grid(int(STAMPS[0]), GRID)
        for k, stamp in enumerate(STAMPS.tolist()):
            result.pose(Estimate(stamp, POSES[k], COVARIANCE, Health.LOCALIZED))
            result.odometry(stamp, ODOMETRY[k])
            result.transforms(stamp, compose(POSES[k], relative(ODOMETRY[k], np.zeros(3))), ODOMETRY[k])
            result.particles(stamp, rng.normal(size=(50, 3)), np.full(50, 0.02))
            for name in ("kept", "rejected"):
                result.points(stamp, name, rng.normal(size=(k, 3)).astype(np.float32), np.ones(k, np.float32))
                result.filtered(stamp, name, rng.normal(size=(k, 3)).astype(np.float32), np.ones(k, np.float32))
            result.annotations(stamp, "front", [Drawn("loop", SQUARE, BLUE, BLUE), Drawn("points", SQUARE[:k], BLUE)])
            result.health(stamp, Health.UNCERTAIN, "two hypotheses", {"hit_ratio": 0.9, "ess": 40.0})
            result.error(stamp, 0.1, 0.01)
            result.truth(stamp, POSES[k] + [0.1, 0, 0])
            result.path(stamp, Trajectory(STAMPS[: k + 1], POSES[: k + 1]))
    return path


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    return write_results(tmp_path_factory.mktemp("result") / "result.mcap")


TOPICS = {
    "/wallkit/pose": "geometry_msgs/msg/PoseWithCovarianceStamped",
    "/wallkit/odometry": "nav_msgs/msg/Odometry",
    "/wallkit/path": "nav_msgs/msg/Path",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/wallkit/particles": "geometry_msgs/msg/PoseArray",
    "/wallkit/particles/cloud": "sensor_msgs/msg/PointCloud2",
    "/wallkit/scan/kept": "sensor_msgs/msg/PointCloud2",
    "/wallkit/scan/rejected": "sensor_msgs/msg/PointCloud2",
    "/wallkit/filter/kept": "sensor_msgs/msg/PointCloud2",
    "/wallkit/filter/rejected": "sensor_msgs/msg/PointCloud2",
    "/wallkit/camera/front/annotations": "foxglove_msgs/msg/ImageAnnotations",
    "/wallkit/map": "nav_msgs/msg/OccupancyGrid",
    "/wallkit/health": "diagnostic_msgs/msg/DiagnosticArray",
    "/wallkit/health/state": "std_msgs/msg/Float64",
    "/wallkit/health/hit_ratio": "std_msgs/msg/Float64",
    "/wallkit/health/ess": "std_msgs/msg/Float64",
    "/wallkit/error/position_m": "std_msgs/msg/Float64",
    "/wallkit/error/heading_rad": "std_msgs/msg/Float64",
    "/ground_truth/pose": "geometry_msgs/msg/PoseStamped",
}


def test_rosbags_reads_every_message_and_its_bytes_are_what_rosbags_writes(result):
    last = {}
    counts = {}
    with AnyReader([result]) as reader:
        for connection, log_ns, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            assert bytes(reader.typestore.serialize_cdr(message, connection.msgtype)) == data
            last[connection.topic] = message
            counts[connection.topic] = counts.get(connection.topic, 0) + 1
            if hasattr(message, "header"):
                assert message.header.stamp.sec * SECOND_NS + message.header.stamp.nanosec == log_ns
        assert {c.topic: c.msgtype for c in reader.connections} == TOPICS
    assert counts == dict.fromkeys(TOPICS, STEPS) | {"/wallkit/map": 1}

    pose = last["/wallkit/pose"].pose
    np.testing.assert_allclose([pose.pose.position.x, pose.pose.position.y], POSES[-1, :2])
    np.testing.assert_allclose(pose.covariance.reshape(6, 6)[np.ix_((0, 1, 5), (0, 1, 5))], COVARIANCE)
    path = last["/wallkit/path"].poses
    assert len(path) == STEPS
    for pose, expected, stamp in zip(path, POSES, STAMPS.tolist(), strict=True):
        assert pose.header.stamp.sec * SECOND_NS + pose.header.stamp.nanosec == stamp
        np.testing.assert_allclose([pose.pose.position.x, pose.pose.position.y], expected[:2])
        half = expected[2] / 2
        np.testing.assert_allclose([pose.pose.orientation.z, pose.pose.orientation.w], [np.sin(half), np.cos(half)])
    assert len(last["/wallkit/particles"].poses) == 50
    assert last["/wallkit/scan/kept"].width == STEPS - 1
    loop, points = last["/wallkit/camera/front/annotations"].points
    assert (loop.type, points.type) == (loop.LINE_LOOP, points.POINTS)
    # half a pixel: Foxglove's origin is the corner of the first one
    assert [(p.x, p.y) for p in loop.points] == [(10.5, 20.5), (30.5, 20.5), (30.5, 40.5)]
    assert len(points.points) == min(STEPS - 1, 3)
    assert (loop.fill_color.b, loop.fill_color.a, loop.thickness) == (1.0, 0.5, 2.0)
    status = last["/wallkit/health"].status[0]
    assert (status.level, status.message) == (1, "UNCERTAIN: two hypotheses")
    assert {v.key: v.value for v in status.values} == {"hit_ratio": "0.9", "ess": "40"}
    assert last["/wallkit/health/state"].data == 1.0
    grid = last["/wallkit/map"]
    assert (grid.info.width, grid.info.height) == (4, 3)
    np.testing.assert_array_equal(grid.data, GRID.cells.ravel())


def test_we_read_our_own_results(result):
    log = open_log([result])
    truth = trajectory_of(log, pick_truth(log))
    np.testing.assert_array_equal(truth.stamps_ns, STAMPS)
    np.testing.assert_allclose(truth.poses[:, 0], POSES[:, 0] + 0.1)
    np.testing.assert_array_equal(log.static.maps["/wallkit/map"].cells, GRID.cells)
    np.testing.assert_allclose(log.static.maps["/wallkit/map"].origin, GRID.origin)
    found = moving_transforms(log, ["/tf"]).poses_at("map", "base_footprint", STAMPS)
    np.testing.assert_allclose(np.exp(1j * found), np.exp(1j * POSES), atol=1e-9)
    assert not log.loss


def test_profile_metadata_and_latched_topics(result):
    with result.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        header, summary = reader.get_header(), reader.get_summary()
        metadata = list(reader.iter_metadata())
    assert (header.profile, header.library) == ("ros2", "wallkit")
    assert [(m.name, m.metadata) for m in metadata] == [("wallkit", {"config": "{}", "version": "1"})]
    qos = {c.topic: c.metadata["offered_qos_profiles"] for c in summary.channels.values()}
    assert qos["/wallkit/map"] == LATCHED_QOS
    assert qos["/wallkit/pose"] == ""


def test_the_same_input_gives_the_same_bytes(tmp_path, result):
    assert write_results(tmp_path / "again.mcap").read_bytes() == result.read_bytes()


def test_a_failed_run_leaves_nothing_behind(tmp_path):
    path = tmp_path / "result.mcap"
    path.write_bytes(b"an older result")

    def fails():
        with ResultWriter(path) as result:
            result.odometry(1, np.zeros(3))
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fails()
    assert [p.name for p in tmp_path.iterdir()] == ["result.mcap"]
    assert path.read_bytes() == b"an older result"


def test_a_place_that_cannot_be_written(tmp_path):
    with pytest.raises(OutputError, match="cannot be written"):
        McapWriter(tmp_path / "missing" / "result.mcap")


def test_empty_things_are_written(tmp_path):
    path = tmp_path / "result.mcap"
    with ResultWriter(path) as result:
        result.path(1, Trajectory(np.zeros(0, np.int64), np.zeros((0, 3))))
        result.path(2, Trajectory(np.array([5]), np.array([[1.0, 2, 3]])))
        result.particles(3, np.zeros((0, 3)), np.zeros(0))
        result.health(4, Health.LOST, "", {})
    with AnyReader([path]) as reader:
        found = [reader.deserialize(data, c.msgtype) for c, _, data in reader.messages()]
    assert [len(m.poses) for m in found[:3]] == [0, 1, 0]


def test_any_core_type_can_be_written_and_topics_may_hold_two_types(tmp_path):
    path = tmp_path / "log.mcap"
    with McapWriter(path) as file:
        file.write("/pose", StampedPose(5, "map", np.zeros(3)), 5)
        file.write("/pose", Odometry(6, np.zeros(3)), 6)
    assert [type(m.value) for m in open_log([path]).messages()] == [StampedPose, Odometry]


def test_the_layout_shows_every_topic_that_is_written(tmp_path, result):
    path = tmp_path / "layout.json"
    write_layout(path, cameras={"/camera": "/wallkit/camera/front/annotations"})
    layout = json.loads(path.read_text())

    def panels(node):
        return [node] if isinstance(node, str) else panels(node["first"]) + panels(node["second"])

    assert sorted(panels(layout["layout"])) == sorted(layout["configById"])
    assert "Image!camera" in panels(layout["layout"])
    assert "Image!camera" not in panels(foxglove_layout()["layout"])
    written = {c.topic for c in open_log([result]).channels}
    shown = set(layout["configById"]["3D!scene"]["topics"])
    lines = [line for panel in layout["configById"].values() for line in panel.get("paths", [])]
    plotted = {line["value"].removesuffix(".data") for line in lines}
    assert shown <= written
    assert plotted - written <= {"/wallkit/health/short_ratio", "/wallkit/health/long_ratio"}
