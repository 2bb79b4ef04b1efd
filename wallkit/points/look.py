"""LiDAR points and one segmented image -> what the image shows where each point may have landed in it.

A point's pixel is known to a few pixels only: the calibration errs, clocks differ, and whatever moves by itself has moved on
between the beam and the picture. So a class is asked for at the pixel and at six places on a circle around it that holds the
pixel with 95 % probability. In the shares the middle counts 0.666 and the circle the rest, which gives them the variance of
the Gaussian that the circle is the 95 % circle of.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numba import njit

from wallkit.core.calibration import Calibration
from wallkit.core.config import setting
from wallkit.core.geometry import relative
from wallkit.core.types import BoolArray, Float32Array, Float64Array, Frame, Int64Array, View
from wallkit.points.project import Projection, hidden, moved_to, project

# 95 % of a planar Gaussian lie within 2.448 sigma: 1 - 2 / 2.448^2 of the weight in the middle keeps the variance
_MIDDLE = 0.666
_RING = np.stack([np.cos(np.arange(6) * np.pi / 3), np.sin(np.arange(6) * np.pi / 3)], axis=-1)
_TO_95 = 1.96

# pixels (M, 2) -> class (M,) int64 or -1, and confidence (M,) float32
ClassesAt = Callable[[Float64Array], tuple[Int64Array, Float32Array]]


@dataclass(frozen=True)
class LookSettings:
    """How sure it is where a point lands in the image, and whether it is seen there at all."""

    lookup: Literal["pixels", "crossing_number", "winding_number", "even_odd", "mask"] = setting(
        "pixels", "what says the class at a pixel: the model itself, or which of its polygons holds it, and how"
    )
    margins: float = setting(1.0, "how far the error of a pixel counts; 0: the pixel itself decides", low=0)
    unknown_error_px: float = setting(3.0, "95 % pixel error where the calibration does not say its own", low=0)
    time_sigma_s: float = setting(0.002, "sigma of the time offset where the calibration does not say its own", low=0)
    moving_m_s: float = setting(0.5, "what moves by itself may have moved so fast between beam and image", low=0)
    margin_max_px: float = setting(40.0, "no point's margin is larger", low=0)
    hidden_px: float = setting(6.0, "3-D clouds: points so near in the image are on one line of sight", low=0.5)
    hidden_m: float = setting(0.15, "3-D clouds: a point so much nearer hides the one behind it", low=0)
    hidden_per_m: float = setting(0.05, "3-D clouds: and so much more per metre of depth", low=0)


@dataclass(frozen=True, eq=False)
class Look:
    """What one image says about the points of a frame, in their order.

    Attributes:
        projection: where they land in the image.
        is_seen: (K,) on the image and not behind something else.
        margins_px: (K,) radius that holds the true pixel with 95 %.
        labels: (K,) int64 class that most of that circle shows; -1 where nobody can tell or it is not seen.
        confidences: (K,) float32 of that class. shares: (K, C) float32, see BeamLabels.
    """

    projection: Projection
    is_seen: BoolArray
    margins_px: Float64Array
    labels: Int64Array
    confidences: Float32Array
    shares: Float32Array


def project_frame(
    calibration: Calibration, frame: Frame, view: View, T_lidar_base: Float64Array, settings: LookSettings
) -> tuple[Projection, BoolArray, Float64Array]:
    """Where a frame's points land in an image taken at another moment, which are seen, and how far off they may be [px].

    A point is moved to the image's moment by odometry: it was measured at one time, and moved to the scan's stamp already.
    """
    motion = relative(view.odometry, frame.odometry)
    points = frame.points
    projection = project(calibration, moved_to(points.xyz_m, motion, T_lidar_base), allow_unverified=True)
    is_seen = projection.is_inside
    if frame.cloud_m is not None:
        cloud = project(calibration, moved_to(frame.cloud_m, motion, T_lidar_base), allow_unverified=True)
        is_seen = is_seen & ~hidden(
            projection,
            cloud,
            reach_px=settings.hidden_px,
            margin_m=settings.hidden_m,
            margin_per_m=settings.hidden_per_m,
        )
    return projection, is_seen, _margins_px(calibration, frame, view, projection, settings)


def look(
    located: tuple[Projection, BoolArray, Float64Array], classes_at: ClassesAt, class_of: Int64Array, count: int
) -> Look:
    """What an image shows where points land in it.

    Args:
        located: of `project_frame`. classes_at: of a Segmentation.
        class_of: (N + 1,) from the model's classes to ours (0 ... count - 1); the last for its -1.
    """
    projection, is_seen, margins = located
    seen = np.flatnonzero(is_seen)
    total = len(is_seen)
    labels, confidences = np.full(total, -1), np.zeros(total, dtype=np.float32)
    shares = np.zeros((total, count), dtype=np.float32)
    if len(seen):
        middles = projection.pixels[seen]
        places = middles[None] if not margins[seen].any() else _places(middles, margins[seen])
        found, sure = classes_at(places.reshape(-1, 2))
        classes = class_of[found].reshape(len(places), -1)
        _share_out(classes, sure.reshape(classes.shape), seen, _MIDDLE, labels, confidences, shares)
    return Look(projection, is_seen, margins, labels, confidences, shares)


def _places(middles: Float64Array, margins: Float64Array) -> Float64Array:
    """(7, M, 2) the pixels and six around each."""
    return np.concatenate([middles[None], middles[None] + _RING[:, None] * margins[None, :, None]])


def _margins_px(
    calibration: Calibration, frame: Frame, view: View, projection: Projection, settings: LookSettings
) -> Float64Array:
    """(K,) radius of the circle that holds a point's true pixel with 95 %: calibration, clocks and own motion together."""
    points, count = frame.points, len(projection.depths_m)
    if settings.margins == 0 or not count:
        return np.zeros(count)
    known = calibration.pixel_error_95_at(points.ranges_m)
    of_calibration = np.where(np.isfinite(known), known, settings.unknown_error_px)
    focal, depths = float(calibration.camera.K[0, 0]), np.maximum(projection.depths_m, 0.1)
    taken_s = points.offsets_s if points.offsets_s is not None else np.zeros(count, dtype=np.float32)
    apart_s = np.abs(taken_s - (view.moment_ns - frame.stamp_ns) * 1e-9)
    of_motion = focal * settings.moving_m_s * apart_s / depths
    sigma_ns = calibration.time_offset_sigma_ns
    sigma_s = settings.time_sigma_s if sigma_ns is None else sigma_ns * 1e-9
    of_clock = _TO_95 * sigma_s * focal * (view.turn_rad_s + view.speed_m_s / depths)
    total = np.sqrt(of_calibration**2 + of_motion**2 + of_clock**2)
    return np.asarray(np.minimum(settings.margins * total, settings.margin_max_px))


@njit(cache=True, nogil=True)
def _share_out(classes: Any, sure: Any, seen: Any, middle: Any, labels: Any, confidences: Any, shares: Any) -> None:
    """Of classes (S, M), the middles first: shares (K, C) by weight, the largest as label, its mean confidence."""
    samples, count = classes.shape
    around = (1.0 - middle) / (samples - 1) if samples > 1 else 0.0
    first = middle if samples > 1 else 1.0
    for m in range(count):
        k, known = seen[m], 0.0
        for s in range(samples):
            c = classes[s, m]
            if c >= 0:
                weight = first if s == 0 else around
                shares[k, c] += weight
                known += weight
        if known == 0.0:
            continue
        best = 0
        for c in range(shares.shape[1]):
            shares[k, c] /= known
            if shares[k, c] > shares[k, best]:
                best = c
        labels[k] = best
        total, weights = 0.0, 0.0
        for s in range(samples):
            if classes[s, m] == best:
                weight = first if s == 0 else around
                total += weight * sure[s, m]
                weights += weight
        confidences[k] = total / weights
