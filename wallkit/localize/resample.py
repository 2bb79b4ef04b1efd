"""Weights -> which particles live on, and how many.

A resampler draws n indices so that particle i is expected n * w_i times (all but the wheel, see there).
"""

from __future__ import annotations

from collections.abc import Callable
from statistics import NormalDist
from typing import Any

import numpy as np
from numba import njit

from wallkit.core.types import Float64Array, Int64Array

Resampler = Callable[[np.random.Generator, Float64Array, int], Int64Array]


def systematic(rng: np.random.Generator, weights: Float64Array, n: int) -> Int64Array:
    """One random offset and n equal steps round the ring (Carpenter, Clifford & Fearnhead 1999): the least variance."""
    return _at(weights, (rng.random() + np.arange(n)) / n)


def stratified(rng: np.random.Generator, weights: Float64Array, n: int) -> Int64Array:
    """One random draw in each of n equal strata (Kitagawa 1996)."""
    return _at(weights, (rng.random(n) + np.arange(n)) / n)


def multinomial(rng: np.random.Generator, weights: Float64Array, n: int) -> Int64Array:
    """n independent draws (Gordon, Salmond & Smith 1993)."""
    return _at(weights, np.sort(rng.random(n)))


def residual(rng: np.random.Generator, weights: Float64Array, n: int) -> Int64Array:
    """floor(n w_i) sure copies of each particle, the rest drawn from what is left over (Liu & Chen 1998)."""
    scaled = n * weights
    copies = np.floor(scaled).astype(np.int64)
    kept = np.repeat(np.arange(len(weights)), copies)
    missing = n - len(kept)
    if missing == 0:
        return kept
    left = scaled - copies
    return np.concatenate([kept, multinomial(rng, left / left.sum(), missing)])


def wheel(rng: np.random.Generator, weights: Float64Array, n: int) -> Int64Array:
    """The wheel of the ceiling localizer: from a random particle walk beta = 2 max(w) U(0, 1) round the ring of weights.

    Biased: a walk starts at a particle, not at a point of the ring, so a particle is drawn in proportion to its weight times
    the number of particles within 2 max(w) before it; stretches of light particles send out more walks than they should.
    `tests/localize/test_resample.py` measures it: one draw in ten goes to another particle than it should.
    """
    starts = rng.integers(0, len(weights), n)
    betas = 2.0 * weights.max() * rng.random(n)
    return _walk(weights, starts, betas)


def roughened(rng: np.random.Generator, poses: Float64Array, sd_m: float, sd_rad: float) -> Float64Array:
    """Poses (N, 3) with Gaussian noise, so that copies of one particle differ (Gordon, Salmond & Smith 1993)."""
    return poses + rng.standard_normal(poses.shape) * np.array([sd_m, sd_m, sd_rad])


def kld_size(rng: np.random.Generator, particles: Float64Array, weights: Float64Array, settings: Any) -> int:
    """How many particles keep the Kullback-Leibler distance to the true posterior below an error (Fox 2003).

    Draws particles one after the other and stops when their number exceeds the bound for the bins filled so far.

    Args:
        particles: (N, 3) poses. weights: (N,) normalised.
        settings: kld_error, kld_quantile, kld_bin_m, kld_bin_rad, particles_min, particles_max.

    Returns:
        A count in [particles_min, particles_max].
    """
    drawn = particles[multinomial(rng, weights, settings.particles_max)[rng.permutation(settings.particles_max)]]
    size = np.array([settings.kld_bin_m, settings.kld_bin_m, settings.kld_bin_rad])
    bins = np.floor(drawn / size).astype(np.int64)
    _, first = np.unique(bins, axis=0, return_index=True)
    is_new = np.zeros(len(drawn), dtype=np.int64)
    is_new[first] = 1
    filled = np.cumsum(is_new)
    enough = np.arange(1, len(drawn) + 1) >= kld_bound(filled, settings.kld_error, settings.kld_quantile)
    enough[: settings.particles_min - 1] = False
    return int(np.argmax(enough)) + 1 if enough.any() else settings.particles_max


def kld_bound(bins: Any, error: float, quantile: float) -> Float64Array:
    """Particles needed for k filled bins (Fox 2003, eq. 7, by Wilson-Hilferty); k = 1 needs 1."""
    k = np.maximum(np.asarray(bins, dtype=np.float64), 2.0)
    a = 2.0 / (9.0 * (k - 1.0))
    needed = (k - 1.0) / (2.0 * error) * (1.0 - a + np.sqrt(a) * NormalDist().inv_cdf(quantile)) ** 3
    return np.where(np.asarray(bins) < 2, 1.0, needed)


def _at(weights: Float64Array, points: Float64Array) -> Int64Array:
    """Indices of the particles that own the given points of [0, 1) on the ring of weights."""
    edges = np.cumsum(weights)
    # rounding can leave the last edge just below 1 (or the sum off by an ulp)
    return np.minimum(np.searchsorted(edges, points * edges[-1], side="right"), len(weights) - 1)


@njit(cache=True)
def _walk(weights: Any, starts: Any, betas: Any) -> Any:
    chosen = np.empty(len(starts), np.int64)
    for j in range(len(starts)):
        i, beta = starts[j], betas[j]
        while weights[i] < beta:
            beta -= weights[i]
            i = i + 1 if i + 1 < len(weights) else 0
        chosen[j] = i
    return chosen


RESAMPLERS: dict[str, Resampler] = {
    "systematic": systematic,
    "stratified": stratified,
    "multinomial": multinomial,
    "residual": residual,
    "wheel": wheel,
}
