"""Scans and the surfaces of a map -> the other poses that explain them: a search of all places and headings.

Branch and bound, as Olson, "Real-time correlative scan matching" (2009) and Hess et al., "Real-time loop closure in 2D
LIDAR SLAM" (2016), over the nodes of `nodes`. A return also misses from a whole node when it ends behind what all beams
of the node meet (`horizon`). Leaves (0.1 m, 2.5 deg) are settled by Gauss-Newton onto the segments, then counted there.
"""

from __future__ import annotations

import math
import os
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from wallkit.core.types import Float64Array, Int64Array
from wallkit.maps.score.horizon import alike_blocks, horizons_for, look_round, profiles_of
from wallkit.maps.score.nearness import LANES, TURNS, Nearness
from wallkit.maps.score.nodes import (
    LEAVES,
    find_leaves,
    free_spans,
    is_left_within,
    misses_from_block,
    nodes_of,
    place_returns,
    sift,
)
from wallkit.maps.score.settle import (
    Beams,
    Criterion,
    Ground,
    count_explained,
    is_close,
    is_free,
    polish,
    settle,
    slide,
)
from wallkit.maps.sight import Sight

# `modes` of a pose whose scan fits all along a line, here or elsewhere: what can slide or turn without a beam noticing
CONTINUUM = -1
# the search of a pose ends at so many rivals
MOST_RIVALS = 16

_STARTS = 3
_SLIDERS = 3
_SAME_M, _SAME_RAD = 0.1, math.radians(5.0)
_GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0


class Rivals(NamedTuple):
    """What the search found, per pose.

    Attributes:
        explained: (N,) beams that the best rival found explains; 0 when none explains enough.
        best: (N, 3) that rival, NaN without one.
        modes: (N,) groups of poses that explain the scan, itself included, or CONTINUUM.
        found: (N, MOST_RIVALS, 4) x, y, yaw and beams explained of the rivals found; counts: (N,) how many.
    """

    explained: Int64Array
    best: Float64Array
    modes: Int64Array
    found: Float64Array
    counts: Int64Array


def ground_of(near: Nearness, sight: Sight, labels: Int64Array, criterion: Criterion) -> Ground:
    """All that the search needs to know of a map."""
    profiles = profiles_of(sight, near, criterion.range_max_m)
    return Ground(near, horizons_for(near), np.zeros_like(near.free_block), profiles, sight, labels, criterion)


def find_rivals(
    ground: Ground, poses: Float64Array, bearings: Float64Array, ranges: Float64Array, wanted: Int64Array
) -> Rivals:
    """Rivals of scans, anywhere on the free floor; found on all cores, the same on any number of them.

    Args:
        poses: (N, 3). bearings: (K,) [rad]. ranges: (N, K) [m] with inf for no return.
        wanted: (N, K) label that a return must meet again, -1 for any.
    """
    count = len(poses)
    rivals = Rivals(
        np.zeros(count, dtype=np.int64),
        np.full((count, 3), np.nan),
        np.ones(count, dtype=np.int64),
        np.zeros((count, MOST_RIVALS, 4)),
        np.zeros(count, dtype=np.int64),
    )
    # neighbouring beams tell much the same: in an order that jumps about, poses that do not fit are found out early
    order = np.argsort((np.arange(len(bearings)) * _GOLDEN) % 1.0)
    workers = max(1, min(os.cpu_count() or 1, 4, count))
    edges = np.linspace(0, count, workers + 1).astype(np.int64)

    def search(first: int, last: int) -> None:
        own = slice(first, last)
        piece = Rivals(
            rivals.explained[own], rivals.best[own], rivals.modes[own], rivals.found[own], rivals.counts[own]
        )
        _find_all(ground, poses[own], bearings, ranges[own], wanted[own], order, _offsets(), piece)

    with ThreadPoolExecutor(workers) as pool:
        list(pool.map(search, edges[:-1].tolist(), edges[1:].tolist()))
    return rivals


def _offsets() -> Int64Array:
    """Headings of the lattice from a pose's own on: buildings repeat at right angles."""
    turns = np.arange(TURNS)
    quarter = TURNS // 4
    off = np.minimum(turns % quarter, -turns % quarter)
    return np.argsort(off, kind="stable")


@njit(cache=True, nogil=True)
def _find_all(
    ground: Any, poses: Any, bearings: Any, ranges: Any, wanted: Any, order: Any, offsets: Any, rivals: Any
) -> None:
    cosines, sines = np.cos(bearings), np.sin(bearings)
    for i in range(poses.shape[0]):
        beams = Beams(bearings, cosines, sines, ranges[i], wanted[i])
        explained, pose = slide(ground, beams, poses[i])
        if explained > 0:
            rivals.modes[i] = CONTINUUM
        else:
            explained, pose, slides = _search(
                ground, beams, poses[i], order, offsets, rivals.found[i], rivals.counts[i : i + 1]
            )
            found = rivals.found[i, : rivals.counts[i], :3]
            rivals.modes[i] = CONTINUUM if slides else _count_modes(ground.criterion, poses[i], found)
        if explained > 0:
            rivals.explained[i] = explained
            for a in range(3):
                rivals.best[i, a] = pose[a]


@njit(cache=True, nogil=True)
def _search(ground: Any, beams: Any, own: Any, order: Any, offsets: Any, found: Any, counts: Any) -> Any:
    """(most beams that a rival explains, that rival, whether one can slide); those that explain enough go to `found`.

    Ends at a rival that can slide, and at MOST_RIVALS.
    """
    near, criterion = ground.near, ground.criterion
    size = beams.ranges.shape[0]
    nodes = nodes_of(ground, beams, order)
    returned = nodes.returned
    slabs, slab_columns = near.slabs.reshape(-1), near.slabs.shape[4]
    misses = np.empty(LANES, dtype=np.uint8)
    places, sectors = np.empty(returned.shape[0], dtype=np.int64), np.empty(returned.shape[0], dtype=np.uint8)
    allowed = size - criterion.needed
    most, best = 0, own
    round_share = abs(beams.bearings[size - 1] - beams.bearings[0]) / (2 * math.pi) * size / max(size - 1, 1)
    alike = alike_blocks(near, ground.profiles, beams.ranges, criterion.range_max_m, allowed / size, round_share > 0.99)
    spans = free_spans(alike)
    turned = own[2] / (2 * math.pi)
    facing = int((turned - math.floor(turned)) * TURNS)
    for offset in offsets:
        turn = (facing + offset) % TURNS
        place_returns(near, beams, returned, nodes.fields, (turn + 0.5) * 2 * math.pi / TURNS, places, sectors)
        for span in range(spans.shape[0]):
            row, start = spans[span, 0], spans[span, 1]
            if not sift(slabs, places, nodes.tolerances[0], row * slab_columns + start, misses, allowed):
                continue
            for lane in range(min(LANES, near.free_block.shape[1] - start)):
                column = start + lane
                if misses[lane] > allowed or not alike[row, column]:
                    continue
                look_round(ground.sight, near, row, column, criterion.tolerance_m, ground.horizons, ground.looked)
                place, horizon = row * slab_columns + column, ground.horizons[row, column]
                if misses_from_block(slabs, places, nodes, place, horizon, sectors, allowed) > allowed:
                    continue
                before = counts[0]
                explained, pose = _descend(ground, beams, own, nodes, (row, column, turn), allowed, found, counts)
                if explained > most:
                    most, best = explained, pose
                if before < counts[0] <= _SLIDERS and slide(ground, beams, pose)[0] > 0:
                    return most, best, True
                if counts[0] == MOST_RIVALS:
                    return most, best, False
    return most, best, False


@njit(cache=True, nogil=True)
def _descend(ground: Any, beams: Any, own: Any, nodes: Any, block: Any, allowed: Any, found: Any, counts: Any) -> Any:
    """(beams explained, pose) of a pose in a block that is away from `own` and explains enough; (0, any) when none does."""
    leaves = np.empty((LEAVES, 4))
    held = find_leaves(ground.near, nodes, block, allowed, leaves)
    criterion, size = ground.criterion, beams.ranges.shape[0]
    top, best = 0, own
    tried = 0
    for i in range(held):
        repeats = False
        for j in range(i):
            repeats |= leaves[j, 0] < 0 and is_close(leaves[i, 1:], leaves[j, 1:], 1.5 * _SAME_M, 1.5 * _SAME_RAD)
        if repeats or not is_left_within(ground.near, beams, nodes, leaves[i, 1:], allowed):
            continue
        leaves[i, 0] = -1
        tried += 1
        pose, good = settle(ground, beams, leaves[i, 1:], 6, allowed + size // 20)
        if _is_known(pose, found, counts[0]):
            break
        away = not is_close(pose, own, criterion.apart_m, criterion.apart_rad)
        if good and away and is_free(ground.near, pose):
            explained = count_explained(ground, beams, pose, criterion.tolerance_m, size - allowed - size // 20)
            if 0 <= explained < criterion.needed:
                explained = polish(ground, beams, own, pose, explained)
            if explained > top:
                top, best = explained, pose
        if top >= criterion.needed or tried == _STARTS:
            break
    if top < criterion.needed:
        return 0, best
    for a in range(3):
        found[counts[0], a] = best[a]
    found[counts[0], 3] = top
    counts[0] += 1
    return top, best


@njit(cache=True, nogil=True)
def _is_known(pose: Any, found: Any, count: Any) -> Any:
    known = False
    for i in range(count):
        known |= is_close(pose, found[i], _SAME_M, _SAME_RAD)
    return known


@njit(cache=True, nogil=True)
def _count_modes(criterion: Any, own: Any, found: Any) -> Any:
    """Groups of rivals and the pose itself, linked where they are no rivals of each other; CONTINUUM if one is wide."""
    count = found.shape[0] + 1
    poses, group = np.empty((count, 3)), np.empty(count, dtype=np.int64)
    for a in range(count):
        group[a] = a
        for axis in range(3):
            poses[a, axis] = own[axis] if a == 0 else found[a - 1, axis]
    groups = count
    for a in range(count):
        for b in range(a):
            if group[a] != group[b] and is_close(poses[a], poses[b], criterion.apart_m, criterion.apart_rad):
                old, groups = group[a], groups - 1
                for c in range(count):
                    if group[c] == old:
                        group[c] = group[b]
    for a in range(count):
        for b in range(a):
            if group[a] == group[b] and not is_close(poses[a], poses[b], criterion.apart_m, criterion.apart_rad):
                return CONTINUUM
    return groups
