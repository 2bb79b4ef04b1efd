"""A calibrated camera with its coverage and its halves -> the gates that say how far it may be trusted."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wallkit.calib.camera_coverage import Coverage
from wallkit.calib.cross_validation import Candidate, Halves, grows_to_corner
from wallkit.calib.gates import Gate, above, below
from wallkit.calib.intrinsics import Intrinsics


def camera_gates(
    found: Intrinsics, coverage: Coverage, halves: Halves | None, tried: Sequence[Candidate]
) -> tuple[Gate, ...]:
    """Every question asked of the intrinsics, in the order of the report.

    Too little data is CANNOT TELL, never FAIL: more views can still turn it into a PASS.
    """
    own = next((c for c in tried if c.model == found.model), None)
    used = len(found.views)
    total = used + len(found.rejected_views)
    relative = float((found.sigmas[:2] / found.camera.parameters[:2]).max())
    lean = "tilt the board by more than 25 deg"
    return (
        above("converged", float(found.fit.is_converged), "", good=1, bad=1, reason="the solver was still improving"),
        above("views", used, "", good=12, reason=f"only {used} views: show the board from at least 12 sides"),
        below(
            "views rejected",
            len(found.rejected_views) / total,
            "",
            good=0.1,
            bad=0.24,
            reason="views do not agree with the others: is the board flat, or was one moved or blurred?",
        ),
        below(
            "reprojection error, held out",
            own.held_out_rms_px if own else float("nan"),
            "px",
            good=0.4,
            bad=0.8,
            reason="corners are not where the model puts them: another --model, a flatter board, sharper pictures",
        ),
        below(
            "sigma of the focal length",
            100 * relative,
            "%",
            good=0.5,
            reason="the views do not fix the focal length: tilt the board more, and bring it closer",
        ),
        _halves_gate(found, halves),
        above(
            "hull of the corners",
            coverage.hull_share,
            "of the image",
            good=0.6,
            reason="parts of the image saw no board: nothing is known of the lens there",
        ),
        above(
            "cells with corners",
            coverage.cell_share,
            "of the cells",
            good=0.6,
            reason="move the board over the whole image",
        ),
        above("views tilted about x", coverage.tilted_x, "", good=3, reason=f"{lean} forwards and backwards"),
        above("views tilted about y", coverage.tilted_y, "", good=3, reason=f"{lean} to the left and right"),
        above(
            "largest by smallest board", coverage.size_ratio, "", good=1.5, reason="show the board nearer and farther"
        ),
        above(
            "model sound up to the corners",
            float(grows_to_corner(found.camera)),
            "",
            good=1,
            reason="the lens model folds back before the image's corners: pixels there have no ray",
        ),
    )


def _halves_gate(found: Intrinsics, halves: Halves | None) -> Gate:
    """Median difference of two halves: within twice what their covariances say, and half a pixel at 1280 px of width."""
    name, limit = "halves differ by, median", 0.5 * max(1.0, found.camera.width / 1280)
    if halves is None:
        return Gate(name, float("nan"), "px", f"<= {limit:g}", "CANNOT TELL", "too few views for two halves")
    allowed = min(limit, 2 * halves.expected_px)
    value = halves.difference.median
    bad = np.inf if value <= 2 * halves.expected_px else 4 * limit
    reason = f"two cameras from half the views each disagree (expected {halves.expected_px:.2f} px)"
    return below(name, value, "px", good=float(np.round(allowed, 3)), bad=bad, reason=reason)
