"""A scan and a pose -> which returns the map explains, which stand in front of it, and which went through a wall."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from wallkit.core.geometry import compose
from wallkit.core.grid import placed
from wallkit.core.types import FieldSet, Float64Array, Int8Array, Points

HIT, SHORT, LONG = 0, 1, 2


def classify_rays(
    fields: FieldSet, points: Points, pose: Float64Array, *, tolerance_m: float, tolerance_per_m: float
) -> Int8Array:
    """HIT, SHORT or LONG for every return (K,) seen from a pose (3,).

    HIT: it ends within tolerance_m of a mapped surface, or its range is the predicted one within
    tolerance_m + tolerance_per_m * range. SHORT: it ends before the predicted surface. LONG: it ends behind it.
    """
    away = points.xyz_m[:, :2] - points.origin_m.astype(np.float32)
    planar = np.hypot(away[:, 0], away[:, 1])
    directions = np.ascontiguousarray((away / np.maximum(planar, np.float32(1e-6))[:, None]).T)
    lidar = compose(pose, np.array([*points.origin_m, 0.0]))[None, :]
    per_m = np.float32(1.0 / fields.resolution_m)
    near, per_cell = np.float32(tolerance_m) * per_m, np.float32(tolerance_per_m)
    codes = np.empty(len(planar), dtype=np.int8)
    at = placed(fields, lidar, border=0)
    _classify_returns(at, directions, planar * per_m, fields.distances_m["all"], per_m, near, per_cell, codes)
    return codes


@njit(cache=True, nogil=True)
def cast_rays(placed: Any, bearings: Any, distances: Any, per_m: Any, reach: Any, out: Any) -> None:
    """out[i, k] = cells from LiDAR pose i along bearing k to the first surface, `reach` when there is none within it.

    Args:
        placed: (4, N) float32 as above, of the LiDAR. bearings: (2, K) float32, cos and sin in the LiDAR's heading.
        distances: (H, W) float32 [m] to the nearest surface cell's centre; 0 on a surface. per_m: cells per metre.
        reach: longest range, cells. out: (N, K) float32, written.
    """
    for i in range(placed.shape[1]):
        c, s, x0, y0 = placed[0, i], placed[1, i], placed[2, i], placed[3, i]
        for k in range(bearings.shape[1]):
            dx, dy = c * bearings[0, k] - s * bearings[1, k], s * bearings[0, k] + c * bearings[1, k]
            out[i, k] = _first_surface(x0, y0, dx, dy, distances, per_m, reach)


@njit(cache=True, nogil=True)
def _classify_returns(
    placed: Any, directions: Any, ranges: Any, distances: Any, per_m: Any, slack: Any, per_cell: Any, codes: Any
) -> None:
    """codes[k] = 0, 1 or 2 for a return that fits the map, ends in front of it, or lies behind it.

    A return fits if it ends within `slack` of a surface, or within slack + per_cell * range of where its ray meets one.

    Args:
        placed: (4, 1) float32 as above, of the LiDAR. directions: (2, K) float32 unit vectors in the LiDAR's heading.
        ranges: (K,) float32, in cells. distances: (H, W) float32 [m]. per_m: cells per metre. slack: in cells.
        codes: (K,) int8, written.
    """
    height, width = distances.shape
    c, s, x0, y0 = placed[0, 0], placed[1, 0], placed[2, 0], placed[3, 0]
    for k in range(ranges.shape[0]):
        dx, dy = c * directions[0, k] - s * directions[1, k], s * directions[0, k] + c * directions[1, k]
        x, y = x0 + ranges[k] * dx, y0 + ranges[k] * dy
        if (
            x >= np.float32(0.0)
            and y >= np.float32(0.0)
            and x < width
            and y < height
            and distances[int(y), int(x)] * per_m <= slack
        ):
            codes[k] = 0
            continue
        margin = slack + per_cell * ranges[k]
        reach = ranges[k] + margin
        expected = _first_surface(x0, y0, dx, dy, distances, per_m, reach)
        if expected >= reach:
            codes[k] = 1
        elif expected >= ranges[k] - margin:
            codes[k] = 0
        else:
            codes[k] = 2


@njit(inline="always")
def _first_surface(x0: Any, y0: Any, dx: Any, dy: Any, distances: Any, per_m: Any, reach: Any) -> Any:
    """Cells along a ray to the first surface, `reach` when there is none within it.

    Sphere tracing: the distance field tells how far a ray can go without hitting anything, so open space is crossed in a few
    steps. Beyond the grid nothing is known and the ray ends at `reach`.
    """
    height, width = distances.shape
    r = np.float32(0.0)
    while r < reach:
        x, y = x0 + r * dx, y0 + r * dy
        if x < np.float32(0.0) or y < np.float32(0.0) or x >= width or y >= height:
            return reach
        d = distances[int(y), int(x)] * per_m
        if d < np.float32(0.5):
            return r
        # a cell's value holds at its centre: up to 0.71 cells nearer at its corner, and a surface cell is as wide
        r += max(d - np.float32(1.42), np.float32(0.25))
    return reach
