"""Gates on how sure the answer is: how much was seen, what was not, and what that means in pixels."""

from __future__ import annotations

import numpy as np

from wallkit.calib.extrinsics.observability import DEGREES_OF_FREEDOM
from wallkit.calib.extrinsics.solver import difference
from wallkit.calib.verify.evidence import Evidence, lidar_axes
from wallkit.calib.verify.gates import Gate, above, below, not_asked
from wallkit.calib.verify.limits import VerifyLimits


def views_gate(evidence: Evidence, limits: VerifyLimits) -> Gate:
    """How many views there are; too few can never be a PASS."""
    if evidence.target_free and not evidence.boards:
        return not_asked("views", evidence.why_no_fresh)
    count = len(evidence.kept) if evidence.sightings or evidence.place is not None else len(evidence.boards)
    reason = (
        f"only {count} views: below {limits.views_bad} nothing is sure, from {limits.views} on it is worth a verdict"
    )
    if evidence.why_no_fresh:
        reason = f"{reason} ({evidence.why_no_fresh})"
    return above("views", float(count), "", good=limits.views, reason=reason, basis="real errors over number of views")


def observability_gate(evidence: Evidence, limits: VerifyLimits) -> Gate:
    """Whether the views see all six degrees of freedom, or a stated prior holds those they do not see."""
    name = "degrees of freedom seen"
    if evidence.place is None and not evidence.sightings:
        return not_asked(name, "a camera alone has no transform")
    if evidence.fresh is None:
        return above(name, float("nan"), "of 6", good=6, reason=evidence.why_no_fresh)
    seen = evidence.fresh.observability
    observed = sum(d.sight == "OBSERVED" for d in seen.directions)
    if observed < 6 and evidence.urdf is not None and evidence.place is not None:
        open_ = seen.vectors("UNOBSERVED", "WEAK")
        units = np.repeat([np.radians(evidence.urdf.sigma_deg), evidence.urdf.sigma_mm * 1e-3], 3)
        off = np.abs(open_.T @ (difference(evidence.urdf.T, evidence.place) / units))
        if (off < 3).all():
            return Gate(name, observed, "of 6", "6, or held by a stated prior", "PASS", basis="the rest is the URDF's")
    if evidence.place is None:
        reason = "the calibration holds no transform to verify"
        if seen.unseen:
            reason = f"{6 - seen.seen} of 6 directions are not seen: {seen.reason}"
        return Gate(name, observed, "of 6", ">= 6", "CANNOT TELL", reason)
    weak = ", ".join(d.words for d in seen.directions if d.sight == "WEAK")
    reason = f"{6 - seen.seen} of 6 directions are not seen: {seen.reason}" if seen.unseen else f"{weak} hardly seen"
    return above(name, float(observed), "of 6", good=6, reason=reason, basis="sigma below a third of 1.5 deg and 60 mm")


def sigma_gate(evidence: Evidence, limits: VerifyLimits) -> Gate:
    """The clustered sigma of the worst axis, as a share of what may be."""
    name = "sigma of the worst axis"
    if evidence.place is None:
        return not_asked(name, "there is no transform")
    if evidence.covariance is None:
        return below(
            name, float("nan"), "", good=limits.sigma_deg, reason="the covariance of the transform is not known"
        )
    sigma = np.sqrt(np.diag(lidar_axes(evidence.place, evidence.covariance)))
    sizes = np.concatenate([np.degrees(sigma[:3]) / limits.sigma_deg, 1e3 * sigma[3:] / limits.sigma_mm])
    worst = int(sizes.argmax())
    turns = worst < 3
    value = float(np.degrees(sigma[worst]) if turns else 1e3 * sigma[worst])
    unit, good, bad = (
        ("deg", limits.sigma_deg, limits.sigma_bad_deg) if turns else ("mm", limits.sigma_mm, limits.sigma_bad_mm)
    )
    axis = DEGREES_OF_FREEDOM[worst]
    reason = f"{axis} is known to {value:.2g} {unit} (1 sigma, {evidence.covariance_source}) only"
    if evidence.fresh is not None and evidence.fresh.observability.unseen:
        # what the views do not see is for the gate of observability; a number for it means nothing
        bad = np.inf
    basis = "clustered by view; a 2-D set that failed has 2.6 deg"
    return below(f"{name} ({axis})", value, unit, good=good, bad=bad, reason=reason, basis=basis)


def pixel_gate(evidence: Evidence, limits: VerifyLimits) -> Gate:
    """Within how many pixels 95 % of the points at the reference range land, at the worst place of the image.

    It cannot FAIL: that an error may be large is no proof that it is. What is drawn in the wrong place fails `edge_gate`.
    """
    name = f"95 % pixel error at {limits.reference_m:g} m"
    if evidence.place is None:
        return not_asked(name, "there is no transform")
    scale = evidence.calibration.camera.width / limits.pixel_width
    good = round(limits.pixel_px * scale, 2)
    value = pixel_error_at(evidence, limits.reference_m)
    reason = (
        f"the transform is not known well enough: {value:.1f} px at {limits.reference_m:g} m, {good:g} px are allowed"
    )
    if not np.isfinite(value):
        reason = "the covariance is not known, or the LiDAR sees nothing of the image"
    basis = f"covariance {evidence.covariance_source}, carried to pixels"
    return below(name, value, "px", good=good, reason=reason, basis=basis)


def hull_gate(evidence: Evidence, limits: VerifyLimits) -> Gate:
    """How much of the image the corners span; asked of a camera alone."""
    name = "hull of the corners"
    if evidence.place is not None or evidence.sightings:
        return not_asked(name, "asked of a camera alone")
    reason = "parts of the image saw no board: nothing is known of the lens there"
    return above(name, evidence.hull_share, "of the image", good=limits.hull, reason=reason)


def focal_gate(evidence: Evidence, limits: VerifyLimits) -> Gate:
    """How sure the focal length is; asked of a camera alone."""
    name = "sigma of the focal length"
    if evidence.place is not None or evidence.sightings:
        return not_asked(name, "asked of a camera alone")
    C = evidence.calibration.camera_covariance
    value = (
        float("nan")
        if C is None
        else float((np.sqrt(np.diag(C)[:2]) / evidence.calibration.camera.parameters[:2]).max())
    )
    reason = "the calibration does not say how sure it is" if C is None else "the views do not fix the focal length"
    return below(name, 100 * value, "%", good=100 * limits.focal, reason=reason)


def pixel_error_at(evidence: Evidence, range_m: float) -> float:
    """95 % error [px] at a range [m]; NaN where it is not known."""
    if evidence.pixel_error is None:
        return float("nan")
    ranges, errors = evidence.pixel_error.T
    return float(np.interp(1 / range_m, 1 / ranges[::-1], errors[::-1]))
