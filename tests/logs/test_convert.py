"""A converted log is the same log, for us and for rosbags."""

from __future__ import annotations

import json
from base64 import b64encode

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer as BagWriter
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from tests.logs.drawn import SECOND_NS, START_NS, drive, log_of, write, write_bag, write_carmen, write_rosbag2
from tests.logs.examples import CAMERA_INFO, FOXGLOVE, ROS, protobuf, ros_message
from tests.logs.test_cdr import assert_same
from wallkit.logs.convert import CONVERTERS, convert_log
from wallkit.logs.reader import open_log
from wallkit.logs.writer import McapWriter

DRIVE = log_of(drive(), seconds=1, mount=np.array([0.1, 0.2, 0.3]))


def converted(tmp_path, *paths, **options):
    log = open_log(list(paths))
    report = convert_log(log, tmp_path / "out.mcap", **options)
    return log, open_log([tmp_path / "out.mcap"]), report


def write_foxglove(path, encoding):
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        for number, (kind, (fields, _)) in enumerate(FOXGLOVE.items()):
            if encoding == "protobuf":
                schema, data = protobuf(kind, fields)
                schema_id = writer.register_schema(kind, "protobuf", schema)
            else:
                text = {k: b64encode(v).decode() if isinstance(v, bytes) else v for k, v in fields.items()}
                data, schema_id = json.dumps(text).encode(), writer.register_schema(kind, "jsonschema", b"{}")
            writer.add_message(writer.register_channel(f"/{kind}", encoding, schema_id), START_NS + number, data, 0)
        writer.finish()
    return path


DRAWN = {
    "cdr": lambda path: write(path, DRIVE),
    "ros1": lambda path: write_bag(path, DRIVE, legacy_tf=True),
    "carmen": lambda path: write_carmen(path, DRIVE),
    "protobuf": lambda path: write_foxglove(path, "protobuf"),
    "json": lambda path: write_foxglove(path, "json"),
}


@pytest.mark.parametrize("encoding", CONVERTERS)
def test_every_encoding_becomes_the_same_messages_in_ros2(tmp_path, encoding):
    log, found, report = converted(tmp_path, DRAWN[encoding](tmp_path / "in"))
    before = [(m.topic, m.log_ns, m.value) for m in log.messages()]
    after = [(m.topic, m.log_ns, m.value) for m in found.messages()]
    assert sum(report.written.values()) == len(after) == len(before)
    assert not report.skipped
    for (topic, log_ns, value), (topic_found, log_found, value_found) in zip(before, after, strict=True):
        assert (topic, log_ns) == (topic_found, log_found)
        if encoding in ("cdr", "ros1"):
            assert_same(value_found, value)
        assert type(value_found) is type(value)
    with AnyReader([tmp_path / "out.mcap"]) as reader:
        for connection, _, data in reader.messages():
            reader.deserialize(data, connection.msgtype)


def test_ros2_messages_keep_their_bytes_and_definitions(tmp_path):
    converted(tmp_path, write_rosbag2(tmp_path / "bag", DRIVE))
    with AnyReader([tmp_path / "bag"]) as a, AnyReader([tmp_path / "out.mcap"]) as b:
        assert [(c.topic, t, d) for c, t, d in a.messages()] == [(c.topic, t, d) for c, t, d in b.messages()]
        definitions = {c.topic: c.msgdef.data.strip() for c in a.connections}
        assert {c.topic: c.msgdef.data.strip() for c in b.connections} == definitions


def test_types_that_ros2_does_not_know_keep_their_definition(tmp_path):
    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(
        get_types_from_msg("Header header\nfloat32[] values\nstring[2] names\ntime when", "own_msgs/msg/Thing")
    )
    fields = {
        "header": {"seq": 3, "stamp": {"sec": 5, "nanosec": 6}, "frame_id": "f"},
        "values": [1.5, 2.5],
        "names": ["a", "bc"],
        "when": {"sec": 7, "nanosec": 8},
    }
    with BagWriter(tmp_path / "in.bag") as bag:
        connection = bag.add_connection("/thing", "own_msgs/msg/Thing", typestore=store)
        data = store.serialize_ros1(ros_message(store, "own_msgs/msg/Thing", fields), "own_msgs/msg/Thing")
        bag.write(connection, 9, data)
    converted(tmp_path, tmp_path / "in.bag")
    with AnyReader([tmp_path / "out.mcap"]) as reader:
        ((connection, log_ns, data),) = reader.messages()
        thing = reader.deserialize(data, connection.msgtype)
    assert (log_ns, thing.header.stamp.sec, thing.header.frame_id, thing.names) == (9, 5, "f", ["a", "bc"])
    np.testing.assert_array_equal(thing.values, [1.5, 2.5])
    assert (thing.when.sec, thing.when.nanosec) == (7, 8)
    assert not hasattr(thing.header, "seq")


def test_fields_that_ros2_renamed_are_carried_over(tmp_path):
    store = get_typestore(Stores.ROS1_NOETIC)
    name = "sensor_msgs/msg/CameraInfo"
    with BagWriter(tmp_path / "in.bag") as bag:
        connection = bag.add_connection("/camera_info", name, typestore=store)
        bag.write(connection, 9, store.serialize_ros1(ros_message(store, name, ROS["sensor_msgs/CameraInfo"][0]), name))
    _, found, _ = converted(tmp_path, tmp_path / "in.bag")
    assert_same(next(found.messages()).value, CAMERA_INFO)


def test_topics_and_times_can_be_chosen_latched_ones_stay(tmp_path):
    path = write(tmp_path / "in.mcap", DRIVE)
    half = START_NS + SECOND_NS // 2
    _, found, report = converted(tmp_path, path, topics={"/scan", "/tf_static"}, start_ns=half)
    assert report.written == {"/scan": 2, "/tf_static": 1}
    assert {m.topic for m in found.messages()} == {"/scan", "/tf_static"}
    with (tmp_path / "out.mcap").open("rb") as file:
        channels = make_reader(file).get_summary().channels.values()
    assert {c.topic: "durability: 1" in c.metadata["offered_qos_profiles"] for c in channels} == {
        "/scan": False,
        "/tf_static": True,
    }


def test_what_cannot_be_carried_over_is_listed_or_counted(tmp_path):
    path = tmp_path / "in.mcap"
    with McapWriter(path) as file:
        for stamp, topic, value in DRIVE[:3]:
            file.write(topic, value, stamp)
    with (tmp_path / "odd.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        writer.add_message(writer.register_channel("/odd", "cbor", 0), 1, b"x", 1)
        writer.finish()
    _, _, report = converted(tmp_path, path, tmp_path / "odd.mcap")
    assert report.skipped == {"/odd": "messages of type '' are not used"}
    assert sum(report.written.values()) == 3


def test_the_same_log_gives_the_same_bytes(tmp_path):
    path = write_bag(tmp_path / "in.bag", DRIVE)
    convert_log(open_log([path]), tmp_path / "a.mcap")
    convert_log(open_log([path]), tmp_path / "b.mcap")
    assert (tmp_path / "a.mcap").read_bytes() == (tmp_path / "b.mcap").read_bytes()
