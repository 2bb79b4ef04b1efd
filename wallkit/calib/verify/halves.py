"""Gates on what the views say against each other: the first half against the second, and the lens against its own refit."""

from __future__ import annotations

import numpy as np

from wallkit.calib.extrinsics.agreement import chance_of, solved
from wallkit.calib.extrinsics.solver import difference
from wallkit.calib.verify.agreement import axis_words
from wallkit.calib.verify.evidence import FEWEST_IN_HALF, Evidence
from wallkit.calib.verify.gates import Gate, below, not_asked
from wallkit.calib.verify.limits import VerifyLimits
from wallkit.core.calibration import Verdict


def halves_gate(evidence: Evidence, limits: VerifyLimits) -> Gate:
    """Whether the first half of the views puts the LiDAR where the second half does: did something move meanwhile?"""
    name = "first half of the views against the second, p"
    if evidence.halves is None:
        return not_asked(name, f"it takes {2 * FEWEST_IN_HALF} views that fix the transform")
    first, second = evidence.halves
    sides = [solved(first), solved(second)]
    d = difference(first.T, second.T)
    p = chance_of(d, sides)
    words = axis_words(d, sides[0].covariance + sides[1].covariance)
    wanted, refused = (
        f">= {limits.halves_p:g}",
        f"< {limits.urdf_bad_p:g} and > {limits.power_deg:g} deg or {limits.power_mm:g} mm",
    )
    basis = "t of six independent directions, both covariances"
    matters = np.degrees(np.abs(d[:3])).max() > limits.urdf_deg or 1e3 * np.abs(d[3:]).max() > limits.urdf_mm
    is_large = np.degrees(np.abs(d[:3])).max() > limits.power_deg or 1e3 * np.abs(d[3:]).max() > limits.power_mm
    if p >= limits.halves_p or not matters:
        return Gate(name, p, "", wanted, "PASS", "", refused, basis)
    reason = f"the second half of the views puts the LiDAR {words} from the first: did it move during the recording?"
    verdict: Verdict = "FAIL" if p < limits.urdf_bad_p and is_large else "CANNOT TELL"
    return Gate(name, p, "", wanted, verdict, reason, refused, basis)


def refit_gate(evidence: Evidence, limits: VerifyLimits) -> Gate:
    """Whether the lens explains these pictures as well as one refitted to four fifths of them explains the last fifth.

    It cannot FAIL: `intrinsics_gate` does where the pictures contradict the lens.
    """
    name = "error of the corners over that of a refit, held out"
    if evidence.place is not None or evidence.sightings:
        return not_asked(name, "asked of a camera alone")
    if evidence.refit is None:
        return not_asked(name, "too few views to refit the lens without some of them")
    judged, refit = evidence.refit
    reason = (
        f"a lens of the same model, refitted, has {refit:.2f} px on views it has not seen, this one {judged:.2f} px:"
        " the focus or the mode changed since"
    )
    basis = "sqrt(mean(du^2 + dv^2)) over corners, poses fitted; refitted in 5 folds"
    return below(name, judged / refit, "", good=limits.refit, reason=reason, basis=basis)
