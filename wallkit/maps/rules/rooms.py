"""T, first half: room polygons that are polygons, and names of rooms that agree with where things stand."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from difflib import get_close_matches
from typing import TYPE_CHECKING

import numpy as np

from wallkit.core.types import Float64Array
from wallkit.errors import closest
from wallkit.maps.document import Attribute, Edit
from wallkit.maps.geometry import slice_parts
from wallkit.maps.nouns import Link
from wallkit.maps.numbers import text_from_number
from wallkit.maps.rules.base import Context, Problem, Rule
from wallkit.maps.rules.floods import Hole, flood_plane_m, holes
from wallkit.maps.rules.solids import assembly, fixtures, structure

if TYPE_CHECKING:
    from shapely import Polygon

# what a door may connect a room to without a <wk:room> for it
OUTSIDE = "outside"
# how far behind the wall's face a room is looked for
_BESIDE_M = 0.2
# a fixture may hang on a wall that its room's polygon leaves out
_NEAR_M = 0.15
# a wall that cuts off less than this from a room is a corner, not a crossing
_CUT_OFF_M2 = 0.25
_UNLIKELY: Mapping[str, tuple[str, ...]] = {
    "toilet": ("circulation", "corridor", "hall", "lobby", "office", "kitchen", "storage", "elevator", "stairs"),
    "urinal": ("circulation", "corridor", "hall", "lobby", "office", "kitchen", "storage", "elevator", "stairs"),
    "sink": ("elevator", "stairs"),
    "furniture": ("elevator", "stairs"),
}


def room_polygons(context: Context) -> dict[str, Polygon]:
    """The floor of every room by id, as far as it is a polygon (WK-T002 names the others)."""
    from shapely import Polygon

    polygons = {room.id: Polygon(room.floor) for room in context.map.rooms.values() if room.floor is not None}
    return {name: polygon for name, polygon in polygons.items() if polygon.is_valid and polygon.area > 0}


def rooms_beside(context: Context, hole: Hole) -> tuple[str, str]:
    """The rooms before and behind an opening; "" where there is none."""
    reach = hole.across * (hole.thickness_m / 2 + _BESIDE_M)
    found = [_room_at(context, hole.centre + reach * side) for side in (-1, 1)]
    return found[0], found[1]


def t002_polygon(context: Context) -> Iterator[Problem]:
    """A room's floor is no simple polygon with its corners counter-clockwise and each named once.

    An error where it crosses itself or has no area; the order of its corners, and a first corner that is repeated at the
    end, are warnings and can be repaired.

    Bad: <wk:map format="1.0" units="m rad"><wk:room id="a" floor="0 0  4 0  4 3  0 3  0 0"/></wk:map>
    Good: <wk:map format="1.0" units="m rad"><wk:room id="a" floor="0 0  4 0  4 3  0 3"/></wk:map>
    """
    from shapely import Polygon
    from shapely.validation import explain_validity

    for room in context.map.all_rooms:
        if room.floor is None:
            continue
        spot = room.element.spot("floor")
        corners = room.floor[:-1] if np.array_equal(room.floor[0], room.floor[-1]) else room.floor
        polygon = Polygon(corners) if len(corners) >= 3 else Polygon()
        if not polygon.is_valid or polygon.area == 0:
            why, _, place = explain_validity(polygon).rstrip("]").partition("[")
            xyz = tuple(float(word) for word in place.split()) if place else tuple(corners.mean(axis=0))
            at = f" at ({place})" if place else ""
            what = "crosses itself" if "Self-intersection" in why else "encloses no area"
            hint = "list the corners in order around the room, counter-clockwise"
            yield Problem(spot, f"the floor of room '{room.id}' {what}{at}", hint, xyz=xyz)
            continue
        is_clockwise = not polygon.exterior.is_ccw
        if is_clockwise or len(corners) < len(room.floor):
            ring = corners[::-1] if is_clockwise else corners
            text = "  ".join(f"{text_from_number(x)} {text_from_number(y)}" for x, y in ring.tolist())
            words = ["runs clockwise"] * is_clockwise + ["repeats its first corner"] * (len(corners) < len(room.floor))
            edits = (spot.replaced_by(text),) if isinstance(spot, Attribute) else ()
            message = f"the floor of room '{room.id}' {' and '.join(words)}"
            yield Problem(spot, message, f'floor="{text}"', edits=edits, severity="warning")


def t003_room_and_walls(context: Context) -> Iterator[Problem]:
    """A wall cuts a room's floor in two, or two rooms overlap.

    Bad:
      <wk:map format="1.0" units="m rad"><wk:room id="a" floor="0 0  4 0  4 3  0 3"/>
      <wk:room id="b" floor="3 0  6 0  6 3  3 3"/></wk:map>
    Good:
      <wk:map format="1.0" units="m rad"><wk:room id="a" floor="0 0  3 0  3 3  0 3"/>
      <wk:room id="b" floor="3 0  6 0  6 3  3 3"/></wk:map>
    """
    import shapely

    polygons = context.once(room_polygons)
    if not polygons:
        return
    reach_m = context.tolerances.room_overlap_m
    names, floors = list(polygons), np.array(list(polygons.values()), dtype=object)
    pairs = shapely.STRtree(floors).query(floors, predicate="intersects").T
    for i, j in sorted((int(i), int(j)) for i, j in pairs if i < j):
        common = floors[i].intersection(floors[j])
        if not common.buffer(-reach_m / 2).is_empty:
            spot = context.map.rooms[names[j]].element.spot("floor")
            other = ((f"room '{names[i]}'", context.map.rooms[names[i]].element.spot("floor")),)
            message = f"rooms '{names[i]}' and '{names[j]}' overlap by {common.area:.2g} m2"
            middle = (common.centroid.x, common.centroid.y)
            yield Problem(spot, message, "a piece of floor belongs to one room", xyz=middle, related=other)
    walls = [part for part in context.once(structure) if part.class_name == "wall"]
    cut = slice_parts(walls, flood_plane_m(context))
    if not cut.polygons:
        return
    tree = shapely.STRtree(cut.polygons)
    for name, floor in polygons.items():
        inner = floor.buffer(-reach_m, join_style="mitre")
        inside = sorted(tree.query(inner, predicate="intersects").tolist())
        free = inner.difference(shapely.union_all([cut.polygons[index] for index in inside]))
        pieces = sorted((float(piece.area) for piece in shapely.get_parts(free)), reverse=True)
        if len(pieces) > 1 and pieces[1] > _CUT_OFF_M2:
            links = list(dict.fromkeys(cut.parts[index].link for index in inside))
            message = f"the floor of room '{name}' reaches through {_listed(links)}: {pieces[1]:.2g} m2 lie behind"
            spot = context.map.rooms[name].element.spot("floor")
            related = tuple((f"wall '{link}'", context.map.links[link].element) for link in links[:3])
            yield Problem(spot, message, "draw it along the walls' faces, or as two rooms", related=related)


def t004_unknown_room(context: Context) -> Iterator[Problem]:
    """Something names a room that does not exist. Doors may also connect to "outside".

    Bad:
      <wk:map format="1.0" units="m rad"><wk:room id="kitchen" floor="0 0  4 0  4 3  0 3"/></wk:map>
      <link name="trash"><wk:object class="trash" room="kitchn"/></link>
      <joint name="b" type="fixed"><parent link="map"/><child link="trash"/></joint>
    Good:
      <wk:map format="1.0" units="m rad"><wk:room id="kitchen" floor="0 0  4 0  4 3  0 3"/></wk:map>
      <link name="trash"><wk:object class="trash" room="kitchen"/></link>
      <joint name="b" type="fixed"><parent link="map"/><child link="trash"/></joint>
    """
    rooms = context.map.rooms
    for link in context.map.links.values():
        for attribute, names in (("connects", link.connects), ("separates", link.separates), ("room", (link.room,))):
            for name in names:
                if not name or name in rooms or (name == OUTSIDE and attribute != "room") or link.semantics is None:
                    continue
                spot = link.semantics.spot(attribute)
                near = get_close_matches(name, rooms, n=1)
                edits: tuple[Edit, ...] = ()
                if near and isinstance(spot, Attribute):
                    text = " ".join(near[0] if word == name else word for word in spot.value.split())
                    edits = (spot.replaced_by(text),)
                hint = closest(name, rooms) if rooms else "declare it: <wk:room id=... floor=.../> in <wk:map>"
                yield Problem(spot, f"'{link.name}' {attribute} '{name}', but there is no such room", hint, edits=edits)


def t005_connects(context: Context) -> Iterator[Problem]:
    """A door connects a room to itself, or does not name two rooms.

    Bad:
      <wk:map format="1.0" units="m rad"><wk:room id="a" floor="0 0  4 0  4 3  0 3"/></wk:map>
      <link name="door_a"><wk:object class="door" connects="a a"/></link>
      <joint name="b" type="fixed"><parent link="map"/><child link="door_a"/></joint>
    Good:
      <wk:map format="1.0" units="m rad"><wk:room id="a" floor="0 0  4 0  4 3  0 3"/></wk:map>
      <link name="door_a"><wk:object class="door" connects="a outside"/></link>
      <joint name="b" type="fixed"><parent link="map"/><child link="door_a"/></joint>
    """
    for link in context.map.links.values():
        if not link.connects or link.semantics is None:
            continue
        spot = link.semantics.spot("connects")
        if len(link.connects) != 2:
            message = f"'{link.name}' connects {len(link.connects)} rooms: {' '.join(link.connects)}"
            yield Problem(spot, message, f'name two; out of the building is "{OUTSIDE}"')
        elif link.connects[0] == link.connects[1]:
            yield Problem(spot, f"'{link.name}' connects room '{link.connects[0]}' with itself", "name both rooms")


def t006_connects_otherwise(context: Context) -> Iterator[Problem]:
    """A door is said to connect other rooms than those before and behind it.

    Bad:
      <wk:map format="1.0" units="m rad"><wk:room id="a" floor="0 0  4 0  4 3  0 3"/>
      <wk:room id="b" floor="0 -3  4 -3  4 0  0 0"/>
      <wk:room id="c" floor="4 0  8 0  8 3  4 3"/></wk:map>
      <link name="wall_a"><wk:opening id="d" kind="door" along="1 2" z="0 2.5" fill="door_a"/>
      <collision><origin xyz="0.5 0 1.25"/><geometry><box size="1 0.1 2.5"/></geometry></collision>
      <collision><origin xyz="3 0 1.25"/><geometry><box size="2 0.1 2.5"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
      <link name="door_a"><wk:object class="door" connects="a c"/></link>
      <joint name="d" type="fixed"><parent link="wall_a"/><child link="door_a"/></joint>
    Good:
      <wk:map format="1.0" units="m rad"><wk:room id="a" floor="0 0  4 0  4 3  0 3"/>
      <wk:room id="b" floor="0 -3  4 -3  4 0  0 0"/>
      <wk:room id="c" floor="4 0  8 0  8 3  4 3"/></wk:map>
      <link name="wall_a"><wk:opening id="d" kind="door" along="1 2" z="0 2.5" fill="door_a"/>
      <collision><origin xyz="0.5 0 1.25"/><geometry><box size="1 0.1 2.5"/></geometry></collision>
      <collision><origin xyz="3 0 1.25"/><geometry><box size="2 0.1 2.5"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
      <link name="door_a"><wk:object class="door" connects="a b"/></link>
      <joint name="d" type="fixed"><parent link="wall_a"/><child link="door_a"/></joint>
    """
    rooms = context.once(room_polygons)
    for hole in context.once(holes):
        link = context.map.links.get(hole.opening.fill)
        if link is None or not _connects_well(link, rooms):
            continue
        beside = [name or OUTSIDE for name in rooms_beside(context, hole)]
        if set(beside) != set(link.connects) and len(set(beside)) == 2:
            spot = link.semantics.spot("connects") if link.semantics is not None else link.element
            edits = (spot.replaced_by(" ".join(beside)),) if isinstance(spot, Attribute) else ()
            message = f"'{link.name}' connects {_listed(link.connects)}, but stands between {_listed(beside)}"
            hint = f'connects="{" ".join(beside)}"'
            yield Problem(spot, message, hint, xyz=tuple(hole.centre), edits=edits)


def t009_outside_rooms(context: Context) -> Iterator[Problem]:
    """A fixture stands in no room, though the map has rooms.

    Bad:
      <wk:map format="1.0" units="m rad"><wk:room id="a" floor="0 0  4 0  4 3  0 3"/></wk:map>
      <link name="trash"><collision><geometry><box size="0.3 0.3 0.5"/></geometry></collision></link>
      <joint name="b" type="fixed"><parent link="map"/><child link="trash"/><origin xyz="6 1 0"/></joint>
    Good:
      <wk:map format="1.0" units="m rad"><wk:room id="a" floor="0 0  4 0  4 3  0 3"/></wk:map>
      <link name="trash"><collision><geometry><box size="0.3 0.3 0.5"/></geometry></collision></link>
      <joint name="b" type="fixed"><parent link="map"/><child link="trash"/><origin xyz="2 1 0"/></joint>
    """
    if not context.map.rooms or len(context.once(room_polygons)) < len(context.map.rooms):
        return
    for link, (middle, room) in context.once(_room_of_fixture).items():
        if not room:
            message = f"{context.map.links[link].class_name} '{link}' stands in no room"
            yield Problem(context.map.links[link].element, message, "is it in its place?", xyz=tuple(middle))


def t010_unlikely(context: Context) -> Iterator[Problem]:
    """A fixture stands in a room where nobody expects it: a toilet in a corridor.

    Bad:
      <wk:map format="1.0" units="m rad"><wk:room id="a" kind="corridor" floor="0 0  4 0  4 3  0 3"/></wk:map>
      <link name="toilet"><collision><geometry><box size="0.6 0.4 0.4"/></geometry></collision></link>
      <joint name="b" type="fixed"><parent link="map"/><child link="toilet"/><origin xyz="2 1 0"/></joint>
    Good:
      <wk:map format="1.0" units="m rad"><wk:room id="a" kind="restroom" floor="0 0  4 0  4 3  0 3"/></wk:map>
      <link name="toilet"><collision><geometry><box size="0.6 0.4 0.4"/></geometry></collision></link>
      <joint name="b" type="fixed"><parent link="map"/><child link="toilet"/><origin xyz="2 1 0"/></joint>
    """
    for link, (middle, room) in context.once(_room_of_fixture).items():
        kind = context.map.rooms[room].kind if room else ""
        class_name = context.map.links[link].class_name
        if kind in _UNLIKELY.get(class_name, ()):
            message = f"{class_name} '{link}' stands in room '{room}', a {kind}"
            yield Problem(context.map.links[link].element, message, "is it in its place?", xyz=tuple(middle))


# -------------------------------------------------------------------------------------------- details


def _room_at(context: Context, point: Float64Array, near_m: float = 0.0) -> str:
    """The room that a point (2,) lies in, or within some reach of; "" for none."""
    from shapely import Point

    at = Point(point)
    distances = {name: float(floor.distance(at)) for name, floor in context.once(room_polygons).items()}
    nearest = min(distances, key=lambda name: distances[name], default="")
    return nearest if nearest and distances[nearest] <= near_m else ""


def _room_of_fixture(context: Context) -> dict[str, tuple[Float64Array, str]]:
    """Middle (2,) and room of every fixture that is no part of another."""
    corners: dict[str, list[Float64Array]] = {}
    for part in context.once(fixtures):
        if assembly(context, part.link) == part.link:
            corners.setdefault(part.link, []).append(part.corners[:, :2])
    middles = {link: np.vstack(points).mean(axis=0) for link, points in corners.items()}
    return {link: (middle, _room_at(context, middle, _NEAR_M)) for link, middle in middles.items()}


def _connects_well(link: Link, rooms: Mapping[str, object]) -> bool:
    """Whether it names two different rooms that can be looked at."""
    return len(set(link.connects)) == 2 == len(link.connects) and all(
        name in rooms or name == OUTSIDE for name in link.connects
    )


def _listed(names: tuple[str, ...] | list[str]) -> str:
    shown = " and ".join(f"'{name}'" for name in names[:3])
    return shown + (f" and {len(names) - 3} more" if len(names) > 3 else "")


RULES = (
    Rule("WK-T002", "error", t002_polygon, fix="safe"),
    Rule("WK-T003", "error", t003_room_and_walls),
    Rule("WK-T004", "error", t004_unknown_room, fix="moderate", blocks=False),
    Rule("WK-T005", "error", t005_connects, blocks=False),
    Rule("WK-T006", "warning", t006_connects_otherwise, fix="moderate"),
    Rule("WK-T009", "warning", t009_outside_rooms),
    Rule("WK-T010", "info", t010_unlikely),
)
