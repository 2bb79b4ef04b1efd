"""A floor plan before it is a file: walls, openings, doors, fixtures, rooms; and what would make no file of it.

A draft is what importers and templates make: it says where things are. `wallkit.maps.draft.write` says it in URDF.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from wallkit.errors import MapError, closest
from wallkit.maps.classes import RESTROOM_V1, ClassInfo
from wallkit.maps.draft.doors import DraftDoor

WALL_HEIGHT_M = 2.5
# pieces of wall shorter than this beside an opening are rounding, not walls
SLIVER_M = 0.005


@dataclass(frozen=True, slots=True)
class DraftPane:
    """A thin sheet that fills a window, in the wall's centre plane."""

    name: str
    class_name: str = "glass"
    thickness_m: float = 0.01


@dataclass(frozen=True, slots=True)
class DraftOpening:
    """A hole in a wall: along (from, to) from the wall's start and z (from, to) from the floor [m]."""

    id: str
    kind: Literal["door", "window", "passage"]
    along: tuple[float, float]
    z: tuple[float, float]
    fill: DraftDoor | DraftPane | None = None


@dataclass(frozen=True, slots=True)
class DraftWall:
    """A straight wall by its axis on the floor, start and end (x, y) in frame map [m]; sigma_m: how well it is known."""

    name: str
    start: tuple[float, float]
    end: tuple[float, float]
    thickness_m: float
    height_m: float = WALL_HEIGHT_M
    openings: tuple[DraftOpening, ...] = ()
    class_name: str = "wall"
    sigma_m: float | None = None

    @property
    def length_m(self) -> float:
        return math.dist(self.start, self.end)


@dataclass(frozen=True, slots=True)
class DraftFixture:
    """A box that stands or hangs somewhere.

    Attributes:
        pose: (x, y, yaw) in frame map; +x points into the room. On a wall: the middle of its back. Free: of its footprint.
        size_m: (deep, wide, high) along its own x, y, z. bottom_m: its underside above the floor.
        wall: name of the wall it is fixed to; None: it stands on the floor.
    """

    name: str
    class_name: str
    pose: tuple[float, float, float]
    size_m: tuple[float, float, float]
    bottom_m: float = 0.0
    wall: str | None = None


@dataclass(frozen=True, slots=True)
class DraftRoom:
    """A room by its floor's corners, (x, y) in frame map, not closed, in either direction."""

    id: str
    kind: str
    floor: tuple[tuple[float, float], ...]


@dataclass(frozen=True, slots=True)
class DraftOrigin:
    """Where frame map lies on Earth: east, north [m] and yaw [rad] in a projected system."""

    kind: Literal["surveyed", "georef"]
    epsg: int
    east_m: float
    north_m: float
    yaw_rad: float


@dataclass(frozen=True, slots=True)
class Draft:
    """One level of a building.

    `classes` are those the taxonomy lacks, or has otherwise; `closed_corners` False leaves every wall exactly as drawn.
    """

    name: str
    walls: tuple[DraftWall, ...] = ()
    fixtures: tuple[DraftFixture, ...] = ()
    rooms: tuple[DraftRoom, ...] = ()
    classes: tuple[ClassInfo, ...] = ()
    level: str = "1"
    elevation_m: float = 0.0
    scan_plane_m: float | None = None
    origin: DraftOrigin | None = None
    source: str = ""
    closed_corners: bool = True


def check_draft(draft: Draft) -> None:
    """Refuse what cannot be written.

    Raises:
        MapError: two things of one name, an unknown class, a wall or box without extent, openings that overlap or leave
            their wall, a fixture on a wall that does not exist.
    """

    def fail(message: str, hint: str) -> MapError:
        return MapError(message, where=draft.source or draft.name, hint=hint)

    walls = {wall.name: wall for wall in draft.walls}
    fills = [opening.fill.name for wall in draft.walls for opening in wall.openings if opening.fill]
    names = Counter(["map", *(wall.name for wall in draft.walls), *(f.name for f in draft.fixtures), *fills])
    if twice := [name for name, count in names.items() if count > 1]:
        raise fail(f"the name '{twice[0]}' is used {names[twice[0]]} times", "every link needs a name of its own")
    known = {cls.name for cls in draft.classes} | set(RESTROOM_V1)
    for name, class_name in classes_used(draft):
        if class_name not in known:
            raise fail(f"'{name}' has the unknown class '{class_name}'", closest(class_name, known))
    for wall in draft.walls:
        sizes = (wall.length_m, wall.thickness_m, wall.height_m)
        if not all(math.isfinite(size) and size > 0 for size in sizes):
            raise fail(f"wall '{wall.name}' measures {_figures(sizes)} m", "all three must be above 0")
        reached = 0.0
        for opening in sorted(wall.openings, key=lambda o: o.along):
            (x0, x1), (z0, z1) = opening.along, opening.z
            if not (reached - SLIVER_M <= x0 < x1 <= wall.length_m + SLIVER_M and 0 <= z0 < z1 <= wall.height_m):
                raise fail(
                    f"opening '{opening.id}' from {x0:.6g} to {x1:.6g} m, z {z0:.6g} to {z1:.6g} m, does not fit into wall "
                    f"'{wall.name}', {_figures(sizes[::2])} m with {reached:.6g} m taken",
                    "openings lie inside their wall, one after another",
                )
            reached = x1
    for fixture in draft.fixtures:
        if not all(math.isfinite(size) and size > 0 for size in fixture.size_m):
            raise fail(f"'{fixture.name}' measures {_figures(fixture.size_m)} m", "all three must be above 0")
        if fixture.wall is not None and fixture.wall not in walls:
            raise fail(
                f"'{fixture.name}' is on the wall '{fixture.wall}', which is not there", closest(fixture.wall, walls)
            )


def classes_used(draft: Draft) -> Iterator[tuple[str, str]]:
    """(name, class) of everything in the draft."""
    for wall in draft.walls:
        yield wall.name, wall.class_name
        for opening in wall.openings:
            if isinstance(opening.fill, DraftPane):
                yield opening.fill.name, opening.fill.class_name
            elif opening.fill:
                yield opening.fill.name, "door"
    for fixture in draft.fixtures:
        yield fixture.name, fixture.class_name


def _figures(values: tuple[float, ...]) -> str:
    return " x ".join(f"{value:.6g}" for value in values)
