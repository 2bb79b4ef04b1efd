"""Poses and points in metres -> cells of a field, with the border that lets kernels do without bounds checks."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from wallkit.core.ceiling import CeilingMap
from wallkit.core.geometry import compose, invert
from wallkit.core.types import FieldSet, Float32Array, Float64Array, Points

BORDER = 1


def bordered(field: Float32Array) -> Float32Array:
    """The field (H + 2, W + 2) with its edge values repeated once all round, C-contiguous."""
    return np.ascontiguousarray(np.pad(field, BORDER, mode="edge"))


def placed(fields: FieldSet | CeilingMap, poses: Float64Array, *, border: int = BORDER) -> Float32Array:
    """Poses (N, 3) of frame map as the kernels take them: (4, N) float32 of cos and sin of the yaw, x and y in cells.

    A point with floor(x) = column lies in that column: the origin is the corner of cell (0, 0), not its centre
    (nav_msgs/OccupancyGrid).
    """
    x, y, yaw = invert(fields.origin)
    per_m = 1.0 / fields.resolution_m
    frame = np.array([np.cos(yaw) * per_m, np.sin(yaw) * per_m, x * per_m + border, y * per_m + border, yaw])
    out = np.empty((4, len(poses)), dtype=np.float32)
    _place_poses(poses, frame, out)
    return out


def cells_from_points(fields: FieldSet, points_m: Float64Array | Float32Array) -> Float32Array:
    """Points (K, 2 or 3) of frame base as (2, K) float32 lengths in cells, the layout of the kernels."""
    return np.ascontiguousarray((points_m[:, :2].T / fields.resolution_m).astype(np.float32))


def distances_at(fields: FieldSet, points_m: Float64Array) -> Float32Array:
    """Distance (K,) float32 [m] from points (K, 2) of frame map to the nearest surface; outside the map: infinity."""
    in_grid = compose(invert(fields.origin), np.column_stack([points_m, np.zeros(len(points_m))]))
    column, row = np.floor(in_grid[:, :2] / fields.resolution_m).astype(np.int64).T
    height, width = fields.shape
    inside = (column >= 0) & (row >= 0) & (column < width) & (row < height)
    found = np.full(len(points_m), np.inf, dtype=np.float32)
    found[inside] = fields.distances_m["all"][row[inside], column[inside]]
    return found


def spread_of(
    points: Points, count: int, weights: Float32Array | None = None, *, range_max_m: float = np.inf
) -> np.ndarray:
    """Indices of at most `count` returns spread evenly over the sweep, those of weight 0 or beyond the range left out."""
    usable = points.ranges_m <= range_max_m
    if weights is not None:
        usable &= weights > 0
    index = np.flatnonzero(usable)
    if len(index) <= count:
        return index
    return index[np.linspace(0, len(index) - 1, count).astype(np.int64)]


@njit(cache=True, nogil=True)
def _place_poses(poses: Any, frame: Any, out: Any) -> None:
    """out = cos and sin of the yaw, x and y of poses (N, 3) in another frame; frame (5,): scaled cos and sin, x, y, yaw."""
    for i in range(poses.shape[0]):
        heading = np.float32(poses[i, 2] + frame[4])
        out[0, i], out[1, i] = math.cos(heading), math.sin(heading)
        out[2, i] = frame[0] * poses[i, 0] - frame[1] * poses[i, 1] + frame[2]
        out[3, i] = frame[1] * poses[i, 0] + frame[0] * poses[i, 1] + frame[3]
