"""Walkers on a plan -> the discs a LiDAR at shin height sees of them over time."""

from __future__ import annotations

import numpy as np

from wallkit.core.types import Float64Array

LEG_RADIUS_M = 0.07
LEG_APART_M = 0.11
STRIDE_M = 0.6


def walk(
    waypoints: list[tuple[float, float]], speed_m_s: float, times_s: Float64Array, start_m: float = 0.0
) -> Float64Array:
    """Poses (T, 3) of a walker who goes round the waypoints for ever, `start_m` along the way at time 0."""
    points = np.asarray([*waypoints, waypoints[0]], dtype=np.float64)
    lengths = np.hypot(*np.diff(points, axis=0).T)
    edges = np.concatenate([[0.0], np.cumsum(lengths)])
    at = (start_m + speed_m_s * times_s) % edges[-1]
    leg = np.clip(np.searchsorted(edges, at, side="right") - 1, 0, len(lengths) - 1)
    share = ((at - edges[leg]) / lengths[leg])[:, None]
    way = points[leg + 1] - points[leg]
    return np.column_stack([points[leg] + share * way, np.arctan2(way[:, 1], way[:, 0])])


def legs(walkers: Float64Array, walked_m: Float64Array) -> Float64Array:
    """Two discs (2 W, 3) for walkers (W, 3): shins that swing against each other as far as each has walked (W,)."""
    c, s = np.cos(walkers[:, 2]), np.sin(walkers[:, 2])
    swing = 0.5 * STRIDE_M * np.sin(2 * np.pi * walked_m / (2 * STRIDE_M)) * 0.5
    discs = []
    for side in (-1.0, 1.0):
        x = walkers[:, 0] + side * swing * c - side * LEG_APART_M * s
        y = walkers[:, 1] + side * swing * s + side * LEG_APART_M * c
        discs.append(np.column_stack([x, y, np.full(len(walkers), LEG_RADIUS_M)]))
    return np.concatenate(discs) if len(walkers) else np.zeros((0, 3))
