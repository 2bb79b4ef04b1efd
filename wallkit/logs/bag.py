"""A ROS 1 bag -> its serialised messages by record time, from its index or, if the recorder never wrote one, without.

http://wiki.ros.org/Bags/Format/2.0: a record is a header of `name=value` fields and data, both with their length in
front. The container is read by hand, the messages in it by rosbags: rosbags' own reader keeps an index entry for every
message in memory and gives nothing of a bag that was cut or never closed (`.bag.active`).
"""

from __future__ import annotations

import bz2
import struct
from collections.abc import Collection, Iterator
from dataclasses import replace
from pathlib import Path
from typing import BinaryIO

from wallkit.errors import LogError
from wallkit.logs.blocks import Block, in_time_order
from wallkit.logs.loss import Damage, Loss
from wallkit.logs.message import Channel, RawMessage

MAGIC = b"#ROSBAG V2.0\n"
OLD_MAGICS = (b"#ROSRECORD", b"#ROSBAG V1", b"#ROSLOG")
_LENGTH = struct.Struct("<I")
_TIME = struct.Struct("<II")
_PLACE = struct.Struct("<Q")
_COUNT = struct.Struct("<II")  # connection, messages
_MESSAGE, _CHUNK, _CONNECTION = 2, 5, 7
# what parsing and decompressing damaged bytes can raise; bz2 says OSError, lz4 RuntimeError
_DAMAGED = (ValueError, struct.error, KeyError, IndexError, OSError, RuntimeError, EOFError, OverflowError, MemoryError)


class BagFile:
    """One ROS 1 bag, read chunk by chunk."""

    format = "ROS 1 bag"

    def __init__(self, path: Path, loss: Loss) -> None:
        self._path, self._loss = path, loss
        index = _index_from_end(path) or _index_from_walk(path, loss)
        self._blocks, self._channels = index
        if not self._channels and loss.damages:
            raise LogError("nothing in this bag can be recovered", where=path)
        self.channels: tuple[Channel, ...] = tuple(self._channels.values())

    def raw(self, topics: Collection[str] | None = None) -> Iterator[RawMessage]:
        """Serialised messages of the topics (None: of all) by record time; chunks without them are not even read."""
        wanted = {i: c for i, c in self._channels.items() if topics is None or c.topic in topics}
        blocks = [b for b in self._blocks if b.channel_ids is None or b.channel_ids & wanted.keys()]
        with self._path.open("rb") as file:
            yield from in_time_order(blocks, lambda block: self._load(file, block, wanted))

    def _load(self, file: BinaryIO, block: Block, wanted: dict[int, Channel]) -> list[RawMessage]:
        file.seek(block.offset)
        try:
            return _messages_in(file, block, wanted)
        except _DAMAGED as error:
            name = str(self._path)
            self._loss.add(Damage(name, block.offset, f"the chunk is damaged ({error})", block.messages))
            lost = sum(d.messages or 0 for d in self._loss.damages.values() if d.file == name)
            self._loss.recovered[name] = sum(b.messages or 0 for b in self._blocks) - lost
            return []


def _messages_in(file: BinaryIO, block: Block, wanted: dict[int, Channel]) -> list[RawMessage]:
    """Messages of the wanted connections in the chunk at the file's position."""
    messages: list[RawMessage] = []
    number = block.offset << 32
    for fields, data in _records(_chunk_content(file)):
        if fields[b"op"][0] == _MESSAGE:
            number += 1
            connection = _number(fields, b"conn")
            if connection in wanted:
                messages.append((_time_ns(fields[b"time"]), number, wanted[connection], data))
    return messages


def _index_from_end(path: Path) -> tuple[list[Block], dict[int, Channel]] | None:
    """Blocks and channels from the bag's own index at its end; None when it has none or it is damaged."""
    with path.open("rb") as file:
        file.seek(len(MAGIC))
        try:
            return _read_index(file, path.stat().st_size)
        except _DAMAGED:
            return None


def _read_index(file: BinaryIO, size: int) -> tuple[list[Block], dict[int, Channel]]:
    fields, _ = _record_header(file)
    (place,) = _PLACE.unpack(fields[b"index_pos"])
    connections, chunks = _number(fields, b"conn_count"), _number(fields, b"chunk_count")
    if not len(MAGIC) < place <= size:
        raise ValueError("the bag has no index")
    file.seek(place)
    blocks: list[Block] = []
    channels: dict[int, Channel] = {}
    for _ in range(connections):
        fields, length = _record_header(file)
        channels[_number(fields, b"conn")] = _channel(fields, file.read(length))
    totals = dict.fromkeys(channels, 0)
    for _ in range(chunks):
        fields, length = _record_header(file)
        counts = dict(_COUNT.iter_unpack(file.read(length)))
        for connection, count in counts.items():
            totals[connection] += count
        (offset,) = _PLACE.unpack(fields[b"chunk_pos"])
        start_ns, end_ns = _time_ns(fields[b"start_time"]), _time_ns(fields[b"end_time"])
        blocks.append(Block(offset, 0, start_ns, end_ns, frozenset(counts), sum(counts.values())))
    return blocks, {i: replace(c, count=totals[i]) for i, c in channels.items()}


def _index_from_walk(path: Path, loss: Loss) -> tuple[list[Block], dict[int, Channel]]:
    """Blocks and channels from every chunk of the bag, reading one at a time."""
    blocks: list[Block] = []
    channels: dict[int, Channel] = {}
    damages: list[Damage] = []
    size = path.stat().st_size
    with path.open("rb") as file:
        file.seek(len(MAGIC))
        while (offset := file.tell()) < size:
            last_ns = blocks[-1].end_ns if blocks else None
            try:
                operation, stop = _record_span(file, size)
            except _DAMAGED as error:
                damages.append(Damage(str(path), offset, f"the bag ends inside a record ({error})", None, last_ns))
                break
            if operation == _CHUNK:
                file.seek(offset)
                try:
                    block, found = _survey(file, offset)
                except _DAMAGED as error:
                    damages.append(Damage(str(path), offset, f"the chunk is damaged ({error})", None, last_ns))
                else:
                    blocks += [block] if block.messages else []
                    _add_channels(channels, found)
            file.seek(stop)
    for damage in damages:
        loss.add(damage)
        loss.recovered[str(path)] = sum(b.messages or 0 for b in blocks)
    loss.note(f"{path}: the bag has no usable index (never closed, or damaged); it was read from start to end")
    return blocks, channels


def _record_span(file: BinaryIO, size: int) -> tuple[int, int]:
    """Kind of the record at the file's position, and where it ends."""
    fields, length = _record_header(file)
    stop = file.tell() + length
    if stop > size:
        raise ValueError(f"of {length} bytes, {stop - size} of them missing")
    return fields[b"op"][0], stop


def _add_channels(channels: dict[int, Channel], found: dict[int, Channel]) -> None:
    for i, channel in found.items():
        known = channels.get(i, replace(channel, count=0))
        channels[i] = replace(known, count=(known.count or 0) + (channel.count or 0))


def _survey(file: BinaryIO, offset: int) -> tuple[Block, dict[int, Channel]]:
    """The block of the chunk at the file's position, and its channels with the messages each has in it."""
    times: list[int] = []
    channels: dict[int, Channel] = {}
    counts: dict[int, int] = {}
    for fields, data in _records(_chunk_content(file)):
        if fields[b"op"][0] == _CONNECTION:
            channels[_number(fields, b"conn")] = _channel(fields, data)
        elif fields[b"op"][0] == _MESSAGE:
            connection = _number(fields, b"conn")
            times.append(_time_ns(fields[b"time"]))
            counts[connection] = counts.get(connection, 0) + 1
    channels = {i: replace(c, count=counts.get(i, 0)) for i, c in channels.items()}
    start, end = (min(times), max(times)) if times else (0, 0)
    return Block(offset, 0, start, end, frozenset(counts), len(times)), channels


def _chunk_content(file: BinaryIO) -> bytes:
    """What the chunk record at the file's position holds, decompressed."""
    fields, length = _record_header(file)
    data = file.read(length)
    if fields[b"op"][0] != _CHUNK or len(data) < length:
        raise ValueError("there is no whole chunk")
    compression = fields[b"compression"].decode()
    if compression == "none":
        return data
    if compression == "bz2":
        return bz2.decompress(data)
    if compression == "lz4":
        import lz4.frame

        content: bytes = lz4.frame.decompress(data)
        return content
    raise ValueError(f"compression {compression!r} is unknown")


def _records(data: bytes) -> Iterator[tuple[dict[bytes, bytes], bytes]]:
    """Header fields and data of each record in a chunk."""
    position = 0
    while position < len(data):
        (length,) = _LENGTH.unpack_from(data, position)
        fields = _fields(data[position + 4 : position + 4 + length])
        position += 4 + length
        (length,) = _LENGTH.unpack_from(data, position)
        stop = position + 4 + length
        if stop > len(data):
            raise ValueError("the chunk ends inside a record")
        yield fields, data[position + 4 : stop]
        position = stop


def _record_header(file: BinaryIO) -> tuple[dict[bytes, bytes], int]:
    """Header fields of the record at the file's position, and the length of the data that begins behind it."""
    (length,) = _LENGTH.unpack(file.read(4))
    if length > 2**20:
        raise ValueError(f"a header of {length} bytes")
    fields = _fields(file.read(length))
    if b"op" not in fields:
        raise ValueError("a record without a kind")
    (data_length,) = _LENGTH.unpack(file.read(4))
    return fields, data_length


def _fields(data: bytes) -> dict[bytes, bytes]:
    fields, position = {}, 0
    while position < len(data):
        (length,) = _LENGTH.unpack_from(data, position)
        name, equals, value = data[position + 4 : position + 4 + length].partition(b"=")
        if not equals:
            raise ValueError("a header field without '='")
        fields[name] = value
        position += 4 + length
    return fields


def _time_ns(data: bytes) -> int:
    seconds, nanoseconds = _TIME.unpack(data)
    return int(seconds) * 1_000_000_000 + int(nanoseconds)


def _number(fields: dict[bytes, bytes], name: bytes) -> int:
    (number,) = _LENGTH.unpack(fields[name])
    return int(number)


def _channel(fields: dict[bytes, bytes], data: bytes) -> Channel:
    """The channel of a connection record."""
    said = _fields(data)
    definition, kind = said.get(b"message_definition", b""), said[b"type"].decode()
    return Channel(fields[b"topic"].decode(), kind, "ros1", "ros1msg", definition, 0)
