"""Views and a first guess -> the transform that fits them, robustly: whiten, minimise, weigh the views, repeat."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from wallkit.calib.extrinsics.covariance import Spread, spread_of
from wallkit.calib.extrinsics.rigid import left_jacobian, rotation_from_vector, vector_from_rotation
from wallkit.calib.extrinsics.sightings import Problem, jacobian, residuals, whiteners
from wallkit.core.types import Float64Array

# a view loses weight beyond so many times the usual misfit; a lower bound would take weight from close views, whose
# many points make the declared noise look too small for everything else that is wrong with a board
HUBER = 3.0
ROUNDS = 30
SETTLED = 1e-10
MOTION = np.eye(6)


@dataclass(frozen=True, eq=False)
class Prior:
    """What is known before: a transform, and how much it counts.

    Attributes:
        T: (4, 4) T_camera_lidar from the URDF.
        rows: (m, 6) whitened rows on the difference to it in LiDAR axes (turn [rad], shift [m]); see `prior_along`.
    """

    T: Float64Array
    rows: Float64Array


@dataclass(frozen=True, eq=False)
class Placement:
    """A minimum.

    Attributes:
        T: (4, 4) T_camera_lidar.
        basis: (6, k) directions that were free, in LiDAR axes (turn, shift) at T.
        rows: (G, K, k) whitened, weighted Jacobian along the basis; residuals: (G, K) with them.
        held: (k, k) information of the prior along the basis.
        weights: (G,) robust weight of each view.
        misfit: (G,) RMS whitened residual of each view; 1 is what the declared noise promises.
        cost: robust sum over the views.
    """

    T: Float64Array
    basis: Float64Array
    rows: Float64Array
    residuals: Float64Array
    held: Float64Array
    weights: Float64Array
    misfit: Float64Array
    cost: float

    def spread(self) -> Spread:
        """Uncertainty along the basis.

        Raises:
            np.linalg.LinAlgError: a direction is entirely open.
        """
        return spread_of(self.rows, self.residuals, self.held)

    def spread_along(self, directions: Float64Array) -> Spread:
        """Uncertainty of directions'(turn, shift) for six independent directions (6, 6), when all six were free."""
        back = np.linalg.inv(directions.T @ self.basis)
        return spread_of(self.rows @ back, self.residuals, back.T @ self.held @ back)


def fit(
    problem: Problem,
    T: Float64Array,
    *,
    basis: Float64Array = MOTION,
    prior: Prior | None = None,
    rounds: int = ROUNDS,
) -> Placement:
    """The minimum nearest to T, over all six directions or those of a basis.

    Args:
        basis: (6, k) directions that may change, in LiDAR axes (turn, shift); the others stay as they are in T.
    """
    base, x = T, np.zeros(basis.shape[1])
    weights = np.ones(len(problem))
    counts = problem.row_counts
    moved = T
    for _ in range(rounds):
        whiten = whiteners(problem, moved) * np.sqrt(weights)[:, None, None]
        step = _minimum(problem, whiten, base, basis, x, prior)
        settled = float(np.abs(step - x).max(initial=0.0)) < SETTLED
        x, moved = step, _moved(base, basis, step)
        misfit = _misfit(problem, moved, counts)
        scale = max(float(np.median(misfit)), 1e-12)
        fresh = np.minimum(1.0, HUBER * scale / np.maximum(misfit, 1e-12))
        settled = settled and float(np.abs(fresh - weights).max()) < 1e-9
        weights = fresh
        if settled:
            break
    return _fit_at(problem, moved, basis_at(basis, x), prior, weights)


def _fit_at(
    problem: Problem, T: Float64Array, basis: Float64Array, prior: Prior | None, weights: Float64Array
) -> Placement:
    whiten = whiteners(problem, T) * np.sqrt(weights)[:, None, None]
    rows = whiten @ jacobian(problem, T) @ _left_from_lidar(T) @ basis
    left = np.einsum("gkj,gj->gk", whiten, residuals(problem, T))
    held = np.zeros((basis.shape[1],) * 2)
    if prior is not None:
        by_prior = prior.rows @ _difference_jacobian(prior.T, T) @ basis
        held = by_prior.T @ by_prior
    misfit = _misfit(problem, T, problem.row_counts)
    scale = HUBER * max(float(np.median(misfit)), 1e-12)
    cost = np.where(misfit <= scale, misfit**2, 2 * scale * misfit - scale**2)
    return Placement(T, basis, rows, left, held, weights, misfit, float((cost * problem.row_counts).sum()))


def prior_along(T: Float64Array, directions: Float64Array, *, turn_rad: float, shift_m: float) -> Prior:
    """A prior that counts only along some directions (6, m; LiDAR axes, unit length when turns are divided by turn_rad and
    shifts by shift_m), each with one sigma."""
    return Prior(T, directions.T / np.repeat([turn_rad, shift_m], 3))


def difference(prior: Float64Array, T: Float64Array) -> Float64Array:
    """(6,) turn [rad] and shift [m] from one transform to another, in the LiDAR axes of the first."""
    R = prior[:3, :3]
    return np.concatenate([vector_from_rotation(R.T @ T[:3, :3]), R.T @ (T[:3, 3] - prior[:3, 3])])


def camera_axes(fit_: Placement, covariance: Float64Array) -> Float64Array:
    """(6, 6) covariance of (w, t) from the left in the camera frame, of one along the fit's basis."""
    A = _left_from_lidar(fit_.T) @ fit_.basis
    return np.asarray(A @ covariance @ A.T)


def inflated(problem: Problem, factor: float) -> Problem:
    """The problem with all declared noise, of ranges and board poses, larger by a factor."""
    return replace(
        problem,
        points=problem.points / factor,
        weights=problem.weights / factor,
        covariances=problem.covariances * factor**2,
    )


# ------------------------------------------------------------------------------------------------ details


def _minimum(
    problem: Problem,
    whiten: Float64Array,
    base: Float64Array,
    basis: Float64Array,
    x: Float64Array,
    prior: Prior | None,
) -> Float64Array:
    from scipy.optimize import least_squares

    def cost(y: Float64Array) -> Float64Array:
        T = _moved(base, basis, y)
        rows = np.einsum("gkj,gj->gk", whiten, residuals(problem, T)).ravel()
        return rows if prior is None else np.concatenate([rows, prior.rows @ difference(prior.T, T)])

    def slope(y: Float64Array) -> Float64Array:
        T, here = _moved(base, basis, y), basis_at(basis, y)
        rows = (whiten @ jacobian(problem, T) @ _left_from_lidar(T) @ here).reshape(-1, basis.shape[1])
        return rows if prior is None else np.concatenate([rows, prior.rows @ _difference_jacobian(prior.T, T) @ here])

    done = least_squares(cost, x, jac=slope, method="trf", x_scale="jac", xtol=1e-12, ftol=1e-14, gtol=1e-14)
    return np.asarray(done.x)


def _misfit(problem: Problem, T: Float64Array, counts: Float64Array) -> Float64Array:
    whitened = np.einsum("gkj,gj->gk", whiteners(problem, T), residuals(problem, T))
    return np.asarray(np.sqrt((whitened**2).sum(axis=1) / counts))


def _moved(base: Float64Array, basis: Float64Array, x: Float64Array) -> Float64Array:
    """base with a turn and a shift along the basis, both in the LiDAR axes of base."""
    motion = basis @ x
    T = np.eye(4)
    T[:3, :3] = base[:3, :3] @ rotation_from_vector(motion[:3])
    T[:3, 3] = base[:3, 3] + base[:3, :3] @ motion[3:]
    return T


def basis_at(basis: Float64Array, x: Float64Array) -> Float64Array:
    """(6, k) the directions of a basis, given in the LiDAR axes before the motion x, in those after it."""
    turn = basis[:3] @ x
    back = rotation_from_vector(-turn)
    return np.asarray(np.concatenate([back @ left_jacobian(turn) @ basis[:3], back @ basis[3:]]))


def _left_from_lidar(T: Float64Array) -> Float64Array:
    """(6, 6) (w, dt) of the camera frame from (turn, shift) in LiDAR axes."""
    A = np.zeros((6, 6))
    A[:3, :3] = A[3:, 3:] = T[:3, :3]
    return A


def _difference_jacobian(prior: Float64Array, T: Float64Array) -> Float64Array:
    """(6, 6) d difference(prior, T) / d (turn, shift) in the LiDAR axes of T."""
    R = prior[:3, :3].T @ T[:3, :3]
    A = np.zeros((6, 6))
    A[:3, :3] = np.linalg.inv(left_jacobian(-vector_from_rotation(R)))
    A[3:, 3:] = R
    return A
