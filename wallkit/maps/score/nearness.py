"""Segments and free floor -> byte fields that tell how near a surface is, laid out for a search over the whole map.

The fields only bound: their value never exceeds the true distance [cm], so what they rule out is out. What they let pass
is judged on the segments themselves.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numba import njit

from wallkit.core.types import BoolArray, Float64Array, Int64Array

if TYPE_CHECKING:
    from shapely import Geometry

CELL_M = 0.05
# side of a block of the coarsest lattice, in cells
BLOCK = 8
# headings of the coarsest lattice
TURNS = 36
# blocks of a row that are looked at together
LANES = 64
# farther than this is as good as anywhere [cm]
FAR_CM = 200
# of all labels together: as fine as 5 cm up to 100 m x 100 m
MOST_CELLS = 4_000_000


class Nearness(NamedTuple):
    """Distance fields and free floor over one grid.

    Attributes:
        x_m, y_m: corner of cell (0, 0). cell_m: side of a cell.
        distances_cm: (C, rows, columns) uint8, rounded down, at cell centres; FAR_CM where nothing is in reach. C is the
            number of labels, or 1 when all surfaces count alike.
        slabs: (C, BLOCK, BLOCK, rows / BLOCK + 2 pad, columns / BLOCK + 2 pad + LANES) uint8: the same values, sorted by
            the cell's place in its block, so that one beam seen from a row of blocks reads consecutive bytes.
        pad: blocks of border round a slab.
        nearest: (rows, columns) int32 segment nearest to a cell's centre, -1 where none is in reach.
        free: (rows, columns) a robot's centre may lie in the cell, or in one beside it.
        free_half: pooled over 2 x 2 cells. free_quarter: over 4 x 4. free_block: over BLOCK x BLOCK.
    """

    x_m: float
    y_m: float
    cell_m: float
    distances_cm: Any
    slabs: Any
    pad: int
    nearest: Any
    free: BoolArray
    free_half: BoolArray
    free_quarter: BoolArray
    free_block: BoolArray


def nearness_of(
    segments: Float64Array,
    labels: Int64Array,
    free: Geometry,
    *,
    label_count: int,
    longest_m: float,
    tolerance_m: float,
    most_cells: int,
) -> Nearness:
    """Fields over the free floor and the surfaces round it.

    Args:
        segments: (S, 4) [m]. labels: (S,) which field each belongs to; -1 for surfaces that beams do not see.
        free: where the robot's centre can be.
        longest_m: the longest return that will be looked up. tolerance_m: how far off, before nodes of the lattice widen it.
        most_cells: of all labels together; cells get larger than CELL_M beyond it.
    """
    lines = np.ascontiguousarray(segments, dtype=np.float64).reshape(-1, 4)
    shown = lines[labels >= 0].reshape(-1, 2)
    bounds = np.array(free.bounds).reshape(2, 2)
    # beyond a border of FAR_CM everything is at least as far as the fields can tell
    margin = FAR_CM / 100 + 0.1
    low = np.minimum(bounds[0], shown.min(axis=0, initial=np.inf)) - margin
    high = np.maximum(bounds[1], shown.max(axis=0, initial=-np.inf)) + margin
    cell = max(CELL_M, math.sqrt(float(np.prod(high - low)) * label_count / most_cells))
    columns, rows = (BLOCK * int(n) for n in np.ceil((high - low) / (cell * BLOCK)).astype(np.int64))
    distances = np.full((label_count, rows, columns), FAR_CM, dtype=np.uint8)
    nearest = np.full((rows, columns), -1, dtype=np.int32)
    # nobody asks beyond the tolerance of the largest node; Gauss-Newton has use for a little more
    reach = min(FAR_CM / 100, tolerance_m + longest_m * math.pi / TURNS + (BLOCK / 2 + 1) * cell * math.sqrt(2.0) + 0.1)
    _spread_distances(lines, labels, low[0], low[1], cell, reach, distances, nearest)
    pad = int(longest_m / (cell * BLOCK)) + 2
    floor = _widened(_free_cells(free, low, cell, (rows, columns)))
    return Nearness(
        float(low[0]),
        float(low[1]),
        cell,
        distances,
        _slabs_of(distances, pad),
        pad,
        nearest,
        floor,
        _pooled(floor, 2),
        _pooled(floor, 4),
        _pooled(floor, BLOCK),
    )


def all_alike(near: Nearness) -> Nearness:
    """The same with one field for the surfaces of all labels."""
    return near._replace(
        distances_cm=np.ascontiguousarray(near.distances_cm.min(axis=0, keepdims=True)),
        slabs=np.ascontiguousarray(near.slabs.min(axis=0, keepdims=True)),
    )


def one_apart(near: Nearness, label: int) -> Nearness:
    """The same with two fields: field 1 for the surfaces of one label, field 0 for all others."""

    def parted(fields: Any) -> Any:
        return np.ascontiguousarray(
            np.stack([np.delete(fields, label, axis=0).min(axis=0, initial=FAR_CM), fields[label]])
        )

    return near._replace(distances_cm=parted(near.distances_cm), slabs=parted(near.slabs))


def _free_cells(free: Geometry, low: Float64Array, cell: float, shape: tuple[int, int]) -> BoolArray:
    """(rows, columns) True where a cell's centre is on the free floor."""
    import shapely

    inside = np.zeros(shape, dtype=np.bool_)
    for piece in shapely.get_parts(free):
        x0, y0, x1, y1 = piece.bounds
        first, last = np.floor((np.array([[x0, y0], [x1, y1]]) - low) / cell).astype(np.int64)
        rows, columns = slice(first[1], last[1] + 1), slice(first[0], last[0] + 1)
        y = low[1] + (np.arange(rows.start, rows.stop) + 0.5) * cell
        x = low[0] + (np.arange(columns.start, columns.stop) + 0.5) * cell
        shapely.prepare(piece)
        inside[rows, columns] |= shapely.contains_xy(piece, *np.meshgrid(x, y))
    return inside


def _widened(cells: BoolArray) -> BoolArray:
    """The cells and the eight round each: a rival on the rim of the floor must not be missed for half a cell."""
    wide = np.pad(cells, 1)
    wide = wide[:-2] | wide[1:-1] | wide[2:]
    return np.ascontiguousarray(wide[:, :-2] | wide[:, 1:-1] | wide[:, 2:])


def _pooled(cells: BoolArray, side: int) -> BoolArray:
    """(rows / side, columns / side) True where any cell of a block is."""
    rows, columns = cells.shape
    return np.ascontiguousarray(cells.reshape(rows // side, side, columns // side, side).any(axis=(1, 3)))


def _slabs_of(distances: Any, pad: int) -> Any:
    count, rows, columns = distances.shape
    blocks = distances.reshape(count, rows // BLOCK, BLOCK, columns // BLOCK, BLOCK).transpose(0, 2, 4, 1, 3)
    border = ((0, 0), (0, 0), (0, 0), (pad, pad), (pad, pad + LANES))
    return np.ascontiguousarray(np.pad(blocks, border, constant_values=FAR_CM))


@njit(cache=True, nogil=True)
def _spread_distances(
    segments: Any, labels: Any, x0: Any, y0: Any, cell: Any, reach: Any, distances: Any, nearest: Any
) -> None:
    """Each segment writes its exact distance into the cells within reach of its box; the smallest stays."""
    _, rows, columns = distances.shape
    least = np.full((rows, columns), np.float32(reach), dtype=np.float32)
    for s in range(segments.shape[0]):
        label = labels[s]
        if label < 0:
            continue
        ax, ay = segments[s, 0] - x0, segments[s, 1] - y0
        bx, by = segments[s, 2] - x0 - ax, segments[s, 3] - y0 - ay
        square = bx * bx + by * by
        per = 1.0 / square if square > 0.0 else 0.0
        first_row = max(int((min(ay, ay + by) - reach) / cell), 0)
        last_row = min(int((max(ay, ay + by) + reach) / cell), rows - 1)
        first_column = max(int((min(ax, ax + bx) - reach) / cell), 0)
        last_column = min(int((max(ax, ax + bx) + reach) / cell), columns - 1)
        for row in range(first_row, last_row + 1):
            y = (row + 0.5) * cell - ay
            for column in range(first_column, last_column + 1):
                x = (column + 0.5) * cell - ax
                u = min(max((x * bx + y * by) * per, 0.0), 1.0)
                d = math.sqrt((x - u * bx) ** 2 + (y - u * by) ** 2)
                if d < reach:
                    centimetres = np.uint8(d * 100.0)
                    if centimetres < distances[label, row, column]:
                        distances[label, row, column] = centimetres
                    if d < least[row, column]:
                        least[row, column] = d
                        nearest[row, column] = s
