"""Wall boxes and openings -> the lines of a traffic editor: walls along their axes that meet in points, gaps for the doors.

Boxes end at each other's faces, lines meet at each other's axes: an end that touches another wall moves along its own axis
to where the two axes cross. That undoes what `wallkit.maps.draft.joints` does to drawn lines.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from wallkit.core.types import Float64Array
from wallkit.maps.draft.joints import CONTINUES_RAD
from wallkit.maps.model import SemanticMap
from wallkit.maps.nouns import Opening
from wallkit.maps.walls import WallRun

# walls that cross at a smaller angle (3 degrees) have no useful crossing
SMALLEST_SINE = 0.05
# ends this much farther apart than their thicknesses allow do not meet; rounding of maps to six decimals
SLACK_M = 0.002
# pieces of wall beside a door shorter than this are rounding
SLIVER_M = 0.005
# openings that begin higher are windows: the wall goes on below
FLOOR_M = 0.05


@dataclass(frozen=True)
class Line:
    """A straight piece from start to end (2,) [m] in frame map, and the run of boxes it stands for."""

    start: Float64Array
    end: Float64Array
    run: WallRun

    @property
    def length_m(self) -> float:
        return float(np.hypot(*(self.end - self.start)))


@dataclass(frozen=True)
class Gap:
    """An opening in a wall that reaches the floor: its ends (2,) [m] in frame map, in the sense of the wall's +x."""

    wall: str
    opening: Opening
    start: Float64Array
    end: Float64Array


def lines_and_gaps(
    semantic_map: SemanticMap, runs: Sequence[WallRun], poses: Mapping[str, Float64Array]
) -> tuple[list[Line], list[Gap]]:
    """The walls without their gaps, and the gaps.

    Args:
        runs: of the walls, from `wall_axes`. poses: T_map_link.
    """
    ends = _meeting_ends(runs)
    lines: list[Line] = []
    gaps: list[Gap] = []
    left = {link.name: _gaps_of(semantic_map, link.name, poses) for link in semantic_map.links.values()}
    for run, (start, end) in zip(runs, ends, strict=True):
        own = [gap for gap in left[run.link] if _is_on(gap, run)]
        left[run.link] = [gap for gap in left[run.link] if gap not in own]
        # a gap at the very end of its wall ends where the wall does
        own = [_reaching(gap, run, start, end) for gap in own]
        gaps += own
        lines += _between(run, start, end, own)
    # a wall whose doors take all of it has no box, and so no run
    return lines, gaps + [gap for gaps_of_wall in left.values() for gap in gaps_of_wall]


def _gaps_of(semantic_map: SemanticMap, wall: str, poses: Mapping[str, Float64Array]) -> list[Gap]:
    if wall not in poses:
        return []
    found = []
    for opening in semantic_map.links[wall].openings:
        if opening.z_m[0] <= FLOOR_M and opening.kind != "window":
            start, end = ((poses[wall] @ [x, 0.0, 0.0, 1.0])[:2] for x in opening.along_m)
            found.append(Gap(wall, opening, start, end))
    return found


def _meeting_ends(runs: Sequence[WallRun]) -> Float64Array:
    """(R, 2, 2) start and end of every run, moved to where its axis crosses that of a wall it touches there."""
    import shapely

    if not runs:
        return np.zeros((0, 2, 2))
    ends = np.array([(run.start, run.end) for run in runs])
    directions = np.array([run.direction for run in runs])
    thickest_m = max(run.thickness_m for run in runs)
    axes = shapely.linestrings(ends)
    tree = shapely.STRtree(axes)
    moved = ends.copy()
    points = shapely.points(ends.reshape(-1, 2))
    near = thickest_m * (0.5 + 1 / math.sin(CONTINUES_RAD)) + SLACK_M
    best = np.full(len(points), np.inf)
    for point, other in zip(*tree.query(points, predicate="dwithin", distance=near), strict=True):
        own = point // 2
        if own == other:
            continue
        crossing = _crossing(ends[own, point % 2], directions[own], ends[other], directions[other])
        if crossing is None:
            continue
        along_m, beyond_m, sine = crossing
        reach_m = _reach(sine, runs[own].thickness_m, runs[other].thickness_m)
        if abs(along_m) <= reach_m and beyond_m <= reach_m and abs(along_m) < best[point]:
            best[point] = abs(along_m)
            moved[own, point % 2] = ends[own, point % 2] + along_m * directions[own]
    return moved


def _crossing(
    point: Float64Array, direction: Float64Array, other: Float64Array, other_direction: Float64Array
) -> tuple[float, float, float] | None:
    """(way along the direction to the other axis, how far beyond the other's ends that is, sine of the angle)."""
    sine = float(direction[0] * other_direction[1] - direction[1] * other_direction[0])
    if abs(sine) < SMALLEST_SINE:
        return None
    offset = other[0] - point
    along_m = float(offset[0] * other_direction[1] - offset[1] * other_direction[0]) / sine
    at = float((point + along_m * direction - other[0]) @ other_direction)
    length_m = float(np.hypot(*(other[1] - other[0])))
    return along_m, max(-at, at - length_m, 0.0), abs(sine)


def _reach(sine: float, thickness_m: float, other_m: float) -> float:
    """How far an end may be from the crossing: a mitre where walls continue each other, else a slanted corner."""
    if sine < math.sin(CONTINUES_RAD):
        return max(thickness_m, other_m) / 2 * math.tan(math.asin(sine) / 2) + SLACK_M
    return (thickness_m + other_m) / 2 / sine + SLACK_M


def _is_on(gap: Gap, run: WallRun) -> bool:
    """Whether a gap lies in a run."""
    for point in (gap.start, gap.end):
        offset = point - run.start
        along, across = offset @ run.direction, offset @ np.array([-run.direction[1], run.direction[0]])
        if abs(across) > run.thickness_m / 2 or not -SLACK_M <= along <= run.length_m + SLACK_M:
            return False
    return True


def _reaching(gap: Gap, run: WallRun, start: Float64Array, end: Float64Array) -> Gap:
    """The gap, its ends moved with the run's where they are one."""
    places = []
    for point in (gap.start, gap.end):
        for old, new in ((run.start, start), (run.end, end)):
            if np.hypot(*(point - old)) < SLIVER_M:
                point = new
        places.append(point)
    return Gap(gap.wall, gap.opening, places[0], places[1])


def _between(run: WallRun, start: Float64Array, end: Float64Array, gaps: Sequence[Gap]) -> Iterator[Line]:
    """The pieces of a run that no gap takes."""
    reached = 0.0
    length_m = float(np.hypot(*(end - start)))
    spans = sorted(tuple(sorted(float((p - start) @ run.direction) for p in (gap.start, gap.end))) for gap in gaps)
    for low, high in [*spans, (length_m, length_m)]:
        if low - reached > SLIVER_M:
            yield Line(start + reached * run.direction, start + low * run.direction, run)
        reached = max(reached, high)
