"""Sightings of a board -> where the LiDAR is to the camera, how sure that is, and what the sightings could not see."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from wallkit.calib.extrinsics.covariance import Spread
from wallkit.calib.extrinsics.observability import DEGREES_OF_FREEDOM, PRIOR_DEG, PRIOR_MM, Observability, observability
from wallkit.calib.extrinsics.planar import PLANAR, planar_placement
from wallkit.calib.extrinsics.rigid import angle_between
from wallkit.calib.extrinsics.sightings import Problem, Sighting, plane_distances, problem_from_sightings
from wallkit.calib.extrinsics.solver import Placement, camera_axes, fit, inflated, prior_along
from wallkit.calib.extrinsics.starts import first_guesses
from wallkit.core.types import BoolArray, Float64Array
from wallkit.errors import CalibrationError

FEWEST = 3
OUTLIER_RATIO, OUTLIER_Z = 3.0, 5.0
MOST_REJECTED = 0.25
# a guess farther from the answer than this is a mistake, not a tolerance
FAR_DEG, FAR_M = 15.0, 0.3
_ROUGH_ROUNDS = 4


@dataclass(frozen=True, eq=False)
class Hold:
    """A transform from CAD that directions without data are held at.

    Attributes:
        T: (4, 4) T_camera_lidar, of the URDF. sigma_deg, sigma_mm: how far it is trusted.
    """

    T: Float64Array
    sigma_deg: float = 1.0
    sigma_mm: float = 10.0


@dataclass(frozen=True)
class ViewFit:
    """How one sighting fits.

    Attributes:
        mean_mm, rms_mm: signed distance of its LiDAR points from the board's plane.
        misfit: whitened RMS; 1 is what the declared noise promises. weight: robust, 0 where it was left out.
        why: it was left out; empty when it was used.
    """

    name: str
    points: int
    mean_mm: float
    rms_mm: float
    misfit: float
    weight: float
    why: str = ""


@dataclass(frozen=True, eq=False)
class Extrinsics:
    """The answer.

    Attributes:
        kind: "full" six degrees of freedom from the data; "held": those without data at the prior; "planar": yaw and two
            shifts, the rest assumed; "refused": directions are open and nothing holds them.
        T: (4, 4) T_camera_lidar; of "refused" one of many that fit.
        covariance: (6, 6) as in `core.calibration.Calibration`; None where it is not bounded.
        spread: along `placement.basis`, in LiDAR axes. placement: the minimum.
        from_data: (6,) share of each of roll, pitch, yaw, forward, left, height that the data decided; 0 is CAD alone.
        views: every sighting, in the order given. warnings: what a user must know, a sentence each.
    """

    kind: str
    T: Float64Array
    covariance: Float64Array | None
    spread: Spread | None
    placement: Placement
    observability: Observability
    from_data: Float64Array
    views: tuple[ViewFit, ...]
    warnings: tuple[str, ...]

    @property
    def used(self) -> tuple[bool, ...]:
        """Which sightings decided."""
        return tuple(not view.why for view in self.views)

    @property
    def sigmas(self) -> Float64Array:
        """(6,) of roll, pitch, yaw [rad], forward, left, height [m]; NaN where they are not bounded or were assumed."""
        if self.spread is None:
            return np.full(6, np.nan)
        B = self.placement.basis
        variance = np.einsum("ik,kl,il->i", B, self.spread.covariance, B)
        return np.sqrt(np.where(np.abs(B).max(axis=1) > 0, variance, np.nan))

    @property
    def degrees(self) -> float:
        """Fewest degrees of freedom of any unknown's sigma."""
        return float(self.spread.degrees.min()) if self.spread is not None else np.inf


def solve(
    sightings: Sequence[Sighting],
    *,
    guess: Float64Array | None = None,
    hold: Hold | None = None,
    prior_deg: float = PRIOR_DEG,
    prior_mm: float = PRIOR_MM,
    seed: int = 0,
) -> Extrinsics:
    """The transform that all sightings agree on.

    Args:
        guess: (4, 4) T_camera_lidar that joins the starts; it never replaces them.
        hold: prior for the directions that the sightings do not see; it does not touch the others.
        prior_deg, prior_mm: what directions are judged OBSERVED, WEAK or UNOBSERVED against.

    Raises:
        CalibrationError: fewer than three sightings, or none of the starts puts the boards in front of the camera.
    """
    if len(sightings) < FEWEST:
        hint = "show the board in 12 or more poses, tilted to all sides"
        raise CalibrationError(
            f"the board was seen by both sensors in {len(sightings)} poses; {FEWEST} is the least", hint=hint
        )
    guess = guess if guess is not None else hold.T if hold else None
    problem = problem_from_sightings(sightings)
    best, warnings = _best_start(problem, guess, seed)
    best, used, reasons = _without_outliers(problem, best, sightings)
    kept = _as_noisy_as_it_is(problem.of(used), best)
    is_planar = all(len(s.faces) == 1 and s.faces[0].directions == 1 for s in sightings)
    kind, placement, seen = _answer(kept, best, hold, prior_deg, prior_mm, is_planar=is_planar)
    spread = placement.spread() if kind != "refused" else None
    covariance = camera_axes(placement, spread.covariance) if spread is not None and kind != "planar" else None
    if reasons:
        warnings.append(
            f"{len(reasons)} of {len(sightings)} views were left out: {', '.join(sightings[i].name for i in reasons)}"
        )
    if len(reasons) > 0.8 * MOST_REJECTED * len(used):
        warnings.append("about a quarter of the views do not fit: look for a moved board or a wrong board definition")
    return Extrinsics(
        kind=kind,
        T=placement.T,
        covariance=covariance,
        spread=spread,
        placement=placement,
        observability=seen,
        from_data=_from_data(placement, spread, kind),
        views=_views(sightings, problem, placement, used, reasons),
        warnings=tuple(warnings),
    )


def evaluate(T: Float64Array, sightings: Sequence[Sighting]) -> tuple[ViewFit, ...]:
    """How sightings fit a transform that they had no part in."""
    problem = problem_from_sightings(sightings)
    held = fit(problem, T, basis=np.zeros((6, 0)), rounds=0)
    return _views(sightings, problem, held, np.ones(len(sightings), bool), {})


def plane_rms_mm(views: Sequence[ViewFit]) -> float:
    """RMS [mm] over the points of the views that were used."""
    counts = np.array([v.points for v in views if not v.why], dtype=np.float64)
    squares = np.array([v.rms_mm for v in views if not v.why]) ** 2
    return float(np.sqrt((counts * squares).sum() / counts.sum())) if len(counts) else np.nan


# ------------------------------------------------------------------------------------------------ details


def _best_start(problem: Problem, guess: Float64Array | None, seed: int) -> tuple[Placement, list[str]]:
    starts = first_guesses(problem, seed=seed)
    fits = [fit(problem, T, rounds=_ROUGH_ROUNDS) for T in starts]
    warnings = []
    if guess is not None:
        near = fit(problem, guess, rounds=_ROUGH_ROUNDS)
        best = min([near, *fits], key=lambda f: f.cost)
        if near.cost <= 2 * best.cost + len(problem):
            best = near
        degrees, metres = np.degrees(angle_between(best.T, guess)), np.linalg.norm(best.T[:3, 3] - guess[:3, 3])
        if degrees > FAR_DEG or metres > FAR_M:
            said = f"the boards put the LiDAR {degrees:.0f} deg and {metres:.2f} m from the guess"
            warnings.append(f"{said}: is the guess the transform lidar -> camera, and are the frames right?")
        return best, warnings
    if not fits:
        hint = "check that the LiDAR points are on the board, and that pictures and scans belong together"
        raise CalibrationError("no transform puts the boards in front of the camera", hint=hint)
    return min(fits, key=lambda f: f.cost), warnings


def _without_outliers(
    problem: Problem, best: Placement, sightings: Sequence[Sighting]
) -> tuple[Placement, BoolArray, dict[int, str]]:
    """Leave out views that misfit three times as much as usual and by five robust sigmas; at most a quarter."""
    used = np.ones(len(problem), dtype=bool)
    reasons: dict[int, str] = {}
    for _ in range(3):
        best = fit(problem.of(used), best.T)
        misfit = fit(problem, best.T, basis=np.zeros((6, 0)), rounds=0).misfit
        usual = float(np.median(misfit[used]))
        deviation = 1.4826 * float(np.median(np.abs(misfit[used] - usual)))
        bad = (misfit > OUTLIER_RATIO * usual) & (misfit > usual + OUTLIER_Z * deviation) & (misfit > OUTLIER_RATIO)
        room = int(MOST_REJECTED * len(used)) if len(used) >= 5 else 0
        chosen = sorted((int(i) for i in np.flatnonzero(bad)), key=lambda i: -misfit[i])[:room]
        fresh = np.ones(len(used), dtype=bool)
        fresh[chosen] = False
        reasons = {
            int(
                i
            ): f"its points lie {np.sqrt(np.mean(plane_distances(sightings[i], best.T) ** 2)) * 1e3:.0f} mm off the board, "
            f"{misfit[i] / usual:.1f} times the usual misfit"
            for i in sorted(chosen)
        }
        if (fresh == used).all():
            break
        used = fresh
    return fit(problem.of(used), best.T), used, reasons


def _as_noisy_as_it_is(problem: Problem, best: Placement) -> Problem:
    """The problem with its noise raised to what the residuals show: a prior may only be weighed against the truth.

    It is never lowered, and it does not move a solution that has no prior.
    """
    said = float(problem.row_counts.sum()) - min(6.0, problem.row_counts.sum() / 2)
    squares = float((best.weights * best.misfit**2 * problem.row_counts).sum())
    return inflated(problem, max(1.0, np.sqrt(squares / said)))


def _answer(
    problem: Problem, best: Placement, hold: Hold | None, prior_deg: float, prior_mm: float, *, is_planar: bool
) -> tuple[str, Placement, Observability]:
    seen = observability(best, problem, prior_deg=prior_deg, prior_mm=prior_mm)
    if not seen.unseen:
        return "full", best, seen
    # far along an open direction a linearisation says little: judge where the robot is known, or nearly known, to be
    near = best
    if hold is not None:
        units = {"turn_rad": np.radians(hold.sigma_deg), "shift_m": hold.sigma_mm * 1e-3}
        near = fit(problem, hold.T, prior=prior_along(hold.T, np.eye(6), **units))
    planar = None
    if hold is None and is_planar:
        planar = near = planar_placement(problem)
    seen = observability(near, problem, prior_deg=prior_deg, prior_mm=prior_mm)
    if not seen.unseen:
        return "full", best, seen
    if hold is not None:
        scaled = np.repeat([prior_deg / hold.sigma_deg, prior_mm / hold.sigma_mm], 3)[:, None]
        directions, _ = np.linalg.qr(seen.vectors("UNOBSERVED", "WEAK") * scaled)
        held = fit(problem, hold.T, prior=prior_along(hold.T, directions, **units))
        return "held", held, seen
    if planar is not None and set(seen.unseen) <= {"roll", "pitch", "height"}:
        return "planar", planar, seen
    return "refused", near if planar is None else best, seen


def _from_data(placement: Placement, spread: Spread | None, kind: str) -> Float64Array:
    if spread is None:
        return np.full(6, np.nan)
    if kind == "planar":
        return np.where(np.abs(PLANAR).max(axis=1) > 0, 1.0, 0.0)
    by_prior = spread.predicted @ placement.held @ spread.predicted
    return 1 - np.diag(by_prior) / np.diag(spread.predicted)


def _views(
    sightings: Sequence[Sighting], problem: Problem, placement: Placement, used: BoolArray, reasons: dict[int, str]
) -> tuple[ViewFit, ...]:
    misfit = fit(problem, placement.T, basis=np.zeros((6, 0)), rounds=0).misfit
    weights = np.zeros(len(sightings))
    weights[used] = placement.weights
    found = []
    for i, sighting in enumerate(sightings):
        off = plane_distances(sighting, placement.T) * 1e3
        found.append(
            ViewFit(
                name=sighting.name,
                points=len(off),
                mean_mm=float(off.mean()),
                rms_mm=float(np.sqrt((off**2).mean())),
                misfit=float(misfit[i]),
                weight=float(weights[i]),
                why=reasons.get(i, ""),
            )
        )
    return tuple(found)


def sigma_words(result: Extrinsics) -> list[tuple[str, str, str]]:
    """(degree of freedom, sigma with unit, where it comes from) of each of the six."""
    rows = []
    for i, (name, sigma, share) in enumerate(zip(DEGREES_OF_FREEDOM, result.sigmas, result.from_data, strict=True)):
        text = "-" if not np.isfinite(sigma) else f"{np.degrees(sigma):.3f} deg" if i < 3 else f"{sigma * 1e3:.1f} mm"
        source = (
            "not known" if np.isnan(share) else "data" if share > 0.9 else "assumed" if result.kind == "planar" else ""
        )
        rows.append((name, text, source or ("CAD" if share < 0.5 else f"data and CAD ({share:.0%} data)")))
    return rows


def subset(sightings: Sequence[Sighting], which: Sequence[int]) -> tuple[Sighting, ...]:
    """Some of the sightings, for solving on those and evaluating on the rest."""
    return tuple(replace(sightings[i]) for i in which)
