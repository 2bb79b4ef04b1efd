"""E, walls against walls: gaps that a LiDAR looks through, joints that miss, angles and offsets that were not meant."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from wallkit.core.types import Float64Array
from wallkit.maps.document import Attribute, Edit
from wallkit.maps.numbers import numbers_from_text, text_from_number
from wallkit.maps.rules.base import Context, Problem, Rule
from wallkit.maps.rules.floods import sealed_regions
from wallkit.maps.rules.scale import outsized
from wallkit.maps.rules.solids import sound_runs
from wallkit.maps.walls import WallEnd, WallRun

if TYPE_CHECKING:
    from shapely import Polygon

# angles nearer to their ideal are exact; numbers are written with so many digits
_EXACT_RAD = 1e-4
# regions smaller than this are notches between walls
_NOTCH_M2 = 0.05


def e015_crossing(context: Context) -> Iterator[Problem]:
    """Two walls run through each other. Where walls meet one of them ends, so that each stretch has its own name.

    Bad:
      <link name="wall_a"><collision><geometry><box size="4 0.1 2.5"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
      <link name="wall_b"><collision><geometry><box size="0.1 4 2.5"/></geometry></collision></link>
      <joint name="b" type="fixed"><parent link="map"/><child link="wall_b"/></joint>
    Good:
      <link name="wall_a"><collision><geometry><box size="4 0.1 2.5"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
      <link name="wall_b"><collision><geometry><box size="0.1 4 2.5"/></geometry></collision></link>
      <joint name="b" type="fixed"><parent link="map"/><child link="wall_b"/><origin xyz="0 2.05 0"/></joint>
    """
    import shapely

    runs = context.once(sound_runs)
    axes = shapely.linestrings([[run.start, run.end] for run in runs]) if runs else []
    pairs = shapely.STRtree(axes).query(axes, predicate="crosses").T if runs else []
    for i, j in sorted((int(i), int(j)) for i, j in pairs if i < j):
        a, b = runs[i], runs[j]
        crossing = shapely.get_coordinates(shapely.intersection(axes[i], axes[j]))[0]
        # a tip that overshoots its corner is no crossing
        clear_m = max(a.thickness_m, b.thickness_m, context.tolerances.gap_max_m)
        beyond = min(float(np.hypot(*(end - crossing))) for end in (a.start, a.end, b.start, b.end))
        if beyond > clear_m and min(a.z_m[1], b.z_m[1]) > max(a.z_m[0], b.z_m[0]):
            message = f"walls '{a.link}' and '{b.link}' cross"
            related = ((f"wall '{b.link}'", b.parts[0].shape.element),)
            hint = f"end '{b.link}' at '{a.link}' and go on with another wall behind it"
            yield Problem(a.parts[0].shape.element, message, hint, xyz=tuple(crossing), related=related)


def e020_gap(context: Context) -> Iterator[Problem]:
    """A wall ends up to 30 cm short of the wall it should meet. LiDAR rays and the filter's free space leak through.

    An error where the gap joins two spaces that the walls else keep apart, a warning elsewhere.

    Bad:
      <link name="wall_a"><collision><geometry><box size="4 0.1 2.5"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
      <link name="wall_b"><collision><geometry><box size="0.1 4 2.5"/></geometry></collision></link>
      <joint name="b" type="fixed"><parent link="map"/><child link="wall_b"/><origin xyz="2.15 2.05 0"/></joint>
    Good:
      <link name="wall_a"><collision><geometry><box size="4 0.1 2.5"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
      <link name="wall_b"><collision><geometry><box size="0.1 4 2.5"/></geometry></collision></link>
      <joint name="b" type="fixed"><parent link="map"/><child link="wall_b"/><origin xyz="1.95 2.05 0"/></joint>
    """
    for end, is_corner in context.once(_short_ends):
        if end.neighbour is None or (not is_corner and end.distance_m <= context.tolerances.junction_m):
            continue
        leak = _leak(context, end)
        if leak is None and not is_corner:
            continue
        which = "start" if end.is_start else "end"
        joins = f"; through it {leak} are one" if leak else ""
        gap_mm = end.distance_m * 1000
        message = f"the {which} of wall '{end.run.link}' stops {gap_mm:.4g} mm short of '{end.neighbour.link}'{joins}"
        edits = _extended(context, end, over_corner=is_corner)
        yield Problem(
            end.run.parts[0].shape.element,
            message,
            f"extend '{end.run.link}' to ({end.nearest[0]:.3f}, {end.nearest[1]:.3f})",
            xyz=tuple((end.point + end.nearest) / 2),
            related=((f"'{end.neighbour.name}'", end.neighbour.shape.element),),
            edits=edits,
            severity=None if leak else "warning",
            detail={"gap_m": end.distance_m},
        )


def e022_t_junction(context: Context) -> Iterator[Problem]:
    """A wall stops up to 5 cm before the side of another one that it should meet.

    Bad:
      <link name="wall_a"><collision><geometry><box size="4 0.1 2.5"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
      <link name="wall_b"><collision><geometry><box size="0.1 4 2.5"/></geometry></collision></link>
      <joint name="b" type="fixed"><parent link="map"/><child link="wall_b"/><origin xyz="0 2.08 0"/></joint>
    Good:
      <link name="wall_a"><collision><geometry><box size="4 0.1 2.5"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
      <link name="wall_b"><collision><geometry><box size="0.1 4 2.5"/></geometry></collision></link>
      <joint name="b" type="fixed"><parent link="map"/><child link="wall_b"/><origin xyz="0 2.05 0"/></joint>
    """
    for end, is_corner in context.once(_short_ends):
        if not is_corner and end.neighbour is not None and end.distance_m <= context.tolerances.junction_m:
            gap_mm = end.distance_m * 1000
            message = f"wall '{end.run.link}' misses the side of '{end.neighbour.link}' by {gap_mm:.4g} mm"
            hint = f"extend '{end.run.link}' to ({end.nearest[0]:.3f}, {end.nearest[1]:.3f})"
            related = ((f"'{end.neighbour.name}'", end.neighbour.shape.element),)
            edits = _extended(context, end, over_corner=False)
            at = end.run.parts[0].shape.element
            yield Problem(at, message, hint, xyz=tuple(end.point), related=related, edits=edits)


def e023_free_end(context: Context) -> Iterator[Problem]:
    """A wall ends in the open. Where the building does so too all is well.

    Bad:
      <link name="wall_a"><collision><geometry><box size="4 0.1 2.5"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
    Good: walls whose both ends touch another wall, a column or a pane.
    """
    sound = {id(run) for run in context.once(sound_runs)}
    for end in context.wall_ends:
        if end.neighbour is None and id(end.run) in sound:
            which = "start" if end.is_start else "end"
            message = f"the {which} of wall '{end.run.link}' meets nothing"
            yield Problem(end.run.parts[0].shape.element, message, xyz=tuple(end.point))


def e033_nearly_right(context: Context) -> Iterator[Problem]:
    """Two walls meet at nearly, but not quite, a right angle.

    Some buildings are like that; most such angles are slips.

    Bad:
      <link name="wall_a"><collision><geometry><box size="4 0.1 2.5"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
      <link name="wall_b"><collision><geometry><box size="4 0.1 2.5"/></geometry></collision></link>
      <joint name="b" type="fixed"><parent link="map"/><child link="wall_b"/><origin xyz="0 2 0" rpy="0 0 1.5607963"/>
      </joint>
    Good:
      <link name="wall_a"><collision><geometry><box size="4 0.1 2.5"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
      <link name="wall_b"><collision><geometry><box size="4 0.1 2.5"/></geometry></collision></link>
      <joint name="b" type="fixed"><parent link="map"/><child link="wall_b"/><origin xyz="0 2 0" rpy="0 0 1.5707963"/>
      </joint>
    """
    for a, b, end in context.once(_meetings):
        off_rad = abs(math.asin(min(1.0, abs(float(a.direction @ b.direction)))))
        if _EXACT_RAD < off_rad <= context.tolerances.near_right_rad:
            message = f"walls '{a.link}' and '{b.link}' meet at {90 - math.degrees(off_rad):.2f} degrees"
            related = ((f"wall '{b.link}'", b.parts[0].shape.element),)
            hint = "if a right angle is meant, write yaw with seven decimals"
            yield Problem(a.parts[0].shape.element, message, hint, xyz=tuple(end.point), related=related)


def e034_offset(context: Context) -> Iterator[Problem]:
    """Two walls that follow each other are nearly, but not quite, in line.

    Bad:
      <link name="wall_a"><collision><geometry><box size="4 0.1 2.5"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
      <link name="wall_b"><collision><geometry><box size="4 0.1 2.5"/></geometry></collision></link>
      <joint name="b" type="fixed"><parent link="map"/><child link="wall_b"/><origin xyz="4 0.01 0"/></joint>
    Good:
      <link name="wall_a"><collision><geometry><box size="4 0.1 2.5"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
      <link name="wall_b"><collision><geometry><box size="4 0.1 2.5"/></geometry></collision></link>
      <joint name="b" type="fixed"><parent link="map"/><child link="wall_b"/><origin xyz="4 0 0"/></joint>
    """
    limits = context.tolerances
    for a, b, end in context.once(_meetings):
        if abs(_cross(a.direction, b.direction)) > limits.near_right_rad:
            continue
        offset_m = abs(_cross(end.point - b.start, b.direction))
        if limits.offset_min_m < offset_m <= limits.offset_max_m:
            message = f"walls '{a.link}' and '{b.link}' are {offset_m * 1000:.4g} mm out of line"
            related = ((f"wall '{b.link}'", b.parts[0].shape.element),)
            yield Problem(a.parts[0].shape.element, message, xyz=tuple(end.point), related=related)


# -------------------------------------------------------------------------------------------- details


def _short_ends(context: Context) -> list[tuple[WallEnd, bool]]:
    """Ends that stop short of what lies before them, once per gap, and whether a wall's end (a corner) lies there."""
    limits = context.tolerances
    wrong = context.once(outsized)
    sound = {id(run) for run in context.once(sound_runs)}
    run_of = _run_of_shape(context)
    found: list[tuple[WallEnd, bool]] = []
    corners_seen: set[tuple[frozenset[int], float]] = set()
    for end in context.wall_ends:
        if end.neighbour is None or id(end.run) not in sound or end.neighbour.link in wrong:
            continue
        if not limits.gap_min_m < end.distance_m <= limits.gap_max_m or not _lies_ahead(end):
            continue
        other = run_of.get(id(end.neighbour.shape))
        reach_m = end.run.thickness_m / 2 + (other.thickness_m if other is not None else 0.0) + limits.gap_max_m / 2
        is_corner = other is not None and min(
            float(np.hypot(*(tip - end.nearest))) for tip in (other.start, other.end)
        ) <= min(reach_m, other.length_m / 3)
        key = (frozenset([id(end.run), id(other)]), round(end.distance_m, 6))
        if is_corner and key in corners_seen:
            continue
        corners_seen.add(key)
        found.append((end, is_corner))
    return found


def _meetings(context: Context) -> list[tuple[WallRun, WallRun, WallEnd]]:
    """Pairs of runs that meet or nearly do, each once, with one end that meets the other."""
    sound = {id(run) for run in context.once(sound_runs)}
    run_of = _run_of_shape(context)
    found: dict[frozenset[int], tuple[WallRun, WallRun, WallEnd]] = {}
    for end in context.wall_ends:
        other = run_of.get(id(end.neighbour.shape)) if end.neighbour is not None else None
        if other is not None and {id(end.run), id(other)} <= sound:
            found.setdefault(frozenset([id(end.run), id(other)]), (end.run, other, end))
    return list(found.values())


def _run_of_shape(context: Context) -> dict[int, WallRun]:
    return {id(part.shape): run for run in context.runs for part in run.parts}


def _edge(end: WallEnd) -> Float64Array:
    """(2, 2) corners of the wall's short side at that end."""
    across = np.array([-end.run.direction[1], end.run.direction[0]]) * end.run.thickness_m / 2
    return np.array([end.point - across, end.point + across])


def _shift(end: WallEnd) -> tuple[Float64Array, Float64Array]:
    """From the end's edge to the neighbour (2,), and the wall's outward direction (2,)."""
    import shapely

    line = shapely.shortest_line(shapely.linestrings(_edge(end)), shapely.points(end.nearest))
    start, stop = shapely.get_coordinates(line)
    return stop - start, -end.run.direction if end.is_start else end.run.direction


def _lies_ahead(end: WallEnd) -> bool:
    """Whether the neighbour lies before the end, not beside it as in a cavity wall."""
    shift, outward = _shift(end)
    return float(shift @ outward) > 0.5 * float(np.hypot(*shift))


def _leak(context: Context, end: WallEnd) -> str | None:
    """What the gap joins ("the outside and 19.2 m2"), or None when closing it would part nothing."""
    import shapely

    regions = context.once(sealed_regions)
    plug: Polygon = shapely.convex_hull(shapely.multipoints([*_edge(end), end.nearest])).buffer(2e-3)
    for region in regions:
        if not region.polygon.intersects(plug):
            continue
        pieces = [piece for piece in shapely.get_parts(region.polygon.difference(plug)) if piece.area > _NOTCH_M2]
        # the gap parts its region only if a piece on each side of it remains
        touching = [piece for piece in pieces if piece.distance(plug) < 1e-6]
        if len(touching) > 1:
            areas = sorted((float(piece.area) for piece in touching), reverse=True)
            first = "the outside" if region.is_outside else f"{areas[0]:.1f} m2"
            return f"{first} and {areas[1]:.1f} m2"
    return None


def _extended(context: Context, end: WallEnd, *, over_corner: bool) -> tuple[Edit, ...]:
    """Edits that lengthen the end's box to its neighbour, and over a corner to the neighbour's far side."""
    part = min(end.run.parts, key=lambda part: float(np.hypot(*(part.corners[:, :2] - end.point).T).min()))
    shift, outward = _shift(end)
    extra_m = float(shift @ outward)
    if over_corner and end.neighbour is not None:
        reach = (end.neighbour.corners[:, :2] - end.point) @ outward
        other = _run_of_shape(context)[id(end.neighbour.shape)]
        extra_m = float(reach.max()) if abs(float(other.direction @ outward)) < 0.5 else extra_m
    R = part.T_map_shape[:3, :3]
    axis = int(np.argmax(np.abs(outward @ R[:2])))
    origin = part.shape.element.find("origin")
    xyz = origin.attribute("xyz") if origin is not None else None
    size = part.shape.geometry.attribute("size")
    centre = numbers_from_text(xyz.value, 3) if xyz is not None else None
    if not isinstance(size, Attribute) or xyz is None or centre is None or abs(float(outward @ R[:2, axis])) < 1 - 1e-6:
        return ()
    lengths = part.shape.size.copy()
    lengths[axis] += extra_m
    R_map_link = context.poses[part.link][:3, :3]
    moved = np.array(centre) + R_map_link.T @ np.append(outward * extra_m / 2, 0.0)
    return (size.replaced_by(_text(lengths)), xyz.replaced_by(_text(moved)))


def _text(values: Float64Array) -> str:
    return " ".join(text_from_number(0.0 if abs(value) < 5e-7 else round(value, 6)) for value in values.tolist())


def _cross(a: Float64Array, b: Float64Array) -> float:
    return float(a[0] * b[1] - a[1] * b[0])


RULES = (
    Rule("WK-E015", "warning", e015_crossing),
    Rule("WK-E020", "error", e020_gap, fix="moderate"),
    Rule("WK-E022", "warning", e022_t_junction, fix="moderate"),
    Rule("WK-E023", "info", e023_free_end),
    Rule("WK-E033", "info", e033_nearly_right),
    Rule("WK-E034", "info", e034_offset),
)
