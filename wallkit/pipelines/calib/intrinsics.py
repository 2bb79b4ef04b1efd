"""Views of a board -> a calibrated camera with everything that was asked of it, ready to store and to show."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from wallkit.calib.board.views import Capture, observations_of
from wallkit.calib.camera.coverage import Coverage, coverage_of
from wallkit.calib.camera.cross_validation import CHOICES, Candidate, Halves, candidates, choose, compare_halves
from wallkit.calib.camera.gates import camera_gates
from wallkit.calib.camera.intrinsics import Intrinsics, calibrate, rms_by_view
from wallkit.calib.camera.limits import CameraLimits
from wallkit.calib.camera.projection_uncertainty import PixelMap, projection_difference, projection_sigma
from wallkit.calib.camera.select import most_informative
from wallkit.calib.verify.gates import Gate, verdict_of
from wallkit.core.calibration import Calibration, Provenance, Verdict
from wallkit.core.camera import Camera
from wallkit.core.types import Float64Array, Int64Array
from wallkit.pipelines.calib.captures import CaptureRequest, capture_from, input_files
from wallkit.pipelines.calib.intrinsics_info import Published, published_against
from wallkit.pipelines.provenance import digests, versions

AUTO = "auto"
DEFINITION = "sqrt(sum |projected - observed|^2 / N) over corners [px]"


@dataclass(frozen=True)
class CameraResult:
    """A calibrated camera and its answers.

    Attributes:
        capture: what was used. found: the solution. tried: lens models compared; only its own when one was named.
        halves: None when there are too few views. sigma_1m, sigma_far: px at 1 m and at infinity.
        difference: to the second-best sound model; None without one. gates, verdict: see `camera_gates`.
        published: the camera_info of the log against it; None where there is none.
    """

    calibration: Calibration
    capture: Capture
    found: Intrinsics
    tried: tuple[Candidate, ...]
    coverage: Coverage
    halves: Halves | None
    sigma_1m: PixelMap
    sigma_far: PixelMap
    difference: tuple[str, PixelMap] | None
    gates: tuple[Gate, ...]
    published: Published | None = None

    @property
    def verdict(self) -> Verdict:
        """PASS, FAIL or CANNOT TELL."""
        return verdict_of(self.gates)


def calibrate_camera(
    request: CaptureRequest,
    *,
    model: str = AUTO,
    name: str = "",
    frame: str = "",
    command: str = "",
    limits: CameraLimits | None = None,
    progress: Callable[[int], None] = lambda done: None,
) -> CameraResult:
    """Find the board, choose the views and the lens model, calibrate, and ask how far to trust it.

    Args:
        model: a name of MODELS, or "auto": the leanest within 2 % of the best held-out error.
        name, frame: of the camera; empty: as far as the source says.

    Raises:
        CalibrationError, LogError: no result can be had, and why.
    """
    capture, _ = most_informative(capture_from(request, progress))
    seen = observations_of(capture.views, capture.board)
    tried = candidates(capture, seen, CHOICES if model == AUTO else (model,)) if len(capture.views) >= 3 else []
    chosen = choose(tried) if model == AUTO and tried else "plumb_bob" if model == AUTO else model
    found = calibrate(capture, chosen)
    coverage, halves = coverage_of(found.fit, found.seen), compare_halves(found, capture)
    gates = camera_gates(found, coverage, halves, tried, limits or CameraLimits())
    camera = _named(found.camera, name or capture.camera_name, frame or capture.frame)
    files = input_files(request.inputs)
    calibration = Calibration(
        camera,
        camera_covariance=found.covariance,
        verdict=verdict_of(gates),
        provenance=Provenance(
            digests(files),
            versions(),
            command,
            tuple(_notes(found, capture, gates)),
        ),
    )
    return CameraResult(
        calibration,
        capture,
        found,
        tuple(tried),
        coverage,
        halves,
        projection_sigma(found.camera, found.covariance, range_m=1.0),
        projection_sigma(found.camera, found.covariance),
        _difference(found, capture, tried),
        gates,
        published_against(request, found.camera),
    )


def reprojection_errors(residuals: Float64Array, views: Int64Array) -> dict[str, float]:
    """The four numbers that go by the name of reprojection error, of the same residuals (N, 2) and views (N,) [px].

    rms_px is wallkit's and OpenCV's; rms_per_coordinate_px is smaller by sqrt(2); mean_distance_px is Kalibr's and
    MATLAB's; mean_norm_by_count_px, the mean over views of |e| / n, is that of OpenCV's Python tutorial, and no error
    at all: it shrinks with the number of corners.
    """
    squared = (residuals**2).sum(axis=1)
    counts = np.bincount(views)
    norms = np.sqrt(np.bincount(views, squared)) / counts
    return {
        "rms_px": math.sqrt(squared.mean()),
        "rms_per_coordinate_px": math.sqrt(squared.mean() / 2),
        "mean_distance_px": float(np.sqrt(squared).mean()),
        "mean_norm_by_count_px": float(norms.mean()),
    }


def document(result: CameraResult) -> dict[str, Any]:
    """The result as --json prints it."""
    found, camera = result.found, result.found.camera
    values, names = camera.parameters.tolist(), camera.parameter_names
    rms = found.view_rms_px.tolist()
    seen = observations_of(result.capture.views, result.capture.board)
    return {
        "verdict": result.verdict,
        "gates": [_gate(gate) for gate in result.gates],
        "camera": {
            "name": result.calibration.camera.name,
            "frame": result.calibration.camera_frame,
            "model": camera.model,
            "width": camera.width,
            "height": camera.height,
            **dict(zip(names, values, strict=True)),
        },
        "sigma": dict(zip(names, found.sigmas.tolist(), strict=True)),
        "interval_95": dict(zip(names, found.spread.half_widths().tolist(), strict=True)),
        "degrees_of_freedom": dict(zip(names, found.spread.degrees.tolist(), strict=True)),
        "sigma_unclustered": dict(zip(names, np.sqrt(np.diag(found.naive_covariance)).tolist(), strict=True)),
        "definition": DEFINITION,
        "fit_not_quality": reprojection_errors(found.fit.residuals, found.seen.views),
        "least_squares": {
            **reprojection_errors(found.plain.residuals, seen.views),
            "views": len(result.capture.views),
            "converged": found.plain.is_converged,
            **dict(zip(names, found.plain.camera.parameters.tolist(), strict=True)),
        },
        "starts_px": dict(found.starts_px),
        "models": [_candidate(tried) for tried in result.tried],
        "difference_to": None if result.difference is None else result.difference[0],
        "difference_median_px": None if result.difference is None else result.difference[1].median,
        "uncertainty_px": {
            "centre_1m": result.sigma_1m.centre,
            "outer_1m": result.sigma_1m.outer,
            "worst_1m": result.sigma_1m.worst,
            "centre_far": result.sigma_far.centre,
            "outer_far": result.sigma_far.outer,
            "worst_far": result.sigma_far.worst,
        },
        "camera_info": None if result.published is None else _published(result.published),
        "pictures": result.capture.looked_at,
        "left_out": dict(result.capture.left_out),
        "rejected_views": dict(found.rejected_views),
        "rejected_corners": found.rejected_corners,
        "views": [
            {"name": v.name, "corners": len(v.ids), "rms_px": r, "sharpness": v.sharpness, "motion_px": v.motion_px}
            for v, r in zip(found.views, rms, strict=True)
        ],
    }


def _published(found: Published) -> dict[str, Any]:
    off = found.difference
    return {
        "topic": found.topic,
        "fault": found.fault or None,
        "difference_median_px": None if off is None else off.median,
        "difference_worst_px": None if off is None else off.worst,
    }


def _gate(gate: Gate) -> dict[str, Any]:
    return {
        "gate": gate.name,
        "value": gate.value,
        "unit": gate.unit,
        "wanted": gate.wanted,
        "verdict": gate.verdict,
        "reason": gate.reason,
    }


def _candidate(tried: Candidate) -> dict[str, Any]:
    return {
        "model": tried.model,
        "parameters": tried.parameters,
        "fit_rms_px": tried.fit_rms_px,
        "held_out_rms_px": tried.held_out_rms_px,
        "held_out_95_px": tried.held_out_95_px,
        "bic": tried.bic,
        "grows_to_corner": tried.grows_to_corner,
    }


def _difference(found: Intrinsics, capture: Capture, tried: list[Candidate]) -> tuple[str, PixelMap] | None:
    """The sound model next in held-out error, and how far its pixels are from the chosen one's."""
    others = [c for c in tried if c.model != found.model and c.grows_to_corner and np.isfinite(c.held_out_rms_px)]
    if not others:
        return None
    second = min(others, key=lambda c: c.held_out_rms_px).model
    return second, projection_difference(found.camera, calibrate(capture, second).camera)


def _notes(found: Intrinsics, capture: Capture, gates: tuple[Gate, ...]) -> list[str]:
    own = rms_by_view(found.fit, found.seen)
    notes = [f"board {capture.board.words}; {len(found.views)} views of {capture.looked_at} pictures"]
    notes.append(f"fit {found.fit.rms_px:.5f} px, worst view {own.max():.3f} px: {DEFINITION}; fit, not quality")
    notes += [f"rejected view {name}: {why}" for name, why in found.rejected_views.items()]
    notes += [f"{gate.verdict}: {gate.name} {gate.value:.4g}: {gate.reason}" for gate in gates if gate.reason]
    return notes


def _named(camera: Camera, name: str, frame: str) -> Camera:
    return Camera(camera.model, camera.width, camera.height, camera.K, camera.D, name, frame)
