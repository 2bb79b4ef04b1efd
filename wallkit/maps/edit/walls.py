"""Split and join: one wall as two that follow each other, and two as one, with all that stands in and hangs on them."""

from __future__ import annotations

import math

from wallkit.core.geometry import invert_matrix
from wallkit.core.types import Float64Array
from wallkit.maps.document import Edit
from wallkit.maps.draft.draft import SLIVER_M
from wallkit.maps.draft.xml import attributes, number_text
from wallkit.maps.edit.changes import (
    Changes,
    indent_of,
    newline_of,
    prefix_of,
    removed,
    renumbered,
    set_origin,
    sliced,
)
from wallkit.maps.edit.cut import box_edits, visuals_stay
from wallkit.maps.edit.lookup import Wall, check_new, free_name, joint_above, refuse, wall_named
from wallkit.maps.edit.place import copied_joint
from wallkit.maps.geometry import Part
from wallkit.maps.nouns import Joint
from wallkit.maps.rules.base import Context

_PARALLEL_RAD = 1e-4


def split(context: Context, name: str, at_m: float, new: str = "") -> Changes:
    """A wall that ends at a place along it, and another that goes on from there: openings and fixtures go where they stand.

    Raises:
        MapError: no such wall, the place is not inside it or lies in an opening, not all of it are boxes on its axis, or the
            new name is taken.
    """
    wall, joint = wall_named(context, name), joint_above(context, name)
    left, _, right, _ = wall.bounds
    if not left + SLIVER_M < at_m < right - SLIVER_M:
        message = f"{number_text(at_m)} m is not inside wall '{name}', {number_text(left)} to {number_text(right)} m"
        raise refuse(context, message, "--at is from the wall's start")
    for opening in wall.link.openings:
        if opening.along_m[0] + SLIVER_M < at_m < opening.along_m[1] - SLIVER_M:
            message = (
                f"{number_text(at_m)} m lies in opening '{opening.id}', {number_text(opening.along_m[0])} to "
                f"{number_text(opening.along_m[1])} m"
            )
            raise refuse(context, message, "split it beside the opening")
    _check_boxes(context, wall)
    taken = {*context.map.links, *context.map.joints}
    new = new or free_name(taken, f"{name}_b")
    joint_name = free_name(taken, f"at_{new}")
    check_new(context, new, joint_name)

    edits: tuple[Edit, ...] = ()
    pieces: list[bytes] = []
    moved = [o for o in wall.link.openings if o.along_m[0] >= at_m - SLIVER_M]
    for opening in moved:
        attribute = opening.element.attribute("along")
        shifted = renumbered(attribute, [x - at_m for x in opening.along_m]) if attribute is not None else ()
        pieces.append(sliced(opening.element, shifted))
        edits += (removed(opening.element),)
    for part, (x0, z0, x1, z1) in wall.boxes:
        if x1 <= at_m + SLIVER_M:
            continue
        element = part.shape.element
        own = box_edits(part, (max(x0, at_m) - at_m, z0, x1 - at_m, z1)) + _part_renamed(part, name, new)
        pieces.append(sliced(element, own))
        edits += (removed(element),) if x0 >= at_m - SLIVER_M else box_edits(part, (x0, z0, at_m, z1))
    fills = {opening.fill for opening in moved}
    stays = {opening.fill for opening in wall.link.openings} - fills
    goes = [
        child
        for child in context.map.children_of(name)
        if child.child in fills
        or _follows(context, child, fills)
        or (child.child not in stays and not _follows(context, child, stays) and child.T_parent_child[0, 3] >= at_m)
    ]
    for child in goes:
        edits += _hung_on(child, new, child.T_parent_child[:3, 3] - [at_m, 0.0, 0.0])
    T_parent_new = joint.T_parent_child.copy()
    T_parent_new[:3, 3] += at_m * T_parent_new[:3, 0]
    link = _link_around(context, wall, new, pieces)
    placed = copied_joint(joint, joint_name, new, T_parent_new)
    last = max(wall.link.element, joint.element, key=lambda element: element.offset)
    between = (newline_of(context.document) + indent_of(last)).encode(context.document.encoding)
    edits += (Edit(last.span.end, 0, between + link + between + placed),)
    said = [
        f"{name}: {number_text(left)} to {number_text(right)} m -> {number_text(left)} to {number_text(at_m)} m",
        f"{new}: added, goes on for {number_text(right - at_m)} m",
    ]
    said += [f"opening {opening.id}: {name} -> {new}" for opening in moved]
    said += [f"{child.child}: hangs on {name} -> {new}" for child in goes]
    return Changes(edits, (*said, *visuals_stay(wall)))


def join(context: Context, first: str, second: str) -> Changes:
    """Two walls in line as one of the first one's name; all of the second goes to it.

    Raises:
        MapError: they are not in line, do not touch, differ in thickness or class, or the second lies before the first.
    """
    a, b = wall_named(context, first), wall_named(context, second)
    joint_a, joint_b = joint_above(context, first), joint_above(context, second)
    T_a_b = invert_matrix(a.T_map_wall) @ b.T_map_wall
    turn_rad = math.atan2(T_a_b[1, 0], T_a_b[0, 0])
    if first == second:
        raise refuse(context, f"'{first}' cannot be joined with itself", "name two walls")
    if abs(turn_rad) > _PARALLEL_RAD:
        hint = (
            "turn it round first: its start must be the end of the other"
            if abs(turn_rad) > 3.1
            else "`wallkit map snap`"
        )
        raise refuse(context, f"'{second}' runs {math.degrees(turn_rad):.4g} deg off '{first}'", hint)
    shift_m = T_a_b[:3, 3]
    gap_m = shift_m[0] + b.bounds[0] - a.bounds[2]
    for what, off_m in (("beside the line of", shift_m[1]), ("above", shift_m[2])):
        if abs(off_m) > SLIVER_M:
            raise refuse(context, f"'{second}' lies {number_text(off_m)} m {what} '{first}'", "move it first")
    if abs(gap_m) > SLIVER_M:
        message = f"'{second}' begins {number_text(gap_m)} m behind the end of '{first}'"
        hint = f"join {second} {first}" if gap_m < -a.bounds[2] else "close the gap first (`wallkit map snap`)"
        raise refuse(context, message, hint)
    if abs(a.thickness_m - b.thickness_m) > SLIVER_M or a.link.class_name != b.link.class_name:
        message = (
            f"'{first}' is {a.link.class_name}, {number_text(a.thickness_m)} m thick, '{second}' {b.link.class_name}, "
            f"{number_text(b.thickness_m)} m"
        )
        raise refuse(context, message, "only alike walls are joined")
    _check_boxes(context, b)
    if second in context.map.subtree(first) or joint_a.parent == second:
        raise refuse(context, f"'{first}' and '{second}' hang on each other", "`wallkit map reparent` one of them")

    edits: tuple[Edit, ...] = ()
    pieces: list[bytes] = []
    said: list[str] = []
    taken = {shape.name for link in context.map.links.values() for shape in link.shapes}
    for opening in b.link.openings:
        attribute = opening.element.attribute("along")
        shifted = renumbered(attribute, [x + shift_m[0] for x in opening.along_m]) if attribute is not None else ()
        pieces.append(sliced(opening.element, shifted))
        said.append(f"opening {opening.id}: {second} -> {first}")
    for part, (x0, z0, x1, z1) in b.boxes:
        x0, x1 = x0 + float(shift_m[0]), x1 + float(shift_m[0])
        mate = next((m for m in a.boxes if _abut(m, (x0, z0, x1, z1), a.bounds[2])), None)
        if mate is not None:
            edits += box_edits(mate[0], (mate[1][0], z0, x1, z1))
            continue
        own = box_edits(part, (x0, z0, x1, z1)) + _part_renamed(part, second, first, taken)
        pieces.append(sliced(part.shape.element, own))
    if pieces:
        element = a.boxes[-1][0].shape.element
        between = (newline_of(context.document) + indent_of(element)).encode(context.document.encoding)
        edits += (Edit(element.span.end, 0, b"".join(between + piece for piece in pieces)),)
    for child in context.map.children_of(second):
        edits += _hung_on(child, first, child.T_parent_child[:3, 3] + shift_m)
        said.append(f"{child.child}: hangs on {second} -> {first}")
    edits += (removed(b.link.element), removed(joint_b.element))
    end_m = b.bounds[2] + float(shift_m[0])
    left = number_text(a.bounds[0])
    first_line = f"{first}: {left} to {number_text(a.bounds[2])} m -> {left} to {number_text(end_m)} m"
    return Changes(edits, (first_line, f"{second}: removed", *said, *visuals_stay(a)))


# ------------------------------------------------------------------------------------------------- details


def _check_boxes(context: Context, wall: Wall) -> None:
    on_axis = {id(part.shape) for part, _ in wall.boxes}
    others = [shape for shape in wall.link.shapes if id(shape) not in on_axis]
    if others:
        said = others[0].name or others[0].kind
        raise refuse(context, f"'{said}' of wall '{wall.link.name}' is no box on its axis", "split or join it by hand")


def _abut(mate: tuple[Part, tuple[float, float, float, float]], other: tuple[float, ...], end_m: float) -> bool:
    """Whether a box of the first wall ends where one of the second begins, at the same heights."""
    _, (_, z0, x1, z1) = mate
    wanted = (end_m, other[1], other[0], other[3])
    return all(abs(p - q) < SLIVER_M for p, q in zip((x1, z0, x1, z1), wanted, strict=True))


def _part_renamed(part: Part, old: str, new: str, taken: set[str] | None = None) -> tuple[Edit, ...]:
    """old.run_b as new.run_b, with a number where that is taken."""
    attribute = part.shape.element.attribute("name")
    if attribute is None:
        return ()
    name = part.shape.name
    wanted = f"{new}.{name[len(old) + 1 :]}" if name.startswith(f"{old}.") else f"{new}.{name}"
    free = wanted if taken is None else free_name(taken, wanted)
    if taken is not None:
        taken.add(free)
    return (attribute.replaced_by(free),)


def _follows(context: Context, joint: Joint, fills: set[str]) -> bool:
    """Whether it is the second leaf of a door."""
    leader = context.map.joints.get(joint.mimic.joint) if joint.mimic is not None else None
    return leader is not None and leader.child in fills


def _hung_on(joint: Joint, parent: str, xyz: Float64Array) -> tuple[Edit, ...]:
    element = joint.element.find("parent")
    attribute = element.attribute("link") if element is not None else None
    return (*((attribute.replaced_by(parent),) if attribute is not None else ()), *set_origin(joint.element, xyz))


def _link_around(context: Context, wall: Wall, name: str, pieces: list[bytes]) -> bytes:
    """A link like the wall's, with what the wall says of itself, around pieces of XML."""
    document = context.document
    semantics = wall.link.semantics
    if semantics is not None:
        said = document.data[semantics.span.offset : semantics.span.end]
    else:
        known = attributes(**{"class": wall.link.class_name})
        said = f"<{prefix_of(document)}:object{known}/>".encode() if prefix_of(document) else b""
    inner = indent_of(wall.boxes[0][0].shape.element)
    between = (newline_of(document) + inner).encode(document.encoding)
    head = f"<link{attributes(name=name)}>".encode(document.encoding)
    return head + said + b"".join(between + piece for piece in pieces) + b"</link>"
