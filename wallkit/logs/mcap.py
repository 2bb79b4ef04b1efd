"""An MCAP file -> its serialised messages by record time, damaged chunks left out and counted."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path
from typing import BinaryIO

from mcap.opcode import Opcode

from wallkit.logs.blocks import Block, in_time_order
from wallkit.logs.loss import Damage, Loss
from wallkit.logs.mcap_index import index_file
from wallkit.logs.mcap_records import MESSAGE, PARSE_ERRORS, RECORD, channel_from_records, chunk_bytes, walk_records
from wallkit.logs.message import Channel, RawMessage


class McapFile:
    """One MCAP file, read chunk by chunk through its index."""

    format = "MCAP"

    def __init__(self, path: Path, loss: Loss) -> None:
        self._path, self._loss = path, loss
        self._index = index_file(path, loss)
        self._channels = {i: channel_from_records(self._index, c) for i, c in self._index.channels.items()}
        self.channels: tuple[Channel, ...] = tuple(self._channels.values())

    def raw(self, topics: Collection[str] | None = None) -> Iterator[RawMessage]:
        """Serialised messages of the topics (None: of all) by record time; chunks without them are not even read."""
        wanted = {i: c for i, c in self._channels.items() if topics is None or c.topic in topics}
        blocks = [b for b in self._index.blocks if b.channel_ids is None or b.channel_ids & wanted.keys()]
        with self._path.open("rb") as file:
            yield from in_time_order(blocks, lambda block: self._load(file, block, wanted))

    def _load(self, file: BinaryIO, block: Block, wanted: dict[int, Channel]) -> list[RawMessage]:
        file.seek(block.offset)
        try:
            return _messages_in(file.read(block.length), block, wanted)
        except PARSE_ERRORS as error:
            self._count(block, str(error))
            return []

    def _count(self, block: Block, reason: str) -> None:
        name = str(self._path)
        self._loss.add(Damage(name, block.offset, reason, block.messages, self._last_before(block)))
        lost = [d.messages for d in self._loss.damages.values() if d.file == name]
        if self._index.counts and None not in lost:
            self._loss.recovered[name] = sum(self._index.counts.values()) - sum(n or 0 for n in lost)

    def _last_before(self, block: Block) -> int | None:
        return max((b.end_ns for b in self._index.blocks if b.end_ns <= block.start_ns and b != block), default=None)


def _messages_in(data: bytes, block: Block, wanted: dict[int, Channel]) -> list[RawMessage]:
    """Messages of the wanted channel ids in the bytes of one block.

    Raises:
        ValueError, McapError, struct.error: the block is damaged.
    """
    if block.is_chunk:
        if len(data) < RECORD.size or RECORD.unpack_from(data) != (Opcode.CHUNK, block.length - RECORD.size):
            raise ValueError("there is no chunk where the index says")
        data = chunk_bytes(data[RECORD.size :])
    messages: list[RawMessage] = []
    number = block.offset << 32

    def visit(opcode: int, start: int, stop: int) -> None:
        nonlocal number
        if opcode == Opcode.MESSAGE:
            channel_id, _, log_ns, _ = MESSAGE.unpack_from(data, start)
            number += 1
            if channel_id in wanted:
                messages.append((log_ns, number, wanted[channel_id], data[start + MESSAGE.size : stop]))

    walk_records(data, visit)
    return messages
