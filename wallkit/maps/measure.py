"""Two things of a map -> how far they are apart: frames, nearest surfaces, clear width, angle; and how large one is."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Literal

import numpy as np

from wallkit.core.types import Float64Array
from wallkit.errors import MapError, closest
from wallkit.maps.geometry import parts
from wallkit.maps.model import SemanticMap
from wallkit.maps.nouns import Opening, Room
from wallkit.maps.numbers import numbers_from_text
from wallkit.maps.space import door_sweep

if TYPE_CHECKING:
    from shapely import Geometry

Kind = Literal["point", "link", "opening", "room"]
# things whose directions differ by less face each other
PARALLEL_RAD = math.radians(1.0)
# what stands open in front of an opening by no more narrows it
_BESIDE_M = 0.05


@dataclass(frozen=True, eq=False)
class Thing:
    """Something that can be measured.

    Attributes:
        at: (3,) its frame's origin, the point itself, the middle of an opening or of a room's floor.
        yaw_rad: where its +x points, or None. shape: what it covers, seen from above. z_m: (lowest, highest).
    """

    kind: Kind
    name: str
    at: Float64Array
    yaw_rad: float | None
    shape: Geometry
    z_m: tuple[float, float]


@dataclass(frozen=True, slots=True)
class Measurement:
    """How two things lie to each other.

    Attributes:
        frames_m: between their frames. by_m: (dx, dy, dz) from the first to the second.
        surfaces_m: between what they cover, seen from above; 0 when they touch. points_m: the nearest two, (x, y).
        over_m: how much air is between them vertically; 0 when they share some height.
        clear_m: between two that lie parallel and face each other, else None. facing_m: along how much they do.
        angle_rad: from the first's +x to the second's, in (-pi, pi]; None where one has no direction.
    """

    a: str
    b: str
    frames_m: float
    by_m: tuple[float, float, float]
    surfaces_m: float
    points_m: tuple[tuple[float, float], tuple[float, float]]
    over_m: float
    clear_m: float | None
    facing_m: float | None
    angle_rad: float | None


@dataclass(frozen=True, slots=True)
class Extent:
    """How large one thing is.

    Attributes:
        size_m: (along its +x, across, high); of a room the longer and the shorter side of the smallest rectangle around it.
        area_m2, perimeter_m: of what it covers. free_m2: of a room's floor without what stands on it; None for the rest.
        clear_m: of an opening, the width left when its door is open; None for the rest.
    """

    name: str
    kind: Kind
    size_m: tuple[float, float, float]
    area_m2: float
    perimeter_m: float
    free_m2: float | None = None
    clear_m: float | None = None


def measure(semantic_map: SemanticMap, a: str, b: str) -> Measurement:
    """Between two things: links, openings (ID or LINK/ID), rooms, or points "x,y" and "x,y,z" in the map frame.

    Raises:
        MapError: there is no such thing, or it is nowhere.
    """
    import shapely

    one, two = thing_of(semantic_map, a), thing_of(semantic_map, b)
    nearest = shapely.get_coordinates(shapely.shortest_line(one.shape, two.shape))
    clear_m, facing_m = _facing(one, two)
    angle = None
    if one.yaw_rad is not None and two.yaw_rad is not None:
        angle = math.remainder(two.yaw_rad - one.yaw_rad, 2 * math.pi)
    x, y, z = (two.at - one.at).tolist()
    return Measurement(
        a=one.name,
        b=two.name,
        frames_m=math.hypot(x, y, z),
        by_m=(x, y, z),
        surfaces_m=float(one.shape.distance(two.shape)),
        points_m=(_pair(nearest[0]), _pair(nearest[1])),
        over_m=max(0.0, one.z_m[0] - two.z_m[1], two.z_m[0] - one.z_m[1]),
        clear_m=clear_m,
        facing_m=facing_m,
        angle_rad=angle,
    )


def extent_of(semantic_map: SemanticMap, word: str) -> Extent:
    """How large a link, an opening or a room is.

    Raises:
        MapError: as for `measure`.
    """
    import shapely

    thing = thing_of(semantic_map, word)
    high = thing.z_m[1] - thing.z_m[0]
    area, perimeter = float(thing.shape.area), float(thing.shape.length)
    if thing.kind == "room":
        corners = shapely.get_coordinates(shapely.minimum_rotated_rectangle(thing.shape))
        sides = sorted(np.hypot(*np.diff(corners[:3], axis=0).T).tolist(), reverse=True)
        standing = [part.footprint for part in parts(semantic_map) if not _is_structure(semantic_map, part.link)]
        free = float(thing.shape.difference(shapely.union_all(standing)).area)
        return Extent(thing.name, thing.kind, (sides[0], sides[1], high), area, perimeter, free_m2=free)
    yaw = thing.yaw_rad or 0.0
    along = np.array([math.cos(yaw), math.sin(yaw)])
    points = shapely.get_coordinates(thing.shape)
    size = tuple(float(np.ptp(points @ axis)) for axis in (along, np.array([-along[1], along[0]])))
    clear = _clear_width(semantic_map, word) if thing.kind == "opening" else None
    return Extent(thing.name, thing.kind, (size[0], size[1], high), area, perimeter, clear_m=clear)


def thing_of(semantic_map: SemanticMap, word: str) -> Thing:
    """What a word means; "link:", "opening:" and "room:" before it say which, where a name is used twice.

    Raises:
        MapError: nothing, or nothing that can be placed.
    """
    from shapely import Point

    point = numbers_from_text(word.replace(",", " "))
    if point is not None and len(point) in (2, 3) and "," in word:
        x, y, z = (*point, 0.0)[:3]
        return Thing("point", word, np.array([x, y, z]), None, Point(x, y), (z, z))
    kind, _, rest = word.partition(":")
    name = rest if kind in ("link", "opening", "room") and rest else word
    kind = kind if name is not word else ""
    if kind in ("", "link") and name in semantic_map.links:
        return _link(semantic_map, name)
    if kind in ("", "opening") and (found := _openings(semantic_map).get(name)) is not None:
        return _opening(semantic_map, *found)
    if kind in ("", "room") and name in semantic_map.rooms:
        return _room(semantic_map, semantic_map.rooms[name])
    known = [*semantic_map.links, *_openings(semantic_map), *semantic_map.rooms]
    raise MapError(f"there is no '{word}'", where=semantic_map.source, hint=closest(name, known) + ', or a point "x,y"')


# -------------------------------------------------------------------------------------------- details


def _link(semantic_map: SemanticMap, name: str) -> Thing:
    from shapely import Point, union_all

    T = _pose(semantic_map, name)
    own = [part for part in parts(semantic_map) if part.link == name]
    shape = union_all([part.footprint for part in own]) if own else Point(*T[:2, 3])
    z = float(T[2, 3])
    heights = (min(p.z_m[0] for p in own), max(p.z_m[1] for p in own)) if own else (z, z)
    return Thing("link", name, T[:3, 3], math.atan2(T[1, 0], T[0, 0]), shape, heights)


def _opening(semantic_map: SemanticMap, wall: str, opening: Opening) -> Thing:
    from shapely import Polygon

    T, half = _pose(semantic_map, wall), _thickness_m(semantic_map, wall) / 2
    (x0, x1), (z0, z1) = opening.along_m, opening.z_m
    corners = np.array([(x, y, z0, 1.0) for x, y in ((x0, -half), (x1, -half), (x1, half), (x0, half))]) @ T.T
    if not np.all(np.isfinite(corners)):
        raise MapError(f"opening '{opening.id}' has no readable place", where=semantic_map.source)
    return Thing(
        "opening",
        f"{wall}/{opening.id}",
        corners[:, :3].mean(axis=0),
        math.atan2(T[1, 0], T[0, 0]),
        Polygon(corners[:, :2]),
        (float(T[2, 3]) + z0, float(T[2, 3]) + z1),
    )


def _room(semantic_map: SemanticMap, room: Room) -> Thing:
    from shapely import Polygon, make_valid

    if room.floor is None:
        raise MapError(f"the floor of room '{room.id}' cannot be read", where=semantic_map.source)
    shape = make_valid(Polygon(room.floor))
    middle = shape.centroid
    walls = [part.z_m[1] for part in parts(semantic_map) if part.class_name == "wall"]
    return Thing("room", room.id, np.array([middle.x, middle.y, 0.0]), None, shape, (0.0, max(walls, default=0.0)))


def _pose(semantic_map: SemanticMap, link: str) -> Float64Array:
    T = semantic_map.poses().get(link)
    if T is None or not np.all(np.isfinite(T)):
        raise MapError(
            f"'{link}' hangs on nothing, so it is nowhere", where=semantic_map.source, hint="wallkit map validate"
        )
    return T


def _openings(semantic_map: SemanticMap) -> dict[str, tuple[str, Opening]]:
    """By LINK/ID, and by ID alone where only one has it."""
    every = [(link.name, opening) for link in semantic_map.links.values() for opening in link.openings]
    ids = [opening.id for _, opening in every]
    found = {f"{wall}/{opening.id}": (wall, opening) for wall, opening in every}
    return found | {opening.id: (wall, opening) for wall, opening in every if ids.count(opening.id) == 1}


def _thickness_m(semantic_map: SemanticMap, wall: str) -> float:
    return max((float(s.size[1]) for s in semantic_map.links[wall].shapes if s.kind == "box"), default=0.0)


def _is_structure(semantic_map: SemanticMap, link: str) -> bool:
    info = semantic_map.class_of(link)
    return info is not None and info.mount == "structure"


def _facing(a: Thing, b: Thing) -> tuple[float | None, float | None]:
    """(clear width, along how much) of two that are parallel and overlap along their direction, with air between."""
    import shapely

    if a.yaw_rad is None or b.yaw_rad is None or a.kind == "point" or b.kind == "point":
        return None, None
    if abs(math.remainder(b.yaw_rad - a.yaw_rad, math.pi / 2)) > PARALLEL_RAD:
        return None, None
    best: tuple[float | None, float | None] = (None, None)
    for yaw in (a.yaw_rad, a.yaw_rad + math.pi / 2):
        along = np.array([math.cos(yaw), math.sin(yaw)])
        spans = []
        for axis in (along, np.array([-along[1], along[0]])):
            values = [shapely.get_coordinates(thing.shape) @ axis for thing in (a, b)]
            spans.append([(float(v.min()), float(v.max())) for v in values])
        (a0, a1), (b0, b1) = spans[0]
        facing = min(a1, b1) - max(a0, b0)
        (a0, a1), (b0, b1) = spans[1]
        clear = max(b0 - a1, a0 - b1)
        if facing > 0 and clear >= 0 and (best[1] is None or facing > best[1]):
            best = clear, facing
    return best


def _clear_width(semantic_map: SemanticMap, word: str) -> float:
    """The widest stretch of an opening that its open leaves leave free."""
    from shapely import box, get_coordinates, union_all
    from shapely.affinity import affine_transform

    wall, opening = _openings(semantic_map)[word.removeprefix("opening:")]
    T_wall_map = np.linalg.inv(_pose(semantic_map, wall))
    x0, x1 = opening.along_m
    half = _thickness_m(semantic_map, wall) / 2 + _BESIDE_M
    leaves = []
    for joint in semantic_map.doors:
        leads = joint.mimic.joint if joint.mimic is not None else joint.name
        leader = semantic_map.joints.get(leads)
        if opening.fill and opening.fill in (joint.child, leader.child if leader is not None else ""):
            leaves.append(door_sweep(semantic_map, joint).leaves[-1])
    m = T_wall_map
    local = affine_transform(union_all(leaves), [m[0, 0], m[0, 1], m[1, 0], m[1, 1], m[0, 3], m[1, 3]])
    blocked = local.intersection(box(x0, -half, x1, half))
    edges = [x0, x1]
    for piece in getattr(blocked, "geoms", [blocked]):
        if not piece.is_empty:
            xs = get_coordinates(piece)[:, 0]
            edges += [float(xs.min()), float(xs.max())]
    edges.sort()
    free = [(a, b) for a, b in pairwise(edges) if not blocked.intersects(box(a, -half, b, half).buffer(-1e-6))]
    return max((b - a for a, b in free), default=0.0)


def _pair(point: Float64Array) -> tuple[float, float]:
    return float(point[0]), float(point[1])
