"""Waypoints -> where a differential-drive robot truly is, and what its odometry claims."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from wallkit.core.geometry import compose, relative, wrap_angle
from wallkit.core.types import Float64Array

SPEED_M_S = 0.6
TURN_RAD_S = 0.9


@dataclass(frozen=True)
class OdometryNoise:
    """How odometry errs between two steps: the alphas of Probabilistic Robotics (2005), table 5.6.

    The variances hold per step, so noise that is meant for another step length must be scaled to it.
    """

    alpha1: float = 0.02
    alpha2: float = 0.01
    alpha3: float = 0.01
    alpha4: float = 0.005


def follow(waypoints: list[tuple[float, float]], rate_hz: float) -> Float64Array:
    """Poses (T, 3) of a robot that turns towards each waypoint and drives there, sampled at a rate."""
    points = np.asarray(waypoints, dtype=np.float64)
    pieces: list[Float64Array] = []
    heading = float(np.arctan2(*(points[1] - points[0])[::-1]))
    for start, end in pairwise(points):
        wanted = float(np.arctan2(*(end - start)[::-1]))
        turn = float(wrap_angle(wanted - heading))
        for angle in heading + np.linspace(0, turn, max(1, int(abs(turn) / TURN_RAD_S * rate_hz)), endpoint=False):
            pieces.append(np.array([*start, angle]))
        length = float(np.hypot(*(end - start)))
        steps = max(1, int(length / SPEED_M_S * rate_hz))
        for share in np.linspace(0, 1, steps, endpoint=False):
            pieces.append(np.array([*(start + share * (end - start)), wanted]))
        heading = wanted
    poses = np.stack([*pieces, np.array([*points[-1], heading])])
    poses[:, 2] = wrap_angle(poses[:, 2])
    return poses


def odometry_from(rng: np.random.Generator, poses: Float64Array, noise: OdometryNoise) -> Float64Array:
    """What odometry claims (T, 3) for true poses (T, 3): every step with noise of its own, starting at the origin."""
    claimed = [np.zeros(3)]
    for before, after in pairwise(poses):
        claimed.append(compose(claimed[-1], _disturbed(rng, relative(before, after), noise)))
    return np.stack(claimed)


def _disturbed(rng: np.random.Generator, step: Float64Array, noise: OdometryNoise) -> Float64Array:
    trans = float(np.hypot(step[0], step[1]))
    rot1 = float(np.arctan2(step[1], step[0])) if trans > 1e-6 else 0.0
    rot2 = float(wrap_angle(step[2] - rot1))
    t1, t2 = min(abs(rot1), np.pi - abs(rot1)), min(abs(rot2), np.pi - abs(rot2))
    n = rng.standard_normal(3)
    rot1 += n[0] * np.sqrt(noise.alpha1 * t1**2 + noise.alpha2 * trans**2)
    trans += n[1] * np.sqrt(noise.alpha3 * trans**2 + noise.alpha4 * (t1**2 + t2**2))
    rot2 += n[2] * np.sqrt(noise.alpha1 * t2**2 + noise.alpha2 * trans**2)
    return np.array([trans * np.cos(rot1), trans * np.sin(rot1), rot1 + rot2])
