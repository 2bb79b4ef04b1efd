"""What the views can see of the six degrees of freedom, and what not, in words.

A direction is judged by the error that is predicted for it against what is known before anything is measured, never by a
bare singular value: how large one is depends on units, noise and the number of points.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from wallkit.calib.extrinsics.covariance import spread_of
from wallkit.calib.extrinsics.sightings import Problem, jacobian, residuals, whiteners
from wallkit.calib.extrinsics.solver import Placement
from wallkit.core.types import Float64Array

Sight = Literal["OBSERVED", "WEAK", "UNOBSERVED"]
# a mounting known by eye: a third of it is the 0.5 deg and 20 mm that a verified calibration must reach
PRIOR_DEG, PRIOR_MM = 1.5, 60.0
DEGREES_OF_FREEDOM = ("roll", "pitch", "yaw", "forward", "left", "height")
_ENTIRELY_OPEN = 1e-6
_NAMED = 0.9
_PART = 0.35


@dataclass(frozen=True, eq=False)
class Direction:
    """One independent direction of the transform.

    Attributes:
        vector: (6,) roll, pitch, yaw, forward, left, height in LiDAR axes (x forward, y left, z up), in units of the prior.
        ratio: predicted sigma over the prior's; inf where nothing is seen.
        sight: OBSERVED below 1/3, WEAK up to 1, UNOBSERVED.
        words: which degrees of freedom it is made of.
    """

    vector: Float64Array
    ratio: float
    sight: Sight
    words: str


@dataclass(frozen=True, eq=False)
class Observability:
    """All six directions, the best seen first.

    Attributes:
        prior_deg, prior_mm: what they were judged against.
        singular_values: (6,) of the whitened Jacobian with turns at a lever arm of the median range, in 1/cm: with a sigma
            of 10 mm, what the bare Jacobian of the points has.
        unseen: names of the degrees of freedom that the UNOBSERVED directions are made of.
        reason: why they are not seen and what to do, in a sentence; empty when all are seen.
    """

    directions: tuple[Direction, ...]
    prior_deg: float
    prior_mm: float
    singular_values: Float64Array
    unseen: tuple[str, ...]
    reason: str

    @property
    def seen(self) -> int:
        """How many directions are not UNOBSERVED."""
        return sum(d.sight != "UNOBSERVED" for d in self.directions)

    def vectors(self, *sights: Sight) -> Float64Array:
        """(6, m) the directions of these kinds, in units of the prior."""
        chosen = [d.vector for d in self.directions if d.sight in sights]
        return np.array(chosen).T if chosen else np.zeros((6, 0))


def observability(
    placement: Placement, problem: Problem, *, prior_deg: float = PRIOR_DEG, prior_mm: float = PRIOR_MM
) -> Observability:
    """What the views see around a placement; of a direction the larger of the predicted and the clustered sigma counts."""
    units = np.repeat([np.radians(prior_deg), prior_mm * 1e-3], 3)
    rows = _rows(placement, problem)
    scaled = rows * units
    values, vectors = np.linalg.eigh(np.einsum("gkp,gkq->pq", scaled, scaled))
    order = np.argsort(values)[::-1]
    values, vectors = values[order], _signed(vectors[:, order])
    seen = values > _ENTIRELY_OPEN
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = np.where(seen, 1 / np.sqrt(np.maximum(values, 0)), np.inf)
    whiten = whiteners(problem, placement.T) * np.sqrt(placement.weights)[:, None, None]
    left = np.einsum("gkj,gj->gk", whiten, residuals(problem, placement.T))
    clustered = spread_of(scaled @ vectors[:, seen], left).sigmas
    ratios[seen] = np.maximum(ratios[seen], clustered)
    directions = tuple(_direction(vectors[:, i], float(ratios[i])) for i in range(6))
    unseen = _unseen(directions)
    lever = float(np.median(_ranges(problem)))
    levelled = (rows * np.repeat([1 / lever, 1.0], 3)).reshape(-1, 6) * 1e-2
    singular = np.linalg.svd(levelled, compute_uv=False)
    return Observability(directions, prior_deg, prior_mm, singular, unseen, _reason(directions, unseen))


def _rows(placement: Placement, problem: Problem) -> Float64Array:
    """(G, K, 6) whitened Jacobian over all six directions in LiDAR axes, whatever was free in the placement."""
    R = placement.T[:3, :3]
    turn = np.zeros((6, 6))
    turn[:3, :3] = turn[3:, 3:] = R
    whiten = whiteners(problem, placement.T) * np.sqrt(placement.weights)[:, None, None]
    return np.asarray(whiten @ jacobian(problem, placement.T) @ turn)


def _direction(vector: Float64Array, ratio: float) -> Direction:
    sight: Sight = "OBSERVED" if ratio < 1 / 3 else "WEAK" if ratio <= 1 else "UNOBSERVED"
    return Direction(vector, ratio, sight, _words(vector))


def _words(vector: Float64Array) -> str:
    """The degrees of freedom that carry a direction, the strongest first."""
    strength = np.abs(vector)
    order = [i for i in np.argsort(-strength, kind="stable") if strength[i] >= _PART * strength.max()]
    if (order[0] >= 3) and np.linalg.norm(vector[3:]) > _NAMED and len(order) > 1:
        unit = vector[3:] / np.linalg.norm(vector[3:])
        if np.abs(unit).max() > _NAMED:
            return DEGREES_OF_FREEDOM[order[0]]
        return f"shift along ({unit[0]:+.2f} {unit[1]:+.2f} {unit[2]:+.2f}) of the LiDAR"
    return " with ".join(DEGREES_OF_FREEDOM[i] for i in order)


def _unseen(directions: Sequence[Direction]) -> tuple[str, ...]:
    """Names for the space of UNOBSERVED directions: single degrees of freedom where it is made of them."""
    open_ = np.array([d.vector for d in directions if d.sight == "UNOBSERVED"])
    if not len(open_):
        return ()
    share = (open_**2).sum(axis=0)
    strongest = np.argsort(-share, kind="stable")[: len(open_)]
    if share[strongest].sum() > _NAMED * len(open_) and share[strongest].min() > 0.5:
        return tuple(DEGREES_OF_FREEDOM[i] for i in sorted(strongest, key=lambda i: (i != 5, i)))
    return tuple(d.words for d in directions if d.sight == "UNOBSERVED")


def _reason(directions: Sequence[Direction], unseen: tuple[str, ...]) -> str:
    if not unseen:
        return ""
    listed = ", ".join(unseen[:-1]) + " and " + unseen[-1] if len(unseen) > 1 else unseen[0]
    are = "are" if len(unseen) > 1 else "is"
    if set(unseen) == {"height", "roll", "pitch"}:
        return f"the LiDAR's {listed} are not constrained by vertical boards: tilt the board 30 deg"
    if set(unseen) <= {"height", "roll", "pitch"}:
        return (
            f"the LiDAR's {listed} {are} hardly constrained by boards that stand nearly upright: tilt the board 30 deg"
        )
    turns = [d for d in directions if d.sight == "UNOBSERVED" and np.linalg.norm(d.vector[:3]) > 0.5]
    if not turns:
        hint = "turn the board about the other axis too, so that its normals do not lie in one plane"
        return f"the LiDAR's {listed} {are} not constrained: {hint}"
    hint = "hold the board in at least five clearly different orientations (30 deg about both of its axes)"
    return f"the LiDAR's {listed} {are} not constrained: {hint}"


def _signed(vectors: Float64Array) -> Float64Array:
    """Columns with their largest component positive, so that runs and machines agree."""
    largest = np.abs(vectors).argmax(axis=0)
    return np.asarray(vectors * np.sign(vectors[largest, np.arange(vectors.shape[1])]))


def _ranges(problem: Problem) -> Float64Array:
    return np.asarray(np.linalg.norm(problem.points[:, 0] / problem.weights[:, :1], axis=1))
