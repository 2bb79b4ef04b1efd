"""Array: an element copied in a row, each copy a step farther along what it hangs on."""

from __future__ import annotations

import re

import numpy as np

from wallkit.core.types import Float64Array
from wallkit.maps.document import Edit, Element
from wallkit.maps.draft.xml import number_text, numbers_text
from wallkit.maps.edit.changes import Changes, indent_of, newline_of, sliced
from wallkit.maps.edit.lookup import Wall, free_name, joint_above, refuse, wall_named
from wallkit.maps.edit.place import copied_joint
from wallkit.maps.nouns import Joint
from wallkit.maps.rules.base import Context

# a row's last element may reach so far past its wall's end: rounding
_PAST_M = 1e-6


def array(context: Context, name: str, count: int, step_m: tuple[float, float, float]) -> Changes:
    """A row of `count` elements, the named one the first; each hangs on the same, a step (x, y, z) farther in its frame.

    Raises:
        MapError: no such element, something hangs on it, fewer than 2, no step, or the row would leave its wall.
    """
    joint = joint_above(context, name)
    link = context.map.links[name]
    if count < 2:
        raise refuse(context, f"a row of {count} is no row", "--count counts the first one too: 2 or more")
    if not any(step_m):
        raise refuse(
            context, "a row with a step of 0 m stands all in one place", "give the distance of two: --pitch 0.75"
        )
    if children := context.map.children_of(name):
        raise refuse(
            context, f"'{children[0].child}' hangs on '{name}'", "copy single elements, then what hangs on them"
        )
    if link.openings or joint.mimic is not None or joint.is_movable:
        what = "has openings" if link.openings else "moves"
        raise refuse(context, f"'{name}' {what}: it cannot be copied in a row", "add each with `wallkit map add`")
    _check_stays(context, name, joint, (count - 1) * np.array(step_m))
    taken = {*context.map.links, *context.map.joints}
    pieces, said = [], []
    stem = re.sub(r"_[0-9]+$", "", name)
    for k in range(1, count):
        copy = free_name(taken, f"{stem}_{_number(name) + k}")
        joint_name = f"at_{copy}" if joint.name == f"at_{name}" else free_name(taken, f"{joint.name}_{k + 1}")
        if joint_name in taken:
            raise refuse(context, f"the joint '{joint_name}' is there already", "rename it first")
        taken |= {copy, joint_name}
        T_place = joint.T_parent_child.copy()
        T_place[:3, 3] += k * np.array(step_m)
        pieces.append(_copied_link(link.element, name, copy))
        pieces.append(copied_joint(joint, joint_name, copy, T_place))
        said.append(
            f"{copy}: added, {link.class_name}, at {numbers_text(tuple(T_place[:3, 3].tolist()))} on {joint.parent}"
        )
    last = max(link.element, joint.element, key=lambda element: element.offset)
    between = (newline_of(context.document) + indent_of(last)).encode(context.document.encoding)
    edit = Edit(last.span.end, 0, b"".join(between + piece for piece in pieces))
    return Changes((edit,), tuple(said))


# ------------------------------------------------------------------------------------------------- details


def _number(name: str) -> int:
    """The number at the end of a name; 1 without."""
    match = re.search(r"_([0-9]+)$", name)
    return int(match[1]) if match else 1


def _check_stays(context: Context, name: str, joint: Joint, shift_m: Float64Array) -> None:
    """Refuse a row on a wall that goes past the wall's end."""
    parent = context.map.links.get(joint.parent)
    if parent is None or parent.class_name != "wall":
        return
    wall: Wall = wall_named(context, joint.parent)
    corners = np.concatenate([part.corners for part in context.parts_by_link.get(name, ())] or [np.empty((0, 3))])
    along = (corners - wall.T_map_wall[:3, 3]) @ wall.T_map_wall[:3, 0]
    if not len(along):
        return
    low, high = float(along.min() + min(shift_m[0], 0)), float(along.max() + max(shift_m[0], 0))
    if low < wall.bounds[0] - _PAST_M or high > wall.bounds[2] + _PAST_M:
        message = (
            f"the row would reach from {number_text(low)} to {number_text(high)} m, wall '{joint.parent}' goes from "
            f"{number_text(wall.bounds[0])} to {number_text(wall.bounds[2])} m"
        )
        raise refuse(context, message, "fewer, a smaller --pitch, or the other way: a negative one")


def _copied_link(element: Element, old: str, new: str) -> bytes:
    edits = []
    for inner in element.iter():
        attribute = inner.attribute("name") if inner.tag in ("link", "collision", "visual") else None
        if attribute is None:
            continue
        name = attribute.value
        is_own = name.startswith(f"{old}.")
        becomes = new if inner is element else f"{new}.{name[len(old) + 1 :]}" if is_own else f"{new}.{name}"
        edits.append(attribute.replaced_by(becomes))
    return sliced(element, edits)
