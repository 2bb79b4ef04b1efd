"""An occupancy grid -> a picture of its walls in the map frame, cropped and no finer than it will be shown."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wallkit.core.geometry import invert, transform_points
from wallkit.core.types import Float64Array, Int8Array, Int64Array, OccupancyGrid, UInt8Array

# RGB of unknown, free, occupied; free is the lightest, so that paths stand out on it
WALL_COLOURS = ((233, 236, 239), (255, 255, 255), (74, 85, 96))
OCCUPIED_PERCENT = 50


@dataclass(frozen=True, slots=True)
class View:
    """A rectangle of the map frame [m]."""

    left: float
    bottom: float
    right: float
    top: float

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """(left, right, bottom, top), the order matplotlib wants."""
        return self.left, self.right, self.bottom, self.top

    @property
    def size(self) -> tuple[float, float]:
        """(width, height) [m]."""
        return self.right - self.left, self.top - self.bottom


def view_of(points: Float64Array, *, margin_m: float, aspect: float | None = None) -> View:
    """The rectangle that holds all points (K, 2) and a margin, widened to an aspect (width / height) if one is given."""
    low, high = points.min(axis=0) - margin_m, points.max(axis=0) + margin_m
    if aspect is not None:
        width, height = high - low
        grow = np.array([max(width, height * aspect), max(height, width / aspect)]) - (high - low)
        low, high = low - grow / 2, high + grow / 2
    return View(float(low[0]), float(low[1]), float(high[0]), float(high[1]))


def draw_walls(grid: OccupancyGrid, view: View, *, pixels: tuple[int, int]) -> UInt8Array:
    """The walls inside a view as (H, W) indices into `WALL_COLOURS`, row 0 at the top; beyond the grid is unknown.

    Args:
        pixels: (W, H) of the picture. Where a pixel covers several cells, the darkest wins, so that no wall is lost.
    """
    width, height = pixels
    factor = max(1, int(max(view.size[0] / width, view.size[1] / height) / grid.resolution_m))
    x = view.left + (np.arange(width) + 0.5) * view.size[0] / width
    y = view.top - (np.arange(height) + 0.5) * view.size[1] / height
    cells = _sampled(_pooled(grid.cells, factor), *_cell_indices(grid, x, y, grid.resolution_m * factor))
    return np.where(cells < 0, 0, np.where(cells >= OCCUPIED_PERCENT, 2, 1)).astype(np.uint8)


def _pooled(cells: Int8Array, factor: int) -> Int8Array:
    """Largest cell of each factor x factor block: occupied before free before unknown."""
    if factor == 1:
        return cells
    height, width = cells.shape
    padded = np.pad(cells, ((0, -height % factor), (0, -width % factor)), constant_values=-1)
    blocks = padded.reshape(padded.shape[0] // factor, factor, padded.shape[1] // factor, factor)
    return np.asarray(blocks.max(axis=(1, 3)))


def _cell_indices(
    grid: OccupancyGrid, x: Float64Array, y: Float64Array, cell_m: float
) -> tuple[Int64Array, Int64Array]:
    """Row and column of the cell under each pixel, broadcastable to (H, W); they may lie outside the grid."""
    if grid.origin[2] == 0:
        # an upright grid needs no transform of every single pixel
        rows, columns = (y - grid.origin[1])[:, None], (x - grid.origin[0])[None, :]
    else:
        points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        in_grid = transform_points(invert(grid.origin), points).reshape(len(y), len(x), 2)
        rows, columns = in_grid[..., 1], in_grid[..., 0]
    return np.floor(rows / cell_m).astype(np.int64), np.floor(columns / cell_m).astype(np.int64)


def _sampled(cells: Int8Array, rows: Int64Array, columns: Int64Array) -> Int8Array:
    height, width = cells.shape
    inside = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
    nearest = cells[rows.clip(0, height - 1), columns.clip(0, width - 1)]
    return np.asarray(np.where(inside, nearest, -1), dtype=np.int8)
