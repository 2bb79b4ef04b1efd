"""A calibration and what boards show of it -> the evidence that gates judge; no view is judged by what it made itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from wallkit.calib.extrinsics.audits import Audit
from wallkit.calib.extrinsics.edges import EdgeFit, edge_fit
from wallkit.calib.extrinsics.extrinsics import Extrinsics, Hold, ViewFit, evaluate
from wallkit.calib.extrinsics.observability import observability
from wallkit.calib.extrinsics.pixel_error import pixel_error_95
from wallkit.calib.extrinsics.sightings import BoardPose, Sighting, problem_from_sightings
from wallkit.calib.extrinsics.solver import Placement, fit
from wallkit.calib.verify.gates import Gate
from wallkit.core.calibration import Calibration
from wallkit.core.types import Float64Array

HELD_OUT_OWN = (
    "each view is judged by the calibration without it: moved by what a solve changes when that view is left out"
    " (leave-one-view-out), because these files are among those that the calibration was made from"
)
HELD_OUT_OTHER = "every view is held out: the calibration was made from other files"
# CR2 needs more views than unknowns
FEWEST_IN_HALF = 8
FIT = "the views are those of the fit and cannot be held out: too few, or they do not fix the transform"


@dataclass(frozen=True, eq=False)
class Evidence:
    """What is known about a calibration when it is judged.

    Attributes:
        calibration: under judgement.
        boards: by name of the picture, every board that was seen.
        sightings: those that the LiDAR saw too. views: how each fits a calibration without it. held_out: in words.
        elevations: (2,) [rad] lowest and highest beam of the LiDAR, as the file or this input has it.
        sigma_range_m: of a range, declared or from a data sheet; sigma_source says which.
        fresh: a solve from these sightings alone; None when they are too few.
        why_no_fresh: what is in the way.
        covariance: (6, 6) of T_camera_lidar as in `Calibration`, that of the file or of the fresh solve, whichever counts;
            None where neither knows it. degrees: of freedom of it. covariance_source: in words.
        pixel_error: (R, 2) range [m] and error [px], from that covariance.
        scale: the square-size audit. square_m: as declared.
        edges: where the plate's ends are drawn; None when the plate's size is not declared.
        urdf: what a URDF says and how far it is trusted.
        clock: (offset [s], sigma [s]) of the camera against the LiDAR beyond the one in the calibration, measured here.
        clock_words: why there is none.
        faults: what is wrong with the camera_info and the frames, a sentence each; None when there was nothing to check.
        target_free: gates that need no board.
        halves: solves from the first and the second half of the views; None where they are too few.
        refit: (RMS of the corners with the camera under judgement, of one refitted, held out) [px]; None where nobody tried.
        hull_share: share of the image in the convex hull of all board corners.
    """

    calibration: Calibration
    boards: tuple[tuple[str, BoardPose], ...] = ()
    sightings: tuple[Sighting, ...] = ()
    views: tuple[ViewFit, ...] = ()
    held_out: str = ""
    elevations: Float64Array | None = None
    sigma_range_m: float = 0.02
    sigma_source: str = "assumed"
    fresh: Extrinsics | None = None
    why_no_fresh: str = ""
    covariance: Float64Array | None = None
    degrees: float = np.inf
    covariance_source: str = ""
    pixel_error: Float64Array | None = None
    scale: Audit | None = None
    square_m: float = float("nan")
    edges: EdgeFit | None = None
    urdf: Hold | None = None
    clock: tuple[float, float] | None = None
    clock_words: str = ""
    faults: tuple[str, ...] | None = None
    target_free: tuple[Gate, ...] = ()
    hull_share: float = float("nan")
    halves: tuple[Placement, Placement] | None = None
    refit: tuple[float, float] | None = None

    @property
    def place(self) -> Float64Array | None:
        """(4, 4) T_camera_lidar under judgement."""
        return self.calibration.T_camera_lidar

    @property
    def kept(self) -> tuple[ViewFit, ...]:
        """The views that a fresh solve could use together: the others are nobody's fault but their own."""
        return tuple(view for view in self.views if not view.why)


def evidence_of(calibration: Calibration, *, sigma_range_m: float, sigma_source: str, urdf: Hold | None) -> Evidence:
    """What the file says about itself, before anything is measured."""
    found = Evidence(
        calibration,
        sigma_range_m=sigma_range_m,
        sigma_source=sigma_source,
        urdf=urdf,
        elevations=calibration.elevations,
        covariance=calibration.covariance,
        degrees=calibration.degrees,
        covariance_source="of the calibration file" if calibration.covariance is not None else "",
    )
    return with_pixel_error(found)


def with_pixel_error(evidence: Evidence) -> Evidence:
    """The evidence, its covariance carried to pixels for its kind of LiDAR."""
    calibration, table = evidence.calibration, None
    T = evidence.place if evidence.place is not None or evidence.fresh is None else evidence.fresh.T
    if T is not None and evidence.covariance is not None:
        table = pixel_error_95(
            calibration.camera,
            T,
            evidence.covariance,
            degrees=evidence.degrees,
            camera_covariance=calibration.camera_covariance,
            elevations=evidence.elevations,
        )
    return replace(evidence, pixel_error=table if table is not None and len(table) else None)


def with_sightings(
    evidence: Evidence,
    sightings: Sequence[Sighting],
    fresh: Extrinsics,
    *,
    is_own: bool,
    is_whole: bool = False,
    scale: Audit | None = None,
    plate_corners: Float64Array | None = None,
) -> Evidence:
    """The evidence, with what the sightings say about the transform.

    Args:
        fresh: the solve from these sightings.
        is_own: whether the calibration was made from them; is_whole: and from nothing else.
        plate_corners: (4, 3) in the board frame, where they are declared.
    """
    T = evidence.place if evidence.place is not None else fresh.T
    places, words = _places_without(sightings, fresh, T, is_own=is_own or evidence.place is None)
    views = tuple(
        replace(evaluate(place, [sighting])[0], why=view.why)
        for place, sighting, view in zip(places, sightings, fresh.views, strict=True)
    )
    edges = None
    if plate_corners is not None:
        edges = edge_fit(evidence.calibration.camera, places, sightings, plate_corners)
    covariance, degrees, source = _covariance(evidence.calibration, fresh, is_whole=is_whole)
    found = replace(
        evidence,
        sightings=tuple(sightings),
        views=views,
        held_out=words,
        fresh=fresh,
        covariance=covariance,
        degrees=degrees,
        covariance_source=source,
        scale=scale,
        edges=edges,
        halves=_halves(sightings, fresh),
    )
    return with_pixel_error(found)


def lidar_axes(T: Float64Array, covariance: Float64Array) -> Float64Array:
    """(6, 6) covariance of (roll, pitch, yaw, forward, left, height) of one in the camera frame."""
    A = np.zeros((6, 6))
    A[:3, :3] = A[3:, 3:] = T[:3, :3]
    return np.asarray(A.T @ covariance @ A)


def _places_without(
    sightings: Sequence[Sighting], fresh: Extrinsics, T: Float64Array, *, is_own: bool
) -> tuple[list[Float64Array], str]:
    """For each view the transform that it had no part in, and what that means in words."""
    if not is_own:
        return [T] * len(sightings), HELD_OUT_OTHER
    used = np.array(fresh.used)
    if fresh.kind not in ("full", "planar") or used.sum() < 5:
        return [T] * len(sightings), FIT
    problem, basis = problem_from_sightings(sightings), fresh.placement.basis
    back = np.linalg.inv(fresh.T)
    places = []
    for i in range(len(sightings)):
        rest = used.copy()
        rest[i] = False
        without = fit(problem.of(rest), fresh.T, basis=basis, rounds=6).T if used[i] else fresh.T
        places.append(without @ back @ T)
    return places, HELD_OUT_OWN


def _halves(sightings: Sequence[Sighting], fresh: Extrinsics) -> tuple[Placement, Placement] | None:
    """The solve again from the first and from the second half of all views, in the order of the recording.

    Views that the fresh solve left out are in: after a bump they are the ones that tell.
    """
    problem, middle = problem_from_sightings(sightings), len(sightings) // 2
    if middle < FEWEST_IN_HALF:
        return None
    halves = [problem.of(list(half)) for half in (range(middle), range(middle, len(problem)))]
    first, second = (fit(half, fresh.T) for half in halves)
    if any(observability(place, half).unseen for place, half in zip((first, second), halves, strict=True)):
        return None
    return first, second


def _covariance(
    calibration: Calibration, fresh: Extrinsics, *, is_whole: bool
) -> tuple[Float64Array | None, float, str]:
    """The file's covariance; that of these views where the file has none, or claims to be surer than its own views are."""
    stored, measured = calibration.covariance, fresh.covariance
    if stored is None:
        return measured, fresh.degrees, "of these views"
    if is_whole and measured is not None and np.trace(measured[:3, :3]) > 1.5 * np.trace(stored[:3, :3]):
        return measured, fresh.degrees, "of these views, which is larger than the file's"
    return stored, calibration.degrees, "of the calibration file"
