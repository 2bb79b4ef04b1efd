"""Normal equations of a camera -> how uncertain its parameters are, with the views as the units that err."""

from __future__ import annotations

import numpy as np

from wallkit.calib.bundle import Fit, System
from wallkit.core.types import BoolArray, Float64Array


def clustered_covariance(system: System, free: BoolArray) -> Float64Array:
    """(4 + n, 4 + n) covariance in which all corners of a view may err together; zero where a parameter is held.

    The one-step jackknife over views (CR3; MacKinnon & White 1985, Bell & McCaffrey 2002): each view is left out, the camera
    moves by d_g = (S - S_g)^-1 s_g, and C = (G - 1)/G sum d_g d_g'. S is the camera's information after the poses are
    eliminated, s_g the score of view g. Unlike the plain sandwich it is not too small with few views. Where leaving out one
    view makes the camera undetermined, its variance is infinite: the largest float that can be stored stands for it.
    """
    schur, scores, gain = system.reduced()
    count = len(scores)
    # information of each view about the camera: its share of cc is not kept apart, so it is found from J'J of the view
    each = system.cc_views - system.cv @ gain
    changes = np.empty_like(scores)
    for g in range(count):
        rest = schur - each[g]
        scale = np.sqrt(np.maximum(np.diag(schur), 1e-300))
        balanced = rest / np.outer(scale, scale)
        if np.linalg.cond(balanced) > 1e14:
            changes[g] = 1e150
            continue
        changes[g] = np.linalg.solve(balanced, scores[g] / scale) / scale
    return _whole((count - 1) / count * changes.T @ changes, free)


def naive_covariance(system: System, fit: Fit, free: BoolArray) -> Float64Array:
    """(4 + n, 4 + n) s^2 (J'J)^-1 with s^2 = sum e^2 / (2 N - p): true only if every corner errs by itself."""
    schur, scores, _ = system.reduced()
    degrees = 2 * len(fit.residuals) - int(free.sum()) - 6 * len(scores)
    variance = float((fit.weights[:, None] * fit.residuals**2).sum()) / max(1, degrees)
    return _whole(np.asarray(variance * np.linalg.inv(schur)), free)


def _whole(covariance: Float64Array, free: BoolArray) -> Float64Array:
    full = np.zeros((len(free), len(free)))
    full[np.ix_(free, free)] = (covariance + covariance.T) / 2
    return full
