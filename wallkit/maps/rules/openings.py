"""O, openings: they and the holes in the wall's boxes say the same."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np

from wallkit.maps.document import Edit, Element, escaped
from wallkit.maps.nouns import Opening
from wallkit.maps.numbers import text_from_number
from wallkit.maps.rules.base import Context, Problem, Rule
from wallkit.maps.rules.elevation import Elevation, elevations, in_frame
from wallkit.maps.rules.floods import closed_leaves

# a hole that nobody declared is told from this size on
_HOLE_SIDE_M = 0.2
_DOOR_WIDTH_M = (0.5, 2.5)


def o001_not_cut(context: Context) -> Iterator[Problem]:
    """An opening is declared, but the wall's boxes do not leave it open.

    Bad:
      <link name="wall_a"><wk:opening id="d" kind="door" along="1 2" z="0 2"/>
      <collision><origin xyz="2 0 1.25"/><geometry><box size="4 0.1 2.5"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
    Good:
      <link name="wall_a"><wk:opening id="d" kind="door" along="1 2" z="0 2"/>
      <collision><origin xyz="0.5 0 1.25"/><geometry><box size="1 0.1 2.5"/></geometry></collision>
      <collision><origin xyz="1.5 0 2.25"/><geometry><box size="1 0.1 0.5"/></geometry></collision>
      <collision><origin xyz="3 0 1.25"/><geometry><box size="2 0.1 2.5"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
    """
    tolerance_m = context.tolerances.hole_m
    for wall, opening in _openings(context):
        if _outside(wall, opening, tolerance_m):
            continue
        (x0, x1), (z0, z1) = opening.along_m, opening.z_m
        for part, (left, low, right, high) in wall.boxes:
            width_m, height_m = min(right, x1) - max(left, x0), min(high, z1) - max(low, z0)
            if width_m > tolerance_m and height_m > tolerance_m:
                message = (
                    f"opening '{opening.id}' is not cut: box '{part.name}' of wall '{wall.link.name}' "
                    f"stands {width_m:.3g} x {height_m:.3g} m in it"
                )
                hint = f"wallkit map cut {context.document.source} {wall.link.name} {opening.id}"
                related = ((f"box '{part.name}'", part.shape.element),)
                yield Problem(opening.element, message, hint, xyz=_middle(context, wall, opening), related=related)


def o002_outside_wall(context: Context) -> Iterator[Problem]:
    """An opening lies outside its wall, or is empty: its numbers run from left to right, from bottom to top.

    Bad:
      <link name="wall_a"><wk:opening id="d" kind="door" along="3.5 4.5" z="0 2"/>
      <collision><origin xyz="2 0 1.25"/><geometry><box size="4 0.1 2.5"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
    Good:
      <link name="wall_a"><collision><origin xyz="2 0 1.25"/><geometry><box size="4 0.1 2.5"/></geometry></collision>
      </link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
    """
    for wall, opening in _openings(context):
        outside = _outside(wall, opening, context.tolerances.hole_m)
        if outside:
            message = f"opening '{opening.id}' of wall '{wall.link.name}' {outside}"
            hint = "along and z are in the wall's frame: x along the wall from its start, z from its floor"
            yield Problem(opening.element, message, hint, xyz=_middle(context, wall, opening))


def o005_overlap(context: Context) -> Iterator[Problem]:
    """Two openings of a wall overlap.

    Bad:
      <link name="wall_a"><wk:opening id="a" kind="passage" along="1 2" z="0 2.5"/>
      <wk:opening id="b" kind="passage" along="1.5 2" z="0 2.5"/>
      <collision><origin xyz="0.5 0 1.25"/><geometry><box size="1 0.1 2.5"/></geometry></collision>
      <collision><origin xyz="3 0 1.25"/><geometry><box size="2 0.1 2.5"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
    Good:
      <link name="wall_a"><wk:opening id="a" kind="passage" along="1 2" z="0 2.5"/>
      <collision><origin xyz="0.5 0 1.25"/><geometry><box size="1 0.1 2.5"/></geometry></collision>
      <collision><origin xyz="3 0 1.25"/><geometry><box size="2 0.1 2.5"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
    """
    tolerance_m = context.tolerances.hole_m
    for link in context.map.links.values():
        for number, b in enumerate(link.openings):
            for a in link.openings[:number]:
                width_m = min(a.along_m[1], b.along_m[1]) - max(a.along_m[0], b.along_m[0])
                height_m = min(a.z_m[1], b.z_m[1]) - max(a.z_m[0], b.z_m[0])
                if width_m > tolerance_m and height_m > tolerance_m:
                    message = (
                        f"openings '{a.id}' and '{b.id}' of '{link.name}' overlap by {width_m:.3g} x {height_m:.3g} m"
                    )
                    related = ((f"opening '{a.id}'", a.element),)
                    yield Problem(b.element, message, "delete one of them, or mend along and z", related=related)


def o006_undeclared(context: Context) -> Iterator[Problem]:
    """The wall's boxes leave a hole that no opening declares: whether one can go or see through it is not known.

    Bad:
      <link name="wall_a">
      <collision><origin xyz="0.5 0 1.25"/><geometry><box size="1 0.1 2.5"/></geometry></collision>
      <collision><origin xyz="3 0 1.25"/><geometry><box size="2 0.1 2.5"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
    Good:
      <link name="wall_a"><wk:opening id="p" kind="passage" along="1 2" z="0 2.5"/>
      <collision><origin xyz="0.5 0 1.25"/><geometry><box size="1 0.1 2.5"/></geometry></collision>
      <collision><origin xyz="3 0 1.25"/><geometry><box size="2 0.1 2.5"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
    """
    for wall in context.once(elevations).values():
        for bounds in _undeclared(wall):
            x0, z0, x1, z1 = bounds
            fill = _likely_fill(context, wall, bounds)
            kind = _likely_kind(wall, bounds, is_filled=bool(fill))
            along, z = (
                f"{text_from_number(round(a, 4))} {text_from_number(round(b, 4))}" for a, b in ((x0, x1), (z0, z1))
            )
            said = f' fill="{escaped(fill)}"' if fill else ""
            name = _free_id(context, kind)
            text = f'<wk:opening id="{name}" kind="{kind}" along="{along}" z="{z}"{said}/>'
            message = f"wall '{wall.link.name}' has a hole of {x1 - x0:.3g} x {z1 - z0:.3g} m that no opening declares"
            xyz = context.poses[wall.link.name] @ [(x0 + x1) / 2, 0.0, (z0 + z1) / 2, 1.0]
            yield Problem(
                wall.link.element, message, f"add {text}", xyz=tuple(xyz[:3]), edits=_inserted(wall.link.element, text)
            )


# -------------------------------------------------------------------------------------------- details


def _openings(context: Context) -> Iterator[tuple[Elevation, Opening]]:
    for wall in context.once(elevations).values():
        for opening in wall.link.openings:
            if np.all(np.isfinite([*opening.along_m, *opening.z_m])):
                yield wall, opening


def _outside(wall: Elevation, opening: Opening, tolerance_m: float) -> str:
    """What is wrong with an opening's place, or ""."""
    (x0, x1), (z0, z1) = opening.along_m, opening.z_m
    left, low, right, high = wall.bounds
    # the wall begins at its frame, on the floor, though its first box may be the lintel over this opening
    left, low = min(left, 0.0), min(low, 0.0)
    if x0 >= x1 or z0 >= z1:
        return f"is empty: along {x0:g} to {x1:g}, z {z0:g} to {z1:g}"
    if x0 < left - tolerance_m or x1 > right + tolerance_m:
        return f"goes from {x0:g} to {x1:g} m, the wall from {left:.3g} to {right:.3g} m"
    if z0 < low - tolerance_m or z1 > high + tolerance_m:
        return f"reaches from {z0:g} to {z1:g} m up, the wall from {low:.3g} to {high:.3g} m"
    return ""


def _undeclared(wall: Elevation) -> list[tuple[float, float, float, float]]:
    """Bounds of the holes between the wall's boxes that no opening covers."""
    import shapely

    if len(wall.boxes) < 2:
        return []
    x0, z0, x1, z1 = wall.bounds
    declared = [
        shapely.box(opening.along_m[0], opening.z_m[0], opening.along_m[1], opening.z_m[1])
        for opening in wall.link.openings
        if np.all(np.isfinite([*opening.along_m, *opening.z_m]))
    ]
    missing = shapely.box(x0, z0, x1, z1) - shapely.union_all([wall.solid, *declared])
    # slits narrower than a hole do not count, and do not join two holes
    half = _HOLE_SIDE_M / 2
    opened = missing.buffer(-half, join_style="mitre").buffer(half, join_style="mitre")
    found = []
    for piece in shapely.get_parts(opened) if not opened.is_empty else ():
        left, low, right, high = (float(value) for value in piece.bounds)
        # a step in the wall's top is no hole: there is wall on both sides
        beside = [shapely.box(a, low, b, high) for a, b in ((x0, left), (right, x1))]
        if x0 < left and right < x1 and all(wall.solid.intersects(side) for side in beside):
            found.append((left, low, right, high))
    return sorted(found)


def _likely_kind(wall: Elevation, bounds: tuple[float, float, float, float], *, is_filled: bool) -> str:
    (x0, low, x1, high), (_, floor, _, top) = bounds, wall.bounds
    if low - floor > _HOLE_SIDE_M:
        return "window"
    narrow = _DOOR_WIDTH_M[0] <= x1 - x0 <= _DOOR_WIDTH_M[1]
    return "door" if is_filled or (narrow and top - high > _HOLE_SIDE_M / 2) else "passage"


def _likely_fill(context: Context, wall: Elevation, bounds: tuple[float, float, float, float]) -> str:
    """The one door or pane on this wall whose middle stands in the hole, or ""."""
    closed = {part.link: part for part in context.once(closed_leaves)}
    inside = []
    for joint in context.map.children_of(wall.link.name):
        part = closed.get(joint.child) or next(iter(context.parts_by_link.get(joint.child, ())), None)
        if part is None or part.class_name not in ("door", "window", "glass"):
            continue
        middle = in_frame(part.corners, context.poses[wall.link.name]).mean(axis=0)
        if bounds[0] < middle[0] < bounds[2] and bounds[1] < middle[2] < bounds[3]:
            inside.append(joint.child)
    return inside[0] if len(inside) == 1 else ""


def _free_id(context: Context, kind: str) -> str:
    taken = Counter(opening.id for link in context.map.links.values() for opening in link.openings)
    return next(name for k in range(1, len(taken) + 2) if (name := f"{kind}_{k}") not in taken)


def _inserted(element: Element, text: str) -> tuple[Edit, ...]:
    """A new first child behind the <wk:object>, or at the start."""
    first = element.children[0] if element.children else None
    if first is None:
        return ()
    at = first.span.end if first.tag.endswith("}object") else element.start_span.end
    return (Edit(at, 0, f"\n    {text}".encode(element.document.encoding)),)


def _middle(context: Context, wall: Elevation, opening: Opening) -> tuple[float, ...]:
    x, z = sum(opening.along_m) / 2, sum(opening.z_m) / 2
    return tuple((context.poses[wall.link.name] @ [x, 0.0, z, 1.0])[:3])


RULES = (
    Rule("WK-O001", "error", o001_not_cut),
    Rule("WK-O002", "error", o002_outside_wall),
    Rule("WK-O005", "error", o005_overlap),
    Rule("WK-O006", "warning", o006_undeclared, fix="moderate"),
)
