"""A semantic map -> the fields a filter needs, drawn at the LiDAR's height: exact distances to the surfaces themselves.

What may not answer is weighted. A likelihood field scores a return at distance d from a surface with N(d; 0, sigma); one
that answers with probability p deserves p N(d; 0, sigma), which is N at the larger distance sqrt(d^2 + 2 sigma^2 ln(1 / p)).
The field holds the smallest of these over all surfaces, so every sensor model weighs glass and doors without knowing of
them. A surface that answers at least every other time counts in full (p = 1): rays that are followed through the field must
end there, and at p = 0.5 the difference is ln 2 = 0.7 nat of an untempered beam. Rays pass through all others.

For "all", p = P(the surface is there) * P(a beam returns from it). The field of one class is for returns already labelled
with it, so only the first factor counts there.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numba import njit

from wallkit.core.types import FieldSet, Float32Array, Float64Array, OccupancyGrid
from wallkit.errors import MapError
from wallkit.maps.grids.lattice import Lattice, lattice_around
from wallkit.maps.model import SemanticMap
from wallkit.maps.surfaces import Surfaces, floor_at, surfaces_at

# the sensor models' own default; with another sigma s a probability p works as p^(SIGMA_M^2 / s^2)
SIGMA_M = 0.1
COUNTS_IN_FULL = 0.5
MARGIN_M = 1.0
_BLOCK, _TILE = 256, 16
# rays end where the distance is below half a cell (core.raycast); a surface through a cell's corner is up to 0.71 away
_STOPS_RAYS = 0.49


@dataclass(frozen=True)
class DrawnMap:
    """A semantic map at one height: as fields to score, as grid to look at."""

    fields: FieldSet
    grid: OccupancyGrid


def fields_from_map(
    semantic_map: SemanticMap,
    *,
    cell_m: float = 0.025,
    scan_plane_m: float | None = None,
    sigma_m: float = SIGMA_M,
) -> DrawnMap:
    """The fields of a sound map.

    Args:
        cell_m: side of a cell.
        scan_plane_m: height of the LiDAR above the floor; None takes the map's own.
        sigma_m: the sensor model's, for the weight of what may not answer.

    Returns:
        Distances hold at cell centres and are exact there, but for cells that a surface passes through: they have at most
        0.49 cells, so that no ray slips between two of them. The fields of the classes are drawn when they are first
        asked for. In the grid everything that stands with the doors closed is occupied, glass and mirrors too.

    Raises:
        MapError: no height is known, nothing is there to be seen, or the map is too large for such cells.
    """
    z_m = height_m(semantic_map, scan_plane_m)
    floor = floor_at(semantic_map, z_m)
    surfaces = surfaces_at(semantic_map, floor)
    ends = floor.cut.segments.reshape(-1, 2)
    lattice = lattice_around(ends, cell_m, margin_m=MARGIN_M, source=semantic_map.source, flag="--set maps.cell_m=")
    solid = lattice.drawn(floor.cut.polygons)
    is_free = lattice.floor(floor) & ~solid
    origin = lattice.origin
    distances = _Distances(surfaces, lattice, sigma_m)
    cells = np.where(solid, 100, np.where(is_free, 0, -1)).astype(np.int8)
    source = semantic_map.source
    return DrawnMap(FieldSet(distances, is_free, cell_m, origin, source), OccupancyGrid(cells, cell_m, origin, source))


def height_m(semantic_map: SemanticMap, given_m: float | None) -> float:
    """The LiDAR's height above the floor: the one given, else what the map says.

    Raises:
        MapError: neither does.
    """
    z_m = semantic_map.header.scan_plane_m if given_m is None else given_m
    if z_m is None:
        raise MapError(
            "the map does not say at which height the LiDAR cuts it",
            where=semantic_map.source,
            hint='<wk:map scan_plane="0.30" ...> in the map, or --set maps.scan_plane_m=0.30',
        )
    return z_m


def distances_to_segments(
    segments: Float64Array, extra_m: Float64Array, low: Float64Array, cell_m: float, shape: tuple[int, int]
) -> Float32Array:
    """Smallest sqrt(d^2 + extra^2) (H, W) float32 [m] over segments, d the distance from a cell's centre to a segment.

    At most 0.49 cells where a segment without extra passes through the cell.

    Args:
        segments: (S, 4) x0, y0, x1, y1 [m], S > 0. extra_m: (S,). low: (2,) corner of cell (0, 0). shape: (H, W).
    """
    out = np.empty(shape, dtype=np.float32)
    lines = np.ascontiguousarray(segments, dtype=np.float64)
    _fill_tiles(lines, np.square(extra_m, dtype=np.float64), float(low[0]), float(low[1]), cell_m, out)
    return out


# -------------------------------------------------------------------------------------------- details


class _Distances(Mapping[str, Float32Array]):
    """The distance fields by class, "all" first; each is computed once, when it is asked for."""

    def __init__(self, surfaces: Surfaces, lattice: Lattice, sigma_m: float) -> None:
        self._surfaces, self._lattice, self._sigma_m = surfaces, lattice, sigma_m
        self._drawn: dict[str, Float32Array] = {}

    def __getitem__(self, name: str) -> Float32Array:
        if name not in self._names:
            raise KeyError(name)
        if name not in self._drawn:
            self._drawn[name] = self._field(name)
        return self._drawn[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    @cached_property
    def _names(self) -> tuple[str, ...]:
        return ("all", *sorted(set(self._surfaces.classes)))

    def _field(self, name: str) -> Float32Array:
        s = self._surfaces
        answers = s.p_there * s.p_return if name == "all" else s.p_there
        chosen = np.array([name in ("all", class_name) for class_name in s.classes])
        segments, p = s.segments[chosen], answers[chosen]
        extra_m = np.where(p >= COUNTS_IN_FULL, 0.0, self._sigma_m * np.sqrt(-2.0 * np.log(np.minimum(p, 1.0))))
        at = self._lattice
        return distances_to_segments(segments, extra_m, at.low, at.cell_m, (at.rows, at.columns))


@njit(cache=True, nogil=True)
def _fill_tiles(segments: Any, extra: Any, x0: Any, y0: Any, cell: Any, out: Any) -> None:
    """out = smallest sqrt(d^2 + extra) at every cell centre, and enough to stop a ray in the cells of a surface.

    The value changes by no more than the way moved, so in a block of cells only segments count whose value at its middle is
    within twice the block's radius of the smallest there; in a tile of the block, only some of those.

    Args:
        segments: (S, 4) float64. extra: (S,) float64 [m^2]. x0, y0: corner of cell (0, 0). out: (H, W) float32, written.
    """
    height, width = out.shape
    everything = np.arange(len(segments))
    in_block, in_tile = everything.copy(), everything.copy()
    values = np.empty(len(segments))
    for block_row in range(0, height, _BLOCK):
        for block_column in range(0, width, _BLOCK):
            end_row, end_column = min(block_row + _BLOCK, height), min(block_column + _BLOCK, width)
            x, y = x0 + 0.5 * (block_column + end_column) * cell, y0 + 0.5 * (block_row + end_row) * cell
            radius = 0.5 * cell * math.hypot(end_column - block_column, end_row - block_row)
            near = _within_reach(segments, extra, everything, len(segments), x, y, radius, values, in_block)
            for tile_row in range(block_row, end_row, _TILE):
                for tile_column in range(block_column, end_column, _TILE):
                    last_row, last_column = min(tile_row + _TILE, height), min(tile_column + _TILE, width)
                    x, y = x0 + 0.5 * (tile_column + last_column) * cell, y0 + 0.5 * (tile_row + last_row) * cell
                    radius = 0.5 * cell * math.hypot(last_column - tile_column, last_row - tile_row)
                    count = _within_reach(segments, extra, in_block, near, x, y, radius, values, in_tile)
                    for row in range(tile_row, last_row):
                        for column in range(tile_column, last_column):
                            x, y = x0 + (column + 0.5) * cell, y0 + (row + 0.5) * cell
                            out[row, column] = _smallest(segments, extra, in_tile, count, x, y, cell)


@njit(cache=True, nogil=True)
def _within_reach(
    segments: Any, extra: Any, asked: Any, asked_count: Any, x: Any, y: Any, radius: Any, values: Any, kept: Any
) -> Any:
    """Writes to `kept` those of the asked segments that may be the smallest somewhere within a radius; how many."""
    nearest = np.inf
    for k in range(asked_count):
        dx, dy = _way_to(segments, asked[k], x, y)
        values[k] = math.sqrt(dx * dx + dy * dy + extra[asked[k]])
        nearest = min(nearest, values[k])
    count = 0
    for k in range(asked_count):
        if values[k] <= nearest + 2.0 * radius:
            kept[count] = asked[k]
            count += 1
    return count


@njit(inline="always")
def _smallest(segments: Any, extra: Any, asked: Any, asked_count: Any, x: Any, y: Any, cell: Any) -> Any:
    """The smallest sqrt(d^2 + extra) at a cell's centre, at most _STOPS_RAYS where a surface passes through the cell."""
    best, limit = np.inf, np.inf
    for k in range(asked_count):
        dx, dy = _way_to(segments, asked[k], x, y)
        square = dx * dx + dy * dy
        best = min(best, square + extra[asked[k]])
        # the line at a right angle to the way goes through the cell
        if extra[asked[k]] == 0.0 and square <= 0.5 * cell * (abs(dx) + abs(dy)):
            limit = _STOPS_RAYS * cell
    return min(math.sqrt(best), limit)


@njit(inline="always")
def _way_to(segments: Any, s: Any, x: Any, y: Any) -> Any:
    """(dx, dy) from the nearest point of segment s to a point."""
    ax, ay = x - segments[s, 0], y - segments[s, 1]
    bx, by = segments[s, 2] - segments[s, 0], segments[s, 3] - segments[s, 1]
    u = min(max((ax * bx + ay * by) / (bx * bx + by * by), 0.0), 1.0)
    return ax - u * bx, ay - u * by
