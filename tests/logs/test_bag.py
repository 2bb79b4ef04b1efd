"""ROS 1 bags: closed, cut, never closed, compressed, damaged; and SQLite files with and without definitions."""

from __future__ import annotations

import itertools
import sqlite3

import apsw
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rosbags.rosbag1 import Reader, Writer
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader
from rosbags.typesys import Stores, get_typestore

from tests.logs.drawn import START_NS, drive, log_of, write_bag, write_rosbag2
from wallkit.core.types import Odometry, Transform
from wallkit.errors import LogError
from wallkit.logs.reader import open_log

DRIVE = log_of(drive(), seconds=2)
STORE = get_typestore(Stores.ROS1_NOETIC)


def many_chunks(path, compression=None):
    """A bag of several chunks: text messages, 400 bytes each."""
    bag = Writer(path)
    bag.chunk_threshold = 4_000
    if compression is not None:
        bag.set_compression(compression)
    with bag:
        connection = bag.add_connection("/robot_description", "std_msgs/msg/String", typestore=STORE)
        for k in range(100):
            data = STORE.serialize_ros1(STORE.types["std_msgs/msg/String"](f"{k:0400d}"), "std_msgs/msg/String")
            bag.write(connection, START_NS + k, data)
    return path


def chunk_places(path):
    with Reader(path) as reader:
        return [info.pos for info in reader.chunk_infos]


def texts(log):
    return [int(m.value) for m in log.messages(["/robot_description"])]


@pytest.mark.parametrize("compression", [None, *Writer.CompressionFormat])
def test_compressed_chunks(tmp_path, compression):
    log = open_log([many_chunks(tmp_path / "log.bag", compression)])
    assert texts(log) == list(range(100))
    assert not log.loss


@pytest.mark.parametrize("compression", [None, *Writer.CompressionFormat])
def test_a_cut_bag_gives_every_chunk_that_is_whole(tmp_path, compression):
    path = many_chunks(tmp_path / "log.bag", compression)
    places = chunk_places(path)
    path.write_bytes(path.read_bytes()[: places[4] + 50])
    log = open_log([path])
    found = texts(log)
    assert found == list(range(len(found)))
    assert 0 < len(found) < 100
    assert log.loss.recovered == {str(path): len(found)}
    assert "ends inside a record" in log.loss.lines()[0]
    assert "no usable index" in log.loss.notes[0]


def test_a_bag_that_was_never_closed(tmp_path):
    """rosbag writes the place of the index last; a `.bag.active` has 0 there."""
    path = many_chunks(tmp_path / "log.bag")
    data = bytearray(path.read_bytes())
    place = data.index(b"index_pos=") + len(b"index_pos=")
    data[place : place + 8] = bytes(8)
    path.write_bytes(data)
    log = open_log([path])
    assert texts(log) == list(range(100))
    assert not log.loss
    assert log.loss.lines() == []
    assert "no usable index" in log.loss.notes[0]


@pytest.mark.parametrize("has_index", [True, False])
def test_a_damaged_chunk_is_left_out(tmp_path, has_index):
    path = many_chunks(tmp_path / "log.bag", Writer.CompressionFormat.BZ2)
    places = chunk_places(path)
    data = bytearray(path.read_bytes())
    data[places[2] + 120 : places[2] + 160] = bytes(40)
    path.write_bytes(data if has_index else data[: places[-1]])
    log = open_log([path])
    found = texts(log)
    assert len(found) < 100
    assert {d.offset for d in log.loss.damages.values()} >= {places[2]}
    assert texts(log) == found
    assert log.loss.recovered == {str(path): len(found)}


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.integers(0, 10**9), st.binary(min_size=1, max_size=30))
def test_whatever_is_overwritten_ends_in_messages_or_one_clear_error(tmp_path, place, garbage):
    path = many_chunks(tmp_path / "log.bag")
    data = bytearray(path.read_bytes())
    path.unlink()
    place = 13 + place % (len(data) - 13 - len(garbage))
    data[place : place + len(garbage)] = garbage
    broken = tmp_path / "broken.bag"
    broken.write_bytes(data)
    try:
        log = open_log([broken])
    except LogError:
        return
    assert sum(1 for _ in log.messages()) <= 100


def test_legacy_and_new_transforms_on_one_topic(tmp_path):
    """Both tf/tfMessage and tf2_msgs/TFMessage on /tf, as real bags hold them."""
    link = (Transform(START_NS, "/odom", "/base_link", np.eye(4)),)
    new = write_bag(tmp_path / "new.bag", [(START_NS, "/tf", link)])
    old = write_bag(tmp_path / "old.bag", [(START_NS + 1, "/tf", link)], legacy_tf=True)
    log = open_log([new, old])
    assert {c.kind for c in log.channels} == {"tf/tfMessage", "tf2_msgs/TFMessage"}
    found = [t for m in log.messages(["/tf"]) for t in m.value]
    assert [(t.parent, t.child) for t in found] == [("odom", "base_link")] * 2


def without_definitions(path):
    """The database as ROS 2 wrote it before Iron: no message_definitions, no type hashes."""
    db = sqlite3.connect(path)
    for table in ("message_definitions", "schema", "metadata"):
        db.execute(f"DROP TABLE {table}")
    db.execute("ALTER TABLE topics DROP COLUMN type_description_hash")
    db.commit()
    db.close()


@pytest.mark.parametrize("has_definitions", [True, False])
def test_sqlite_with_and_without_definitions(tmp_path, has_definitions):
    folder = write_rosbag2(tmp_path / "bag", [*DRIVE, (START_NS, "/robot_description", "<robot/>")])
    path = next(folder.glob("*.db3"))
    if not has_definitions:
        without_definitions(path)
    log = open_log([path])
    assert sum(1 for _ in log.messages()) == len(DRIVE) + 1
    assert bool(log.loss.notes) != has_definitions
    if not has_definitions:
        assert "read as std_msgs/msg/String of ROS Humble" in log.loss.notes[0]


def test_a_database_without_half_its_pages_is_refused(tmp_path):
    folder = write_rosbag2(tmp_path / "bag", DRIVE)
    path = next(folder.glob("*.db3"))
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 8192 * 4096] + b"\xff" * (len(data) // 2))
    with pytest.raises(LogError, match="damaged"):
        open_log([path])


def test_a_database_that_breaks_off_is_counted(tmp_path, monkeypatch):
    original = Sqlite3Reader.messages

    def breaks_off(self, connections, start=None, stop=None):
        yield from itertools.islice(original(self, connections), 20)
        raise apsw.CorruptError("database disk image is malformed")

    monkeypatch.setattr(Sqlite3Reader, "messages", breaks_off)
    log = open_log([write_rosbag2(tmp_path / "bag", DRIVE)])
    assert sum(1 for _ in log.messages()) == 20
    assert "database is damaged" in log.loss.lines()[0]


def test_odometry_of_a_bag_is_planar(tmp_path):
    odometry = Odometry(START_NS, np.array([1.0, 2.0, -0.5]), "odom", "base_link")
    log = open_log([write_bag(tmp_path / "log.bag", [(START_NS, "/odom", odometry)])])
    found = next(log.messages()).value
    np.testing.assert_allclose(found.pose, odometry.pose, atol=1e-12)
    assert (found.frame_id, found.child_frame_id) == ("odom", "base_link")
