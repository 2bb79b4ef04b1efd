"""Who moves in a drawn world: people on their rounds, as the discs a LiDAR sees, and a robot whose odometry errs."""

from __future__ import annotations

import numpy as np

from wallkit.core.types import Float64Array
from wallkit.simulate.odometry import WheelOdometry, odometry_of
from wallkit.simulate.route import Route, driven

LEG_RADIUS_M = 0.07
LEG_APART_M = 0.11
STRIDE_M = 0.6
ROUTE = Route(speed_m_s=0.6)
# noise at every step, and wheels of the size they are believed to have
NOISE = WheelOdometry(0.02, 0.01, 0.01, 0.005, radius_error=0.0, difference_error=0.0, baseline_error=0.0)


def tour(corners: list[tuple[float, float]], rate_hz: float = 5.0) -> Float64Array:
    """Poses (T, 3) of a robot that drives from corner to corner, at a rate."""
    return driven(ROUTE, np.array(corners, dtype=np.float64), rate_hz)


def claimed(rng: np.random.Generator, poses: Float64Array, rate_hz: float = 5.0) -> Float64Array:
    """What noisy odometry says (T, 3) of poses (T, 3) at a rate."""
    return odometry_of(rng, NOISE, poses, rate_hz)


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
