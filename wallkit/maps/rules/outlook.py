"""What rules about localisation share: the world that a robot meets in a map, and looks round in it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from wallkit.core.types import Float64Array
from wallkit.errors import MapError
from wallkit.maps.geometry import Slice
from wallkit.maps.rules.base import Context
from wallkit.maps.rules.floods import closed_leaves, holes, sealed_regions
from wallkit.maps.rules.scale import wrong_unit
from wallkit.maps.rules.solids import leaf_links, structure
from wallkit.maps.score.score import Ambiguity, ambiguity_of
from wallkit.maps.score.seen import Seen, look_from
from wallkit.maps.score.world import Pose, Scene, ScoreSettings, World, part_of, poses_scattered
from wallkit.maps.space import PASSAGE_M
from wallkit.maps.surfaces import floor_at, p_return_of

if TYPE_CHECKING:
    from shapely import Geometry

# poses that are looked round from, and at most so many of them are searched for rivals
POSES = 400
# floor that is searched for rivals
AREA_M2 = 150.0
# an enclosed region without a door or a declared room is a shaft unless it is larger
_SHAFT_M2 = 1.0
# places that are asked whether they are indoors, where walls do not enclose the floor
_LATTICE_M, _MOST_PLACES = 0.25, 40_000


def score_settings(context: Context, *, poses: int = ScoreSettings.poses) -> ScoreSettings:
    """The robot and its LiDAR: the settings', else the map's, else the defaults."""
    reach_m, radius_m = context.max_range_m, context.robot_radius_m
    return ScoreSettings(
        max_range_m=ScoreSettings.max_range_m if reach_m is None else reach_m,
        robot_radius_m=ScoreSettings.robot_radius_m if radius_m is None else radius_m,
        beams=context.tolerances.beams,
        poses=poses,
    )


def robot_in_words(context: Context) -> str:
    """The robot and its LiDAR for messages, and which of it nobody said."""
    settings = score_settings(context)
    reach = f"range {settings.max_range_m:g} m{' (default)' if context.max_range_m is None else ''}"
    radius = f"robot radius {settings.robot_radius_m:g} m{' (default)' if context.robot_radius_m is None else ''}"
    return f"{reach}, {radius}"


def world(context: Context) -> World:
    """The world at the LiDAR's height, everything at rest.

    Raises:
        MapError: the height is unknown, nothing is there, or no floor is indoors.
    """
    cut = context.scan_slice
    if cut is None:
        raise MapError(
            "the height of the LiDAR's plane is unknown",
            where=context.document.source,
            hint='say it in the map, <wk:map scan_plane="0.3">, or with --set rules.scan_plane_m=0.3',
        )
    if not cut.polygons:
        raise MapError(
            f"nothing of the map is cut at {cut.z_m:g} m, the LiDAR's height",
            where=context.document.source,
            hint="cut it where walls stand: --set rules.scan_plane_m=HEIGHT",
        )
    names = tuple(sorted({part.class_name or "unknown" for part in cut.parts}))
    leaves = context.once(leaf_links)
    infos = [context.map.class_of(part.link) for part in cut.parts]
    of = cut.part_of_segment
    return World(
        segments=cut.segments,
        classes=np.array([names.index(part.class_name or "unknown") for part in cut.parts])[of],
        class_names=names,
        p_return=np.array([p_return_of(info) for info in infos])[of],
        glass=np.array([info is not None and info.lidar in ("glass", "mirror") for info in infos])[of],
        movable=np.array(
            [
                part.link in leaves or (info is not None and info.movable)
                for part, info in zip(cut.parts, infos, strict=True)
            ]
        )[of],
        free=_free_floor(context, cut),
        source=context.document.source,
        frame=_frame(cut),
    )


def sound_world(context: Context) -> World | None:
    """The world, where there is one whose lengths are to be believed."""
    if context.once(wrong_unit) is not None:
        return None
    try:
        return context.once(world)
    except MapError:
        return None


def places(context: Context) -> Float64Array | None:
    """Poses (N, 3) all over the floor; None where a robot has none."""
    found = context.once(sound_world)
    if found is None:
        return None
    settings = score_settings(context)
    try:
        scene = Scene.of(found, settings)
    except MapError:
        return None
    return poses_scattered(found, scene.floor, POSES)


def seen(context: Context) -> Seen | None:
    """What is seen from there."""
    found, poses = context.once(sound_world), context.once(places)
    return None if found is None or poses is None else look_from(found, poses, score_settings(context))


@dataclass(frozen=True, slots=True, eq=False)
class Judged:
    """Poses (N, 3) of a part of the floor, and which of them have rivals there."""

    poses: Float64Array
    ambiguity: Ambiguity
    area_m2: float
    is_part: bool


def ambiguity(context: Context) -> Judged | None:
    """As many poses searched for rivals as tell on which side of its limits the share is.

    Of a large floor only a part is judged, against itself: `wallkit map score` has the time for all of it.
    """
    found = context.once(sound_world)
    if found is None:
        return None
    settings = score_settings(context)
    part = part_of(found, settings, AREA_M2)
    try:
        floor = Scene.of(part, settings).floor
    except MapError:
        return None
    limits = (context.tolerances.ambiguous_warn, context.tolerances.ambiguous_error)
    poses, judged = ambiguity_of(part, poses_scattered(part, floor, POSES), settings, limits=limits)
    return Judged(poses, judged, float(part.free.area), part is not found)


# -------------------------------------------------------------------------------------------- details


def _free_floor(context: Context, cut: Slice) -> Geometry:
    """Indoor floor at rest: what walls, doors and openings enclose; else what is declared; else where walls are near."""
    import shapely

    rooms = [
        polygon
        for room in context.map.all_rooms
        if room.floor is not None
        for polygon in shapely.get_parts(shapely.make_valid(shapely.Polygon(room.floor)))
        if polygon.geom_type == "Polygon"
    ]
    enclosed = np.array([r.polygon for r in context.once(sealed_regions) if not r.is_outside], dtype=object)
    ways = [*(hole.footprint for hole in context.once(holes)), *(p.footprint for p in context.once(closed_leaves))]
    near = shapely.union_all([*rooms, *shapely.buffer(np.array(ways, dtype=object), 2 * PASSAGE_M)])
    shapely.prepare(near)
    chosen = enclosed[shapely.intersects(enclosed, near)] if len(enclosed) else enclosed
    if not len(chosen) and not rooms:
        chosen = enclosed[shapely.area(enclosed) >= _SHAFT_M2] if len(enclosed) else enclosed
    if len(chosen):
        walls = {part.link for part in context.once(structure)}
        rest = [polygon for part, polygon in zip(cut.parts, cut.polygons, strict=True) if part.link not in walls]
        return shapely.difference(shapely.union_all(chosen), shapely.union_all(rest))
    floor = shapely.union_all(rooms) if rooms else _indoors(context, cut)
    return shapely.difference(floor, cut.solid)


def _indoors(context: Context, cut: Slice) -> Geometry:
    """Squares of floor that has walls on most sides, in a map whose walls do not close.

    Raises:
        MapError: there is none.
    """
    import shapely

    found = floor_at(context.map, cut.z_m)
    x0, y0, x1, y1 = cut.solid.bounds
    side = max(_LATTICE_M, math.sqrt((x1 - x0) * (y1 - y0) / _MOST_PLACES))
    x, y = np.meshgrid(np.arange(x0 + side / 2, x1, side), np.arange(y0 + side / 2, y1, side))
    centres = np.column_stack([x.ravel(), y.ravel()])
    held = centres[found.holds(centres)] if len(centres) else centres
    if not len(held):
        raise MapError(
            "no floor of the map has walls around it",
            where=context.document.source,
            hint="close its walls (`wallkit map validate`), or declare its floor: <wk:room id=... floor=...>",
        )
    half = side / 2 + 1e-6
    return shapely.union_all(shapely.box(*(held - half).T, *(held + half).T))


def _frame(cut: Slice) -> Pose:
    """Of the first part that is cut."""
    T = cut.parts[0].T_map_shape
    return float(T[0, 3]), float(T[1, 3]), math.atan2(T[1, 0], T[0, 0])
