"""E, fixtures: they touch their wall without standing in it, face the room, and do not stand in each other."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from wallkit.core.types import Float64Array
from wallkit.maps.document import Edit
from wallkit.maps.geometry import Part
from wallkit.maps.rules.base import Context, Problem, Rule
from wallkit.maps.rules.solids import (
    BUILT_IN_CLASSES,
    assembly,
    fixtures,
    joint_spot,
    leaf_links,
    moved,
    overlapping,
    penetration,
    shared_height_m,
    sound_parts,
    structure,
)

# things hang on these too: a basin on a counter, a dispenser on a partition
_CARRIER_CLASSES = ("partition", "furniture", "column")
# a wall farther away is not worth naming
_NEAREST_M = 2.0


def e010_in_wall(context: Context) -> Iterator[Problem]:
    """A fixture stands in a wall.

    Bad:
      <link name="wall_a"><collision><origin xyz="2 0 1.25"/><geometry><box size="4 0.1 2.5"/></geometry></collision>
      </link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
      <link name="sink"><collision><origin xyz="0.2 0 0.8"/><geometry><box size="0.4 0.5 0.2"/></geometry></collision>
      </link>
      <joint name="s" type="fixed"><parent link="map"/><child link="sink"/><origin xyz="2 0 0" rpy="0 0 1.5707963"/>
      </joint>
    Good:
      <link name="wall_a"><collision><origin xyz="2 0 1.25"/><geometry><box size="4 0.1 2.5"/></geometry></collision>
      </link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
      <link name="sink"><collision><origin xyz="0.2 0 0.8"/><geometry><box size="0.4 0.5 0.2"/></geometry></collision>
      </link>
      <joint name="s" type="fixed"><parent link="map"/><child link="sink"/><origin xyz="2 0.05 0" rpy="0 0 1.5707963"/>
      </joint>
    """
    things = [part for part in context.once(fixtures) if part.class_name not in BUILT_IN_CLASSES]
    walls = context.once(structure)
    worst: dict[tuple[str, str], tuple[float, Float64Array, Part, Part]] = {}
    for i, j in overlapping(things, walls):
        depth_m, way = _depth(things[i], walls[j])
        pair = (things[i].link, walls[j].link)
        if depth_m > max(context.tolerances.penetration_m, worst.get(pair, (0.0,))[0]):
            worst[pair] = (depth_m, way, things[i], walls[j])
    for (fixture, _), (depth_m, way, thing, wall) in worst.items():
        message = f"{thing.class_name} '{fixture}' stands {depth_m * 1000:.4g} mm deep in '{wall.name}'"
        edits = moved(context, fixture, way * depth_m)
        yield Problem(
            joint_spot(context, fixture) or thing.shape.element,
            message,
            f"move it {depth_m * 1000:.4g} mm out of the wall" + _new_xyz(edits),
            xyz=tuple(thing.T_map_shape[:3, 3]),
            related=((f"'{wall.name}'", wall.shape.element),),
            edits=edits,
            detail={"depth_m": depth_m},
        )


def e011_overlap(context: Context) -> Iterator[Problem]:
    """Two fixtures stand in each other. Parts of one piece of furniture may.

    Bad:
      <link name="toilet_1"><collision><geometry><box size="0.6 0.4 0.4"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="toilet_1"/></joint>
      <link name="trash"><collision><geometry><box size="0.3 0.3 0.5"/></geometry></collision></link>
      <joint name="b" type="fixed"><parent link="map"/><child link="trash"/><origin xyz="0.3 0 0"/></joint>
    Good:
      <link name="toilet_1"><collision><geometry><box size="0.6 0.4 0.4"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="toilet_1"/></joint>
      <link name="trash"><collision><geometry><box size="0.3 0.3 0.5"/></geometry></collision></link>
      <joint name="b" type="fixed"><parent link="map"/><child link="trash"/><origin xyz="0.5 0 0"/></joint>
    """
    things = context.once(fixtures)
    whole = {link: assembly(context, link) for link in {part.link for part in things}}
    duplicates = {frozenset([a.link, b.link]) for a, b in context.once(_coincident)}
    seen: set[frozenset[str]] = set()
    for i, j in overlapping(things, things):
        a, b = things[i], things[j]
        pair = frozenset([a.link, b.link])
        both_built_in = a.class_name in BUILT_IN_CLASSES and b.class_name in BUILT_IN_CLASSES
        if i >= j or whole[a.link] == whole[b.link] or both_built_in or pair in seen or pair in duplicates:
            continue
        depth_m, _ = _depth(a, b)
        if depth_m > context.tolerances.penetration_m:
            seen.add(pair)
            message = (
                f"{a.class_name} '{a.link}' and {b.class_name} '{b.link}' stand {depth_m * 1000:.4g} mm in each other"
            )
            related = ((f"'{b.name}'", b.shape.element),)
            at = joint_spot(context, a.link) or a.shape.element
            yield Problem(at, message, "move one of them", xyz=tuple(a.T_map_shape[:3, 3]), related=related)


def e012_off_wall(context: Context) -> Iterator[Problem]:
    """Something that hangs on a wall is more than 2 cm off any wall.

    Bad:
      <link name="wall_a"><collision><origin xyz="2 0 1.25"/><geometry><box size="4 0.1 2.5"/></geometry></collision>
      </link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
      <link name="sink"><collision><origin xyz="0.2 0 0.8"/><geometry><box size="0.4 0.5 0.2"/></geometry></collision>
      </link>
      <joint name="s" type="fixed"><parent link="map"/><child link="sink"/><origin xyz="2 0.15 0" rpy="0 0 1.5707963"/>
      </joint>
    Good:
      <link name="wall_a"><collision><origin xyz="2 0 1.25"/><geometry><box size="4 0.1 2.5"/></geometry></collision>
      </link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
      <link name="sink"><collision><origin xyz="0.2 0 0.8"/><geometry><box size="0.4 0.5 0.2"/></geometry></collision>
      </link>
      <joint name="s" type="fixed"><parent link="map"/><child link="sink"/><origin xyz="2 0.05 0" rpy="0 0 1.5707963"/>
      </joint>
    """
    import shapely

    carriers = context.once(_carriers)
    if not carriers:
        return
    tree = shapely.STRtree([part.footprint for part in carriers])
    for link, own in _wall_mounted(context).items():
        nearest: tuple[float, Part, Part] | None = None
        for part in own:
            for index in sorted(tree.query(part.footprint, predicate="dwithin", distance=_NEAREST_M).tolist()):
                carrier = carriers[index]
                if carrier.link == link or shared_height_m(part.z_m, carrier.z_m) <= 0:
                    continue
                distance_m = float(part.footprint.distance(carrier.footprint))
                if nearest is None or distance_m < nearest[0]:
                    nearest = (distance_m, part, carrier)
        if nearest is not None and nearest[0] <= context.tolerances.off_wall_m:
            continue
        at = joint_spot(context, link) or own[0].shape.element
        if nearest is None:
            message = f"{own[0].class_name} '{link}' hangs on nothing: no wall within {_NEAREST_M:g} m"
            yield Problem(at, message, "move it to its wall", xyz=tuple(own[0].T_map_shape[:3, 3]))
            continue
        distance_m, part, carrier = nearest
        start, stop = shapely.get_coordinates(shapely.shortest_line(part.footprint, carrier.footprint))
        edits = moved(context, link, stop - start) if distance_m <= context.tolerances.gap_max_m else ()
        message = f"{part.class_name} '{link}' is {distance_m * 1000:.4g} mm off the nearest wall, '{carrier.link}'"
        yield Problem(
            at,
            message,
            f"move it to the wall{_new_xyz(edits)}",
            xyz=tuple(part.T_map_shape[:3, 3]),
            related=((f"'{carrier.name}'", carrier.shape.element),),
            edits=edits,
            detail={"distance_m": distance_m},
        )


def e013_faces_wall(context: Context) -> Iterator[Problem]:
    """A fixture faces the wall it hangs on: its +x, which points into the room, points into the wall.

    Bad:
      <link name="wall_a"><collision><origin xyz="2 0 1.25"/><geometry><box size="4 0.1 2.5"/></geometry></collision>
      </link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
      <link name="sink"><collision><origin xyz="0.2 0 0.8"/><geometry><box size="0.4 0.5 0.2"/></geometry></collision>
      </link>
      <joint name="s" type="fixed"><parent link="map"/><child link="sink"/>
      <origin xyz="2 0.45 0" rpy="0 0 -1.5707963"/></joint>
    Good:
      <link name="wall_a"><collision><origin xyz="2 0 1.25"/><geometry><box size="4 0.1 2.5"/></geometry></collision>
      </link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
      <link name="sink"><collision><origin xyz="0.2 0 0.8"/><geometry><box size="0.4 0.5 0.2"/></geometry></collision>
      </link>
      <joint name="s" type="fixed"><parent link="map"/><child link="sink"/><origin xyz="2 0.05 0" rpy="0 0 1.5707963"/>
      </joint>
    """
    import shapely

    carriers = context.once(_carriers)
    if not carriers:
        return
    tree = shapely.STRtree([part.footprint for part in carriers])
    for link, own in _wall_mounted(context).items():
        forward = context.poses[link][:2, 0]
        if np.hypot(*forward) < 0.5 or own[0].class_name in BUILT_IN_CLASSES:
            continue
        corners = np.vstack([part.corners[:, :2] for part in own])
        along, middle = corners @ forward, (corners.min(axis=0) + corners.max(axis=0)) / 2
        reach_m = np.array([along.min(), along.max()]) - middle @ forward
        z_m = (min(part.z_m[0] for part in own), max(part.z_m[1] for part in own))
        touched = []
        for way in (reach_m[0] - context.tolerances.off_wall_m, reach_m[1] + context.tolerances.off_wall_m):
            probe = shapely.LineString([middle + forward * np.sign(way) * 1e-3, middle + forward * way])
            near = (carriers[index] for index in tree.query(probe, predicate="intersects").tolist())
            touched.append(any(part.link != link and shared_height_m(part.z_m, z_m) > 0 for part in near))
        if touched == [False, True]:
            joint = context.map.parent_joint(link)
            spot = joint.element if joint is not None else own[0].shape.element
            message = f"{own[0].class_name} '{link}' faces the wall: its +x points into it"
            hint = "turn it by 180 degrees; the frame sits at the mounting point, the body lies along +x"
            yield Problem(spot, message, hint, xyz=tuple(own[0].T_map_shape[:3, 3]))


def e014_duplicate(context: Context) -> Iterator[Problem]:
    """Two elements of one class take the same place: one was pasted twice.

    A warning where both belong to one link.

    Bad:
      <link name="wall_a"><collision><geometry><box size="4 0.1 2.5"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
      <link name="wall_b"><collision><geometry><box size="4 0.1 2.5"/></geometry></collision></link>
      <joint name="b" type="fixed"><parent link="map"/><child link="wall_b"/></joint>
    Good:
      <link name="wall_a"><collision><geometry><box size="4 0.1 2.5"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
      <link name="wall_b"><collision><geometry><box size="4 0.1 2.5"/></geometry></collision></link>
      <joint name="b" type="fixed"><parent link="map"/><child link="wall_b"/><origin xyz="0 3 0"/></joint>
    """
    for a, b in context.once(_coincident):
        yield Problem(
            b.shape.element,
            f"'{b.name}' takes the place of '{a.name}', both {a.class_name or 'without a class'}",
            "delete one of them",
            xyz=tuple(b.T_map_shape[:3, 3]),
            related=((f"'{a.name}'", a.shape.element),),
            edits=_deleted(context, b),
            severity="warning" if a.link == b.link else None,
        )


# -------------------------------------------------------------------------------------------- details


def _depth(a: Part, b: Part) -> tuple[float, Float64Array]:
    """How deep two parts stand in each other, and the horizontal way (2,) out for a; over or under it counts as out."""
    depth_m, way = penetration(a.footprint, b.footprint)
    return min(depth_m, shared_height_m(a.z_m, b.z_m)), way


def _carriers(context: Context) -> list[Part]:
    leaves = context.once(leaf_links)
    hangs_on = [
        part for part in context.once(sound_parts) if part.class_name in _CARRIER_CLASSES and part.link not in leaves
    ]
    return [*context.once(structure), *hangs_on]


def _wall_mounted(context: Context) -> dict[str, list[Part]]:
    """Parts by link of what hangs on walls, but for what hangs on other fixtures."""
    found: dict[str, list[Part]] = {}
    for part in context.once(fixtures):
        info = context.map.classes[part.class_name]
        if info.mount == "wall" and assembly(context, part.link) == part.link:
            found.setdefault(part.link, []).append(part)
    return found


def _coincident(context: Context) -> list[tuple[Part, Part]]:
    """Pairs of parts of one class of which each covers nearly all of the other."""
    import shapely

    solids = context.once(sound_parts)
    if not solids:
        return []
    footprints = np.array([part.footprint for part in solids], dtype=object)
    areas = shapely.area(footprints)
    i, j = shapely.STRtree(footprints).query(footprints, predicate="intersects")
    share = context.tolerances.coincident_share
    likely = (i < j) & (np.minimum(areas[i], areas[j]) >= share * np.maximum(areas[i], areas[j]))
    i, j = i[likely], j[likely]
    common = shapely.area(shapely.intersection(footprints[i], footprints[j]))
    found = []
    for a, b, area in sorted(zip(i.tolist(), j.tolist(), common.tolist(), strict=True)):
        one, other = solids[a], solids[b]
        height = max(shared_height_m(one.z_m, other.z_m), 0.0)
        both = areas[a] * (one.z_m[1] - one.z_m[0]) + areas[b] * (other.z_m[1] - other.z_m[0]) - area * height
        if one.class_name == other.class_name and area * height >= share * both:
            found.append((one, other))
    return found


def _deleted(context: Context, part: Part) -> tuple[Edit, ...]:
    """Edits that take out a shape, or the whole link where it has no other and carries nothing."""
    link = context.map.links[part.link]
    spans = [part.shape.element.span]
    if len(link.shapes) == 1:
        joint = context.map.parent_joint(link.name)
        if joint is None or context.map.children_of(link.name) or link.openings:
            return ()
        spans = [link.element.span, joint.element.span]
    return tuple(Edit(span.offset, span.end - span.offset, b"") for span in spans)


def _new_xyz(edits: tuple[Edit, ...]) -> str:
    return f': xyz="{edits[0].text.decode()}"' if edits else ""


RULES = (
    Rule("WK-E010", "error", e010_in_wall, fix="moderate", blocks=False),
    Rule("WK-E011", "error", e011_overlap, blocks=False),
    Rule("WK-E012", "warning", e012_off_wall, fix="moderate"),
    Rule("WK-E013", "warning", e013_faces_wall),
    Rule("WK-E014", "error", e014_duplicate, fix="moderate", blocks=False),
)
