"""A semantic map and a height -> the surfaces that a LiDAR there can meet from inside, and how likely each answers.

A wall's interior, the face it turns away from the rooms, and what hangs flush against it are never seen, and a likelihood
field that contains them draws endpoints into the wall (Beluga #265). So every edge of the slice is cut where it runs inside
another solid, and kept where it looks onto floor that walls enclose.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from wallkit.core.types import BoolArray, Float64Array
from wallkit.errors import MapError
from wallkit.maps.classes import RESTROOM_V1, ClassInfo, Lidar
from wallkit.maps.geometry import Part, Slice, parts, slice_parts
from wallkit.maps.model import SemanticMap
from wallkit.maps.nouns import Joint
from wallkit.maps.sight import Sight, cast_beams, index_segments
from wallkit.maps.space import PASSAGE_M

if TYPE_CHECKING:
    from shapely import Geometry, Polygon

# p_return of a class that does not say its own: a mirror shows something else, "none" is never met, perforated as glass
_GLASS_P_RETURN = RESTROOM_V1["glass"].p_return or 0.0
P_RETURN: Mapping[Lidar, float] = {
    "opaque": 1.0,
    "glass": _GLASS_P_RETURN,
    "perforated": _GLASS_P_RETURN,
    "mirror": 0.0,
    "none": 0.0,
}
# a place is indoors when so many of the directions end at something: 100 % in a closed room, 50 % before a facade, 75 % in
# the corner of two; what is between is a room with a wide way out, or with walls that a mapper left open
INDOORS_SHARE = 0.8
_DIRECTIONS: Float64Array = np.linspace(0.0, 2 * np.pi, 32, endpoint=False)
_INDOORS_REACH_M = 50.0
# an enclosed region without a door or a declared room is a shaft unless it is larger
_SHAFT_M2 = 1.0
_LATTICE_M = 0.5
_PIECE_M = 0.25
_BESIDE_M = PASSAGE_M / 2
_ROUNDING_M = 1e-6


@dataclass(frozen=True, eq=False)
class Surfaces:
    """What a LiDAR at one height can meet.

    Attributes:
        segments: (S, 4) float64 x0, y0, x1, y1 [m] in frame map.
        p_return: (S,) probability that a beam on the surface comes back from it.
        p_there: (S,) probability that the surface is where it is drawn: 1, but for doors.
        classes: (S,) class names.
    """

    segments: Float64Array
    p_return: Float64Array
    p_there: Float64Array
    classes: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Floor:
    """Where a robot may be.

    Attributes:
        cut: the slice with closed doors. regions: enclosed floor. outside: floor that reaches around the building.
        rooms: declared floors. sight: the edges of the slice, for asking what walls enclose.
        indoors_share: how enclosed a place outside the regions must be; 0 when nothing in the map is enclosed.
    """

    cut: Slice
    regions: tuple[Polygon, ...]
    outside: tuple[Polygon, ...]
    rooms: tuple[Polygon, ...]
    sight: Sight
    indoors_share: float

    def holds(self, points_m: Float64Array) -> BoolArray:
        """Whether points (K, 2) of frame map lie on floor that a robot may be on."""
        held = _within(self.regions, points_m)
        open_air = np.flatnonzero(~held & _within(self.outside, points_m))
        declared = _within(self.rooms, points_m[open_air])
        asked = open_air[~declared]
        held[open_air[declared]] = True
        held[asked] = enclosure(self.sight, points_m[asked]) >= self.indoors_share
        return held


@dataclass(frozen=True, slots=True)
class _Stand:
    """Parts that stand together, with the probability that they do, among solids that may cover them."""

    parts: tuple[Part, ...]
    polygons: tuple[Polygon, ...]
    p_there: float
    covered_by: Geometry


def floor_at(semantic_map: SemanticMap, z_m: float) -> Floor:
    """The floor between what a plane cuts, doors closed.

    Raises:
        MapError: the plane cuts nothing.
    """
    import shapely

    cut = slice_parts(parts(semantic_map, semantic_map.door_states("closed")), z_m)
    if not cut.polygons:
        raise MapError(
            f"nothing of the map is cut at {z_m:g} m, the LiDAR's height",
            where=semantic_map.source,
            hint=_heights_hint(semantic_map),
        )
    declared = [shapely.Polygon(room.floor) for room in semantic_map.all_rooms if room.floor is not None]
    rooms = tuple(p for p in shapely.get_parts(shapely.make_valid(declared)) if p.geom_type == "Polygon")
    leaves = [polygon for part, polygon in zip(cut.parts, cut.polygons, strict=True) if part.class_name == "door"]
    near = shapely.union_all([*rooms, *shapely.buffer(np.array(leaves, dtype=object), 2 * PASSAGE_M)])
    outside, enclosed = _floor_between(cut)
    regions = tuple(
        region for region in enclosed if region.intersects(near) or (not rooms and region.area >= _SHAFT_M2)
    )
    shapely.prepare([*rooms, *regions, *outside])
    floor = Floor(cut, regions, outside, rooms, index_segments(cut.segments), INDOORS_SHARE)
    if not regions and not rooms and floor.holds(_lattice(cut)).sum() * _LATTICE_M**2 < _SHAFT_M2:
        return Floor(cut, regions, outside, rooms, floor.sight, 0.0)
    return floor


def surfaces_at(semantic_map: SemanticMap, floor: Floor) -> Surfaces:
    """Every surface that is seen from the floor, doors at every state their prior names.

    A leaf without a prior stands at rest. Of a prior's states, "closed", "open" and "rest" are places; the others
    ("unknown") are none, so their share belongs to no surface.

    Raises:
        MapError: nothing that returns beams is seen from the floor.
    """
    import shapely

    found: list[tuple[Float64Array, Float64Array, float, float, str]] = []
    for stand in _stands(semantic_map, floor.cut.z_m):
        shapely.prepare(stand.covered_by)
        for part, polygon in zip(stand.parts, stand.polygons, strict=True):
            p = p_return_of(semantic_map.class_of(part.link))
            if p > 0.0:
                pieces, beside = _exposed_pieces(polygon, stand.covered_by)
                found.append((pieces, beside, p, stand.p_there, part.class_name or "unknown"))
    seen = floor.holds(np.vstack([np.zeros((0, 2)), *(beside for _, beside, *_ in found)]))
    if not seen.any():
        raise MapError(
            f"at {floor.cut.z_m:g} m the LiDAR meets nothing that returns a beam",
            where=semantic_map.source,
            hint=f"everything there is glass or mirror, or covered: `wallkit map validate {semantic_map.source}`",
        )
    of_part = np.repeat(np.arange(len(found)), [len(pieces) for pieces, *_ in found])[seen]
    return Surfaces(
        segments=np.vstack([pieces for pieces, *_ in found])[seen],
        p_return=np.array([p for _, _, p, _, _ in found])[of_part],
        p_there=np.array([p for _, _, _, p, _ in found])[of_part],
        classes=tuple(found[index][4] for index in of_part.tolist()),
    )


def enclosure(sight: Sight, points_m: Float64Array) -> Float64Array:
    """Share (K,) of the directions around points (K, 2) in which something stands."""
    poses = np.column_stack([points_m, np.zeros(len(points_m))])
    ranges_m = cast_beams(sight, poses, _DIRECTIONS, range_max_m=_INDOORS_REACH_M).ranges_m
    return np.asarray(np.isfinite(ranges_m).mean(axis=1))


def p_return_of(info: ClassInfo | None) -> float:
    """Probability that a beam on a thing of a class comes back from it; a thing of no class is opaque."""
    if info is None:
        return 1.0
    return P_RETURN[info.lidar] if info.p_return is None else info.p_return


def door_alternatives(joint: Joint) -> dict[float, float]:
    """Joint states a door may stand at, with their probabilities; what the prior leaves over is nowhere in particular."""
    prior = joint.state.prior if joint.state is not None else None
    if not prior:
        return {joint.rest: 1.0}
    places = {"closed": joint.closed, "open": joint.open, "rest": joint.rest}
    states: dict[float, float] = {}
    for name, probability in prior.items():
        if name in places and probability > 0:
            states[places[name]] = states.get(places[name], 0.0) + probability
    return states


# -------------------------------------------------------------------------------------------- details


def _stands(semantic_map: SemanticMap, z_m: float) -> Iterator[_Stand]:
    """What never moves, then every door at each of its states; leaves that follow a door stand with it."""
    import shapely

    followers: dict[str, set[str]] = {}
    for joint in semantic_map.doors:
        followers.setdefault(_leader(semantic_map, joint), set()).update(semantic_map.subtree(joint.child))
    leaves = set().union(*followers.values())
    fixed = slice_parts([part for part in parts(semantic_map) if part.link not in leaves], z_m)
    covered = _closed_up(fixed.polygons)
    yield _Stand(fixed.parts, fixed.polygons, 1.0, covered)
    for leader, links in followers.items():
        for state, probability in door_alternatives(semantic_map.joints[leader]).items():
            poses = semantic_map.poses({leader: state})
            leaf = parts(semantic_map, poses={link: T for link, T in poses.items() if link in links})
            cut = slice_parts(leaf, z_m)
            own = _closed_up(cut.polygons)
            yield _Stand(cut.parts, cut.polygons, probability, shapely.union(covered, own))


def _leader(semantic_map: SemanticMap, joint: Joint) -> str:
    """The joint at the end of the chain of mimics; the rules refuse rings (WK-G)."""
    while joint.mimic is not None and joint.mimic.joint in semantic_map.joints:
        joint = semantic_map.joints[joint.mimic.joint]
    return joint.name


def _closed_up(polygons: Sequence[Polygon]) -> Geometry:
    """The solids with the chinks between them filled, a rounding error smaller: edges that stay outside are exposed."""
    import shapely

    grown = shapely.union_all(shapely.buffer(np.array(polygons, dtype=object), _BESIDE_M, join_style="mitre"))
    return grown.buffer(-_BESIDE_M - _ROUNDING_M, join_style="mitre")


def _exposed_pieces(polygon: Polygon, covered_by: Geometry) -> tuple[Float64Array, Float64Array]:
    """Short pieces (S, 4) of a convex polygon's outline outside of what covers it, and a point (S, 2) just before each."""
    import shapely

    outline = polygon.exterior
    exposed = outline.difference(covered_by) if covered_by.intersects(outline) else outline
    lines = shapely.segmentize(shapely.get_parts(exposed), _PIECE_M)
    points, line = shapely.get_coordinates(lines, return_index=True)
    same = line[1:] == line[:-1]
    pieces = np.hstack([points[:-1], points[1:]])[same]
    pieces = pieces[np.hypot(*(pieces[:, 2:] - pieces[:, :2]).T) > 2 * _ROUNDING_M]
    middle, along = (pieces[:, :2] + pieces[:, 2:]) / 2, pieces[:, 2:] - pieces[:, :2]
    across = np.column_stack([-along[:, 1], along[:, 0]]) / np.hypot(*along.T)[:, None]
    centre = np.array(polygon.centroid.coords[0])
    outward = np.where(np.sum(across * (middle - centre), axis=1) >= 0, 1.0, -1.0)
    return pieces, middle + across * (outward * _BESIDE_M)[:, None]


def _within(polygons: Sequence[Polygon], points_m: Float64Array) -> BoolArray:
    import shapely

    inside = np.zeros(len(points_m), dtype=np.bool_)
    x, y = points_m.T
    for polygon in polygons:
        left, bottom, right, top = polygon.bounds
        near = np.flatnonzero((x > left) & (x < right) & (y > bottom) & (y < top) & ~inside)
        inside[near] = shapely.contains_xy(polygon, x[near], y[near])
    return inside


def _floor_between(cut: Slice) -> tuple[tuple[Polygon, ...], tuple[Polygon, ...]]:
    """Floor that reaches around the building, and floor that is enclosed.

    Unlike `free_space`, a chink joins what it connects: of what leaks, the directions tell whether it is indoors.
    """
    import shapely

    frame = shapely.box(*cut.solid.bounds).buffer(1.0, join_style="mitre")
    pieces = shapely.get_parts(frame.difference(cut.solid))
    is_outside = shapely.intersects(pieces, frame.exterior)
    return tuple(pieces[is_outside]), tuple(pieces[~is_outside])


def _lattice(cut: Slice) -> Float64Array:
    """Points (K, 2) all over the extent of a slice."""
    ends = cut.segments.reshape(-1, 2)
    low, high = ends.min(axis=0) + _LATTICE_M / 2, ends.max(axis=0)
    axes = [np.arange(low[axis], high[axis], _LATTICE_M) for axis in (0, 1)]
    x, y = np.meshgrid(*axes)
    return np.column_stack([x.ravel(), y.ravel()])


def _heights_hint(semantic_map: SemanticMap) -> str:
    reached = [part.z_m for part in parts(semantic_map)]
    if not reached:
        return "the map has no boxes, cylinders or spheres: meshes are not drawn"
    low, high = min(z[0] for z in reached), max(z[1] for z in reached)
    return f"its solids reach from {math.floor(low * 100) / 100:g} to {high:.2f} m: --set maps.scan_plane_m=HEIGHT"
