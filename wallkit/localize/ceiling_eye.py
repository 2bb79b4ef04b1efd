"""A likelihood of the ceiling with what it learned of the light, and what a view says for or against a pose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wallkit.core.ceiling import CeilingMap, CeilingView, colours_at
from wallkit.core.ceiling_eye import smoothed
from wallkit.core.geometry import compose, relative
from wallkit.core.raycast import HIT, LONG, SHORT
from wallkit.core.types import FieldSet, Float64Array, Int8Array
from wallkit.localize.ceiling import CeilingLikelihood
from wallkit.localize.ceiling_settings import CeilingSettings
from wallkit.localize.particles import Particles, normalised
from wallkit.localize.search import Place

# particles that the expected colour is taken over
_ASKED = 40
# they have gathered when they lie within a square of this side
_GATHERED_M = 1.0


@dataclass(frozen=True, slots=True)
class Light:
    """What the log's colours sum to, and what the map's would at the same views: their ratio is the gain of each channel."""

    seen: tuple[float, float, float] = (0.0, 0.0, 0.0)
    expected: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def gains(self) -> Float64Array:
        """(3,) image over map; ones before the first view."""
        seen, expected = np.array(self.seen), np.array(self.expected)
        if (expected <= 0).any() or (seen <= 0).any():
            return np.ones(3)
        return np.clip(seen / expected, 0.1, 10.0)


@dataclass(frozen=True)
class CeilingEyes:
    """The ceiling's part of a filter, on one map.

    Attributes:
        ceiling: blurred as views are.
    """

    settings: CeilingSettings
    ceiling: CeilingMap
    likelihood: CeilingLikelihood

    def is_new(self, looked: Float64Array | None, odometry: Float64Array) -> bool:
        """Whether the robot has moved enough since it last looked for another view to tell something."""
        if looked is None:
            return True
        moved, s = relative(looked, odometry), self.settings
        return bool(np.hypot(moved[0], moved[1]) >= s.distance_m or abs(moved[2]) >= np.deg2rad(s.turn_deg))

    def lit(self, view: CeilingView, light: Light) -> CeilingView:
        """The view in the map's light, as far as it is known."""
        return view.lit(light.gains) if self.settings.gain == "log" else view

    def learned(self, light: Light, particles: Particles, view: CeilingView) -> Light:
        """The light after a view, which shows on average what the map shows at the particles.

        Nothing is learned until they have gathered: a blue view under a ceiling of all colours is no blue light.
        """
        if self.settings.gain == "none" or not view.is_seen.any():
            return light
        edges = np.cumsum(normalised(particles.log_weights))
        asked = np.searchsorted(edges, (np.arange(_ASKED) + 0.5) / _ASKED * edges[-1])
        poses = particles.poses[np.minimum(asked, len(particles) - 1)]
        if np.ptp(poses[:, :2], axis=0).max() > _GATHERED_M:
            return light
        colours, known = colours_at(self.ceiling, poses, view)
        if not known.any():
            return light
        keep = 0.5 ** (1 / self.settings.gain_views)
        # medians: a view may show a piece of wall
        seen = keep * np.array(light.seen) + np.median(view.colours[view.is_seen], axis=0)
        expected = keep * np.array(light.expected) + np.median(colours[known], axis=0)
        return Light(tuple(seen.tolist()), tuple(expected.tolist()))

    def agreement(self, pose: Float64Array, view: CeilingView) -> Int8Array:
        """(P,) HIT where a place of the view (lit) has the map's colour, LONG where another, SHORT where one is not known.

        A view may be exposed otherwise than the map.
        """
        colours, known = colours_at(self.ceiling, pose, view)
        if known.any():
            exposure = np.median(
                view.colours.reshape(-1, 3)[known[0]].sum(axis=1) / (colours[known].sum(axis=1) + 0.01)
            )
            colours = colours * np.float32(np.clip(exposure, 0.5, 2.0))
        off = np.sqrt(np.mean((view.colours.reshape(-1, 3) - colours[0]) ** 2, axis=1))
        return np.where(~known[0], SHORT, np.where(off <= self.settings.tolerance, HIT, LONG)).astype(np.int8)

    def tell_apart(
        self,
        places: Sequence[Place],
        odometry: Float64Array,
        sights: Sequence[tuple[Float64Array, CeilingView]],
    ) -> Sequence[Place]:
        """The places at which the last views of the ceiling are about as likely as at the best of them."""
        if not places:
            return places
        standing = np.array([self.standing(place.pose, odometry, sights) for place in places])
        keep = standing >= standing.max() - self.settings.tell_apart
        return tuple(place for place, kept in zip(places, keep, strict=True) if kept)

    def standing(
        self, place: Float64Array, odometry: Float64Array, sights: Sequence[tuple[Float64Array, CeilingView]]
    ) -> float:
        """Log-likelihood of the last views, had the robot come to a place (3,) along its odometry."""
        total = 0.0
        for taken_at, view in sights:
            then = compose(place, relative(odometry, taken_at))
            total += float(self.likelihood.log_likelihood(then[None], view)[0])
        return total


def ceiling_eyes(settings: CeilingSettings, ceiling: CeilingMap, *, threads: int = 1) -> CeilingEyes:
    """The ceiling's part of a filter for one map, its look-up tables prepared.

    Raises:
        MapError: the map is grey and the model compares colours.
    """
    blurred = smoothed(ceiling, settings.smooth_m)
    return CeilingEyes(settings, blurred, settings.model.on(blurred, threads=threads))


def fields_of_ceiling(ceiling: CeilingMap, cell_m: float = 0.1) -> FieldSet:
    """A map without walls whose free space is where the ceiling is seen: to spread particles when there is no other map."""
    step = max(1, round(cell_m / ceiling.resolution_m))
    is_free = np.asarray(ceiling.is_seen[step // 2 :: step, step // 2 :: step])
    cell = step * ceiling.resolution_m
    far = np.full(is_free.shape, 100.0, dtype=np.float32)
    return FieldSet({"all": far}, is_free, cell, ceiling.origin, ceiling.source)
