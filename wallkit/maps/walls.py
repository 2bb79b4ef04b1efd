"""Wall boxes -> straight wall runs with their axes, and how the ends of the runs meet what stands around them."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from wallkit.core.types import Float64Array
from wallkit.maps.geometry import Part
from wallkit.maps.model import SemanticMap

if TYPE_CHECKING:
    from shapely import Polygon

WALL_CLASSES = ("wall",)
# boxes whose centre planes or thicknesses differ by less belong to one wall; drawings are rounded to millimetres
ALIGNED_M = 1e-3

Interval = tuple[float, float]


@dataclass(frozen=True, slots=True, eq=False)
class WallRun:
    """A straight piece of wall: boxes of one link on one axis, with nothing but declared openings between them.

    Attributes:
        start, end: (2,) ends of the axis in the map frame; from start to end runs the wall's +x where they are parallel.
        z_m: (lowest, highest) in the map frame, over all boxes.
        parts: its boxes.
    """

    link: str
    start: Float64Array
    end: Float64Array
    thickness_m: float
    z_m: tuple[float, float]
    parts: tuple[Part, ...]

    @property
    def length_m(self) -> float:
        """Length of the axis."""
        return float(np.hypot(*(self.end - self.start)))

    @property
    def height_m(self) -> float:
        """From the lowest to the highest box."""
        return self.z_m[1] - self.z_m[0]

    @property
    def direction(self) -> Float64Array:
        """(2,) unit vector from start to end."""
        return np.asarray((self.end - self.start) / self.length_m)

    @property
    def footprint(self) -> Polygon:
        """The rectangle around the axis, openings included."""
        from shapely import Polygon

        across = np.array([-self.direction[1], self.direction[0]]) * self.thickness_m / 2
        return Polygon([self.start + across, self.start - across, self.end - across, self.end + across])


@dataclass(frozen=True, slots=True, eq=False)
class WallEnd:
    """One end of a run, and the nearest structure that is not the run itself.

    Attributes:
        point: (2,) end of the axis. is_start: it is `run.start`.
        neighbour: the nearest part within reach that shares some height; None for a free end.
        distance_m: from the end's edge to the neighbour; 0 when they touch; inf for a free end.
        nearest: (2,) the neighbour's closest point; the end itself for a free end.
    """

    run: WallRun
    is_start: bool
    point: Float64Array
    neighbour: Part | None
    distance_m: float
    nearest: Float64Array


def wall_axes(
    semantic_map: SemanticMap, solids: Sequence[Part], *, classes: Collection[str] = WALL_CLASSES
) -> list[WallRun]:
    """Every run of every wall, by link in the order of the parts, longest first within a link.

    Args:
        solids: the map's parts, placed. classes: whose links count as walls.

    A polyline wall (boxes turned against each other in one link) gives one run per direction. Only boxes count; a tilted one
    by its two most horizontal sides.
    """
    boxes: dict[str, list[Part]] = {}
    for part in solids:
        if part.class_name in classes and part.shape.kind == "box":
            boxes.setdefault(part.link, []).append(part)
    return [run for link, found in boxes.items() for run in _runs_of_link(semantic_map, link, found)]


def wall_ends(runs: Sequence[WallRun], solids: Sequence[Part], *, reach_m: float) -> list[WallEnd]:
    """Start and end of every run with their nearest neighbour among the solids (give all that can close a gap)."""
    import shapely

    if not runs:
        return []
    edges = shapely.linestrings([edge for run in runs for edge in (_edge(run, run.start), _edge(run, run.end))])
    footprints = np.array([part.footprint for part in solids], dtype=object)
    # parts are placed anew for other joint states; the shape they come from stays
    own = {id(part.shape): number for number, run in enumerate(runs) for part in run.parts}
    nearest: dict[int, tuple[float, int]] = {}
    pairs = shapely.STRtree(footprints).query(edges, predicate="dwithin", distance=reach_m)
    for end, solid, distance in zip(*pairs, shapely.distance(edges[pairs[0]], footprints[pairs[1]]), strict=True):
        if own.get(id(solids[solid].shape)) != end // 2 and _share_height(runs[end // 2].z_m, solids[solid].z_m):
            nearest[end] = min(nearest.get(end, (np.inf, 0)), (float(distance), int(solid)))
    ends = []
    for end, edge in enumerate(edges):
        run, is_start = runs[end // 2], end % 2 == 0
        point = run.start if is_start else run.end
        if end not in nearest:
            ends.append(WallEnd(run, is_start, point, None, np.inf, point))
            continue
        distance_m, solid = nearest[end]
        reached = shapely.get_coordinates(shapely.shortest_line(edge, footprints[solid]))[-1]
        ends.append(WallEnd(run, is_start, point, solids[solid], distance_m, reached))
    return ends


def gaps(ends: Sequence[WallEnd], *, min_m: float, max_m: float) -> list[WallEnd]:
    """Ends that stop between min and max short of their neighbour; of two ends that face each other only the first."""
    found: list[WallEnd] = []
    seen: set[tuple[frozenset[str], float]] = set()
    for end in ends:
        if end.neighbour is None or not min_m < end.distance_m <= max_m:
            continue
        key = (frozenset([end.run.link, end.neighbour.link]), round(end.distance_m, 6))
        if end.run.link == end.neighbour.link or key not in seen:
            found.append(end)
        seen.add(key)
    return found


# -------------------------------------------------------------------------------------------- details


@dataclass(slots=True)
class _Line:
    """A run in the making: a line through `origin`, and the boxes on it as intervals along it."""

    origin: Float64Array
    direction: Float64Array
    thickness_m: float
    boxes: list[tuple[Interval, Part]]

    def extent(self, points: Float64Array) -> tuple[Interval, Interval]:
        """Of points (C, 2): along the line and across it."""
        along = (points - self.origin) @ self.direction
        across = (points - self.origin) @ np.array([-self.direction[1], self.direction[0]])
        return (float(along.min()), float(along.max())), (float(across.min()), float(across.max()))


def _runs_of_link(semantic_map: SemanticMap, link: str, boxes: list[Part]) -> list[WallRun]:
    lines: list[_Line] = []
    sides = sorted(((_sides(part), part) for part in boxes), key=lambda pair: -pair[0][1])
    for (direction, _, thickness_m), part in sides:
        points = part.corners[:, :2]
        for line in lines:
            along, (left, right) = line.extent(points)
            if abs(left + right) / 2 <= ALIGNED_M and abs(right - left - line.thickness_m) <= ALIGNED_M:
                line.boxes.append((along, part))
                break
        else:
            line = _Line(part.T_map_shape[:2, 3], direction, thickness_m, [])
            line.boxes.append((line.extent(points)[0], part))
            lines.append(line)
    T_map_link = boxes[0].T_map_shape @ np.linalg.inv(boxes[0].shape.T_link_shape)
    openings = [opening.along_m for opening in semantic_map.links[link].openings]
    return [run for line in lines for run in _runs_on_line(line, link, _on_line(line, openings, T_map_link))]


def _sides(part: Part) -> tuple[Float64Array, float, float]:
    """Direction (2,) of the longer horizontal side, its length, and the shorter one's."""
    R, size = part.T_map_shape[:3, :3], part.shape.size
    upright = int(np.argmax(np.abs(R[2])))
    long, short = sorted((axis for axis in range(3) if axis != upright), key=lambda axis: -size[axis])
    direction = R[:2, long] / np.hypot(*R[:2, long])
    # of the two senses the one nearer to the link's +x, which runs along the wall
    R_link_shape = part.shape.T_link_shape[:3, :3]
    if R_link_shape[0, long] < -1e-9:
        direction = -direction
    return direction, float(size[long]), float(size[short])


def _on_line(line: _Line, openings: list[tuple[float, float]], T_map_link: Float64Array) -> list[Interval]:
    """Intervals of the openings along the line; they are given along the link's x axis, so other lines have none."""
    found = []
    for along in openings:
        ends = np.array([T_map_link @ [x, 0.0, 0.0, 1.0] for x in along])[:, :2]
        interval, across = line.extent(ends)
        if np.all(np.isfinite(interval)) and max(map(abs, across)) <= line.thickness_m / 2 + ALIGNED_M:
            found.append(interval)
    return found


def _runs_on_line(line: _Line, link: str, openings: list[Interval]) -> list[WallRun]:
    """Boxes that follow each other without a gap, or with an opening between them, as runs."""
    items: list[tuple[Interval, Part | None]] = [*line.boxes, *((interval, None) for interval in openings)]
    groups: list[list[tuple[Interval, Part]]] = [[]]
    reached = -np.inf
    for interval, part in sorted(items, key=lambda item: item[0]):
        if interval[0] > reached + ALIGNED_M and groups[-1]:
            groups.append([])
        reached = max(reached, interval[1])
        if part is not None:
            groups[-1].append((interval, part))
    runs = []
    for group in groups:
        if not group:
            continue
        start, end = min(a for (a, _), _ in group), max(b for (_, b), _ in group)
        z = (min(part.z_m[0] for _, part in group), max(part.z_m[1] for _, part in group))
        ends = line.origin + np.outer([start, end], line.direction)
        runs.append(WallRun(link, ends[0], ends[1], line.thickness_m, z, tuple(part for _, part in group)))
    return runs


def _edge(run: WallRun, end: Float64Array) -> Float64Array:
    """(2, 2) the short side of the wall at one of its ends."""
    across = np.array([-run.direction[1], run.direction[0]]) * run.thickness_m / 2
    return np.array([end - across, end + across])


def _share_height(a: tuple[float, float], b: tuple[float, float]) -> bool:
    return min(a[1], b[1]) > max(a[0], b[0])
