"""Lens models: a point in front of a camera -> distorted normalised coordinates, and back, with Jacobians.

Normalised coordinates are pixels without the camera matrix: u = fx x' + cx. The three models are those ROS names; the
formulas are OpenCV's, whose functions are the oracles of the tests.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from wallkit.core.types import BoolArray, Float64Array

_TABLE = 512
_STEPS = 20
_WIDEST_RAD = np.deg2rad(89.5)


@dataclass(frozen=True, slots=True)
class Lens:
    """One distortion model as functions of points (N, 3) in the optical frame and coefficients D (n,).

    Attributes:
        name: as ROS writes it in `distortion_model`.
        coefficients: their names, in the order of D.
        distort: (points, D) -> (N, 2) distorted normalised coordinates; defined wherever the formula is.
        jacobians: (points, D) -> d distorted / d point (N, 2, 3) and d distorted / d D (N, 2, n).
        undistort: (distorted (N, 2), D) -> (N, 3) unit rays; NaN where no ray of the domain leads there.
        limit: D -> how far from the optical axis the radial map grows (see `reach`); inf when it always does.
        reach: points -> what `limit` bounds: the radius at unit depth, or the angle [rad] of `equidistant`; NaN behind.
    """

    name: str
    coefficients: tuple[str, ...]
    distort: Callable[[Float64Array, Float64Array], Float64Array]
    jacobians: Callable[[Float64Array, Float64Array], tuple[Float64Array, Float64Array]]
    undistort: Callable[[Float64Array, Float64Array], Float64Array]
    limit: Callable[[Float64Array], float]
    reach: Callable[[Float64Array], Float64Array]

    def sees(self, points: Float64Array, D: Float64Array) -> BoolArray:
        """(N,) whether each point is in front of the camera and where the radial map still grows."""
        with np.errstate(invalid="ignore"):
            return np.asarray(self.reach(points) < self.limit(D))


# --------------------------------------------------------------------- plumb_bob and rational_polynomial (Brown-Conrady)


def _distort_brown(points: Float64Array, D: Float64Array) -> Float64Array:
    """x' = x s + 2 p1 x y + p2 (q + 2 x^2), y' = y s + p1 (q + 2 y^2) + 2 p2 x y, with q = x^2 + y^2."""
    x, y = points[:, 0] / points[:, 2], points[:, 1] / points[:, 2]
    return _brown(x, y, D)


def _brown(x: Float64Array, y: Float64Array, D: Float64Array) -> Float64Array:
    q = x * x + y * y
    top, bottom = _radial(q, D)
    s, p1, p2 = top / bottom, D[2], D[3]
    return np.stack([x * s + 2 * p1 * x * y + p2 * (q + 2 * x * x), y * s + p1 * (q + 2 * y * y) + 2 * p2 * x * y], -1)


def _radial(q: Float64Array, D: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Numerator and denominator of s at q = r^2: 1 + k1 q + k2 q^2 + k3 q^3 over 1 + k4 q + k5 q^2 + k6 q^3."""
    top = 1 + q * (D[0] + q * (D[1] + q * D[4]))
    bottom = 1 + q * (D[5] + q * (D[6] + q * D[7])) if len(D) == 8 else np.ones_like(q)
    return top, bottom


def _radial_slope(q: Float64Array, D: Float64Array) -> Float64Array:
    """ds / dq."""
    top, bottom = _radial(q, D)
    top_slope = D[0] + q * (2 * D[1] + q * 3 * D[4])
    bottom_slope = D[5] + q * (2 * D[6] + q * 3 * D[7]) if len(D) == 8 else np.zeros_like(q)
    return (top_slope * bottom - top * bottom_slope) / bottom**2


def _brown_slopes(x: Float64Array, y: Float64Array, D: Float64Array) -> Float64Array:
    """d(x', y') / d(x, y), (N, 2, 2)."""
    q = x * x + y * y
    top, bottom = _radial(q, D)
    s, slope, p1, p2 = top / bottom, _radial_slope(q, D), D[2], D[3]
    cross = 2 * x * y * slope + 2 * p1 * x + 2 * p2 * y
    xx = s + 2 * x * x * slope + 2 * p1 * y + 6 * p2 * x
    yy = s + 2 * y * y * slope + 6 * p1 * y + 2 * p2 * x
    return np.stack([np.stack([xx, cross], -1), np.stack([cross, yy], -1)], -2)


def _brown_jacobians(points: Float64Array, D: Float64Array) -> tuple[Float64Array, Float64Array]:
    z = points[:, 2]
    x, y = points[:, 0] / z, points[:, 1] / z
    zero = np.zeros_like(x)
    perspective = np.stack([np.stack([1 / z, zero, -x / z], -1), np.stack([zero, 1 / z, -y / z], -1)], -2)
    q = x * x + y * y
    top, bottom = _radial(q, D)
    powers = np.stack([q, q * q, q**3], -1)
    gains = powers / bottom[:, None]
    if len(D) == 8:
        gains = np.concatenate([gains, -powers * (top / bottom**2)[:, None]], -1)
    along = gains[:, None, :] * np.stack([x, y], -1)[:, :, None]
    p1 = np.stack([2 * x * y, q + 2 * y * y], -1)
    p2 = np.stack([q + 2 * x * x, 2 * x * y], -1)
    columns = [along[..., 0], along[..., 1], p1, p2, *np.moveaxis(along[..., 2:], -1, 0)]
    return _brown_slopes(x, y, D) @ perspective, np.stack(columns, -1)


def _brown_limit(D: Float64Array) -> float:
    """Smallest radius where d(r s)/dr is 0 or s has a pole: roots of N M + 2 q (N' M - N M') and of M in q = r^2."""
    top = np.polynomial.Polynomial([1, D[0], D[1], D[4]])
    bottom = np.polynomial.Polynomial([1, D[5], D[6], D[7]] if len(D) == 8 else [1])
    growth = top * bottom + np.polynomial.Polynomial([0, 2]) * (top.deriv() * bottom - top * bottom.deriv())
    return float(np.sqrt(min(_smallest_root(growth), _smallest_root(bottom))))


def _smallest_root(polynomial: np.polynomial.Polynomial) -> float:
    """Smallest positive real root; inf without one."""
    roots = np.atleast_1d(polynomial.trim(tol=0).roots())
    real = roots[np.abs(roots.imag) < 1e-9 * np.maximum(1, np.abs(roots))].real
    return float(real[real > 0].min(initial=np.inf))


def _brown_reach(points: Float64Array) -> Float64Array:
    z = np.where(points[:, 2] > 0, points[:, 2], np.nan)
    return np.hypot(points[:, 0], points[:, 1]) / z


def _undistort_brown(distorted: Float64Array, D: Float64Array) -> Float64Array:
    """Newton on both coordinates, started where the radial part alone would put the point."""
    if not D.any():
        straight = np.concatenate([distorted, np.ones((len(distorted), 1))], -1)
        return np.asarray(straight / np.linalg.norm(straight, axis=-1, keepdims=True))
    limit = _brown_limit(D)
    radii = np.tan(np.linspace(0, min(np.arctan(limit), _WIDEST_RAD), _TABLE))
    top, bottom = _radial(radii[:-1] ** 2, D)
    reached = np.hypot(distorted[:, 0], distorted[:, 1])
    start = np.interp(reached, radii[:-1] * top / bottom, radii[:-1])
    xy = distorted * (start / np.where(reached > 0, reached, 1))[:, None]
    with np.errstate(all="ignore"):
        for _ in range(_STEPS):
            miss = _brown(xy[:, 0], xy[:, 1], D) - distorted
            slopes = _brown_slopes(xy[:, 0], xy[:, 1], D)
            determinant = slopes[:, 0, 0] * slopes[:, 1, 1] - slopes[:, 0, 1] * slopes[:, 1, 0]
            dx = (slopes[:, 1, 1] * miss[:, 0] - slopes[:, 0, 1] * miss[:, 1]) / determinant
            dy = (slopes[:, 0, 0] * miss[:, 1] - slopes[:, 1, 0] * miss[:, 0]) / determinant
            xy = xy - np.stack([dx, dy], -1)
        miss = _brown(xy[:, 0], xy[:, 1], D) - distorted
        found = (np.hypot(miss[:, 0], miss[:, 1]) < 1e-10 * (1 + reached)) & (np.hypot(xy[:, 0], xy[:, 1]) < limit)
    rays = np.concatenate([xy, np.ones((len(xy), 1))], -1)
    rays = rays / np.linalg.norm(rays, axis=-1, keepdims=True)
    return np.where(found[:, None], rays, np.nan)


# ---------------------------------------------------------------------------------------------- equidistant (fisheye)


def _distort_equidistant(points: Float64Array, D: Float64Array) -> Float64Array:
    """theta_d (X, Y) / rho with theta = atan2(rho, Z) (Kannala & Brandt, PAMI 2006, as in OpenCV's fisheye module)."""
    rho = np.hypot(points[:, 0], points[:, 1])
    theta = np.arctan2(rho, points[:, 2])
    on_axis = rho < 1e-12
    scale = np.where(on_axis, 1 / np.where(on_axis, points[:, 2], 1), _theta_d(theta, D) / np.where(on_axis, 1, rho))
    return points[:, :2] * scale[:, None]


def _theta_d(theta: Float64Array, D: Float64Array) -> Float64Array:
    t = theta * theta
    return theta * (1 + t * (D[0] + t * (D[1] + t * (D[2] + t * D[3]))))


def _theta_slope(theta: Float64Array, D: Float64Array) -> Float64Array:
    t = theta * theta
    return 1 + t * (3 * D[0] + t * (5 * D[1] + t * (7 * D[2] + t * 9 * D[3])))


def _equidistant_jacobians(points: Float64Array, D: Float64Array) -> tuple[Float64Array, Float64Array]:
    x, y, z = points.T
    rho2 = x * x + y * y
    rho = np.sqrt(rho2)
    theta = np.arctan2(rho, z)
    on_axis = rho < 1e-12
    safe = np.where(on_axis, 1, rho)
    gain = np.where(on_axis, 1 / np.where(on_axis, z, 1), _theta_d(theta, D) / safe)
    depth2 = rho2 + z * z
    slope = _theta_slope(theta, D)
    # gain = theta_d / rho; its derivative along the unit vector away from the axis, and along z
    outward = np.where(on_axis, 0, (slope * z / depth2 - gain) / safe)
    forward = np.where(on_axis, -1 / np.where(on_axis, z, 1) ** 2, -slope / depth2)
    ux, uy = np.where(on_axis, 0, x / safe), np.where(on_axis, 0, y / safe)
    by_point = np.empty((len(points), 2, 3))
    for row, along in enumerate((x, y)):
        by_point[:, row, 0] = along * outward * ux
        by_point[:, row, 1] = along * outward * uy
        by_point[:, row, 2] = along * forward
        by_point[:, row, row] += gain
    direction = np.stack([ux, uy], -1)
    powers = theta[:, None] ** np.array([3, 5, 7, 9])
    return by_point, direction[:, :, None] * powers[:, None, :]


def _equidistant_limit(D: Float64Array) -> float:
    """Smallest angle [rad] where d theta_d / d theta is 0, at most pi: the model sees behind the plane z = 0."""
    growth = np.polynomial.Polynomial([1, 3 * D[0], 5 * D[1], 7 * D[2], 9 * D[3]])
    return float(min(np.sqrt(_smallest_root(growth)), np.pi))


def _equidistant_reach(points: Float64Array) -> Float64Array:
    return np.arctan2(np.hypot(points[:, 0], points[:, 1]), points[:, 2])


def _undistort_equidistant(distorted: Float64Array, D: Float64Array) -> Float64Array:
    limit = _equidistant_limit(D)
    thetas = np.linspace(0, limit, _TABLE)
    reached = np.hypot(distorted[:, 0], distorted[:, 1])
    theta = np.interp(reached, _theta_d(thetas, D), thetas)
    with np.errstate(all="ignore"):
        for _ in range(_STEPS):
            theta = np.clip(theta - (_theta_d(theta, D) - reached) / _theta_slope(theta, D), 0, limit)
        found = (np.abs(_theta_d(theta, D) - reached) < 1e-10 * (1 + reached)) & (theta < limit)
    away = distorted / np.where(reached > 0, reached, 1)[:, None]
    rays = np.concatenate([away * np.sin(theta)[:, None], np.cos(theta)[:, None]], -1)
    return np.where(found[:, None], rays, np.nan)


CAMERAS: Mapping[str, Lens] = {
    "plumb_bob": Lens(
        "plumb_bob",
        ("k1", "k2", "p1", "p2", "k3"),
        _distort_brown,
        _brown_jacobians,
        _undistort_brown,
        _brown_limit,
        _brown_reach,
    ),
    "rational_polynomial": Lens(
        "rational_polynomial",
        ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"),
        _distort_brown,
        _brown_jacobians,
        _undistort_brown,
        _brown_limit,
        _brown_reach,
    ),
    "equidistant": Lens(
        "equidistant",
        ("k1", "k2", "k3", "k4"),
        _distort_equidistant,
        _equidistant_jacobians,
        _undistort_equidistant,
        _equidistant_limit,
        _equidistant_reach,
    ),
}
