"""Corners in several views -> the camera and board poses that explain them best (bundle adjustment).

Levenberg-Marquardt on intrinsics and one pose a view; poses are eliminated (Schur complement), so that a step with 60 views
costs a 14 x 14 system. Its optimum is OpenCV's `calibrateCamera`, which the tests compare with; it is not used because it
stops after 30 iterations, has no robust loss, and its fisheye half differs between the versions 4 and 5.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np

from wallkit.calib.board.views import Observations
from wallkit.core.camera import Camera
from wallkit.core.types import BoolArray, Float64Array

MAX_ITERATIONS = 500
LEAST_DROP = 1e-14


@dataclass(frozen=True, slots=True)
class Fit:
    """A camera with the board poses of its views.

    Attributes:
        camera: intrinsics. poses: (G, 4, 4) T_camera_board of each view.
        residuals: (N, 2) projected minus observed [px].
        weights: (N,) robust weights in (0, 1]; ones of a plain least-squares fit.
        cost: half the sum of the loss. iterations: used. is_converged: whether the cost came to rest within them.
    """

    camera: Camera
    poses: Float64Array
    residuals: Float64Array
    weights: Float64Array
    cost: float
    iterations: int
    is_converged: bool

    @property
    def rms_px(self) -> float:
        """Root of the mean squared distance between projected and observed corners: sqrt(sum |e|^2 / N)."""
        return float(np.sqrt((self.residuals**2).sum() / max(1, len(self.residuals))))


def adjust(
    start: Fit,
    seen: Observations,
    *,
    free: BoolArray,
    huber_px: float = np.inf,
    max_iterations: int = MAX_ITERATIONS,
    least_drop: float = LEAST_DROP,
) -> Fit:
    """The nearest optimum of camera and poses.

    Args:
        start: camera and poses to begin with.
        free: (4 + n,) which of fx, fy, cx, cy, D may change; none: only the poses do.
        huber_px: distance from which a corner pulls with constant force (Huber); inf: least squares.
        least_drop: of the cost in a step, relative; below it the optimum is reached.

    Returns:
        A Fit; `is_converged` is False when it was still improving after the last iteration.
    """
    fit, damping = _judged(start.camera, start.poses, seen, huber_px), 1e-3
    for iteration in range(1, max_iterations + 1):
        system = normal_equations(fit, seen, free)
        while True:
            tried = _stepped(fit, seen, system, free, damping, huber_px)
            if tried is not None and tried.cost <= fit.cost:
                break
            damping *= 10
            if damping > 1e12:
                # no direction leads down any more: the optimum, to the last digit
                return replace(fit, iterations=iteration, is_converged=True)
        drop = fit.cost - tried.cost
        fit, damping = tried, max(damping / 10, 1e-12)
        if drop <= least_drop * fit.cost or fit.cost < 1e-20:
            return replace(fit, iterations=iteration, is_converged=True)
    return replace(fit, iterations=max_iterations, is_converged=False)


@dataclass(frozen=True, slots=True)
class System:
    """Normal equations, weighted: blocks of the camera (C), the views (V) and between, and the gradients.

    Attributes:
        cc_views: (G, P, P) of each view. vv: (G, 6, 6). cv: (G, P, 6). gc: (G, P) of each view. gv: (G, 6).
    """

    cc_views: Float64Array
    vv: Float64Array
    cv: Float64Array
    gc: Float64Array
    gv: Float64Array

    @property
    def cc(self) -> Float64Array:
        """(P, P) of all views."""
        return np.asarray(self.cc_views.sum(axis=0))

    def reduced(self, damping: float = 0.0) -> tuple[Float64Array, Float64Array, Float64Array]:
        """Schur complement (P, P), the views' reduced gradients (G, P), and vv^-1 cv' (G, 6, P)."""
        bounded = self.vv + damping * self.vv * np.eye(6)
        gain = np.linalg.solve(bounded, np.swapaxes(self.cv, 1, 2))
        scores = self.gc - np.einsum("gpv,gv->gp", np.swapaxes(gain, 1, 2), self.gv)
        cc = self.cc
        schur = cc + damping * cc * np.eye(len(cc)) - (self.cv @ gain).sum(axis=0)
        return np.asarray(schur), np.asarray(scores), np.asarray(gain)


def normal_equations(fit: Fit, seen: Observations, free: BoolArray) -> System:
    """The weighted normal equations at a fit, for its next step or its covariance."""
    by_camera, by_pose = jacobians(fit.camera, fit.poses, seen)
    every = np.concatenate([by_camera[:, :, free], by_pose, fit.residuals[:, :, None]], axis=2)
    every *= np.sqrt(fit.weights)[:, None, None]
    # views side by side, the shorter ones filled up with zeros: one product for all
    within = np.arange(len(seen.views)) - seen.starts[seen.views]
    padded = np.zeros((seen.count, int(within.max()) + 1, *every.shape[1:]))
    padded[seen.views, within] = every
    padded = padded.reshape(seen.count, -1, every.shape[2])
    squared = np.swapaxes(padded, 1, 2) @ padded
    c, v = slice(0, -7), slice(-7, -1)
    return System(squared[:, c, c], squared[:, v, v], squared[:, c, v], squared[:, c, -1], squared[:, v, -1])


def jacobians(camera: Camera, poses: Float64Array, seen: Observations) -> tuple[Float64Array, Float64Array]:
    """d pixel / d parameters (N, 2, 4 + n) and d pixel / d pose (N, 2, 6), from the left: (w_x w_y w_z t_x t_y t_z)."""
    R, t = poses[seen.views, :3, :3], poses[seen.views, :3, 3]
    turned = np.einsum("nij,nj->ni", R, seen.points)
    by_point, by_lens = camera.lens.jacobians(turned + t, camera.D)
    focal = camera.K[[0, 1], [0, 1]]
    by_point = by_point * focal[:, None]
    by_camera = np.zeros((len(turned), 2, 4 + len(camera.D)))
    by_camera[:, [0, 1], [0, 1]] = camera.lens.distort(turned + t, camera.D)
    by_camera[:, [0, 1], [2, 3]] = 1
    by_camera[:, :, 4:] = by_lens * focal[:, None]
    # d(Exp(w) R X) / dw = -[R X]_x, so each row of by_point turns into (R X) x row
    by_turn = np.cross(turned[:, None, :], by_point)
    return by_camera, np.concatenate([by_turn, by_point], -1)


def _stepped(
    fit: Fit, seen: Observations, system: System, free: BoolArray, damping: float, huber_px: float
) -> Fit | None:
    """The fit after one damped step; None where that step leads nowhere (behind the camera, singular, not finite)."""
    try:
        schur, scores, gain = system.reduced(damping)
        step = -np.linalg.solve(schur, scores.sum(axis=0)) if free.any() else np.zeros(0)
        # the views' own steps follow from the camera's
        bounded = system.vv + damping * system.vv * np.eye(6)
        moves = -np.linalg.solve(bounded, system.gv[:, :, None])[:, :, 0] - gain @ step
    except np.linalg.LinAlgError:
        return None
    parameters = fit.camera.parameters
    parameters[free] += step
    if not np.isfinite(parameters).all() or (parameters[:2] <= 0).any() or not np.isfinite(moves).all():
        return None
    return _judged(fit.camera.with_parameters(parameters), moved(fit.poses, moves), seen, huber_px)


def moved(poses: Float64Array, moves: Float64Array) -> Float64Array:
    """Poses (G, 4, 4) after moves (G, 6) from the left: R <- Exp(w) R, t <- t + dt."""
    result = poses.copy()
    result[:, :3, :3] = rotations(moves[:, :3]) @ poses[:, :3, :3]
    result[:, :3, 3] += moves[:, 3:]
    return result


def rotations(vectors: Float64Array) -> Float64Array:
    """Exp of rotation vectors (G, 3) [rad], (G, 3, 3) (Rodrigues)."""
    angle = np.linalg.norm(vectors, axis=1)[:, None, None]
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], -1).reshape(-1, 3, 3)
    safe = np.where(angle < 1e-8, 1.0, angle)
    first = np.where(angle < 1e-8, 1 - angle**2 / 6, np.sin(safe) / safe)
    second = np.where(angle < 1e-8, 0.5 - angle**2 / 24, (1 - np.cos(safe)) / safe**2)
    return np.asarray(np.eye(3) + first * cross + second * cross @ cross)


def _judged(camera: Camera, poses: Float64Array, seen: Observations, huber_px: float) -> Fit:
    """Residuals, weights and cost of a camera with poses; the cost is inf when a corner is not in front of the camera."""
    R, t = poses[seen.views, :3, :3], poses[seen.views, :3, 3]
    points = np.einsum("nij,nj->ni", R, seen.points) + t
    with np.errstate(all="ignore"):
        pixels = camera.lens.distort(points, camera.D) * camera.K[[0, 1], [0, 1]] + camera.K[:2, 2]
        residuals = pixels - seen.pixels
        distance = np.hypot(residuals[:, 0], residuals[:, 1])
        weights = np.where(distance > huber_px, huber_px / distance, 1.0) if np.isfinite(huber_px) else np.ones(len(t))
        loss = np.where(distance > huber_px, 2 * huber_px * distance - huber_px**2, distance**2)
    is_bad = not np.isfinite(loss).all() or bool((points[:, 2] <= 0).any() and camera.model != "equidistant")
    return Fit(camera, poses, residuals, weights, np.inf if is_bad else float(loss.sum() / 2), 0, False)


def first_fit(camera: Camera, seen: Observations) -> Fit | None:
    """A camera with the board poses that its corners suggest (planar homography); None when a view allows none."""
    rays = camera.unproject(seen.pixels)
    if not np.isfinite(rays).all() or (rays[:, 2] < 0.05).any():
        return None
    xy = rays[:, :2] / rays[:, 2:]
    bounds = [*seen.starts.tolist(), len(xy)]
    poses = np.stack([_pose(seen.points[a:b, :2], xy[a:b]) for a, b in itertools.pairwise(bounds)])
    return _judged(camera, poses, seen, np.inf)


def homography(plane: Float64Array, xy: Float64Array) -> Float64Array:
    """(3, 3) H with xy ~ H plane by the normalised direct linear transform (Hartley & Zisserman 2004, alg. 4.2)."""
    A, B = _normalising(plane), _normalising(xy)
    p = np.column_stack([plane, np.ones(len(plane))]) @ A.T
    q = np.column_stack([xy, np.ones(len(xy))]) @ B.T
    zero = np.zeros_like(p)
    rows = np.concatenate([np.hstack([p, zero, -q[:, :1] * p]), np.hstack([zero, p, -q[:, 1:2] * p])])
    H = np.linalg.svd(rows, full_matrices=False)[2][-1].reshape(3, 3)
    return np.asarray(np.linalg.inv(B) @ H @ A)


def _normalising(points: Float64Array) -> Float64Array:
    middle = points.mean(axis=0)
    scale = np.sqrt(2) / max(float(np.linalg.norm(points - middle, axis=1).mean()), 1e-12)
    return np.array([[scale, 0, -scale * middle[0]], [0, scale, -scale * middle[1]], [0, 0, 1]])


def _pose(plane: Float64Array, xy: Float64Array) -> Float64Array:
    """T_camera_board (4, 4) of plane points (n, 2) [m] seen at normalised coordinates (Zhang, PAMI 2000, section 3.1)."""
    H = homography(plane, xy)
    H = H / np.sqrt(np.linalg.norm(H[:, 0]) * np.linalg.norm(H[:, 1]))
    H = -H if (H @ np.append(plane.mean(axis=0), 1))[2] < 0 else H
    U, _, V = np.linalg.svd(np.column_stack([H[:, 0], H[:, 1], np.cross(H[:, 0], H[:, 1])]))
    pose = np.eye(4)
    pose[:3, :3] = U @ np.diag([1, 1, np.linalg.det(U @ V)]) @ V
    pose[:3, 3] = H[:, 2]
    return pose
