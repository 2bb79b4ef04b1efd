"""Gates on what everybody takes for granted: the intrinsics, the squares, the clocks and the camera_info."""

from __future__ import annotations

import numpy as np

from wallkit.calib.verify.evidence import Evidence
from wallkit.calib.verify.gates import Gate, below, not_asked
from wallkit.calib.verify.limits import VerifyLimits


def intrinsics_gate(evidence: Evidence, limits: VerifyLimits) -> Gate:
    """Whether the intrinsics belong to these pictures: how well the corners of a board fit them, in the median view."""
    name = "intrinsics against the pictures, median RMS"
    if not evidence.boards:
        return not_asked(name, "no board was seen")
    rms = np.array([board.rms_px for _, board in evidence.boards])
    value = float(np.median(rms))
    worst = evidence.boards[int(rms.argmax())][0]
    reason = (
        f"corners lie {value:.2f} px from where the intrinsics put them (worst {worst}: {rms.max():.2f} px):"
        " the camera_info is of another camera, mode or focus, or the board is bent"
    )
    basis = "sqrt(mean(du^2 + dv^2)) after the board's pose is fitted; correct: 0.13 to 0.21 px, wrong: 0.88"
    return below(name, value, "px", good=limits.board_px, bad=limits.board_bad_px, reason=reason, basis=basis)


def square_gate(evidence: Evidence, limits: VerifyLimits) -> Gate:
    """Whether the squares are as large as declared, by the LiDAR's ruler."""
    name = "size of the squares by the LiDAR"
    audit = evidence.scale
    if audit is None or not np.isfinite(audit.sigma):
        return not_asked(name, "the views give no scale")
    allowed = max(limits.scale, 3 * audit.sigma)
    off = abs(audit.value - 1)
    return below(name, off, "of 1", good=round(allowed, 4), bad=round(allowed, 4), reason=audit.words)


def clock_gate(evidence: Evidence, limits: VerifyLimits) -> Gate:
    """Whether the clocks of camera and LiDAR are as the calibration has them."""
    name = "clock of the camera against the LiDAR's"
    if evidence.clock is None:
        return not_asked(name, evidence.clock_words or "files do not say: the clocks show only where the board moves")
    offset, sigma = evidence.clock
    good, bad = 1e3 * max(limits.clock_s, 3 * sigma), 1e3 * max(limits.clock_bad_s, 3 * sigma)
    said = f"the camera's clock is {offset * 1e3:+.1f} ms off (sigma {sigma * 1e3:.1f} ms)"
    return below(name, 1e3 * abs(offset), "ms", good=good, bad=bad, reason=said)


def sanity_gate(evidence: Evidence, limits: VerifyLimits) -> Gate:
    """Whether the camera_info and the frames can be true at all."""
    name = "faults of the camera_info and the frames"
    if evidence.faults is None:
        return not_asked(name, "there is no camera_info in the input")
    return below(name, float(len(evidence.faults)), "", good=0, bad=0, reason="; ".join(evidence.faults))
