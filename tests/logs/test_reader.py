"""One contract for every recorder's file: the same drive, whatever it was written by, comes out the same."""

from __future__ import annotations

import gzip
import shutil

import lz4.frame
import numpy as np
import pytest
import zstandard

from tests.logs.drawn import (
    SECOND_NS,
    START_NS,
    drive,
    log_of,
    write,
    write_bag,
    write_carmen,
    write_rosbag2,
    write_with_library,
)
from wallkit.core.types import OccupancyGrid, Odometry, Scan, Transform
from wallkit.errors import LogError
from wallkit.logs.reader import READERS, open_log
from wallkit.logs.rig import find_rig
from wallkit.logs.sync import synchronise
from wallkit.logs.unpack import WRAPPINGS

MOUNT = np.array([0.1, -0.05, 0.4])
DRIVE = log_of(drive(), seconds=2, mount=MOUNT)


def write_sqlite(path, messages):
    folder = write_rosbag2(path.with_name("folder"), messages)
    return shutil.move(next(folder.glob("*.db3")), path)


DRAWN = {"MCAP": write, "ROS 1 bag": write_bag, "rosbag2 SQLite": write_sqlite, "CARMEN": write_carmen}
# CARMEN writes its odometry after the scan's own; float32 of the scan's step
TOLERANCE_M = 2e-4


@pytest.mark.parametrize("name", READERS)
def test_every_reader_gives_the_same_drive(tmp_path, name):
    path = DRAWN[name](tmp_path / "misleading.txt", DRIVE)
    log = open_log([path])
    assert log.formats == (name,)

    stamps = {}
    for message in log.messages():
        stamps.setdefault(message.topic, []).append(message.stamp_ns)
    assert all(np.all(np.diff(s) > 0) for topic, s in stamps.items() if topic != "/tf_static")
    assert sum(len(s) for s in stamps.values()) == len(DRIVE)
    again = [(m.topic, m.stamp_ns, m.log_ns) for m in log.messages()]
    assert again == [(m.topic, m.stamp_ns, m.log_ns) for m in log.messages()]

    counted = {c.topic: c.count for c in log.channels}
    assert counted == {topic: len(s) for topic, s in stamps.items()}
    assert not log.loss

    expected = list(synchronise(reference := open_log([write(tmp_path / "reference", DRIVE)]), find_rig(reference)))
    frames = list(synchronise(log, find_rig(log)))
    assert [f.stamp_ns for f in frames] == [f.stamp_ns for f in expected]
    for frame, other in zip(frames, expected, strict=True):
        np.testing.assert_allclose(frame.odometry, other.odometry, atol=1e-6)
        np.testing.assert_allclose(frame.points.xyz_m, other.points.xyz_m, atol=TOLERANCE_M)


@pytest.mark.parametrize("name", READERS)
def test_every_reader_reads_only_the_topics_asked_for(tmp_path, name):
    log = open_log([DRAWN[name](tmp_path / "log", DRIVE)])
    topic = next(c.topic for c in log.channels if c.count == 10)
    assert {m.topic for m in log.messages([topic])} == {topic}
    assert list(log.messages(["/nothing"])) == []
    assert len(log.first(topic, 3)) == 3


PACKERS = {
    "zstd": zstandard.ZstdCompressor().compress,
    "lz4": lz4.frame.compress,
    "gzip": gzip.compress,
}


@pytest.mark.parametrize("packer", PACKERS)
def test_a_compressed_file_is_unpacked(tmp_path, packer):
    path = write(tmp_path / "log.mcap", DRIVE)
    packed = tmp_path / "log.mcap.packed"
    packed.write_bytes(PACKERS[packer](path.read_bytes()))
    assert sum(1 for _ in open_log([packed]).messages()) == len(DRIVE)
    packed.write_bytes(packed.read_bytes()[:100])
    with pytest.raises(LogError, match="cannot be unpacked"):
        open_log([packed])


def test_every_wrapping_has_its_packer():
    assert {next(p for p in PACKERS if PACKERS[p](b"x").startswith(magic)) for magic in WRAPPINGS} == set(PACKERS)


def test_several_files_are_merged_by_time(tmp_path):
    half = START_NS + SECOND_NS
    first = write(tmp_path / "a.mcap", [m for m in DRIVE if m[0] < half])
    second = write_bag(tmp_path / "b.bag", [m for m in DRIVE if m[0] >= half])
    log = open_log([second, first])
    times = [m.log_ns for m in log.messages()]
    assert times == sorted(times)
    assert len(times) == len(DRIVE)
    assert len(list(synchronise(log, find_rig(log)))) == 10


@pytest.mark.parametrize("storage", ["sqlite3", "mcap"])
@pytest.mark.parametrize("is_closed", [True, False])
def test_a_rosbag2_directory(tmp_path, storage, is_closed):
    folder = write_rosbag2(tmp_path / "bag", DRIVE, storage=storage)
    if not is_closed:
        (folder / "metadata.yaml").unlink()
    assert sum(1 for _ in open_log([folder]).messages()) == len(DRIVE)


def test_a_split_directory_with_a_part_missing(tmp_path):
    folder = write_rosbag2(tmp_path / "bag", DRIVE)
    next(folder.glob("*.db3")).unlink()
    with pytest.raises(LogError, match="parts of the recording are missing"):
        open_log([folder])
    (folder / "metadata.yaml").write_text("a: [")
    with pytest.raises(LogError, match="YAML"):
        open_log([folder])
    (folder / "metadata.yaml").write_text("a: 1")
    with pytest.raises(LogError, match="rosbag2_bagfile_information"):
        open_log([folder])
    (folder / "metadata.yaml").unlink()
    with pytest.raises(LogError, match="no recording in this directory"):
        open_log([folder])


def test_messages_compressed_one_by_one_are_refused(tmp_path):
    folder = tmp_path / "bag"
    folder.mkdir()
    (folder / "metadata.yaml").write_text("rosbag2_bagfile_information:\n  compression_mode: MESSAGE\n")
    with pytest.raises(LogError, match="one by one"):
        open_log([folder])


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "empty"),
        (b"hello", "not a recording"),
        (b"#ROSRECORD V1.2\n", "older than version 2.0"),
        (b"#ROSBAG V1.3\n", "older than version 2.0"),
        (b"SQLite format 3\x00" + bytes(2000), "no rosbag2 recording"),
        (b"#ROSBAG V2.0\n" + bytes(100), "nothing in this bag"),
    ],
)
def test_what_is_no_recording_is_said(tmp_path, content, words):
    path = tmp_path / "log.mcap"
    path.write_bytes(content)
    with pytest.raises(LogError, match=words):
        open_log([path])


def test_a_path_that_does_not_exist(tmp_path):
    with pytest.raises(LogError, match="no such file"):
        open_log([tmp_path / "gone.mcap"])
    with pytest.raises(LogError, match="no log was given"):
        open_log([])


def test_static_things_are_found_wherever_they_stand(tmp_path):
    """Latched messages of several publishers, at the end of the file, are there even with --start."""
    late = START_NS + 100 * SECOND_NS
    grid = OccupancyGrid(np.zeros((2, 3), np.int8), 0.05, np.zeros(3), "/map", 0)
    links = [Transform(0, "base_link", name, np.eye(4), is_static=True) for name in ("a", "b")]
    extra = [
        (late, "/tf_static", (links[0],)),
        (late + 1, "/tf_static", (links[1],)),
        (late + 2, "/map", grid),
        (late + 3, "/robot_description", "<robot name='r'/>"),
    ]
    log = open_log([write_with_library(tmp_path / "log.mcap", [*DRIVE, *extra])])
    assert {t.child for t in log.static.transforms} == {"laser", "a", "b"}
    assert log.static.maps["/map"].cells.shape == (2, 3)
    assert log.static.robot_descriptions == {"/robot_description": "<robot name='r'/>"}
    window = list(log.messages(start_ns=START_NS + SECOND_NS, end_ns=START_NS + 2 * SECOND_NS))
    assert {m.topic for m in window} == {"/odom", "/scan"}
    assert all(START_NS + SECOND_NS <= m.stamp_ns < START_NS + 2 * SECOND_NS for m in window)


def test_undecodable_messages_are_counted_once(tmp_path):
    from wallkit.logs.writer import McapWriter

    path = tmp_path / "log.mcap"
    with McapWriter(path) as file:
        file.write_cdr("/odom", "nav_msgs/msg/Odometry", 1, b"\x00\x01\x00\x00broken")
        file.write("/odom", Odometry(5, np.zeros(3)), 2)
        file.write_cdr("/odom", "nav_msgs/msg/Odometry", 3, b"")
        file.write_cdr("/twist", "geometry_msgs/msg/Twist", 4, bytes(52))
    log = open_log([path])
    for _ in range(2):
        assert [m.stamp_ns for m in log.messages()] == [5]
        assert log.loss.undecodable == {"/odom": 2}
        assert log.loss.skipped == {"/twist": "messages of type 'geometry_msgs/msg/Twist' are not used"}
    assert log.loss
    assert "/odom: 2 messages could not be decoded" in log.loss.lines()[0]


def test_scans_and_odometry_are_core_types(tmp_path):
    log = open_log([write(tmp_path / "log.mcap", DRIVE)])
    kinds = {m.topic: type(m.value) for m in log.messages()}
    assert kinds == {"/odom": Odometry, "/scan": Scan, "/tf_static": tuple}
