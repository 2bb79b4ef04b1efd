"""A verification -> the document that --json prints."""

from __future__ import annotations

from typing import Any

import numpy as np

from wallkit.calib.extrinsics.edges import DEFINITION as EDGE_DEFINITION
from wallkit.calib.extrinsics.extrinsics import plane_rms_mm
from wallkit.calib.extrinsics.observability import DEGREES_OF_FREEDOM
from wallkit.calib.verify.sure import pixel_error_at
from wallkit.pipelines.calib.verify import Verification, next_step

BOARD_DEFINITION = "sqrt(mean(du^2 + dv^2)) over the corners of one view, after the board's pose is fitted [px]"


def document(found: Verification) -> dict[str, Any]:
    """Verdict, gates, held-out errors with their definitions, and the pixel-error table."""
    evidence, judgement = found.evidence, found.judgement
    worst = judgement.worst
    rms = np.array([board.rms_px for _, board in evidence.boards])
    return {
        "verdict": judgement.verdict,
        "reasons": [g.reason for _, g in judgement.gates if g.verdict == judgement.verdict and g.reason],
        "worst_gate": None if worst is None else worst.name,
        "next": next_step(found),
        "pixel_error_95_at_reference_px": pixel_error_at(evidence, found.limits.reference_m),
        "reference_range_m": found.limits.reference_m,
        "pixel_error_95": None
        if evidence.pixel_error is None
        else [{"range_m": r, "px": e} for r, e in evidence.pixel_error.tolist()],
        "gates": [
            {
                "key": key,
                "gate": gate.name,
                "value": gate.value,
                "unit": gate.unit,
                "pass": gate.wanted,
                "fail": gate.refused,
                "verdict": gate.verdict or None,
                "reason": gate.reason,
                "basis": gate.basis,
            }
            for key, gate in judgement.gates
        ],
        "held_out": evidence.held_out,
        "held_out_plane_rms_mm": plane_rms_mm(evidence.kept) if evidence.views else None,
        "fit_plane_rms_mm_not_quality": None if evidence.fresh is None else plane_rms_mm(evidence.fresh.views),
        "held_out_reprojection": None
        if evidence.edges is None
        else {
            "definition": EDGE_DEFINITION,
            "rms_px": evidence.edges.rms_px,
            "p95_px": evidence.edges.p95_px,
            "views": dict(zip(evidence.edges.names, evidence.edges.offsets_px.tolist(), strict=True)),
        },
        "board_reprojection": None
        if not len(rms)
        else {
            "definition": BOARD_DEFINITION,
            "median_px": float(np.median(rms)),
            "p95_px": float(np.percentile(rms, 95)),
            "worst_px": float(rms.max()),
        },
        "directions": None
        if evidence.fresh is None
        else [
            {"words": d.words, "sight": d.sight, "sigma_over_prior": d.ratio}
            for d in evidence.fresh.observability.directions
        ],
        "unseen": [] if evidence.fresh is None else list(evidence.fresh.observability.unseen),
        "degrees_of_freedom": list(DEGREES_OF_FREEDOM),
        "sigma_range_m": evidence.sigma_range_m,
        "sigma_range_source": evidence.sigma_source,
        "urdf_prior": None
        if evidence.urdf is None
        else {"turn_deg": evidence.urdf.sigma_deg, "shift_mm": evidence.urdf.sigma_mm},
        "square_scale": None if evidence.scale is None else evidence.scale.value,
        "square_scale_sigma": None if evidence.scale is None else evidence.scale.sigma,
        "pictures": found.looked_at,
        "views": [
            {"name": v.name, "points": v.points, "mean_mm": v.mean_mm, "rms_mm": v.rms_mm, "left_out": v.why or None}
            for v in evidence.views
        ],
        "left_out": [{"name": name, "why": why} for name, why in found.left_out],
        "notes": list(found.notes),
    }
