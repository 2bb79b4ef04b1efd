"""A camera fitted to several views -> how uncertain its parameters are, with the views as the units that err."""

from __future__ import annotations

import itertools

import numpy as np

from wallkit.calib.board.views import Observations
from wallkit.calib.camera.bundle import Fit, System, jacobians
from wallkit.calib.extrinsics.covariance import Spread, spread_of
from wallkit.core.types import BoolArray, Float64Array

# stands for infinity where the views leave a parameter open: its square can still be stored
_OPEN = 1e150


def camera_spread(fit: Fit, seen: Observations, free: BoolArray, sigma_px: float) -> Spread:
    """Uncertainty of the 4 + n parameters in which all corners of a view may err together; zero where one is held.

    Each view's Jacobian is first cleared of what its own board pose explains, then shortened to a triangle by QR: both
    leave the information, the scores and the leverages of `spread_of` as they are.

    Args:
        sigma_px: standard deviation of a residual coordinate.
    """
    rows, residuals = _reduced_rows(fit, seen, free, max(sigma_px, 1e-9))
    # pixels against coefficients: comparable columns keep the inverse exact
    scale = np.sqrt((rows**2).sum(axis=(0, 1)))
    unknowns, every = int(free.sum()), len(free)
    if not (scale > 0).all():
        return _open(free, seen.count)
    try:
        spread = spread_of(rows / scale, residuals)
    except np.linalg.LinAlgError:
        return _open(free, seen.count)
    degrees = np.full(every, np.inf)
    degrees[free] = spread.degrees
    both = np.outer(scale, scale)
    assert spread.covariance.shape == (unknowns, unknowns)
    return Spread(_whole(spread.covariance / both, free), _whole(spread.predicted / both, free), degrees, seen.count)


def naive_covariance(system: System, fit: Fit, free: BoolArray) -> Float64Array:
    """(4 + n, 4 + n) s^2 (J'J)^-1 with s^2 = sum e^2 / (2 N - p): true only if every corner errs by itself."""
    schur, scores, _ = system.reduced()
    degrees = 2 * len(fit.residuals) - int(free.sum()) - 6 * len(scores)
    variance = float((fit.weights[:, None] * fit.residuals**2).sum()) / max(1, degrees)
    return _whole(np.asarray(variance * np.linalg.inv(schur)), free)


def _reduced_rows(fit: Fit, seen: Observations, free: BoolArray, sigma_px: float) -> tuple[Float64Array, Float64Array]:
    """Whitened Jacobian (G, p, p) and residuals (G, p) of each view, its pose eliminated."""
    by_camera, by_pose = jacobians(fit.camera, fit.poses, seen)
    root = np.sqrt(fit.weights)[:, None] / sigma_px
    by_camera, by_pose, errors = (
        by_camera[:, :, free] * root[..., None],
        by_pose * root[..., None],
        fit.residuals * root,
    )
    unknowns = int(free.sum())
    rows, residuals = np.zeros((seen.count, unknowns, unknowns)), np.zeros((seen.count, unknowns))
    bounds = [*seen.starts.tolist(), len(errors)]
    for view, (a, b) in enumerate(itertools.pairwise(bounds)):
        pose, _ = np.linalg.qr(by_pose[a:b].reshape(-1, 6))
        camera, error = by_camera[a:b].reshape(-1, unknowns), errors[a:b].ravel()
        basis, triangle = np.linalg.qr(camera - pose @ (pose.T @ camera))
        rows[view, : len(triangle)], residuals[view, : len(triangle)] = (
            triangle,
            basis.T @ (error - pose @ (pose.T @ error)),
        )
    return rows, residuals


def _open(free: BoolArray, views: int) -> Spread:
    """What is known when the views leave the camera undetermined: nothing."""
    covariance = np.diag(np.where(free, _OPEN**2, 0.0))
    return Spread(covariance, covariance, np.where(free, 1.0, np.inf), views)


def _whole(covariance: Float64Array, free: BoolArray) -> Float64Array:
    full = np.zeros((len(free), len(free)))
    full[np.ix_(free, free)] = (covariance + covariance.T) / 2
    return full
