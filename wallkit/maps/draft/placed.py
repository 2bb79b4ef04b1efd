"""A draft's walls -> where each wall's frame stands and how long it is once its corners are closed."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from wallkit.maps.draft.draft import SLIVER_M, Draft, DraftOpening, DraftWall
from wallkit.maps.draft.joints import end_closures


@dataclass(frozen=True, slots=True)
class PlacedWall:
    """A wall with its corners closed: the pose of its frame, its length, and its openings from the new start."""

    wall: DraftWall
    pose: tuple[float, float, float]
    length_m: float
    openings: tuple[DraftOpening, ...]


def placed_walls(draft: Draft) -> Iterator[PlacedWall]:
    """The draft's walls as they are written, in the same order."""
    axes = np.array([(*wall.start, *wall.end) for wall in draft.walls], dtype=np.float64).reshape(-1, 4)
    closures = np.zeros((len(axes), 2))
    if draft.closed_corners:
        closures = end_closures(axes, np.array([wall.thickness_m for wall in draft.walls]))
    for wall, (at_start, at_end) in zip(draft.walls, closures.tolist(), strict=True):
        yaw = math.atan2(wall.end[1] - wall.start[1], wall.end[0] - wall.start[0])
        pose = (wall.start[0] - at_start * math.cos(yaw), wall.start[1] - at_start * math.sin(yaw), yaw)
        length_m = wall.length_m + at_start + at_end
        yield PlacedWall(wall, pose, length_m, tuple(_shifted(wall.openings, at_start, length_m)))


def _shifted(openings: tuple[DraftOpening, ...], shift_m: float, length_m: float) -> Iterator[DraftOpening]:
    """The openings in order, from the wall's new start; a corner that was closed takes from an opening beside it."""
    for opening in sorted(openings, key=lambda o: o.along):
        x0, x1 = (min(max(x + shift_m, 0.0), length_m) for x in opening.along)
        x0 = 0.0 if x0 < SLIVER_M else x0
        x1 = length_m if length_m - x1 < SLIVER_M else x1
        yield DraftOpening(opening.id, opening.kind, (x0, x1), opening.z, opening.fill)
