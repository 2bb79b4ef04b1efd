"""Worlds with a known transform -> how often each unknown lies in the interval that is reported for it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from wallkit.calib.extrinsics.agreement import Known, chance_of, solved, stated
from wallkit.calib.extrinsics.covariance import quantiles
from wallkit.calib.extrinsics.sightings import Sighting, problem_from_sightings
from wallkit.calib.extrinsics.solver import difference, fit
from wallkit.calib.extrinsics.worlds import World, draw_sightings, mounting
from wallkit.core.types import Float64Array

LEVEL = 0.95
LOWEST, HIGHEST = 0.92, 0.98
# of a covariance from a file nobody knows what had been promised, so the directions lean on an estimate
LOWEST_OF_TWO = 0.90


@dataclass(frozen=True, eq=False)
class Coverage:
    """One row of the table.

    Attributes:
        covered: (6,) share of the seeds in which roll, pitch, yaw, forward, left, height lay in their 95 % interval.
        predicted: (6,) the same with the sigma that the declared noise promises and the normal quantile.
        joint: share in which the test of all six at once did not refuse the truth at 5 %; agreed: in which it did not tell
            two solves of the same truth apart, of which one is known by its covariance and degrees of freedom only.
        naive: (6,) the same with (J'J)^-1 s^2 over points, as tools commonly report.
        squared: mean of d'C^-1 d of the error d of all six with the covariance C that the declared noise promises: 6 where
            boards err as much as they say.
        sigma: (6,) median clustered sigma [rad, m]. degrees: (6,) mean degrees of freedom.
    """

    sensor: str
    views: int
    seeds: int
    excess: float
    covered: Float64Array
    predicted: Float64Array
    naive: Float64Array
    joint: float
    agreed: float
    squared: float
    sigma: Float64Array
    degrees: Float64Array

    @property
    def is_honest(self) -> bool:
        """Whether every unknown and all six are covered 92 to 98 times of 100 (two solves: 90); with fewer than 500 seeds
        +- three standard errors (36 numbers are compared in a table, of which one is two off by chance)."""
        low, high = (3 * np.sqrt(p * (1 - p) / self.seeds) if self.seeds < 500 else 0.0 for p in (LOWEST, HIGHEST))
        shares = np.array([*self.covered, self.joint, self.agreed])
        lowest = np.array([LOWEST] * 7 + [LOWEST_OF_TWO])
        return bool((shares >= lowest - low).all() and (shares <= HIGHEST + high).all())


def coverage(world: World, views: int, seeds: int, *, done: Callable[[int], None] | None = None) -> Coverage:
    """Coverage over seeds 0, 1, ... of one kind of world, each with a mounting and boards of its own."""
    hits, predicted, naive = np.zeros(6), np.zeros(6), np.zeros(6)
    sigmas, degrees, squared = [], [], []
    joint, agreed = 0, 0
    before: tuple[Float64Array, Known] | None = None
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        T = mounting(rng)
        sightings = draw_sightings(rng, world, T, views)
        problem = problem_from_sightings(sightings)
        found = fit(problem, T)
        spread = found.spread()
        # the truth as seen from the estimate, in the axes that the intervals are in
        signed = difference(found.T, T)
        off = np.abs(signed)
        hits += off <= spread.half_widths(LEVEL)
        predicted += off <= quantiles(np.full(6, np.inf), LEVEL) * np.sqrt(np.diag(spread.predicted))
        naive += off <= quantiles(np.full(6, np.inf), LEVEL) * _naive_sigmas(sightings, found.T)
        squared.append(signed @ np.linalg.solve(spread.predicted, signed))
        known = solved(found)
        joint += chance_of(signed, [known]) >= 1 - LEVEL
        if before is not None:
            agreed += chance_of(signed - before[0], [known, before[1]]) >= 1 - LEVEL
        # another world's error and covariance stand for a stored calibration of this one
        before = signed, stated(known.covariance, float(spread.degrees.min()))
        sigmas.append(spread.sigmas)
        degrees.append(spread.degrees)
        if done is not None:
            done(seed + 1)
    name = "2D" if world.is_planar else "3D"
    shares = (hits / seeds, predicted / seeds, naive / seeds)
    return Coverage(
        name,
        views,
        seeds,
        world.excess,
        *shares,
        joint / seeds,
        agreed / (seeds - 1),
        float(np.mean(squared)),
        np.median(sigmas, axis=0),
        np.mean(degrees, axis=0),
    )


def _naive_sigmas(sightings: Sequence[Sighting], T: Float64Array) -> Float64Array:
    """(6,) of (J'J)^-1 s^2 over all points of all boards, in LiDAR axes."""
    rows, off = [], []
    for sighting in sightings:
        turned = sighting.points_m @ T[:3, :3].T
        n = np.broadcast_to(sighting.board.normal, turned.shape)
        rows.append(np.concatenate([np.cross(turned, n) @ T[:3, :3], n @ T[:3, :3]], axis=1))
        off.append((turned + T[:3, 3]) @ sighting.board.normal - sighting.board.distance_m)
    J, r = np.concatenate(rows), np.concatenate(off)
    return np.sqrt(np.diag(np.linalg.inv(J.T @ J)) * (r @ r) / (len(r) - 6))
