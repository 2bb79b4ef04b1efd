"""G, second half: joints that move by a usable amount about a usable axis."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from wallkit.errors import closest
from wallkit.maps.document import Attribute, Edit, Element
from wallkit.maps.model import SemanticMap
from wallkit.maps.nouns import Joint
from wallkit.maps.numbers import text_from_number
from wallkit.maps.rules.base import Context, Problem, Rule


def g020_no_limit(context: Context) -> Iterator[Problem]:
    """A revolute or prismatic joint does not say how far it goes.

    Bad:
      <link name="a"/><joint name="j" type="revolute"><parent link="map"/><child link="a"/><axis xyz="0 0 1"/></joint>
    Good:
      <link name="a"/><joint name="j" type="revolute"><parent link="map"/><child link="a"/><axis xyz="0 0 1"/>
      <limit lower="0" upper="1.57" effort="1" velocity="1"/></joint>
    """
    for joint in _with_limits(context.map):
        if joint.element.find("limit") is None:
            message = f"{joint.kind} joint '{joint.name}' has no <limit>"
            yield Problem(joint.element, message, 'add <limit lower="0" upper="1.5708" effort="1" velocity="1"/>')


def g021_limits_swapped(context: Context) -> Iterator[Problem]:
    """A joint's lower limit is above its upper one.

    Bad:
      <link name="a"/><joint name="j" type="revolute"><parent link="map"/><child link="a"/><axis xyz="0 0 1"/>
      <limit lower="1" upper="0" effort="1" velocity="1"/></joint>
    Good:
      <link name="a"/><joint name="j" type="revolute"><parent link="map"/><child link="a"/><axis xyz="0 0 1"/>
      <limit lower="0" upper="1" effort="1" velocity="1"/></joint>
    """
    for joint in _with_limits(context.map):
        low, high = joint.lower or 0.0, joint.upper or 0.0
        limit = joint.element.find("limit")
        if limit is not None and low > high:
            lower, upper = limit.attribute("lower"), limit.attribute("upper")
            edits = (lower.replaced_by(upper.value), upper.replaced_by(lower.value)) if lower and upper else ()
            message = f"joint '{joint.name}' has lower {low:g} above upper {high:g}"
            yield Problem(limit, message, "swap them", edits=edits)


def g022_zero_axis(context: Context) -> Iterator[Problem]:
    """A joint's axis has no direction.

    Bad:
      <link name="a"/><joint name="j" type="continuous"><parent link="map"/><child link="a"/><axis xyz="0 0 0"/></joint>
    Good:
      <link name="a"/><joint name="j" type="continuous"><parent link="map"/><child link="a"/><axis xyz="0 0 1"/></joint>
    """
    for joint in _movable(context.map):
        if not np.any(joint.axis):
            message = f"the axis of joint '{joint.name}' is 0 0 0"
            yield Problem(_axis_spot(joint), message, 'a door turns about <axis xyz="0 0 1"/>')


def g023_axis_length(context: Context) -> Iterator[Problem]:
    """A joint's axis is not of length 1.

    Some readers multiply the travel of a sliding joint by it: with "0 0 2" a door opens twice as far.

    Bad:
      <link name="a"/><joint name="j" type="continuous"><parent link="map"/><child link="a"/><axis xyz="0 0 2"/></joint>
    Good:
      <link name="a"/><joint name="j" type="continuous"><parent link="map"/><child link="a"/><axis xyz="0 0 1"/></joint>
    """
    for joint in _movable(context.map):
        length = float(np.linalg.norm(joint.axis))
        spot = _axis_spot(joint)
        if length > 0 and abs(length - 1) > context.tolerances.axis_length and isinstance(spot, Attribute):
            unit = " ".join(text_from_number(value) for value in joint.axis / length)
            message = f"the axis of joint '{joint.name}' is {length:.4g} long, not 1"
            yield Problem(spot, message, f'xyz="{unit}"', edits=(spot.replaced_by(unit),))


def g024_no_travel(context: Context) -> Iterator[Problem]:
    """A joint's limits are equal: it cannot move and could as well be fixed.

    Bad:
      <link name="a"/><joint name="j" type="revolute"><parent link="map"/><child link="a"/><axis xyz="0 0 1"/>
      <limit lower="0" upper="0" effort="1" velocity="1"/></joint>
    Good: <link name="a"/><joint name="j" type="fixed"><parent link="map"/><child link="a"/></joint>
    """
    for joint in _with_limits(context.map):
        limit = joint.element.find("limit")
        if limit is not None and (joint.lower or 0.0) == (joint.upper or 0.0):
            at_zero = (joint.lower or 0.0) == 0.0
            kind = joint.element.attribute("type")
            # only at 0 does the child stay where it is
            edits = (kind.replaced_by("fixed"), *_removed(joint, "axis", "limit")) if at_zero and kind else ()
            message = f"joint '{joint.name}' goes from {joint.lower or 0:g} to {joint.upper or 0:g}: it cannot move"
            yield Problem(limit, message, 'type="fixed"', edits=edits)


def g025_mimic(context: Context) -> Iterator[Problem]:
    """A joint follows one that does not exist, cannot move, or follows it in turn.

    Bad:
      <link name="a"/><joint name="j" type="continuous"><parent link="map"/><child link="a"/><axis xyz="0 0 1"/>
      <mimic joint="jj"/></joint>
    Good:
      <link name="a"/><joint name="j" type="continuous"><parent link="map"/><child link="a"/><axis xyz="0 0 1"/></joint>
      <link name="b"/><joint name="k" type="continuous"><parent link="map"/><child link="b"/><axis xyz="0 0 1"/>
      <mimic joint="j" multiplier="-1"/></joint>
    """
    joints = context.map.joints
    for joint in joints.values():
        if joint.mimic is None:
            continue
        spot, target = joint.mimic.element.spot("joint"), joints.get(joint.mimic.joint)
        if target is None:
            hint = closest(joint.mimic.joint, [other.name for other in _movable(context.map)])
            yield Problem(spot, f"joint '{joint.name}' follows '{joint.mimic.joint}', which does not exist", hint)
        elif not target.is_movable:
            message = f"joint '{joint.name}' follows '{target.name}', which cannot move"
            yield Problem(spot, message, related=(("the joint it follows", target.element.spot("type")),))
        elif np.isnan(context.map.joint_state(joint.name, {})):
            message = f"joint '{joint.name}' follows '{target.name}', which in the end follows it"
            yield Problem(spot, message, "one of them must lead")


def g026_free_joint(context: Context) -> Iterator[Problem]:
    """A floating or planar joint: what hangs on it has no place in a map.

    Bad: <link name="a"/><joint name="j" type="floating"><parent link="map"/><child link="a"/></joint>
    Good: <link name="a"/><joint name="j" type="fixed"><parent link="map"/><child link="a"/></joint>
    """
    for joint in context.map.joints.values():
        if joint.kind in ("floating", "planar"):
            message = f"joint '{joint.name}' is {joint.kind}: '{joint.child}' is taken where it was drawn"
            yield Problem(joint.element.spot("type"), message, 'type="fixed"')


def g027_fixed_with_travel(context: Context) -> Iterator[Problem]:
    """A fixed joint has an axis or limits, which mean nothing there.

    Bad:
      <link name="a"/><joint name="j" type="fixed"><parent link="map"/><child link="a"/><axis xyz="0 0 1"/></joint>
    Good: <link name="a"/><joint name="j" type="fixed"><parent link="map"/><child link="a"/></joint>
    """
    for joint in context.map.joints.values():
        useless = [
            element for tag in ("axis", "limit") if joint.kind == "fixed" for element in joint.element.findall(tag)
        ]
        if useless:
            named = " and ".join(f"<{element.name}>" for element in useless)
            edits = _removed(joint, "axis", "limit")
            yield Problem(useless[0], f"{named} of fixed joint '{joint.name}' means nothing", "delete it", edits=edits)


# -------------------------------------------------------------------------------------------- details


def _movable(semantic_map: SemanticMap) -> Iterator[Joint]:
    return (joint for joint in semantic_map.joints.values() if joint.is_movable)


def _with_limits(semantic_map: SemanticMap) -> Iterator[Joint]:
    return (joint for joint in _movable(semantic_map) if joint.kind != "continuous")


def _axis_spot(joint: Joint) -> Attribute | Element:
    axis = joint.element.find("axis")
    return axis.spot("xyz") if axis is not None else joint.element


def _removed(joint: Joint, *tags: str) -> tuple[Edit, ...]:
    spans = [element.span for tag in tags for element in joint.element.findall(tag)]
    return tuple(Edit(span.offset, span.end - span.offset, b"") for span in spans)


RULES = (
    Rule("WK-G020", "error", g020_no_limit),
    Rule("WK-G021", "error", g021_limits_swapped, fix="safe"),
    Rule("WK-G022", "error", g022_zero_axis),
    Rule("WK-G023", "warning", g023_axis_length, fix="safe"),
    Rule("WK-G024", "info", g024_no_travel, fix="safe"),
    Rule("WK-G025", "error", g025_mimic),
    Rule("WK-G026", "warning", g026_free_joint),
    Rule("WK-G027", "info", g027_fixed_with_travel, fix="safe"),
)
