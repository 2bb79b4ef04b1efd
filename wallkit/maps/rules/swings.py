"""O, doors on their way: what a leaf sweeps from closed to open stays clear of walls, fixtures and other doors."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from wallkit.maps.document import Edit
from wallkit.maps.geometry import Part
from wallkit.maps.nouns import Joint
from wallkit.maps.numbers import text_from_number
from wallkit.maps.rules.base import Context, Problem, Rule
from wallkit.maps.rules.doors import axis_is_sane, limits_are_sane
from wallkit.maps.rules.elevation import fill_extents
from wallkit.maps.rules.solids import fixtures, joint_spot, shared_height_m, sound_runs, structure
from wallkit.maps.space import DoorSweep, door_sweep

# parts that share less of their height pass over each other: a leaf over its threshold
GRAZE_M = 1e-3
_REFINED_STEPS = 16
# of a hit that counts, contact begins at this overlap: a square millimetre
_CONTACT_M2 = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Hit:
    """A leaf that runs into something.

    Attributes:
        state: first joint state (radians or metres) at which they touch. area_m2: the largest overlap, at the state `worst`.
        xy: the middle of that overlap.
    """

    sweep: DoorSweep
    part: Part
    state: float
    area_m2: float
    worst: float
    xy: tuple[float, float]


def sweeps(context: Context) -> list[DoorSweep]:
    """The sweep of every door whose joint is sound and whose leaf fits its opening; other rules name the rest."""
    limits = context.tolerances
    too_large = set()
    for wall in context.map.links.values():
        for opening in wall.openings:
            extent = context.once(fill_extents).get(opening.element)
            if extent is not None:
                x0, z0, x1, z1 = extent
                width_m, height_m = (high - low for low, high in (opening.along_m, opening.z_m))
                if x1 - x0 > width_m + limits.leaf_m or z1 - z0 > height_m + limits.leaf_m:
                    too_large.add(opening.fill)
    found = []
    for joint in context.map.doors:
        is_placed = joint.child in context.poses and joint.closed != joint.open
        if is_placed and joint.child not in too_large and limits_are_sane(joint) and axis_is_sane(context, joint):
            sweep = door_sweep(context.map, joint, steps=limits.sweep_steps, poses=context.poses, solids=context.parts)
            if sweep.parts:
                found.append(sweep)
    return found


def o010_hits_wall(context: Context) -> Iterator[Problem]:
    """A door hits its jamb or another wall when it opens.

    Mostly the hinge sits inside the wall's thickness; it belongs on the face of the wall to which the door opens.

    Bad:
      <link name="wall_a"><wk:opening id="d" kind="door" along="1 2" z="0 2.5" fill="door_a"/>
      <collision><origin xyz="0.5 0 1.25"/><geometry><box size="1 0.1 2.5"/></geometry></collision>
      <collision><origin xyz="3 0 1.25"/><geometry><box size="2 0.1 2.5"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
      <link name="door_a"><collision><origin xyz="0.5 0 1.25"/><geometry><box size="0.98 0.04 2.48"/></geometry>
      </collision></link>
      <joint name="d" type="revolute"><parent link="wall_a"/><child link="door_a"/><origin xyz="1 0 0"/>
      <axis xyz="0 0 1"/>
      <limit lower="0" upper="1.5" effort="1" velocity="1"/></joint>
    Good:
      <link name="wall_a"><wk:opening id="d" kind="door" along="1 2" z="0 2.5" fill="door_a"/>
      <collision><origin xyz="0.5 0 1.25"/><geometry><box size="1 0.1 2.5"/></geometry></collision>
      <collision><origin xyz="3 0 1.25"/><geometry><box size="2 0.1 2.5"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
      <link name="door_a"><collision><origin xyz="0.49 -0.02 1.25"/><geometry><box size="0.98 0.04 2.48"/></geometry>
      </collision></link>
      <joint name="d" type="revolute"><parent link="wall_a"/><child link="door_a"/><origin xyz="1.01 0.05 0"/>
      <axis xyz="0 0 1"/>
      <limit lower="0" upper="1.5" effort="1" velocity="1"/></joint>
    """
    for hit in _hits(context, context.once(structure)):
        if hit.sweep.joint.kind == "prismatic":
            continue
        edits = _hinge_on_face(context, hit.sweep.joint)
        hint = "put the hinge on the wall face of the swing side"
        if edits:
            hint += f': xyz="{edits[0].text.decode()}", and the leaf at xyz="{edits[1].text.decode()}"'
        yield _problem(context, hit, f"wall part '{hit.part.name}'", hint, edits)


def o011_hits_fixture(context: Context) -> Iterator[Problem]:
    """A door hits a fixture when it opens.

    Bad:
      <link name="door_a"><collision><origin xyz="0.5 0 1"/><geometry><box size="0.9 0.04 2"/></geometry></collision>
      </link>
      <joint name="d" type="revolute"><parent link="map"/><child link="door_a"/><axis xyz="0 0 1"/>
      <limit lower="0" upper="1.5" effort="1" velocity="1"/></joint>
      <link name="trash"><collision><origin xyz="0 0 0.25"/><geometry><box size="0.3 0.3 0.5"/></geometry></collision>
      </link>
      <joint name="b" type="fixed"><parent link="map"/><child link="trash"/><origin xyz="0.5 0.5 0"/></joint>
    Good:
      <link name="door_a"><collision><origin xyz="0.5 0 1"/><geometry><box size="0.9 0.04 2"/></geometry></collision>
      </link>
      <joint name="d" type="revolute"><parent link="map"/><child link="door_a"/><axis xyz="0 0 1"/>
      <limit lower="0" upper="1.5" effort="1" velocity="1"/></joint>
      <link name="trash"><collision><origin xyz="0 0 0.25"/><geometry><box size="0.3 0.3 0.5"/></geometry></collision>
      </link>
      <joint name="b" type="fixed"><parent link="map"/><child link="trash"/><origin xyz="0.5 -0.5 0"/></joint>
    """
    for hit in _hits(context, context.once(fixtures)):
        if hit.sweep.joint.kind != "prismatic":
            what = f"{hit.part.class_name} '{hit.part.link}'"
            yield _problem(context, hit, what, "move it, or limit how far the door opens")


def o017_slide_blocked(context: Context) -> Iterator[Problem]:
    """A sliding door has no room to open.

    Bad:
      <link name="wall_a"><wk:opening id="d" kind="door" along="1 2" z="0 2.5" fill="door_a"/>
      <collision><origin xyz="0.5 0 1.25"/><geometry><box size="1 0.1 2.5"/></geometry></collision>
      <collision><origin xyz="3 0 1.25"/><geometry><box size="2 0.1 2.5"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
      <link name="door_a"><collision><origin xyz="0 0 1.25"/><geometry><box size="0.98 0.04 2.48"/></geometry>
      </collision></link>
      <joint name="d" type="prismatic"><parent link="wall_a"/><child link="door_a"/><origin xyz="1.5 0 0"/>
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
    for hit in _hits(context, [*context.once(structure), *context.once(fixtures)]):
        if hit.sweep.joint.kind == "prismatic":
            yield _problem(context, hit, f"'{hit.part.name}'", "hang it before the wall's face")


# -------------------------------------------------------------------------------------------- details


def _hits(context: Context, obstacles: Sequence[Part]) -> list[Hit]:
    """Per door and obstacle's link the part that is hit first."""
    import shapely

    if not obstacles:
        return []
    tree = shapely.STRtree([part.footprint for part in obstacles])
    found: dict[tuple[str, str], Hit] = {}
    for sweep in context.once(sweeps):
        own = set(context.map.subtree(sweep.joint.child))
        for index in sorted(tree.query(sweep.swept, predicate="intersects").tolist()):
            part = obstacles[index]
            if part.link in own or shared_height_m(part.z_m, sweep.z_m) <= GRAZE_M:
                continue
            hit = _hit(context, sweep, part)
            key = (sweep.joint.name, part.link)
            if hit is not None and (key not in found or abs(hit.state) < abs(found[key].state)):
                found[key] = hit
    return list(found.values())


def _hit(context: Context, sweep: DoorSweep, part: Part) -> Hit | None:
    import shapely

    areas = shapely.area(shapely.intersection(np.array(sweep.leaves, dtype=object), part.footprint))
    if areas.max() <= context.tolerances.swing_m2:
        return None
    first, worst = int(np.argmax(areas > _CONTACT_M2)), int(np.argmax(areas))
    state = float(sweep.states[first])
    if first > 0:
        # look closer between the last free state and this one
        low, high = sorted((float(sweep.states[first - 1]), state))
        kind = "revolute" if sweep.joint.kind == "continuous" else sweep.joint.kind
        between = replace(sweep.joint, kind=kind, lower=low, upper=high)
        closer = door_sweep(context.map, between, steps=_REFINED_STEPS, poses=context.poses, solids=sweep.parts)
        over = shapely.area(shapely.intersection(np.array(closer.leaves, dtype=object), part.footprint)) > _CONTACT_M2
        state = float(closer.states[int(np.argmax(over))])
    middle = sweep.leaves[worst].intersection(part.footprint).centroid
    return Hit(sweep, part, state, float(areas[worst]), float(sweep.states[worst]), (middle.x, middle.y))


def _problem(context: Context, hit: Hit, what: str, hint: str, edits: tuple[Edit, ...] = ()) -> Problem:
    joint = hit.sweep.joint
    unit = "m" if joint.kind == "prismatic" else "rad"
    when = "fully open" if hit.worst == hit.sweep.states[-1] else f"at {hit.worst:.3g} {unit}"
    message = (
        f"door '{joint.child}' hits {what} from {abs(hit.state - joint.closed):.2f} {unit} on "
        f"(travel {joint.closed:g} to {joint.open:.4g} {unit}; overlap {hit.area_m2 * 1e4:.3g} cm2 {when})"
    )
    return Problem(
        joint_spot(context, joint.child) or joint.element,
        message,
        hint,
        xyz=hit.xy,
        related=((f"'{hit.part.name}'", hit.part.shape.element),),
        edits=edits,
        detail={"state": hit.state, "overlap_m2": hit.area_m2},
    )


def _hinge_on_face(context: Context, joint: Joint) -> tuple[Edit, ...]:
    """Edits that put a hinge inside the wall's thickness on its face, and the leaf flush with that face.

    Only for the plain case: a leaf of one box, nothing turned, the hinge at the leaf's edge.
    """
    runs = [run for run in context.once(sound_runs) if run.link == joint.parent]
    leaf = context.map.links[joint.child]
    at = joint_spot(context, joint.child)
    if not runs or at is None or len(leaf.shapes) != 1 or leaf.shapes[0].kind != "box":
        return ()
    shape, half_m = leaf.shapes[0], runs[0].thickness_m / 2
    origin = shape.element.find("origin")
    leaf_at = origin.attribute("xyz") if origin is not None else None
    is_turned = not np.allclose(shape.T_link_shape[:3, :3], np.eye(3)) or not np.allclose(
        joint.T_parent_child[:3, :3], np.eye(3)
    )
    hinge, centre = joint.T_parent_child[:3, 3].copy(), shape.T_link_shape[:3, 3].copy()
    if leaf_at is None or is_turned or abs(hinge[1]) >= half_m - 1e-6 or centre[0] == 0:
        return ()
    # the side to which the leaf's middle moves: axis x radius
    side = float(np.sign(joint.axis[2] * (joint.open - joint.closed) * centre[0]))
    edge_m = centre[0] - np.sign(centre[0]) * shape.size[0] / 2
    hinge[:2] = hinge[0] + edge_m, side * half_m
    centre[:2] = centre[0] - edge_m, -side * shape.size[1] / 2
    texts = [
        " ".join(text_from_number(round(value, 6)) for value in (at_xyz + 0.0).tolist()) for at_xyz in (hinge, centre)
    ]
    return (at.replaced_by(texts[0]), leaf_at.replaced_by(texts[1]))


RULES = (
    Rule("WK-O010", "error", o010_hits_wall, fix="moderate"),
    Rule("WK-O011", "error", o011_hits_fixture, blocks=False),
    Rule("WK-O017", "warning", o017_slide_blocked),
)
