"""L, the plane: what the LiDAR's height cuts, what it leaves out, and what a tilt of the robot changes of it."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from wallkit.maps.document import Attribute, Element
from wallkit.maps.plane import Standing, region_counts, standings
from wallkit.maps.rules.base import Context, Problem, Rule
from wallkit.maps.rules.solids import joint_spot, structure

# names of places where something is to start, stop or turn
_PLACE = re.compile(r"(?:^|_)(start|spawn|waypoint|wp|goal|dock|home|station|charger)(?=_|\d|$)", re.IGNORECASE)


def plane_standings(context: Context) -> list[Standing]:
    """How every element stands to the LiDAR's plane; empty when its height is unknown."""
    if context.scan_plane_m is None:
        return []
    return standings(context.parts, context.map.classes, context.scan_plane_m, context.tolerances.wobble_m)


def heights_text(standing: Standing) -> str:
    """`0.15 to 1.95 m`, several joined by `and`."""
    return " and ".join(f"{low:.2f} to {high:.2f}" for low, high in standing.z_m) + " m"


def l001_out_of_plane(context: Context) -> Iterator[Problem]:
    """The LiDAR's plane does not cut an element: it helps no localization, and its beams pass over or under it.

    Bad:
      <wk:map format="1.0" units="m rad" scan_plane="0.3"/><link name="sink"><wk:object class="sink"/>
      <collision><origin xyz="0 0 0.8"/><geometry><box size="0.4 0.5 0.2"/></geometry></collision></link>
      <joint name="s" type="fixed"><parent link="map"/><child link="sink"/></joint>
      <link name="wall_a"><wk:object class="wall"/>
      <collision><origin xyz="0 0.3 1.2"/><geometry><box size="4 0.1 2.4"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
    Good:
      <wk:map format="1.0" units="m rad" scan_plane="0.8"/><link name="sink"><wk:object class="sink"/>
      <collision><origin xyz="0 0 0.8"/><geometry><box size="0.4 0.5 0.2"/></geometry></collision></link>
      <joint name="s" type="fixed"><parent link="map"/><child link="sink"/></joint>
      <link name="wall_a"><wk:object class="wall"/>
      <collision><origin xyz="0 0.3 1.2"/><geometry><box size="4 0.1 2.4"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
    """
    for standing in context.once(plane_standings):
        if standing.sight != "in":
            link = context.map.links[standing.link]
            side = {"between": "not"}.get(standing.sight, f"{standing.sight} the plane, not")
            message = (
                f"{standing.class_name or 'element'} '{standing.link}' reaches from {heights_text(standing)}: "
                f"{side} in the LiDAR's plane at {context.scan_plane_m:g} m"
            )
            xyz = tuple(context.parts_by_link[standing.link][0].T_map_shape[:3, 3])
            yield Problem(link.element, message, xyz=xyz, detail={"z_m": standing.z_m})


def l002_empty_plane(context: Context) -> Iterator[Problem]:
    """The LiDAR's plane cuts nothing, or the map was drawn for a LiDAR at another height.

    Bad:
      <wk:map format="1.0" units="m rad" scan_plane="3.0"/><link name="wall_a"><wk:object class="wall"/>
      <collision><origin xyz="0 0 1.2"/><geometry><box size="4 0.1 2.4"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
    Good:
      <wk:map format="1.0" units="m rad" scan_plane="0.3"/><link name="wall_a"><wk:object class="wall"/>
      <collision><origin xyz="0 0 1.2"/><geometry><box size="4 0.1 2.4"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
    """
    said, given = context.map.header.scan_plane_m, context.tolerances.scan_plane_m
    header = context.map.header.element
    spot: Element | Attribute = header.spot("scan_plane") if header is not None else context.root
    if said is not None and given is not None and abs(said - given) > context.tolerances.plane_off_m:
        message = f"the map is drawn for a LiDAR at {said:g} m, but it looks at {given:g} m"
        hint = f'scan_plane="{given:g}", once walls and fixtures are right at that height'
        yield Problem(spot, message, hint, detail={"map_m": said, "lidar_m": given})
    elements = context.once(plane_standings)
    if elements and not any(standing.is_seen for standing in elements):
        low, high = min(s.z_m[0][0] for s in elements), max(s.z_m[-1][1] for s in elements)
        message = f"the LiDAR's plane at {context.scan_plane_m:g} m cuts nothing of the map"
        yield Problem(spot, message, f"its elements reach from {low:.2f} to {high:.2f} m")


def l010_place_in_wall(context: Context) -> Iterator[Problem]:
    """A start or waypoint lies inside of something solid, or nearer to it than the robot's radius.

    A place is a link without shapes whose name begins a word with start, spawn, waypoint, wp, goal, dock, home, station or
    charger.

    Bad:
      <link name="wall_a"><wk:object class="wall"/>
      <collision><origin xyz="0 0 1.2"/><geometry><box size="4 0.1 2.4"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
      <link name="start"/>
      <joint name="s" type="fixed"><parent link="map"/><child link="start"/><origin xyz="1 0.02 0"/></joint>
    Good:
      <link name="wall_a"><wk:object class="wall"/>
      <collision><origin xyz="0 0 1.2"/><geometry><box size="4 0.1 2.4"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
      <link name="start"/>
      <joint name="s" type="fixed"><parent link="map"/><child link="start"/><origin xyz="1 0.5 0"/></joint>
    """
    import shapely

    links = context.map.links.values()
    places = [k for k in links if not k.shapes and _PLACE.search(k.name) and k.name in context.poses]
    solids = [part for part in context.parts if part.class_name not in ("floor", "ceiling")] if places else []
    if not solids:
        return
    footprints = np.array([part.footprint for part in solids], dtype=object)
    for link in places:
        x, y = context.poses[link.name][:2, 3]
        distances = shapely.distance(footprints, shapely.Point(x, y))
        nearest = int(np.argmin(distances))
        away_m, part = float(distances[nearest]), solids[nearest]
        spot = joint_spot(context, link.name) or link.element
        related = ((f"'{part.link}'", part.shape.element),)
        if away_m == 0.0:
            message = f"place '{link.name}' at {x:.2f} {y:.2f} lies inside of '{part.name}'"
            yield Problem(spot, message, "move it onto free floor", xyz=(x, y), related=related)
        elif context.robot_radius_m is not None and away_m < context.robot_radius_m:
            message = f"place '{link.name}' is {away_m:.2f} m from '{part.name}'; the robot's radius is "
            message += f"{context.robot_radius_m:g} m"
            yield Problem(spot, message, "move it away", xyz=(x, y), related=related, severity="warning")


def l013_tilt(context: Context) -> Iterator[Problem]:
    """Within 5 cm of the LiDAR's plane the slice changes: an element ends there, or rooms are joined or parted.

    A robot that pitches by one degree lifts its plane by 5 cm three metres ahead.

    Bad:
      <wk:map format="1.0" units="m rad" scan_plane="0.42"/><link name="bench"><wk:object class="furniture"/>
      <collision><origin xyz="0 0 0.2"/><geometry><box size="1.5 0.4 0.4"/></geometry></collision></link>
      <joint name="b" type="fixed"><parent link="map"/><child link="bench"/></joint>
    Good:
      <wk:map format="1.0" units="m rad" scan_plane="0.30"/><link name="bench"><wk:object class="furniture"/>
      <collision><origin xyz="0 0 0.2"/><geometry><box size="1.5 0.4 0.4"/></geometry></collision></link>
      <joint name="b" type="fixed"><parent link="map"/><child link="bench"/></joint>
    """
    plane_m, wobble_m = context.scan_plane_m, context.tolerances.wobble_m
    if plane_m is None:
        return
    for standing in context.once(plane_standings):
        if standing.changes:
            edge = min(standing.changes, key=lambda z: abs(z - plane_m))
            off = (
                f"{abs(edge - plane_m) * 100:.2g} cm {'above' if edge > plane_m else 'below'}"
                if edge != plane_m
                else "in"
            )
            message = f"'{standing.link}' begins or ends {off} the LiDAR's plane: a tilt shows or hides it"
            xyz = (*context.parts_by_link[standing.link][0].T_map_shape[:2, 3], edge)
            hint = f"choose a plane {wobble_m * 100:g} cm away from {edge:.2f} m"
            yield Problem(context.map.links[standing.link].element, message, hint, xyz=xyz)
    counts = region_counts(context.once(structure), plane_m, wobble_m)
    if len({count for _, count in counts}) > 1:
        said = ", ".join(f"{count} at {z:.2f} m" for z, count in counts)
        message = f"a tilt joins or parts enclosed floor around the LiDAR's plane at {plane_m:g} m: regions are {said}"
        header = context.map.header.element
        spot = header.spot("scan_plane") if header is not None else context.root
        yield Problem(spot, message, "choose a plane away from sills and heads", detail={"regions": counts})


RULES = (
    Rule("WK-L001", "info", l001_out_of_plane),
    Rule("WK-L002", "error", l002_empty_plane, blocks=False),
    Rule("WK-L010", "error", l010_place_in_wall, blocks=False),
    Rule("WK-L013", "warning", l013_tilt),
)
