"""Distances and ranges -> the densities that sensor models mix: of returns from the map, and of all others."""

from __future__ import annotations

import numpy as np

from wallkit.core.types import Float32Array

SQRT_2PI = float(np.sqrt(2.0 * np.pi))


def hit_density(distances_m: Float32Array, sigma_m: float) -> Float32Array:
    """N(d; 0, sigma) [1/m] in float32, 0 where it is next to nothing: denormal numbers slow the kernels fourfold."""
    scaled = distances_m / np.float32(sigma_m)
    density = np.exp(np.float32(-0.5) * scaled * scaled) / np.float32(sigma_m * SQRT_2PI)
    return np.where(density > 1e-20, density, np.float32(0.0)).astype(np.float32)


def unknown_density(ranges_m: Float32Array, *, rate_per_m: float, range_max_m: float) -> Float32Array:
    """Density (K,) [1/m] of returns from what is not in the map: exponential, for it stands in front of the map.

    p_unknown(z) = lambda exp(-lambda z) / (1 - exp(-lambda z_max)), Akai 2023.
    """
    share = -np.expm1(-rate_per_m * range_max_m)
    return np.asarray(rate_per_m * np.exp(-rate_per_m * ranges_m) / share, dtype=np.float32)
