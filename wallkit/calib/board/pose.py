"""Corners in one picture -> where the board stands before the camera, how sure that is, and whether it could be mirrored."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from wallkit.calib.extrinsics.rigid import rotation_from_vector, skew
from wallkit.calib.extrinsics.sightings import BoardPose
from wallkit.core.camera import Camera
from wallkit.core.types import Float64Array
from wallkit.errors import CalibrationError

AMBIGUOUS = 1.5
FEWEST_CORNERS = 6
# corners are never better than this, however well a few of them happen to fit
_SIGMA_FLOOR_PX = 0.05
_ITERATIONS = 20


def pose_of_board(camera: Camera, points: Float64Array, pixels: Float64Array, *, name: str = "") -> BoardPose:
    """The pose that explains the corners of one picture best.

    IPPE (Collins and Bartoli, IJCV 2014) has two solutions for a plane; both are refined on the pixels, and the ratio of
    what is left is the ambiguity.

    Args:
        points: (n, 3) corners in the board frame, z = 0 [m]. pixels: (n, 2) where they were seen.

    Raises:
        CalibrationError: fewer than six corners, or corners that the camera model cannot see.
    """
    import cv2

    rays = camera.unproject(pixels)
    sees = np.isfinite(rays).all(axis=1) & (rays[:, 2] > 1e-3)
    if sees.sum() < FEWEST_CORNERS:
        said = f"only {int(sees.sum())} corners can be used of {len(pixels)}; {FEWEST_CORNERS} is the least"
        raise CalibrationError(said, where=name, hint="do the intrinsics belong to these pictures?")
    flat = np.ascontiguousarray(rays[sees, :2] / rays[sees, 2:]).reshape(-1, 1, 2)
    corners = np.ascontiguousarray(points[sees], dtype=np.float64).reshape(-1, 1, 3)
    _, turns, shifts, _ = cv2.solvePnPGeneric(corners, flat, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE)
    starts = [_transform(turn, shift) for turn, shift in zip(turns, shifts, strict=True)]
    solved = [_refined(camera, T, points[sees], pixels[sees]) for T in starts if T[2, 3] > 0]
    if not solved:
        raise CalibrationError(
            "the board comes to lie behind the camera", where=name, hint="check the board's definition"
        )
    solved.sort(key=lambda pair: pair[1])
    T, rms_px = solved[0]
    ambiguity = solved[1][1] / max(rms_px, 1e-9) if len(solved) > 1 else np.inf
    if len(solved) > 1 and np.abs(solved[1][0] - T).max() < 1e-6:
        ambiguity = np.inf
    return BoardPose(T, _covariance(camera, T, points[sees], rms_px), rms_px, float(ambiguity))


def _transform(turn: ArrayLike, shift: ArrayLike) -> Float64Array:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rotation_from_vector(np.asarray(turn).ravel()), np.asarray(shift).ravel()
    return T


def _refined(camera: Camera, T: Float64Array, points: Float64Array, pixels: Float64Array) -> tuple[Float64Array, float]:
    """Levenberg-Marquardt on the pixels; the pose and sqrt(mean(du^2 + dv^2))."""
    error, damping = _error(camera, T, points, pixels), 1e-4
    for _ in range(_ITERATIONS):
        J = _slope(camera, T, points)
        H, g = J.T @ J, J.T @ error
        step = -np.linalg.solve(H + damping * np.diag(np.diag(H)), g)
        trial = T.copy()
        trial[:3, :3] = rotation_from_vector(step[:3]) @ T[:3, :3]
        trial[:3, 3] += step[3:]
        fresh = _error(camera, trial, points, pixels)
        if not np.isfinite(fresh).all() or fresh @ fresh > error @ error:
            damping *= 10
            continue
        settled = error @ error - fresh @ fresh <= 1e-12 * (error @ error)
        T, error, damping = trial, fresh, damping / 10
        if settled:
            break
    return T, float(np.sqrt(error @ error / len(points)))


def _error(camera: Camera, T: Float64Array, points: Float64Array, pixels: Float64Array) -> Float64Array:
    return np.asarray((camera.project(points @ T[:3, :3].T + T[:3, 3]) - pixels).ravel())


def _slope(camera: Camera, T: Float64Array, points: Float64Array) -> Float64Array:
    """(2n, 6) d pixels / d (w, dt), R <- Exp(w) R, t <- t + dt."""
    arms = points @ T[:3, :3].T
    by_motion = np.concatenate([-skew(arms), np.tile(np.eye(3), (len(arms), 1, 1))], axis=2)
    return np.asarray((camera.point_jacobian(arms + T[:3, 3]) @ by_motion).reshape(-1, 6))


def _covariance(camera: Camera, T: Float64Array, points: Float64Array, rms_px: float) -> Float64Array:
    J = _slope(camera, T, points)
    free = max(2 * len(points) - 6, 1)
    variance = max(rms_px**2 * len(points) / free, _SIGMA_FLOOR_PX**2)
    return np.asarray(np.linalg.inv(J.T @ J) * variance)
