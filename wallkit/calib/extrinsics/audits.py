"""Suspicions that the LiDAR can settle: is a square as large as declared, and do ranges read long?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from wallkit.calib.extrinsics.covariance import spread_of
from wallkit.calib.extrinsics.extrinsics import Extrinsics
from wallkit.calib.extrinsics.planar import PLANAR, planar_placement
from wallkit.calib.extrinsics.sightings import Problem, Sighting, jacobian, problem_from_sightings, residuals, whiteners
from wallkit.calib.extrinsics.solver import Placement, fit
from wallkit.core.types import Float64Array

SCALE_TOLERANCE = 0.02
_ROUNDS = 8
# a range bias is told from a shift only by boards at different distances
FEWEST_FOR_BIAS, SPAN_FOR_BIAS = 12, 2.0


@dataclass(frozen=True)
class Audit:
    """A nuisance that was fitted for once, beside the transform.

    Attributes:
        value, sigma: of kappa (1 when squares are as declared) or the range bias [m].
        is_suspect: it differs from what was declared by more than the tolerance and three sigmas.
        words: the finding in a sentence.
    """

    value: float
    sigma: float
    is_suspect: bool
    words: str


def square_size(result: Extrinsics, sightings: Sequence[Sighting], *, square_m: float) -> Audit:
    """How large the squares are by the LiDAR's ruler: kappa times as large as declared."""
    used = [s for s, use in zip(sightings, result.used, strict=True) if use]
    kappa, sigma, T, basis = 1.0, np.nan, result.T, result.placement.basis
    if result.kind == "refused" and all(s.faces[0].directions == 1 for s in used):
        # wrong squares blow up the misfit until a planar LiDAR's yaw counts as unseen; six open directions fit any size
        T, basis = planar_placement(problem_from_sightings(used)).T, PLANAR
    for _ in range(_ROUNDS):
        problem = problem_from_sightings([replace(s, board=s.board.scaled(kappa)) for s in used])
        here = fit(problem, T, basis=basis, rounds=3)
        T = here.T
        step, sigma = _extra(
            here, problem, -problem.weights * np.einsum("gkc,gc->gk", problem.normals, problem.origins)
        )
        kappa *= 1 + step
        if abs(step) < 1e-7:
            break
    sigma *= kappa
    is_suspect = abs(kappa - 1) > max(SCALE_TOLERANCE, 3 * sigma)
    sizes = f"squares of {square_m * 1e3:.4g} mm measure {square_m * kappa * 1e3:.4g} mm"
    said = f"{sizes} by the LiDAR (scale {kappa:.3f} +- {sigma:.3f})"
    if is_suspect:
        said += "; measure a row of squares with a ruler, or the intrinsics do not belong to these pictures"
    return Audit(kappa, sigma, is_suspect, said)


def range_bias(result: Extrinsics, sightings: Sequence[Sighting]) -> Audit | None:
    """By how much [m] the ranges read short, the transform being free again; None where nobody can tell it from a shift."""
    used = [s for s, use in zip(sightings, result.used, strict=True) if use]
    ranges = [float(np.linalg.norm(s.points_m.mean(axis=0))) for s in used]
    if len(used) < FEWEST_FOR_BIAS or max(ranges) < SPAN_FOR_BIAS * min(ranges):
        return None
    problem = problem_from_sightings(used)
    here = fit(problem, result.T, basis=result.placement.basis)
    middles = problem.points[:, 0] / np.linalg.norm(problem.points[:, 0], axis=1, keepdims=True)
    column = problem.weights * np.einsum("gkc,gc->gk", problem.normals, middles @ here.T[:3, :3].T)
    bias, sigma = _extra(here, problem, column)
    is_suspect = abs(bias) > max(0.01, 3 * sigma)
    said = f"ranges read {abs(bias) * 1e3:.0f} +- {sigma * 1e3:.0f} mm {'short' if bias > 0 else 'long'}"
    return Audit(bias, sigma, is_suspect, said)


def _extra(here: Placement, problem: Problem, column: Float64Array) -> tuple[float, float]:
    """Gauss-Newton step and clustered sigma of one more unknown with this (G, K) derivative of the residuals."""
    whiten = whiteners(problem, here.T) * np.sqrt(here.weights)[:, None, None]
    R = np.zeros((6, 6))
    R[:3, :3] = R[3:, 3:] = here.T[:3, :3]
    rows = np.concatenate([jacobian(problem, here.T) @ R @ here.basis, column[..., None]], axis=2)
    rows = whiten @ rows
    left = np.einsum("gkj,gj->gk", whiten, residuals(problem, here.T))
    flat = rows.reshape(-1, rows.shape[2])
    step = np.linalg.lstsq(flat, -left.ravel(), rcond=None)[0]
    spread = spread_of(rows, left + np.einsum("gkp,p->gk", rows, step))
    return float(step[-1]), float(spread.sigmas[-1])
