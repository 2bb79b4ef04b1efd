"""Extents, polygons and floors -> cells: the grid that fields and rasters of a semantic map are drawn on."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from wallkit.core.types import BoolArray, Float64Array
from wallkit.errors import MapError
from wallkit.maps.surfaces import Floor

# a floor of 150 m x 150 m at 2.5 cm; beyond it a larger cell is wanted
MOST_CELLS = 36_000_000
_INDOORS_STEP_M = 0.2


@dataclass(frozen=True, eq=False)
class Lattice:
    """The cells: corner of cell (0, 0) in frame map, side, and how many."""

    low: Float64Array
    cell_m: float
    rows: int
    columns: int

    @property
    def origin(self) -> Float64Array:
        """(3,) T_map_grid."""
        return np.array([*self.low, 0.0])

    def drawn(self, polygons: Any) -> BoolArray:
        """The cells (H, W) that polygons touch, holes left open."""
        import cv2
        import shapely

        picture = np.zeros((self.rows, self.columns), dtype=np.uint8)
        # OpenCV's whole numbers are pixel centres; 1/256 pixel is finer than any map is known
        for polygon in polygons:
            rings = [shapely.get_coordinates(ring) for ring in (polygon.exterior, *polygon.interiors)]
            pixels = [np.rint(((ring - self.low) / self.cell_m - 0.5) * 256).astype(np.int32) for ring in rings]
            cv2.fillPoly(picture, pixels, (1,), shift=8)
        return np.asarray(picture > 0)

    def floor(self, floor: Floor) -> BoolArray:
        """The cells (H, W) of floor a robot may be on; outside of closed rooms asked every 0.2 m."""
        free = self.drawn([*floor.regions, *floor.rooms])
        every = max(1, round(_INDOORS_STEP_M / self.cell_m))
        row, column = np.mgrid[every // 2 : self.rows : every, every // 2 : self.columns : every]
        centres = self.low + (np.column_stack([column.ravel(), row.ravel()]) + 0.5) * self.cell_m
        asked = floor.holds(centres).reshape(row.shape)
        blocks = asked.repeat(every, axis=0).repeat(every, axis=1)[: self.rows, : self.columns]
        missing = ((0, self.rows - blocks.shape[0]), (0, self.columns - blocks.shape[1]))
        return np.asarray(free | np.pad(blocks, missing, mode="edge"))


def lattice_around(points: Float64Array, cell_m: float, *, margin_m: float, source: str, flag: str) -> Lattice:
    """The cells that hold points (K, 2) and a margin; corners lie at whole multiples of the cell.

    Args:
        source: the map, for the message. flag: what sets the cell, as "--resolution ".

    Raises:
        MapError: they would be more than MOST_CELLS.
    """
    low = np.floor((points.min(axis=0) - margin_m) / cell_m) * cell_m
    columns, rows = (int(n) for n in np.ceil((points.max(axis=0) + margin_m - low) / cell_m))
    if rows * columns > MOST_CELLS:
        fitting_m = cell_m * math.sqrt(rows * columns / MOST_CELLS)
        raise MapError(
            f"{columns * cell_m:.0f} m x {rows * cell_m:.0f} m in cells of {cell_m:g} m are {rows * columns:,} cells, "
            f"more than {MOST_CELLS:,}",
            where=source,
            hint=f"if its lengths are metres (`wallkit map validate {source}` tells), "
            f"{flag}{math.ceil(fitting_m * 1000) / 1000:g}",
        )
    return Lattice(low, cell_m, rows, columns)
