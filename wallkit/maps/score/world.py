"""The surfaces of a map at the LiDAR's height, and a robot -> a scene in which scans can be cast and matched."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from wallkit.core.config import setting
from wallkit.core.geometry import compose
from wallkit.core.types import BoolArray, Float64Array, Int64Array
from wallkit.errors import MapError
from wallkit.maps.score.nearness import MOST_CELLS, all_alike, nearness_of, one_apart
from wallkit.maps.score.rivals import ground_of
from wallkit.maps.score.settle import Criterion, Ground
from wallkit.maps.sight import Sight, Sighting, cast_beams, index_segments

if TYPE_CHECKING:
    from shapely import Geometry

Pose = tuple[float, float, float]
_GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0
# the golden section of the plane: the root of x^3 = x + 1
_PLASTIC = 1.324717957244746
_TRIES = 12
_MOST_TRIED = 200_000


@dataclass(frozen=True, slots=True, eq=False)
class World:
    """What a horizontal LiDAR and a robot meet in a map.

    Attributes:
        segments: (S, 4) float64 x0, y0, x1, y1 of the surfaces at the LiDAR's height [m].
        classes: (S,) int64 index into class_names.
        p_return: (S,) probability that a beam comes back from the surface.
        glass: (S,) whether it is glass or mirror. movable: (S,) whether it changes place while the map holds.
        free: floor without obstacles; the robot's radius is taken off by the score.
        source: the file, for messages.
        frame: (x, y, yaw) of something in the map: poses are laid out from it, so that a map moved as a whole is judged at
            the same places.
    """

    segments: Float64Array
    classes: Int64Array
    class_names: tuple[str, ...]
    p_return: Float64Array
    glass: BoolArray
    movable: BoolArray
    free: Geometry
    source: str = ""
    frame: Pose = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class ScoreSettings:
    """The robot, its LiDAR, and what makes a pose ambiguous."""

    max_range_m: float = setting(12.0, "longest range of the LiDAR", low=0.5, high=1000)
    robot_radius_m: float = setting(0.25, "the robot's centre keeps this away from surfaces", low=0, high=5)
    fov_deg: float = setting(360.0, "field of view, about the heading", low=10, high=360)
    beams: int = setting(72, "beams that are compared", low=8, high=240)
    poses: int = setting(1000, "most poses that are judged, on a grid over the free floor", low=1, high=100_000)
    tolerance_m: float = setting(0.05, "how well a beam must fit to be explained", low=0.001, high=1)
    explained: float = setting(0.9, "share of the beams that a rival explains", low=0.5, high=1)
    rival_distance_m: float = setting(0.5, "a rival is farther away than this", low=0.01)
    rival_angle_deg: float = setting(30.0, "or turned by more than this", low=0.1, high=180)
    p_return_min: float = setting(0.5, "beams pass through surfaces that return less often", low=0, high=1)
    degenerate_below: float = setting(0.02, "share of the returns that must see a direction", low=0, high=0.5)


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """A world made ready for one robot.

    Attributes:
        floor: where its centre can be. sight: of the surfaces that return beams.
        labels: (S,) class of each surface as index into label_names, -1 where beams pass.
        bearings: (K,) of the beams that are compared [rad].
    """

    settings: ScoreSettings
    segments: Float64Array
    floor: Geometry
    sight: Sight
    labels: Int64Array
    label_names: tuple[str, ...]
    bearings: Float64Array

    @staticmethod
    def of(world: World, settings: ScoreSettings) -> Scene:
        """The world as this robot meets it.

        Raises:
            MapError: see score.
        """
        returns = world.p_return >= settings.p_return_min
        if not returns.any():
            raise MapError(
                f"none of the {len(returns)} surfaces at the LiDAR's height returns beams",
                where=world.source,
                hint="cut it where walls stand: --set rules.scan_plane_m=HEIGHT",
            )
        floor = world.free.buffer(-settings.robot_radius_m) if settings.robot_radius_m > 0 else world.free
        if floor.is_empty:
            raise MapError(
                f"a robot of radius {settings.robot_radius_m:g} m fits nowhere on {world.free.area:.3g} m2 of free floor",
                where=world.source,
                hint="if yours is smaller: --set rules.robot_radius_m=RADIUS",
            )
        used, numbers = np.unique(world.classes[returns], return_inverse=True)
        labels = np.full(len(returns), -1, dtype=np.int64)
        labels[returns] = numbers
        fov = math.radians(settings.fov_deg)
        bearings = ((np.arange(settings.beams) + 0.5) / settings.beams - 0.5) * fov
        segments = np.ascontiguousarray(world.segments, dtype=np.float64)
        sight = index_segments(segments, seen=returns)
        names = tuple(world.class_names[index] for index in used.tolist())
        return Scene(settings, segments, floor, sight, labels, names, bearings)

    def scans(self, poses: Float64Array) -> Sighting:
        """What the LiDAR measures from poses (N, 3)."""
        return cast_beams(self.sight, poses, self.bearings, range_max_m=self.settings.max_range_m)

    def ground(self, scans: Sighting, *, most_cells: int = MOST_CELLS) -> Ground:
        """What these scans are matched to with labels; `without_labels` makes it for ranges alone."""
        settings = self.settings
        criterion = Criterion(
            settings.tolerance_m,
            settings.max_range_m,
            beams_for(settings.explained, settings),
            settings.rival_distance_m,
            math.radians(settings.rival_angle_deg),
        )
        near = nearness_of(
            self.segments,
            self.labels,
            self.floor,
            label_count=len(self.label_names),
            longest_m=float(scans.ranges_m[np.isfinite(scans.ranges_m)].max(initial=0.0)),
            tolerance_m=settings.tolerance_m,
            most_cells=most_cells,
        )
        return ground_of(near, self.sight, self.labels, criterion)


def without_labels(ground: Ground) -> Ground:
    """The same with all surfaces alike."""
    return ground._replace(near=all_alike(ground.near))


def with_label(ground: Ground, label: int) -> Ground:
    """The same with one label told from the rest: 1 for it, 0 for all others."""
    labels = np.where(ground.labels < 0, -1, ground.labels == label).astype(np.int64)
    return ground._replace(near=one_apart(ground.near, label), labels=labels)


def beams_for(share: float, settings: ScoreSettings) -> int:
    return math.ceil(share * settings.beams - 1e-9)


def part_of(world: World, settings: ScoreSettings, area_m2: float) -> World:
    """The part of a world round its frame whose floor is about so large, with all surfaces in range of it."""
    import shapely

    if world.free.area <= area_m2:
        return world
    centre = shapely.Point(*world.frame[:2])
    pieces = shapely.get_parts(world.free)
    away = shapely.distance(pieces, centre)
    order = np.argsort(away, kind="stable")
    areas = shapely.area(pieces)[order]
    last = int(np.searchsorted(np.cumsum(areas), area_m2))
    left = area_m2 - float(areas[:last].sum())
    chosen = list(pieces[order[:last]])
    if last == 0 or left > areas[last] / 2:
        # of a hall the part next to the frame
        radius = float(away[order[last]]) + math.sqrt(left / math.pi) * 1.2
        chosen.append(pieces[order[last]].intersection(centre.buffer(radius)))
    floor = shapely.union_all(chosen)
    x0, y0, x1, y1 = floor.bounds
    reach = settings.max_range_m
    x, y = world.segments[:, ::2], world.segments[:, 1::2]
    near = (x.max(axis=1) > x0 - reach) & (x.min(axis=1) < x1 + reach)
    near &= (y.max(axis=1) > y0 - reach) & (y.min(axis=1) < y1 + reach)
    return replace(
        world,
        segments=world.segments[near],
        classes=world.classes[near],
        p_return=world.p_return[near],
        glass=world.glass[near],
        movable=world.movable[near],
        free=floor,
    )


def poses_on_grid(world: World, floor: Geometry, most: int, *, seed: int = 0) -> tuple[Float64Array, float]:
    """At most `most` poses (N, 3) on a square grid over a floor, and its side [m].

    Headings go round by the golden section, so that no beam runs along the walls of all poses; the seed shifts grid and
    headings. A floor so thin that the grid misses it is judged from one point on it.
    """
    import shapely

    level = _levelled(world, floor)
    shift = np.random.default_rng(seed).uniform(size=3)
    side = math.sqrt(level.area / most)
    x0, y0, x1, y1 = level.bounds
    for _ in range(_TRIES):
        along = x0 + np.arange(-1, math.ceil((x1 - x0) / side) + 1) * side + shift[0] * side
        up = y0 + np.arange(-1, math.ceil((y1 - y0) / side) + 1) * side + shift[1] * side
        grid = np.stack(np.meshgrid(along, up), axis=-1).reshape(-1, 2)
        places = grid[shapely.contains_xy(level, *grid.T)]
        # rows of rooms can fall between the lines of a grid
        if most / 2 <= len(places) <= most:
            break
        side *= 1.01 * math.sqrt(len(places) / most) if len(places) > most else 0.83
    return _headed(world, level, places[:most], shift[2]), side


def poses_scattered(world: World, floor: Geometry, most: int) -> Float64Array:
    """`most` poses (N, 3) all over a floor, the first n of them as well as all; fewer on a floor that is very thin.

    Places are the R2 sequence of M. Roberts, "The unreasonable effectiveness of quasirandom sequences" (2018).
    """
    import shapely

    level = _levelled(world, floor)
    x0, y0, x1, y1 = level.bounds
    wanted = min(math.ceil(1.2 * most * (x1 - x0) * (y1 - y0) / level.area) + 100, _MOST_TRIED)
    steps = np.array([1 / _PLASTIC, 1 / _PLASTIC**2])
    tried = (np.arange(1, wanted + 1)[:, None] * steps) % 1.0 * [x1 - x0, y1 - y0] + [x0, y0]
    return _headed(world, level, tried[shapely.contains_xy(level, *tried.T)][:most], 0.0)


def _levelled(world: World, floor: Geometry) -> Geometry:
    """A floor in the world's frame."""
    import shapely
    from shapely.affinity import rotate, translate

    x, y, yaw = world.frame
    level = rotate(translate(floor, -x, -y), -yaw, origin=(0, 0), use_radians=True)
    shapely.prepare(level)
    return level


def _headed(world: World, level: Geometry, places: Float64Array, first: float) -> Float64Array:
    """Poses of frame map at places in the world's frame; at one place of the floor if there are none."""
    if not len(places):
        point = level.representative_point()
        places = np.array([[point.x, point.y]])
    headings = (np.arange(len(places)) * _GOLDEN + first) % 1.0 * 2 * math.pi
    return compose(np.array(world.frame), np.column_stack([places, headings]))
