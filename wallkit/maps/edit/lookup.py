"""Names that a user types -> what they name in the map, or an error with the closest name."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from wallkit.core.types import Float64Array
from wallkit.errors import MapError, closest
from wallkit.maps.classes import ClassInfo
from wallkit.maps.geometry import Part
from wallkit.maps.nouns import Joint, Link, Opening, Room
from wallkit.maps.rules.base import Context
from wallkit.maps.rules.elevation import elevations

_NAME = re.compile(r"[A-Za-z_][\w.-]*", re.ASCII)
# of more names only the closest is said
_LISTED = 20

Noun = TypeVar("Noun")
Rectangle = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Wall:
    """A wall seen from the side, in its own frame: x along the wall, z up [m].

    Attributes:
        boxes: its boxes on the x axis, each with (x0, z0, x1, z1). bounds: of all of them.
        thickness_m: of its largest box.
    """

    link: Link
    T_map_wall: Float64Array
    boxes: tuple[tuple[Part, Rectangle], ...]
    bounds: Rectangle
    thickness_m: float

    @property
    def pose(self) -> tuple[float, float, float]:
        """(x, y, yaw) of its frame in the map."""
        T = self.T_map_wall
        return float(T[0, 3]), float(T[1, 3]), float(np.arctan2(T[1, 0], T[0, 0]))


def refuse(context: Context, message: str, hint: str = "") -> MapError:
    """The error that says why an edit is not made."""
    return MapError(message, where=context.document.source, hint=hint)


def link_named(context: Context, name: str) -> Link:
    """A link.

    Raises:
        MapError: there is none, or several have the name.
    """
    link = _named(context, "element", name, context.map.links)
    if sum(other.name == name for other in context.map.all_links) > 1:
        raise refuse(context, f"'{name}' is the name of several elements", "wallkit map fix --fix moderate")
    return link


def joint_above(context: Context, name: str) -> Joint:
    """The joint that a link hangs on.

    Raises:
        MapError: there is no such link, or it hangs on nothing.
    """
    link_named(context, name)
    joint = context.map.parent_joint(name)
    if joint is None or joint.parent not in context.poses:
        raise refuse(context, f"'{name}' hangs on nothing, so it has no place of its own", "name an element of the map")
    return joint


def room_named(context: Context, name: str) -> Room:
    """A room."""
    return _named(context, "room", name, context.map.rooms)


def class_named(context: Context, name: str) -> ClassInfo:
    """A class of the map's class table, the taxonomy's included."""
    return _named(context, "class", name, context.map.classes)


def opening_named(context: Context, name: str, wall: str = "") -> tuple[Link, Opening]:
    """An opening with its wall; `wall` is needed where several walls have one of that id."""
    walls = [link_named(context, wall)] if wall else list(context.map.links.values())
    found = {f"{link.name}/{o.id}": (link, o) for link in walls for o in link.openings if o.id == name}
    if not found:
        known = {o.id: o for link in walls for o in link.openings}
        _named(context, "opening", name, known, f" in wall '{wall}'" if wall else "")
    if len(found) > 1:
        raise refuse(
            context, f"opening '{name}' is in several walls: {', '.join(sorted(found))}", "give each its own id"
        )
    return next(iter(found.values()))


def wall_named(context: Context, name: str) -> Wall:
    """A wall, or another link whose boxes stand on its x axis.

    Raises:
        MapError: there is none, or it is not made of upright boxes along its own x axis.
    """
    link = link_named(context, name)
    side = context.once(elevations).get(name)
    if side is None:
        if link.class_name != "wall":
            raise refuse(context, f"'{name}' is no wall but {link.class_name or 'without a class'}", "name a wall")
        raise refuse(context, f"wall '{name}' has no box along its x axis", "its axis is y = 0 of its own frame")
    T = context.poses[name]
    if abs(T[2, 2]) < 1 - 1e-6:
        raise refuse(context, f"wall '{name}' leans", "wallkit map validate --select E032")
    largest = max(side.boxes, key=lambda box: float(np.prod(box[0].shape.size)))[0]
    thickness_m = float(np.abs(largest.shape.T_link_shape[1, :3]) @ largest.shape.size)
    return Wall(link, T, side.boxes, side.bounds, thickness_m)


def check_new(context: Context, *names: str) -> None:
    """Refuse names for new elements that are taken or are none.

    Raises:
        MapError: likewise.
    """
    taken = {*context.map.links, *context.map.joints}
    for name in names:
        if not _NAME.fullmatch(name):
            raise refuse(context, f"'{name}' is no name", "a letter, then letters, digits, '_', '.' or '-'")
        if name in taken:
            raise refuse(context, f"the name '{name}' is taken", f"for example {free_name(taken, name)}")


def free_name(taken: Collection[str], wanted: str) -> str:
    """The first of wanted, wanted_2, wanted_3 (or wall_4 after wall_3) that is not taken."""
    if wanted not in taken:
        return wanted
    stem, number = re.fullmatch(r"(.*?)(?:_([0-9]+))?", wanted).groups()  # type: ignore[union-attr]  # matches anything
    k = int(number or 2)
    while f"{stem}_{k}" in taken or f"{stem}_{k}" == wanted:
        k += 1
    return f"{stem}_{k}"


def numbered(taken: Collection[str], stem: str) -> str:
    """The first of stem_1, stem_2 ... that is not taken."""
    return free_name(taken, f"{stem}_1")


def _named(context: Context, what: str, name: str, known: Mapping[str, Noun], where: str = "") -> Noun:
    if name in known:
        return known[name]
    hint = closest(name, known) if known else f"this map has no {what}"
    if len(known) > _LISTED:
        hint = f"{hint.partition(' (one of')[0]} " if hint.startswith("did you mean") else ""
        hint += f"`wallkit map ls {context.document.source}` lists them"
    raise refuse(context, f"there is no {what} '{name}'{where}", hint)
