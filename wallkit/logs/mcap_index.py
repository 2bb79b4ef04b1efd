"""An MCAP file -> where its messages stand: from its own index if that can be trusted, else by walking the file."""

from __future__ import annotations

import io
import zlib
from pathlib import Path
from typing import BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.reader import FOOTER_SIZE, SeekingReader
from mcap.records import Footer
from mcap.summary import Summary

from wallkit.errors import LogError
from wallkit.logs.blocks import Block
from wallkit.logs.loss import Loss
from wallkit.logs.mcap_records import MAGIC, PARSE_ERRORS, RECORD, Index
from wallkit.logs.mcap_walk import index_from_walk


def index_file(path: Path, loss: Loss) -> Index:
    """Where the messages of an MCAP file stand.

    Raises:
        LogError: nothing in the file can be recovered.
    """
    with path.open("rb") as file:
        index = _index_from_summary(file) or index_from_walk(file, path, loss)
    if loss.damages and not index.channels:
        damage = next(iter(loss.damages.values()))
        raise LogError(
            f"nothing in this MCAP file can be recovered: {damage.reason} (byte {damage.offset})", where=path
        )
    return index


def _index_from_summary(file: BinaryIO) -> Index | None:
    """The index from the summary section; None when there is none, or it is damaged or incomplete."""
    if not _is_summary_intact(file):
        return None
    file.seek(0)
    try:
        summary = SeekingReader(file).get_summary()
    except (*PARSE_ERRORS, OSError):
        return None
    if summary is None or not _is_complete(summary):
        return None
    blocks = [
        Block(
            c.chunk_start_offset,
            c.chunk_length,
            c.message_start_time,
            c.message_end_time,
            frozenset(c.message_index_offsets) or None,
            _message_count(c.message_index_length, len(c.message_index_offsets)),
        )
        for c in summary.chunk_indexes
    ]
    statistics = summary.statistics
    counts = dict(statistics.channel_message_counts) if statistics and statistics.channel_message_counts else None
    known = [b.messages for b in blocks if b.messages is not None]
    if statistics and len(known) == len(blocks) and sum(known) != statistics.message_count:
        return None  # messages outside chunks, or an index of another file
    return Index(summary.schemas, summary.channels, blocks, counts)


def _is_complete(summary: Summary) -> bool:
    """Whether every message can be found and decoded from the summary alone."""
    statistics, channels = summary.statistics, summary.channels
    if not summary.chunk_indexes or not channels:
        return False
    if statistics and statistics.chunk_count != len(summary.chunk_indexes):
        return False
    if statistics and statistics.channel_count != len(channels):
        return False
    used = {channel_id for c in summary.chunk_indexes for channel_id in c.message_index_offsets}
    schemas = {c.schema_id for c in channels.values()} - {0}
    return used <= channels.keys() and schemas <= summary.schemas.keys()


def _is_summary_intact(file: BinaryIO) -> bool:
    """Whether the file ends as it should, and its summary section has the checksum that is stated; 0 states none."""
    size = file.seek(0, io.SEEK_END)
    end = size - len(MAGIC) - FOOTER_SIZE
    if end < len(MAGIC):
        return False
    file.seek(end)
    tail = file.read()
    if tail[0] != Opcode.FOOTER or tail[FOOTER_SIZE:] != MAGIC:
        return False
    footer = Footer.read(ReadDataStream(io.BytesIO(tail[RECORD.size :])))
    if not len(MAGIC) <= footer.summary_start <= end:
        return False
    file.seek(footer.summary_start)
    covered = file.read(size - len(MAGIC) - 4 - footer.summary_start)
    return footer.summary_crc in (0, zlib.crc32(covered))


def _message_count(index_bytes: int, channels: int) -> int | None:
    """Messages of a chunk, from the size of its message indexes: 15 bytes each and 16 a message."""
    count, rest = divmod(index_bytes - 15 * channels, 16)
    return count if channels and rest == 0 else None
