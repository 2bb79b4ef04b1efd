"""Points and a camera -> pixels in one compiled pass: what `Camera.project` says, for a filter that runs at every scan."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from wallkit.core.camera import Camera
from wallkit.core.types import BoolArray, Float32Array, Float64Array


def project_points(
    camera: Camera, T: Float64Array, points_m: Float64Array | Float32Array
) -> tuple[Float64Array, Float64Array, BoolArray]:
    """Pixels (K, 2), depths (K,) [m] and whether they are on the image, of points (K, 3) that T (4, 4) moves to the camera.

    NaN pixels where the camera cannot see a point at all, as `Camera.project`.
    """
    points = np.ascontiguousarray(points_m)
    pixels, depths = np.empty((len(points), 2)), np.empty(len(points))
    inside = np.empty(len(points), dtype=np.bool_)
    K, D = camera.compiled
    kernel = _equidistant if camera.model == "equidistant" else _brown
    kernel(points, np.ascontiguousarray(T[:3], dtype=np.float64), K, D, camera.limit, pixels, depths, inside)
    return pixels, depths, inside


@njit(cache=True, nogil=True)
def _brown(points: Any, T: Any, K: Any, D: Any, limit: Any, pixels: Any, depths: Any, inside: Any) -> None:
    """plumb_bob, whose k4 ... k6 are 0, and rational_polynomial; see lenses.py."""
    for k in range(len(points)):
        X, Y, Z = _moved(points, T, k)
        depths[k] = Z
        if not (Z > 0 and (limit * Z) ** 2 > X * X + Y * Y):
            pixels[k, 0] = pixels[k, 1] = math.nan
            inside[k] = False
            continue
        x, y = X / Z, Y / Z
        q = x * x + y * y
        s = (1 + q * (D[0] + q * (D[1] + q * D[4]))) / (1 + q * (D[5] + q * (D[6] + q * D[7])))
        _set(
            x * s + 2 * D[2] * x * y + D[3] * (q + 2 * x * x),
            y * s + D[2] * (q + 2 * y * y) + 2 * D[3] * x * y,
            K,
            k,
            pixels,
            inside,
        )


@njit(cache=True, nogil=True)
def _equidistant(points: Any, T: Any, K: Any, D: Any, limit: Any, pixels: Any, depths: Any, inside: Any) -> None:
    for k in range(len(points)):
        X, Y, Z = _moved(points, T, k)
        depths[k] = Z
        rho = math.hypot(X, Y)
        theta = math.atan2(rho, Z)
        if not theta < limit:
            pixels[k, 0] = pixels[k, 1] = math.nan
            inside[k] = False
            continue
        t = theta * theta
        bent = theta * (1 + t * (D[0] + t * (D[1] + t * (D[2] + t * D[3]))))
        scale = bent / rho if rho >= 1e-12 else 1 / Z
        _set(X * scale, Y * scale, K, k, pixels, inside)


@njit(inline="always")
def _moved(points: Any, T: Any, k: int) -> Any:
    a, b, c = points[k, 0], points[k, 1], points[k, 2]
    return (
        T[0, 0] * a + T[0, 1] * b + T[0, 2] * c + T[0, 3],
        T[1, 0] * a + T[1, 1] * b + T[1, 2] * c + T[1, 3],
        T[2, 0] * a + T[2, 1] * b + T[2, 2] * c + T[2, 3],
    )


@njit(inline="always")
def _set(x: Any, y: Any, K: Any, k: int, pixels: Any, inside: Any) -> None:
    u, v = K[0] * x + K[2], K[1] * y + K[3]
    pixels[k, 0], pixels[k, 1] = u, v
    inside[k] = u >= -0.5 and u < K[4] - 0.5 and v >= -0.5 and v < K[5] - 0.5
