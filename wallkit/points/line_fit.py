"""A planar scan alone -> which returns lie on long straight lines, as walls do; legs, chairs and plants do not.

Split and merge (Nguyen, Gaechter, Martinelli, Tomatis & Siegwart 2007): neighbouring returns are split where they leave
their chord, and pieces on one line are merged, so that a wall seen between people's legs counts as a whole.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numba import njit

from wallkit.core.config import setting
from wallkit.core.types import Estimate, FieldSet, Float32Array, Int64Array, LabelledScan

if TYPE_CHECKING:
    from wallkit.points.filters import BoundFilter


@dataclass(frozen=True)
class LineFit:
    """Returns on straight lines that are long enough to be walls. No camera, no map, no pose."""

    tolerance_m: float = setting(0.03, "a return so far from a line is on it", low=0.001)
    tolerance_per_m: float = setting(0.005, "growth of that with range", low=0)
    gap_m: float = setting(0.15, "neighbouring returns farther apart are not on one piece", low=0.01)
    gap_per_m: float = setting(0.05, "growth of that with range", low=0)
    piece_m: float = setting(0.15, "a shorter piece is no line: a leg is about as wide", low=0.01)
    piece_points: int = setting(5, "a piece of fewer returns is no line", low=3)
    wall_m: float = setting(0.6, "pieces of one line make a wall if together they are as long", low=0.05)
    off_weight: float = setting(0.0, "weight of a return that is on no wall", low=0, high=1)

    def on(self, fields: FieldSet) -> BoundFilter:
        """See PointFilter."""
        return self

    def weigh(self, scan: LabelledScan, estimate: Estimate) -> Float32Array:
        """See BoundFilter."""
        return np.where(self.walls(scan) >= 0, np.float32(1.0), np.float32(self.off_weight)).astype(np.float32)

    def walls(self, scan: LabelledScan) -> Int64Array:
        """(K,) number of the wall that each return is on, -1 for none."""
        points = scan.points
        xy = np.ascontiguousarray(points.xyz_m[:, :2], dtype=np.float64)
        # in the order of the beams; of a cloud's slice that is the order of bearing
        order = np.argsort(points.beams, kind="stable")
        found = np.full(len(xy), -1)
        limits = np.array(
            [self.tolerance_m, self.tolerance_per_m, self.gap_m, self.gap_per_m, self.piece_m, self.wall_m]
        )
        ordered = np.full(len(xy), -1)
        _find_walls(xy[order], points.ranges_m[order].astype(np.float64), limits, self.piece_points, ordered)
        found[order] = ordered
        return found


@njit(cache=True, nogil=True)
def _find_walls(xy: Any, ranges: Any, limits: Any, fewest: int, found: Any) -> None:
    """found[k] = number of the wall of return k, -1 without one; see LineFit for the limits."""
    count = len(xy)
    tolerance, per_m, gap, gap_per_m, least, wall = limits
    begins, ends = np.empty(count + 1, np.int64), np.empty(count + 1, np.int64)
    pieces = 0
    stack = np.empty((count + 2, 2), np.int64)
    start = 0
    for k in range(1, count + 1):
        if k < count:
            apart = np.hypot(xy[k, 0] - xy[k - 1, 0], xy[k, 1] - xy[k - 1, 1])
            if apart <= gap + gap_per_m * min(ranges[k], ranges[k - 1]):
                continue
        # split the run of neighbours start ... k - 1 where it is farthest from its chord, until all of it is near
        stack[0, 0], stack[0, 1] = start, k - 1
        held = 1
        while held > 0:
            held -= 1
            a, b = stack[held, 0], stack[held, 1]
            if b - a + 1 < fewest:
                continue
            dx, dy = xy[b, 0] - xy[a, 0], xy[b, 1] - xy[a, 1]
            length = np.hypot(dx, dy)
            worst, at = 0.0, -1
            for m in range(a + 1, b):
                if length > 1e-9:
                    off = abs(dx * (xy[m, 1] - xy[a, 1]) - dy * (xy[m, 0] - xy[a, 0])) / length
                else:
                    off = np.hypot(xy[m, 0] - xy[a, 0], xy[m, 1] - xy[a, 1])
                excess = off - tolerance - per_m * ranges[m]
                if excess > worst:
                    worst, at = excess, m
            if at < 0:
                if length >= least:
                    begins[pieces], ends[pieces] = a, b
                    pieces += 1
            else:
                stack[held, 0], stack[held, 1] = a, at
                stack[held + 1, 0], stack[held + 1, 1] = at, b
                held += 2
        start = k
    lines = np.empty((pieces, 5))
    for p in range(pieces):
        _fit(xy, begins[p], ends[p], lines[p])
    # longest first: a short piece's direction is not sure enough to lead
    order = np.argsort(-lines[:, 4])
    owner = np.full(pieces, -1)
    for i in range(pieces):
        lead = order[i]
        if owner[lead] >= 0:
            continue
        total = lines[lead, 4]
        owner[lead] = lead
        for j in range(i + 1, pieces):
            p = order[j]
            if owner[p] < 0 and _on_line(xy, ranges, lines[lead], begins[p], ends[p], tolerance, per_m):
                owner[p] = lead
                total += lines[p, 4]
        if total < wall:
            for p in range(pieces):
                if owner[p] == lead:
                    owner[p] = -2 if p == lead else -1
    for p in range(pieces):
        if owner[p] >= 0:
            for k in range(begins[p], ends[p] + 1):
                found[k] = owner[p]


@njit(cache=True, nogil=True)
def _fit(xy: Any, a: int, b: int, line: Any) -> None:
    """line = mean point, unit normal and length of the returns a ... b: total least squares."""
    n = b - a + 1
    mx, my = 0.0, 0.0
    for k in range(a, b + 1):
        mx += xy[k, 0]
        my += xy[k, 1]
    mx, my = mx / n, my / n
    xx, xy_, yy = 0.0, 0.0, 0.0
    for k in range(a, b + 1):
        dx, dy = xy[k, 0] - mx, xy[k, 1] - my
        xx += dx * dx
        xy_ += dx * dy
        yy += dy * dy
    along = 0.5 * np.arctan2(2 * xy_, xx - yy)
    line[0], line[1], line[2], line[3] = mx, my, -np.sin(along), np.cos(along)
    line[4] = np.hypot(xy[b, 0] - xy[a, 0], xy[b, 1] - xy[a, 1])


@njit(cache=True, nogil=True)
def _on_line(xy: Any, ranges: Any, line: Any, a: int, b: int, tolerance: Any, per_m: Any) -> bool:
    """Whether the returns a ... b lie on a line: both ends within twice the tolerance, and the middle."""
    for k in (a, (a + b) // 2, b):
        off = abs((xy[k, 0] - line[0]) * line[2] + (xy[k, 1] - line[1]) * line[3])
        if off > 2 * (tolerance + per_m * ranges[k]):
            return False
    return True
