"""One scan laid over the lattice of places and headings -> which of its nodes can still hold a pose that explains it.

The lattice has blocks of BLOCK cells by 10 deg, halved three times. A node is judged at its centre with the tolerance
widened by all that can be lost between its centre and its rim, so that no node which holds a rival is dropped:

    tolerance + half the square's diagonal + range * half the heading interval + half a field cell's diagonal

(a point at range r moves at most |shift| + r |turn|).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from wallkit.core.types import Int64Array
from wallkit.maps.score.horizon import SECTORS, UNSEEN_DM
from wallkit.maps.score.nearness import BLOCK, FAR_CM, LANES, TURNS

LEAVES = 24  # most leaves of a block that are kept
_BATCH = 24  # beams between two looks whether any block is left


class Nodes(NamedTuple):
    """The returns of one scan in the layouts of the three lattices.

    Attributes:
        returned: (R,) the beams. fields: (R,) the distance field of each. reaches: (R,) uint8 range rounded down [dm].
        tolerances: (4, R) uint8 [cm], widened for blocks, halves, quarters and eighths of blocks.
        halves, quarters: (turns, R, 2) float32 returns [cells] at the middle of each heading interval.
    """

    returned: Int64Array
    fields: Any
    reaches: Any
    tolerances: Any
    halves: Any
    quarters: Any


@njit(cache=True, nogil=True)
def nodes_of(ground: Any, beams: Any, order: Any) -> Any:
    """The returns of a scan for all levels of the lattice; looked at in the given order of its beams."""
    returned = np.empty(order.shape[0], dtype=np.int64)
    count = 0
    for k in order:
        if not np.isinf(beams.ranges[k]):
            returned[count] = k
            count += 1
    returned = returned[:count]
    near, size = ground.near, returned.shape[0]
    fields, reaches = np.empty(size, dtype=np.int32), np.empty(size, dtype=np.uint8)
    tolerances = np.empty((4, size), dtype=np.uint8)
    for j in range(size):
        fields[j] = max(beams.wanted[returned[j]], 0)
        reaches[j] = min(int(beams.ranges[returned[j]] * 10.0), UNSEEN_DM)
        for level in range(4):
            half_diagonal = near.cell_m * (BLOCK / 2 ** (level + 1) + 0.5) * math.sqrt(2.0)
            turn = beams.ranges[returned[j]] * math.pi / (TURNS * 2**level)
            tolerances[level, j] = min(int((ground.criterion.tolerance_m + half_diagonal + turn) * 100.0), FAR_CM)
    halves = _turned(beams, returned, 2 * TURNS, near.cell_m)
    return Nodes(returned, fields, reaches, tolerances, halves, _turned(beams, returned, 4 * TURNS, near.cell_m))


@njit(cache=True, nogil=True)
def place_returns(near: Any, beams: Any, returned: Any, fields: Any, yaw: Any, places: Any, sectors: Any) -> None:
    """Writes where in the slabs each return lies seen from block (0, 0), and the sector of directions it is in."""
    c, s = math.cos(yaw) / near.cell_m, math.sin(yaw) / near.cell_m
    _, _, _, slab_rows, slab_columns = near.slabs.shape
    for j in range(returned.shape[0]):
        k = returned[j]
        x = int(math.floor(BLOCK / 2 + beams.ranges[k] * (c * beams.cosines[k] - s * beams.sines[k])))
        y = int(math.floor(BLOCK / 2 + beams.ranges[k] * (s * beams.cosines[k] + c * beams.sines[k])))
        slab = (fields[j] * BLOCK + y % BLOCK) * BLOCK + x % BLOCK
        places[j] = (slab * slab_rows + near.pad + y // BLOCK) * slab_columns + near.pad + x // BLOCK
        turns = (yaw + beams.bearings[k]) / (2 * math.pi)
        sectors[j] = min(int((turns - math.floor(turns)) * SECTORS), SECTORS - 1)


@njit(cache=True, nogil=True)
def sift(slabs: Any, places: Any, limits: Any, start: Any, misses: Any, allowed: Any) -> Any:
    """Counts the returns that miss from each of LANES blocks in a row; False as soon as no block is left."""
    misses[:] = 0
    total = places.shape[0]
    j = 0
    while j < total:
        stop = min(j + _BATCH, total)
        # four beams at a time: `misses` is read and written once for all
        while j + 3 < stop:
            a, b, c, d = places[j] + start, places[j + 1] + start, places[j + 2] + start, places[j + 3] + start
            in_a, in_b = slabs[a : a + LANES], slabs[b : b + LANES]
            in_c, in_d = slabs[c : c + LANES], slabs[d : d + LANES]
            la, lb, lc, ld = limits[j], limits[j + 1], limits[j + 2], limits[j + 3]
            for i in range(LANES):
                two = np.uint8(in_a[i] > la) + np.uint8(in_b[i] > lb)
                misses[i] += np.uint8(two + np.uint8(in_c[i] > lc) + np.uint8(in_d[i] > ld))
            j += 4
        while j < stop:
            seen = slabs[places[j] + start : places[j] + start + LANES]
            for i in range(LANES):
                misses[i] += np.uint8(seen[i] > limits[j])
            j += 1
        least = misses[0]
        for i in range(LANES):
            least = min(least, misses[i])
        if least > allowed:
            return False
    return True


@njit(cache=True, nogil=True)
def misses_from_block(slabs: Any, places: Any, nodes: Any, place: Any, horizon: Any, sectors: Any, allowed: Any) -> Any:
    """Returns that end behind the horizon of a block, or far from all surfaces; stops counting beyond `allowed`."""
    missed, reaches, limits = 0, nodes.reaches, nodes.tolerances[0]
    for j in range(places.shape[0]):
        if reaches[j] > horizon[sectors[j]] or slabs[np.uint64(places[j] + place)] > limits[j]:
            missed += 1
            if missed > allowed:
                break
    return missed


@njit(cache=True, nogil=True)
def find_leaves(near: Any, nodes: Any, block: Any, allowed: Any, leaves: Any) -> Any:
    """Writes misses, x, y, yaw of the leaves of a block with the fewest misses, in that order; how many."""
    row, column, turn = block
    held, half, quarter = 0, BLOCK / 2, BLOCK / 4
    for i in range(8):
        row_2, column_2, turn_2 = 2 * row + (i & 1), 2 * column + (i >> 1 & 1), 2 * turn + (i >> 2)
        if not near.free_quarter[row_2, column_2]:
            continue
        x, y = (column_2 + 0.5) * half, (row_2 + 0.5) * half
        if _misses(near.distances_cm, x, y, nodes.halves[turn_2], nodes.fields, nodes.tolerances[1], allowed) > allowed:
            continue
        for j in range(8):
            row_4, column_4, turn_4 = 2 * row_2 + (j & 1), 2 * column_2 + (j >> 1 & 1), 2 * turn_2 + (j >> 2)
            if not near.free_half[row_4, column_4]:
                continue
            x, y = (column_4 + 0.5) * quarter, (row_4 + 0.5) * quarter
            turned = nodes.quarters[turn_4]
            missed = _misses(near.distances_cm, x, y, turned, nodes.fields, nodes.tolerances[2], allowed)
            if missed <= allowed:
                yaw = (turn_4 + 0.5) * 2 * math.pi / (4 * TURNS)
                held = _keep(leaves, held, missed, near.x_m + x * near.cell_m, near.y_m + y * near.cell_m, yaw)
    return held


@njit(cache=True, nogil=True)
def is_left_within(near: Any, beams: Any, nodes: Any, leaf: Any, allowed: Any) -> Any:
    """Whether one of the eight parts of a leaf is still possible: cheaper to ask than to settle it."""
    turned = np.empty((nodes.returned.shape[0], 2), dtype=np.float32)
    shift, x, y = BLOCK / 16, (leaf[0] - near.x_m) / near.cell_m, (leaf[1] - near.y_m) / near.cell_m
    for side in (-1.0, 1.0):
        _turn(beams, nodes.returned, leaf[2] + side * math.pi / (8 * TURNS), near.cell_m, turned)
        for i in range(4):
            x_8, y_8 = x + (shift if i & 1 else -shift), y + (shift if i & 2 else -shift)
            if _misses(near.distances_cm, x_8, y_8, turned, nodes.fields, nodes.tolerances[3], allowed) <= allowed:
                return True
    return False


@njit(cache=True, nogil=True)
def _misses(distances: Any, x: Any, y: Any, turned: Any, fields: Any, tolerances: Any, allowed: Any) -> Any:
    """Returns that end farther from a surface than their tolerance; stops counting beyond `allowed`."""
    _, rows, columns = distances.shape
    flat = distances.reshape(-1)
    x_last, y_last = np.float32(columns - 1), np.float32(rows - 1)
    x0, y0, zero = np.float32(x), np.float32(y), np.float32(0.0)
    missed = 0
    for j in range(turned.shape[0]):
        column = np.int32(min(max(x0 + turned[j, 0], zero), x_last))
        row = np.int32(min(max(y0 + turned[j, 1], zero), y_last))
        # unsigned: Numba then needs no test for indices from the end
        if flat[np.uint32((fields[j] * rows + row) * columns + column)] > tolerances[j]:
            missed += 1
            if missed > allowed:
                break
    return missed


@njit(cache=True, nogil=True)
def _keep(leaves: Any, held: Any, missed: Any, x: Any, y: Any, yaw: Any) -> Any:
    """Inserts a leaf by its misses, fewest first, dropping the last when full; the new number held."""
    if held == LEAVES and missed >= leaves[held - 1, 0]:
        return held
    at = min(held, LEAVES - 1)
    while at > 0 and leaves[at - 1, 0] > missed:
        leaves[at] = leaves[at - 1]
        at -= 1
    leaves[at, 0], leaves[at, 1], leaves[at, 2], leaves[at, 3] = missed, x, y, yaw
    return min(held + 1, LEAVES)


@njit(cache=True, nogil=True)
def _turned(beams: Any, returned: Any, turns: Any, cell: Any) -> Any:
    out = np.empty((turns, returned.shape[0], 2), dtype=np.float32)
    for t in range(turns):
        _turn(beams, returned, (t + 0.5) * 2 * math.pi / turns, cell, out[t])
    return out


@njit(cache=True, nogil=True)
def _turn(beams: Any, returned: Any, yaw: Any, cell: Any, out: Any) -> None:
    """Writes the returns (R, 2) in cells from a LiDAR at a heading."""
    c, s = math.cos(yaw) / cell, math.sin(yaw) / cell
    for j in range(returned.shape[0]):
        k = returned[j]
        out[j, 0] = beams.ranges[k] * (c * beams.cosines[k] - s * beams.sines[k])
        out[j, 1] = beams.ranges[k] * (s * beams.cosines[k] + c * beams.sines[k])


@njit(cache=True, nogil=True)
def free_spans(free: Any) -> Any:
    """(n, 2) row and first column of stretches of LANES blocks with free floor in them."""
    spans = []
    for row in range(free.shape[0]):
        column = 0
        while column < free.shape[1]:
            if free[row, column]:
                spans.append((row, column))
                column += LANES
            else:
                column += 1
    out = np.empty((len(spans), 2), dtype=np.int64)
    for i, span in enumerate(spans):
        out[i, 0], out[i, 1] = span
    return out
