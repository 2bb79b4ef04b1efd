"""OccupancyGrid -> what a LiDAR sees of it: the distance to the nearest visible surface, and where a robot can stand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wallkit.core.config import setting
from wallkit.core.types import BoolArray, FieldSet, Float32Array, OccupancyGrid
from wallkit.errors import MapError

# nav_msgs/OccupancyGrid leaves the thresholds to the reader; these are map_saver's
OCCUPIED_FROM = 65
FREE_TO = 25
# how far unknown cells are looked through from free space to a wall
SEEN_THROUGH_M = 0.3


@dataclass(frozen=True)
class MapsSettings:
    """The [maps] table of wallkit.toml."""

    wall_depth_m: float = setting(
        0.5, "how far behind its visible side a raster's wall may still be the surface", low=0
    )
    scan_plane_m: float | None = setting(
        None, "height above the floor at which a semantic map is cut; none takes the map's scan_plane", low=0
    )
    cell_m: float = setting(0.025, "side of a cell of the fields of a semantic map", low=0.005, high=1)


def fields_from_grid(grid: OccupancyGrid, *, wall_depth_m: float = MapsSettings.wall_depth_m) -> FieldSet:
    """Distance field and free space of a raster map.

    Where a grid was made from scans, a wall is a band in which the surface lies somewhere, so its cells count as surface up
    to `wall_depth_m` behind the side that free space sees; for a drawn floor plan the visible side is exact, and 0 is right.

    Raises:
        MapError: no occupied cell (nothing to localize against) or no free one (nowhere to be).
    """
    occupied = grid.cells >= OCCUPIED_FROM
    free = (grid.cells >= 0) & (grid.cells <= FREE_TO)
    if not occupied.any():
        raise MapError("the map has no occupied cell", where=grid.source, hint="check occupied_thresh and negate")
    if not free.any():
        raise MapError("the map has no free cell", where=grid.source, hint="check free_thresh and negate")
    surface = visible_surface(occupied, free, grid.resolution_m)
    if wall_depth_m > 0:
        surface |= occupied & (distance_to(surface, grid.resolution_m) <= wall_depth_m)
    return FieldSet({"all": distance_to(surface, grid.resolution_m)}, free, grid.resolution_m, grid.origin, grid.source)


def visible_surface(occupied: BoolArray, free: BoolArray, resolution_m: float) -> BoolArray:
    """Occupied cells that free space can see: a wall's inside is never seen.

    A likelihood field built from solid walls draws endpoints into them (Beluga #265). Unknown cells between free space and
    a wall (soft edges of a probability grid) are looked through up to SEEN_THROUGH_M. A wall that no free space is near,
    as in maps that mark only walls, is kept by its outline.
    """
    import cv2

    square = np.ones((3, 3), np.uint8)
    solid = occupied.astype(np.uint8)
    seen_from = free.astype(np.uint8)
    for _ in range(max(1, round(SEEN_THROUGH_M / resolution_m))):
        seen_from = np.asarray(cv2.dilate(seen_from, square) * (1 - solid), dtype=np.uint8)
    touched = occupied & (cv2.dilate(seen_from, square) > 0)
    count, labels = cv2.connectedComponents(solid, connectivity=8)
    is_seen = np.zeros(count, dtype=bool)
    is_seen[labels[touched]] = True
    is_seen[0] = True
    inside = cv2.erode(solid, square, borderType=cv2.BORDER_CONSTANT, borderValue=0) > 0
    return np.asarray(touched | (occupied & ~is_seen[labels] & ~inside))


def distance_to(surface: BoolArray, resolution_m: float) -> Float32Array:
    """Exact Euclidean distance (H, W) float32 [m] from every cell's centre to the nearest surface cell's centre."""
    import cv2

    # DIST_MASK_PRECISE is Felzenszwalb & Huttenlocher's exact transform, not a chamfer
    away = cv2.distanceTransform((~surface).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return np.asarray(away * np.float32(resolution_m), dtype=np.float32)
