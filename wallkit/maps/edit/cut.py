"""Cut and fill: an opening and the boxes around it. Both touch only the boxes that border on the hole.

A box with a hole in it becomes up to four: left and right of it at full height, sill and head between them. Filling joins
those that make a rectangle with the hole, so that after cut and fill the file is what it was.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

import numpy as np

from wallkit.maps.document import Edit
from wallkit.maps.draft.draft import SLIVER_M, DraftOpening
from wallkit.maps.draft.xml import box_line, letters, number_text, opening_line
from wallkit.maps.edit.changes import (
    Changes,
    indent_of,
    inserted_behind,
    inserted_first,
    newline_of,
    removed,
    renumbered,
    set_origin,
    sliced,
    with_attribute,
)
from wallkit.maps.edit.lookup import Rectangle, Wall, free_name, opening_named, refuse, wall_named
from wallkit.maps.edit.place import fills_of
from wallkit.maps.edit.tree import links_removed
from wallkit.maps.geometry import Part
from wallkit.maps.nouns import Opening
from wallkit.maps.rules.base import Context


def cut(context: Context, wall: str, opening: DraftOpening, *, fill: str | None = None) -> Changes:
    """A new opening: declared in the wall, and its boxes cut. `fill` is what the declaration names; it is not made here.

    Raises:
        MapError: no such wall, or the opening lies outside it, is empty or overlaps another one.
    """
    side = wall_named(context, wall)
    check_fits(context, side, opening)
    line = opening_line(opening, fill)
    link = side.link
    if link.openings:
        edits = inserted_behind(link.openings[-1].element, [line])
    elif link.semantics is not None:
        edits = inserted_behind(link.semantics, [line])
    else:
        edits = inserted_first(link.element, [line])
    (x0, x1), (z0, z1) = opening.along, opening.z
    said = f"opening {opening.id}: added, {opening.kind} in {wall}, {_stretch((x0, z0, x1, z1))}"
    return Changes(edits, (said,)) + hole_cut(context, side, opening.id, (x0, z0, x1, z1))


def cut_declared(context: Context, opening: str, wall: str = "", *, quiet: bool = False) -> Changes:
    """The boxes of a wall cut where an opening is declared already (WK-O001); `quiet` says nothing of it."""
    link, found = opening_named(context, opening, wall)
    changes = hole_cut(context, wall_named(context, link.name), opening, _rectangle(found))
    if not changes.edits and not quiet:
        return Changes(said=(f"opening {opening}: is cut in {link.name} already",))
    return Changes(changes.edits) if quiet else changes


def fill(context: Context, opening: str, wall: str = "", *, recursive: bool = False) -> Changes:
    """An opening closed: its declaration taken out and the boxes around it joined over the hole.

    Raises:
        MapError: no such opening, or something fills it (without `recursive`, which removes that too).
    """
    link, found = opening_named(context, opening, wall)
    side = wall_named(context, link.name)
    fills = fills_of(context, link.name, found)
    if fills and not recursive:
        message = f"'{fills[0]}' fills opening '{opening}'"
        raise refuse(context, message, "add --recursive to remove it too")
    gone = dict.fromkeys(name for fill in fills for name in context.map.subtree(fill))
    changes = links_removed(context, list(gone)) if gone else Changes()
    said = f"opening {opening}: removed from {link.name}, {_stretch(_rectangle(found))}"
    changes += Changes((removed(found.element),), (said,))
    return changes + hole_closed(context, side, opening, _rectangle(found))


def close_only(context: Context, opening: str, wall: str = "") -> Changes:
    """The boxes joined over an opening that stays declared: the first step of moving it."""
    link, found = opening_named(context, opening, wall)
    return Changes(hole_closed(context, wall_named(context, link.name), opening, _rectangle(found)).edits)


def check_fits(context: Context, wall: Wall, opening: DraftOpening) -> None:
    """Refuse an opening that is empty, outside its wall, or where another one is.

    Raises:
        MapError: likewise, with the numbers.
    """
    (x0, x1), (z0, z1) = opening.along, opening.z
    left, low, right, high = wall.bounds
    left, low = min(left, 0.0), min(low, 0.0)
    name, here = wall.link.name, _stretch((x0, z0, x1, z1))
    if not (x1 - x0 >= SLIVER_M and z1 - z0 >= SLIVER_M):
        raise refuse(context, f"the opening is empty: {here}", "its width and height must be above 0")
    if x0 < left - SLIVER_M or x1 > right + SLIVER_M or z0 < low - SLIVER_M or z1 > high + SLIVER_M:
        message = f"the opening, {here}, leaves wall '{name}', {_stretch((left, low, right, high))}"
        raise refuse(context, message, "along is from the wall's start, z from its floor")
    for other in wall.link.openings:
        (a0, a1), (b0, b1) = other.along_m, other.z_m
        if min(x1, a1) - max(x0, a0) > SLIVER_M and min(z1, b1) - max(z0, b0) > SLIVER_M:
            message = f"the opening, {here}, overlaps opening '{other.id}', {_stretch((a0, b0, a1, b1))}"
            raise refuse(context, message, "choose another place")
    _check_leaves_its_frame(context, wall, (x0, z0, x1, z1))
    taken = [o.id for link in context.map.links.values() for o in link.openings]
    if opening.id in taken:
        raise refuse(
            context, f"there is an opening '{opening.id}' already", f"for example {free_name(taken, opening.id)}"
        )


def hole_cut(context: Context, wall: Wall, opening: str, hole: Rectangle) -> Changes:
    """Edits that take a hole out of the boxes that stand in it."""
    x0, z0, x1, z1 = hole
    taken = {shape.name for link in context.map.links.values() for shape in link.shapes}
    changes = Changes()
    for part, (left, low, right, high) in wall.boxes:
        if min(right, x1) - max(left, x0) <= SLIVER_M or min(high, z1) - max(low, z0) <= SLIVER_M:
            continue
        a, b = max(left, x0), min(right, x1)
        pieces = [
            ("", (left, low, x0, high)),
            ("run", (x1, low, right, high)),
            ("sill", (a, low, b, z0)),
            ("head", (a, z1, b, high)),
        ]
        pieces = [(kind, r) for kind, r in pieces if r[2] - r[0] >= SLIVER_M and r[3] - r[1] >= SLIVER_M]
        changes += _replaced(context, wall, part, pieces, opening, taken)
    return changes + Changes(said=visuals_stay(wall))


def hole_closed(context: Context, wall: Wall, opening: str, hole: Rectangle) -> Changes:
    """Edits that join the boxes around a hole over it, as far as they make a rectangle with it; else a box of its own."""
    x0, z0, x1, z1 = hole
    alike = [(part, r) for part, r in wall.boxes if _is_in_line(part, wall)]

    def touching(wanted: tuple[float | None, ...]) -> tuple[Part, Rectangle] | None:
        return next(
            (
                (part, r)
                for part, r in alike
                if all(w is None or abs(w - value) < SLIVER_M for w, value in zip(wanted, r, strict=True))
            ),
            None,
        )

    sill, head = touching((x0, None, x1, z0)), touching((x0, z1, x1, None))
    low, high = (sill[1][1] if sill else z0), (head[1][3] if head else z1)
    left, right = touching((None, low, x0, high)), touching((x1, low, None, high))
    whole = (left[1][0] if left else x0, low, right[1][2] if right else x1, high)
    around = [found for found in (left, right, sill, head) if found is not None]
    name = f"{wall.link.name}.{opening}_fill"
    if not around:
        size = (x1 - x0, wall.thickness_m, z1 - z0)
        line = box_line(name, ((x0 + x1) / 2, 0.0, (z0 + z1) / 2), size)
        edits = inserted_behind(wall.boxes[-1][0].shape.element, [line])
        return Changes(edits, (f"{name}: added, {_stretch(hole)}",))
    kept, old = around[0]
    edits = box_edits(kept, whole)
    if left is None and right is None:
        edits += (with_attribute(kept.shape.element, "name", name),)
    edits += tuple(removed(part.shape.element) for part, _ in around[1:])
    said = [f"{kept.name}: {_stretch(old)} -> {_stretch(whole)}"]
    said += [f"{part.name}: removed, {_stretch(r)}" for part, r in around[1:]]
    return Changes(edits, (*said, *visuals_stay(wall)))


def visuals_stay(wall: Wall) -> tuple[str, ...]:
    """A word on what only other programs draw: a map has one truth, its collisions."""
    count = sum(child.tag == "visual" for child in wall.link.element.children)
    return (f"{wall.link.name}: its {count} <visual> stay{'s' * (count == 1)} as before",) if count else ()


def box_edits(part: Part, to: Rectangle) -> tuple[Edit, ...]:
    """Edits that give a wall's box other bounds (x0, z0, x1, z1) in the wall's frame."""
    x0, z0, x1, z1 = to
    T, size = part.shape.T_link_shape, part.shape.size.copy()
    along, up = (int(np.argmax(np.abs(T[row, :3]))) for row in (0, 2))
    size[along], size[up] = x1 - x0, z1 - z0
    attribute = part.shape.geometry.attribute("size")
    centre = np.array([(x0 + x1) / 2, T[1, 3], (z0 + z1) / 2])
    sized = renumbered(attribute, size) if attribute is not None else ()
    return (*set_origin(part.shape.element, centre), *sized)


# ------------------------------------------------------------------------------------------------- details


def _check_leaves_its_frame(context: Context, wall: Wall, hole: Rectangle) -> None:
    """Refuse a hole that takes the end or the whole top of a wall away: that is a smaller wall, and no opening."""
    import shapely

    left = shapely.union_all([shapely.box(*r) for _, r in wall.boxes]).difference(shapely.box(*hole))
    bounds = left.bounds if not left.is_empty else (0.0,) * 4
    ends = (min(bounds[0], 0.0) - hole[0], min(bounds[1], 0.0) - hole[1], hole[2] - bounds[2], hole[3] - bounds[3])
    if max(ends) > SLIVER_M:
        message = f"the opening, {_stretch(hole)}, would take the end of wall '{wall.link.name}' away"
        raise refuse(context, message, "leave a piece of wall beside or above it, or make the wall smaller")


def _replaced(
    context: Context,
    wall: Wall,
    part: Part,
    pieces: list[tuple[str, Rectangle]],
    opening: str,
    taken: set[str],
) -> Changes:
    """Edits that put pieces in the place of a box: the first takes its element over, copies of it make the others."""
    element = part.shape.element
    before = _bounds_of(wall, part)
    if not pieces:
        return Changes((removed(element),), (f"{part.name}: removed, {_stretch(before)}",))
    edits: tuple[Edit, ...] = ()
    said, copies = [], []
    for number, (kind, rectangle) in enumerate(pieces):
        name = part.shape.name
        is_renamed = bool(name) and kind != "" and (number > 0 or kind in ("sill", "head"))
        if is_renamed:
            name = _run_name(name, taken) if kind == "run" else free_name(taken, f"{wall.link.name}.{opening}_{kind}")
            taken.add(name)
        own = box_edits(part, rectangle)
        attribute = element.attribute("name")
        if is_renamed and attribute is not None:
            own += (attribute.replaced_by(name),)
        shown = name or part.name
        if number == 0:
            edits += own
            said.append(f"{part.name}: {_stretch(before)} -> {_stretch(rectangle)}" + f", now {name}" * is_renamed)
        else:
            copies.append(sliced(element, own))
            said.append(f"{shown}: added, {_stretch(rectangle)}")
    between = (newline_of(context.document) + indent_of(element)).encode(context.document.encoding)
    if copies:
        edits += (Edit(element.span.end, 0, b"".join(between + copy for copy in copies)),)
    return Changes(edits, tuple(said))


def _run_name(name: str, taken: Iterable[str]) -> str:
    """wall.run_b beside wall.run or wall.run_a."""
    stem = re.sub(r"_[a-z]$", "", name)
    used = set(taken)
    return next(found for k in range(1, len(used) + 3) if (found := f"{stem}_{letters(k)}") not in used)


def _bounds_of(wall: Wall, part: Part) -> Rectangle:
    return next(rectangle for other, rectangle in wall.boxes if other is part)


def _is_in_line(part: Part, wall: Wall) -> bool:
    """Whether a box has the wall's thickness and stands in its centre plane."""
    T = part.shape.T_link_shape
    thickness_m = float(np.abs(T[1, :3]) @ part.shape.size)
    return abs(thickness_m - wall.thickness_m) < SLIVER_M and abs(float(T[1, 3])) < SLIVER_M


def _rectangle(opening: Opening) -> Rectangle:
    (x0, x1), (z0, z1) = opening.along_m, opening.z_m
    return x0, z0, x1, z1


def _stretch(rectangle: Rectangle) -> str:
    x0, z0, x1, z1 = (number_text(value) for value in rectangle)
    return f"{x0} to {x1} m along, {z0} to {z1} m up"
