"""map_server raster -> thin walls along its lines of occupied cells, with a report of how far they are from the cells.

A raster made from scans is cluttered; short faithful walls are worth more to a localizer than long pretty ones. What is too
small to be a wall, or what no wall explains, becomes a box of class `unknown`, so that nothing vanishes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from wallkit.core.geometry import transform_points
from wallkit.core.types import BoolArray, Float64Array, OccupancyGrid
from wallkit.errors import MapError
from wallkit.maps.draft.draft import Draft, DraftFixture, DraftWall
from wallkit.maps.draft.placed import placed_walls
from wallkit.maps.grids.fields import FREE_TO, OCCUPIED_FROM, MapsSettings, distance_to, visible_surface
from wallkit.maps.grids.raster import read_raster
from wallkit.maps.importers.imported import Imported, ImportOptions, Notes
from wallkit.maps.importers.skeleton import middle_lines

# how far a wall's axis may be from the middle of its cells
TOLERANCE_CELLS = 0.75
# a thing shorter than this in every direction is a speck, not a wall
SPECK_CELLS = 4
# a cell's centre so far beyond every wall's face is explained by none
EXPLAINED_CELLS = 0.75
# a wall is at least so much longer than thick (rule WK-E004)
SLENDER = 1.5
# a turned box may cover so much more than its cells before it is split into upright ones
LOOSE_BOX = 1.6


@dataclass(frozen=True)
class Residual:
    """Distances [m] between a raster and its boxes; 0 for what is inside of the other.

    cells_m (K,): of the middles of the seen cells to the boxes.
    outline_m (L,): of points on the outline of the boxes to the cells.
    """

    cells_m: Float64Array
    outline_m: Float64Array

    def __str__(self) -> str:
        parts = (
            f"{what} mean {values.mean() * 100:.1f} cm, 95 % within {np.quantile(values, 0.95) * 100:.1f} cm, "
            f"largest {values.max() * 100:.1f} cm"
            for what, values in (("seen cells to boxes", self.cells_m), ("boxes' outline to cells", self.outline_m))
        )
        return "; ".join(parts)


def read_map_raster(path: Path, options: ImportOptions) -> Imported:
    """The raster of a map_server YAML as one level.

    Raises:
        MapError: the pair cannot be read (see wallkit.maps.grids.raster), or has no occupied cell.
    """
    grid, findings = read_raster(path)
    notes = Notes(path, list(findings))
    occupied = grid.cells >= OCCUPIED_FROM
    if not occupied.any():
        raise MapError("the map has no occupied cell", where=path, hint="check occupied_thresh and negate in the YAML")
    band = _seen_band(grid, occupied)
    specks = _specks(band)
    tolerance = options.tolerance_m / grid.resolution_m if options.tolerance_m else TOLERANCE_CELLS
    strips = _strips(band & ~specks, tolerance)
    unexplained = band & ~specks & ~_covered(band, strips)
    walls = tuple(_walls(grid, strips, options))
    pieces = [*_pieces(specks), *_pieces(unexplained)]
    draft = Draft(
        path.stem.removesuffix(".map"),
        walls,
        tuple(_unknowns(grid, pieces, options)),
        scan_plane_m=options.scan_plane_m,
        source=path.name,
    )
    residual = residual_of(grid, band, draft)
    length_m = sum(wall.length_m for wall in walls)
    notes.read(
        f"{int(occupied.sum()):,} occupied cells of {grid.resolution_m:g} m became {len(walls):,} walls, "
        f"{length_m:.1f} m long, {np.median([wall.thickness_m for wall in walls]) if walls else 0:.3g} m thick (median)",
        walls=len(walls),
        length_m=length_m,
    )
    if pieces:
        share = float((specks | unexplained).sum() / band.sum())
        notes.guessed(
            f"{len(pieces):,} pieces of class unknown hold the {share:.1%} of the seen cells that no wall explains: "
            f"{int(specks.sum()):,} cells in specks, {int(unexplained.sum()):,} beside walls",
            share=share,
            pieces=len(pieces),
        )
    notes.read(
        f"residual: {residual}", cells_m=float(residual.cells_m.mean()), outline_m=float(residual.outline_m.mean())
    )
    notes.guessed(f"every wall is {options.height_m:g} m high: a raster has no heights")
    return Imported((draft,), tuple(notes.found))


def residual_of(grid: OccupancyGrid, band: BoolArray, draft: Draft) -> Residual:
    """How far what is seen of the grid (band (H, W)) and the draft's boxes are from each other, both ways."""
    from shapely import STRtree, box, get_coordinates, points, segmentize, union_all

    boxes = [
        _rectangle(*wall.pose, wall.length_m / 2, wall.length_m, wall.wall.thickness_m) for wall in placed_walls(draft)
    ]
    boxes += [_rectangle(*fixture.pose, 0.0, *fixture.size_m[:2]) for fixture in draft.fixtures]
    rows, columns = np.nonzero(band)
    centres = transform_points(grid.origin, np.column_stack([columns + 0.5, rows + 0.5]) * grid.resolution_m)
    cells_m = STRtree(boxes).query_nearest(points(centres), return_distance=True, all_matches=False)[1]
    outline = get_coordinates(segmentize(union_all(boxes).boundary, grid.resolution_m / 2))
    # back into cells, where a cell is an upright unit square
    turn = np.array([0.0, 0.0, -grid.origin[2]])
    samples = transform_points(turn, outline - grid.origin[:2]) / grid.resolution_m
    squares = STRtree(box(columns, rows, columns + 1, rows + 1))
    outline_cells = squares.query_nearest(points(samples), return_distance=True, all_matches=False)[1]
    return Residual(np.asarray(cells_m), np.asarray(outline_cells) * grid.resolution_m)


def _seen_band(grid: OccupancyGrid, occupied: BoolArray) -> BoolArray:
    """The occupied cells a LiDAR may have met: those the localizer takes for surface (wallkit.maps.grids.fields)."""
    free = (grid.cells >= 0) & (grid.cells <= FREE_TO)
    surface = visible_surface(occupied, free, grid.resolution_m)
    return np.asarray(surface | (occupied & (distance_to(surface, grid.resolution_m) <= MapsSettings.wall_depth_m)))


def _specks(band: BoolArray) -> BoolArray:
    """Cells of connected pieces too small to be walls."""
    labels, boxes = _components(band)
    is_speck = (boxes[:, 2] < SPECK_CELLS) & (boxes[:, 3] < SPECK_CELLS)
    is_speck[0] = False
    return np.asarray(is_speck[labels])


def _strips(band: BoolArray, tolerance_cells: float) -> Float64Array:
    """(N, 5) x, y of both ends and thickness, in cells, of straight strips along the middle of the band.

    A strip is as thick as its cells fill it: their number over its length.
    """
    import cv2

    lines = [line for line in middle_lines(band, tolerance_cells) if len(line) > 1]
    axes = np.array([(*a, *b) for line in lines for a, b in pairwise(line)]).reshape(-1, 4)
    lengths = np.hypot(axes[:, 2] - axes[:, 0], axes[:, 3] - axes[:, 1])
    axes, lengths = axes[lengths > 0], lengths[lengths > 0]
    if not len(axes):
        return np.empty((0, 5))
    # drawn four times finer, so that strips which share a cell keep apart
    fine = 4
    drawn = np.zeros((band.shape[0] * fine, band.shape[1] * fine), np.int32)
    for number, axis in enumerate(np.floor(axes * fine).astype(int).tolist(), start=1):
        cv2.line(drawn, tuple(axis[:2]), tuple(axis[2:]), number)
    _, nearest = cv2.distanceTransformWithLabels(
        (drawn == 0).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    strip_of = np.zeros(nearest.max() + 1, dtype=np.int64)
    strip_of[nearest[drawn > 0]] = drawn[drawn > 0]
    own = strip_of[nearest[fine // 2 :: fine, fine // 2 :: fine][band]]
    cells = np.bincount(own, minlength=len(axes) + 1)[1:]
    thickness = np.clip(cells / lengths, 1.0, np.maximum(1.0, (lengths + 1) / SLENDER))
    return np.column_stack([axes, thickness])


def _covered(band: BoolArray, strips: Float64Array) -> BoolArray:
    """Cells (H, W) of the band whose centre is on a strip, or nearly."""
    from shapely import STRtree, linestrings, points

    covered = np.zeros_like(band)
    if not len(strips):
        return covered
    rows, columns = np.nonzero(band)
    index, away = STRtree(linestrings(strips[:, :4].reshape(-1, 2, 2))).query_nearest(
        points(columns + 0.5, rows + 0.5), return_distance=True, all_matches=False
    )
    covered[rows, columns] = away - strips[index[1], 4] / 2 <= EXPLAINED_CELLS
    return covered


def _pieces(cells: BoolArray) -> Iterator[tuple[float, float, float, float, float]]:
    """(x, y, yaw, deep, wide) in cells, of boxes that hold exactly, or with little to spare, each piece of the cells."""
    import cv2

    labels, boxes = _components(cells)
    for number, (left, bottom, width, height, count) in enumerate(boxes.tolist()):
        if number == 0:
            continue
        own = labels[bottom : bottom + height, left : left + width] == number
        rows, columns = np.nonzero(own)
        corners = np.concatenate([np.column_stack([columns + i, rows + j]) for i in (0, 1) for j in (0, 1)])
        (x, y), (deep, wide), turned_deg = cv2.minAreaRect(corners.astype(np.float32))
        if deep * wide <= LOOSE_BOX * count:
            yield left + x, bottom + y, math.radians(turned_deg), deep, wide
            continue
        for x0, y0, x1, y1 in _upright(own):
            yield left + (x0 + x1) / 2, bottom + (y0 + y1) / 2, 0.0, float(x1 - x0), float(y1 - y0)


def _upright(cells: BoolArray) -> Iterator[tuple[int, int, int, int]]:
    """Upright rectangles (x0, y0, x1, y1) that hold exactly the cells: equal runs of following rows in one."""
    growing: dict[tuple[int, int], int] = {}
    for row in range(cells.shape[0] + 1):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], cells[row], [0]]))) if row < cells.shape[0] else np.empty(0)
        runs = {(int(x0), int(x1)) for x0, x1 in edges.reshape(-1, 2)}
        for run in sorted(set(growing) - runs):
            yield run[0], growing.pop(run), run[1], row
        for run in runs:
            growing.setdefault(run, row)


def _components(cells: BoolArray) -> tuple[np.ndarray, np.ndarray]:
    """Labels (H, W) of pieces connected by sides or corners, and (left, bottom, width, height, count) of each label."""
    import cv2

    _, labels, boxes, _ = cv2.connectedComponentsWithStats(cells.astype(np.uint8), connectivity=8)
    return labels, boxes


def _walls(grid: OccupancyGrid, strips: Float64Array, options: ImportOptions) -> Iterator[DraftWall]:
    ends = strips[:, :4].reshape(-1, 2)
    points = transform_points(grid.origin, ends * grid.resolution_m).tolist()
    for number, thickness in enumerate(strips[:, 4].tolist()):
        start, end = points[2 * number], points[2 * number + 1]
        thickness_m = options.thickness_m or thickness * grid.resolution_m
        yield DraftWall(
            f"wall_{number + 1}",
            (start[0], start[1]),
            (end[0], end[1]),
            thickness_m,
            options.height_m,
            sigma_m=grid.resolution_m / 2,
        )


def _unknowns(grid: OccupancyGrid, pieces: list[Any], options: ImportOptions) -> Iterator[DraftFixture]:
    for number, (x, y, yaw, deep, wide) in enumerate(pieces, start=1):
        ((at_x, at_y),) = transform_points(grid.origin, np.array([[x, y]]) * grid.resolution_m).tolist()
        size_m = (deep * grid.resolution_m, wide * grid.resolution_m, options.height_m)
        yield DraftFixture(f"unknown_{number}", "unknown", (at_x, at_y, yaw + float(grid.origin[2])), size_m)


def _rectangle(x: float, y: float, yaw: float, forward: float, deep: float, wide: float) -> Any:
    """A polygon, its middle `forward` of the pose (x, y, yaw) along its x."""
    from shapely import Polygon

    corners = [(forward + i * deep / 2, j * wide / 2) for i, j in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
    return Polygon(transform_points((x, y, yaw), corners))
