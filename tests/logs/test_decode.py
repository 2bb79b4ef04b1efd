"""One contract for every message type: what ROS 2, ROS 1, Foxglove protobuf and Foxglove JSON say of it is the same."""

from __future__ import annotations

import base64
import json
from types import SimpleNamespace

import numpy as np
import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from tests.logs.examples import FOXGLOVE, PLANAR, POSE, ROS, protobuf, ros_message
from tests.logs.test_cdr import assert_same
from wallkit.logs.decode import DECODERS, UndecodableError, UnknownTypeError, decoder
from wallkit.logs.loss import Loss
from wallkit.logs.message import Channel


def test_every_decoder_has_an_example():
    assert {*ROS, *FOXGLOVE} == set(DECODERS)


def check(channel, data, expected):
    value = decoder(channel, loss := Loss())(data)
    if expected is None:
        assert value.cells.tolist() == [[-1, 0, 100], [1, 2, 3]]
        np.testing.assert_allclose(value.origin, PLANAR, atol=1e-9)
        assert (value.resolution_m, value.source) == (pytest.approx(0.05), channel.topic)
    else:
        assert_same(value, expected)
    assert not loss
    with pytest.raises(UndecodableError):
        decoder(channel, Loss())(data[:-1] if channel.encoding != "json" else b"{}")


LEGACY_TF = "geometry_msgs/TransformStamped[] transforms"
LASER_ECHO = "float32[] echoes"


@pytest.mark.parametrize("kind", [k for k in ROS if k != "tf/tfMessage"])
@pytest.mark.parametrize("has_definition", [True, False])
def test_ros2(kind, has_definition):
    store = get_typestore(Stores.ROS2_HUMBLE)
    name = kind.replace("/", "/msg/")
    fields, expected = ROS[kind]
    data = bytes(store.serialize_cdr(ros_message(store, name, fields), name))
    schema = store.generate_msgdef(name, ros_version=2)[0].encode() if has_definition else b""
    check(Channel("/topic", name, "cdr", "ros2msg" if schema else "", schema), data, expected)


@pytest.mark.parametrize("kind", ROS)
def test_ros1(kind):
    store = get_typestore(Stores.ROS1_NOETIC)
    for missing in ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage"):
        store.register(get_types_from_msg(LEGACY_TF, missing))
    store.register(get_types_from_msg(LASER_ECHO, "sensor_msgs/msg/LaserEcho"))
    name = kind.replace("/", "/msg/")
    fields, expected = ROS[kind]
    data = bytes(store.serialize_ros1(ros_message(store, name, fields), name))
    schema = store.generate_msgdef(name, ros_version=1)[0].encode()
    check(Channel("/topic", kind, "ros1", "ros1msg", schema), data, expected)


@pytest.mark.parametrize("kind", FOXGLOVE)
def test_foxglove_json(kind):
    fields, expected = FOXGLOVE[kind]
    as_text = {k: base64.b64encode(v).decode() if isinstance(v, bytes) else v for k, v in fields.items()}
    check(Channel("/topic", kind, "json", "jsonschema", b"{}"), json.dumps(as_text).encode(), expected)


@pytest.mark.parametrize("kind", FOXGLOVE)
def test_foxglove_protobuf(kind):
    fields, expected = FOXGLOVE[kind]
    schema, data = protobuf(kind, fields)
    check(Channel("/topic", kind, "protobuf", "protobuf", schema), data, expected)


def test_unset_poses_of_foxglove_are_no_move():
    fields, expected = FOXGLOVE["foxglove.PointCloud"]
    schema, data = protobuf("foxglove.PointCloud", {**fields, "pose": {}})
    assert_same(decoder(Channel("/t", "foxglove.PointCloud", "protobuf", "protobuf", schema), Loss())(data), expected)


def test_a_foxglove_scan_may_stand_elsewhere_in_its_frame():
    moved = {**FOXGLOVE["foxglove.LaserScan"][0], "pose": POSE, "start_angle": 0.0, "end_angle": 0.0, "ranges": [3.0]}
    scan = decoder(Channel("/t", "foxglove.LaserScan", "json", "jsonschema", b""), Loss())(json.dumps(moved).encode())
    x, y = scan.ranges_m * np.cos(scan.angles_rad), scan.ranges_m * np.sin(scan.angles_rad)
    np.testing.assert_allclose([x[0], y[0], scan.heights_m[0]], [1.0, 5.0, 0.5], atol=1e-6)


def test_foxglove_messages_of_ros2_are_the_same_types():
    assert Channel("/t", "foxglove_msgs/msg/LaserScan", "cdr").kind == "foxglove.LaserScan"


def test_big_endian_pixels_are_turned_round():
    store = get_typestore(Stores.ROS2_HUMBLE)
    pixels = np.array([[1, 515]], ">u2")
    fields = ROS["sensor_msgs/Image"][0] | {
        "encoding": "mono16",
        "is_bigendian": 1,
        "step": 4,
        "data": np.frombuffer(pixels.tobytes(), np.uint8),
    }
    data = bytes(store.serialize_cdr(ros_message(store, "sensor_msgs/msg/Image", fields), "sensor_msgs/msg/Image"))
    image = decoder(Channel("/t", "sensor_msgs/msg/Image", "cdr"), Loss())(data)
    assert np.frombuffer(image.data, "<u2").tolist() == [1, 515]


@pytest.mark.parametrize(
    ("channel", "words"),
    [
        (Channel("/t", "sensor_msgs/msg/Imu", "cdr"), "not used"),
        (Channel("/t", "nav_msgs/msg/OccupancyGrid", "cbor"), "not known"),
        (Channel("/t", "foxglove_msgs/msg/LaserScan", "cdr"), "no standard type"),
        (Channel("/t", "foxglove.LaserScan", "protobuf", "protobuf", b"\xff\xff"), "protobuf definition"),
        (Channel("/t", "foxglove.LaserScan", "protobuf", "protobuf", b""), "protobuf definition"),
    ],
)
def test_what_cannot_be_decoded_is_said(channel, words):
    with pytest.raises(UnknownTypeError, match=words):
        decoder(channel, Loss())


@pytest.mark.parametrize("schema", [b"   \n", b"float32[ x", b"geometry_msgs/Missing field", b"\xff\xfe"])
def test_an_unusable_definition_falls_back_to_the_standard_and_is_said(schema):
    store = get_typestore(Stores.ROS2_HUMBLE)
    name = "geometry_msgs/msg/PoseStamped"
    fields, expected = ROS["geometry_msgs/PoseStamped"]
    data = bytes(store.serialize_cdr(ros_message(store, name, fields), name))
    loss = Loss()
    assert_same(decoder(Channel("/pose", name, "cdr", "ros2msg", schema), loss)(data), expected)
    assert "/pose" in loss.notes[0]
    assert "ROS Humble" in loss.notes[0]


def test_definitions_in_idl():
    schema = b"""
module std_msgs { module msg { struct String { string data; }; }; };
"""
    loss = Loss()
    data = bytes(get_typestore(Stores.ROS2_HUMBLE).serialize_cdr(SimpleNamespace(data="hello"), "std_msgs/msg/String"))
    for text in (schema, b"=" * 80 + b"\nIDL: std_msgs/msg/String\n" + schema):
        assert decoder(Channel("/t", "std_msgs/msg/String", "cdr", "ros2idl", text), loss)(data) == "hello"
    assert not loss.notes
