"""Walls as line segments -> what a planar LiDAR measures among them, and the grid a mapper would have drawn."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from wallkit.core.types import Float64Array, OccupancyGrid, Scan


@dataclass(frozen=True)
class Plan:
    """A floor seen from above: walls (S, 4) float64 as x0, y0, x1, y1 [m] in frame map."""

    walls: Float64Array


def plan_from_polylines(*polylines: list[tuple[float, float]]) -> Plan:
    """A plan whose walls follow the given corner lists."""
    return Plan(np.array([(*a, *b) for line in polylines for a, b in pairwise(line)], dtype=np.float64))


def cast(
    plan: Plan, discs: Float64Array, origin: Float64Array, bearings_rad: Float64Array, reach_m: float
) -> Float64Array:
    """Exact range (K,) [m] from a point (2,) along each bearing to the nearest wall or disc; inf beyond reach.

    Args:
        discs: (D, 3) x, y, radius of people and carts.
    """
    direction = np.stack([np.cos(bearings_rad), np.sin(bearings_rad)], axis=1)
    ranges = np.minimum(_to_segments(plan.walls, origin, direction), _to_discs(discs, origin, direction))
    return np.where(ranges <= reach_m, ranges, np.inf)


def instant_scan(
    rng: np.random.Generator, plan: Plan, pose: Float64Array, stamp_ns: int, *, beams: int = 270, sigma_m: float = 0.015
) -> Scan:
    """What a LiDAR at a pose (3,) measures among the walls at one moment, over 270 degrees and up to 12 m."""
    bearings = np.linspace(-0.75 * np.pi, 0.75 * np.pi, beams)
    ranges = cast(plan, np.zeros((0, 3)), pose[:2], pose[2] + bearings, 12.0) + sigma_m * rng.standard_normal(beams)
    return Scan(stamp_ns, "laser", ranges.astype(np.float32), bearings.astype(np.float32), 0.0, 0.1, 12.0)


def occupancy(plan: Plan, resolution_m: float, *, margin_m: float = 1.0, inside: Float64Array) -> OccupancyGrid:
    """The plan as a grid: walls occupied, what can be reached from a point (2,) inside free, the rest unknown.

    The grid is laid so that walls at multiples of the resolution run through the middle of cells.
    """
    import cv2

    low = np.floor((plan.walls.reshape(-1, 2).min(axis=0) - margin_m) / resolution_m) * resolution_m - resolution_m / 2
    high = plan.walls.reshape(-1, 2).max(axis=0) + margin_m
    width, height = np.ceil((high - low) / resolution_m).astype(int)
    walls = np.zeros((height, width), dtype=np.uint8)
    for x0, y0, x1, y1 in plan.walls:
        steps = np.linspace(0.0, 1.0, max(2, int(4 * np.hypot(x1 - x0, y1 - y0) / resolution_m)))[:, None]
        points = (1 - steps) * (x0, y0) + steps * (x1, y1)
        column, row = np.floor((points - low) / resolution_m).astype(int).T
        walls[row, column] = 1
    seed = np.floor((inside - low) / resolution_m).astype(int)
    mask = np.pad(walls, 1)
    cv2.floodFill(walls.copy(), mask, (int(seed[0]), int(seed[1])), 1, flags=4 | (2 << 8) | cv2.FLOODFILL_MASK_ONLY)
    cells = np.where(walls > 0, 100, np.where(mask[1:-1, 1:-1] == 2, 0, -1)).astype(np.int8)
    return OccupancyGrid(cells, resolution_m, np.array([*low, 0.0]), source="simulated plan")


def _to_segments(walls: Float64Array, origin: Float64Array, direction: Float64Array) -> Float64Array:
    """Smallest positive r with origin + r direction on a wall, (K,)."""
    start, along = walls[:, :2] - origin, walls[:, 2:] - walls[:, :2]
    cross = direction[:, None, 0] * along[None, :, 1] - direction[:, None, 1] * along[None, :, 0]
    parallel = np.abs(cross) < 1e-12
    cross = np.where(parallel, 1.0, cross)
    r = (start[:, 0] * along[:, 1] - start[:, 1] * along[:, 0])[None, :] / cross
    s = (start[None, :, 0] * direction[:, None, 1] - start[None, :, 1] * direction[:, None, 0]) / cross
    hit = ~parallel & (r > 0) & (s >= 0) & (s <= 1)
    return np.asarray(np.where(hit, r, np.inf).min(axis=1, initial=np.inf))


def _to_discs(discs: Float64Array, origin: Float64Array, direction: Float64Array) -> Float64Array:
    """Smallest positive r with origin + r direction on a circle, (K,)."""
    centre = discs[:, :2] - origin
    along = direction @ centre.T
    square = discs[None, :, 2] ** 2 - (np.sum(centre**2, axis=1)[None, :] - along**2)
    r = along - np.sqrt(np.maximum(square, 0.0))
    return np.asarray(np.where((square >= 0) & (r > 0), r, np.inf).min(axis=1, initial=np.inf))
