"""Move and rotate: another <origin> in the joint of an element; what hangs on it goes with it, or stays where it is."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from wallkit.core.geometry import invert_matrix
from wallkit.core.types import Float64Array
from wallkit.maps.document import Edit
from wallkit.maps.draft.xml import number_text, numbers_text
from wallkit.maps.edit.changes import Changes, renumbered, set_origin, sliced
from wallkit.maps.edit.lookup import joint_above, link_named, opening_named, refuse, wall_named
from wallkit.maps.nouns import Joint, Opening
from wallkit.maps.numbers import numbers_from_text
from wallkit.maps.rules.base import Context

Frame = Literal["map", "parent", "own"]


def move(
    context: Context, name: str, by_m: tuple[float, float, float], *, frame: Frame = "map", leave_children: bool = False
) -> Changes:
    """An element moved by (x, y, z) along the axes of the map, of what it hangs on, or of its own.

    Raises:
        MapError: no such element, it hangs on nothing, or it fills an opening (which moves with `move_opening`).
    """
    joint = joint_above(context, name)
    _check_fills_nothing(context, name, "moved", f"move the opening: wallkit map move {{}} {{}} --along {by_m[0]:g}")
    T_map_link, T_map_parent = context.poses[name], context.poses[joint.parent]
    R_map_frame = {"map": np.eye(3), "parent": T_map_parent[:3, :3], "own": T_map_link[:3, :3]}[frame]
    T_new = T_map_link.copy()
    T_new[:3, 3] += R_map_frame @ np.array(by_m)
    changes = placed_anew(context, joint, T_new, leave_children=leave_children)
    before, after = (numbers_text(tuple(T[:3, 3].tolist())) for T in (T_map_link, T_new))
    return Changes(changes.edits, (f"{name}: at {before} -> {after} in the map{_with(changes)}",))


def move_to(context: Context, name: str, to_m: tuple[float | None, ...], *, leave_children: bool = False) -> Changes:
    """An element moved to a place (x, y, z) in the map; None keeps that coordinate."""
    joint_above(context, name)
    here = context.poses[name][:3, 3].tolist()
    by_m = [0.0 if wanted is None else wanted - value for wanted, value in zip(to_m, here, strict=True)]
    return move(context, name, (by_m[0], by_m[1], by_m[2]), leave_children=leave_children)


def move_opening(context: Context, name: str, along_m: float, wall: str = "") -> Changes:
    """What an opening and its fills say of their place, moved along the wall; the boxes follow in steps of their own.

    Raises:
        MapError: no such opening, or it would leave its wall.
    """
    link, opening = opening_named(context, name, wall)
    side = wall_named(context, link.name)
    low, high = (x + along_m for x in opening.along_m)
    if low < side.bounds[0] - 1e-6 or high > side.bounds[2] + 1e-6:
        message = (
            f"opening '{name}' would reach from {number_text(low)} to {number_text(high)} m, wall '{link.name}' goes "
            f"from {number_text(side.bounds[0])} to {number_text(side.bounds[2])} m"
        )
        raise refuse(context, message, "move it by less")
    for other in link.openings:
        (a0, a1), (b0, b1), (z0, z1) = other.along_m, other.z_m, opening.z_m
        if other is not opening and min(high, a1) - max(low, a0) > 1e-6 and min(z1, b1) > max(z0, b0):
            message = f"from {number_text(low)} to {number_text(high)} m opening '{name}' would overlap '{other.id}'"
            raise refuse(context, f"{message}, {number_text(a0)} to {number_text(a1)} m", "move that one first")
    attribute = opening.element.attribute("along")
    edits = renumbered(attribute, (low, high)) if attribute is not None else ()
    said = [f"opening {name}: along {numbers_text(opening.along_m)} -> {numbers_text((low, high))} in {link.name}"]
    for fill in fills_of(context, link.name, opening):
        joint = joint_above(context, fill)
        shifted = joint.T_parent_child[:3, 3] + [along_m, 0.0, 0.0]
        edits += set_origin(joint.element, shifted)
        said.append(f"{fill}: with it, at {numbers_text(tuple(shifted.tolist()))} in {link.name}")
    return Changes(edits, tuple(said))


def fills_of(context: Context, wall: str, opening: Opening) -> list[str]:
    """The link that fills an opening, and the leaf that follows its joint."""
    found = [opening.fill] if opening.fill in context.map.links else []
    led = {joint.name for joint in context.map.children_of(wall) if joint.child in found}
    followers = [j.child for j in context.map.children_of(wall) if j.mimic is not None and j.mimic.joint in led]
    return [*found, *followers]


def rotate(
    context: Context,
    name: str,
    by_rad: float,
    *,
    about: tuple[float, float] | None = None,
    leave_children: bool = False,
) -> Changes:
    """An element turned about the upright axis through its frame, or through (x, y) in the map; anticlockwise from above.

    Raises:
        MapError: no such element, it hangs on nothing, or fills an opening.
    """
    joint = joint_above(context, name)
    _check_fills_nothing(
        context, name, "turned", "a door turns by its joint; hang it on the other side with `add door`"
    )
    T_map_link = context.poses[name]
    pivot = np.array([*(about if about is not None else T_map_link[:2, 3]), 0.0])
    c, s = math.cos(by_rad), math.sin(by_rad)
    T_turn = np.eye(4)
    T_turn[:2, :2] = (c, -s), (s, c)
    T_turn[:3, 3] = pivot - T_turn[:3, :3] @ pivot
    T_new = T_turn @ T_map_link
    changes = placed_anew(context, joint, T_new, leave_children=leave_children)
    yaws = [math.atan2(T[1, 0], T[0, 0]) for T in (T_map_link, T_new)]
    said = f"{name}: yaw {yaws[0]:.7g} -> {yaws[1]:.7g} rad ({math.degrees(by_rad):+.6g} deg)"
    if about is not None:
        before, after = (numbers_text(tuple(T[:3, 3].tolist())) for T in (T_map_link, T_new))
        said += f", at {before} -> {after} in the map"
    return Changes(changes.edits, (said + _with(changes),))


def placed_anew(
    context: Context, joint: Joint, T_map_link: Float64Array, *, leave_children: bool = False, parent: str = ""
) -> Changes:
    """Edits that put a joint's child somewhere else in the map, hanging on the same parent or another one.

    Args:
        T_map_link: where it shall be, the joint in its state of rest.
        leave_children: what hangs on it keeps its place in the map.

    Returns:
        The edits; said names the children, and how they fare.
    """
    T_map_parent = context.poses[parent or joint.parent]
    T_old = context.poses[joint.child]
    T_parent_link = invert_matrix(T_map_parent) @ T_map_link @ invert_matrix(joint.motion(joint.rest))
    edits = origin_edits(joint, T_parent_link)
    children = context.map.children_of(joint.child)
    if leave_children:
        T_new_old = invert_matrix(T_map_link) @ T_old
        for child in children:
            edits += origin_edits(child, T_new_old @ child.T_parent_child)
    how = "stays in its place" if leave_children else "goes with it"
    return Changes(edits, tuple(f"{child.child} {how}" for child in children))


def origin_edits(joint: Joint, T_parent_child: Float64Array) -> tuple[Edit, ...]:
    """Edits that give a joint another pose; angles stay near the old ones, as they were written."""
    origin = joint.element.find("origin")
    written = numbers_from_text(origin.get("rpy"), 3) if origin is not None else None
    old = np.zeros(3) if written is None else np.array(written)
    rpy = rpy_from_matrix(T_parent_child)
    if np.allclose(T_parent_child[:3, :3], joint.T_parent_child[:3, :3], atol=1e-12):
        rpy = old
    elif not old[:2].any() and not rpy[:2].any():
        near = old[2] + math.remainder(rpy[2] - old[2], 2 * math.pi)
        rpy[2] = near if abs(near) <= math.pi + 1e-9 else rpy[2]
    return set_origin(joint.element, T_parent_child[:3, 3], rpy)


def copied_joint(joint: Joint, name: str, child: str, T_parent_child: Float64Array) -> bytes:
    """The bytes of a joint like another one, under another name, for another child in another place."""
    edits = list(origin_edits(joint, T_parent_child))
    element = joint.element.find("child")
    for attribute, value in (
        (joint.element.attribute("name"), name),
        (element.attribute("link") if element is not None else None, child),
    ):
        if attribute is not None:
            edits.append(attribute.replaced_by(value))
    return sliced(joint.element, edits)


def rpy_from_matrix(T: Float64Array) -> Float64Array:
    """Roll, pitch and yaw (3,) of a rotation, as URDF writes it; at a pitch of 90 degrees roll is 0.

    Without tilt roll and pitch are exactly 0.
    """
    pitch = math.atan2(-T[2, 0], math.hypot(T[0, 0], T[1, 0]))
    if abs(T[2, 0]) > 1 - 1e-12:
        return np.array([0.0, pitch, math.atan2(-T[0, 1], T[1, 1])])
    rpy = np.array([math.atan2(T[2, 1], T[2, 2]), pitch, math.atan2(T[1, 0], T[0, 0])])
    rpy[:2][np.abs(rpy[:2]) < 1e-12] = 0.0
    return rpy


# ------------------------------------------------------------------------------------------------- details


def _check_fills_nothing(context: Context, name: str, verb: str, hint: str) -> None:
    for link in context.map.links.values():
        for opening in link.openings:
            if opening.fill == name:
                said = hint.format(context.document.source, opening.id)
                raise refuse(context, f"'{name}' fills opening '{opening.id}' of '{link.name}': not {verb} alone", said)
    link_named(context, name)


def _with(changes: Changes) -> str:
    return (
        f"; {'; '.join(changes.said)}"
        if 0 < len(changes.said) <= 3
        else f"; {len(changes.said)} more go along" * (len(changes.said) > 3)
    )
