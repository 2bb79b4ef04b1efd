"""Gates on agreement: with the robot's URDF, and with what the boards of this log say by themselves."""

from __future__ import annotations

import numpy as np

from wallkit.calib.extrinsics.agreement import Known, chance_of, solved, stated
from wallkit.calib.extrinsics.observability import DEGREES_OF_FREEDOM
from wallkit.calib.extrinsics.solver import difference
from wallkit.calib.verify.evidence import Evidence, lidar_axes
from wallkit.calib.verify.gates import Gate, not_asked
from wallkit.calib.verify.limits import VerifyLimits
from wallkit.core.types import Float64Array

# 80 % power at 5 %, two-sided
_POWER = 2.8
_FEW = 12
_TEST = "t of six independent directions (p of their chi-square)"


def urdf_gate(evidence: Evidence, limits: VerifyLimits) -> Gate:
    """Whether the calibration and the URDF can both be right: the test of `agreement` of their difference.

    It may only PASS where the calibration is sharp enough to have seen a difference that matters.
    """
    name, urdf, T = "agreement with the URDF, p", evidence.urdf, evidence.place
    if urdf is None or T is None:
        return not_asked(name, "no URDF was given" if urdf is None else "there is no transform")
    prior = f"prior {urdf.sigma_deg:g} deg, {urdf.sigma_mm:g} mm"
    d = difference(urdf.T, T)
    trusted = stated(np.diag(np.repeat([np.radians(urdf.sigma_deg), urdf.sigma_mm * 1e-3], 3) ** 2))
    sides = _sides(evidence, T)
    if not sides:
        return Gate(
            name, np.nan, "", f">= {limits.urdf_p:g}", "CANNOT TELL", "the calibration does not say how sure it is"
        )
    p, covariance = max(
        ((chance_of(d, [known, trusted]), known.covariance) for known in sides), key=lambda pair: pair[0]
    )
    words = axis_words(d, covariance + trusted.covariance)
    wanted, refused = (
        f">= {limits.urdf_p:g}",
        f"< {limits.urdf_bad_p:g} and > {limits.urdf_deg:g} deg or {limits.urdf_mm:g} mm",
    )
    basis = f"{_TEST}, {prior}"
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
    sides = [solved(fresh.placement)]
    if evidence.calibration.covariance is not None and np.abs(fresh.T - T).max() > 1e-9:
        sides.append(stated(lidar_axes(T, evidence.calibration.covariance), evidence.calibration.degrees))
    d = difference(T, fresh.T)
    # in the axes of the solve, whose degrees of freedom they are
    p = chance_of(difference(fresh.T, T), sides)
    spread = sum(side.covariance for side in sides[1:]) + sides[0].covariance
    words = axis_words(d, spread)
    wanted, refused = (
        f">= {limits.urdf_p:g}",
        f"< {limits.urdf_bad_p:g} and > {limits.urdf_deg:g} deg or {limits.urdf_mm:g} mm",
    )
    basis = f"{_TEST}, both covariances"
    matters = np.degrees(np.abs(d[:3])).max() > limits.urdf_deg or 1e3 * np.abs(d[3:]).max() > limits.urdf_mm
    if p < limits.urdf_bad_p and matters:
        reason = f"the boards of this log put the LiDAR {words} from where the calibration has it"
        return Gate(name, p, "", wanted, "FAIL", reason, refused, basis)
    if p < limits.urdf_p and matters:
        reason = f"the boards of this log may put the LiDAR {words} from where the calibration has it"
        return Gate(name, p, "", wanted, "CANNOT TELL", reason, refused, basis)
    return Gate(name, p, "", wanted, "PASS", "", refused, basis)


def _sides(evidence: Evidence, T: Float64Array) -> list[Known]:
    """What is known of the calibration: by its file and by the fresh solve, unless that has too few views to know."""
    file, fresh = evidence.calibration, evidence.fresh
    known = [] if evidence.covariance is None else [stated(lidar_axes(T, evidence.covariance), evidence.degrees)]
    if file.covariance is not None and fresh is not None and len(evidence.kept) < _FEW:
        return [stated(lidar_axes(T, file.covariance), file.degrees)]
    return known + ([solved(fresh.placement)] if fresh is not None and fresh.covariance is not None else [])


def axis_words(d: Float64Array, covariance: Float64Array) -> str:
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
