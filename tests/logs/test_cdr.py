"""Hand-read and hand-written CDR agree with rosbags, for any content."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_typestore

from wallkit.core.geometry import matrix_from_quaternion, quaternions_from_matrices
from wallkit.core.types import (
    CameraImage,
    CameraInfo,
    OccupancyGrid,
    Odometry,
    PointCloud,
    Scan,
    StampedPose,
    Transform,
)
from wallkit.logs.cdr import beam_angles, odometry_from_cdr, planar_pose, scan_from_cdr, transforms_from_cdr
from wallkit.logs.decode import FAST_DECODERS, decoder
from wallkit.logs.encode import ENCODERS, encode
from wallkit.logs.loss import Loss
from wallkit.logs.message import Channel

STORE = get_typestore(Stores.ROS2_HUMBLE)
T = STORE.types
names = st.text(st.characters(codec="utf-8", exclude_characters="\0/"), max_size=12)
stamps = st.integers(0, 2**31 * 10**9 - 1)
metres = st.floats(-1e6, 1e6)
yaws = st.floats(-3.14, 3.14)
quaternions = st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: sum(v * v for v in q) > 1e-3)


def time_message(stamp_ns):
    return T["builtin_interfaces/msg/Time"](sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)


def header(stamp_ns, frame_id):
    return T["std_msgs/msg/Header"](stamp=time_message(stamp_ns), frame_id=frame_id)


def vector(kind, xyz):
    return T[f"geometry_msgs/msg/{kind}"](*xyz)


def rosbags_bytes(message):
    return bytes(STORE.serialize_cdr(message, message.__msgtype__))


def read_again(kind, value, *, is_static=False):
    """A value after our encoder and rosbags' own idea of the same bytes."""
    name, data = encode(value)
    assert rosbags_bytes(STORE.deserialize_cdr(data, name)) == data, "rosbags reads and writes the same bytes"
    channel = Channel("/tf_static" if is_static else "/topic", name, "cdr")
    return decoder(channel, Loss())(data)


@given(stamps, names, names, metres, metres, quaternions)
def test_odometry_as_rosbags_says(stamp_ns, frame, child, x, y, q):
    pose = T["geometry_msgs/msg/Pose"](vector("Point", (x, y, 0.3)), vector("Quaternion", q))
    twist = T["geometry_msgs/msg/Twist"](vector("Vector3", (1, 2, 3)), vector("Vector3", (4, 5, 6)))
    message = T["nav_msgs/msg/Odometry"](
        header(stamp_ns, frame),
        child,
        T["geometry_msgs/msg/PoseWithCovariance"](pose, np.zeros(36)),
        T["geometry_msgs/msg/TwistWithCovariance"](twist, np.zeros(36)),
    )
    odometry = odometry_from_cdr(rosbags_bytes(message))
    matrix = matrix_from_quaternion((x, y, 0), q)
    assert (odometry.stamp_ns, odometry.frame_id, odometry.child_frame_id) == (stamp_ns, frame, child)
    np.testing.assert_allclose(odometry.pose[:2], [x, y])
    if np.hypot(matrix[0, 0], matrix[1, 0]) > 1e-6:  # looking straight up there is no heading
        heading = np.arctan2(matrix[1, 0], matrix[0, 0])
        np.testing.assert_allclose(np.exp(1j * odometry.pose[2]), np.exp(1j * heading), atol=1e-6)


@given(stamps, names, st.lists(st.floats(width=32), max_size=40), st.floats(-3, 3, width=32))
def test_scan_as_rosbags_says(stamp_ns, frame, ranges, angle_min):
    ranges = np.array(ranges, np.float32)
    numbers = np.float32([angle_min, 1.0, -0.01, 1e-4, 0.1, 0.05, 30.0])
    message = T["sensor_msgs/msg/LaserScan"](header(stamp_ns, frame), *(float(v) for v in numbers), ranges, ranges[:3])
    scan = scan_from_cdr(rosbags_bytes(message))
    assert (scan.stamp_ns, scan.frame_id) == (stamp_ns, frame)
    np.testing.assert_array_equal(scan.ranges_m, ranges)
    np.testing.assert_allclose(scan.angles_rad, angle_min - 0.01 * np.arange(len(ranges)), atol=1e-5)
    assert (scan.beam_interval_s, scan.range_min_m, scan.range_max_m) == tuple(numbers[[3, 5, 6]].tolist())


@given(st.lists(st.tuples(stamps, names, names, st.tuples(metres, metres, metres), quaternions), max_size=4))
def test_transforms_as_rosbags_says(rows):
    message = T["tf2_msgs/msg/TFMessage"](
        [
            T["geometry_msgs/msg/TransformStamped"](
                header(stamp_ns, parent),
                child,
                T["geometry_msgs/msg/Transform"](vector("Vector3", t), vector("Quaternion", q)),
            )
            for stamp_ns, parent, child, t, q in rows
        ]
    )
    found = transforms_from_cdr(rosbags_bytes(message), is_static=True)
    assert [(t.stamp_ns, t.parent, t.child, t.is_static) for t in found] == [(*row[:3], True) for row in rows]
    for transform, (*_, translation, q) in zip(found, rows, strict=True):
        np.testing.assert_allclose(transform.matrix, matrix_from_quaternion(translation, q))


@pytest.mark.parametrize("kind", FAST_DECODERS)
def test_damaged_bytes_are_no_message(kind):
    package, _, name = kind.rpartition("/")
    values = {
        "Odometry": Odometry(1, np.zeros(3)),
        "LaserScan": Scan(1, "l", np.ones(9, np.float32), np.arange(9, dtype=np.float32) * 0.1, 0, 0, 1),
        "TFMessage": (Transform(1, "a", "b", np.eye(4)),),
    }
    type_name, data = encode(values[name])
    assert type_name == f"{package}/msg/{name}"
    decode = decoder(Channel("/t", type_name, "cdr"), Loss())
    assert decode(data)
    for damaged in (b"", data[:3], data[: len(data) // 2], data + bytes(16), b"\xff\xff" + data[2:]):
        with pytest.raises(ValueError):
            decode(damaged)


def test_big_endian_goes_through_rosbags():
    name, data = encode(Odometry(5, np.array([1.0, 2.0, 0.5]), "odom", "base"))
    big = bytes(STORE.serialize_cdr(STORE.deserialize_cdr(data, name), name, little_endian=False))
    assert big != data
    found = decoder(Channel("/odom", name, "cdr"), Loss())(big)
    np.testing.assert_allclose(found.pose, [1.0, 2.0, 0.5])
    assert (found.stamp_ns, found.frame_id, found.child_frame_id) == (5, "odom", "base")


@given(quaternions)
def test_quaternion_of_a_matrix_is_the_rotation(q):
    matrix = matrix_from_quaternion((0, 0, 0), q)
    found = quaternions_from_matrices(matrix[None])[0]
    np.testing.assert_allclose(matrix_from_quaternion((0, 0, 0), found), matrix, atol=1e-9)
    assert found[3] >= 0
    assert np.linalg.norm(found) == pytest.approx(1)


@given(stamps, st.tuples(metres, metres, yaws), names, names)
def test_odometry_survives_our_own_encoder(stamp_ns, pose, frame, child):
    value = Odometry(stamp_ns, np.array(pose), frame, child)
    found = read_again("odometry", value)
    assert (found.stamp_ns, found.frame_id, found.child_frame_id) == (stamp_ns, frame, child)
    np.testing.assert_allclose(found.pose, pose, atol=1e-9)


RNG = np.random.default_rng(5)
SAMPLES = {
    Scan: Scan(
        7 * 10**9 + 3, "laser", RNG.uniform(0, 9, 181).astype(np.float32), beam_angles(-1.5, 0.017, 181), 1e-4, 0.1, 9
    ),
    Odometry: Odometry(3, np.array([1.0, -2.0, 0.3]), "odom", "base"),
    tuple: (
        Transform(4, "a", "b", matrix_from_quaternion((1, 2, 3), (0.5, 0.1, -0.2, 0.8))),
        Transform(5, "bc", "d", np.eye(4)),
    ),
    StampedPose: StampedPose(9, "map", np.array([1.0, 2.0, -3.0]), np.diag([0.1, 0.2, 0.3])),
    OccupancyGrid: OccupancyGrid(
        RNG.integers(-1, 101, (7, 5)).astype(np.int8), 0.05, np.array([1, 2, 0.5]), "/topic", 8
    ),
    CameraImage: CameraImage(6, "camera", "rgb8", bytes(range(24)), 2, 4, 12),
    CameraInfo: CameraInfo(
        2,
        "cam",
        640,
        480,
        "plumb_bob",
        np.arange(5.0),
        np.arange(9.0).reshape(3, 3),
        np.eye(3),
        np.arange(12.0).reshape(3, 4),
    ),
    PointCloud: PointCloud(
        1,
        "lidar",
        RNG.normal(size=(6, 3)).astype(np.float32),
        np.float32([1, 2, 3, 4, 5, 6]),
        None,
        np.float32([0, 1, 2, 3, 4, 5]),
    ),
    str: "<robot name='x'/>",
}


@pytest.mark.parametrize("kind", ENCODERS, ids=lambda k: k.__name__)
def test_every_encoder_is_read_by_rosbags_and_by_us(kind):
    value = SAMPLES[kind]
    found = read_again(kind, value)
    assert_same(found, value)


def test_variants_of_a_type():
    plain = StampedPose(9, "map", np.array([1.0, 2.0, -3.0]))
    assert_same(read_again("pose", plain), plain)
    jpeg = CameraImage(6, "camera", "jpeg", b"\xff\xd8...")
    assert_same(read_again("image", jpeg), jpeg)
    static = (Transform(4, "a", "b", np.eye(4), is_static=True),)
    assert_same(read_again("tf", static, is_static=True), static)
    uneven = Scan(1, "l", np.ones(3, np.float32), np.float32([0, 1, 5]), 0, 0, 1)
    with pytest.raises(ValueError, match="evenly"):
        encode(uneven)


def assert_same(a, b):
    if isinstance(b, tuple):
        assert len(a) == len(b)
        for one, other in zip(a, b, strict=True):
            assert_same(one, other)
        return
    if isinstance(b, str):
        assert a == b
        return
    for name in b.__dataclass_fields__:
        one, other = getattr(a, name), getattr(b, name)
        if isinstance(other, np.ndarray):
            np.testing.assert_allclose(one, other, atol=1e-6, err_msg=name)
        elif isinstance(other, float):
            assert one == pytest.approx(other, abs=1e-6), name
        else:
            assert one == other, name


def test_angles_that_cannot_be_are_refused():
    for bad in ((np.nan, 0.1, 5), (0.0, np.inf, 5), (0.0, 0.0, 5), (0.0, 0.1, 700)):
        with pytest.raises(ValueError):
            beam_angles(*bad)
    assert beam_angles(0.0, 0.0, 1).tolist() == [0.0]
    assert beam_angles(1.0, -0.5, 3).tolist() == [1.0, 0.5, 0.0]


def test_a_pose_that_is_none_is_refused():
    for bad in ((np.nan, 0, 0, 0, 0, 1), (0, np.inf, 0, 0, 0, 1), (0, 0, 0, 0, 0, 0), (0, 0, 0, 0, np.nan, 1)):
        with pytest.raises(ValueError, match="not a pose"):
            planar_pose(*bad)
