"""Particles -> hypotheses, and one answer with its covariance."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numba import njit

from wallkit.core.geometry import wrap_angle
from wallkit.core.types import BoolArray, Float64Array, Mode

# particles nearer than this to a cluster's centre belong to it; two such modes are different places for a robot
CLUSTER_RADIUS_M = 1.0
CLUSTER_RADIUS_RAD = math.radians(30.0)
# a handful of particles of negligible weight is noise, not a hypothesis
SMALLEST_SHARE = 0.01
MODES_MAX = 12

Estimator = Callable[[Float64Array, Float64Array, tuple[Mode, ...]], tuple[Float64Array, Float64Array]]


def find_modes(poses: Float64Array, weights: Float64Array) -> tuple[Mode, ...]:
    """Clusters of the belief, heaviest first.

    Takes the heaviest bin of half a cluster's radius, moves to the mean of what lies around it, and cuts that out; again
    until less than SMALLEST_SHARE of the weight is left or MODES_MAX are found. When no place holds that much, everything is
    one wide mode.

    Args:
        poses: (N, 3). weights: (N,) summing to 1.
    """
    modes: list[Mode] = []
    left = np.ones(len(poses), dtype=np.bool_)
    while len(modes) < MODES_MAX:
        seed = _particle_in_heaviest_bin(poses, weights, left)
        centre = poses[seed]
        for _ in range(3):
            before = centre
            weight, centre, covariance = _moments_around(poses, weights, left, centre)
            if np.hypot(*(centre - before)[:2]) < 0.05 * CLUSTER_RADIUS_M:
                break
        if weight <= 0.0:
            # the mean of a ring-shaped cloud can lie outside it
            weight, centre, covariance = _moments_around(poses, weights, left, poses[seed])
        _cut_out(poses, left, centre)
        left[seed] = False
        if weight > SMALLEST_SHARE:
            modes.append(Mode(centre, covariance, weight))
        if weights[left].sum() <= SMALLEST_SHARE:
            break
    if not modes:
        modes.append(Mode(*weighted_moments(poses, weights), 1.0))
    return tuple(sorted(modes, key=lambda mode: -mode.weight))


def weighted_moments(poses: Float64Array, weights: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Mean pose (3,), headings averaged as unit vectors, and covariance (3, 3) in (m, m, rad) about it."""
    share = weights / weights.sum()
    heading = np.arctan2(share @ np.sin(poses[:, 2]), share @ np.cos(poses[:, 2]))
    mean = np.array([share @ poses[:, 0], share @ poses[:, 1], heading])
    return mean, _covariance(poses, share, mean)


def near_pose(poses: Float64Array, centre: Float64Array) -> BoolArray:
    """Which poses (N,) lie within a cluster's radius of a centre (3,)."""
    off = poses - centre
    turned = np.abs(wrap_angle(off[:, 2]))
    return np.asarray((off[:, 0] ** 2 + off[:, 1] ** 2 < CLUSTER_RADIUS_M**2) & (turned < CLUSTER_RADIUS_RAD))


def best_cluster(
    poses: Float64Array, weights: Float64Array, modes: tuple[Mode, ...]
) -> tuple[Float64Array, Float64Array]:
    """Mean and covariance of the heaviest cluster."""
    return modes[0].pose, modes[0].covariance


def mean_of_all(
    poses: Float64Array, weights: Float64Array, modes: tuple[Mode, ...]
) -> tuple[Float64Array, Float64Array]:
    """Mean and covariance of all particles, as the ceiling localizer reports it: between two modes it is nowhere."""
    return weighted_moments(poses, weights)


def best_particle(
    poses: Float64Array, weights: Float64Array, modes: tuple[Mode, ...]
) -> tuple[Float64Array, Float64Array]:
    """The heaviest particle, with the covariance of the particles around it."""
    best = poses[np.argmax(weights)]
    near = near_pose(poses, best)
    share = weights[near] / weights[near].sum()
    return best.copy(), _covariance(poses[near], share, best)


def _covariance(poses: Float64Array, share: Float64Array, mean: Float64Array) -> Float64Array:
    off = poses - mean
    off[:, 2] = wrap_angle(off[:, 2])
    return np.asarray((off * share[:, None]).T @ off)


@njit(cache=True, nogil=True)
def _particle_in_heaviest_bin(poses: Any, weights: Any, left: Any) -> int:
    """Index of a particle in the bin that holds the most weight: an open-addressing hash table, exact keys."""
    size = 4
    while size < 2 * len(poses):
        size *= 2
    keys = np.full((size, 3), np.iinfo(np.int64).min)
    sums = np.zeros(size)
    owner = np.zeros(size, np.int64)
    best = -1
    for i in range(len(poses)):
        if not left[i]:
            continue
        a = int(math.floor(poses[i, 0] / (CLUSTER_RADIUS_M / 2)))
        b = int(math.floor(poses[i, 1] / (CLUSTER_RADIUS_M / 2)))
        c = int(math.floor(poses[i, 2] / CLUSTER_RADIUS_RAD))
        slot = (a * 73856093 ^ b * 19349663 ^ c * 83492791) & (size - 1)
        while sums[slot] != 0.0 and (keys[slot, 0] != a or keys[slot, 1] != b or keys[slot, 2] != c):
            slot = (slot + 1) & (size - 1)
        if sums[slot] == 0.0:
            keys[slot, 0], keys[slot, 1], keys[slot, 2] = a, b, c
            owner[slot] = i
        # a weight that underflowed to 0 must still claim its slot
        sums[slot] += weights[i] + 1e-300
        if best < 0 or sums[slot] > sums[best]:
            best = slot
    return owner[best]


@njit(cache=True, nogil=True)
def _moments_around(poses: Any, weights: Any, left: Any, centre: Any) -> Any:
    """Weight, mean (3,) and covariance (3, 3) of the particles left within a cluster's radius of a centre."""
    total = 0.0
    first = np.zeros(3)
    second = np.zeros((3, 3))
    d = np.zeros(3)
    for i in range(len(poses)):
        if left[i]:
            d[0], d[1] = poses[i, 0] - centre[0], poses[i, 1] - centre[1]
            d[2] = poses[i, 2] - centre[2]
            d[2] -= 2 * math.pi * np.round(d[2] / (2 * math.pi))
            if d[0] * d[0] + d[1] * d[1] < CLUSTER_RADIUS_M**2 and abs(d[2]) < CLUSTER_RADIUS_RAD:
                total += weights[i]
                for j in range(3):
                    first[j] += weights[i] * d[j]
                    for k in range(3):
                        second[j, k] += weights[i] * d[j] * d[k]
    if total <= 0.0:
        return 0.0, centre.copy(), np.zeros((3, 3))
    first /= total
    mean = centre + first
    mean[2] -= 2 * math.pi * np.round(mean[2] / (2 * math.pi))
    return total, mean, second / total - np.outer(first, first)


@njit(cache=True, nogil=True)
def _cut_out(poses: Any, left: Any, centre: Any) -> None:
    for i in range(len(poses)):
        dx, dy, turn = poses[i, 0] - centre[0], poses[i, 1] - centre[1], poses[i, 2] - centre[2]
        turn -= 2 * math.pi * np.round(turn / (2 * math.pi))
        if dx * dx + dy * dy < CLUSTER_RADIUS_M**2 and abs(turn) < CLUSTER_RADIUS_RAD:
            left[i] = False


ESTIMATORS: dict[str, Estimator] = {
    "best_cluster": best_cluster,
    "mean": mean_of_all,
    "best_particle": best_particle,
}
