"""T, second half: floods of the floor plan against the declared rooms: ways in, leaks, areas."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from wallkit.maps.geometry import slice_parts
from wallkit.maps.rules.base import Context, Problem, Rule
from wallkit.maps.rules.floods import closed_regions, flood, flood_plane_m, holes, open_regions, sealed
from wallkit.maps.rules.rooms import OUTSIDE, room_polygons, rooms_beside
from wallkit.maps.rules.solids import structure
from wallkit.maps.space import Region

if TYPE_CHECKING:
    from shapely import Polygon

# widths at which a leak is looked for; a wider way between two rooms is how the building is, not a leak
_WIDTHS_M = (0.06, 0.1, 0.15, 0.2, 0.3, 0.45, 0.6)
_CIRCULATION = ("circulation", "corridor", "hall", "lobby")
_NAMED_WALLS = 6


def t001_unreachable(context: Context) -> Iterator[Problem]:
    """There is no way into a room, all doors open.

    Bad:
      <wk:map format="1.0" units="m rad"><wk:room id="a" floor="0.1 0.1  3.9 0.1  3.9 2.9  0.1 2.9"/>
      <wk:room id="b" kind="corridor" floor="5 0  9 0  9 3  5 3"/></wk:map>
      <link name="wall_a"><collision><geometry><box size="4.2 0.2 2.5"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/><origin xyz="2 0 0"/></joint>
      <link name="wall_b"><collision><geometry><box size="4.2 0.2 2.5"/></geometry></collision></link>
      <joint name="b" type="fixed"><parent link="map"/><child link="wall_b"/><origin xyz="2 3 0"/></joint>
      <link name="wall_c"><collision><geometry><box size="0.2 3 2.5"/></geometry></collision></link>
      <joint name="c" type="fixed"><parent link="map"/><child link="wall_c"/><origin xyz="0 1.5 0"/></joint>
      <link name="wall_d"><collision><geometry><box size="0.2 3 2.5"/></geometry></collision></link>
      <joint name="d" type="fixed"><parent link="map"/><child link="wall_d"/><origin xyz="4 1.5 0"/></joint>
    Good:
      <wk:map format="1.0" units="m rad"><wk:room id="a" floor="0.1 0.1  3.9 0.1  3.9 2.9  0.1 2.9"/>
      <wk:room id="b" kind="corridor" floor="5 0  9 0  9 3  5 3"/></wk:map>
      <link name="wall_a"><collision><geometry><box size="4.2 0.2 2.5"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/><origin xyz="2 0 0"/></joint>
      <link name="wall_b"><collision><geometry><box size="4.2 0.2 2.5"/></geometry></collision></link>
      <joint name="b" type="fixed"><parent link="map"/><child link="wall_b"/><origin xyz="2 3 0"/></joint>
      <link name="wall_c"><collision><geometry><box size="0.2 3 2.5"/></geometry></collision></link>
      <joint name="c" type="fixed"><parent link="map"/><child link="wall_c"/><origin xyz="0 1.5 0"/></joint>
    """
    if len(context.once(room_polygons)) < 2:
        return
    regions = context.once(open_regions)
    groups: dict[int, list[str]] = {}
    for name, index in _region_of(context.once(room_polygons), regions).items():
        groups.setdefault(index, []).append(name)
    if len(groups) < 2:
        return
    rooms = context.map.rooms

    def standing(index: int) -> tuple[bool, int, float]:
        """What speaks for a region being where one comes from."""
        names = groups[index]
        return any(rooms[name].kind in _CIRCULATION for name in names), len(names), regions[index].area_m2

    main = max(groups, key=standing)
    for index, names in groups.items():
        if index == main:
            continue
        walls = _enclosing(context, regions[index])
        first, *others = names
        also = f" (and with it {', '.join(repr(name) for name in others)})" if others else ""
        message = f"no way leads into room '{first}'{also}, all doors open; it is enclosed by {_listed(walls)}"
        middle = regions[index].polygon.representative_point()
        yield Problem(
            rooms[first].element,
            message,
            "cut an opening into one of its walls",
            xyz=(middle.x, middle.y),
            related=tuple((f"'{link}'", context.map.links[link].element) for link in walls[:_NAMED_WALLS]),
            detail={"walls": walls},
        )


def t007_leak(context: Context) -> Iterator[Problem]:
    """Through a chink up to 60 cm wide a room runs into another, or out of the building, though every door is closed.

    Declared openings are no leaks, and rooms that share an open side are none either. A room that is open to the outside
    over more is a warning: part of the building may not be mapped.

    Bad: two rooms whose dividing wall ends 40 cm short of the outer wall.
    Good: two rooms whose dividing wall reaches the outer wall.
    """
    rooms = context.once(room_polygons)
    if not rooms:
        return
    widths = (context.tolerances.passage_m, *_WIDTHS_M)
    floods = [flood(context.once(sealed), widths[0])]
    where = [_region_of(rooms, floods[0])]
    for a, b in _joined(where[0], floods[0]):
        narrow = None
        for step in range(1, len(widths)):
            if len(floods) == step:
                floods.append(flood(context.once(sealed), widths[step]))
                where.append(_region_of(rooms, floods[step]))
            if not _is_joined(a, b, where[step], floods[step]):
                narrow = step
                break
        spot = context.map.rooms[a].element
        other = "the outside" if b == OUTSIDE else f"room '{b}'"
        if narrow is None:
            if b == OUTSIDE:
                message = f"room '{a}' is open to the outside over more than {widths[-1]:g} m"
                yield Problem(spot, message, "map the missing wall, or declare the opening", severity="warning")
            continue
        neck = _neck(context, rooms[a], floods[narrow - 1][where[narrow - 1][a]], floods[narrow])
        if neck is None:
            continue
        xy, width_m = neck
        message = f"room '{a}' leaks into {other} with all doors closed, through a gap of about {width_m * 100:.0f} cm"
        hint = f"close it at ({xy[0]:.2f}, {xy[1]:.2f}), or declare it as an opening"
        yield Problem(spot, message, hint, xyz=xy, detail={"gap_m": width_m})


def t008_no_door(context: Context) -> Iterator[Problem]:
    """A room has no door, no declared opening and no open side.

    Bad: a room between four walls without an opening.
    Good: a room with <wk:opening kind="door"> in one of its walls.
    """
    rooms = context.once(room_polygons)
    if not rooms:
        return
    regions = context.once(open_regions)
    where = _region_of(rooms, regions)
    entered = {
        name for hole in context.once(holes) if hole.opening.kind != "window" for name in rooms_beside(context, hole)
    }
    entered |= {name for link in context.map.links.values() for name in link.connects}
    for name, index in where.items():
        has_company = regions[index].is_outside or list(where.values()).count(index) > 1
        if name not in entered and not has_company:
            middle = rooms[name].representative_point()
            message = f"room '{name}' has no door"
            yield Problem(
                context.map.rooms[name].element,
                message,
                f"wallkit map add door {context.document.source} --in WALL --at M --width M",
                xyz=(middle.x, middle.y),
            )


def t011_area(context: Context) -> Iterator[Problem]:
    """A room's polygon and the floor between its walls differ in area by more than 5 %.

    Bad: a room drawn 4 by 3 m between walls that stand 5 by 3 m apart.
    Good: a room drawn along the faces of its walls.
    """
    rooms = context.once(room_polygons)
    if not rooms:
        return
    regions = context.once(closed_regions)
    where = _region_of(rooms, regions)
    for name, index in where.items():
        region = regions[index]
        if region.is_outside or list(where.values()).count(index) > 1:
            continue
        drawn_m2 = float(rooms[name].area)
        if abs(drawn_m2 - region.area_m2) > context.tolerances.room_area_share * region.area_m2:
            message = f"room '{name}' is drawn with {drawn_m2:.1f} m2, but its walls enclose {region.area_m2:.1f} m2"
            middle = rooms[name].representative_point()
            spot = context.map.rooms[name].element.spot("floor")
            yield Problem(spot, message, "draw it along the walls' faces", xyz=(middle.x, middle.y))


# -------------------------------------------------------------------------------------------- details


def _region_of(rooms: Mapping[str, Polygon], regions: Sequence[Region]) -> dict[str, int]:
    """The region that holds most of a room, by room; rooms full of walls have none."""
    import shapely

    if not regions:
        return {}
    polygons = np.array([region.polygon for region in regions], dtype=object)
    tree = shapely.STRtree(polygons)
    found = {}
    for name, floor in rooms.items():
        near = np.sort(tree.query(floor, predicate="intersects"))
        if len(near):
            common = shapely.area(shapely.intersection(polygons[near], floor))
            if common.max() > 0:
                found[name] = int(near[int(np.argmax(common))])
    return found


def _joined(where: Mapping[str, int], regions: Sequence[Region]) -> Iterator[tuple[str, str]]:
    """Rooms that share a region: each with the outside, or with the first room in it."""
    first: dict[int, str] = {}
    for name, index in where.items():
        if regions[index].is_outside:
            yield name, OUTSIDE
        elif index in first:
            yield name, first[index]
        else:
            first[index] = name


def _is_joined(a: str, b: str, where: Mapping[str, int], regions: Sequence[Region]) -> bool:
    if a not in where:
        return False
    return regions[where[a]].is_outside if b == OUTSIDE else where[a] == where.get(b)


def _neck(
    context: Context, floor: Polygon, joined: Region, parted: Sequence[Region]
) -> tuple[tuple[float, float], float] | None:
    """Where a region parts when narrow ways are closed, and how wide it is there; None where closing them took nothing."""
    import shapely

    pieces = [region.polygon for region in parted if region.polygon.intersects(joined.polygon)]
    rest = [way for way in shapely.get_parts(joined.polygon.difference(shapely.union_all(pieces))) if way.area > 0]
    if not rest:
        return None
    # what joins two pieces touches both; among those the way nearest to the room
    bridges = [way for way in rest if sum(way.distance(piece) < 1e-6 for piece in pieces) > 1]
    neck = min(bridges or rest, key=lambda way: (float(way.distance(floor)), -float(way.area)))
    middle = neck.centroid
    solids = context.once(sealed)
    width_m = 2 * min(float(solid.distance(middle)) for solid in solids)
    return (float(middle.x), float(middle.y)), width_m


def _enclosing(context: Context, region: Region) -> list[str]:
    """Links along the boundary of a region, in the map's order."""
    cut = slice_parts(context.once(structure), flood_plane_m(context))
    near = [
        part.link
        for part, polygon in zip(cut.parts, cut.polygons, strict=True)
        if polygon.distance(region.polygon) < 1e-3
    ]
    return list(dict.fromkeys(near))


def _listed(links: Sequence[str]) -> str:
    more = f" and {len(links) - _NAMED_WALLS} more" if len(links) > _NAMED_WALLS else ""
    return ", ".join(f"'{link}'" for link in links[:_NAMED_WALLS]) + more


RULES = (
    Rule("WK-T001", "error", t001_unreachable),
    Rule("WK-T007", "error", t007_leak),
    Rule("WK-T008", "warning", t008_no_door),
    Rule("WK-T011", "warning", t011_area),
)
