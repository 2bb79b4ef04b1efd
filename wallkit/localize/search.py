"""A handful of LiDAR points and a map -> every place that explains them, by branch and bound over the whole map.

After Hess, Kohler, Rapp & Andor (2016), section V: a pyramid of maxima bounds from above how well any pose inside a block
of poses can match, so whole blocks are dropped without losing an answer. Here all good answers are wanted, not just the
best: a robot that does not know where it is must see its rivals.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

from wallkit.core.geometry import compose, wrap_angle
from wallkit.core.types import BoolArray, FieldSet, Float64Array, Int64Array, UInt8Array

# two answers nearer than this are one
SEPARATION_M = 1.0
SEPARATION_RAD = np.deg2rad(30.0)
LEVELS = 4
# a level never holds more blocks than this: memory stays bounded, and the best are kept
BLOCKS_MAX = 400_000
PORTION = 50_000


@dataclass(frozen=True)
class Place:
    """One answer: pose (3,) in frame map and the mean score of the points there, in [0, 1]."""

    pose: Float64Array
    score: float


@dataclass(frozen=True)
class SearchMap:
    """A map prepared for searching.

    Attributes:
        pyramid: (LEVELS + 1, H, W) uint8; level h holds the largest score (255 = on a surface) of the 2^h x 2^h cells up
            and right of each cell.
        is_free: (H, W) bool at the same cells.
        cell_m: side of a cell: the map is searched at about 0.1 m.
        origin: (3,) T_map_grid.
    """

    pyramid: UInt8Array
    is_free: BoolArray
    cell_m: float
    origin: Float64Array


def prepare_search(fields: FieldSet, *, cell_m: float = 0.1, sigma_m: float = 0.15) -> SearchMap:
    """The pyramid of a map; `sigma_m` is how far off a point may be and still count for 60 %."""
    factor = max(1, round(cell_m / fields.resolution_m))
    # a block may begin left of or below the map and still reach into it, so the map gets a margin there
    margin = factor << LEVELS
    pad = tuple((margin, -n % factor) for n in fields.shape)
    distances = np.pad(fields.distances_m["all"], pad, constant_values=np.float32(1e3))
    free = np.pad(fields.is_free, pad)
    blocks = (distances.shape[0] // factor, factor, distances.shape[1] // factor, factor)
    cell_m = fields.resolution_m * factor
    origin = compose(fields.origin, np.array([-margin * fields.resolution_m, -margin * fields.resolution_m, 0.0]))
    nearest = distances.reshape(blocks).min(axis=(1, 3)) / np.float32(sigma_m)
    levels = [np.round(255.0 * np.exp(-0.5 * nearest * nearest)).astype(np.uint8)]
    for h in range(LEVELS):
        levels.append(_max_of_four(levels[-1], 1 << h))
    return SearchMap(np.stack(levels), np.asarray(free.reshape(blocks).any(axis=(1, 3))), cell_m, origin)


def find_places(
    at: SearchMap, points_m: Float64Array, *, keep: float = 0.75, places_max: int = 30, headings: int = 180
) -> list[Place]:
    """Separated poses of frame base whose points match the map, best first.

    Args:
        at: the prepared map. points_m: (K, 2) in frame base.
        keep: answers scoring less than this share of the best are dropped.
        places_max: most answers given. headings: how finely a full turn is divided.

    Returns:
        Poses that stand in free space, at least SEPARATION_M or SEPARATION_RAD from each other. No points: none.
    """
    if len(points_m) == 0:
        return []
    turns = np.linspace(0.0, 2 * np.pi, headings, endpoint=False)
    c, s = np.cos(turns)[:, None], np.sin(turns)[:, None]
    x, y = points_m[:, 0], points_m[:, 1]
    offsets = np.stack([np.floor((c * x - s * y) / at.cell_m + 0.5), np.floor((s * x + c * y) / at.cell_m + 0.5)])
    offsets = np.ascontiguousarray(offsets.astype(np.int32))

    top = _blocks_over_free_space(at, headings)
    bounds = _bounds(at, LEVELS, top, offsets)
    best = _greedy_best(at, top, bounds, offsets)
    good = np.flatnonzero(bounds >= keep * best)
    blocks, scores = _most(top[:, good], bounds[good])
    for level in range(LEVELS - 1, -1, -1):
        parts = [_refined(at, level, part, offsets, keep * best) for part in _in_portions(blocks)]
        blocks, scores = _most(np.concatenate([b for b, _ in parts], axis=1), np.concatenate([s for _, s in parts]))
    return _separated(at, blocks, scores, turns, places_max)


def _blocks_over_free_space(at: SearchMap, headings: int) -> Int64Array:
    """(3, B) int32 columns, rows, headings of the coarsest blocks that hold a free cell."""
    size = 1 << LEVELS
    height, width = at.is_free.shape
    free = np.pad(at.is_free, ((0, -height % size), (0, -width % size)))
    rows, columns = np.nonzero(free.reshape(-(-height // size), size, -(-width // size), size).any(axis=(1, 3)))
    n = len(rows)
    return np.stack(
        [
            np.repeat(columns * size, headings),
            np.repeat(rows * size, headings),
            np.tile(np.arange(headings), n),
        ]
    ).astype(np.int32)


def _greedy_best(at: SearchMap, top: Int64Array, bounds: Float64Array, offsets: Int64Array) -> float:
    """A score that some pose does reach: the best blocks followed down without looking back."""
    width = 200
    blocks = top[:, np.argsort(-bounds, kind="stable")[:width]]
    best = 0.0
    for level in range(LEVELS - 1, -1, -1):
        blocks = _split(at, blocks, level)
        scores = _bounds(at, level, blocks, offsets)
        if level == 0:
            standing = at.is_free[blocks[1], blocks[0]]
            best = float(scores[standing].max(initial=0.0))
        blocks = blocks[:, np.argsort(-scores, kind="stable")[:width]]
    return best


def _split(at: SearchMap, blocks: Int64Array, level: int) -> Int64Array:
    """The four quarters of every block, those outside the map left out."""
    size = 1 << level
    x, y, t = blocks
    quarters = np.stack(
        [np.concatenate([x, x + size, x, x + size]), np.concatenate([y, y, y + size, y + size]), np.tile(t, 4)]
    )
    height, width = at.is_free.shape
    return quarters[:, (quarters[0] < width) & (quarters[1] < height)]


def _bounds(at: SearchMap, level: int, blocks: Int64Array, offsets: Int64Array) -> Float64Array:
    scores = np.zeros(blocks.shape[1])
    _score_blocks(at.pyramid[level], blocks, offsets, scores)
    return scores


def _in_portions(blocks: Int64Array) -> list[Int64Array]:
    """The blocks a portion at a time, so that splitting them takes little memory; at least one portion."""
    return [blocks[:, i : i + PORTION] for i in range(0, max(blocks.shape[1], 1), PORTION)]


def _refined(
    at: SearchMap, level: int, blocks: Int64Array, offsets: Int64Array, least: float
) -> tuple[Int64Array, Float64Array]:
    """The quarters of the blocks that may still hold an answer scoring `least`, and their bounds."""
    blocks = _split(at, blocks, level)
    if level == 0:
        blocks = blocks[:, at.is_free[blocks[1], blocks[0]]]
    scores = _bounds(at, level, blocks, offsets)
    good = np.flatnonzero(scores >= least)
    return blocks[:, good], scores[good]


def _most(blocks: Int64Array, scores: Float64Array) -> tuple[Int64Array, Float64Array]:
    """The best BLOCKS_MAX of them."""
    if len(scores) <= BLOCKS_MAX:
        return blocks, scores
    best = np.argpartition(-scores, BLOCKS_MAX)[:BLOCKS_MAX]
    return blocks[:, best], scores[best]


def _separated(
    at: SearchMap, cells: Int64Array, scores: Float64Array, turns: Float64Array, places_max: int
) -> list[Place]:
    order = np.argsort(-scores, kind="stable")
    cells, scores = cells[:, order], scores[order]
    # a cell stands for its centre, as endpoints were rounded to the nearest cell
    in_grid = np.stack([(cells[0] + 0.5) * at.cell_m, (cells[1] + 0.5) * at.cell_m, turns[cells[2]]], axis=1)
    poses = compose(at.origin, in_grid)
    places: list[Place] = []
    alive = np.ones(len(scores), dtype=bool)
    while len(places) < places_max and alive.any():
        first = int(np.argmax(alive))
        places.append(Place(poses[first], float(scores[first])))
        off = poses - poses[first]
        near = (np.hypot(off[:, 0], off[:, 1]) < SEPARATION_M) & (np.abs(wrap_angle(off[:, 2])) < SEPARATION_RAD)
        alive &= ~near
    return places


def _max_of_four(level: UInt8Array, step: int) -> UInt8Array:
    """Largest of each value and those `step` cells right, up, and right-up of it."""
    right = level.copy()
    right[:, :-step] = np.maximum(level[:, :-step], level[:, step:])
    out = right.copy()
    out[:-step] = np.maximum(right[:-step], right[step:])
    return out


@njit(cache=True, nogil=True)
def _score_blocks(level: Any, blocks: Any, offsets: Any, scores: Any) -> None:
    """scores[i] = mean over points of level[...] at block i; points outside the map score 0."""
    height, width = level.shape
    count = offsets.shape[2]
    for i in range(blocks.shape[1]):
        column, row, turn = blocks[0, i], blocks[1, i], blocks[2, i]
        total = 0
        for k in range(count):
            x, y = column + offsets[0, turn, k], row + offsets[1, turn, k]
            if 0 <= x < width and 0 <= y < height:
                total += level[y, x]
        scores[i] = total / (255.0 * count)
