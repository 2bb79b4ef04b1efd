"""New: drafts of an empty room, a corridor and a restroom, by their inner sizes; each is valid without a warning."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from wallkit.errors import MapError
from wallkit.maps.draft.doors import CLEARANCE_M, DraftDoor
from wallkit.maps.draft.draft import Draft, DraftFixture, DraftOpening, DraftRoom, DraftWall
from wallkit.maps.edit.add import SIZES

DOOR_HEIGHT_M = 2.1
# of a cubicle; the partition stands between two
CUBICLE_M = 0.95
URINAL_PITCH_M = 0.75
SINK_PITCH_M = 0.80
# between the end of a row and the wall beside it, and between a door and a corner
ASIDE_M = 0.15
# what a door needs before the farther of its ends: its leaf, open, and some
_BEYOND_DOOR_M = 0.1


@dataclass(frozen=True, slots=True)
class TemplateSizes:
    """What a template is made to [m].

    Attributes:
        length_m, width_m: inside, along x and y. corridor_m: width of the corridor before a restroom.
        toilets, urinals, sinks: how many of each a restroom has.
    """

    length_m: float
    width_m: float
    height_m: float = 2.7
    thickness_m: float = 0.12
    door_m: float = 0.9
    corridor_m: float = 2.0
    toilets: int = 2
    urinals: int = 2
    sinks: int = 2
    level: str = "1"
    scan_plane_m: float = 0.3


def new_draft(template: str, name: str, sizes: TemplateSizes) -> Draft:
    """The draft of a template.

    Raises:
        MapError: there is no such template, a size is not positive, or what it holds does not fit into it.
    """
    for what in ("length_m", "width_m", "height_m", "thickness_m", "door_m", "corridor_m"):
        value = getattr(sizes, what)
        if not (math.isfinite(value) and value > 0):
            raise MapError(
                f"a {what.removesuffix('_m')} of {value:g} m", where=f"new {template}", hint="it must be above 0"
            )
    if sizes.height_m <= DOOR_HEIGHT_M:
        message = f"walls {sizes.height_m:g} m high have no room for a door of {DOOR_HEIGHT_M:g} m"
        raise MapError(message, where=f"new {template}", hint="--height 2.5")
    if not 0 < sizes.scan_plane_m < DOOR_HEIGHT_M:
        message = f"the scan plane is {sizes.scan_plane_m:g} m up"
        raise MapError(message, where=f"new {template}", hint=f"--scan-plane between 0 and {DOOR_HEIGHT_M:g}")
    return TEMPLATES[template](name, sizes)


def _room(name: str, sizes: TemplateSizes) -> Draft:
    """Four walls, one door to the outside in the south wall."""
    need_m = sizes.door_m + 2 * ASIDE_M
    _check_fits(sizes.length_m, need_m, "the door", "room", "--size", "--door")
    # not in the middle: a room with its door there has two ends that look the same
    start = ASIDE_M + (sizes.length_m - need_m) / 4
    _check_fits(sizes.width_m, sizes.door_m + _BEYOND_DOOR_M, "the open door", "room", "--size", "--door")
    door = _door("d1", "door_1", start, sizes, connects=("outside", "room"))
    walls = _ring(0.0, 0.0, sizes.length_m, sizes.width_m, sizes, south=(door,))
    return _draft(name, sizes, walls, rooms=(_floor("room", "room", 0.0, 0.0, sizes.length_m, sizes.width_m),))


def _corridor(name: str, sizes: TemplateSizes) -> Draft:
    """A long room with a door in each end wall."""
    need_m = sizes.door_m + 2 * ASIDE_M
    _check_fits(sizes.width_m, need_m, "a door", "corridor", "--size", "--door")
    _check_fits(sizes.length_m, 2 * (sizes.door_m + _BEYOND_DOOR_M), "two open doors", "corridor", "--size", "--door")
    # both on the same side of the axis: turned by 180 degrees the corridor looks otherwise
    west = _door("d1", "door_w", ASIDE_M, sizes, side="right", connects=("corridor", "outside"))
    east = _door("d2", "door_e", ASIDE_M, sizes, connects=("outside", "corridor"))
    walls = _ring(0.0, 0.0, sizes.length_m, sizes.width_m, sizes, west=(west,), east=(east,))
    return _draft(name, sizes, walls, rooms=(_floor("corridor", "corridor", 0.0, 0.0, sizes.length_m, sizes.width_m),))


def _restroom(name: str, sizes: TemplateSizes) -> Draft:
    """A corridor along x, and north of it a restroom: toilets in cubicles, urinals in the west, sinks beside the door."""
    t, length, width, hall = sizes.thickness_m, sizes.length_m, sizes.width_m, sizes.corridor_m
    y0 = hall + t
    stalls_m, urinals_m = sizes.toilets * CUBICLE_M, sizes.urinals * URINAL_PITCH_M
    sinks_m = sizes.sinks * SINK_PITCH_M
    depth_m = SIZES["partition"].size_m[0] if sizes.toilets else 0.0
    for count, what in ((sizes.toilets, "toilets"), (sizes.urinals, "urinals"), (sizes.sinks, "sinks")):
        if count < 0:
            raise MapError(f"{count} {what}", where="new restroom", hint="0 or more")
    beside_m = SIZES["urinal"].size_m[0] if sizes.urinals else 0.0
    _check_fits(length, stalls_m + beside_m + ASIDE_M, f"{sizes.toilets} toilets", "restroom", "--size", "--toilets")
    _check_fits(
        width, urinals_m + ASIDE_M + sizes.door_m, f"{sizes.urinals} urinals", "restroom", "--size", "--urinals"
    )
    _check_fits(width, depth_m + sizes.door_m + _BEYOND_DOOR_M, "cubicles and the door", "restroom", "--size", "--door")
    row_m = 2 * ASIDE_M + sizes.door_m + sinks_m + ASIDE_M
    _check_fits(length, row_m, f"the door and {sizes.sinks} sinks", "restroom", "--size", "--sinks")
    _check_fits(hall, sizes.door_m + _BEYOND_DOOR_M, "the door to the outside", "corridor", "--corridor", "--door")

    entry = _door("d2", "door_out", ASIDE_M, sizes, connects=("outside", "corridor"))
    inner = _door("d1", "door_m", ASIDE_M, sizes, connects=("corridor", "restroom"))
    outer = _ring(0.0, 0.0, length, y0 + width, sizes, east=(entry,))
    ends = (-t / 2, hall + t / 2), (length + t / 2, hall + t / 2)
    middle = DraftWall("wall_mid", *ends, t, sizes.height_m, (_shifted(inner, t / 2),))
    fixtures: list[DraftFixture] = []
    for k in range(sizes.toilets):
        x = length - CUBICLE_M * (k + 0.5)
        fixtures.append(_on_wall("toilet", k + 1, (x, y0 + width, -math.pi / 2), "wall_n"))
        fixtures.append(_on_wall("partition", k + 1, (x - CUBICLE_M / 2, y0 + width, -math.pi / 2), "wall_n"))
    for k in range(sizes.urinals):
        y = y0 + width - ASIDE_M - URINAL_PITCH_M * (k + 0.5)
        fixtures.append(_on_wall("urinal", k + 1, (0.0, y, 0.0), "wall_w"))
    for k in range(sizes.sinks):
        x = length - ASIDE_M - SINK_PITCH_M * (k + 0.5)
        fixtures.append(_on_wall("sink", k + 1, (x, y0, math.pi / 2), "wall_mid"))
        fixtures.append(_on_wall("mirror", k + 1, (x, y0, math.pi / 2), "wall_mid"))
    rooms = (
        _floor("corridor", "corridor", 0.0, 0.0, length, hall),
        _floor("restroom", "restroom", 0.0, y0, length, y0 + width),
    )
    return _draft(name, sizes, (*outer, middle), fixtures=tuple(fixtures), rooms=rooms)


# ------------------------------------------------------------------------------------------------- details


def _ring(
    x0: float,
    y0: float,
    x1: float,
    y1: float,
    sizes: TemplateSizes,
    *,
    south: tuple[DraftOpening, ...] = (),
    west: tuple[DraftOpening, ...] = (),
    east: tuple[DraftOpening, ...] = (),
) -> tuple[DraftWall, ...]:
    """Four walls around a rectangle of free floor; openings are given from its corner."""
    h = sizes.thickness_m / 2
    ends = {
        "wall_s": ((x0 - h, y0 - h), (x1 + h, y0 - h), south),
        "wall_n": ((x0 - h, y1 + h), (x1 + h, y1 + h), ()),
        "wall_w": ((x0 - h, y0 - h), (x0 - h, y1 + h), west),
        "wall_e": ((x1 + h, y0 - h), (x1 + h, y1 + h), east),
    }
    return tuple(
        DraftWall(name, start, end, sizes.thickness_m, sizes.height_m, tuple(_shifted(one, h) for one in openings))
        for name, (start, end, openings) in ends.items()
    )


def _shifted(opening: DraftOpening, by_m: float) -> DraftOpening:
    x0, x1 = opening.along
    return DraftOpening(opening.id, opening.kind, (x0 + by_m, x1 + by_m), opening.z, opening.fill)


def _door(
    opening: str,
    name: str,
    start_m: float,
    sizes: TemplateSizes,
    *,
    side: str = "left",
    connects: tuple[str, str],
) -> DraftOpening:
    """A door that opens into the rooms, its hinge at the start."""
    if sizes.door_m <= 3 * CLEARANCE_M:
        raise MapError(f"a door of {sizes.door_m:g} m", where="new", hint="--door 0.9")
    fill = DraftDoor(name, "hinged", "start", "left" if side == "left" else "right", connects=connects)
    return DraftOpening(opening, "door", (start_m, start_m + sizes.door_m), (0.0, DOOR_HEIGHT_M), fill)


def _on_wall(class_name: str, number: int, pose: tuple[float, float, float], wall: str) -> DraftFixture:
    usual = SIZES[class_name]
    return DraftFixture(f"{class_name}_{number}", class_name, pose, usual.size_m, usual.bottom_m, wall)


def _floor(name: str, kind: str, x0: float, y0: float, x1: float, y1: float) -> DraftRoom:
    return DraftRoom(name, kind, ((x0, y0), (x1, y0), (x1, y1), (x0, y1)))


def _check_fits(has_m: float, needs_m: float, what: str, template: str, *flags: str) -> None:
    if has_m < needs_m - 1e-9:
        message = f"{what} need{'s' * (not what.endswith('s'))} {needs_m:.3g} m, there are {has_m:.3g} m"
        raise MapError(message, where=f"new {template}", hint=f"change {' or '.join(flags)}")


def _draft(
    name: str,
    sizes: TemplateSizes,
    walls: tuple[DraftWall, ...],
    *,
    fixtures: tuple[DraftFixture, ...] = (),
    rooms: tuple[DraftRoom, ...],
) -> Draft:
    return Draft(name, walls, fixtures, rooms, level=sizes.level, scan_plane_m=sizes.scan_plane_m)


TEMPLATES: Mapping[str, Callable[[str, TemplateSizes], Draft]] = {
    "room": _room,
    "corridor": _corridor,
    "restroom": _restroom,
}
