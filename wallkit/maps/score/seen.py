"""Looks round from many places -> what a LiDAR has to go by in a map: directions, glass, movable things, classes."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from wallkit.core.types import BoolArray, Float64Array
from wallkit.maps.score.world import ScoreSettings, World
from wallkit.maps.sight import Sighting, cast_beams, index_segments

# finer than the scans that are matched
_BEAMS = 180
_BIN_M = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """What is seen from a set of poses.

    Attributes:
        open_directions: (N,) the direction that a pose's returns leave open [rad, in 0..pi], NaN where there is none.
        is_empty: (N,) nothing is in range.
        glass_share, movable_share: shares of the length of all visible boundary.
        from_share: per class at this height, the share of the poses from which it is seen.
    """

    open_directions: Float64Array
    is_empty: BoolArray
    glass_share: float
    movable_share: float
    from_share: dict[str, float]

    @property
    def degenerate(self) -> BoolArray:
        """(N,) whether the returns leave one direction open."""
        return np.isfinite(self.open_directions)

    @property
    def open_direction(self) -> float | None:
        """The mean of the open directions [rad, in 0..pi]; None without any."""
        found = self.open_directions[self.degenerate]
        # directions have no sense, so their doubled angles are averaged
        return float(np.angle(np.exp(2j * found).mean()) / 2.0 % math.pi) if len(found) else None


def look_from(world: World, poses: Float64Array, settings: ScoreSettings) -> Seen:
    """What is seen from poses (N, 3), all the way round and up to the LiDAR's range."""
    look = np.linspace(0.0, 2 * math.pi, _BEAMS, endpoint=False, dtype=np.float64)
    returns = world.p_return >= settings.p_return_min
    seen = cast_beams(index_segments(world.segments), poses, look, range_max_m=settings.max_range_m)
    returned = seen
    if not returns.all():
        sight = index_segments(world.segments, seen=returns)
        returned = cast_beams(sight, poses, look, range_max_m=settings.max_range_m)
    lengths = _visible_lengths(world.segments, poses, look, seen)
    return Seen(
        open_directions=_open_directions(world.segments, returned, settings.degenerate_below),
        is_empty=np.asarray(np.isinf(returned.ranges_m).all(axis=1)),
        glass_share=_share(lengths, world.glass),
        movable_share=_share(lengths, world.movable),
        from_share=_from_share(world, seen),
    )


def _visible_lengths(
    segments: Float64Array, poses: Float64Array, bearings: Float64Array, seen: Sighting
) -> Float64Array:
    """(S,) length of each segment that some pose sees [m], in bins of at most _BIN_M."""
    lengths = np.hypot(segments[:, 2] - segments[:, 0], segments[:, 3] - segments[:, 1])
    bins = np.maximum(np.ceil(lengths / _BIN_M), 1).astype(np.int64)
    ends = np.cumsum(bins)
    hit = seen.segments >= 0
    met = seen.segments[hit]
    headings = (poses[:, 2:3] + bearings)[hit]
    starts = np.repeat(poses[:, :2], len(bearings), axis=0)[hit.ravel()]
    points = starts + seen.ranges_m[hit][:, None] * np.column_stack([np.cos(headings), np.sin(headings)])
    along = np.hypot(*(points - segments[met, :2]).T) / np.maximum(lengths[met], 1e-12)
    reached = np.zeros(ends[-1], dtype=np.bool_)
    reached[(ends - bins)[met] + np.minimum((along * bins[met]).astype(np.int64), bins[met] - 1)] = True
    return np.asarray(np.add.reduceat(reached, ends - bins, dtype=np.int64) * lengths / bins)


def _open_directions(segments: Float64Array, returned: Sighting, below: float) -> Float64Array:
    """(N,) direction [rad, in 0..pi] in which less than a share of the information lies; NaN where both are well seen.

    The translation information matrix is the sum of n n^T over the returns' normals; of its trace, the weaker eigenvalue
    has the share (1 - |mean of exp(2 i angle of n)|) / 2, and its eigenvector lies across the mean normal.
    """
    across = segments[:, 2:] - segments[:, :2]
    normals = np.arctan2(across[:, 1], across[:, 0]) + math.pi / 2
    hit = returned.segments >= 0
    count = hit.sum(axis=1)
    doubled = np.where(hit, np.exp(2j * normals[returned.segments]), 0.0).sum(axis=1)
    mean = doubled / np.maximum(count, 1)
    is_open = (count > 0) & ((1.0 - np.abs(mean)) / 2.0 < below)
    return np.where(is_open, (np.angle(mean) / 2.0 + math.pi / 2) % math.pi, np.nan)


def _from_share(world: World, seen: Sighting) -> dict[str, float]:
    """Share of the poses from which each class is seen, for the classes at this height."""
    hit = np.where(seen.segments >= 0, world.classes[seen.segments], -1)
    return {
        world.class_names[index]: float((hit == index).any(axis=1).mean())
        for index in np.unique(world.classes).tolist()
    }


def _share(lengths: Float64Array, part: BoolArray) -> float:
    total = float(lengths.sum())
    return float(lengths[part].sum()) / total if total > 0 else 0.0
