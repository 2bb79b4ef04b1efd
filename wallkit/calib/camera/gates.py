"""A calibrated camera with its coverage and its halves -> the gates that say how far it may be trusted."""

from __future__ import annotations

from collections.abc import Sequence

from wallkit.calib.camera.coverage import Coverage
from wallkit.calib.camera.cross_validation import Candidate, Halves, grows_to_corner
from wallkit.calib.camera.intrinsics import Intrinsics
from wallkit.calib.camera.limits import CameraLimits
from wallkit.calib.camera.projection_uncertainty import projection_sigma
from wallkit.calib.verify.gates import Gate, above, below

LIMITS = CameraLimits()


def camera_gates(
    found: Intrinsics,
    coverage: Coverage,
    halves: Halves | None,
    tried: Sequence[Candidate],
    limits: CameraLimits = LIMITS,
) -> tuple[Gate, ...]:
    """Every question asked of the intrinsics, in the order of the report.

    Too little data is CANNOT TELL, never FAIL: more views can still turn it into a PASS.
    """
    return (*_fit_gates(found, tried, limits), *_sure_gates(found, halves, limits), *_coverage_gates(coverage, limits))


def _fit_gates(found: Intrinsics, tried: Sequence[Candidate], limits: CameraLimits) -> tuple[Gate, ...]:
    """Whether the model explains what was seen."""
    own = next((c for c in tried if c.model == found.model), None)
    used = len(found.views)
    return (
        above("converged", float(found.fit.is_converged), "", good=1, bad=1, reason="the solver was still improving"),
        above("views", used, "", good=limits.views, reason=f"only {used} views: show the board from at least 12 sides"),
        below(
            "views rejected",
            len(found.rejected_views) / (used + len(found.rejected_views)),
            "",
            good=limits.rejected,
            bad=limits.rejected_bad,
            reason="views do not agree with the others: is the board flat, or was one moved or blurred?",
        ),
        below(
            "reprojection error, held out",
            own.held_out_rms_px if own else float("nan"),
            "px",
            good=limits.held_out_px,
            bad=limits.held_out_bad_px,
            reason="corners are not where the model puts them: another --model, a flatter board, sharper pictures",
        ),
        above(
            "model sound up to the corners",
            float(grows_to_corner(found.camera)),
            "",
            good=1,
            reason="the lens model folds back before the image's corners: pixels there have no ray",
        ),
    )


def _sure_gates(found: Intrinsics, halves: Halves | None, limits: CameraLimits) -> tuple[Gate, ...]:
    """How sure the result is, and whether that is honest."""
    relative = float((found.sigmas[:2] / found.camera.parameters[:2]).max())
    wider = max(1.0, found.camera.width / limits.pixel_width)
    return (
        below(
            "sigma of the focal length",
            100 * relative,
            "%",
            good=100 * limits.focal,
            reason="the views do not fix the focal length: tilt the board more, and bring it closer",
        ),
        below(
            "sigma of a pixel, median",
            projection_sigma(found.camera, found.covariance).median,
            "px",
            good=limits.pixel_px * wider,
            reason="far points may land that far off: take more views, with the board over more of the image",
        ),
        _halves_gate(halves, wider, limits),
    )


def _halves_gate(halves: Halves | None, wider: float, limits: CameraLimits) -> Gate:
    name = "halves differ by, median"
    if halves is None:
        reason = "too few views for two halves"
        return Gate(name, float("nan"), "px", f"<= {limits.halves_sigmas:g} sigma", "CANNOT TELL", reason)
    expected, value = round(limits.halves_sigmas * halves.expected_px, 2), halves.difference.median
    allowed = min(expected, 2 * limits.pixel_px * wider)
    reason = f"two cameras from half the views each disagree (expected {halves.expected_px:.2f} px)"
    bad = max(expected, limits.halves_bad_px * wider)
    return below(name, value, "px", good=allowed, bad=bad, reason=reason)


def _coverage_gates(coverage: Coverage, limits: CameraLimits) -> tuple[Gate, ...]:
    """Whether the board was where the camera looks."""
    lean = "tilt the board by more than 25 deg"
    return (
        above(
            "hull of the corners",
            coverage.hull_share,
            "of the image",
            good=limits.hull,
            reason="parts of the image saw no board: nothing is known of the lens there",
        ),
        above(
            "cells with corners",
            coverage.cell_share,
            "of the cells",
            good=limits.cells,
            reason="move the board over the whole image",
        ),
        above(
            "views tilted about x", coverage.tilted_x, "", good=limits.tilted, reason=f"{lean} forwards and backwards"
        ),
        above(
            "views tilted about y", coverage.tilted_y, "", good=limits.tilted, reason=f"{lean} to the left and right"
        ),
        above(
            "largest by smallest board",
            coverage.size_ratio,
            "",
            good=limits.size_ratio,
            reason="show the board nearer and farther",
        ),
    )
