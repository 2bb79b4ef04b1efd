"""True poses -> what wheel odometry claims: noise per step, wheels of the wrong size, slip, and encoder ticks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wallkit.core.config import setting
from wallkit.core.geometry import compose, relative, wrap_angle
from wallkit.core.types import Float64Array

ALPHAS = ("alpha1", "alpha2", "alpha3", "alpha4")
# a shorter step says nothing of its direction
_SHORT_M = 0.01


@dataclass(frozen=True)
class WheelOdometry:
    """How odometry errs; all zero: it does not.

    The alphas are those of Probabilistic Robotics (2005), table 5.6, and hold per step of the odometry's own rate.
    """

    alpha1: float = setting(0.02, "turn noise per turn [rad2 per rad2]", low=0)
    alpha2: float = setting(0.002, "turn noise per way [rad2 per m2]", low=0)
    alpha3: float = setting(0.01, "way noise per way [m2 per m2]", low=0)
    alpha4: float = setting(0.002, "way noise per turn [m2 per rad2]", low=0)
    radius_error: float = setting(0.005, "both wheels are larger than believed, relative", low=-0.5, high=0.5)
    difference_error: float = setting(
        0.001, "the right wheel is larger than the left one, relative", low=-0.5, high=0.5
    )
    baseline_m: float = setting(0.35, "distance of the wheels", low=0.05, high=3)
    baseline_error: float = setting(0.01, "the wheels are farther apart than believed, relative", low=-0.5, high=0.5)
    slips_per_minute: float = setting(0.0, "how often the wheels spin without moving the robot", low=0)
    slip_m: float = setting(0.05, "way that a slip claims", low=0)
    slip_rad: float = setting(0.05, "turn that a slip claims, either way", low=0)
    tick_m: float = setting(0.0, "way of a wheel per encoder tick; 0: exact", low=0)


def odometry_of(rng: np.random.Generator, odometry: WheelOdometry, poses: Float64Array, rate_hz: float) -> Float64Array:
    """T_odom_base (T, 3) claimed of true T_map_base (T, 3) at a rate; it begins at the origin."""
    steps = relative(poses[:-1], poses[1:])
    steps = _with_wheels(rng, odometry, _noisy(rng, odometry, steps), rate_hz)
    claimed = np.empty_like(poses)
    claimed[0] = at = np.zeros(3)
    for k, step in enumerate(steps, start=1):
        claimed[k] = at = compose(at, step)
    return claimed


def decomposed(steps: Float64Array) -> tuple[Float64Array, Float64Array, Float64Array]:
    """(rot1, trans, rot2), each (T,), of relative poses (T, 3): turn towards, go, turn (table 5.6)."""
    trans = np.hypot(steps[:, 0], steps[:, 1])
    rot1 = np.where(trans > 1e-9, np.arctan2(steps[:, 1], steps[:, 0]), 0.0)
    return rot1, trans, np.asarray(wrap_angle(steps[:, 2] - rot1))


def fitted_alphas(truth: Float64Array, claimed: Float64Array) -> tuple[Float64Array, Float64Array]:
    """alpha1..4 (4,) and their sigma (4,) that explain claimed steps (T, 3) of true steps (T, 3), by maximum likelihood.

    Each squared error is its variance times chi-square with one degree of freedom, and variances are linear in the alphas:
    weighted least squares, the weights from the fit before, until they stay.
    """
    from scipy.optimize import nnls

    rows, squares = _variance_rows(truth, claimed)
    alphas = np.full(4, 0.01)
    for _ in range(50):
        weights = 1 / np.maximum(rows @ alphas, 1e-12)
        found, _ = nnls(rows * weights[:, None], squares * weights)
        if np.allclose(found, alphas, rtol=1e-9, atol=1e-15):
            break
        alphas = found
    weights = 1 / np.maximum(rows @ alphas, 1e-12)
    information = (rows * weights[:, None] ** 2).T @ rows / 2
    return alphas, np.sqrt(np.diag(np.linalg.pinv(information)))


# -------------------------------------------------------------------------------------------- details


def _noisy(rng: np.random.Generator, odometry: WheelOdometry, steps: Float64Array) -> Float64Array:
    rot1, trans, rot2 = decomposed(steps)
    t1, t2 = _turned(rot1), _turned(rot2)
    a1, a2, a3, a4 = (getattr(odometry, name) for name in ALPHAS)
    noise = rng.standard_normal((3, len(steps)))
    rot1 = rot1 + noise[0] * np.sqrt(a1 * t1**2 + a2 * trans**2)
    trans_claimed = trans + noise[1] * np.sqrt(a3 * trans**2 + a4 * (t1**2 + t2**2))
    rot2 = rot2 + noise[2] * np.sqrt(a1 * t2**2 + a2 * trans**2)
    return np.column_stack([trans_claimed * np.cos(rot1), trans_claimed * np.sin(rot1), rot1 + rot2])


def _turned(rot: Float64Array) -> Float64Array:
    """Turn (T,) of a step; driving backwards is no turn."""
    return np.minimum(np.abs(rot), np.pi - np.abs(rot))


def _with_wheels(
    rng: np.random.Generator, odometry: WheelOdometry, steps: Float64Array, rate_hz: float
) -> Float64Array:
    """What the wheels make of steps (T, 3): sizes believed wrongly, slip, ticks."""
    base = odometry.baseline_m
    # x of the robot's frame is driven; what goes sideways (noise) stays
    way, turn = steps[:, 0], steps[:, 2]
    left, right = way - turn * base / 2, way + turn * base / 2
    left = left / (1 + odometry.radius_error - odometry.difference_error / 2)
    right = right / (1 + odometry.radius_error + odometry.difference_error / 2)
    slips = rng.random(len(steps)) < odometry.slips_per_minute / 60 / rate_hz
    sides = rng.choice([-1.0, 1.0], len(steps))
    left = left + slips * (odometry.slip_m - sides * odometry.slip_rad * base / 2)
    right = right + slips * (odometry.slip_m + sides * odometry.slip_rad * base / 2)
    if odometry.tick_m > 0:
        left, right = (
            np.diff(np.floor(np.cumsum(w) / odometry.tick_m), prepend=0) * odometry.tick_m for w in (left, right)
        )
    believed = base / (1 + odometry.baseline_error)
    return np.column_stack([(left + right) / 2, steps[:, 1], (right - left) / believed])


def _variance_rows(truth: Float64Array, claimed: Float64Array) -> tuple[Float64Array, Float64Array]:
    """(R, 4) what each alpha adds to the variance of each error, and (R,) the squared errors.

    Errors along and across the true direction instead of those of (rot1, trans, rot2): where a step is short, noise turns
    its claimed direction round, and the decomposition tells of another motion.
    """
    rot1, trans, rot2 = decomposed(truth)
    c, s = np.cos(rot1), np.sin(rot1)
    along = c * claimed[:, 0] + s * claimed[:, 1] - trans
    across = -s * claimed[:, 0] + c * claimed[:, 1]
    turn = wrap_angle(claimed[:, 2] - truth[:, 2])
    t1, t2, zero = _turned(rot1), _turned(rot2), np.zeros_like(trans)
    goes = trans > _SHORT_M
    rows = np.concatenate(
        [
            np.column_stack([zero, zero, trans**2, t1**2 + t2**2]),
            np.column_stack([t1**2, trans**2, zero, zero])[goes],
            np.column_stack([t1**2 + t2**2, 2 * trans**2, zero, zero]),
        ]
    )
    squares = np.concatenate([along, across[goes] / trans[goes], turn]) ** 2
    tells = rows.sum(axis=1) > 1e-9
    return rows[tells], squares[tells]
