"""A mask -> COCO's run lengths and back: down the columns, first the zeros, packed into text as pycocotools does.

Format: maskApi.c of the COCO API (Lin and Dollar, 2014): from the fourth on a count is told as its difference to the one
two before; five bits to a character from '0' on, the sixth bit says that more follow.
"""

from __future__ import annotations

import numpy as np

from wallkit.core.types import BoolArray, Int64Array

_FIRST = 48


def counts_from_mask(mask: BoolArray) -> Int64Array:
    """Lengths of runs of 0, 1, 0, ... down the columns of a mask (H, W)."""
    flat = mask.ravel(order="F")
    edges = np.flatnonzero(np.diff(flat)) + 1
    bounds = np.concatenate([[0], edges, [flat.size]])
    counts = np.diff(bounds)
    return np.concatenate([[0], counts]) if flat.size and flat[0] else counts


def mask_from_counts(counts: Int64Array, shape: tuple[int, int]) -> BoolArray:
    """(H, W) of run lengths.

    Raises:
        ValueError: they do not make a mask of this shape.
    """
    values = np.arange(len(counts)) % 2 == 1
    return np.repeat(values, counts).reshape(shape, order="F")


def text_from_counts(counts: Int64Array) -> str:
    """Run lengths as COCO's text."""
    rest = np.asarray(counts, dtype=np.int64).copy()
    rest[3:] -= counts[1:-2]
    left = np.ones(len(rest), dtype=bool)
    columns = []
    while left.any():
        bits = rest & 0x1F
        rest = rest >> 5
        more = np.where(bits & 0x10, rest != -1, rest != 0)
        columns.append(np.where(left, bits + 0x20 * more + _FIRST, 0))
        left &= more
    characters = np.stack(columns, axis=1).astype(np.uint8).ravel() if columns else np.zeros(0, np.uint8)
    return characters[characters > 0].tobytes().decode("ascii")


def counts_from_text(text: str) -> Int64Array:
    """Run lengths of COCO's text."""
    counts: list[int] = []
    value, shift = 0, 0
    for character in text.encode("ascii"):
        bits = character - _FIRST
        value |= (bits & 0x1F) << shift
        shift += 5
        if bits & 0x20:
            continue
        if bits & 0x10:
            value -= 1 << shift
        counts.append(value + (counts[-2] if len(counts) > 2 else 0))
        value, shift = 0, 0
    return np.array(counts, dtype=np.int64)
