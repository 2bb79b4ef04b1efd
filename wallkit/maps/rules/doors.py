"""O, doors as joints: they turn about an upright axis within sensible limits, and what is believed about them adds up."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from wallkit.errors import closest
from wallkit.maps.document import Edit
from wallkit.maps.nouns import Joint
from wallkit.maps.numbers import text_from_number
from wallkit.maps.rules.base import Context, Problem, Rule
from wallkit.maps.rules.elevation import in_frame
from wallkit.maps.rules.floods import closed_leaves

STATES = ("closed", "open", "unknown")
_FULL_TURN_RAD = 2 * math.pi
# a hinge that leans by more is not upright
_UPRIGHT_RAD = math.radians(2)
_STATE_M = 1e-6


def limits_are_sane(joint: Joint) -> bool:
    """Whether a joint's travel is an angle in radians, or a length (WK-O012)."""
    return joint.kind != "revolute" or max(map(abs, joint.travel)) <= _FULL_TURN_RAD + 1e-3


def axis_is_sane(context: Context, joint: Joint) -> bool:
    """Whether a hinge is upright, and a slide runs along its wall or upwards (WK-O013)."""
    length = float(np.linalg.norm(joint.axis))
    if joint.parent not in context.poses or length == 0:
        return True
    R_parent_joint = joint.T_parent_child[:3, :3]
    axis_map = context.poses[joint.parent][:3, :3] @ R_parent_joint @ joint.axis / length
    is_upright = abs(float(axis_map[2])) >= math.cos(_UPRIGHT_RAD)
    if joint.kind != "prismatic" or is_upright:
        return is_upright
    along_wall = abs(float((R_parent_joint @ joint.axis)[0])) / length
    info = context.map.class_of(joint.parent)
    return info is None or info.mount != "structure" or along_wall >= math.cos(_UPRIGHT_RAD)


def o008_door_without_opening(context: Context) -> Iterator[Problem]:
    """A door is in no opening, so nothing says which hole it closes.

    Bad:
      <link name="door_a"><wk:object class="door"/><collision><geometry><box size="0.9 0.04 2"/></geometry></collision>
      </link>
      <joint name="d" type="revolute"><parent link="map"/><child link="door_a"/><axis xyz="0 0 1"/>
      <limit lower="0" upper="1.5" effort="1" velocity="1"/></joint>
    Good: a wall with <wk:opening id="d1" kind="door" along="1 1.9" z="0 2.1" fill="door_a"/> and the door hanging on it.
    """
    openings = {link.name: link.openings for link in context.map.links.values() if link.openings}
    filled = {opening.fill for own in openings.values() for opening in own}
    closed = {part.link: part for part in context.once(closed_leaves)}
    for joint in context.map.doors:
        leader = context.map.joints.get(joint.mimic.joint) if joint.mimic is not None else None
        if joint.child in filled or (leader is not None and leader.child in filled):
            continue
        part = closed.get(joint.child)
        if part is not None and joint.parent in openings:
            middle = in_frame(part.corners, context.poses[joint.parent]).mean(axis=0)
            # the second leaf of a double door
            if any(one.along_m[0] < middle[0] < one.along_m[1] for one in openings[joint.parent]):
                continue
        message = f"door '{joint.child}' fills no opening"
        hint = f'declare it in its wall: <wk:opening ... fill="{joint.child}"/>'
        xyz = tuple(context.poses[joint.child][:3, 3]) if joint.child in context.poses else ()
        yield Problem(context.map.links[joint.child].element, message, hint, xyz=xyz)


def o012_degrees(context: Context) -> Iterator[Problem]:
    """A hinge turns by more than a full turn: its limits were written in degrees.

    Bad:
      <link name="door_a"/><joint name="d" type="revolute"><parent link="map"/><child link="door_a"/><axis xyz="0 0 1"/>
      <limit lower="0" upper="90" effort="1" velocity="1"/></joint>
    Good:
      <link name="door_a"/><joint name="d" type="revolute"><parent link="map"/><child link="door_a"/><axis xyz="0 0 1"/>
      <limit lower="0" upper="1.5707963" effort="1" velocity="1"/></joint>
    """
    for joint in context.map.joints.values():
        limit = joint.element.find("limit")
        if limit is None or limits_are_sane(joint):
            continue
        edits: list[Edit] = []
        for name, value in (("lower", joint.lower), ("upper", joint.upper)):
            attribute = limit.attribute(name)
            if attribute is not None and value:
                edits.append(attribute.replaced_by(text_from_number(math.radians(value), 8)))
        low, high = joint.travel
        message = f"joint '{joint.name}' turns from {low:g} to {high:g} rad, more than a full turn: degrees?"
        hint = f'lower="{math.radians(low):.7g}" upper="{math.radians(high):.7g}"'
        yield Problem(limit, message, hint, edits=tuple(edits))


def o013_axis(context: Context) -> Iterator[Problem]:
    """A door's hinge is not upright, or a sliding door does not slide along its wall (or upwards).

    Bad:
      <link name="door_a"/><joint name="d" type="revolute"><parent link="map"/><child link="door_a"/><axis xyz="1 0 0"/>
      <limit lower="0" upper="1.5" effort="1" velocity="1"/></joint>
    Good:
      <link name="door_a"/><joint name="d" type="revolute"><parent link="map"/><child link="door_a"/><axis xyz="0 0 1"/>
      <limit lower="0" upper="1.5" effort="1" velocity="1"/></joint>
    """
    for joint in context.map.doors:
        if axis_is_sane(context, joint):
            continue
        axis = joint.element.find("axis")
        written = " ".join(f"{value:g}" for value in joint.axis)
        is_slide = joint.kind == "prismatic"
        what = "slides across its wall" if is_slide else "hangs on a hinge that is not upright"
        hint = '<axis xyz="1 0 0"/> is along the wall' if is_slide else 'a door turns about <axis xyz="0 0 1"/>'
        at = axis.spot("xyz") if axis is not None else joint.element
        yield Problem(at, f"door '{joint.child}' {what}: axis {written}", hint)


def o014_rest(context: Context) -> Iterator[Problem]:
    """A joint rests where it cannot go.

    Bad:
      <link name="door_a"/><joint name="d" type="revolute"><parent link="map"/><child link="door_a"/><axis xyz="0 0 1"/>
      <limit lower="0" upper="1.5" effort="1" velocity="1"/><wk:state rest="2"/></joint>
    Good:
      <link name="door_a"/><joint name="d" type="revolute"><parent link="map"/><child link="door_a"/><axis xyz="0 0 1"/>
      <limit lower="0" upper="1.5" effort="1" velocity="1"/><wk:state rest="0"/></joint>
    """
    for joint in context.map.joints.values():
        if joint.state is None or joint.state.rest is None or not joint.is_movable:
            continue
        low, high = joint.travel
        if not low - _STATE_M <= joint.rest <= high + _STATE_M:
            message = f"joint '{joint.name}' rests at {joint.rest:g}, but goes from {low:g} to {high:g}"
            limit = joint.element.find("limit")
            related = (("its limits", limit),) if limit is not None else ()
            yield Problem(joint.state.element.spot("rest"), message, "0 is closed", related=related)


def o015_prior(context: Context) -> Iterator[Problem]:
    """A prior is no distribution over the states closed, open and unknown.

    Bad:
      <link name="door_a"/><joint name="d" type="continuous"><parent link="map"/><child link="door_a"/>
      <axis xyz="0 0 1"/>
      <wk:state prior="closed:0.7 open:0.7"/></joint>
    Good:
      <link name="door_a"/><joint name="d" type="continuous"><parent link="map"/><child link="door_a"/>
      <axis xyz="0 0 1"/>
      <wk:state prior="closed:0.7 open:0.3"/></joint>
    """
    hint = 'for example prior="closed:0.7 open:0.2 unknown:0.1"'
    for joint in context.map.joints.values():
        if joint.state is None or not joint.state.prior_text.strip():
            continue
        spot, prior = joint.state.element.spot("prior"), joint.state.prior
        if prior is None:
            yield Problem(spot, f"prior '{joint.state.prior_text}' of joint '{joint.name}' cannot be read", hint)
            continue
        for name, share in prior.items():
            if name not in STATES:
                message = f"prior of joint '{joint.name}' names a state '{name}'"
                yield Problem(spot, message, closest(name, STATES))
            elif not 0 <= share <= 1:
                yield Problem(spot, f"prior of joint '{joint.name}' gives '{name}' the probability {share:g}", hint)
        total = sum(prior.values())
        if abs(total - 1) > context.tolerances.prior_sum:
            yield Problem(spot, f"prior of joint '{joint.name}' sums to {total:g}, not 1", hint)


def o016_no_prior(context: Context) -> Iterator[Problem]:
    """Nothing is said about how a door mostly stands, so the filter takes every state for equally likely.

    Bad:
      <link name="door_a"/><joint name="d" type="continuous"><parent link="map"/><child link="door_a"/>
      <axis xyz="0 0 1"/></joint>
    Good:
      <link name="door_a"/><joint name="d" type="continuous"><parent link="map"/><child link="door_a"/>
      <axis xyz="0 0 1"/>
      <wk:state prior="closed:0.7 open:0.3"/></joint>
    """
    for joint in context.map.doors:
        if joint.mimic is None and (joint.state is None or not joint.state.prior_text.strip()):
            message = f"door '{joint.child}' has no prior"
            yield Problem(joint.element, message, '<wk:state rest="0" prior="closed:0.7 open:0.2 unknown:0.1"/>')


RULES = (
    Rule("WK-O008", "warning", o008_door_without_opening),
    Rule("WK-O012", "error", o012_degrees, fix="moderate"),
    Rule("WK-O013", "error", o013_axis),
    Rule("WK-O014", "error", o014_rest),
    Rule("WK-O015", "error", o015_prior, blocks=False),
    Rule("WK-O016", "info", o016_no_prior),
)
