"""Small motions of a transform, and transforms in words: exponentials, and roll, pitch, yaw as URDF means them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from wallkit.core.types import Float64Array


def rotation_from_vector(w: ArrayLike) -> Float64Array:
    """(..., 3, 3) Exp(w): the turn by |w| [rad] about w (..., 3)."""
    return np.asarray(Rotation.from_rotvec(np.asarray(w, dtype=np.float64)).as_matrix())


def vector_from_rotation(R: ArrayLike) -> Float64Array:
    """(..., 3) Log(R), |w| <= pi."""
    return np.asarray(Rotation.from_matrix(np.asarray(R, dtype=np.float64)).as_rotvec())


def skew(v: ArrayLike) -> Float64Array:
    """(..., 3, 3) [v]x of v (..., 3), so that [v]x u = v x u."""
    v = np.asarray(v, dtype=np.float64)
    K = np.zeros((*v.shape, 3))
    for row, column, axis, sign in (
        (0, 1, 2, -1),
        (0, 2, 1, 1),
        (1, 0, 2, 1),
        (1, 2, 0, -1),
        (2, 0, 1, -1),
        (2, 1, 0, 1),
    ):
        K[..., row, column] = sign * v[..., axis]
    return K


def left_jacobian(w: ArrayLike) -> Float64Array:
    """(3, 3) J with Exp(w + d) = Exp(J d) Exp(w) for small d (Sola, Deray, Atchuthan 2018, eq. 145)."""
    w = np.asarray(w, dtype=np.float64)
    angle = float(np.linalg.norm(w))
    if angle < 1e-6:
        return np.eye(3) + 0.5 * skew(w)
    K = skew(w / angle)
    return np.asarray(np.eye(3) + (1 - np.cos(angle)) / angle * K + (1 - np.sin(angle) / angle) * K @ K)


def matrix_from_rpy(xyz: ArrayLike, rpy: ArrayLike) -> Float64Array:
    """(4, 4) of a URDF <origin>: xyz [m], roll, pitch, yaw [rad] about fixed axes."""
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler("xyz", np.asarray(rpy, dtype=np.float64)).as_matrix()
    T[:3, 3] = xyz
    return T


def rpy_from_matrix(T: ArrayLike) -> Float64Array:
    """(3,) roll, pitch, yaw [rad] of the rotation in (3, 3) or (4, 4); at pitch +-90 deg yaw is taken as 0."""
    R = np.asarray(T, dtype=np.float64)[:3, :3]
    pitch = float(np.arctan2(-R[2, 0], np.hypot(R[0, 0], R[1, 0])))
    if np.hypot(R[0, 0], R[1, 0]) < 1e-9:
        return np.array([np.arctan2(-R[1, 2], R[1, 1]), pitch, 0.0])
    return np.array([np.arctan2(R[2, 1], R[2, 2]), pitch, np.arctan2(R[1, 0], R[0, 0])])


def angle_between(T: Float64Array, other: Float64Array) -> float:
    """Angle [rad] of the turn from one transform to another."""
    return float(np.linalg.norm(vector_from_rotation(T[:3, :3].T @ other[:3, :3])))
