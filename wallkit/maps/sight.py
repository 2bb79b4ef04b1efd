"""Segments of a map's slice -> what a beam meets first, exactly: casting with the segments listed in a uniform grid.

A cast costs the cells it crosses, not the segments of the map. Distances come from the segments themselves, in float64;
the grid only says which ones to ask.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from wallkit.core.types import BoolArray, Float64Array, Int64Array

CELL_M = 0.5
# a beam through the joint of two segments meets one of them in spite of rounding
_JOINT = 1e-9
_MOST_CELLS = 4_000_000


class Sight(NamedTuple):
    """Segments and the grid that lists them; made by `index_segments`, read by the kernels.

    Attributes:
        segments: (S, 4) float64 x0, y0, x1, y1 [m].
        starts: (rows * columns + 1,) where the list of each cell begins in `listed`, row by row.
        listed: indices of the segments that pass through each cell.
        x_m, y_m: corner of cell (0, 0). cell_m: side of a cell.
    """

    segments: Float64Array
    starts: Int64Array
    listed: Int64Array
    x_m: float
    y_m: float
    cell_m: float
    rows: int
    columns: int


@dataclass(frozen=True, slots=True, eq=False)
class Sighting:
    """What beams meet.

    Attributes:
        ranges_m: (N, K) float64, infinite where nothing is in range.
        segments: (N, K) int64 index of the segment met, -1 for none.
    """

    ranges_m: Float64Array
    segments: Int64Array


def index_segments(segments: Float64Array, *, seen: BoolArray | None = None, cell_m: float = CELL_M) -> Sight:
    """Segments (S, 4) [m] made ready for casting.

    Args:
        seen: (S,) False for segments that beams pass through, glass for example; indices stay those of `segments`.
        cell_m: side of a grid cell; larger maps get larger cells.
    """
    lines = np.ascontiguousarray(segments, dtype=np.float64).reshape(-1, 4)
    shown = np.ones(len(lines), dtype=np.bool_) if seen is None else np.ascontiguousarray(seen, dtype=np.bool_)
    if not shown.any():
        return Sight(lines, np.zeros(2, dtype=np.int64), np.zeros(0, dtype=np.int64), 0.0, 0.0, float(cell_m), 1, 1)
    points = lines[shown].reshape(-1, 2)
    low, high = points.min(axis=0) - 1e-6, points.max(axis=0) + 1e-6
    side = max(float(cell_m), math.sqrt(float(np.prod(high - low)) / _MOST_CELLS))
    columns, rows = (int(n) for n in np.floor((high - low) / side).astype(np.int64) + 1)
    starts, listed = _list_segments(lines, shown, low[0], low[1], side, rows, columns)
    return Sight(lines, starts, listed, float(low[0]), float(low[1]), side, rows, columns)


def cast_beams(sight: Sight, poses: Float64Array, bearings_rad: Float64Array, *, range_max_m: float) -> Sighting:
    """The first surface on every beam: poses (N, 3) in the map frame, bearings (K,) from the heading."""
    ranges = np.empty((len(poses), len(bearings_rad)))
    met = np.empty(ranges.shape, dtype=np.int64)
    turned = np.ascontiguousarray(poses, dtype=np.float64)
    _cast_all(sight, turned, np.ascontiguousarray(bearings_rad, dtype=np.float64), range_max_m, ranges, met)
    return Sighting(ranges, met)


# --------------------------------------------------------------------------------------------- kernels


@njit(cache=True, nogil=True)
def first_hit(sight: Any, x: Any, y: Any, dx: Any, dy: Any, reach: Any) -> Any:
    """Distance to the first segment on a ray and its index; (inf, -1) when there is none within `reach`.

    The grid is walked as by Amanatides & Woo, "A Fast Voxel Traversal Algorithm" (1987). A ray along a segment does not
    meet it, only its neighbours.
    """
    x0, y0, side = sight.x_m, sight.y_m, sight.cell_m
    near, far = 0.0, reach
    for p, d, low, count in ((x, dx, x0, sight.columns), (y, dy, y0, sight.rows)):
        high = low + count * side
        if abs(d) < 1e-15:
            if p < low or p > high:
                return np.inf, -1
        else:
            a, b = (low - p) / d, (high - p) / d
            near, far = max(near, min(a, b)), min(far, max(a, b))
    if near > far:
        return np.inf, -1
    column = min(max(int((x + near * dx - x0) / side), 0), sight.columns - 1)
    row = min(max(int((y + near * dy - y0) / side), 0), sight.rows - 1)
    step_x, step_y = (1 if dx > 0 else -1), (1 if dy > 0 else -1)
    per_x = side / abs(dx) if abs(dx) >= 1e-15 else np.inf
    per_y = side / abs(dy) if abs(dy) >= 1e-15 else np.inf
    next_x = (x0 + (column + (dx > 0)) * side - x) / dx if abs(dx) >= 1e-15 else np.inf
    next_y = (y0 + (row + (dy > 0)) * side - y) / dy if abs(dy) >= 1e-15 else np.inf
    best, met = np.inf, -1
    while True:
        cell = row * sight.columns + column
        for i in range(sight.starts[cell], sight.starts[cell + 1]):
            s = sight.listed[i]
            t = _meet(sight.segments, s, x, y, dx, dy)
            if t < best:
                best, met = t, s
        leave = min(next_x, next_y)
        # a segment met beyond this cell may be hidden by one that only the next cells list
        if best <= leave or leave > far:
            break
        if next_x < next_y:
            column += step_x
            next_x += per_x
            if column < 0 or column >= sight.columns:
                break
        else:
            row += step_y
            next_y += per_y
            if row < 0 or row >= sight.rows:
                break
    if best > reach:
        return np.inf, -1
    return best, met


@njit(cache=True, nogil=True)
def distance_to(segments: Any, s: Any, x: Any, y: Any) -> Any:
    """Distance from a point to segment s [m]."""
    ax, ay = segments[s, 0], segments[s, 1]
    bx, by = segments[s, 2] - ax, segments[s, 3] - ay
    along = (x - ax) * bx + (y - ay) * by
    square = bx * bx + by * by
    u = min(max(along / square, 0.0), 1.0) if square > 0.0 else 0.0
    return math.hypot(x - ax - u * bx, y - ay - u * by)


@njit(cache=True, nogil=True)
def touches(sight: Any, labels: Any, label: Any, x: Any, y: Any, tolerance: Any) -> Any:
    """Whether a segment passes within `tolerance` of a point; with label >= 0 only one of that label counts."""
    side = sight.cell_m
    first_column = max(int(math.floor((x - tolerance - sight.x_m) / side)), 0)
    last_column = min(int(math.floor((x + tolerance - sight.x_m) / side)), sight.columns - 1)
    first_row = max(int(math.floor((y - tolerance - sight.y_m) / side)), 0)
    last_row = min(int(math.floor((y + tolerance - sight.y_m) / side)), sight.rows - 1)
    for row in range(first_row, last_row + 1):
        for column in range(first_column, last_column + 1):
            cell = row * sight.columns + column
            for i in range(sight.starts[cell], sight.starts[cell + 1]):
                s = sight.listed[i]
                fits = label < 0 or labels[s] == label
                if fits and distance_to(sight.segments, s, x, y) <= tolerance:
                    return True
    return False


@njit(cache=True, nogil=True)
def _meet(segments: Any, s: Any, x: Any, y: Any, dx: Any, dy: Any) -> Any:
    """Distance along a ray to segment s, infinite when it misses."""
    ax, ay = segments[s, 0] - x, segments[s, 1] - y
    bx, by = segments[s, 2] - segments[s, 0], segments[s, 3] - segments[s, 1]
    across = dx * by - dy * bx
    if abs(across) <= 1e-12 * (abs(bx) + abs(by)):
        return np.inf
    t = (ax * by - ay * bx) / across
    u = (ax * dy - ay * dx) / across
    if t < 0.0 or u < -_JOINT or u > 1.0 + _JOINT:
        return np.inf
    return t


@njit(cache=True, nogil=True)
def _cast_all(sight: Any, poses: Any, bearings: Any, reach: Any, ranges: Any, met: Any) -> None:
    for i in range(poses.shape[0]):
        for k in range(bearings.shape[0]):
            heading = poses[i, 2] + bearings[k]
            ranges[i, k], met[i, k] = first_hit(
                sight, poses[i, 0], poses[i, 1], math.cos(heading), math.sin(heading), reach
            )


@njit(cache=True, nogil=True)
def _list_segments(segments: Any, shown: Any, x0: Any, y0: Any, side: Any, rows: Any, columns: Any) -> Any:
    """(starts, listed) of a grid: counted in a first pass, written in a second."""
    starts = np.zeros(rows * columns + 1, dtype=np.int64)
    listed = np.zeros(0, dtype=np.int64)
    for writes in (False, True):
        for s in range(segments.shape[0]):
            if not shown[s]:
                continue
            ax, ay, bx, by = segments[s, 0] - x0, segments[s, 1] - y0, segments[s, 2] - x0, segments[s, 3] - y0
            first_row = max(int((min(ay, by) - 1e-6) / side), 0)
            last_row = min(int((max(ay, by) + 1e-6) / side), rows - 1)
            first_column = max(int((min(ax, bx) - 1e-6) / side), 0)
            last_column = min(int((max(ax, bx) + 1e-6) / side), columns - 1)
            nx, ny = by - ay, ax - bx
            reach = 0.5 * (side + 2e-6) * (abs(nx) + abs(ny))
            for row in range(first_row, last_row + 1):
                for column in range(first_column, last_column + 1):
                    # the box of the cell and the line of the segment overlap: separating axis
                    off = nx * ((column + 0.5) * side - ax) + ny * ((row + 0.5) * side - ay)
                    if abs(off) > reach:
                        continue
                    cell = row * columns + column
                    if writes:
                        listed[starts[cell]] = s
                        starts[cell] += 1
                    else:
                        starts[cell + 1] += 1
        if not writes:
            starts[:] = np.cumsum(starts)
            listed = np.empty(starts[-1], dtype=np.int64)
    starts[1:] = starts[:-1].copy()
    starts[0] = 0
    return starts, listed
