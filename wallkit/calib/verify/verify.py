"""Evidence about a calibration -> the answers of all gates and one verdict: PASS, FAIL or CANNOT TELL."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from wallkit.calib.verify.agreement import boards_gate, urdf_gate
from wallkit.calib.verify.audit import clock_gate, intrinsics_gate, sanity_gate, square_gate
from wallkit.calib.verify.evidence import Evidence
from wallkit.calib.verify.fit import edge_gate, inlier_gate, mean_gate, plane_gate, trend_gate, worst_view_gate
from wallkit.calib.verify.gates import Gate, verdict_of
from wallkit.calib.verify.halves import halves_gate, refit_gate
from wallkit.calib.verify.limits import VerifyLimits
from wallkit.calib.verify.sure import (
    focal_gate,
    hull_gate,
    observability_gate,
    pixel_gate,
    sigma_gate,
    views_gate,
)
from wallkit.core.calibration import Verdict

_SEVERITY = {"FAIL": 0, "CANNOT TELL": 1, "PASS": 2, "": 3}


@dataclass(frozen=True)
class Judgement:
    """The answers, in the order of GATES."""

    gates: tuple[tuple[str, Gate], ...]

    @property
    def verdict(self) -> Verdict:
        """FAIL if one gate fails, else CANNOT TELL if one cannot tell or none was asked, else PASS."""
        asked = [gate for _, gate in self.gates if gate.verdict]
        return verdict_of(asked) if asked else "CANNOT TELL"

    @property
    def worst(self) -> Gate | None:
        """The first gate of the worst kind; None when all pass."""
        bad = [gate for _, gate in self.gates if gate.verdict in ("FAIL", "CANNOT TELL")]
        return min(bad, key=lambda gate: _SEVERITY[gate.verdict], default=None)


def verify(evidence: Evidence, limits: VerifyLimits | None = None) -> Judgement:
    """Every gate asked of the evidence, and the target-free ones that came with it."""
    chosen = limits or VerifyLimits()
    asked = [(name, gate(evidence, chosen)) for name, gate in GATES.items()]
    return Judgement((*asked, *((f"target-free {gate.name}", gate) for gate in evidence.target_free)))


GATES: Mapping[str, Callable[[Evidence, VerifyLimits], Gate]] = {
    "sanity": sanity_gate,
    "intrinsics": intrinsics_gate,
    "refit": refit_gate,
    "plane": plane_gate,
    "worst-view": worst_view_gate,
    "inliers": inlier_gate,
    "reprojection": edge_gate,
    "mean": mean_gate,
    "trend": trend_gate,
    "boards": boards_gate,
    "halves": halves_gate,
    "observability": observability_gate,
    "views": views_gate,
    "hull": hull_gate,
    "sigma": sigma_gate,
    "focal": focal_gate,
    "pixel-error": pixel_gate,
    "square-size": square_gate,
    "time-offset": clock_gate,
    "urdf": urdf_gate,
}
