"""Two maps -> what changed between them, in the words of the map: moved by how much, limits, rooms, classes, names.

Formatting, comments, order, names of collisions and visuals do not count: only what the map means does. What hangs on
something that moved is carried along, and not named.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields

import numpy as np

from wallkit.core.types import Float64Array
from wallkit.maps.classes import ClassInfo
from wallkit.maps.diff.changes import Change, Moved, number_change, value_change
from wallkit.maps.diff.links import Side, link_changes, renamed_links
from wallkit.maps.model import SemanticMap
from wallkit.maps.nouns import Room

# differences below this are rounding: metres, radians, and numbers without a unit
TOLERANCE = 1e-6


@dataclass(frozen=True, slots=True)
class _Rigid:
    """A motion of the whole map: T_b_a (4, 4) takes every point of the first map to where the second has it."""

    T: Float64Array


def compare_maps(a: SemanticMap, b: SemanticMap, *, tolerance: float = TOLERANCE) -> tuple[Change, ...]:
    """Everything that is different in b, in the order: the map itself, classes, rooms, links in the order of the files."""
    sides = Side.of(a), Side.of(b)
    together = _moved_together(*sides, tolerance)
    names = renamed_links(*sides, tolerance)
    found = [*_header_changes(a, b, tolerance), *_class_changes(a, b, tolerance)]
    if together is not None:
        moved = Moved.between(np.eye(4), together.T)
        found.append(Change("moved", "map", b.name, f"everything moved together: {moved.text}", detail=moved.detail))
    found += _room_changes(a, b, tolerance, together)
    kept_places = set() if together is None else {joint.child for joint in b.children_of(b.root or "")}
    for name, link in a.links.items():
        new = names.get(name, name)
        if new not in b.links:
            found.append(Change("removed", "link", name, f"{name} removed ({link.class_name or 'no class'})"))
            continue
        if new != name:
            found.append(Change("renamed", "link", name, f"{name} renamed to {new}", "name", name, new))
        changes = link_changes(*sides, name, new, names, tolerance)
        found += [change for change in changes if not (change.field == "pose" and new in kept_places)]
    for name in b.links:
        if name not in a.links and name not in names.values():
            found.append(Change("added", "link", name, _added_text(sides[1], name)))
    return tuple(found)


# -------------------------------------------------------------------------------------------- details


def _added_text(b: Side, name: str) -> str:
    """What appeared, and where."""
    class_name = b.map.links[name].class_name or "no class"
    T = b.pose(name)
    return f"{name} added ({class_name}" + ("" if T is None else f" at x {T[0, 3]:.3f}, y {T[1, 3]:.3f}") + ")"


def _moved_together(a: Side, b: Side, tolerance: float) -> _Rigid | None:
    """The one motion that took everything on the root from a to b; None where there is none, or nothing moved."""
    motions, far_m = [], 1.0
    for joint in a.map.children_of(a.map.root or ""):
        before, after = a.pose(joint.child), b.pose(joint.child)
        if joint.child not in b.map.links or before is None or after is None:
            continue
        if not np.all(np.isfinite([before, after])):
            return None
        motions.append(after @ np.linalg.inv(before))
        far_m = max(far_m, float(np.abs(before[:3, 3]).max()) + 1.0)
    if len(motions) < 2:
        return None
    is_one = np.abs(np.array(motions) - motions[0]).max() <= tolerance * far_m
    is_still = np.abs(motions[0] - np.eye(4)).max() <= tolerance
    return _Rigid(motions[0]) if is_one and not is_still else None


def _header_changes(a: SemanticMap, b: SemanticMap, tolerance: float) -> Iterator[Change]:
    yield from value_change("map", b.name, "name", a.name, b.name)
    for field in fields(a.header):
        before, after = getattr(a.header, field.name), getattr(b.header, field.name)
        if field.name in ("element", "survey"):
            continue
        unit = "m" if field.name.endswith("_m") else ""
        yield from _either(b.name, "map", field.name.removesuffix("_m"), (before, after), unit, tolerance)
    for field_name in ("kind", "epsg", "east_m", "north_m", "yaw_rad"):
        before, after = (getattr(m.header.survey, field_name, None) for m in (a, b))
        name, _, unit = field_name.partition("_")
        yield from _either(b.name, "map", f"origin {name}", (before, after), unit, tolerance)


def _class_changes(a: SemanticMap, b: SemanticMap, tolerance: float) -> Iterator[Change]:
    rows_a: Mapping[str, ClassInfo] = {row.name: row for row in reversed(a.all_classes)}
    rows_b: Mapping[str, ClassInfo] = {row.name: row for row in reversed(b.all_classes)}
    for name, row in rows_a.items():
        if name not in rows_b:
            yield Change("removed", "class", name, f"class {name} removed")
            continue
        for field in ("seg", "lidar", "p_return", "movable", "color", "merge"):
            pair = (getattr(row, field), getattr(rows_b[name], field))
            yield from _either(f"class {name}", "class", field, pair, "", tolerance, name=name)
    for name in rows_b:
        if name not in rows_a:
            yield Change("added", "class", name, f"class {name} added ({rows_b[name].lidar})")


def _either(
    said: str,
    what: str,
    field: str,
    pair: tuple[object, object],
    unit: str,
    tolerance: float,
    name: str = "",
) -> Iterator[Change]:
    before, after = pair
    if all(isinstance(value, (int, float)) and not isinstance(value, bool) for value in pair):
        yield from number_change(what, said, field, pair, unit, tolerance, name=name)  # type: ignore[arg-type]
    else:
        yield from value_change(what, said, field, before, after, name=name)


def _room_changes(a: SemanticMap, b: SemanticMap, tolerance: float, together: _Rigid | None) -> Iterator[Change]:
    gone = [name for name in a.rooms if name not in b.rooms]
    new = [name for name in b.rooms if name not in a.rooms]
    names: dict[str, str] = {}
    for old in gone:
        same = (
            name for name in new if name not in names.values() and _same_floor(a, b, old, name, tolerance, together)
        )
        if (found := next(same, None)) is not None:
            names[old] = found
    for old, room in a.rooms.items():
        name = names.get(old, old)
        if name not in b.rooms:
            yield Change("removed", "room", old, f"room {old} removed ({_area_m2(room):.1f} m2)")
            continue
        if name != old:
            yield Change("renamed", "room", old, f"room {old} renamed to {name}", "id", old, name)
        yield from value_change("room", f"room {name}", "kind", room.kind, b.rooms[name].kind, name=name)
        if not _same_floor(a, b, old, name, tolerance, together):
            yield _floor_change(name, room, b.rooms[name])
    for name in new:
        if name not in names.values():
            yield Change("added", "room", name, f"room {name} added ({_area_m2(b.rooms[name]):.1f} m2)")


def _same_floor(a: SemanticMap, b: SemanticMap, old: str, new: str, tolerance: float, together: _Rigid | None) -> bool:
    """Whether two floors have the same corners, whichever comes first."""
    before, after = a.rooms[old].floor, b.rooms[new].floor
    if before is None or after is None or len(before) != len(after):
        return before is None and after is None
    if together is not None:
        before = before @ together.T[:2, :2].T + together.T[:2, 3]
    limit = tolerance * (1.0 if together is None else float(np.abs(before).max()) + 1.0)
    return any(np.abs(np.roll(after, shift, axis=0) - before).max() <= limit for shift in range(len(after)))


def _floor_change(name: str, before: Room, after: Room) -> Change:
    old, new = _area_m2(before), _area_m2(after)
    text = f"room {name} has another floor: {old:.2f} -> {new:.2f} m2"
    return Change("changed", "room", name, text, "floor", f"{old:.4f} m2", f"{new:.4f} m2")


def _area_m2(room: Room) -> float:
    """By Gauss's formula; NaN when the floor cannot be read."""
    if room.floor is None:
        return math.nan
    x, y = room.floor.T
    return float(abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))) / 2)
