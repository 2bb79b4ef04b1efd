"""O, ways through: chinks beside closed doors, doors in each other's way, openings too narrow for the robot."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from wallkit.maps.document import Attribute, Element
from wallkit.maps.rules.base import Context, Problem, Rule
from wallkit.maps.rules.elevation import fill_extents
from wallkit.maps.rules.floods import holes
from wallkit.maps.rules.solids import shared_height_m
from wallkit.maps.rules.swings import GRAZE_M, sweeps

# how far beside the wall an open leaf still narrows the way through
_BESIDE_M = 0.3


def o018_chink(context: Context) -> Iterator[Problem]:
    """A closed door leaves a chink of more than 3 cm beside it, through which a LiDAR looks into the next room.

    Bad:
      <link name="wall_a"><wk:opening id="d" kind="door" along="1 2" z="0 2.5" fill="door_a"/>
      <collision><origin xyz="0.5 0 1.25"/><geometry><box size="1 0.1 2.5"/></geometry></collision>
      <collision><origin xyz="3 0 1.25"/><geometry><box size="2 0.1 2.5"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
      <link name="door_a"><collision><origin xyz="0 0 1.25"/><geometry><box size="0.9 0.04 2.48"/></geometry>
      </collision></link>
      <joint name="d" type="prismatic"><parent link="wall_a"/><child link="door_a"/><origin xyz="1.5 0.08 0"/>
      <axis xyz="1 0 0"/>
      <limit lower="0" upper="0.9" effort="1" velocity="1"/></joint>
    Good:
      <link name="wall_a"><wk:opening id="d" kind="door" along="1 2" z="0 2.5" fill="door_a"/>
      <collision><origin xyz="0.5 0 1.25"/><geometry><box size="1 0.1 2.5"/></geometry></collision>
      <collision><origin xyz="3 0 1.25"/><geometry><box size="2 0.1 2.5"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
      <link name="door_a"><collision><origin xyz="0 0 1.25"/><geometry><box size="0.98 0.04 2.48"/></geometry>
      </collision></link>
      <joint name="d" type="prismatic"><parent link="wall_a"/><child link="door_a"/><origin xyz="1.5 0.08 0"/>
      <axis xyz="1 0 0"/>
      <limit lower="0" upper="0.9" effort="1" velocity="1"/></joint>
    """
    doors = {joint.child: joint for joint in context.map.doors}
    for wall in context.map.links.values():
        for opening in wall.openings:
            extent = context.once(fill_extents).get(opening.element)
            # a second leaf, which no opening names, may take the rest of the hole
            is_double = sum(joint.child in doors for joint in context.map.children_of(wall.name)) > len(wall.openings)
            if extent is None or opening.fill not in doors or is_double:
                continue
            chink_m = max(extent[0] - opening.along_m[0], opening.along_m[1] - extent[2])
            if chink_m > context.tolerances.clearance_m:
                message = f"door '{opening.fill}', closed, leaves {chink_m * 100:.3g} cm of opening '{opening.id}' free"
                fill = context.map.links[opening.fill]
                at: Element | Attribute = fill.shapes[0].geometry if fill.shapes else fill.element
                related = ((f"opening '{opening.id}'", opening.element),)
                yield Problem(at, message, "make the leaf as wide as the hole, less a centimetre", related=related)


def o019_doors_collide(context: Context) -> Iterator[Problem]:
    """Two doors sweep the same floor, so that they can hit each other.

    Bad:
      <link name="door_a"><collision><origin xyz="0.5 0 1"/><geometry><box size="0.9 0.04 2"/></geometry></collision>
      </link>
      <joint name="d" type="revolute"><parent link="map"/><child link="door_a"/><axis xyz="0 0 1"/>
      <limit lower="0" upper="1.5" effort="1" velocity="1"/></joint>
      <link name="door_b"><collision><origin xyz="0.5 0 1"/><geometry><box size="0.9 0.04 2"/></geometry></collision>
      </link>
      <joint name="e" type="revolute"><parent link="map"/><child link="door_b"/><origin xyz="0 0.5 0"/>
      <axis xyz="0 0 1"/>
      <limit lower="-1.5" upper="0" effort="1" velocity="1"/></joint>
    Good:
      <link name="door_a"><collision><origin xyz="0.5 0 1"/><geometry><box size="0.9 0.04 2"/></geometry></collision>
      </link>
      <joint name="d" type="revolute"><parent link="map"/><child link="door_a"/><axis xyz="0 0 1"/>
      <limit lower="0" upper="1.5" effort="1" velocity="1"/></joint>
      <link name="door_b"><collision><origin xyz="0.5 0 1"/><geometry><box size="0.9 0.04 2"/></geometry></collision>
      </link>
      <joint name="e" type="revolute"><parent link="map"/><child link="door_b"/><origin xyz="0 -0.5 0"/>
      <axis xyz="0 0 1"/>
      <limit lower="-1.5" upper="0" effort="1" velocity="1"/></joint>
    """
    import shapely

    found = context.once(sweeps)
    if len(found) < 2:
        return
    swept = np.array([sweep.swept for sweep in found], dtype=object)
    pairs = shapely.STRtree(swept).query(swept, predicate="intersects").T
    for i, j in sorted((int(i), int(j)) for i, j in pairs if i < j):
        a, b = found[i], found[j]
        mates = {joint.mimic.joint for joint in (a.joint, b.joint) if joint.mimic is not None}
        if mates & {a.joint.name, b.joint.name} or shared_height_m(a.z_m, b.z_m) <= GRAZE_M:
            continue
        common = swept[i].intersection(swept[j])
        if common.area > context.tolerances.swing_m2:
            message = f"doors '{a.joint.child}' and '{b.joint.child}' sweep {common.area:.2g} m2 of floor in common"
            related = ((f"door '{b.joint.child}'", b.joint.element),)
            middle = (common.centroid.x, common.centroid.y)
            yield Problem(a.joint.element, message, "limit how far one of them opens", xyz=middle, related=related)


def o020_too_narrow(context: Context) -> Iterator[Problem]:
    """The robot does not fit through an opening, the door fully open. Asked only where the robot's radius is known.

    Bad:
      <wk:check robot-radius="0.5"/><link name="wall_a"><wk:opening id="d" kind="passage" along="1 2" z="0 2.5"/>
      <collision><origin xyz="0.5 0 1.25"/><geometry><box size="1 0.1 2.5"/></geometry></collision>
      <collision><origin xyz="3 0 1.25"/><geometry><box size="2 0.1 2.5"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
    Good:
      <wk:check robot-radius="0.3"/><link name="wall_a"><wk:opening id="d" kind="passage" along="1 2" z="0 2.5"/>
      <collision><origin xyz="0.5 0 1.25"/><geometry><box size="1 0.1 2.5"/></geometry></collision>
      <collision><origin xyz="3 0 1.25"/><geometry><box size="2 0.1 2.5"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
    """
    from shapely import Polygon, get_coordinates

    radius_m = context.robot_radius_m
    if radius_m is None:
        return
    needed_m = 2 * radius_m + context.tolerances.passage_margin_m
    leaves = {sweep.joint.child: sweep.leaves[-1] for sweep in context.once(sweeps)}
    for hole in context.once(holes):
        if hole.opening.kind == "window" or hole.z_m[0] > radius_m:
            continue
        along = np.array([hole.across[1], -hole.across[0]])
        half_m, depth_m = np.ptp(hole.opening.along_m) / 2, hole.thickness_m / 2 + _BESIDE_M
        way = Polygon(
            [
                hole.centre + along * half_m * a + hole.across * depth_m * b
                for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))
            ]
        )
        leaf = leaves.get(hole.opening.fill)
        clear_m = 2 * half_m
        if leaf is not None and leaf.intersects(way):
            blocked = (get_coordinates(leaf.intersection(way)) - hole.centre) @ along
            clear_m = max(blocked.min() + half_m, half_m - blocked.max(), 0.0)
        if clear_m < needed_m:
            message = (
                f"opening '{hole.opening.id}' of '{hole.wall.name}' is {clear_m:.3g} m wide when open; "
                f"a robot of radius {radius_m:g} m needs {needed_m:.3g} m"
            )
            yield Problem(hole.opening.element, message, xyz=tuple(hole.centre), detail={"clear_m": float(clear_m)})


RULES = (
    Rule("WK-O018", "info", o018_chink),
    Rule("WK-O019", "warning", o019_doors_collide),
    Rule("WK-O020", "warning", o020_too_narrow),
)
