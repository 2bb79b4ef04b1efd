"""Rigid transforms in the plane and in space: compose, invert, apply, interpolate.

Planar poses are (..., 3) arrays (x [m], y [m], yaw [rad]) and compose as T_ac = T_ab @ T_bc.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from wallkit.core.types import Float64Array, Int64Array


def wrap_angle(angles_rad: ArrayLike) -> Float64Array:
    """The same angles in [-pi, pi]."""
    angles = np.asarray(angles_rad, dtype=np.float64)
    # four times faster than a remainder, and this runs over every particle
    return np.asarray(angles - 2 * np.pi * np.round(angles / (2 * np.pi)))


def compose(ab: ArrayLike, bc: ArrayLike) -> Float64Array:
    """T_ac = T_ab @ T_bc for planar poses (..., 3), broadcasting; yaw is wrapped."""
    ab, bc = np.asarray(ab, dtype=np.float64), np.asarray(bc, dtype=np.float64)
    if ab.ndim == bc.ndim == 1:
        return _compose_two(*ab.tolist(), *bc.tolist())
    c, s = np.cos(ab[..., 2]), np.sin(ab[..., 2])
    x = ab[..., 0] + c * bc[..., 0] - s * bc[..., 1]
    y = ab[..., 1] + s * bc[..., 0] + c * bc[..., 1]
    return np.stack([x, y, wrap_angle(ab[..., 2] + bc[..., 2])], axis=-1)


def _compose_two(x: float, y: float, yaw: float, dx: float, dy: float, turn: float) -> Float64Array:
    """compose() of single poses, ten times faster without arrays; every frame of a log needs several."""
    c, s, heading = math.cos(yaw), math.sin(yaw), yaw + turn
    return np.array([x + c * dx - s * dy, y + s * dx + c * dy, heading - math.tau * round(heading / math.tau)])


def invert(ab: ArrayLike) -> Float64Array:
    """T_ba for a planar pose T_ab (..., 3)."""
    ab = np.asarray(ab, dtype=np.float64)
    if ab.ndim == 1:
        x, y, yaw = ab.tolist()
        return np.array([-math.cos(yaw) * x - math.sin(yaw) * y, math.sin(yaw) * x - math.cos(yaw) * y, -yaw])
    c, s = np.cos(ab[..., 2]), np.sin(ab[..., 2])
    x, y = ab[..., 0], ab[..., 1]
    return np.stack([-c * x - s * y, s * x - c * y, -ab[..., 2]], axis=-1)


def relative(a: ArrayLike, b: ArrayLike) -> Float64Array:
    """T_ab for two planar poses given in one frame: the motion that leads from a to b, seen from a."""
    return compose(invert(a), b)


def transform_points(ab: ArrayLike, points_b: ArrayLike) -> Float64Array:
    """Points (K, 2) of frame b in frame a, for one planar pose T_ab (3,)."""
    pose, points = np.asarray(ab, dtype=np.float64), np.asarray(points_b, dtype=np.float64)
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return points @ np.array([[c, s], [-s, c]]) + pose[:2]


def matrix_from_pose(pose: ArrayLike) -> Float64Array:
    """(4, 4) transform of a planar pose (3,), z = 0."""
    x, y, yaw = np.asarray(pose, dtype=np.float64)
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, -s, 0, x], [s, c, 0, y], [0, 0, 1, 0], [0, 0, 0, 1]], dtype=np.float64)


def pose_from_matrix(matrix: ArrayLike) -> Float64Array:
    """Planar pose (3,) of a (4, 4) transform: its x, y and the heading of its x axis in the plane."""
    m = np.asarray(matrix, dtype=np.float64)
    return np.array([m[0, 3], m[1, 3], np.arctan2(m[1, 0], m[0, 0])])


def matrix_from_quaternion(translation: ArrayLike, xyzw: ArrayLike) -> Float64Array:
    """(4, 4) transform of a translation (3,) [m] and a quaternion (x, y, z, w); it need not have unit length.

    Raises:
        ValueError: the quaternion is zero or not finite.
    """
    q = np.asarray(xyzw, dtype=np.float64)
    norm = float(np.linalg.norm(q))
    if not np.isfinite(norm) or norm < 1e-9:
        raise ValueError(f"not a rotation: quaternion {q.tolist()}")
    x, y, z, w = q / norm
    m = np.eye(4)
    m[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    m[:3, 3] = np.asarray(translation, dtype=np.float64)
    return m


def quaternions_from_matrices(matrices: ArrayLike) -> Float64Array:
    """(N, 4) x, y, z, w of the rotations in (N, 3, 3) or (N, 4, 4) matrices, w >= 0.

    Of the four ways to work a quaternion out the one with the largest term is taken, which never divides by little
    (Shepperd 1978).
    """
    m = np.asarray(matrices, dtype=np.float64)
    xx, yy, zz = m[:, 0, 0], m[:, 1, 1], m[:, 2, 2]
    x, y, z = m[:, 2, 1] - m[:, 1, 2], m[:, 0, 2] - m[:, 2, 0], m[:, 1, 0] - m[:, 0, 1]
    xy, xz, yz = m[:, 1, 0] + m[:, 0, 1], m[:, 2, 0] + m[:, 0, 2], m[:, 2, 1] + m[:, 1, 2]
    ways = np.empty((len(m), 4, 4))
    ways[:, 0] = np.stack([1 + xx - yy - zz, xy, xz, x], axis=1)
    ways[:, 1] = np.stack([xy, 1 + yy - xx - zz, yz, y], axis=1)
    ways[:, 2] = np.stack([xz, yz, 1 + zz - xx - yy, z], axis=1)
    ways[:, 3] = np.stack([x, y, z, 1 + xx + yy + zz], axis=1)
    rows = np.arange(len(m))
    largest = np.argmax(ways[:, range(4), range(4)], axis=1)
    q = ways[rows, largest]
    q /= np.sqrt(np.sum(q * q, axis=1))[:, None]
    return np.where(q[:, 3:] < 0, -q, q)


def invert_matrix(ab: Float64Array) -> Float64Array:
    """T_ba of a (4, 4) rigid transform T_ab."""
    ba = np.eye(4)
    ba[:3, :3] = ab[:3, :3].T
    ba[:3, 3] = -ab[:3, :3].T @ ab[:3, 3]
    return ba


def yaw_from_quaternion(xyzw: ArrayLike) -> float:
    """Heading [rad] of a quaternion (x, y, z, w)."""
    x, y, z, w = np.asarray(xyzw, dtype=np.float64)
    return float(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))


def interpolate_poses(stamps_ns: Int64Array, poses: Float64Array, at_ns: ArrayLike) -> Float64Array:
    """Poses (M, 3) at the wanted stamps, linear in x, y and along the shorter turn in yaw.

    Args:
        stamps_ns: (T,) ascending. poses: (T, 3). at_ns: (M,) int64.

    Returns:
        (M, 3) float64. Outside the recorded time: the nearest end's pose (never extrapolated).
    """
    # int64 nanoseconds lose microseconds as float64, so time is counted from the first stamp
    origin = int(stamps_ns[0])
    t = (np.asarray(stamps_ns) - origin).astype(np.float64)
    at = (np.asarray(at_ns, dtype=np.int64) - origin).astype(np.float64)
    yaw = np.unwrap(poses[:, 2])
    return np.stack(
        [np.interp(at, t, poses[:, 0]), np.interp(at, t, poses[:, 1]), wrap_angle(np.interp(at, t, yaw))], axis=-1
    )
