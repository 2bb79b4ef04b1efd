"""Uncertainty of a calibration -> within how many pixels 95 % of the LiDAR points at a range land."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wallkit.calib.extrinsics.covariance import quantiles
from wallkit.calib.extrinsics.rigid import skew
from wallkit.core.camera import Camera
from wallkit.core.types import Float64Array

RANGES_M = (0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0, 10.0, 15.0)
_STEP_DEG, _ROWS = 1.0, 9


def pixel_error_95(
    camera: Camera,
    T_camera_lidar: Float64Array,
    covariance: Float64Array,
    *,
    degrees: float = np.inf,
    camera_covariance: Float64Array | None = None,
    ranges_m: Sequence[float] = RANGES_M,
    elevations: Float64Array | None = None,
) -> Float64Array:
    """(R, 2) range [m] and error [px] of the worst place in the image, at 95 %.

    Var(u) = P [-[R p]x, I] C [..]' P' + Q C_K Q' with P = d pi / d p_C and Q = d pi / d K, D, at points that beams can meet.
    The error of a place is its larger axis times the quantile of a circle for two
    equal axes, of a line for one: it covers 95 % or more.

    Args:
        covariance: (6, 6) of T_camera_lidar. degrees: of freedom it was estimated with.
        elevations: (2,) [rad] lowest and highest beam, 0 0 of a planar LiDAR; None: anything may be hit.
    """
    stretch = float(quantiles(np.array([degrees]))[0]) / 1.959963984540054
    table = []
    beams = _beams(elevations)
    for range_m in ranges_m:
        points = _seen_points(camera, T_camera_lidar, range_m * beams)
        if not len(points):
            continue
        by_point = camera.point_jacobian(points)
        arms = np.array([-skew(q) for q in points - T_camera_lidar[:3, 3]])
        by_motion = by_point @ np.concatenate([arms, np.tile(np.eye(3), (len(points), 1, 1))], axis=2)
        variance = by_motion @ covariance @ by_motion.transpose(0, 2, 1)
        if camera_covariance is not None:
            by_camera = camera.parameter_jacobian(points)
            variance = variance + by_camera @ camera_covariance @ by_camera.transpose(0, 2, 1)
        table.append((range_m, stretch * float(_radius_95(np.linalg.eigvalsh(variance)).max())))
    return np.array(table).reshape(-1, 2)


def _radius_95(axes: Float64Array) -> Float64Array:
    """(N,) radius that holds at least 95 % of a 2-D normal with variances (N, 2) ascending: between 1.96 and 2.45 sigma."""
    small, large = np.maximum(axes[:, 0], 0), np.maximum(axes[:, 1], 1e-300)
    return np.sqrt(large) * (1.959963984540054 + (2.447746830680816 - 1.959963984540054) * np.sqrt(small / large))


def _beams(elevations: Float64Array | None) -> Float64Array:
    """(B, 3) unit vectors in the LiDAR frame, all around."""
    low, high = (-np.pi / 2, np.pi / 2) if elevations is None else elevations
    rows = max(_ROWS, int(np.degrees(high - low) / (2 * _STEP_DEG))) if high > low else 1
    azimuth, elevation = np.meshgrid(np.radians(np.arange(-180.0, 180.0, _STEP_DEG)), np.linspace(low, high, rows))
    flat = np.cos(elevation)
    return np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)], axis=-1).reshape(-1, 3)


def _seen_points(camera: Camera, T: Float64Array, points: Float64Array) -> Float64Array:
    """Points (K, 3) of the LiDAR in the camera frame, those that fall into the image."""
    seen = points @ T[:3, :3].T + T[:3, 3]
    with np.errstate(invalid="ignore"):
        inside = camera.is_inside(camera.project(seen))
    return np.asarray(seen[inside])
