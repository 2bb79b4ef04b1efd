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
from wallkit.core.geometry import matrix_from_pose, relative
from wallkit.core.projection import project_points
from wallkit.core.types import BoolArray, Float32Array, Float64Array, Frame, Int64Array, View
from wallkit.points.occlusion import hidden
from wallkit.points.project import Projection

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
    returns: int = setting(
        240, "so many returns of a scan, spread over it, are looked up, and only they count; 0: all", low=0
    )
    margins: float = setting(1.0, "how far the error of a pixel counts; 0: the pixel itself decides", low=0)
    unknown_error_px: float = setting(3.0, "95 % pixel error where the calibration does not say its own", low=0)
    time_sigma_s: float = setting(0.002, "sigma of the time offset where the calibration does not say its own", low=0)
    moving_m_s: float = setting(0.5, "what moves by itself may have moved so fast between beam and image", low=0)
    margin_max_px: float = setting(40.0, "no point's margin is larger", low=0)
    field_of_view_deg: float = setting(
        0.0, "returns farther to the side than half of it count as not seen; 0: the whole image", low=0, high=360
    )
    hidden_deg: float = setting(
        1.2,
        "3-D clouds: points so near in direction are on one line of sight; half the angle between rings or more",
        low=0.1,
    )
    hidden_m: float = setting(0.1, "3-D clouds: what is not so much nearer hides nothing", low=0.01)
    hidden_slant_deg: float = setting(
        85.0, "3-D clouds: a surface seen at up to this angle to its normal hides nothing of itself", low=0, high=90
    )


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
    assert calibration.T_camera_lidar is not None  # check_usable
    T = calibration.T_camera_lidar @ T_lidar_base @ matrix_from_pose(relative(view.odometry, frame.odometry))
    projection = Projection(*project_points(calibration.camera, T, frame.points.xyz_m))
    is_seen = projection.is_inside
    if settings.field_of_view_deg:
        is_seen = is_seen & _in_view(T, frame.points.xyz_m, settings.field_of_view_deg)
    if frame.cloud_m is not None:
        near = {"reach_deg": settings.hidden_deg, "margin_m": settings.hidden_m, "slant_deg": settings.hidden_slant_deg}
        is_seen = is_seen & ~hidden(calibration.camera, T, frame.points.xyz_m, frame.cloud_m, **near)
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
        samples = 1 + len(_RING) if margins.any() else 1
        places = np.empty((samples, len(seen), 2))
        _place(projection.pixels, margins, seen, _RING, places)
        found, sure = classes_at(places.reshape(-1, 2))
        _share_out(found, sure, class_of, seen, samples, _MIDDLE, labels, confidences, shares)
    return Look(projection, is_seen, margins, labels, confidences, shares)


def _in_view(T: Float64Array, xyz_m: Float32Array, field_of_view_deg: float) -> BoolArray:
    """(K,) points (K, 3), which T (4, 4) moves to the camera, that are not too far to its side."""
    x, z = (xyz_m @ T[row, :3] + T[row, 3] for row in (0, 2))
    return np.asarray(np.abs(np.arctan2(x, z)) <= np.deg2rad(field_of_view_deg) / 2)


def _margins_px(
    calibration: Calibration, frame: Frame, view: View, projection: Projection, settings: LookSettings
) -> Float64Array:
    """(K,) radius of the circle that holds a point's true pixel with 95 %: calibration, clocks and own motion together."""
    points, count = frame.points, len(projection.depths_m)
    margins = np.zeros(count)
    if settings.margins == 0 or not count:
        return margins
    table, taken_s = calibration.pixel_error_95, points.offsets_s
    if table is None:
        table = np.array([[1.0, settings.unknown_error_px]] * 2)
        nearest_m = 0.0
    else:
        nearest_m = float(table[0, 0])
    sigma_ns = calibration.time_offset_sigma_ns
    clock_s = _TO_95 * (settings.time_sigma_s if sigma_ns is None else sigma_ns * 1e-9)
    focal = float(calibration.camera.K[0, 0])
    image_s = (view.moment_ns - frame.stamp_ns) * 1e-9
    numbers = (focal, image_s, settings.moving_m_s, clock_s * view.turn_rad_s, clock_s * view.speed_m_s, nearest_m,
               settings.margins, settings.margin_max_px)  # fmt: skip
    times = taken_s if taken_s is not None else np.zeros(0, dtype=np.float32)
    _add_up(points.ranges_m, times, projection.depths_m, 1 / table[::-1, 0], table[::-1, 1].copy(), numbers, margins)
    return margins


@njit(cache=True, nogil=True)
def _add_up(ranges: Any, times: Any, depths: Any, inverse: Any, errors: Any, numbers: Any, margins: Any) -> None:
    """margins[k] = how far off the pixel of return k may be, see _margins_px; the table is Calibration.pixel_error_95_at."""
    focal, image_s, moving, turned, driven, nearest, scale, most = numbers
    last = len(inverse) - 1
    for k in range(len(margins)):
        z = max(depths[k], 0.1)
        at = 1.0 / max(ranges[k], 1e-6)
        if ranges[k] < nearest:
            of_calibration = errors[last] * nearest * at
        else:
            i = 0
            while i < last and inverse[i + 1] < at:
                i += 1
            if i == last or at <= inverse[i]:
                of_calibration = errors[i]
            else:
                share = (at - inverse[i]) / (inverse[i + 1] - inverse[i])
                of_calibration = errors[i] + share * (errors[i + 1] - errors[i])
        taken = times[k] if len(times) else 0.0
        of_motion = focal * moving * abs(taken - image_s) / z
        of_clock = focal * (turned + driven / z)
        margins[k] = min(most, scale * np.sqrt(of_calibration**2 + of_motion**2 + of_clock**2))


@njit(cache=True, nogil=True)
def _place(pixels: Any, margins: Any, seen: Any, ring: Any, places: Any) -> None:
    """places (S, M, 2): the pixels of the points seen, and round each as many on its circle as `ring` has."""
    for m in range(len(seen)):
        k = seen[m]
        places[0, m, 0], places[0, m, 1] = pixels[k, 0], pixels[k, 1]
        for s in range(1, len(places)):
            places[s, m, 0] = pixels[k, 0] + margins[k] * ring[s - 1, 0]
            places[s, m, 1] = pixels[k, 1] + margins[k] * ring[s - 1, 1]


@njit(cache=True, nogil=True)
def _share_out(
    found: Any,
    sure: Any,
    class_of: Any,
    seen: Any,
    samples: int,
    middle: Any,
    labels: Any,
    confidences: Any,
    shares: Any,
) -> None:
    """Of what was found at (S * M) places, the middles first: shares (K, C) by weight, the largest as label, and how sure.

    class_of: from what is found to our classes, its last is for -1.
    """
    count = len(seen)
    around = (1.0 - middle) / (samples - 1) if samples > 1 else 0.0
    first = middle if samples > 1 else 1.0
    # of a class that all places show: the same sums as below, once
    whole, weights = np.zeros(1, dtype=np.float32), 0.0
    for s in range(samples):
        weight = first if s == 0 else around
        whole[0] += weight
        weights += weight
    whole[0] /= weights
    for m in range(count):
        k, known = seen[m], 0.0
        c, one = class_of[found[m]], True
        for s in range(1, samples):
            one &= found[s * count + m] == found[m]
        if one:
            if c >= 0:
                total = first * sure[m]
                for s in range(1, samples):
                    total += around * sure[s * count + m]
                shares[k, c], labels[k], confidences[k] = whole[0], c, total / weights
            continue
        for s in range(samples):
            c = class_of[found[s * count + m]]
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
        total, of_best = 0.0, 0.0
        for s in range(samples):
            if class_of[found[s * count + m]] == best:
                weight = first if s == 0 else around
                total += weight * sure[s * count + m]
                of_best += weight
        confidences[k] = total / of_best
