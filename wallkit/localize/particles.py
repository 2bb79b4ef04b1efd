"""The belief as weighted poses, with the weights kept as logarithms and normalised in one place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wallkit.core.types import Float64Array


@dataclass(frozen=True, slots=True)
class Particles:
    """Weighted hypotheses of where the robot is.

    Attributes:
        poses: (N, 3) float64, T_map_base as x [m], y [m], yaw [rad].
        log_weights: (N,) float64, up to a constant.
    """

    poses: Float64Array
    log_weights: Float64Array

    def __len__(self) -> int:
        return len(self.poses)


def equally_weighted(poses: Float64Array) -> Particles:
    """Particles at the given poses, none better than another."""
    return Particles(poses, np.zeros(len(poses)))


def normalised(log_weights: Float64Array) -> Float64Array:
    """Weights (N,) that sum to 1. The largest becomes exp(0) first, so nothing underflows to 0 / 0."""
    weights = np.exp(log_weights - log_weights.max())
    return weights / weights.sum()


def effective_size(weights: Float64Array) -> float:
    """How many equally weighted particles these weights are worth: 1 / sum w^2 (Kong, Liu & Wong 1994)."""
    return float(1.0 / np.dot(weights, weights))
