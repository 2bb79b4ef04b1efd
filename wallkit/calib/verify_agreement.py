"""Gates on agreement: with the robot's URDF, and with what the boards of this log say by themselves."""

from __future__ import annotations

import numpy as np

from wallkit.calib.evidence import Evidence, lidar_axes
from wallkit.calib.gates import Gate, not_asked
from wallkit.calib.observability import DEGREES_OF_FREEDOM
from wallkit.calib.solver import difference
from wallkit.calib.verify_limits import VerifyLimits
from wallkit.core.types import Float64Array

# 80 % power at 5 %, two-sided
_POWER = 2.8


def urdf_gate(evidence: Evidence, limits: VerifyLimits) -> Gate:
    """Whether the calibration and the URDF can both be right: chi-square of their difference, six degrees of freedom.

    It may only PASS where the calibration is sharp enough to have seen a difference that matters.
    """
    name, urdf, T = "agreement with the URDF, p", evidence.urdf, evidence.place
    if urdf is None or T is None:
        return not_asked(name, "no URDF was given" if urdf is None else "there is no transform")
    prior = f"prior {urdf.sigma_deg:g} deg, {urdf.sigma_mm:g} mm"
    covariance = _cautious(evidence, urdf.T, T)
    if covariance is None:
        return Gate(
            name, np.nan, "", f">= {limits.urdf_p:g}", "CANNOT TELL", "the calibration does not say how sure it is"
        )
    d = difference(urdf.T, T)
    trusted = np.diag(np.repeat([np.radians(urdf.sigma_deg), urdf.sigma_mm * 1e-3], 3) ** 2)
    p = _p_value(d, covariance + trusted)
    words = _axis_words(d, covariance + trusted)
    wanted, refused = (
        f">= {limits.urdf_p:g}",
        f"< {limits.urdf_bad_p:g} and > {limits.urdf_deg:g} deg or {limits.urdf_mm:g} mm",
    )
    basis = f"chi-square, {prior}"
    matters = np.degrees(np.abs(d[:3])).max() > limits.urdf_deg or 1e3 * np.abs(d[3:]).max() > limits.urdf_mm
    if p < limits.urdf_bad_p and matters:
        reason = f"the URDF disagrees: the boards put the LiDAR {words} from it ({prior})"
        return Gate(name, p, "", wanted, "FAIL", reason, refused, basis)
    if p < limits.urdf_p:
        reason = f"the URDF may disagree: the boards put the LiDAR {words} from it ({prior})"
        return Gate(name, p, "", wanted, "CANNOT TELL", reason, refused, basis)
    blind = _blind_axes(covariance, limits)
    if blind:
        sees = f"{limits.power_deg:g} deg or {limits.power_mm:g} mm"
        reason = f"nothing speaks against the URDF, but the boards could not show {sees} of {blind}"
        return Gate(name, p, "", wanted, "CANNOT TELL", reason, refused, basis)
    return Gate(name, p, "", wanted, "PASS", "", refused, basis)


def boards_gate(evidence: Evidence, limits: VerifyLimits) -> Gate:
    """Whether the calibration is where the boards of this log put the LiDAR by themselves."""
    name, T, fresh = "agreement with a fresh solve, p", evidence.place, evidence.fresh
    if T is None or fresh is None or fresh.covariance is None:
        return not_asked(name, "the views give no transform of their own")
    spread = lidar_axes(fresh.T, fresh.covariance)
    if evidence.calibration.covariance is not None and np.abs(fresh.T - T).max() > 1e-9:
        spread = spread + lidar_axes(T, evidence.calibration.covariance)
    d = difference(T, fresh.T)
    p = _p_value(d, spread, degrees=float(sum(fresh.used) - 6))
    words = _axis_words(d, spread)
    wanted, refused = (
        f">= {limits.urdf_p:g}",
        f"< {limits.urdf_bad_p:g} and > {limits.urdf_deg:g} deg or {limits.urdf_mm:g} mm",
    )
    basis = "F-test, both covariances"
    matters = np.degrees(np.abs(d[:3])).max() > limits.urdf_deg or 1e3 * np.abs(d[3:]).max() > limits.urdf_mm
    if p < limits.urdf_bad_p and matters:
        reason = f"the boards of this log put the LiDAR {words} from where the calibration has it"
        return Gate(name, p, "", wanted, "FAIL", reason, refused, basis)
    if p < limits.urdf_p and matters:
        reason = f"the boards of this log may put the LiDAR {words} from where the calibration has it"
        return Gate(name, p, "", wanted, "CANNOT TELL", reason, refused, basis)
    return Gate(name, p, "", wanted, "PASS", "", refused, basis)


def _cautious(evidence: Evidence, urdf: Float64Array, T: Float64Array) -> Float64Array | None:
    """(6, 6) LiDAR-axes covariance of the calibration: of the file's and the fresh one, which lets more pass."""
    d = difference(urdf, T)
    known = [c for c in (evidence.covariance, evidence.fresh.covariance if evidence.fresh else None) if c is not None]
    if evidence.calibration.covariance is not None and evidence.fresh is not None and len(evidence.kept) < 12:
        known = [evidence.calibration.covariance]
    turned = [lidar_axes(T, c) for c in known]
    return min(turned, key=lambda c: float(d @ np.linalg.solve(c, d)), default=None)


def _p_value(d: Float64Array, covariance: Float64Array, *, degrees: float = np.inf) -> float:
    """Of a difference at least as unlikely: chi-square, or Hotelling's F where the covariance is an estimate."""
    from scipy.special import chdtrc, fdtrc

    squared = float(d @ np.linalg.solve(covariance, d))
    if not np.isfinite(degrees) or degrees > 1e6:
        return float(chdtrc(6, squared))
    # Hotelling's T^2 with so many degrees of freedom of the covariance; fewer than 6 leave nothing to say
    left = degrees - 5
    return float(fdtrc(6, left, squared * left / (6 * degrees))) if left > 0 else 1.0


def _axis_words(d: Float64Array, covariance: Float64Array) -> str:
    """The degrees of freedom that carry the difference, the strongest first."""
    z = np.abs(d) / np.sqrt(np.diag(covariance))
    strong = [i for i in np.argsort(-z, kind="stable") if z[i] > 3] or [int(z.argmax())]
    parts = [
        f"{DEGREES_OF_FREEDOM[i]} {np.degrees(d[i]):+.2f} deg"
        if i < 3
        else f"{DEGREES_OF_FREEDOM[i]} {1e3 * d[i]:+.1f} mm"
        for i in strong[:3]
    ]
    return ", ".join(parts)


def _blind_axes(covariance: Float64Array, limits: VerifyLimits) -> str:
    """Axes whose sigma is too large to show a difference that matters."""
    sigma = np.sqrt(np.diag(covariance))
    matters = np.repeat([np.radians(limits.power_deg), limits.power_mm * 1e-3], 3)
    blind = [DEGREES_OF_FREEDOM[i] for i in np.flatnonzero(_POWER * sigma > matters)]
    return " and ".join(blind)
