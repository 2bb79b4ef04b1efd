"""Stretches of a file that are read at once -> its messages in the order of their record time, in bounded memory."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from wallkit.logs.message import RawMessage

SORT_WINDOW_BYTES = 64 * 2**20


@dataclass(frozen=True, slots=True)
class Block:
    """A chunk, or a stretch of messages that stand outside chunks.

    Attributes:
        offset, length: its place in the file [byte].
        start_ns, end_ns: first and last record time in it.
        channel_ids: the channels in it; None when the index does not say.
        messages: how many; None when the index does not say.
        is_chunk: whether the bytes are a chunk record or bare message records.
    """

    offset: int
    length: int
    start_ns: int
    end_ns: int
    channel_ids: frozenset[int] | None = None
    messages: int | None = None
    is_chunk: bool = True


def in_time_order(blocks: Sequence[Block], load: Callable[[Block], list[RawMessage]]) -> Iterator[RawMessage]:
    """Messages of all blocks by record time.

    A block is loaded when its first message is due, so memory holds the blocks that overlap in time: one or two in a
    file as recorders write it. Where more than `SORT_WINDOW_BYTES` overlap (a shuffled file), the oldest half of what
    is held goes out unsorted against what comes: order is given up there, never memory.
    """
    pending: list[RawMessage] = []
    held = 0
    for block in sorted(blocks, key=lambda b: (b.start_ns, b.offset)):
        due = bisect_left(pending, (block.start_ns,))
        yield from pending[:due]
        loaded = load(block)
        held += sum(len(m[3]) for m in loaded) - sum(len(m[3]) for m in pending[:due])
        # two sorted runs: the sort merges them in linear time
        pending = sorted(pending[due:] + loaded)
        if held > SORT_WINDOW_BYTES and len(pending) > 1:
            half = len(pending) // 2
            held -= sum(len(m[3]) for m in pending[:half])
            yield from pending[:half]
            pending = pending[half:]
    yield from pending
