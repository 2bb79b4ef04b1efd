"""An MCAP file without a usable index -> where its messages stand, from every record of it, one at a time.

The walk is our own, because a file that is cut or damaged must still give everything that is whole, and because the
library's streaming reader holds a file without chunks in memory.
"""

from __future__ import annotations

import io
import zlib
from pathlib import Path
from typing import Any, BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel as ChannelRecord
from mcap.records import DataEnd, Schema

from wallkit.logs.blocks import Block
from wallkit.logs.loss import Damage, Loss
from wallkit.logs.mcap_records import MAGIC, MESSAGE, PARSE_ERRORS, RECORD, Index, chunk_bytes, walk_records

_LOOSE_BLOCK_BYTES = 2**20


def index_from_walk(file: BinaryIO, path: Path, loss: Loss) -> Index:
    """The index from every record of the data section, reading one record at a time."""
    size = file.seek(0, io.SEEK_END)
    offset = file.seek(len(MAGIC))
    walk = _Walk(path, loss, file)
    ended = ""
    while not ended:
        header = file.read(RECORD.size)
        opcode, length = RECORD.unpack(header) if len(header) == RECORD.size else (0, 0)
        rest = size - offset - RECORD.size - length - len(MAGIC)
        if len(header) < RECORD.size:
            ended = "the file ends without its closing records (the recorder was stopped or the file cut)"
        elif opcode == 0:
            ended = "these bytes are no records (zeros where the recorder did not finish)"
        elif rest < -len(MAGIC):
            ended = f"the file ends inside a record of {length} bytes (cut off, or the length is damaged)"
        elif opcode == Opcode.FOOTER:
            if rest > 0:
                loss.note(f"{path}: {rest} bytes after the end of the recording were ignored; no message is missing")
            break
        else:
            walk.record(opcode, offset, file.read(length))
            offset = file.tell()
    if ended and walk.has_all_data:
        loss.note(f"{path}: its index is cut off (byte {offset}); no message is missing")
    elif ended:
        walk.damage(offset, ended)
    walk.close_loose_block()
    walk.find_orphans()
    if walk.is_damaged:
        loss.recovered[str(path)] = sum(n for i, n in walk.counts.items() if i in walk.channels)
    return Index(walk.schemas, walk.channels, walk.blocks, walk.counts)


class _Walk:
    """What has been found so far; `record` takes the records of the data section one by one."""

    def __init__(self, path: Path, loss: Loss, file: BinaryIO) -> None:
        self.path, self.loss = path, loss
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, ChannelRecord] = {}
        self.blocks: list[Block] = []
        self.counts: dict[int, int] = {}
        self.is_damaged = False
        self.has_all_data = False
        self._last_ns: int | None = None
        self._loose: list[tuple[int, int, int, int]] = []  # offset, stop, log time, channel of messages outside chunks
        file.seek(0)
        self._crc = zlib.crc32(file.read(len(MAGIC)))

    def damage(self, offset: int, reason: str, messages: int | None = None) -> None:
        self.is_damaged = True
        self.loss.add(Damage(str(self.path), offset, reason, messages, self._last_ns))

    def record(self, opcode: int, offset: int, content: bytes) -> None:
        if opcode == Opcode.CHUNK:
            self.close_loose_block()
            self._chunk(offset, content)
        elif opcode == Opcode.MESSAGE and len(content) >= MESSAGE.size:
            channel_id, _, log_ns, _ = MESSAGE.unpack_from(content)
            self.counts[channel_id] = self.counts.get(channel_id, 0) + 1
            stop = offset + RECORD.size + len(content)
            if self._loose and stop - self._loose[0][0] > _LOOSE_BLOCK_BYTES:
                self.close_loose_block()
            self._loose.append((offset, stop, log_ns, channel_id))
            self._last_ns = log_ns
        elif opcode == Opcode.DATA_END:
            self._data_end(offset, content)
        else:
            self._definition(opcode, offset, content)
        self._crc = zlib.crc32(content, zlib.crc32(RECORD.pack(opcode, len(content)), self._crc))

    def close_loose_block(self) -> None:
        if self._loose:
            start, stop = self._loose[0][0], self._loose[-1][1]
            times, ids = [m[2] for m in self._loose], frozenset(m[3] for m in self._loose)
            block = Block(start, stop - start, min(times), max(times), ids, len(times), is_chunk=False)
            self.blocks.append(block)
            self._loose = []

    def find_orphans(self) -> None:
        for block in self.blocks:
            for channel_id in sorted((block.channel_ids or frozenset()) - self.channels.keys()):
                n = self.counts.pop(channel_id, 0)
                if n:
                    self.damage(block.offset, f"no record tells what channel {channel_id} holds", n)

    def _chunk(self, offset: int, content: bytes) -> None:
        try:
            data = chunk_bytes(content)
        except ValueError as error:
            self.damage(offset, str(error))
            return
        counts: dict[int, int] = {}
        times: list[int] = []

        def visit(opcode: int, start: int, stop: int) -> None:
            if opcode == Opcode.MESSAGE:
                channel_id, _, log_ns, _ = MESSAGE.unpack_from(data, start)
                counts[channel_id] = counts.get(channel_id, 0) + 1
                times.append(log_ns)
            else:
                self._definition(opcode, offset, data[start:stop])

        try:
            walk_records(data, visit)
        except PARSE_ERRORS as error:
            self.damage(offset, str(error))
            return
        if times:
            length = RECORD.size + len(content)
            self.blocks.append(Block(offset, length, min(times), max(times), frozenset(counts), len(times)))
            self._last_ns = max(times)
        for channel_id, n in counts.items():
            self.counts[channel_id] = self.counts.get(channel_id, 0) + n

    def _definition(self, opcode: int, offset: int, content: bytes) -> None:
        readers: dict[int, tuple[Any, dict[int, Any]]] = {
            Opcode.SCHEMA: (Schema.read, self.schemas),
            Opcode.CHANNEL: (ChannelRecord.read, self.channels),
        }
        if opcode in readers:
            read, known = readers[opcode]
            try:
                record = read(ReadDataStream(io.BytesIO(content)))
            except PARSE_ERRORS as error:
                self.damage(offset, f"a schema or channel record is damaged ({error})")
                return
            known[record.id] = record

    def _data_end(self, offset: int, content: bytes) -> None:
        self.has_all_data = True
        try:
            stated = DataEnd.read(ReadDataStream(io.BytesIO(content))).data_section_crc
        except PARSE_ERRORS:
            stated = 0
        if stated not in (0, self._crc) and not self.is_damaged:
            self.damage(
                offset, "the checksum of the data section is wrong: some message is damaged, none can be named", 0
            )
