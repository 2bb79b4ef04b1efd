"""Doorways drawn beside or on top of the walls -> openings in the walls they lie in."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from wallkit.maps.draft.doors import DraftDoor
from wallkit.maps.draft.draft import DraftOpening, DraftWall


def hang_doors(doors: Sequence[DraftWall], walls: Sequence[DraftWall]) -> Iterator[DraftWall]:
    """The walls, with those doorways that lie in a wall cut into it; the others stay pieces of wall of their own."""
    cut: dict[str, list[DraftOpening]] = {}
    alone: list[DraftWall] = []
    for door in doors:
        host = next((found for wall in walls if (found := _opening_in(wall, door, cut.get(wall.name, [])))), None)
        if host:
            cut.setdefault(host[0], []).append(host[1])
        else:
            alone.append(door)
    for wall in walls:
        yield replace(wall, openings=tuple(cut.get(wall.name, ())))
    yield from alone


def _opening_in(wall: DraftWall, door: DraftWall, taken: list[DraftOpening]) -> tuple[str, DraftOpening] | None:
    """The door's opening as seen from a wall it lies in; None if it does not."""
    start, along = np.array(wall.start), (np.array(wall.end) - wall.start) / wall.length_m
    normal = np.array([-along[1], along[0]])
    x, y = ([float((np.array(p) - start) @ axis) for p in (door.start, door.end)] for axis in (along, normal))
    low, high = min(x), max(x)
    is_inside = max(map(abs, y)) <= wall.thickness_m / 2 and low >= 0 and high <= wall.length_m
    if not is_inside or any(low < o.along[1] and high > o.along[0] for o in taken):
        return None
    (opening,) = door.openings
    if not isinstance(opening.fill, DraftDoor):
        return None
    fill = opening.fill
    if x[1] < x[0]:
        # the door is drawn against the wall's direction
        fill = replace(
            fill,
            hinge="end" if fill.hinge == "start" else "start",
            side="left" if fill.side == "right" else "right",
        )
    top_m = min(opening.z[1], wall.height_m)
    return wall.name, replace(opening, along=(low, high), z=(0.0, top_m), fill=fill)
