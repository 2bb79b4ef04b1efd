"""A capture -> what its data say about themselves: two halves against each other, and lens models on views held out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wallkit.calib.board.views import Capture, Observations
from wallkit.calib.camera.bundle import Fit
from wallkit.calib.camera.covariance import camera_spread
from wallkit.calib.camera.intrinsics import Intrinsics, fit_cameras, free_parameters, held_out_residuals, robust_sigma
from wallkit.calib.camera.projection_uncertainty import PixelMap, projection_difference, projection_sigma
from wallkit.core.camera import Camera
from wallkit.core.types import Float64Array
from wallkit.errors import CalibrationError

FOLDS = 5
CHOICES = ("k1k2", "plumb_bob", "equidistant", "rational_polynomial")
_WITHIN = 1.02


@dataclass(frozen=True, slots=True)
class Halves:
    """Two cameras from every other view each.

    Attributes:
        difference: where they disagree [px], a common turn taken out. expected_px: median of their predicted sigmas.
    """

    difference: PixelMap
    expected_px: float


@dataclass(frozen=True, slots=True)
class Candidate:
    """A lens model on trial.

    Attributes:
        model: name in MODELS. parameters: how many are estimated.
        fit_rms_px: of the fit. held_out_rms_px, held_out_95_px: of views it was not fitted to; NaN if a fold failed.
        bic: Bayesian information criterion of the fit's 2 N coordinates.
        grows_to_corner: whether the radial map grows up to the image's corners.
    """

    model: str
    parameters: int
    fit_rms_px: float
    held_out_rms_px: float
    held_out_95_px: float
    bic: float
    grows_to_corner: bool


def compare_halves(found: Intrinsics, capture: Capture) -> Halves | None:
    """The views in two halves, every other one; None when a half is too small to calibrate."""
    count = found.seen.count
    halves = [found.seen.of_views(range(first, count, 2)) for first in (0, 1)]
    if count < 6:
        return None
    cameras, medians = [], []
    for half in halves:
        fit = _fit_or_none(found.model, capture, half, found.camera)
        if fit is None:
            return None
        covariance = camera_spread(fit, half, found.free, robust_sigma(fit)).covariance
        cameras.append(fit.camera)
        medians.append(projection_sigma(fit.camera, covariance).median)
    return Halves(projection_difference(cameras[0], cameras[1]), float(sum(medians)))


def candidates(capture: Capture, seen: Observations, models: Sequence[str] = CHOICES) -> list[Candidate]:
    """Every model fitted to all views and to four fifths of them in turn, the last fifth held out.

    Held-out views only find the board's pose with the camera fixed: so these are errors on pictures the
    camera has not seen.
    """
    return [found for model in models if (found := _candidate(model, capture, seen)) is not None]


def choose(tried: Sequence[Candidate]) -> str:
    """The leanest model whose held-out RMS is within 2 % of the best, among those that grow up to the image's corners.

    Raises:
        CalibrationError: none could be fitted.
    """
    sound = [c for c in tried if np.isfinite(c.held_out_rms_px) and c.grows_to_corner]
    if not sound:
        raise CalibrationError(
            "no lens model can be judged on held-out views", hint="take more views, or name one: --model"
        )
    best = min(c.held_out_rms_px for c in sound)
    return min((c for c in sound if c.held_out_rms_px <= _WITHIN * best), key=lambda c: c.parameters).model


def held_out_errors(
    model: str, capture: Capture, seen: Observations, near: Camera | None = None
) -> Float64Array | None:
    """(N,) distance [px] of every corner while its view was held out; None if a fold could not be fitted."""
    folds = min(FOLDS, seen.count)
    errors = np.full(len(seen.pixels), np.nan)
    for fold in range(folds):
        held = np.arange(fold, seen.count, folds)
        rest = np.setdiff1d(np.arange(seen.count), held)
        fit = _fit_or_none(model, capture, seen.of_views(rest), near)
        residuals = held_out_residuals(fit.camera, seen.of_views(held)) if fit is not None else None
        if residuals is None:
            return None
        errors[np.isin(seen.views, held)] = np.hypot(residuals[:, 0], residuals[:, 1])
    return errors


def grows_to_corner(camera: Camera) -> bool:
    """Whether every corner of the image is where the model's radial map still grows."""
    right, low = camera.width - 1, camera.height - 1
    return bool(np.isfinite(camera.unproject([(0, 0), (right, 0), (0, low), (right, low)])).all())


def _candidate(model: str, capture: Capture, seen: Observations) -> Candidate | None:
    fit = _fit_or_none(model, capture, seen)
    if fit is None:
        return None
    errors = held_out_errors(model, capture, seen, fit.camera)
    parameters, count = int(free_parameters(model).sum()), 2 * len(seen.pixels)
    squares = float((fit.weights[:, None] * fit.residuals**2).sum())
    return Candidate(
        model,
        parameters,
        fit.rms_px,
        float("nan") if errors is None else float(np.sqrt((errors**2).mean())),
        float("nan") if errors is None else float(np.quantile(errors, 0.95)),
        count * float(np.log(squares / count)) + (parameters + 6 * seen.count) * float(np.log(count)),
        grows_to_corner(fit.camera),
    )


def _fit_or_none(model: str, capture: Capture, seen: Observations, near: Camera | None = None) -> Fit | None:
    """The fit; None where the views are too few or lead nowhere."""
    if 2 * len(seen.pixels) <= free_parameters(model).sum() + 6 * seen.count or seen.count < 2:
        return None
    try:
        fit = fit_cameras(model, capture, seen, near=near)
    except (CalibrationError, np.linalg.LinAlgError):
        return None
    return fit if np.isfinite(fit.cost) else None
