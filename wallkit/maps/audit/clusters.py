"""Returns that the map does not explain -> things that stand there: where, how large, and what they may be.

A thing is told from people by patience: it is there whenever a beam comes its way. So cells count the views that had a
return in them against those that looked through them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from scipy import ndimage

from wallkit.core.types import BoolArray, Float64Array, Int64Array
from wallkit.maps.audit.faces import Faces
from wallkit.maps.audit.nouns import Cluster, Logged
from wallkit.maps.audit.solve import Solution
from wallkit.maps.model import SemanticMap
from wallkit.maps.sight import touches

CELL_M = 0.1
# so many views, over so long, must have met it, and so many of those that could have
VIEWS_MIN, SECONDS_MIN, SHARE_MIN = 5, 4.0, 0.5
RETURNS_MIN = 12
# a thing whose back is nearer to a wall stands at it
_AT_WALL_M = 0.3
# a beam this close to its end tells nothing about the cell it is in
_SHY_M = 0.15
_CELLS_MAX = 16_000_000
# spans of a thing's outline are between these quantiles of its returns: noise makes the extremes larger
_SPAN = (1.0, 99.0)


@dataclass(frozen=True, slots=True)
class _Lattice:
    low: Float64Array
    rows: int
    columns: int


def unexplained_returns(
    faces: Faces,
    logged: Logged,
    solution: Solution,
    on_face: BoolArray,
    doorways: Sequence[Any],
    *,
    tolerance_m: float,
) -> BoolArray:
    """(B,) returns near nothing in the map, on its floor: not behind glass, not where a door sweeps, not beyond the map.

    Args:
        doorways: what every door covers on its way (polygons).
    """
    import shapely

    beams = solution.beams
    candidates = np.flatnonzero(np.isfinite(logged.ranges_m) & ~on_face & beams.is_clear)
    points = beams.endpoints[candidates]
    low, high = faces.segments.reshape(-1, 2).min(axis=0), faces.segments.reshape(-1, 2).max(axis=0)
    kept = ((points > low - tolerance_m) & (points < high + tolerance_m)).all(axis=1)
    for doorway in doorways:
        kept &= ~shapely.contains_xy(doorway.buffer(tolerance_m), points[:, 0], points[:, 1])
    # through a wall that stands the map says nothing
    kept[kept] &= ~_near(faces, points[kept], tolerance_m)
    found = np.zeros(len(on_face), dtype=np.bool_)
    found[candidates[kept]] = True
    return found


def clusters_of(
    semantic_map: SemanticMap, faces: Faces, logged: Logged, solution: Solution, is_unexplained: BoolArray
) -> list[Cluster]:
    """Things that stand where the map has none, largest first."""
    if not is_unexplained.any():
        return []
    beams = solution.beams
    lattice = _lattice(faces)
    is_return = np.isfinite(logged.ranges_m)
    hits, passes = _tally(
        beams.origins,
        beams.directions,
        np.hypot(*(beams.endpoints - beams.origins).T),
        is_return,
        is_unexplained,
        logged.views,
        float(lattice.low[0]),
        float(lattice.low[1]),
        CELL_M,
        lattice.rows,
        lattice.columns,
    )
    stands = (hits >= 2) & (hits >= SHARE_MIN * (hits + passes))
    labels, _ = ndimage.label(ndimage.binary_dilation(stands, np.ones((3, 3))), np.ones((3, 3)))
    labels = np.where(stands, labels, 0)
    chosen = np.flatnonzero(is_unexplained)
    column, row = np.floor((beams.endpoints[chosen] - lattice.low) / CELL_M).astype(np.int64).T
    inside = (column >= 0) & (row >= 0) & (column < lattice.columns) & (row < lattice.rows)
    of = np.where(inside, labels[row.clip(0, lattice.rows - 1), column.clip(0, lattice.columns - 1)], 0)
    found = []
    for label in np.unique(of[of > 0]).tolist():
        cluster = _cluster(semantic_map, faces, logged, solution, chosen[of == label])
        if cluster is not None:
            found.append(cluster)
    return sorted(found, key=lambda c: (-c.size_m[0] * max(c.size_m[1], CELL_M), c.pose))


def guess_class(long_m: float, deep_m: float, sides: int, *, is_at_wall: bool, room_kind: str, z_m: float) -> str:
    """What a thing may be, by its outline at one height and where it stands: a guess, for a person to check."""
    if is_at_wall and room_kind == "restroom" and long_m < 0.9 and deep_m < 0.9:
        return "toilet" if z_m < 0.45 else "sink"
    if long_m > 1.2 and deep_m < 0.3 and sides > 1:
        return "wall"
    if not is_at_wall and long_m < 0.8 and deep_m > 0.6 * long_m:
        return "column"
    return "furniture"


# -------------------------------------------------------------------------------------------- details


def _near(faces: Faces, points: Float64Array, tolerance_m: float) -> BoolArray:
    near = np.zeros(len(points), dtype=np.bool_)
    _touched(faces.everything, np.zeros(1, dtype=np.int64), np.ascontiguousarray(points), tolerance_m, near)
    return near


def _lattice(faces: Faces) -> _Lattice:
    ends = faces.segments.reshape(-1, 2)
    low = ends.min(axis=0) - 1.0
    columns, rows = (int(n) + 1 for n in (ends.max(axis=0) + 1.0 - low) / CELL_M)
    if rows * columns > _CELLS_MAX:
        rows = min(rows, _CELLS_MAX // columns)
    return _Lattice(low, rows, columns)


def _cluster(
    semantic_map: SemanticMap, faces: Faces, logged: Logged, solution: Solution, chosen: Int64Array
) -> Cluster | None:
    """The thing that returns are from; None when it was not met often or long enough."""
    import shapely

    points, views = solution.beams.endpoints[chosen], np.unique(logged.views[chosen])
    over_s = float(np.ptp(logged.stamps_s[views]))
    if len(views) < VIEWS_MIN or over_s < SECONDS_MIN or len(points) < RETURNS_MIN:
        return None
    yaw = _yaw_of(points, faces, solution)
    c, s = np.cos(yaw), np.sin(yaw)
    turned = points @ np.array([[c, -s], [s, c]])
    low, high = np.percentile(turned, _SPAN, axis=0)
    size, middle = high - low, (low + high) / 2
    if size[1] > size[0]:
        size, middle, yaw = size[::-1], np.array([middle[1], -middle[0]]), yaw + np.pi / 2
        c, s = np.cos(yaw), np.sin(yaw)
    x, y = float(c * middle[0] - s * middle[1]), float(s * middle[0] + c * middle[1])
    seen_from = (solution.beams.origins[chosen] - (x, y)) @ np.array([[c, -s], [s, c]]) / np.maximum(size, CELL_M)
    side = np.where(np.abs(seen_from[:, 0]) > np.abs(seen_from[:, 1]), 0, 2) + (
        np.take_along_axis(seen_from, np.argmax(np.abs(seen_from), axis=1)[:, None], axis=1)[:, 0] > 0
    )
    sides = int((np.bincount(side, minlength=4) > 0.1 * len(side)).sum())
    wall, gap_m, normal = _nearest_wall(semantic_map, faces, (x, y))
    is_at_wall = gap_m < size[1] / 2 + _AT_WALL_M
    if is_at_wall:
        # returns near the wall itself count as the wall's: the thing reaches back to it
        axis = int(abs(normal @ (-s, c)) > abs(normal @ (c, s)))
        fill = max(gap_m - size[axis] / 2, 0.0)
        x, y = x - normal[0] * fill / 2, y - normal[1] * fill / 2
        size = size + np.where(np.arange(2) == axis, fill, 0.0)
    kind = next(
        (
            r.kind
            for r in semantic_map.all_rooms
            if r.floor is not None and shapely.Polygon(r.floor).contains(shapely.Point(x, y))
        ),
        "",
    )
    guess = guess_class(float(size[0]), float(size[1]), sides, is_at_wall=is_at_wall, room_kind=kind, z_m=faces.z_m)
    yaw = float((yaw + np.pi / 2) % np.pi - np.pi / 2)
    return Cluster(
        pose=(x, y, yaw),
        size_m=(float(size[0]), float(size[1])),
        views=len(views),
        returns=len(points),
        seen_over_s=over_s,
        sides=sides,
        wall=wall if is_at_wall else "",
        room_kind=kind,
        class_name=guess,
    )


def _yaw_of(points: Float64Array, faces: Faces, solution: Solution) -> float:
    """Heading of the smallest rectangle around the points; of the nearest face, when that is as good within 5 degrees."""
    import shapely

    hull = shapely.MultiPoint(points).convex_hull
    if hull.geom_type != "Polygon":
        along = points.max(axis=0) - points.min(axis=0)
        return float(np.arctan2(along[1], along[0]))
    ring = shapely.get_coordinates(hull)
    headings = np.arctan2(*np.diff(ring, axis=0).T[::-1])
    face = np.argmin(np.abs(np.sum((points.mean(axis=0) - faces.face_points) * faces.face_normals, axis=1)))
    walls = np.arctan2(faces.face_normals[:, 1], faces.face_normals[:, 0])
    headings = np.concatenate([headings, walls[face : face + 1]])
    areas = []
    for heading in headings:
        c, s = np.cos(heading), np.sin(heading)
        low, high = np.percentile(points @ np.array([[c, -s], [s, c]]), _SPAN, axis=0)
        areas.append(float(np.prod(np.maximum(high - low, 0.02))))
    best = int(np.argmin(areas))
    return float(headings[-1] if areas[-1] < 1.15 * areas[best] else headings[best])


def _nearest_wall(semantic_map: SemanticMap, faces: Faces, at: tuple[float, float]) -> tuple[str, float, Float64Array]:
    """The nearest link of structure, how far its surface is, and its normal; "" and infinity without any."""
    infos = [semantic_map.class_of(name) for name in faces.names]
    is_structure = np.array([info is not None and info.mount == "structure" for info in infos])[faces.links]
    if not is_structure.any():
        return "", np.inf, np.array([1.0, 0.0])
    start, along = faces.segments[:, :2], faces.segments[:, 2:] - faces.segments[:, :2]
    share = np.sum((np.array(at) - start) * along, axis=1) / np.maximum(np.sum(along**2, axis=1), 1e-12)
    away = np.hypot(*(np.array(at) - start - np.clip(share, 0.0, 1.0)[:, None] * along).T)
    nearest = int(np.argmin(np.where(is_structure, away, np.inf)))
    return faces.names[faces.links[nearest]], float(away[nearest]), faces.normals[nearest]


@njit(cache=True, nogil=True)
def _touched(sight: Any, labels: Any, points: Any, tolerance: Any, out: Any) -> None:
    for i in range(len(points)):
        out[i] = touches(sight, labels, -1, points[i, 0], points[i, 1], tolerance)


@njit(cache=True, nogil=True)
def _tally(
    origins: Any,
    directions: Any,
    ranges: Any,
    is_return: Any,
    is_unexplained: Any,
    views: Any,
    x0: Any,
    y0: Any,
    cell: Any,
    rows: Any,
    columns: Any,
) -> Any:
    """(hits, passes) (H, W): views with an unexplained return in a cell, and views that looked through it."""
    hits, passes = np.zeros((rows, columns), np.int32), np.zeros((rows, columns), np.int32)
    hit_view, pass_view = np.full((rows, columns), -1, np.int64), np.full((rows, columns), -1, np.int64)
    # the grid is only walked where it has an unexplained return at all
    asked = np.zeros((rows, columns), np.bool_)
    for b in range(len(views)):
        if is_unexplained[b]:
            x, y = origins[b, 0] + ranges[b] * directions[b, 0], origins[b, 1] + ranges[b] * directions[b, 1]
            column, row = int(np.floor((x - x0) / cell)), int(np.floor((y - y0) / cell))
            if 0 <= row < rows and 0 <= column < columns:
                asked[row, column] = True
                if hit_view[row, column] != views[b]:
                    hit_view[row, column] = views[b]
                    hits[row, column] += 1
    start = 0
    hit_view[:] = -1
    while start < len(views):
        end = start
        while end < len(views) and views[end] == views[start]:
            if is_return[end]:
                x, y = (
                    origins[end, 0] + ranges[end] * directions[end, 0],
                    origins[end, 1] + ranges[end] * directions[end, 1],
                )
                column, row = int(np.floor((x - x0) / cell)), int(np.floor((y - y0) / cell))
                if 0 <= row < rows and 0 <= column < columns:
                    hit_view[row, column] = views[start]
            end += 1
        for b in range(start, end):
            step, r = 0.5 * cell, 0.0
            while r < ranges[b] - _SHY_M:
                x, y = origins[b, 0] + r * directions[b, 0], origins[b, 1] + r * directions[b, 1]
                column, row = int(np.floor((x - x0) / cell)), int(np.floor((y - y0) / cell))
                r += step
                if row < 0 or row >= rows or column < 0 or column >= columns or not asked[row, column]:
                    continue
                if hit_view[row, column] != views[start] and pass_view[row, column] != views[start]:
                    pass_view[row, column] = views[start]
                    passes[row, column] += 1
        start = end
    return hits, passes
