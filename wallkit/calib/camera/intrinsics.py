"""Corners of one camera -> its intrinsics: several starts, least squares, then a robust fit that says what it rejected."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from wallkit.calib.board.views import Capture, Observations, View, observations_of
from wallkit.calib.camera.bundle import Fit, adjust, first_fit, homography, normal_equations
from wallkit.calib.camera.covariance import camera_spread, naive_covariance
from wallkit.calib.extrinsics.covariance import Spread
from wallkit.core.camera import Camera
from wallkit.core.lenses import CAMERAS
from wallkit.core.types import BoolArray, Float64Array, Int64Array
from wallkit.errors import CalibrationError, closest

_GUESSES = (0.5, 0.8, 1.2)
_START_ITERATIONS = 50
_ROUNDS = 3
# models and halves are compared to a hundredth of their RMS: no need for the last digits of each
_JUDGING_DROP = 1e-9
_VIEW_RMS_FACTOR, _VIEW_MAD_Z, _CORNER_SIGMAS, _MOST_REJECTED = 3.0, 5.0, 5.0, 0.25
# standard deviations of a normal distribution per median absolute deviation
_SIGMA_PER_MAD = 1.4826


@dataclass(frozen=True, slots=True)
class Model:
    """A lens model with the coefficients that are estimated; the others stay 0."""

    lens: str
    estimated: tuple[str, ...]


@dataclass(frozen=True)
class Intrinsics:
    """A calibrated camera, and how it was found.

    Attributes:
        model: name in MODELS. free: (4 + n,) which parameters were estimated.
        views: used. seen: their corners, those rejected left out. fit: the robust fit of them.
        plain_rms_px: of the least-squares fit to every corner of every view, and plain: that fit.
        rejected_views: name -> why. rejected_corners: how many, in views that are used.
        sigma_px: robust standard deviation of a residual coordinate.
        spread: of the 4 + n parameters, clustered by view; zero where a parameter is held.
        naive_covariance: s^2 (J'J)^-1, which takes every corner's error for its own.
        starts_px: RMS that each start reached, by its name, smallest is the one continued.
    """

    model: str
    free: BoolArray
    views: tuple[View, ...]
    seen: Observations
    fit: Fit
    plain: Fit
    rejected_views: Mapping[str, str]
    rejected_corners: int
    sigma_px: float
    spread: Spread
    naive_covariance: Float64Array
    starts_px: Mapping[str, float]

    @property
    def camera(self) -> Camera:
        """The answer."""
        return self.fit.camera

    @property
    def covariance(self) -> Float64Array:
        """(4 + n, 4 + n), clustered by view."""
        return self.spread.covariance

    @property
    def sigmas(self) -> Float64Array:
        """(4 + n,) clustered standard deviation of each parameter."""
        return self.spread.sigmas

    @property
    def view_rms_px(self) -> Float64Array:
        """(G,) RMS of each used view."""
        return rms_by_view(self.fit, self.seen)


def calibrate(capture: Capture, model: str) -> Intrinsics:
    """The camera that explains the corners of a capture best.

    Raises:
        CalibrationError: an unknown model, too few corners for it, or no start that leads anywhere.
    """
    if model not in MODELS:
        raise CalibrationError(f"lens model '{model}' is not known", hint=closest(model, MODELS))
    views = list(capture.views)
    seen = observations_of(views, capture.board)
    free = free_parameters(model)
    if len(views) < 3 or 2 * len(seen.pixels) <= free.sum() + 6 * len(views):
        hint = "show the board from at least 12 sides, tilted and near the corners of the image"
        raise CalibrationError(f"{len(views)} views of the board are too few for {model}", hint=hint)
    start, starts = _best_start(model, capture, seen, free)
    plain = adjust(start, seen, free=free)
    rejected: dict[str, str] = {}
    corners, fit, kept, allowed = 0, plain, seen, int(_MOST_REJECTED * len(views))
    for _ in range(_ROUNDS):
        fit = adjust(fit, kept, free=free, huber_px=3 * robust_sigma(fit))
        bad_corners = _bad_corners(fit, kept)
        bad_views = _bad_views(fit, kept, ~bad_corners, allowed - len(rejected))
        if not bad_views and not bad_corners.any():
            break
        rejected |= {views[i].name: why for i, why in bad_views.items()}
        good = np.array([i for i in range(len(views)) if i not in bad_views])
        corners += int((bad_corners & np.isin(kept.views, good)).sum())
        fit, kept = _without(fit, kept, good, bad_corners)
        views = [views[i] for i in good]
    fit = adjust(fit, kept, free=free, huber_px=3 * robust_sigma(fit))
    return Intrinsics(
        model,
        free,
        tuple(views),
        kept,
        fit,
        plain,
        rejected,
        corners,
        robust_sigma(fit),
        camera_spread(fit, kept, free, robust_sigma(fit)),
        naive_covariance(normal_equations(fit, kept, free), fit, free),
        starts,
    )


def free_parameters(model: str) -> BoolArray:
    """(4 + n,) which of fx, fy, cx, cy, D a model of MODELS estimates."""
    chosen = MODELS[model]
    return np.array([True] * 4 + [name in chosen.estimated for name in CAMERAS[chosen.lens].coefficients])


def fit_cameras(model: str, capture: Capture, seen: Observations, *, near: Camera | None = None) -> Fit:
    """A robust fit without rejection, for judging models and halves of the data against each other.

    Args:
        near: the only start, where one is known (the camera of all views, for most of them); None: several.
    """
    free = free_parameters(model)
    start = first_fit(near, seen) if near is not None else None
    if start is None or not np.isfinite(start.cost):
        start, _ = _best_start(model, capture, seen, free)
    else:
        start = adjust(start, seen, free=free, least_drop=_JUDGING_DROP)
    return adjust(start, seen, free=free, huber_px=3 * max(robust_sigma(start), 1e-6), least_drop=_JUDGING_DROP)


def held_out_residuals(camera: Camera, seen: Observations) -> Float64Array | None:
    """(N, 2) residuals [px] of corners the camera was not fitted to; only the board's poses are. None without any."""
    start = first_fit(camera, seen)
    if start is None:
        return None
    return adjust(
        start, seen, free=np.zeros(4 + len(camera.D), dtype=bool), max_iterations=100, least_drop=_JUDGING_DROP
    ).residuals


def robust_sigma(fit: Fit) -> float:
    """1.4826 times the median absolute residual coordinate [px]."""
    return float(_SIGMA_PER_MAD * np.median(np.abs(fit.residuals)))


def rms_by_view(fit: Fit, seen: Observations) -> Float64Array:
    """(G,) root of the mean squared distance of each view's corners [px]."""
    squared = (fit.residuals**2).sum(axis=1)
    return np.sqrt(np.bincount(seen.views, squared, seen.count) / np.bincount(seen.views, minlength=seen.count))


# ----------------------------------------------------------------------------------------------------------- starts


def _best_start(model: str, capture: Capture, seen: Observations, free: BoolArray) -> tuple[Fit, dict[str, float]]:
    """The best of several focal lengths after 50 iterations, and what each reached.

    A rational model starts from a converged plumb_bob, whose optimum lies in its valley.
    """
    lens = MODELS[model].lens
    fits: dict[str, Fit] = {}
    for name, focal_px in _focal_guesses(capture, seen).items():
        start = first_fit(
            _plain_camera("equidistant" if lens == "equidistant" else "plumb_bob", focal_px, capture), seen
        )
        if start is None or not np.isfinite(start.cost):
            continue
        first = free if lens != "rational_polynomial" else free_parameters("plumb_bob")
        found = adjust(start, seen, free=first, max_iterations=_START_ITERATIONS)
        if np.isfinite(found.cost):
            fits[name] = found
    if not fits:
        hint = "check that the board and its numbers of rows and columns are those in the pictures"
        raise CalibrationError("no focal length explains the corners", hint=hint)
    best = min(fits.values(), key=lambda fit: fit.cost)
    if lens == "rational_polynomial":
        wider = _as_rational(best.camera)
        best = adjust(Fit(wider, best.poses, best.residuals, best.weights, best.cost, 0, False), seen, free=free)
    return best, {name: fit.rms_px for name, fit in fits.items()}


def _focal_guesses(capture: Capture, seen: Observations) -> dict[str, float]:
    guesses = {f"{share:g} x width": share * capture.width for share in _GUESSES}
    vanishing = _focal_from_homographies(capture, seen)
    return {"vanishing points": vanishing, **guesses} if vanishing else guesses


def _focal_from_homographies(capture: Capture, seen: Observations) -> float | None:
    """One focal length from the right angles of the boards (Zhang, PAMI 2000, eq. 3 and 4; principal point in the middle).

    None when the boards all stand straight before the camera, where nothing vanishes.
    """
    middle, top, bottom = np.array([(capture.width - 1) / 2, (capture.height - 1) / 2]), 0.0, 0.0
    for view in range(seen.count):
        rows = seen.views == view
        H = homography(seen.points[rows, :2], (seen.pixels[rows] - middle) / capture.width)
        a, b = H[:, 0] / np.linalg.norm(H[:, 0]), H[:, 1] / np.linalg.norm(H[:, 1])
        # right angle and equal lengths with diag(1/f^2, 1/f^2, 1) between: plane + f^2 depth = 0, in least squares
        plane = np.array([a[:2] @ b[:2], a[:2] @ a[:2] - b[:2] @ b[:2]])
        depth = np.array([a[2] * b[2], a[2] ** 2 - b[2] ** 2])
        top -= float(plane @ depth)
        bottom += float(depth @ depth)
    share2 = top / bottom if bottom > 0 else -1.0
    return float(np.sqrt(share2) * capture.width) if 0.04 < share2 < 25 else None


def _plain_camera(lens: str, focal_px: float, capture: Capture) -> Camera:
    K = np.array([[focal_px, 0, (capture.width - 1) / 2], [0, focal_px, (capture.height - 1) / 2], [0, 0, 1]])
    D = np.zeros(len(CAMERAS[lens].coefficients))
    return Camera(lens, capture.width, capture.height, K, D, capture.camera_name, capture.frame)


def _as_rational(camera: Camera) -> Camera:
    D = np.concatenate([camera.D, np.zeros(3)])
    return Camera("rational_polynomial", camera.width, camera.height, camera.K, D, camera.name, camera.frame)


# -------------------------------------------------------------------------------------------------------- rejection


def _bad_views(fit: Fit, seen: Observations, good: BoolArray, allowed: int) -> dict[int, str]:
    """Views far worse than the others by their good corners -> why; the worst first, no more than allowed."""
    squared = np.where(good, (fit.residuals**2).sum(axis=1), 0.0)
    counts = np.bincount(seen.views, good, seen.count)
    rms = np.sqrt(np.bincount(seen.views, squared, seen.count) / np.maximum(counts, 1))
    middle = float(np.median(rms))
    spread = _SIGMA_PER_MAD * float(np.median(np.abs(rms - middle)))
    z = (rms - middle) / max(spread, 0.1 * middle, 1e-9)
    worst = [
        int(i) for i in np.argsort(-rms, kind="stable") if rms[i] > _VIEW_RMS_FACTOR * middle or z[i] > _VIEW_MAD_Z
    ]
    return {i: f"RMS {rms[i]:.3f} px, the median is {middle:.3f} px" for i in worst[: max(0, allowed)]}


def _bad_corners(fit: Fit, seen: Observations) -> BoolArray:
    """(N,) corners farther than 5 sigma, in at most a quarter of a view's corners."""
    distance = np.hypot(fit.residuals[:, 0], fit.residuals[:, 1])
    bad = distance > _CORNER_SIGMAS * max(robust_sigma(fit), 1e-6)
    shares = np.bincount(seen.views, bad, seen.count) / np.bincount(seen.views, minlength=seen.count)
    return np.asarray(bad & (shares <= _MOST_REJECTED)[seen.views])


def _without(fit: Fit, seen: Observations, good: Int64Array, bad: BoolArray) -> tuple[Fit, Observations]:
    kept = Observations(seen.points[~bad], seen.pixels[~bad], seen.views[~bad]).of_views(good)
    rows = ~bad & np.isin(seen.views, good)
    poses = fit.poses[good]
    return Fit(fit.camera, poses, fit.residuals[rows], fit.weights[rows], fit.cost, 0, False), kept


MODELS: Mapping[str, Model] = {
    "k1k2": Model("plumb_bob", ("k1", "k2")),
    "radtan": Model("plumb_bob", ("k1", "k2", "p1", "p2")),
    "plumb_bob": Model("plumb_bob", ("k1", "k2", "p1", "p2", "k3")),
    "rational_polynomial": Model("rational_polynomial", CAMERAS["rational_polynomial"].coefficients),
    "equidistant": Model("equidistant", CAMERAS["equidistant"].coefficients),
}
