"""Add walls, fixtures, rooms and classes to a map that is there; doors and windows are in `add_openings`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Literal

import numpy as np

from wallkit.core.geometry import compose
from wallkit.core.types import Float64Array
from wallkit.maps.classes import ClassInfo
from wallkit.maps.document import Edit, Element, wk
from wallkit.maps.draft.draft import SLIVER_M, DraftFixture, DraftRoom, DraftWall
from wallkit.maps.draft.joints import stop_at
from wallkit.maps.draft.placed import PlacedWall
from wallkit.maps.draft.xml import class_line, fixture_lines, number_text, numbers_text, room_line, wall_lines
from wallkit.maps.edit.changes import Changes, appended, inserted_behind, inserted_first
from wallkit.maps.edit.lookup import Wall, check_new, class_named, numbered, refuse, room_named, wall_named
from wallkit.maps.importers.fixtures import USUAL_SIZES, UsualSize
from wallkit.maps.rules.base import Context
from wallkit.maps.rules.floods import sealed, sealed_regions
from wallkit.maps.rules.rooms import room_polygons
from wallkit.maps.walls import WallRun

Side = Literal["left", "right"]
# how far before a wall's face a room is looked for
BESIDE_M = 0.2
# of a flooded floor, corners that are less than this off a straight line are none
_STRAIGHT_M = 0.005

# those of plans and further ones, of the usual ware; a mirror is thin, a partition stands off the floor
SIZES: Mapping[str, UsualSize] = {
    **USUAL_SIZES,
    "mirror": UsualSize((0.006, 0.60, 0.80), 1.10),
    "partition": UsualSize((1.50, 0.025, 1.80), 0.15),
    "dispenser": UsualSize((0.12, 0.28, 0.35), 1.10),
    "radiator": UsualSize((0.10, 1.00, 0.60), 0.15),
    "column": UsualSize((0.40, 0.40, 2.50), on_wall=False),
    "furniture": UsualSize((0.60, 1.20, 0.75), on_wall=False),
}


def add_wall(context: Context, wall: DraftWall) -> Changes:
    """A wall; an end that lies in another wall stops at that wall's face.

    Raises:
        MapError: the name is taken, or the wall has no length, thickness or height.
    """
    check_new(context, wall.name, f"at_{wall.name}")
    class_named(context, wall.class_name)
    sizes = {"length": wall.length_m, "thickness": wall.thickness_m, "height": wall.height_m}
    for what, size in sizes.items():
        if not (math.isfinite(size) and size > 0):
            raise refuse(context, f"wall '{wall.name}' has a {what} of {size:g} m", "it must be above 0")
    axis = np.array([wall.start, wall.end])
    inward = (axis[1] - axis[0]) / wall.length_m
    closures, said = [], []
    for which, point, into in (("start", axis[0], inward), ("end", axis[1], -inward)):
        run = _run_at(context, point)
        extra_m = 0.0
        if run is not None:
            offset = point - run.start
            extra_m = stop_at(offset, into, wall.thickness_m, run.direction, run.thickness_m)
            if abs(extra_m) > SLIVER_M:
                there = numbers_text(tuple((point - extra_m * into).tolist()))
                said.append(
                    f"{wall.name}: its {which} {numbers_text(tuple(point.tolist()))} -> {there}, the face of {run.link}"
                )
        closures.append(extra_m)
    length_m = wall.length_m + sum(closures)
    if length_m < SLIVER_M:
        raise refuse(context, f"wall '{wall.name}' lies within other walls", "draw it from one wall to another")
    start = axis[0] - closures[0] * inward
    pose = (float(start[0]), float(start[1]), math.atan2(inward[1], inward[0]))
    lines = list(wall_lines(PlacedWall(wall, pose, length_m, ())))
    first = (
        f"{wall.name}: added, {wall.class_name}, from {numbers_text(pose[:2])} to "
        f"{numbers_text(tuple((start + length_m * inward).tolist()))}, {number_text(length_m)} m long, "
        f"{number_text(wall.thickness_m)} thick, {number_text(wall.height_m)} high"
    )
    return Changes(appended(context.root, lines), (first, *said))


def add_fixture(
    context: Context,
    class_name: str,
    name: str = "",
    *,
    on: tuple[str, float, str] | None = None,
    pose: tuple[float, float, float] | None = None,
    size_m: tuple[float, float, float] | None = None,
    bottom_m: float | None = None,
) -> Changes:
    """A box of a class, on a wall or free.

    Args:
        name: by default the class with a number.
        on: (wall, metres along it to the fixture's middle, side: left, right, the room on it, or "" for the only room).
        pose: (x, y, yaw) in the map of what stands free. size_m: (deep, wide, high), by default usual for the class.
        bottom_m: height of its underside.

    Raises:
        MapError: unknown class, wall or room, a place beside its wall, no size, or a size that is not positive.
    """
    class_named(context, class_name)
    name = name or numbered({*context.map.links, *context.map.joints}, class_name)
    check_new(context, name, f"at_{name}")
    usual = SIZES.get(class_name)
    if size_m is None and usual is None:
        raise refuse(context, f"nothing is known about the size of a {class_name}", "say it: --size DEEP,WIDE,HIGH")
    size = size_m or usual.size_m  # type: ignore[union-attr]  # one of the two is there
    bottom = bottom_m if bottom_m is not None else usual.bottom_m if usual is not None else 0.0
    if not all(math.isfinite(value) and value > 0 for value in size):
        raise refuse(context, f"'{name}' measures {' x '.join(map(number_text, size))} m", "all three must be above 0")
    if (on is None) == (pose is None):
        raise refuse(context, f"where does '{name}' stand?", "on a wall: --in WALL --at X; free: --pose X,Y,YAW")
    if pose is not None:
        lines = list(fixture_lines(DraftFixture(name, class_name, pose, size, bottom), None))
        place = f"at {numbers_text(pose)} in the map"
    else:
        fixture, placed, place = _on_wall(context, DraftFixture(name, class_name, (0, 0, 0), size, bottom), on)  # type: ignore[arg-type]  # checked
        lines = list(fixture_lines(fixture, placed))
    measures = " x ".join(map(number_text, size))
    said = f"{name}: added, {class_name}, {place}, {measures} m, {number_text(bottom)} m above the floor"
    return Changes(appended(context.root, lines), (said,))


def add_room(
    context: Context,
    name: str,
    kind: str = "",
    *,
    floor: Float64Array | None = None,
    at: tuple[float, float] | None = None,
) -> Changes:
    """A room by its corners (V, 2), or by a point in it: then its floor is what the walls enclose, doors closed.

    Raises:
        MapError: the id is taken, there is no header, the corners make no polygon, or the point lies in a wall or outside.
    """
    from shapely import Polygon

    if name in context.map.rooms:
        raise refuse(context, f"there is a room '{name}' already", "choose another id")
    if at is not None:
        floor = _flooded(context, at)
    if floor is None or len(floor) < 3 or not Polygon(floor).is_valid or Polygon(floor).area <= 0:
        raise refuse(
            context, f"the floor of room '{name}' is no polygon", "--floor 'X Y  X Y  X Y', or a point: --at X,Y"
        )
    for other, polygon in context.once(room_polygons).items():
        common = polygon.intersection(Polygon(floor)).area
        if (
            common > context.tolerances.room_overlap_m**2
            and polygon.intersection(Polygon(floor)).buffer(-0.025).area > 0
        ):
            message = f"room '{name}' would share {common:.3g} m2 with room '{other}'"
            hint = f"a piece of floor belongs to one room: first wallkit map remove {context.document.source} {other}"
            raise refuse(context, message, hint)
    corners = tuple((float(x), float(y)) for x, y in floor)
    edits = _in_header(context, room_line(DraftRoom(name, kind, corners)), wk("room"))
    said = f"room {name}: added, {len(corners)} corners, {number_text(round(Polygon(floor).area, 4))} m2"
    return Changes(edits, (said,))


def add_class(context: Context, info: ClassInfo) -> Changes:
    """A row of the class table; for a class of the taxonomy it replaces what that says.

    Raises:
        MapError: the table has it, there is no header, p_return is no probability, or an id is another class's.
    """
    if any(row.name == info.name for row in context.map.all_classes):
        hint = f"change it: wallkit map set {context.document.source} {info.name} KEY=VALUE"
        raise refuse(context, f"the class table has '{info.name}' already", hint)
    if info.p_return is not None and not 0 <= info.p_return <= 1:
        raise refuse(context, f"p_return is {info.p_return:g}", "a probability, from 0 to 1")
    for row in context.map.all_classes:
        if shared := set(row.seg) & set(info.seg):
            raise refuse(
                context, f"class '{row.name}' has the segmentation id {min(shared)}", "each id means one class"
            )
    line = class_line(replace(info, p_return=info.p_return))
    said = f"class {info.name}: added, seg {' '.join(map(str, info.seg)) or 'none'}, {info.lidar}"
    return Changes(_in_header(context, line, wk("class")), (said,))


def rooms_beside(context: Context, wall: Wall, along_m: float) -> dict[Side, str]:
    """The rooms right and left of a wall at a place along it; "" where there is none."""
    from shapely import Point

    found: dict[Side, str] = {}
    for side, sign in (("right", -1), ("left", 1)):
        at = (wall.T_map_wall @ [along_m, sign * (wall.thickness_m / 2 + BESIDE_M), 0.0, 1.0])[:2]
        inside = (name for name, floor in context.once(room_polygons).items() if floor.contains(Point(at)))
        found[side] = next(inside, "")  # type: ignore[index]  # the two words of Side
    return found


def side_named(context: Context, wall: Wall, along_m: float, word: str) -> Side:
    """left or right of a wall, by that word, by in (left) and out (right), or by the room on that side.

    Raises:
        MapError: no side is named so.
    """
    rooms = rooms_beside(context, wall, along_m)
    words: dict[str, Side] = {"left": "left", "in": "left", "right": "right", "out": "right"}
    words |= {room: side for side, room in rooms.items() if room and room not in words}
    if word in words:
        return words[word]
    if not word:
        known = [side for side, room in rooms.items() if room]
        if len(known) == 1:
            return known[0]
        where = " and ".join(f"'{room}'" for room in rooms.values() if room) or "no room on either side"
        raise refuse(
            context, f"which side of wall '{wall.link.name}'? There is {where}", "--side left, right or a room"
        )
    room_named(context, word)
    raise refuse(
        context,
        f"room '{word}' is not beside wall '{wall.link.name}' at {number_text(along_m)} m",
        f"one of: {', '.join(words)}",
    )


# ------------------------------------------------------------------------------------------------- details


def _run_at(context: Context, point: Float64Array) -> WallRun | None:
    """The wall whose footprint a point lies in or on, the one with the nearest axis."""
    from shapely import LineString, Point

    at = Point(point)
    near = [run for run in context.runs if run.footprint.distance(at) <= SLIVER_M]
    return min(near, key=lambda run: LineString([run.start, run.end]).distance(at), default=None)


def _on_wall(
    context: Context, fixture: DraftFixture, on: tuple[str, float, str]
) -> tuple[DraftFixture, PlacedWall, str]:
    name, along_m, word = on
    wall = wall_named(context, name)
    half = fixture.size_m[1] / 2
    if along_m - half < wall.bounds[0] - SLIVER_M or along_m + half > wall.bounds[2] + SLIVER_M:
        message = (
            f"'{fixture.name}', {number_text(2 * half)} m wide, would reach from {number_text(along_m - half)} to "
            f"{number_text(along_m + half)} m, wall '{name}' goes from {number_text(wall.bounds[0])} to "
            f"{number_text(wall.bounds[2])} m"
        )
        raise refuse(context, message, "--at is its middle, from the wall's start")
    side = side_named(context, wall, along_m, word)
    sign = 1.0 if side == "left" else -1.0
    x, y, yaw = compose(wall.pose, (along_m, sign * wall.thickness_m / 2, sign * math.pi / 2)).tolist()
    drawn = DraftWall(name, (0.0, 0.0), (1.0, 0.0), wall.thickness_m)
    room = rooms_beside(context, wall, along_m)[side]
    place = f"on {name} at {number_text(along_m)} m, {side} side" + f" ({room})" * bool(room)
    return replace(fixture, pose=(x, y, yaw), wall=name), PlacedWall(drawn, wall.pose, 1.0, ()), place


def _flooded(context: Context, at: tuple[float, float]) -> Float64Array:
    """Corners (V, 2) of the floor that walls, closed doors and panes enclose around a point."""
    from shapely import LinearRing, Point, get_coordinates

    regions = context.once(sealed_regions)
    region = next((region for region in regions if region.polygon.contains(Point(at))), None)
    if region is None and any(polygon.contains(Point(at)) for polygon in context.once(sealed)):
        raise refuse(context, f"({at[0]:g}, {at[1]:g}) lies in something solid", "name a point on the free floor")
    if region is None or region.is_outside:
        raise refuse(context, f"({at[0]:g}, {at[1]:g}) is not enclosed by walls", "close the gaps (`wallkit map snap`)")
    ring = get_coordinates(region.polygon.exterior)[:-1]
    # the westernmost point is a corner, whichever the flood began with
    ring = np.roll(ring, -int(np.lexsort((ring[:, 1], ring[:, 0]))[0]), axis=0)
    corners = get_coordinates(LinearRing(ring).simplify(_STRAIGHT_M))[:-1]
    return np.asarray(np.round(corners, 4))


def _in_header(context: Context, line: str, tag: str) -> tuple[Edit, ...]:
    """A row behind the last one of its kind in <wk:map>."""
    header = context.map.header.element
    if header is None:
        hint = f"write it: wallkit map adopt {context.document.source}"
        raise refuse(context, "there is no <wk:map> header", hint)
    rows = header.findall(tag)
    if rows:
        return inserted_behind(rows[-1], [line])
    before: list[Element] = [child for child in header.children if child.tag in (wk("origin"), wk("class"))]
    if before and tag != wk("origin"):
        return inserted_behind(before[-1], [line])
    return inserted_first(header, [line])
