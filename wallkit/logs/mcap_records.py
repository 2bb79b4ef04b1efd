"""Bytes of MCAP records -> their fields; https://mcap.dev/spec. What every way of reading the container shares."""

from __future__ import annotations

import io
import struct
from collections.abc import Callable
from dataclasses import dataclass, field

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.records import Channel as ChannelRecord
from mcap.records import Chunk, Schema
from mcap.stream_reader import get_chunk_data_stream

from wallkit.logs.blocks import Block
from wallkit.logs.message import Channel

MAGIC = b"\x89MCAP0\r\n"
RECORD = struct.Struct("<BQ")  # opcode, length
MESSAGE = struct.Struct("<HIQQ")  # channel id, sequence, log time, publish time
# what parsing a damaged record can raise, beside errors of decompression; a damaged length asks for more than there is
PARSE_ERRORS = (McapError, struct.error, ValueError, OverflowError, MemoryError)


@dataclass
class Index:
    """Where the messages of one file stand: its schemas and channels by id, its blocks, and messages per channel."""

    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, ChannelRecord] = field(default_factory=dict)
    blocks: list[Block] = field(default_factory=list)
    counts: dict[int, int] | None = field(default_factory=dict)


def channel_from_records(index: Index, record: ChannelRecord) -> Channel:
    """The channel of a channel record and its schema."""
    schema = index.schemas.get(record.schema_id)
    return Channel(
        topic=record.topic,
        type_name=schema.name if schema else "",
        encoding=record.message_encoding,
        schema_encoding=schema.encoding if schema else "",
        schema=bytes(schema.data) if schema else b"",
        count=None if index.counts is None else index.counts.get(record.id, 0),
        qos=record.metadata.get("offered_qos_profiles", ""),
    )


def chunk_bytes(record: bytes) -> bytes:
    """What a chunk record holds, decompressed and compared with its checksum.

    Raises:
        ValueError: it is damaged, or compressed in a way nobody knows.
    """
    import zstandard

    try:
        chunk = Chunk.read(ReadDataStream(io.BytesIO(record)))
    except PARSE_ERRORS as error:
        raise ValueError(f"the chunk's header is damaged ({error})") from error
    if chunk.compression not in ("", "zstd", "lz4"):
        raise ValueError(f"the chunk's compression {chunk.compression[:16]!r} is unknown")
    try:
        stream, size = get_chunk_data_stream(chunk, validate_crc=True)
    except (zstandard.ZstdError, RuntimeError, EOFError, MemoryError) as error:
        raise ValueError(f"the chunk cannot be decompressed ({error})") from error
    except ValueError as error:
        raise ValueError(f"the chunk's checksum is wrong ({error})") from error
    return stream.read(size)


def walk_records(data: bytes, visit: Callable[[int, int, int], None]) -> None:
    """Call visit(opcode, start, stop) for each record in the bytes of a chunk.

    Raises:
        ValueError: a record is longer than what is left.
    """
    position, end = 0, len(data)
    while position < end:
        if position + RECORD.size > end:
            raise ValueError("the chunk ends inside a record")
        opcode, length = RECORD.unpack_from(data, position)
        start = position + RECORD.size
        position = start + length
        if position > end:
            raise ValueError(f"a record of {length} bytes is longer than its chunk")
        visit(opcode, start, position)
