"""A hypothesis that is not trusted -> new ones worth a look, for motion to decide between.

`relocalise` searches the whole map with the points of the last few views; `augmented` throws in random poses when the
likelihood drops (Thrun, Burgard & Fox 2005, table 8.3); `none` leaves the particles alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar, Protocol

import numpy as np

from wallkit.core.ceiling import CeilingView
from wallkit.core.config import setting
from wallkit.core.geometry import compose, relative, transform_points, wrap_angle
from wallkit.core.grid import spread_of
from wallkit.core.types import FieldSet, Float64Array, Points
from wallkit.localize.estimate import near_pose
from wallkit.localize.initial import over_free_space
from wallkit.localize.particles import Particles, normalised
from wallkit.localize.search import Place, SearchMap, find_places, prepare_search


@dataclass(frozen=True, slots=True)
class View:
    """Points (K, 2) in frame base, T_odom_base (3,) where they were seen, and what the ceiling looked like from there."""

    odometry: Float64Array
    points_m: Float64Array
    ceiling: CeilingView | None = None


@dataclass(frozen=True, slots=True)
class Memory:
    """What recovery remembers between updates.

    Attributes:
        views: the last distinct views, oldest first. places: the last answers of a search, best first, moved along by
            odometry; empty when none is of use. views_to_wait, patience: backing off while searches do not settle it.
        slow, fast: running means of the fit (augmented).
    """

    views: tuple[View, ...] = ()
    survivors: tuple[Place, ...] | None = None
    views_to_wait: int = 0
    patience: int = 0
    slow: float = 0.0
    fast: float = 0.0


@dataclass(frozen=True, slots=True)
class Situation:
    """What recovery is told at an update.

    Attributes:
        points, odometry: of this update. estimate: the filter's pose (3,).
        fit: share of the returns that the map explains.
        is_confirmed: the hypothesis is trusted. was_confirmed: it was before this update.
        is_ripe: it could be confirmed if there is no rival. is_fitting: the last updates spoke for it.
        ceiling: what a camera saw of it last, from here; None without one.
        likelihood: of poses (N, 3) by the present view alone, (N,) [nat]; None where nobody offers it.
    """

    points: Points
    odometry: Float64Array
    estimate: Float64Array
    fit: float
    is_confirmed: bool
    was_confirmed: bool
    is_ripe: bool
    is_fitting: bool
    ceiling: CeilingView | None = None
    likelihood: Callable[[Float64Array], Float64Array] | None = None


@dataclass(frozen=True, slots=True)
class Outcome:
    """What recovery did: the particles to go on with, whether the hypothesis stood the test, how many were thrown in."""

    particles: Particles
    memory: Memory
    confirms: bool = False
    injected: int = 0


# places, odometry now, and (odometry, view of the ceiling) of the last moments -> the places that are left
TellApart = Callable[[Sequence[Place], Float64Array, Sequence[tuple[Float64Array, CeilingView]]], Sequence[Place]]


class Recovery(Protocol):
    """Settings of a recovery."""

    def on(self, fields: FieldSet, *, tell_apart: TellApart | None = None) -> BoundRecovery:
        """The recovery on one map.

        Args:
            tell_apart: leaves out the places that another sensor than the LiDAR rules out.
        """
        ...


class BoundRecovery(Protocol):
    """A recovery on one map; `seeks_rivals` if it searches the map for places that explain the scans as well."""

    seeks_rivals: ClassVar[bool]

    def recover(self, rng: np.random.Generator, particles: Particles, memory: Memory, now: Situation) -> Outcome:
        """Look at the situation after an update, and change the particles if need be."""
        ...

    def candidates(self, memory: Memory, odometry: Float64Array) -> Sequence[Place]:
        """Every place that explains the remembered views, seen from where odometry (3,) is now, best first."""
        ...


@dataclass(frozen=True)
class Relocalise:
    """Search the whole map with the last views stitched by odometry; seed particles at the places that explain them."""

    views: int = setting(10, "views remembered", low=1)
    view_distance_m: float = setting(0.5, "a view is new after this distance", low=0)
    view_turn_deg: float = setting(20.0, "or after this turn", low=0)
    points: int = setting(180, "points of all views together used in a search", low=10)
    range_max_m: float = setting(20.0, "farther points are not used", low=0.1)
    keep: float = setting(0.85, "places scoring less than this share of the best are no hypotheses", low=0, high=1)
    rival: float = setting(0.93, "a place scoring at least this share of the best is a rival", low=0, high=1)
    share: float = setting(0.5, "share of the particles moved to the places found when lost", low=0, high=1)
    share_of_doubt: float = setting(0.1, "the same while the hypothesis fits", low=0, high=1)
    sharpness: float = setting(40.0, "log odds of two places per unit of score", low=0)
    sd_m: float = setting(0.15, "spread of the particles seeded at a place", low=0)
    sd_deg: float = setting(3.0, "spread of their heading", low=0)
    views_to_confirm: int = setting(3, "views without which nothing is confirmed", low=1)
    wait_views_max: int = setting(16, "most views between two searches", low=1)

    def on(self, fields: FieldSet, *, tell_apart: TellApart | None = None) -> BoundRecovery:
        """See Recovery."""
        return _Relocaliser(self, fields, tell_apart)


@dataclass
class _Relocaliser:
    seeks_rivals: ClassVar[bool] = True
    settings: Relocalise
    fields: FieldSet
    tell_apart: TellApart | None = None
    # the pyramid is built at the first search: a robot that never loses its way never pays for it
    _search_map: SearchMap | None = field(default=None, repr=False)

    def recover(self, rng: np.random.Generator, particles: Particles, memory: Memory, now: Situation) -> Outcome:
        """See BoundRecovery."""
        memory, is_new = self._remembered(memory, now)
        if now.is_confirmed:
            return Outcome(particles, replace(memory, survivors=None, views_to_wait=0, patience=0))
        if not is_new:
            return Outcome(particles, memory)
        if memory.views_to_wait > 0:
            return Outcome(particles, replace(memory, views_to_wait=memory.views_to_wait - 1))
        places = tuple(self.candidates(memory, now.odometry))
        confirms = now.is_ripe and len(memory.views) >= self.settings.views_to_confirm and self._agrees(places, now)
        # search after 1, 2, 3, 5, 9, 17, ... views: the first ones settle it or it takes long
        wait = min(memory.patience, self.settings.wait_views_max)
        patience = max(1, 2 * memory.patience)
        survivors = still_found(memory.survivors, places)
        memory = replace(memory, survivors=survivors, views_to_wait=wait, patience=patience)
        if confirms or not places:
            return Outcome(particles, memory, confirms)
        share = self.settings.share_of_doubt if now.is_fitting else self.settings.share
        seeded, count = self._seeded(rng, particles, places, share)
        return Outcome(seeded, memory, False, count)

    def candidates(self, memory: Memory, odometry: Float64Array) -> Sequence[Place]:
        """See BoundRecovery."""
        if not memory.views:
            return ()
        if self._search_map is None:
            self._search_map = prepare_search(self.fields)
        each = max(20, self.settings.points // len(memory.views))
        stitched = [
            transform_points(relative(odometry, view.odometry), view.points_m[:: max(1, len(view.points_m) // each)])
            for view in memory.views
        ]
        places = find_places(self._search_map, np.concatenate(stitched), keep=self.settings.keep)
        sights = [(view.odometry, view.ceiling) for view in memory.views if view.ceiling is not None]
        return self.tell_apart(places, odometry, sights) if self.tell_apart and sights else places

    def _remembered(self, memory: Memory, now: Situation) -> tuple[Memory, bool]:
        """Memory with this view, if it is a new one; a hypothesis just given up takes its views with it."""
        s = self.settings
        views = memory.views
        if now.was_confirmed and not now.is_confirmed:
            # what was seen on the way into the wrong place may be stitched by the very odometry that failed
            views, memory = (), replace(memory, survivors=None, views_to_wait=0, patience=0)
        if views:
            moved = relative(views[-1].odometry, now.odometry)
            if np.hypot(moved[0], moved[1]) < s.view_distance_m and abs(moved[2]) < np.deg2rad(s.view_turn_deg):
                return replace(memory, views=views), False
        used = spread_of(now.points, s.points, range_max_m=s.range_max_m)
        view = View(now.odometry, now.points.xyz_m[used, :2].astype(np.float64), now.ceiling)
        return replace(memory, views=(*views, view)[-s.views :]), True

    def _agrees(self, places: tuple[Place, ...], now: Situation) -> bool:
        """The best place is where the filter is, and no other comes near it."""
        if not places:
            return False
        off = relative(places[0].pose, now.estimate)
        is_here = np.hypot(off[0], off[1]) < 0.75 and abs(off[2]) < np.deg2rad(20.0)
        has_rival = len(places) > 1 and places[1].score >= self.settings.rival * places[0].score
        return bool(is_here and not has_rival)

    def _seeded(
        self, rng: np.random.Generator, particles: Particles, places: tuple[Place, ...], share: float
    ) -> tuple[Particles, int]:
        """Particles with a share of them moved to the places, better ones getting more; all weights equal to the mean."""
        s = self.settings
        count = round(share * len(particles))
        odds = normalised(np.array([s.sharpness * place.score for place in places]))
        which = rng.choice(len(places), count, p=odds)
        poses = np.array([place.pose for place in places])[which]
        poses += rng.standard_normal(poses.shape) * (s.sd_m, s.sd_m, np.deg2rad(s.sd_deg))
        return replaced(rng, particles, poses), count


@dataclass(frozen=True)
class Augmented:
    """Random poses over free space with probability max(0, 1 - w_fast / w_slow) (Probabilistic Robotics, table 8.3).

    The book averages the likelihood; here it is the share of returns that fit, which does not depend on their number.
    """

    alpha_slow: float = setting(0.05, "rate of the slow mean of the fit", low=0, high=1)
    alpha_fast: float = setting(0.5, "rate of the fast mean", low=0, high=1)
    share_max: float = setting(0.5, "largest share of the particles replaced at once", low=0, high=1)

    def on(self, fields: FieldSet, *, tell_apart: TellApart | None = None) -> BoundRecovery:
        """See Recovery."""
        return _AugmentedRecovery(self, fields)


@dataclass(frozen=True)
class _AugmentedRecovery:
    seeks_rivals: ClassVar[bool] = False
    settings: Augmented
    fields: FieldSet

    def recover(self, rng: np.random.Generator, particles: Particles, memory: Memory, now: Situation) -> Outcome:
        """See BoundRecovery."""
        s = self.settings
        if memory.slow == 0.0:
            memory = replace(memory, slow=now.fit, fast=now.fit)
        slow = memory.slow + s.alpha_slow * (now.fit - memory.slow)
        fast = memory.fast + s.alpha_fast * (now.fit - memory.fast)
        memory = replace(memory, slow=slow, fast=fast)
        count = round(len(particles) * min(s.share_max, max(0.0, 1.0 - fast / slow)))
        if count == 0:
            return Outcome(particles, memory)
        return Outcome(replaced(rng, particles, over_free_space(rng, self.fields, count)), memory, False, count)

    def candidates(self, memory: Memory, odometry: Float64Array) -> Sequence[Place]:
        """See BoundRecovery."""
        return ()


@dataclass(frozen=True)
class NoRecovery:
    """Particles go only where odometry takes them; who does not look for rivals confirms nothing but by outliving them."""

    def on(self, fields: FieldSet, *, tell_apart: TellApart | None = None) -> BoundRecovery:
        """See Recovery."""
        return _NoRecovery()


@dataclass(frozen=True)
class _NoRecovery:
    seeks_rivals: ClassVar[bool] = False

    def recover(self, rng: np.random.Generator, particles: Particles, memory: Memory, now: Situation) -> Outcome:
        """See BoundRecovery."""
        return Outcome(particles, memory)

    def candidates(self, memory: Memory, odometry: Float64Array) -> Sequence[Place]:
        """See BoundRecovery."""
        return ()


def replaced(rng: np.random.Generator, particles: Particles, poses: Float64Array) -> Particles:
    """Particles with randomly chosen ones replaced by poses (M, 3) of average weight."""
    kept, log_weights = particles.poses.copy(), np.log(np.maximum(normalised(particles.log_weights), 1e-300))
    at = rng.permutation(len(particles))[: len(poses)]
    poses[:, 2] = wrap_angle(poses[:, 2])
    kept[at] = poses
    log_weights[at] = -np.log(len(particles))
    return Particles(kept, log_weights)


def still_found(before: tuple[Place, ...] | None, places: tuple[Place, ...]) -> tuple[Place, ...]:
    """The places that were among the survivors before and are found again; all of them when nothing was left or asked."""
    again = [place for place in places if before and near_pose(np.array([p.pose for p in before]), place.pose).any()]
    return tuple(again) or places


def has_twin(memory: Memory, estimate: Float64Array) -> bool:
    """Whether another place than the estimate (3,) has explained the views of every search so far, or none was made yet."""
    if memory.survivors is None:
        return True
    return not all(near_pose(place.pose[None], estimate)[0] for place in memory.survivors)


def moved_memory(memory: Memory, odometry: Float64Array) -> Memory:
    """The memory after the robot has moved by `odometry` (3,)."""
    if not memory.survivors:
        return memory
    moved = tuple(Place(compose(place.pose, odometry), place.score) for place in memory.survivors)
    return replace(memory, survivors=moved)


RECOVERIES: dict[str, type[Recovery]] = {
    "relocalise": Relocalise,
    "augmented": Augmented,
    "none": NoRecovery,
}
