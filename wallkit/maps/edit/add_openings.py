"""Add doors and windows: an opening cut into a wall, and the leaves or the pane that fill it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

from wallkit.maps.document import Edit
from wallkit.maps.draft.doors import CLEARANCE_M, DoorMotion, DraftDoor, Leaf, leaves_of
from wallkit.maps.draft.draft import DraftOpening, DraftPane
from wallkit.maps.draft.xml import door_lines, number_text, pane_lines
from wallkit.maps.edit.add import rooms_beside, side_named
from wallkit.maps.edit.changes import Changes, appended, with_attribute
from wallkit.maps.edit.cut import check_fits, cut
from wallkit.maps.edit.lookup import (
    Wall,
    check_new,
    class_named,
    numbered,
    opening_named,
    refuse,
    room_named,
    wall_named,
)
from wallkit.maps.rules.base import Context
from wallkit.maps.rules.rooms import OUTSIDE

# what ids of openings begin with, by kind
STEMS = {"door": "d", "window": "win", "passage": "p"}


@dataclass(frozen=True, slots=True)
class Place:
    """Where an opening is, or shall be cut [m].

    Attributes:
        along_m: (from, to) from the wall's start. z_m: (from, to) from its floor.
        opening: id of one that is declared already; then along_m and z_m are its own.
    """

    wall: str
    along_m: tuple[float, float] = (0.0, 0.0)
    z_m: tuple[float, float] = (0.0, 0.0)
    opening: str = ""


@dataclass(frozen=True, slots=True)
class DoorWords:
    """What is said about a new door.

    Attributes:
        name: by default door_1, door_2 ...
        swing: the side it opens to or runs on: in (left of the wall), out (right), or the room there.
        hinge: left (towards the wall's start) or right, as seen from outside looking in.
        connects: ids of two rooms; by default those on its two sides, where the map has them.
    """

    name: str = ""
    motion: DoorMotion = "hinged"
    swing: str = "in"
    hinge: Literal["left", "right"] = "left"
    connects: tuple[str, ...] = ()


def add_door(context: Context, place: Place, words: DoorWords) -> Changes:
    """A door in a new opening, or in one that is there and empty.

    Raises:
        MapError: the opening does not fit, is taken, or is too narrow for a leaf; a name is taken; a room does not exist.
    """
    wall = wall_named(context, place.wall)
    opening, is_new = _opening(context, wall, place, "door")
    width_m = opening.along[1] - opening.along[0]
    leaves = 2 if words.motion.startswith("double") else 1
    if width_m <= leaves * 3 * CLEARANCE_M or opening.z[1] - opening.z[0] <= 3 * CLEARANCE_M:
        raise refuse(
            context,
            f"an opening of {number_text(width_m)} m has no room for {leaves} leaf{'s' * (leaves - 1)}",
            f"each wants more than {3 * CLEARANCE_M:g} m",
        )
    middle_m = sum(opening.along) / 2
    side = side_named(context, wall, middle_m, words.swing)
    connects = words.connects or _connects(context, wall, middle_m)
    for room in connects:
        if room != OUTSIDE:
            room_named(context, room)
    if connects and (len(connects) != 2 or connects[0] == connects[1]):
        raise refuse(
            context, f"a door connects two rooms, not {' '.join(connects)}", f'out of the building is "{OUTSIDE}"'
        )
    name = words.name or numbered({*context.map.links, *context.map.joints}, "door")
    hinge: Literal["start", "end"] = "start" if words.hinge == "left" else "end"
    pair = (connects[0], connects[1]) if connects else None
    door = DraftDoor(name, words.motion, hinge, side, connects=pair)
    made = leaves_of(door, opening.along, opening.z, wall.thickness_m)
    check_new(context, *(text for leaf in made for text in (leaf.link, leaf.joint)))
    _check_runs(context, wall, made)
    lines = [line for leaf in made for line in door_lines(door, leaf, place.wall)]
    how = f"hinge {words.hinge}" if words.motion == "hinged" else words.motion.replace("_", " ")
    room = rooms_beside(context, wall, middle_m)[side]
    said = f"{name}: added, door in {opening.id} of {place.wall}, {how}, opens to the {side}" + f" ({room})" * bool(
        room
    )
    said += f", connects {' and '.join(connects)}" if connects else ""
    return _filled(context, wall, opening, made[0].link, lines, said, is_new=is_new)


def add_window(context: Context, place: Place, *, name: str = "", class_name: str = "glass") -> Changes:
    """A window with its pane, in a new opening or in one that is there and empty.

    Raises:
        MapError: the opening does not fit or is taken, a name is taken, or the class is unknown.
    """
    wall = wall_named(context, place.wall)
    opening, is_new = _opening(context, wall, place, "window")
    class_named(context, class_name)
    name = name or numbered({*context.map.links, *context.map.joints}, "window")
    check_new(context, name, f"at_{name}")
    pane = DraftPane(name, class_name)
    lines = list(pane_lines(opening, pane, place.wall))
    said = f"{name}: added, {class_name}, {number_text(pane.thickness_m)} m thick, in {opening.id} of {place.wall}"
    return _filled(context, wall, opening, name, lines, said, is_new=is_new)


def new_opening(
    context: Context, place: Place, kind: Literal["door", "window", "passage"], name: str = ""
) -> DraftOpening:
    """The opening to be cut at a place, with an id of its own."""
    taken = [o.id for link in context.map.links.values() for o in link.openings]
    return DraftOpening(name or numbered_id(taken, kind), kind, place.along_m, place.z_m)


def numbered_id(taken: Sequence[str], kind: str) -> str:
    """d1, d2 ...; win1 ...; p1 ...: the first that is not taken."""
    return next(found for k in range(1, len(taken) + 2) if (found := f"{STEMS[kind]}{k}") not in taken)


# ------------------------------------------------------------------------------------------------- details


def _opening(context: Context, wall: Wall, place: Place, kind: Literal["door", "window"]) -> tuple[DraftOpening, bool]:
    """The opening meant, and whether it is still to be made."""
    if not place.opening or not any(o.id == place.opening for o in wall.link.openings):
        made = new_opening(context, place, kind, place.opening)
        if place.opening and place.along_m == (0.0, 0.0):
            opening_named(context, place.opening, place.wall)
        check_fits(context, wall, made)
        return made, True
    _, found = opening_named(context, place.opening, place.wall)
    if found.fill:
        raise refuse(context, f"opening '{found.id}' is filled by '{found.fill}'", "remove that first")
    width_m, own_m = place.along_m[1] - place.along_m[0], found.along_m[1] - found.along_m[0]
    if width_m > 0:
        message = f"opening '{found.id}' is {number_text(own_m)} m wide; {number_text(width_m)} m was asked for"
        raise refuse(context, message, "leave out --at and --width: the leaf fits its opening")
    return DraftOpening(found.id, kind, found.along_m, found.z_m), False


def _filled(
    context: Context, wall: Wall, opening: DraftOpening, fill: str, lines: list[str], said: str, *, is_new: bool
) -> Changes:
    if is_new:
        changes = cut(context, wall.link.name, replace(opening, fill=None), fill=fill)
    else:
        element = next(o.element for o in wall.link.openings if o.id == opening.id)
        edits: tuple[Edit, ...] = (with_attribute(element, "fill", fill),)
        if element.get("kind") != opening.kind:
            edits += (with_attribute(element, "kind", opening.kind),)
        changes = Changes(edits, (f"opening {opening.id} of {wall.link.name}: filled by {fill}",))
    return changes + Changes(appended(context.root, lines), (said,))


def _connects(context: Context, wall: Wall, along_m: float) -> tuple[str, ...]:
    """The rooms before (right of) and behind (left of) a wall; one room and no other: that and the outside."""
    rooms = rooms_beside(context, wall, along_m)
    if not any(rooms.values()) or rooms["right"] == rooms["left"]:
        return ()
    return rooms["right"] or OUTSIDE, rooms["left"] or OUTSIDE


def _check_runs(context: Context, wall: Wall, leaves: Sequence[Leaf]) -> None:
    """Refuse a sliding leaf that would slide off the end of its wall."""
    for leaf in leaves:
        if leaf.joint_type != "prismatic":
            continue
        x = leaf.origin[0] + leaf.centre[0]
        ends = [x + way * leaf.axis[0] * leaf.upper + s * leaf.size[0] / 2 for way in (0, 1) for s in (-1, 1)]
        if min(ends) < wall.bounds[0] or max(ends) > wall.bounds[2]:
            message = (
                f"open, leaf '{leaf.link}' would reach from {number_text(min(ends))} to {number_text(max(ends))} m, wall "
                f"'{wall.link.name}' goes from {number_text(wall.bounds[0])} to {number_text(wall.bounds[2])} m"
            )
            raise refuse(context, message, "slide it the other way (--hinge), or hang it on hinges")
