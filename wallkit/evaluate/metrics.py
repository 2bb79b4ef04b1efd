"""An estimate and the truth at the same moments -> named numbers with unit and definition.

Definitions are evo's (Grupp, evo: Python package for the evaluation of odometry and SLAM, 2017), which follow Sturm et
al. (2012) and Kuemmerle et al. (2009); a test calls evo and compares. A localizer's error is unaligned: aligning first
would hide an error of the map frame, so the aligned numbers only stand beside it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from wallkit.core.geometry import compose, relative, wrap_angle
from wallkit.core.results import Errors, Value
from wallkit.core.types import Float64Array, Int64Array
from wallkit.evaluate.associate import Pairs

Statistic = Callable[[Float64Array], float]


@dataclass(frozen=True, slots=True)
class Series:
    """Errors (E,) at the pairs `at` (E,), in a unit; several statistics are taken of one series."""

    errors: Float64Array
    at: Int64Array
    unit: str


@dataclass(frozen=True, slots=True)
class Metric:
    """One named number; `compute` gives None where the pairs do not have it."""

    unit: str
    definition: str
    compute: Callable[[Pairs], float | None]
    better: Literal["lower", "higher", ""] = "lower"


def measure(pairs: Pairs) -> dict[str, Value]:
    """Every metric of the pairs by key, unaligned first; a number that does not exist for these pairs is None."""
    return {key: Value(key, m.compute(pairs), m.unit, m.definition, m.better) for key, m in METRICS.items()}


def errors_from_pairs(pairs: Pairs) -> Errors:
    """Position and heading error at each pair."""
    return Errors(pairs.stamps_ns, pairs.rows, ate(pairs).errors, heading(pairs).errors)


# ------------------------------------------------------------------------------------------------ error series


def ate(pairs: Pairs) -> Series:
    """Absolute trajectory error, unaligned: distance between estimate and truth [m]."""
    return Series(_distances(pairs.estimate, pairs.truth), np.arange(len(pairs)), "m")


def ate_aligned(pairs: Pairs) -> Series | None:
    """Absolute trajectory error after the best rigid motion of the whole estimate; None if the robot stood still."""
    motion = align(pairs.estimate, pairs.truth)
    if motion is None:
        return None
    return Series(_distances(compose(motion, pairs.estimate), pairs.truth), np.arange(len(pairs)), "m")


def heading(pairs: Pairs) -> Series:
    """Absolute difference of the headings, unaligned [deg]."""
    turn = wrap_angle(pairs.estimate[:, 2] - pairs.truth[:, 2])
    return Series(np.rad2deg(np.abs(turn)), np.arange(len(pairs)), "deg")


def rpe_translation(pairs: Pairs, starts: Int64Array, ends: Int64Array) -> Series | None:
    """Relative pose error: position part of the difference of the motions from start to end [m]; None without one."""
    return Series(np.hypot(*_relative_errors(pairs, starts, ends)[:, :2].T), ends, "m") if len(ends) else None


def rpe_rotation(pairs: Pairs, starts: Int64Array, ends: Int64Array) -> Series | None:
    """Relative pose error: heading part of the difference of the motions from start to end [deg]; None without one."""
    return Series(np.rad2deg(np.abs(_relative_errors(pairs, starts, ends)[:, 2])), ends, "deg") if len(ends) else None


def per_metre(pairs: Pairs, *, distance_m: float = 1.0) -> tuple[Int64Array, Int64Array]:
    """Rows that cut the estimate's path into consecutive pieces of at least the distance, as starts and ends."""
    cuts, travelled_m = [0], 0.0
    for row, step_m in enumerate(_distances(pairs.estimate[1:], pairs.estimate[:-1]).tolist(), start=1):
        # summed anew after each cut, as evo does: a running total would round differently and cut elsewhere
        travelled_m += step_m
        if travelled_m >= distance_m:
            cuts.append(row)
            travelled_m = 0.0
    return np.array(cuts[:-1], dtype=np.int64), np.array(cuts[1:], dtype=np.int64)


def per_update(pairs: Pairs) -> tuple[Int64Array, Int64Array]:
    """Each row and the next."""
    rows = np.arange(len(pairs))
    return rows[:-1], rows[1:]


def align(estimate: Float64Array, truth: Float64Array) -> Float64Array | None:
    """Rigid motion (3,) that moves the estimate's positions closest to the truth's, in least squares and without scale.

    The planar closed form of Umeyama (1991): the turn is the angle of the summed cross and dot products of the centred
    positions. None when that sum vanishes (the robot stood still), since every turn is then as good.
    """
    a, b = estimate[:, :2], truth[:, :2]
    a0, b0 = a - a.mean(axis=0), b - b.mean(axis=0)
    dot, cross = float((a0 * b0).sum()), float((a0[:, 0] * b0[:, 1] - a0[:, 1] * b0[:, 0]).sum())
    if np.hypot(dot, cross) < 1e-9:
        return None
    yaw = np.arctan2(cross, dot)
    c, s = np.cos(yaw), np.sin(yaw)
    shift = b.mean(axis=0) - np.array([[c, -s], [s, c]]) @ a.mean(axis=0)
    return np.array([shift[0], shift[1], yaw])


def _distances(a: Float64Array, b: Float64Array) -> Float64Array:
    return np.hypot(a[:, 0] - b[:, 0], a[:, 1] - b[:, 1])


def _relative_errors(pairs: Pairs, starts: Int64Array, ends: Int64Array) -> Float64Array:
    done = relative(pairs.truth[starts], pairs.truth[ends])
    claimed = relative(pairs.estimate[starts], pairs.estimate[ends])
    return relative(done, claimed)


# ------------------------------------------------------------------------------------------------ statistics


def rmse(errors: Float64Array) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(errors**2)))


def mean(errors: Float64Array) -> float:
    """Arithmetic mean."""
    return float(np.mean(errors))


def median(errors: Float64Array) -> float:
    """Middle value."""
    return float(np.median(errors))


def sd(errors: Float64Array) -> float:
    """Standard deviation of the errors themselves (divided by their number)."""
    return float(np.std(errors))


def largest(errors: Float64Array) -> float:
    """Largest error."""
    return float(np.max(errors))


def _path_length(pairs: Pairs) -> float:
    return float(_distances(pairs.truth[1:], pairs.truth[:-1]).sum())


# Series that evo can be handed, by name; a metric is one statistic of one of them.
SERIES: Mapping[str, Callable[[Pairs], Series | None]] = {
    "ate": ate,
    "ate_aligned": ate_aligned,
    "heading": heading,
    "rpe_1m": lambda pairs: rpe_translation(pairs, *per_metre(pairs)),
    "rpe_1m_heading": lambda pairs: rpe_rotation(pairs, *per_metre(pairs)),
    "rpe_update": lambda pairs: rpe_translation(pairs, *per_update(pairs)),
    "rpe_update_heading": lambda pairs: rpe_rotation(pairs, *per_update(pairs)),
}


def _of(name: str, statistic: Statistic) -> Callable[[Pairs], float | None]:
    def compute(pairs: Pairs) -> float | None:
        series = SERIES[name](pairs)
        return None if series is None else statistic(series.errors)

    return compute


_ALIGNED = "the same after moving the whole estimate rigidly onto the truth"
_METRE = "over consecutive pieces of path of 1 m"

METRICS: Mapping[str, Metric] = {
    "ate_rmse_m": Metric("m", "root mean square distance between estimate and truth, unaligned", _of("ate", rmse)),
    "ate_median_m": Metric("m", "median distance between estimate and truth, unaligned", _of("ate", median)),
    "ate_max_m": Metric("m", "largest distance between estimate and truth, unaligned", _of("ate", largest)),
    "error_mean_m": Metric("m", "mean distance between estimate and truth, unaligned", _of("ate", mean)),
    "error_sd_m": Metric("m", "standard deviation of that distance", _of("ate", sd)),
    "heading_error_mean_deg": Metric("deg", "mean absolute difference of the headings", _of("heading", mean)),
    "heading_error_median_deg": Metric("deg", "median absolute difference of the headings", _of("heading", median)),
    "heading_error_rmse_deg": Metric("deg", "root mean square difference of the headings", _of("heading", rmse)),
    "heading_error_max_deg": Metric("deg", "largest absolute difference of the headings", _of("heading", largest)),
    "ate_aligned_rmse_m": Metric("m", f"ate_rmse_m, {_ALIGNED}", _of("ate_aligned", rmse)),
    "ate_aligned_median_m": Metric("m", f"ate_median_m, {_ALIGNED}", _of("ate_aligned", median)),
    "ate_aligned_max_m": Metric("m", f"ate_max_m, {_ALIGNED}", _of("ate_aligned", largest)),
    "error_aligned_mean_m": Metric("m", f"error_mean_m, {_ALIGNED}", _of("ate_aligned", mean)),
    "error_aligned_sd_m": Metric("m", f"error_sd_m, {_ALIGNED}", _of("ate_aligned", sd)),
    "rpe_1m_rmse_m": Metric("m", f"root mean square motion error {_METRE}", _of("rpe_1m", rmse)),
    "rpe_1m_max_m": Metric("m", f"largest motion error {_METRE}", _of("rpe_1m", largest)),
    "rpe_1m_heading_rmse_deg": Metric("deg", f"root mean square turn error {_METRE}", _of("rpe_1m_heading", rmse)),
    "rpe_update_rmse_m": Metric("m", "root mean square motion error between updates", _of("rpe_update", rmse)),
    "rpe_update_max_m": Metric("m", "largest motion error between updates", _of("rpe_update", largest)),
    "rpe_update_heading_rmse_deg": Metric(
        "deg", "root mean square turn error between updates", _of("rpe_update_heading", rmse)
    ),
    "path_length_m": Metric("m", "length of the true path over the compared updates", _path_length, better=""),
}
