"""Gates on what is left over: do the points lie on the boards, without a trend, and where the picture shows them?"""

from __future__ import annotations

import numpy as np

from wallkit.calib.extrinsics.edges import DEFINITION
from wallkit.calib.extrinsics.extrinsics import plane_rms_mm
from wallkit.calib.extrinsics.rigid import rotation_from_vector
from wallkit.calib.extrinsics.sightings import plane_distances
from wallkit.calib.verify.evidence import Evidence
from wallkit.calib.verify.gates import Gate, above, below, not_asked
from wallkit.calib.verify.limits import VerifyLimits
from wallkit.core.types import Float64Array

_FEWEST_FOR_TREND = 6


def plane_gate(evidence: Evidence, limits: VerifyLimits) -> Gate:
    """RMS distance of the points from the boards, each view judged by a calibration without it."""
    name = "points off the boards, held out, RMS"
    if not evidence.views:
        return not_asked(name, _no_boards(evidence))
    sigma = evidence.sigma_range_m
    good = 1e3 * max(limits.plane_m, limits.plane_sigmas * sigma)
    bad = max(good, 1e3 * min(limits.plane_bad_sigmas * sigma, limits.plane_bad_m))
    value = plane_rms_mm(evidence.kept)
    reason = f"points lie {value:.0f} mm (RMS) off the boards, where ranges scatter {sigma * 1e3:.0f} mm"
    least = _least_rms_mm(evidence) if value > good else 0.0
    if least > good:
        reason += f", and no transform does better than {least:.0f} mm"
        reason += ": do the intrinsics and the board belong to these pictures?"
    else:
        reason += ": the LiDAR or the camera moved since, or the transform is wrong"
    return below(name, value, "mm", good=good, bad=bad, reason=reason, basis="13.7 mm on a real VLP-16, 73 mm if wrong")


def worst_view_gate(evidence: Evidence, limits: VerifyLimits) -> Gate:
    """The worst view that a fresh solve could use, over the median view."""
    name = "worst view over the median view"
    if len(evidence.kept) < 3:
        return not_asked(name, "fewer than three views")
    rms = np.array([view.rms_mm for view in evidence.kept])
    worst = evidence.kept[int(rms.argmax())]
    # within what ranges scatter, a ratio says nothing
    usual = max(float(np.median(rms)), evidence.sigma_range_m * 1e3 / 2)
    reason = f"view {worst.name} is {worst.rms_mm:.0f} mm off, the median {np.median(rms):.0f} mm, though others fit"
    ratio = float(rms.max()) / usual
    return below(name, ratio, "", good=limits.view_ratio, bad=limits.view_ratio, reason=reason)


def inlier_gate(evidence: Evidence, limits: VerifyLimits) -> Gate:
    """How many of the sightings agree; too few can never be a PASS, whatever the rest says."""
    name = "views that agree"
    if not evidence.views:
        return not_asked(name, _no_boards(evidence))
    out = [view for view in evidence.views if view.why]
    share = 1 - len(out) / len(evidence.views)
    named = "; ".join(f"{view.name}: {view.why}" for view in out)
    reason = f"{len(out)} of {len(evidence.views)} views fit no transform that the others fit ({named})"
    return above(name, share, "of the views", good=limits.inliers, reason=reason, basis="9 of 16 were sold as 4.6 px")


def mean_gate(evidence: Evidence, limits: VerifyLimits) -> Gate:
    """Whether the views lie on one side of the boards on average."""
    name = "mean off the boards, over its own sigma"
    means = np.array([view.mean_mm for view in evidence.kept])
    if len(means) < _FEWEST_FOR_TREND:
        return not_asked(name, f"fewer than {_FEWEST_FOR_TREND} views")
    from scipy.special import stdtrit

    error = float(means.std(ddof=1)) / np.sqrt(len(means))
    value = abs(float(means.mean())) / max(error, 1e-9)
    good = float(stdtrit(len(means) - 1, 1 - limits.bias_p / 2))
    side = "beyond" if means.mean() > 0 else "before"
    reason = (
        f"points lie {abs(means.mean()):.1f} mm {side} the boards on average: a range bias, or a shift along the view"
    )
    # half a centimetre on average hurts nobody, however significant it is
    small = abs(float(means.mean())) < 1e3 * limits.plane_m / 2
    return below(name, min(value, good) if small else value, "sigma", good=round(good, 2), reason=reason)


def trend_gate(evidence: Evidence, limits: VerifyLimits) -> Gate:
    """Whether the mean of a view grows with its distance or its bearing: a wrong scale, a range bias, a turn."""
    name = "trend of the means over the views"
    if len(evidence.kept) < _FEWEST_FOR_TREND:
        return not_asked(name, f"fewer than {_FEWEST_FOR_TREND} views")
    means = np.array([view.mean_mm for view in evidence.kept])
    middles = np.array(
        [s.points_m.mean(axis=0) for s, v in zip(evidence.sightings, evidence.views, strict=True) if not v.why]
    )
    by = {
        "distance": np.linalg.norm(middles, axis=1),
        "bearing": np.arctan2(middles[:, 1], middles[:, 0]),
    }
    found = {word: _trend(x, means) for word, x in by.items()}
    told = {word: effect for word, (effect, p) in found.items() if p < limits.trend_p}
    is_sure = any(p < limits.trend_bad_p for _, p in found.values())
    word = max(told, key=lambda w: abs(told[w]), default="")
    value = abs(told[word]) if word else 0.0
    shape = "scale, squares or ranges are off" if word == "distance" else "the LiDAR is turned, or its bearings are off"
    reason = f"the mean grows by {value:.0f} mm from the least to the largest {word} (p < {limits.trend_p:g}): {shape}"
    good = 1e3 * limits.trend_m / 2
    bad = 1e3 * max(limits.trend_m, evidence.sigma_range_m) if is_sure else np.inf
    return below(name, value, "mm", good=good, bad=bad, reason=reason, basis="catches scale and range bias")


def edge_gate(evidence: Evidence, limits: VerifyLimits) -> Gate:
    """Where the returns are drawn beside the plate: the error that planes are blind to."""
    name = "reprojection error, held out, RMS over views"
    if evidence.edges is None or not len(evidence.edges.offsets_px):
        return not_asked(name, "the size of the plate is not declared (plate_m of the board)")
    edges, scale = evidence.edges, evidence.calibration.camera.width / limits.pixel_width
    step = float(np.median(edges.spacing_px)) / 2
    value, worst = edges.rms_px, edges.names[int(np.abs(edges.offsets_px).argmax())]
    side = "right" if np.median(edges.offsets_px) > 0 else "left"
    reason = f"returns are drawn {abs(float(np.median(edges.offsets_px))):.1f} px {side} of the plates (worst {worst})"
    return below(
        name,
        value,
        "px",
        good=round(limits.edge_px * scale + step, 2),
        bad=round(limits.edge_bad_px * scale + step, 2),
        reason=reason,
        basis=DEFINITION,
    )


def _least_rms_mm(evidence: Evidence) -> float:
    """RMS off the boards of the transform that makes it least, with every point counted alike."""
    from scipy.optimize import least_squares

    start = evidence.fresh.T if evidence.fresh is not None else evidence.place
    kept = [s for s, v in zip(evidence.sightings, evidence.views, strict=True) if not v.why]
    if start is None or not kept:
        return 0.0

    def off(x: Float64Array) -> Float64Array:
        T = start.copy()
        T[:3, :3] = rotation_from_vector(x[:3]) @ T[:3, :3]
        T[:3, 3] += x[3:]
        return np.concatenate([plane_distances(sighting, T) for sighting in kept])

    return 1e3 * float(np.sqrt(np.mean(least_squares(off, np.zeros(6)).fun ** 2)))


def _trend(x: Float64Array, y: Float64Array) -> tuple[float, float]:
    """Change of y over the span of x by a straight line, and the p of having it by chance (t-test)."""
    from scipy.special import stdtr

    if np.ptp(x) < 1e-6:
        return 0.0, 1.0
    centred = x - x.mean()
    slope = float(centred @ y) / float(centred @ centred)
    left = y - y.mean() - slope * centred
    degrees = len(x) - 2
    error = np.sqrt(max(float(left @ left) / degrees / float(centred @ centred), 1e-30))
    return slope * float(np.ptp(x)), float(2 * stdtr(degrees, -abs(slope / error)))


def _no_boards(evidence: Evidence) -> str:
    return evidence.why_no_fresh or "no board was seen by both"
