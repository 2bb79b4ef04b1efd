"""A world -> the floor that a walker or a robot of some size can use, and ways on it from place to place."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wallkit.core.types import BoolArray, Float64Array, Int64Array
from wallkit.errors import SimulationError
from wallkit.simulate.meshes import corners_of
from wallkit.simulate.world import MAP, Solid, World

CELL_M = 0.1
# what stands between these heights is in the way
_BAND_M = (0.03, 1.8)
_MARGIN_M = 0.5


@dataclass(frozen=True, eq=False)
class Floor:
    """Floor as cells: clearance_m (H, W) from a cell's centre to the nearest obstacle; origin (2,) of the corner cell."""

    clearance_m: Float64Array
    origin: Float64Array
    is_inside: BoolArray
    source: str = ""

    def cells_of(self, points: Float64Array) -> Int64Array:
        """(..., 2) row, column of points (..., 2)."""
        cells = np.floor((np.asarray(points) - self.origin) / CELL_M).astype(np.int64)[..., ::-1]
        return np.clip(cells, 0, np.array(self.clearance_m.shape) - 1)

    def clearance_at(self, points: Float64Array) -> Float64Array:
        """(...,) [m] distance of points (..., 2) to the nearest obstacle, to within a cell; 0 beyond the map."""
        points = np.asarray(points, dtype=np.float64)
        high = self.origin + np.array(self.clearance_m.shape[::-1]) * CELL_M
        row, column = np.moveaxis(self.cells_of(points), -1, 0)
        is_on = ((points >= self.origin) & (points <= high)).all(axis=-1)
        return np.where(is_on, self.clearance_m[row, column], 0.0)

    def free_points(self, radius_m: float) -> Float64Array:
        """(P, 2) centres of the largest region of cells inside that something of that radius can go about in."""
        from scipy.ndimage import label

        usable = (self.clearance_m > radius_m) & self.is_inside
        regions, _ = label(usable)
        sizes = np.bincount(regions.ravel())
        sizes[0] = 0
        row, column = np.nonzero(usable & (regions == int(np.argmax(sizes))))
        return self.origin + (np.column_stack([column, row]) + 0.5) * CELL_M

    def way(self, start: Sequence[float], end: Sequence[float], radius_m: float) -> Float64Array:
        """(W, 2) corners of a short way that keeps its distance from obstacles, both ends included.

        Raises:
            SimulationError: an end is too near to an obstacle, or there is no way.
        """
        from scipy.sparse.csgraph import dijkstra

        ends = np.array([start, end], dtype=np.float64)
        for name, point, clear in zip(("begins", "ends"), ends, self.clearance_at(ends), strict=True):
            if clear <= radius_m - CELL_M:
                x, y = point
                raise SimulationError(
                    f"a way {name} at {x:.2f} {y:.2f}, {max(clear, 0):.2f} m from an obstacle",
                    where=self.source,
                    hint=f"something of radius {radius_m:g} m needs a place with more room",
                )
        graph, numbers = self._graph(radius_m, ends)
        first, last = (int(numbers[tuple(cell)]) for cell in self.cells_of(ends))
        distances, before = dijkstra(graph, indices=first, return_predecessors=True)
        if not np.isfinite(distances[last]):
            (x0, y0), (x1, y1) = ends
            raise SimulationError(
                f"there is no way from {x0:.2f} {y0:.2f} to {x1:.2f} {y1:.2f} for a radius of {radius_m:g} m",
                where=self.source,
                hint="open a door in the scenario, or choose another waypoint",
            )
        steps = [last]
        while steps[-1] != first:
            steps.append(int(before[steps[-1]]))
        cells = np.argwhere(numbers >= 0)[steps[::-1]]
        centres = self.origin + (cells[:, ::-1] + 0.5) * CELL_M
        return self._shortened(np.vstack([ends[:1], centres[1:-1], ends[1:]]), radius_m)

    def _graph(self, radius_m: float, ends: Float64Array):  # type: ignore[no-untyped-def]
        """Steps to the eight neighbours among usable cells, dearer near obstacles; (H, W) numbers of the cells."""
        from scipy.sparse import coo_array

        usable = self.clearance_m > radius_m
        for row, column in self.cells_of(ends):
            usable[row, column] = True
        numbers = np.where(usable, np.cumsum(usable.ravel()).reshape(usable.shape) - 1, -1)
        price = 1.0 + 0.5 / np.maximum(self.clearance_m - radius_m + CELL_M, CELL_M)
        rows, columns, costs = [], [], []
        for dr, dc in ((0, 1), (1, 0), (1, 1), (1, -1)):
            a = numbers[: -dr or None, max(-dc, 0) : -dc if dc > 0 else None]
            b = numbers[dr:, max(dc, 0) : dc if dc < 0 else None]
            ok = (a >= 0) & (b >= 0)
            pa = price[: -dr or None, max(-dc, 0) : -dc if dc > 0 else None][ok]
            pb = price[dr:, max(dc, 0) : dc if dc < 0 else None][ok]
            rows.append(a[ok])
            columns.append(b[ok])
            costs.append(np.hypot(dr, dc) * (pa + pb) / 2)
        r, c, w = np.concatenate(rows), np.concatenate(columns), np.concatenate(costs)
        count = int(usable.sum())
        both = (np.concatenate([r, c]), np.concatenate([c, r]))
        return coo_array((np.concatenate([w, w]), both), shape=(count, count)).tocsr(), numbers

    def _shortened(self, points: Float64Array, radius_m: float) -> Float64Array:
        """The way with every corner left out that can be, as a string is pulled tight."""
        kept, at = [0], 0
        comfort = radius_m + 0.05
        while at < len(points) - 1:
            ahead = len(points) - 1
            while ahead > at + 1 and not self._is_clear(points[at], points[ahead], comfort):
                ahead -= 1
            kept.append(ahead)
            at = ahead
        return points[kept]

    def _is_clear(self, a: Float64Array, b: Float64Array, radius_m: float) -> bool:
        count = max(2, int(np.hypot(*(b - a)) / (CELL_M / 2)))
        line = a + np.linspace(0, 1, count)[:, None] * (b - a)
        return bool((self.clearance_at(line) > radius_m).all())

    @cached_property
    def area_m2(self) -> float:
        """Of the free floor inside."""
        return float(((self.clearance_m > 0) & self.is_inside).sum() * CELL_M**2)


def floor_of(world: World, states: Mapping[str, float] | None = None, *, with_doors: bool = True) -> Floor:
    """The floor between everything that stands in the world, doors at given states or left out."""
    import cv2

    poses = {MAP: np.eye(4), **world.poses(states)}
    fixed = [solid for solid in world.solids if solid.body == MAP or (with_doors and solid.body in poses)]
    outlines = [outline for solid in fixed if (outline := _outline(solid, poses[solid.body])) is not None]
    low, high = _bounds(world, outlines)
    width, height = np.ceil((high - low) / CELL_M).astype(int)
    # drawn four times as fine, so that what is thinner than a cell still stands
    fine = 4
    canvas = np.full((int(height) * fine, int(width) * fine), 255, dtype=np.uint8)
    for outline in outlines:
        cv2.fillConvexPoly(canvas, np.round((outline - low) / CELL_M * fine - 0.5).astype(np.int32), 0)
    distance = cv2.distanceTransform(canvas, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) * (CELL_M / fine)
    clearance = distance[fine // 2 :: fine, fine // 2 :: fine].astype(np.float64)
    return Floor(clearance, low, _inside(world, low, clearance.shape), world.source)


# -------------------------------------------------------------------------------------------- details


def _outline(solid: Solid, T_map_body: Float64Array) -> Float64Array | None:
    """(C, 2) convex outline seen from above of what is in the way; None of what is not."""
    import cv2

    corners = (T_map_body @ solid.T_body_solid @ corners_of(solid).T).T[:, :3]
    if corners[:, 2].max() < _BAND_M[0] or corners[:, 2].min() > _BAND_M[1]:
        return None
    hull = cv2.convexHull(corners[:, :2].astype(np.float32))
    return np.asarray(hull[:, 0], dtype=np.float64)


def _bounds(world: World, outlines: list[Float64Array]) -> tuple[Float64Array, Float64Array]:
    points = np.concatenate([*outlines, *(np.array(room.floor) for room in world.rooms), world.extent])
    return points.min(axis=0) - _MARGIN_M, points.max(axis=0) + _MARGIN_M


def _inside(world: World, low: Float64Array, shape: tuple[int, ...]) -> BoolArray:
    """Cells on some room's floor; without rooms all of them."""
    import cv2

    canvas = np.zeros(shape, dtype=np.uint8)
    for room in world.rooms:
        corners = np.round((np.array(room.floor) - low) / CELL_M - 0.5).astype(np.int32)
        cv2.fillPoly(canvas, [corners], 1)
    return canvas.astype(bool) if world.rooms else np.ones(shape, dtype=bool)
