"""Lengths and places measured twice -> the scale, turn and shift between them by robust least squares, with sigmas."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from wallkit.core.types import Float64Array

_ROUNDS = 20
# Huber's limit in robust standard deviations
_HUBER = 1.5


@dataclass(frozen=True)
class Ratio:
    """value = a / b with its standard deviation, from `count` pairs of which a share counted less as outliers."""

    value: float
    sigma: float
    count: int
    outliers: float


@dataclass(frozen=True)
class Similarity:
    """p = scale R(yaw) q + shift.

    Attributes:
        scale_sigma, yaw_sigma, shift_sigma: standard deviations. rms: of the residuals that count fully.
    """

    scale: float
    yaw: float
    shift: Float64Array
    scale_sigma: float
    yaw_sigma: float
    shift_sigma: float
    rms: float
    count: int
    outliers: float

    def apply(self, q: Float64Array) -> Float64Array:
        """Places (K, 2) of the one frame in the other."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        return np.asarray(self.scale * q @ np.array([[c, s], [-s, c]]) + self.shift)


def robust_ratio(a: Float64Array, b: Float64Array) -> Ratio:
    """a / b by least squares through the origin of lengths (K,), outliers weighed down (Huber).

    Its sigma is the sandwich estimate: pairs are independent, and errors may grow with length in any way.
    """
    weights = np.ones(len(a))
    value = float(np.median(a / b))
    for _ in range(_ROUNDS):
        value = float((weights * a * b).sum() / (weights * b * b).sum())
        weights = _huber(a - value * b)
    residual = weights * (a - value * b) * b
    spread = math.sqrt(float((residual**2).sum()) * len(a) / max(len(a) - 1, 1))
    # Huber's influence no longer grows beyond his limit, so outliers hold nothing in place (Huber 1981, 7.6)
    return Ratio(value, spread / float((b * b)[weights >= 1].sum()), len(a), float((weights < 1).mean()))


def robust_similarity(
    p: Float64Array, q: Float64Array, *, scale: float | None = None, blocks: np.ndarray | None = None
) -> Similarity:
    """The similarity that takes places q (K, 2) to p (K, 2), linear in a = s cos, b = s sin; outliers weighed down (Huber).

    Args:
        scale: known already; None: estimated too.
        blocks: (K,) numbers of stretches whose errors go together, as those of odometry do; None: every pair for itself.
    """
    weights = np.ones(len(p))
    q = np.asarray(q, dtype=np.float64)
    x = np.zeros(4)
    for _ in range(_ROUNDS):
        middle_q, middle_p = (np.average(v, axis=0, weights=weights) for v in (q, p))
        dq, dp = q - middle_q, p - middle_p
        total = float((weights[:, None] * dq * dq).sum())
        a = float((weights[:, None] * dp * dq).sum()) / total
        b = float((weights * (dp[:, 1] * dq[:, 0] - dp[:, 0] * dq[:, 1])).sum()) / total
        if scale is not None:
            a, b = a * scale / math.hypot(a, b), b * scale / math.hypot(a, b)
        x = np.array([a, b, *(middle_p - np.array([[a, -b], [b, a]]) @ middle_q)])
        residual = p - (q @ np.array([[a, b], [-b, a]]) + x[2:])
        weights = _huber(np.hypot(*residual.T), is_length=True)
    covariance = _sandwich(q, residual, weights, np.arange(len(p)) if blocks is None else blocks)
    s = math.hypot(x[0], x[1])
    by_scale, by_yaw = np.array([x[0], x[1], 0, 0]) / s, np.array([-x[1], x[0], 0, 0]) / s**2
    full = weights >= 1
    return Similarity(
        s,
        math.atan2(x[1], x[0]),
        x[2:],
        0.0 if scale is not None else math.sqrt(max(0.0, float(by_scale @ covariance @ by_scale))),
        math.sqrt(max(0.0, float(by_yaw @ covariance @ by_yaw))),
        math.sqrt(max(0.0, float(covariance[2, 2] + covariance[3, 3]))),
        float(np.sqrt((residual[full] ** 2).sum(axis=1).mean())),
        len(p),
        float((~full).mean()),
    )


def _sandwich(q: Float64Array, residual: Float64Array, weights: Float64Array, blocks: np.ndarray) -> Float64Array:
    """(4, 4) covariance of a, b and the shift, summed over blocks of residuals that go together."""
    J = np.zeros((len(q), 2, 4))
    J[:, 0] = np.column_stack([q[:, 0], -q[:, 1], np.ones(len(q)), np.zeros(len(q))])
    J[:, 1] = np.column_stack([q[:, 1], q[:, 0], np.zeros(len(q)), np.ones(len(q))])
    bread = np.linalg.inv(np.einsum("kic,k,kid->cd", J, weights, J))
    scores = np.einsum("kic,k,ki->kc", J, weights, residual)
    numbers = np.unique(blocks, return_inverse=True)[1]
    sums = np.zeros((numbers.max() + 1, 4))
    np.add.at(sums, numbers, scores)
    n = len(sums)
    return np.asarray(bread @ (sums.T @ sums) @ bread * n / max(n - 1, 1))


def _huber(residual: Float64Array, *, is_length: bool = False) -> Float64Array:
    """Weights (K,) that are 1 for what is usual and fall with 1 / residual beyond."""
    size = np.abs(residual)
    # of a Gaussian the median of |r| is 0.6745 sigma; of the length of a vector of two, 1.1774 sigma
    sigma = max(float(np.median(size)) / (1.1774 if is_length else 0.6745), 1e-12)
    return np.asarray(np.minimum(1.0, _HUBER * sigma / np.maximum(size, 1e-300)))
