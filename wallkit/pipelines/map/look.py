"""A sound map -> what is in it: its figures, and a row for every element."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from wallkit.errors import MapError, closest
from wallkit.maps.geometry import Part, parts
from wallkit.maps.model import MAP_LINK, SemanticMap
from wallkit.maps.nouns import Link

# what stands in a room touches its floor polygon; what bounds it (walls, doors, panes) is no farther than a wall is thick
TOUCH_M = 0.02
WALL_M = 0.2


@dataclass(frozen=True)
class ElementRow:
    """One link that is something.

    Attributes:
        parent: the link it hangs on; "" for the root.
        joint: "fixed", "revolute", ...
        x_m, y_m, yaw_rad: of its frame in the map, at rest; NaN where it hangs on nothing.
        z_m: (lowest, highest) of its shapes, or None when it has none that can be placed (meshes).
        rooms: ids of those it says it belongs to, whose floor it stands on, or that it bounds.
    """

    link: str
    class_name: str
    class_is_inferred: bool
    parent: str
    joint: str
    x_m: float
    y_m: float
    yaw_rad: float
    z_m: tuple[float, float] | None
    rooms: tuple[str, ...]


@dataclass(frozen=True)
class MapInfo:
    """The figures of a map.

    Attributes:
        classes: how many links are of each class. inferred: how many links do not say theirs.
        joints, openings: how many of each kind.
        rooms: (id, kind, area of the floor polygon in m2 or NaN).
        extent_m: (x0, y0, z0, x1, y1, z1) of everything solid; None when nothing is.
        meshes: how many shapes are meshes, which have no extent here.
    """

    file: str
    name: str
    format: str
    level: str
    elevation_m: float | None
    scan_plane_m: float | None
    survey: str
    links: int
    classes: dict[str, int]
    inferred: int
    joints: dict[str, int]
    openings: dict[str, int]
    doors: tuple[str, ...]
    rooms: tuple[tuple[str, str, float], ...]
    extent_m: tuple[float, ...] | None
    meshes: int


def info_of(semantic_map: SemanticMap) -> MapInfo:
    """The figures of a map."""
    header, links = semantic_map.header, semantic_map.links.values()
    things = [link for link in links if _is_thing(link)]
    survey = header.survey
    return MapInfo(
        file=semantic_map.source,
        name=semantic_map.name,
        format=header.format,
        level=header.level,
        elevation_m=header.elevation_m,
        scan_plane_m=header.scan_plane_m,
        survey=f"{survey.kind} EPSG:{survey.epsg}" if survey and survey.epsg else survey.kind if survey else "",
        links=len(links),
        classes=_tally(link.class_name or "(none)" for link in things),
        inferred=sum(link.class_is_inferred for link in things),
        joints=_tally(joint.kind for joint in semantic_map.joints.values()),
        openings=_tally(opening.kind for link in links for opening in link.openings),
        doors=tuple(joint.child for joint in semantic_map.doors),
        rooms=tuple((room.id, room.kind, _area_m2(room.floor)) for room in semantic_map.rooms.values()),
        extent_m=_extent(parts(semantic_map)),
        meshes=sum(shape.kind == "mesh" for link in links for shape in link.shapes),
    )


def elements_of(
    semantic_map: SemanticMap, *, class_name: str | None = None, room: str | None = None
) -> list[ElementRow]:
    """A row for every link that has a class, a shape or an opening, in the file's order.

    Raises:
        MapError: no such class or room in this map.
    """
    source = semantic_map.source
    known = {*semantic_map.classes, *(link.class_name for link in semantic_map.links.values())} - {""}
    if class_name is not None and class_name not in known:
        raise MapError(f"there is no class '{class_name}'", where=source, hint=closest(class_name, known))
    if room is not None and room not in semantic_map.rooms:
        hint = closest(room, semantic_map.rooms) if semantic_map.rooms else "this map has no <wk:room>"
        raise MapError(f"there is no room '{room}'", where=source, hint=hint)
    rows = _rows(semantic_map)
    return [row for row in rows if class_name in (None, row.class_name) and (room is None or room in row.rooms)]


# -------------------------------------------------------------------------------------------- details


def _rows(semantic_map: SemanticMap) -> list[ElementRow]:
    poses = semantic_map.poses()
    by_link: dict[str, list[Part]] = {}
    for part in parts(semantic_map, poses=poses):
        by_link.setdefault(part.link, []).append(part)
    rows = []
    for link in filter(_is_thing, semantic_map.links.values()):
        joint = semantic_map.parent_joint(link.name)
        T = poses.get(link.name, np.full((4, 4), np.nan))
        solid = by_link.get(link.name, [])
        rows.append(
            ElementRow(
                link=link.name,
                class_name=link.class_name,
                class_is_inferred=link.class_is_inferred,
                parent=joint.parent if joint else "",
                joint=joint.kind if joint else "",
                x_m=float(T[0, 3]),
                y_m=float(T[1, 3]),
                yaw_rad=math.atan2(T[1, 0], T[0, 0]),
                z_m=(min(p.z_m[0] for p in solid), max(p.z_m[1] for p in solid)) if solid else None,
                rooms=_rooms_of(link, solid, semantic_map),
            )
        )
    return rows


def _rooms_of(link: Link, solid: list[Part], semantic_map: SemanticMap) -> tuple[str, ...]:
    from shapely import Polygon, union_all

    said = {link.room, *link.connects, *link.separates}
    info = semantic_map.class_of(link.name)
    near_m = WALL_M if info is not None and info.mount == "structure" else TOUCH_M
    footprint = union_all([part.footprint for part in solid])
    return tuple(
        room.id
        for room in semantic_map.rooms.values()
        if room.id in said or (room.floor is not None and Polygon(room.floor).distance(footprint) <= near_m)
    )


def _is_thing(link: Link) -> bool:
    return link.name != MAP_LINK and bool(link.class_name or link.shapes or link.openings)


def _tally(names: Iterable[str]) -> dict[str, int]:
    return dict(sorted(Counter(names).items(), key=lambda pair: (-pair[1], pair[0])))


def _area_m2(floor: np.ndarray | None) -> float:
    from shapely import Polygon

    return math.nan if floor is None else float(Polygon(floor).area)


def _extent(solid: list[Part]) -> tuple[float, ...] | None:
    if not solid:
        return None
    corners = np.concatenate([part.corners for part in solid])
    return tuple(float(value) for value in (*corners.min(axis=0), *corners.max(axis=0)))
