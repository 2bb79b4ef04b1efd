"""Origin: the map's frame somewhere else, and where it lies on Earth; everything keeps its place in the world."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from wallkit.core.geometry import invert, matrix_from_pose, transform_points
from wallkit.maps.document import Edit
from wallkit.maps.draft.xml import attributes, number_text, numbers_text
from wallkit.maps.edit.changes import Changes, inserted_first, renumbered, with_attribute
from wallkit.maps.edit.lookup import refuse
from wallkit.maps.edit.place import origin_edits
from wallkit.maps.rules.base import Context

_TURN_RAD = 1e-9
# of a survey, millimetres
_SURVEY_DECIMALS = 3


@dataclass(frozen=True, slots=True)
class Survey:
    """Where frame map lies on Earth: what is known of it."""

    kind: str | None = None
    epsg: int | None = None
    east_m: float | None = None
    north_m: float | None = None
    yaw_rad: float | None = None


def reorigin(context: Context, to: tuple[float, float, float] | None = None) -> Changes:
    """Frame map moved to a pose (x, y, yaw) of the old one; every element, room and survey is written in the new frame.

    Args:
        to: by default the corner of the data, in whole metres.

    Raises:
        MapError: nothing in the map has a place.
    """
    pose = _corner(context) if to is None else to
    if not any(pose):
        return Changes(said=("the origin stays where it is",))
    if not all(map(math.isfinite, pose)):
        raise refuse(context, f"({numbers_text(pose)}) is no place", "--to X,Y or X,Y,YAW")
    T_new_old = matrix_from_pose(invert(pose))
    edits: tuple[Edit, ...] = ()
    children = context.map.children_of(context.map.root or "")
    for joint in children:
        edits += origin_edits(joint, T_new_old @ joint.T_parent_child)
    rooms = [room for room in context.map.all_rooms if room.floor is not None]
    for room in rooms:
        attribute = room.element.attribute("floor")
        if attribute is not None:
            edits += renumbered(attribute, transform_points(invert(pose), room.floor).ravel())  # type: ignore[arg-type]  # not None
    turn = f", turned by {number_text(pose[2])} rad" if abs(pose[2]) > _TURN_RAD else ""
    said = f"origin: now at ({number_text(pose[0])}, {number_text(pose[1])}) of the old frame{turn}"
    counts = f"{len(children)} elements on '{context.map.root}' and {len(rooms)} rooms written anew"
    changes = Changes(edits, (said, counts))
    return changes + _survey_moved(context, pose)


def survey(context: Context, given: Survey) -> Changes:
    """What <wk:origin> says, with what is given in it; nothing in the map moves.

    Raises:
        MapError: there is no header, or coordinates come without the system they are in.
    """
    header = context.map.header.element
    if header is None:
        raise refuse(context, "there is no <wk:map> header", f"write it: wallkit map adopt {context.document.source}")
    old = context.map.header.survey
    epsg = given.epsg if given.epsg is not None else old.epsg if old is not None else None
    if given.east_m is not None and epsg is None:
        raise refuse(context, "coordinates without a system", "--epsg 32654, say: the number of the projected system")
    words = {
        "kind": given.kind or ("surveyed" if old is None or old.kind == "none" else None),
        "epsg": None if given.epsg is None else str(given.epsg),
        "east": _metres(given.east_m),
        "north": _metres(given.north_m),
        "yaw": None if given.yaw_rad is None else f"{given.yaw_rad:.9g}",
    }
    said = []
    for key, value in words.items():
        before = old.element.get(key) if old is not None else None
        if value is not None and value != before:
            said.append(f"survey: {key} {before or 'nothing'} -> {value}")
    if old is None:
        return Changes(inserted_first(header, [f"    <wk:origin{attributes(**words)}/>"]), tuple(said))
    edits = [with_attribute(old.element, key, value) for key, value in words.items() if value is not None]
    return Changes(_merged(edits), tuple(said))


# ------------------------------------------------------------------------------------------------- details


def _corner(context: Context) -> tuple[float, float, float]:
    if not context.parts:
        raise refuse(context, "nothing in the map has a place", "say where: --to X,Y")
    x, y = np.floor(np.min([part.corners.min(axis=0)[:2] for part in context.parts], axis=0)).tolist()
    return float(x), float(y), 0.0


def _survey_moved(context: Context, pose: tuple[float, float, float]) -> Changes:
    """<wk:origin> for the new frame; where there was none and the frame jumps far, a new one keeps the old coordinates."""
    old, header = context.map.header.survey, context.map.header.element
    if header is None:
        return Changes(said=("no header keeps the old coordinates",))
    if old is None or old.east_m is None or old.north_m is None:
        if math.hypot(*pose[:2]) < context.tolerances.far_m or old is not None:
            return Changes()
        words = {"kind": "surveyed", "east": _metres(pose[0]), "north": _metres(pose[1]), "yaw": number_text(pose[2])}
        said = (
            f"survey: east {words['east']}, north {words['north']}: the old coordinates; add their system with --epsg"
        )
        return Changes(inserted_first(header, [f"    <wk:origin{attributes(**words)}/>"]), (said,))
    yaw = old.yaw_rad or 0.0
    east = old.east_m + math.cos(yaw) * pose[0] - math.sin(yaw) * pose[1]
    north = old.north_m + math.sin(yaw) * pose[0] + math.cos(yaw) * pose[1]
    edits: tuple[Edit, ...] = ()
    said_words = []
    new_yaw = math.remainder(yaw + pose[2], 2 * math.pi)
    for key, value, before, decimals in (
        ("east", east, old.east_m, _SURVEY_DECIMALS),
        ("north", north, old.north_m, _SURVEY_DECIMALS),
        ("yaw", new_yaw, yaw, 7),
    ):
        attribute = old.element.attribute(key)
        if attribute is not None:
            edits += renumbered(attribute, [value], decimals=decimals)
        elif abs(value) > _TURN_RAD:
            edits += (with_attribute(old.element, key, number_text(value)),)
        if abs(value - before) > 1e-9:
            said_words.append(f"{key} {before:.{decimals}f} -> {value:.{decimals}f}")
    return Changes(edits, (f"survey: {', '.join(said_words)}",) if said_words else ())


def _metres(value: float | None) -> str | None:
    return None if value is None else f"{value:.{_SURVEY_DECIMALS}f}".rstrip("0").rstrip(".")


def _merged(edits: list[Edit]) -> tuple[Edit, ...]:
    """Insertions at one place as one, in the order given; other edits as they are."""
    at: dict[int, Edit] = {}
    kept = []
    for edit in edits:
        if edit.length == 0:
            before = at.get(edit.offset, Edit(edit.offset, 0, b""))
            at[edit.offset] = Edit(edit.offset, 0, before.text + edit.text)
        else:
            kept.append(edit)
    return (*kept, *at.values())
