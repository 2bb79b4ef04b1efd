"""L, cells and mirrors: what becomes of the slice in a raster, and where reflections fall."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from wallkit.core.types import Float64Array
from wallkit.maps.document import Element
from wallkit.maps.geometry import slice_parts
from wallkit.maps.rules.base import Context, Problem, Rule
from wallkit.maps.rules.floods import Hole, flood, flood_plane_m, holes, sealed_regions
from wallkit.maps.rules.solids import sound_runs, structure
from wallkit.maps.space import Region

if TYPE_CHECKING:
    from shapely import Polygon

# pieces of floor smaller than this are corners between things, no rooms
_PIECE_M2 = 0.25
# reflections are looked for so deep behind a mirror
_BEHIND_M = 2.0
_BESIDE_M = 0.02
# no raster shows less; what leaks through it, WK-E020 and WK-T007 say
_CHINK_M = 0.01


def fine_regions(context: Context) -> list[Region]:
    """Floor between the building's cuts; even a chink joins what is beside it."""
    return flood(
        list(slice_parts(context.once(structure), flood_plane_m(context)).polygons), context.tolerances.gap_min_m
    )


def l005_interior(context: Context) -> Iterator[Problem]:
    """The building is solid for more than two cells behind its surface.

    No beam returns from there, but a likelihood field made of solid cells invites endpoints into it (Beluga #265). This
    program draws surfaces only; an exporter that fills walls does not.

    Bad:
      <wk:map format="1.0" units="m rad" scan_plane="0.3"/><link name="pillar"><wk:object class="column"/>
      <collision><origin xyz="0 0 1.2"/><geometry><box size="0.6 0.6 2.4"/></geometry></collision></link>
      <joint name="p" type="fixed"><parent link="map"/><child link="pillar"/></joint>
    Good:
      <wk:map format="1.0" units="m rad" scan_plane="0.3"/><link name="pillar"><wk:object class="column"/>
      <collision><origin xyz="0 0 1.2"/><geometry><box size="0.2 0.2 2.4"/></geometry></collision></link>
      <joint name="p" type="fixed"><parent link="map"/><child link="pillar"/></joint>
    """
    import shapely

    if context.scan_plane_m is None:
        return
    cut = slice_parts(context.once(structure), context.scan_plane_m)
    cell_m = context.tolerances.cell_m
    # the cells along the surface on both sides, and one cell of interior on either side of the middle
    cores = shapely.buffer(list(cut.polygons), -2 * cell_m, join_style="mitre")
    for part, core in zip(cut.parts, cores, strict=True):
        if core.area > cell_m**2:
            x, y = core.representative_point().coords[0]
            message = f"'{part.name}' has an inside of {core.area:.2g} m2 that no beam reaches"
            hint = f"draw rasters of it as surfaces; at cells of {cell_m:g} m its inside is more than two cells"
            yield Problem(part.shape.geometry, message, hint, xyz=(x, y))


def l007_mirror(context: Context) -> Iterator[Problem]:
    """A mirror hangs where the map has free floor behind it: what is seen in it lies in that room.

    Bad:
      <wk:map format="1.0" units="m rad" scan_plane="0.3"/>
      <link name="wall_a"><wk:object class="wall"/>
      <collision><origin xyz="2 0 1"/><geometry><box size="4.1 0.1 2"/></geometry></collision>
      <collision><origin xyz="2 3 1"/><geometry><box size="4.1 0.1 2"/></geometry></collision>
      <collision><origin xyz="2 6 1"/><geometry><box size="4.1 0.1 2"/></geometry></collision>
      <collision><origin xyz="0 3 1"/><geometry><box size="0.1 6 2"/></geometry></collision>
      <collision><origin xyz="4 3 1"/><geometry><box size="0.1 6 2"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
      <link name="mirror"><wk:object class="mirror"/>
      <collision><origin xyz="0.003 0 1"/><geometry><box size="0.006 1.2 2"/></geometry></collision></link>
      <joint name="m" type="fixed"><parent link="wall_a"/><child link="mirror"/><origin xyz="2 3.05 0" rpy="0 0 1.5707963"/>
      </joint>
    Good:
      <wk:map format="1.0" units="m rad" scan_plane="0.3"/>
      <link name="wall_a"><wk:object class="wall"/>
      <collision><origin xyz="2 0 1"/><geometry><box size="4.1 0.1 2"/></geometry></collision>
      <collision><origin xyz="2 6 1"/><geometry><box size="4.1 0.1 2"/></geometry></collision>
      <collision><origin xyz="0 3 1"/><geometry><box size="0.1 6 2"/></geometry></collision>
      <collision><origin xyz="4 3 1"/><geometry><box size="0.1 6 2"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
      <link name="mirror"><wk:object class="mirror"/>
      <collision><origin xyz="0.003 0 1"/><geometry><box size="0.006 1.2 2"/></geometry></collision></link>
      <joint name="m" type="fixed"><parent link="wall_a"/><child link="mirror"/><origin xyz="2 0.05 0" rpy="0 0 1.5707963"/>
      </joint>
    """
    import shapely

    if context.scan_slice is None:
        return
    classes = context.map.classes
    mirrors = [
        (part, polygon)
        for part, polygon in zip(context.scan_slice.parts, context.scan_slice.polygons, strict=True)
        if part.class_name in classes and classes[part.class_name].lidar == "mirror"
    ]
    if not mirrors:
        return
    # doors closed: a room whose door leads out is floor all the same
    floor = shapely.union_all([region.polygon for region in context.once(sealed_regions) if not region.is_outside])
    for part, polygon in mirrors:
        for behind in _behind(polygon, floor):
            phantom = floor.intersection(behind)
            if phantom.area > _PIECE_M2:
                middle = phantom.centroid
                message = (
                    f"what is seen in mirror '{part.link}' lies behind it, where the map has free floor: "
                    f"{phantom.area:.2g} m2 within {_BEHIND_M:g} m"
                )
                hint = 'leave out returns from its direction (lidar="mirror" keeps only the mirror out of the fields)'
                yield Problem(part.shape.element, message, hint, xyz=(middle.x, middle.y))


def l011_thin_wall(context: Context) -> Iterator[Problem]:
    """A wall is thinner than a cell of the rasters made from the map: it comes out thicker, or not at all.

    Bad:
      <link name="wall_a"><wk:object class="wall"/>
      <collision><origin xyz="0 0 1.2"/><geometry><box size="4 0.02 2.4"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
    Good:
      <link name="wall_a"><wk:object class="wall"/>
      <collision><origin xyz="0 0 1.2"/><geometry><box size="4 0.1 2.4"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
    """
    cell_m = context.tolerances.cell_m
    for run in context.once(sound_runs):
        if run.thickness_m < cell_m - 1e-9:
            message = f"wall '{run.link}' is {run.thickness_m * 100:.2g} cm thick, thinner than a cell of {cell_m:g} m"
            middle = tuple((run.start + run.end) / 2)
            hint = f"a raster of it wants cells of {run.thickness_m:.2g} m (--set rules.cell_m={run.thickness_m:.2g})"
            yield Problem(run.parts[0].shape.geometry.spot("size"), message, hint, xyz=middle)


def l012_narrow_way(context: Context) -> Iterator[Problem]:
    """A way through is narrower than two cells: in a raster of the map it is closed, or it leaks, as the cells fall.

    Bad:
      <wk:map format="1.0" units="m rad" scan_plane="0.3"/>
      <link name="wall_a"><wk:object class="wall"/><wk:opening id="o" kind="passage" along="1.95 2.02" z="0 2"/>
      <collision><origin xyz="0.95 0 1"/><geometry><box size="2 0.1 2"/></geometry></collision>
      <collision><origin xyz="3.035 0 1"/><geometry><box size="2.03 0.1 2"/></geometry></collision>
      <collision><origin xyz="2 3 1"/><geometry><box size="4.1 0.1 2"/></geometry></collision>
      <collision><origin xyz="0 1.5 1"/><geometry><box size="0.1 3 2"/></geometry></collision>
      <collision><origin xyz="4 1.5 1"/><geometry><box size="0.1 3 2"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
    Good:
      <wk:map format="1.0" units="m rad" scan_plane="0.3"/>
      <link name="wall_a"><wk:object class="wall"/>
      <collision><origin xyz="2 0 1"/><geometry><box size="4.1 0.1 2"/></geometry></collision>
      <collision><origin xyz="2 3 1"/><geometry><box size="4.1 0.1 2"/></geometry></collision>
      <collision><origin xyz="0 1.5 1"/><geometry><box size="0.1 3 2"/></geometry></collision>
      <collision><origin xyz="4 1.5 1"/><geometry><box size="0.1 3 2"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
    """
    import shapely

    cell_m = context.tolerances.cell_m
    # a declared one also where there is another way round, so that closing it parts nothing
    widths_m = {hole: float(np.ptp(hole.opening.along_m)) for hole in context.once(holes)}
    narrow = {hole: width_m for hole, width_m in widths_m.items() if _CHINK_M < width_m < 2 * cell_m}
    for declared, width_m in narrow.items():
        yield _narrow(declared.opening.element, _of(declared), width_m, cell_m, declared.centre)
    cut = slice_parts(context.once(structure), flood_plane_m(context))
    if not _has_narrow_ways(cut.polygons, 2 * cell_m):
        return
    coarse = [region for region in flood(list(cut.polygons), 2 * cell_m) if region.area_m2 > _PIECE_M2]
    if len(coarse) <= sum(region.area_m2 > _PIECE_M2 for region in context.once(fine_regions)):
        return
    for region in context.once(fine_regions):
        pieces = [piece.polygon for piece in coarse if piece.polygon.representative_point().within(region.polygon)]
        if len(pieces) < 2:
            continue
        rest = [way for way in shapely.get_parts(region.polygon.difference(shapely.union_all(pieces))) if way.area > 0]
        for way in rest:
            if sum(way.distance(piece) < 1e-6 for piece in pieces) < 2:
                continue
            x, y = way.centroid.x, way.centroid.y
            width_m = 2 * min(float(polygon.distance(way.centroid)) for polygon in cut.polygons)
            hole = next((h for h in context.once(holes) if h.footprint.intersects(way)), None)
            if hole is None:
                yield _narrow(context.root, "a way through", width_m, cell_m, np.array([x, y]))
            elif hole not in narrow:
                yield _narrow(hole.opening.element, _of(hole), width_m, cell_m, np.array([x, y]))


# -------------------------------------------------------------------------------------------- details


def _narrow(at: Element, what: str, width_m: float, cell_m: float, place: Float64Array) -> Problem:
    message = f"{what} is {width_m * 100:.2g} cm wide, less than two cells of {cell_m:g} m: a raster closes it"
    return Problem(at, message, "close it, or draw rasters with smaller cells", xyz=tuple(place.tolist()))


def _of(hole: Hole) -> str:
    return f"opening '{hole.opening.id}' of '{hole.wall.name}'"


def _has_narrow_ways(polygons: Sequence[Polygon], width_m: float) -> bool:
    """Whether any two of the cuts stand apart by less than a width: floods cost more than looking."""
    import shapely

    shapes = np.array(polygons, dtype=object)
    pairs = shapely.STRtree(shapes).query(shapes, predicate="dwithin", distance=width_m)
    i, j = pairs[:, pairs[0] < pairs[1]]
    return bool((shapely.distance(shapes[i], shapes[j]) > _CHINK_M).any())


def _behind(mirror: Polygon, floor: Polygon) -> Iterator[Polygon]:
    """Rectangles as wide as the mirror on each side of it that it turns its back to: the other side looks onto floor."""
    from shapely import Point, Polygon

    corners: Float64Array = np.array(mirror.minimum_rotated_rectangle.exterior.coords)[:4]
    edges = np.roll(corners, -1, axis=0) - corners
    long = int(np.argmax(np.hypot(*edges.T)))
    along = edges[long] / np.hypot(*edges[long])
    across = np.array([-along[1], along[0]])
    centre, half_m = corners.mean(axis=0), float(np.hypot(*edges[long])) / 2
    thick_m = float(np.hypot(*edges[(long + 1) % 4])) / 2
    for side in (across, -across):
        if floor.distance(Point(centre + side * (thick_m + _BESIDE_M))) < _BESIDE_M / 2:
            ends = (centre - along * half_m, centre + along * half_m)
            yield Polygon([*ends, ends[1] - side * _BEHIND_M, ends[0] - side * _BEHIND_M])


RULES = (
    Rule("WK-L005", "info", l005_interior),
    Rule("WK-L007", "warning", l007_mirror),
    Rule("WK-L011", "warning", l011_thin_wall),
    Rule("WK-L012", "warning", l012_narrow_way),
)
