"""Every way an MCAP file can be written or broken: what is whole is read, what is not is counted."""

from __future__ import annotations

import itertools
import json
import struct
import tarfile

import pytest
import zstandard
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.data_stream import RecordBuilder
from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.records import Message
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, IndexType, Writer

from tests.logs.drawn import SECOND_NS, START_NS, drive, log_of, write_with_library
from wallkit.core.types import Odometry
from wallkit.errors import LogError
from wallkit.logs import blocks, mcap
from wallkit.logs.loss import Loss
from wallkit.logs.mcap import McapFile
from wallkit.logs.reader import open_log

MESSAGES = log_of(drive(), seconds=4, scan_hz=5, odometry_hz=50)


def counts_of(path):
    """Messages by topic, and what was lost."""
    log = open_log([path])
    counts = {}
    for message in log.messages():
        counts[message.topic] = counts.get(message.topic, 0) + 1
    return counts, log.loss


WHOLE = {"/tf_static": 1, "/odom": 201, "/scan": 20}


@pytest.mark.parametrize("compression", CompressionType)
@pytest.mark.parametrize("index_types", [IndexType.ALL, IndexType.CHUNK, IndexType.NONE])
@pytest.mark.parametrize(("use_chunking", "with_summary"), [(True, True), (True, False), (False, True), (False, False)])
def test_every_kind_of_file_is_read_whole(tmp_path, compression, index_types, use_chunking, with_summary):
    options = {"compression": compression, "index_types": index_types}
    path = write_with_library(
        tmp_path / "log.bin", MESSAGES, use_chunking=use_chunking, with_summary=with_summary, **options
    )
    counts, loss = counts_of(path)
    assert counts == WHOLE
    assert not loss
    assert loss.lines() == []


def test_messages_come_by_record_time_and_can_be_read_again(tmp_path):
    shuffled = [m for pair in itertools.zip_longest(MESSAGES[::2], MESSAGES[1::2][::-1]) for m in pair if m]
    path = write_with_library(tmp_path / "log.mcap", shuffled, chunk_size=2_000)
    log = open_log([path])
    first = [(m.topic, m.log_ns, m.stamp_ns) for m in log.messages()]
    assert [ns for _, ns, _ in first] == sorted(ns for ns, _, _ in MESSAGES)
    assert first == [(m.topic, m.log_ns, m.stamp_ns) for m in log.messages()]


def test_shuffled_files_stay_within_the_window(tmp_path, monkeypatch):
    """With a window far smaller than the file, nothing is lost; only order is given up, and only as far as needed."""
    monkeypatch.setattr(blocks, "SORT_WINDOW_BYTES", 5_000)
    shuffled = MESSAGES[::2] + MESSAGES[1::2]
    path = write_with_library(tmp_path / "log.mcap", shuffled, chunk_size=1_000_000)
    assert counts_of(path)[0] == WHOLE


def chunk_offsets(path):
    with path.open("rb") as file:
        return [c.chunk_start_offset for c in make_reader(file).get_summary().chunk_indexes]


@pytest.mark.parametrize("with_summary", [True, False])
def test_a_damaged_chunk_is_left_out_and_counted(tmp_path, with_summary):
    path = write_with_library(tmp_path / "log.mcap", MESSAGES)
    offsets = chunk_offsets(path)
    data = bytearray(path.read_bytes())
    for k in range(200):
        data[offsets[1] + 200 + k] ^= 0x5A
    if not with_summary:
        data = data[: offsets[-1]]  # cut: the index is gone as well
    path.write_bytes(data)

    counts, loss = counts_of(path)
    damage = next(d for d in loss.damages.values() if d.offset == offsets[1])
    assert "chunk" in damage.reason
    assert loss
    assert sum(counts.values()) == loss.recovered[str(path)]
    if with_summary:
        assert damage.messages == sum(WHOLE.values()) - sum(counts.values())
        assert damage.last_ns is not None
        assert damage.last_ns >= START_NS


def test_losses_are_not_counted_twice(tmp_path):
    path = write_with_library(tmp_path / "log.mcap", MESSAGES)
    data = bytearray(path.read_bytes())
    offset = chunk_offsets(path)[0] + 300
    data[offset : offset + 50] = bytes(50)
    path.write_bytes(data)
    log = open_log([path])
    first = [sum(1 for _ in log.messages()), log.loss.lines()]
    assert [sum(1 for _ in log.messages()), log.loss.lines()] == first
    assert len(log.loss.damages) == 1


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.floats(0, 1))
def test_a_cut_file_gives_every_chunk_that_is_whole(tmp_path, share):
    path = write_with_library(tmp_path / "whole.mcap", MESSAGES)
    data = path.read_bytes()
    size = int(share * (len(data) - 1))
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(data[:size])
    expected = 0
    with cut.open("rb") as file:
        records = StreamReader(file, validate_crcs=True).records
        try:
            for record in records:
                expected += type(record).__name__ == "Message"
        except (McapError, struct.error, ValueError, zstandard.ZstdError):
            pass  # the library ends where the file does
    if expected == 0:
        return
    counts, loss = counts_of(cut)
    assert sum(counts.values()) == expected
    if sum(counts.values()) == sum(WHOLE.values()):
        assert not loss or "the file ends" in loss.lines()[0]  # cut behind the last message
    else:
        assert loss.recovered[str(cut)] == expected


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.integers(8, 10**9), st.binary(min_size=1, max_size=40))
def test_whatever_is_overwritten_ends_in_messages_or_one_clear_error(tmp_path, place, garbage):
    path = write_with_library(tmp_path / "whole.mcap", MESSAGES)
    data = bytearray(path.read_bytes())
    place = 8 + place % (len(data) - 8 - len(garbage))
    data[place : place + len(garbage)] = garbage
    broken = tmp_path / "broken.mcap"
    broken.write_bytes(data)
    try:
        counts, _ = counts_of(broken)
    except LogError:
        return
    assert sum(counts.values()) <= sum(WHOLE.values())


def test_trailing_garbage_loses_nothing_and_is_said(tmp_path):
    path = write_with_library(tmp_path / "log.mcap", MESSAGES)
    path.write_bytes(path.read_bytes() + b"garbage" * 10)
    counts, loss = counts_of(path)
    assert counts == WHOLE
    assert not loss
    assert "70 bytes after the end" in loss.notes[0]


def test_zeros_at_the_end_are_a_cut(tmp_path):
    path = write_with_library(tmp_path / "log.mcap", MESSAGES)
    data = path.read_bytes()
    keep = chunk_offsets(path)[-1]
    path.write_bytes(data[:keep] + bytes(len(data) - keep))
    counts, loss = counts_of(path)
    assert 0 < sum(counts.values()) < sum(WHOLE.values())
    assert "zeros" in loss.lines()[0]


def test_a_checksum_tells_a_damaged_message_outside_chunks(tmp_path):
    path = tmp_path / "log.mcap"
    with path.open("wb") as file:
        writer = Writer(file, use_chunking=False, enable_data_crcs=True)
        writer.start()
        channel = writer.register_channel("/t", "json", 0)
        for k in range(5):
            writer.add_message(channel, k, b'{"number": 1}', k)
        writer.finish()
    assert not open_log([path]).loss
    path.write_bytes(path.read_bytes().replace(b'"number"', b'"numb3r"', 1))
    assert "checksum of the data section" in open_log([path]).loss.lines()[0]


def test_messages_of_an_undefined_channel_are_counted(tmp_path):
    path = write_with_library(
        tmp_path / "log.mcap", MESSAGES, use_chunking=False, with_summary=False, index_types=IndexType.NONE
    )
    data = path.read_bytes()
    builder = RecordBuilder()
    Message(channel_id=99, log_time=START_NS, data=b"x", publish_time=0, sequence=0).write(builder)
    end = data.rindex(b"\x0f" + (4).to_bytes(8, "little"))  # the DataEnd record
    path.write_bytes(data[:end] + builder.end() + data[end:])
    counts, loss = counts_of(path)
    assert counts == WHOLE
    assert "channel 99" in loss.lines()[0]


def test_nothing_to_recover_is_an_error(tmp_path):
    path = tmp_path / "log.mcap"
    path.write_bytes(b"\x89MCAP0\r\n")
    with pytest.raises(LogError, match="nothing in this MCAP file can be recovered"):
        open_log([path])


def test_only_chunks_with_the_topic_are_read(tmp_path, monkeypatch):
    late = [(START_NS + 10 * SECOND_NS + k, "/odom2", Odometry(START_NS + k, MESSAGES[1][2].pose)) for k in range(20)]
    path = write_with_library(tmp_path / "log.mcap", [*MESSAGES, *late], chunk_size=5_000)
    read = []
    original = mcap.chunk_bytes
    monkeypatch.setattr(mcap, "chunk_bytes", lambda data: read.append(1) or original(data))
    file = McapFile(path, Loss())
    assert len(list(file.raw(["/odom2"]))) == 20
    few = len(read)
    assert len(list(file.raw())) == 242
    assert few < 0.3 * (len(read) - few)


def conformance_files(data):
    """(name, bytes, expectation) of the files of the MCAP specification."""
    archive = next((data / "logs/mcap_conformance").glob("TenMessages*.tar.gz"))
    with tarfile.open(archive) as tar:
        members = {m.name: m for m in tar.getmembers()}
        for name in sorted(n for n in members if n.endswith(".mcap")):
            expected = json.load(tar.extractfile(members[name.removesuffix(".mcap") + ".json"]))
            yield name.rpartition("/")[2], tar.extractfile(members[name]).read(), expected


@pytest.mark.data
def test_all_conformance_files_hold_ten_messages(data, tmp_path):
    number = 0
    for name, content, expected in conformance_files(data):
        path = tmp_path / name
        path.write_bytes(content)
        loss = Loss()
        found = list(McapFile(path, loss).raw())
        messages = [dict(r["fields"]) for r in expected["records"] if r["type"] == "Message"]
        wanted = sorted((int(m["log_time"]), bytes(int(b) for b in m["data"])) for m in messages)
        assert sorted((log_ns, payload) for log_ns, _, _, payload in found) == wanted, name
        assert [m[0] for m in found] == sorted(m[0] for m in found), name
        assert not loss, (name, loss)
        channels = [dict(r["fields"]) for r in expected["records"] if r["type"] == "Channel"]
        assert {c.topic for _, _, c, _ in found} == {c["topic"] for c in channels}, name
        number += 1
    assert number == 154


@pytest.mark.data
@pytest.mark.parametrize(
    ("name", "messages", "recovered"),
    [
        ("unchunked", 5601, None),
        ("empty_profile", 5601, None),
        ("no_index_no_summary", 5601, None),
        ("log_time_plus_8days", 5601, None),
        ("trailing_garbage", 5601, None),
        ("no_tf_static", 5600, None),
        ("truncated_60pct", 2107, 2107),
        ("bitflip_mid_chunk", 3508, 3508),
    ],
)
def test_real_broken_files(data, name, messages, recovered):
    path = data / f"logs/robustness/{name}.mcap"
    counts, loss = counts_of(path)
    assert sum(counts.values()) == messages
    assert loss.recovered == ({} if recovered is None else {str(path): recovered})
    assert bool(loss) == (recovered is not None)


@pytest.mark.data
@pytest.mark.parametrize(("name", "words"), [("empty", "0 bytes"), ("not_mcap", "not a recording")])
def test_real_files_that_are_no_recording(data, name, words):
    with pytest.raises(LogError, match=words):
        open_log([data / f"logs/robustness/{name}.mcap"])
