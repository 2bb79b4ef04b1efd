"""Uncertainty of a calibration -> within how many pixels 95 % of the LiDAR points at a range land."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wallkit.calib.covariance import quantiles
from wallkit.calib.rigid import skew
from wallkit.core.camera import Camera
from wallkit.core.types import Float64Array

RANGES_M = (0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0, 10.0, 15.0)
_COLUMNS = 9


def pixel_error_95(
    camera: Camera,
    T_camera_lidar: Float64Array,
    covariance: Float64Array,
    *,
    degrees: float = np.inf,
    camera_covariance: Float64Array | None = None,
    ranges_m: Sequence[float] = RANGES_M,
    is_planar: bool = True,
) -> Float64Array:
    """(R, 2) range [m] and error [px] of the worst place in the image, at 95 %.

    Var(u) = P [-[R p]x, I] C [..]' P' + Q C_K Q' with P = d pi / d p_C and Q = d pi / d K, D, at points of the scan plane
    (of the whole image for a 3-D LiDAR). The error of a place is its larger axis times the quantile of a circle for two
    equal axes, of a line for one: it covers 95 % or more.

    Args:
        covariance: (6, 6) of T_camera_lidar. degrees: of freedom it was estimated with.
    """
    stretch = float(quantiles(np.array([degrees]))[0]) / 1.959963984540054
    table = []
    for range_m in ranges_m:
        points = _seen_points(camera, T_camera_lidar, range_m, is_planar=is_planar)
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


def _seen_points(camera: Camera, T: Float64Array, range_m: float, *, is_planar: bool) -> Float64Array:
    """Points of the camera frame at a range from the LiDAR that fall into the image."""
    if is_planar:
        azimuth = np.radians(np.arange(-180.0, 180.0, 2.0))
        beams = np.column_stack([np.cos(azimuth), np.sin(azimuth), np.zeros_like(azimuth)])
        points = range_m * beams @ T[:3, :3].T + T[:3, 3]
    else:
        u, v = np.meshgrid(np.linspace(0, camera.width - 1, _COLUMNS), np.linspace(0, camera.height - 1, _COLUMNS))
        rays = camera.unproject(np.column_stack([u.ravel(), v.ravel()]))
        along = rays @ T[:3, 3]
        reach = along + np.sqrt(np.maximum(along**2 - T[:3, 3] @ T[:3, 3] + range_m**2, 0))
        points = rays[np.isfinite(rays).all(axis=1)] * reach[np.isfinite(rays).all(axis=1), None]
    with np.errstate(invalid="ignore"):
        inside = camera.is_inside(camera.project(points))
    return np.asarray(points[inside])
