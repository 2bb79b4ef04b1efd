"""Polygons over an image -> for most of its points the answer of a table: where no edge passes, all lie in the same polygon.

The image is cut into tiles. A tile that no edge touches has one answer, its neighbours that none touches have the same; only
points in the other tiles have to be asked for one by one. The answers are those of asking for every point.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wallkit.core.polygon import Polygons
from wallkit.core.types import Float64Array, Int64Array

Int32Array = NDArray[np.int32]
# an edge takes up little of a tile of this side [px], and the table of a VGA image stays in a core's own cache
_SIDE = 3
# edges count as this much wider [px], far more than coordinates are rounded by
_ROUNDING = 1e-6


@dataclass(frozen=True, eq=False)
class Tiles:
    """What each tile of an image knows; its first pixel's centre is at (0, 0), its corner at (-0.5, -0.5).

    Attributes:
        regions: (h, w) int32 place in `answers`, -1 where an edge passes.
        answers: (R,) the polygon that all of a region lies in, -1 for none.
    """

    regions: Int32Array
    answers: Int64Array

    def found(self, points: Float64Array, located: Callable[[Float64Array], Int64Array]) -> Int64Array:
        """(K,) the polygon that each point (K, 2) lies in; points beside the image are asked for too."""
        found = np.empty(len(points), dtype=np.int64)
        rest = np.empty(len(points), dtype=np.int64)
        count = _look_up(points, self.regions, self.answers, found, rest)
        if count:
            asked = rest[:count]
            found[asked] = located(points[asked])
        return found


def tiles_of(polygons: Polygons, shape: tuple[int, int], located: Callable[[Float64Array], Int64Array]) -> Tiles:
    """The tiles of an image (height, width).

    Args:
        located: the polygon that each of some points (K, 2) lies in, by any of the ways that core.polygon has.
    """
    size = tuple(-(-side // _SIDE) for side in shape)
    regions = np.zeros(size, dtype=np.int32)
    _mark(polygons.edges, regions)
    middles = np.empty((regions.size, 2))
    count = _join(regions, middles)
    return Tiles(regions, located(middles[:count]))


@njit(cache=True, nogil=True)
def _mark(edges: Any, regions: Any) -> None:
    """-1 in every tile that an edge touches."""
    rows, columns = regions.shape
    for e in range(edges.shape[1]):
        x0, y0, x1, y1 = edges[0, e] + 0.5, edges[1, e] + 0.5, edges[2, e] + 0.5, edges[3, e] + 0.5
        if y1 < y0:
            x0, y0, x1, y1 = x1, y1, x0, y0
        first, last = int(np.floor((y0 - _ROUNDING) / _SIDE)), int(np.floor((y1 + _ROUNDING) / _SIDE))
        slope = (x1 - x0) / (y1 - y0) if y1 > y0 else 0.0
        for row in range(max(first, 0), min(last, rows - 1) + 1):
            # the part of the edge that is level with the row; of a level edge all of it
            xa, xb = x0, x1
            if y1 > y0:
                top, bottom = max(row * _SIDE - _ROUNDING, y0), min((row + 1) * _SIDE + _ROUNDING, y1)
                xa, xb = x0 + (top - y0) * slope, x0 + (bottom - y0) * slope
                if last - first <= 1 and abs(slope) > 1e3:
                    xa, xb = x0, x1
            low, high = min(xa, xb) - _ROUNDING, max(xa, xb) + _ROUNDING
            for column in range(max(int(np.floor(low / _SIDE)), 0), min(int(np.floor(high / _SIDE)), columns - 1) + 1):
                regions[row, column] = -1


@njit(cache=True, nogil=True)
def _join(regions: Any, middles: Any) -> int:
    """Numbers of regions in the tiles that are 0, and the middle of each region's first tile; how many there are."""
    rows, columns = regions.shape
    count = 0
    for row in range(rows):
        for column in range(columns):
            if regions[row, column] < 0:
                continue
            if column > 0 and regions[row, column - 1] >= 0:
                regions[row, column] = regions[row, column - 1]
            elif row > 0 and regions[row - 1, column] >= 0:
                regions[row, column] = regions[row - 1, column]
            else:
                middles[count, 0] = (column + 0.5) * _SIDE - 0.5
                middles[count, 1] = (row + 0.5) * _SIDE - 0.5
                regions[row, column] = count
                count += 1
    return count


@njit(cache=True, nogil=True)
def _look_up(points: Any, regions: Any, answers: Any, found: Any, rest: Any) -> int:
    """found[k] = the answer of point k's tile, where it has one; the others' places in `rest`, and how many they are."""
    rows, columns = regions.shape
    count = 0
    for k in range(len(points)):
        x, y = (points[k, 0] + 0.5) / _SIDE, (points[k, 1] + 0.5) / _SIDE
        # NaN is in no tile
        if x >= 0 and y >= 0 and x < columns and y < rows:
            region = regions[int(y), int(x)]
            if region >= 0:
                found[k] = answers[region]
                continue
        rest[count] = k
        count += 1
    return count
