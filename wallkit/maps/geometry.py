"""Shapes of the links -> solid parts placed in the map, and what a horizontal plane cuts of them.

Every part is convex. A box is its eight corners, a cylinder a prism of 32 sides inside the true circle (0.5 % of the radius
at most), a sphere a disc at every height. Meshes have no part: the map's geometry does not wait for files that may be
missing, and the rules name them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from wallkit.core.types import Float64Array, Int64Array
from wallkit.maps.model import SemanticMap
from wallkit.maps.nouns import Shape

if TYPE_CHECKING:
    from shapely import Geometry, Polygon

CYLINDER_SIDES = 32
# a plane this close to a corner goes through it
_TOUCH_M = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """One collision shape standing in the map.

    Attributes:
        link, class_name: whose it is. name: of the collision, or "link#2" for its second shape when it has none.
        T_map_shape: (4, 4), the shape's centre.
        corners: (C, 3) in the map frame: 8 of a box; 64 of a cylinder (lower rim, then upper); 6 extreme points of a sphere.
        footprint: the polygon that the part covers, seen from above.
        z_m: (lowest, highest) in the map frame.
        is_upright: its cut is the footprint at every height it reaches.
    """

    link: str
    class_name: str
    name: str
    shape: Shape
    T_map_shape: Float64Array
    corners: Float64Array
    footprint: Polygon
    z_m: tuple[float, float]
    is_upright: bool

    def is_cut_by(self, z_m: float) -> bool:
        """Whether a plane goes through it: from its bottom up to, but without, its top, so that stacked boxes count once."""
        return self.z_m[0] <= z_m < self.z_m[1]

    def cut(self, z_m: float) -> Polygon:
        """The polygon a horizontal plane cuts out of it; empty when the plane misses it or only touches an edge."""
        from shapely import MultiPoint, Point, Polygon

        if not self.is_cut_by(z_m):
            return Polygon()
        if self.is_upright:
            return self.footprint
        if self.shape.kind == "sphere":
            x, y, z = self.T_map_shape[:3, 3]
            radius = float(np.sqrt(max(self.shape.size[0] ** 2 - (z_m - z) ** 2, 0.0)))
            return Point(x, y).buffer(radius, quad_segs=CYLINDER_SIDES // 4)
        hull = MultiPoint(_plane_cut(self.corners, _edges_of(self.shape), z_m)).convex_hull
        return hull if isinstance(hull, Polygon) else Polygon()


@dataclass(frozen=True)
class Slice:
    """What a horizontal plane cuts.

    Attributes:
        parts: the parts cut, in the map's order. polygons: their cuts, alike.
    """

    z_m: float
    parts: tuple[Part, ...]
    polygons: tuple[Polygon, ...]

    @cached_property
    def solid(self) -> Geometry:
        """All cuts as one geometry."""
        import shapely

        return shapely.union_all(list(self.polygons))

    @cached_property
    def _outlines(self) -> tuple[Float64Array, Int64Array]:
        import shapely

        rings = shapely.get_exterior_ring(np.array(self.polygons, dtype=object))
        points, ring = shapely.get_coordinates(rings, return_index=True)
        same = ring[1:] == ring[:-1]
        return np.hstack([points[:-1], points[1:]])[same], ring[:-1][same].astype(np.int64)

    @property
    def segments(self) -> Float64Array:
        """(S, 4) x0, y0, x1, y1 of every edge of every cut, in metres in the map frame."""
        return self._outlines[0]

    @property
    def part_of_segment(self) -> Int64Array:
        """(S,) index into `parts`."""
        return self._outlines[1]

    @property
    def owners(self) -> list[str]:
        """Link of every segment."""
        return [self.parts[index].link for index in self.part_of_segment]

    @property
    def classes(self) -> list[str]:
        """Class of every segment."""
        return [self.parts[index].class_name for index in self.part_of_segment]

    def by_link(self) -> dict[str, Geometry]:
        """The cut of every link that the plane meets."""
        return self._grouped([part.link for part in self.parts])

    def by_class(self) -> dict[str, Geometry]:
        """The cut of every class that the plane meets."""
        return self._grouped([part.class_name for part in self.parts])

    def _grouped(self, keys: Sequence[str]) -> dict[str, Geometry]:
        import shapely

        groups: dict[str, list[Polygon]] = {}
        for key, polygon in zip(keys, self.polygons, strict=True):
            groups.setdefault(key, []).append(polygon)
        return {key: shapely.union_all(polygons) for key, polygons in groups.items()}


def parts(
    semantic_map: SemanticMap,
    joint_states: Mapping[str, float] | None = None,
    *,
    poses: Mapping[str, Float64Array] | None = None,
) -> list[Part]:
    """Every box, cylinder and sphere of the map, placed; in document order.

    Args:
        joint_states: as for `SemanticMap.poses`, which is asked unless `poses` are at hand.

    Shapes without finite numbers or with a size that is not positive, meshes, and links that hang on nothing are left out:
    the rules name them.
    """
    import shapely

    placed = semantic_map.poses(joint_states) if poses is None else poses
    found = []
    for link in semantic_map.links.values():
        if link.name not in placed:
            continue
        for number, shape in enumerate(link.shapes, start=1):
            if shape.kind != "mesh" and np.all(shape.size > 0) and np.all(np.isfinite(shape.size)):
                found.append((link, shape, shape.name or f"{link.name}#{number}", placed[link.name]))
    if not found:
        return []
    T_map_shape = np.array([pose for *_, pose in found]) @ np.array([shape.T_link_shape for _, shape, *_ in found])
    # what hangs on numbers that cannot be read has no place
    is_placed = np.isfinite(T_map_shape).all(axis=(1, 2))
    if not is_placed.any():
        return []
    T_map_shape, found = T_map_shape[is_placed], [one for one, ok in zip(found, is_placed, strict=True) if ok]
    corners = [
        _corners_of(shape) @ T[:3, :3].T + T[:3, 3] for (_, shape, *_), T in zip(found, T_map_shape, strict=True)
    ]
    rings, is_upright = [], []
    for (_, shape, *_), T, points in zip(found, T_map_shape, corners, strict=True):
        upright = bool(shape.kind != "sphere" and abs(T[2, 2]) > 1.0 - 1e-12)
        is_upright.append(upright)
        rings.append(_floor_points(shape, T, points, is_upright=upright))
    footprints = shapely.convex_hull(_multipoints(rings))
    placed_parts = []
    for (link, shape, name, _), T, points, footprint, upright in zip(
        found, T_map_shape, corners, footprints, is_upright, strict=True
    ):
        if np.all(np.isfinite(points)):
            z = (float(points[:, 2].min()), float(points[:, 2].max()))
            placed_parts.append(Part(link.name, link.class_name, name, shape, T, points, footprint, z, upright))
    return placed_parts


def slice_parts(solids: Iterable[Part], z_m: float) -> Slice:
    """What the plane z cuts of parts that are already placed."""
    cut = [(part, part.cut(z_m)) for part in solids if part.is_cut_by(z_m)]
    cut = [(part, polygon) for part, polygon in cut if not polygon.is_empty]
    return Slice(z_m, tuple(part for part, _ in cut), tuple(polygon for _, polygon in cut))


def slice_at(semantic_map: SemanticMap, z_m: float, joint_states: Mapping[str, float] | None = None) -> Slice:
    """What the plane z cuts of the map at given joint states (at rest without)."""
    return slice_parts(parts(semantic_map, joint_states), z_m)


# -------------------------------------------------------------------------------------------- details

_BOX = np.array([[x, y, z] for z in (-0.5, 0.5) for x, y in ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5))])
_TURNS = np.arange(CYLINDER_SIDES) * (2 * np.pi / CYLINDER_SIDES)
_RIM = np.column_stack([np.cos(_TURNS), np.sin(_TURNS)])
_AXES = np.vstack([np.eye(3), -np.eye(3)])


def _corners_of(shape: Shape) -> Float64Array:
    """Corners (C, 3) in the shape's own frame."""
    if shape.kind == "box":
        return np.asarray(_BOX * shape.size)
    if shape.kind == "sphere":
        return np.asarray(_AXES * shape.size[0])
    rim = np.tile(_RIM * shape.size[0], (2, 1))
    heights = np.repeat([-0.5, 0.5], CYLINDER_SIDES) * shape.size[1]
    return np.column_stack([rim, heights])


def _edges_of(shape: Shape) -> Int64Array:
    """(E, 2) indices into the corners of a prism whose lower rim comes first."""
    sides = 4 if shape.kind == "box" else CYLINDER_SIDES
    lower = np.arange(sides)
    following = np.roll(lower, -1)
    return np.vstack(
        [
            np.column_stack([lower, following]),
            np.column_stack([lower + sides, following + sides]),
            np.column_stack([lower, lower + sides]),
        ]
    )


def _plane_cut(corners: Float64Array, edges: Int64Array, z_m: float) -> Float64Array:
    """Points (K, 2) where a plane meets the edges, with the corners that lie in it."""
    a, b = corners[edges[:, 0]], corners[edges[:, 1]]
    below, above = a[:, 2] - z_m, b[:, 2] - z_m
    crosses = below * above < 0
    share = below[crosses] / (below[crosses] - above[crosses])
    crossing = a[crosses, :2] + share[:, None] * (b[crosses, :2] - a[crosses, :2])
    return np.vstack([crossing, corners[np.abs(corners[:, 2] - z_m) <= _TOUCH_M, :2]])


def _floor_points(shape: Shape, T: Float64Array, points: Float64Array, *, is_upright: bool) -> Float64Array:
    """Points (K, 2) whose convex hull is the footprint."""
    if shape.kind == "sphere":
        return np.asarray(_RIM * shape.size[0] + T[:2, 3])
    return points[: len(points) // 2, :2] if is_upright else points[:, :2]


def _multipoints(groups: list[Float64Array]) -> np.ndarray:
    import shapely

    index = np.repeat(np.arange(len(groups)), [len(group) for group in groups])
    return np.asarray(shapely.multipoints(shapely.points(np.vstack(groups)), indices=index))
