"""Segments and blocks of free floor -> how far a beam can reach from anywhere in a block: what lies farther is hidden.

It serves the search for rivals as the distance fields do: it only rules out. A surface counts as the end of sight when
every beam from the block within an interval of directions meets it, and beams that end behind it by more than the
tolerance are then explained by no pose of the block.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from wallkit.maps.score.nearness import BLOCK, TURNS, Nearness
from wallkit.maps.sight import first_hit

SECTORS = 72
# decimetres in a byte; 255 means that nothing ends the sight
UNSEEN_DM = 255
_LAYERS = 6
# half a heading interval of the coarsest lattice
_TURN_RAD = math.pi / TURNS


def horizons_for(near: Nearness) -> Any:
    """Room for the horizons of all blocks: (rows / BLOCK, columns / BLOCK, SECTORS) uint8 [dm], nothing hidden yet."""
    return np.full((*near.free_block.shape, SECTORS), UNSEEN_DM, dtype=np.uint8)


@njit(cache=True, nogil=True)
def look_round(sight: Any, near: Any, row: Any, column: Any, tolerance: Any, horizons: Any, looked: Any) -> None:
    """Fills in the horizon of a block, rounded up, unless it is known.

    Directions within a sector are covered widened by half a heading interval of the lattice to either side.
    """
    if looked[row, column]:
        return
    side = near.cell_m * BLOCK
    x, y = near.x_m + (column + 0.5) * side, near.y_m + (row + 0.5) * side
    width = 2 * math.pi / SECTORS
    longest = UNSEEN_DM / 10.0
    for sector in range(SECTORS):
        middle = (sector + 0.5) * width
        dx, dy = math.cos(middle), math.sin(middle)
        travelled = 0.0
        for _ in range(_LAYERS):
            way, met = first_hit(sight, x + travelled * dx, y + travelled * dy, dx, dy, longest - travelled)
            if met < 0:
                break
            travelled += way + 1e-6
            end = _end_of_sight(sight.segments, met, x, y, side / 2, middle, width / 2 + _TURN_RAD, tolerance)
            if end < longest:
                horizons[row, column, sector] = math.ceil(end * 10.0)
                break
            if travelled >= longest:
                break
    # last: another thread that comes by in between finds less hidden, which is true as well
    looked[row, column] = True


@njit(cache=True, nogil=True)
def _end_of_sight(segments: Any, s: Any, x: Any, y: Any, half: Any, middle: Any, spread: Any, tolerance: Any) -> Any:
    """Longest range at which a beam from a square can end within `tolerance` of segment s, or before it.

    Infinite unless all beams meet the segment. The beams from the corners along both ends of the interval decide: where
    they meet it is linear in the start, and between two directions the segment is met between.
    """
    farthest = 0.0
    bx, by = segments[s, 2] - segments[s, 0], segments[s, 3] - segments[s, 1]
    length = math.hypot(bx, by)
    for end in (-1.0, 1.0):
        dx, dy = math.cos(middle + end * spread), math.sin(middle + end * spread)
        across = dx * by - dy * bx
        slant = abs(across) / length
        if slant < 1e-6:
            return np.inf
        for corner in range(4):
            ax = segments[s, 0] - x - (half if corner & 1 else -half)
            ay = segments[s, 1] - y - (half if corner & 2 else -half)
            t = (ax * by - ay * bx) / across
            u = (ax * dy - ay * dx) / across
            if t < 0.0 or u < 0.0 or u > 1.0:
                return np.inf
            farthest = max(farthest, t + tolerance / slant)
    return farthest


PROFILE = 12
_PROFILE_BEAMS = 36
# a profile may differ by so many half diagonals of a block, and by the ranks of so many more beams than a rival may miss
_PROFILE_SLACK, _PROFILE_RANKS = 1.5, 0.05


@njit(cache=True, nogil=True)
def profiles_of(sight: Any, near: Any, reach: Any) -> Any:
    """(rows / BLOCK, columns / BLOCK, _PROFILE_BEAMS) float32: ranges all round from each block's centre in rising order.

    A profile does not depend on the heading. Zero from centres in or at a solid: they tell nothing of their block.
    """
    rows, columns = near.free_block.shape
    out = np.zeros((rows, columns, _PROFILE_BEAMS), dtype=np.float32)
    side = near.cell_m * BLOCK
    for row in range(rows):
        for column in range(columns):
            if not near.free_block[row, column]:
                continue
            closest = near.distances_cm[0, row * BLOCK + BLOCK // 2, column * BLOCK + BLOCK // 2]
            for label in range(1, near.distances_cm.shape[0]):
                closest = min(closest, near.distances_cm[label, row * BLOCK + BLOCK // 2, column * BLOCK + BLOCK // 2])
            if closest < 10:
                continue
            x, y = near.x_m + (column + 0.5) * side, near.y_m + (row + 0.5) * side
            for k in range(_PROFILE_BEAMS):
                turn = k * 2 * math.pi / _PROFILE_BEAMS
                way, _met = first_hit(sight, x, y, math.cos(turn), math.sin(turn), reach)
                out[row, column, k] = min(way, reach)
            out[row, column] = np.sort(out[row, column])
    return out


@njit(cache=True, nogil=True)
def alike_blocks(near: Any, profiles: Any, ranges: Any, reach: Any, missed_share: Any, whole_round: Any) -> Any:
    """(rows / BLOCK, columns / BLOCK) free blocks from whose centre the scene looks like a scan, whatever the heading.

    A heuristic, unlike the other bounds, with ample slack: a rival within half a block's diagonal of the centre shares all
    but a share of its beams, so the sorted ranges agree but for a shift in rank and in range. Scans of less than a whole
    turn cannot be compared so.
    """
    fits = near.free_block.copy()
    if not whole_round:
        return fits
    own = np.sort(np.minimum(ranges, reach))
    size = own.shape[0]
    slack = _PROFILE_SLACK * near.cell_m * (BLOCK / 2) * math.sqrt(2.0) + 0.05
    lows, highs, ranks = np.empty(PROFILE), np.empty(PROFILE), np.empty(PROFILE, dtype=np.int64)
    shift = missed_share + _PROFILE_RANKS
    for q in range(PROFILE):
        u = (q + 0.5) / PROFILE
        ranks[q] = int(u * _PROFILE_BEAMS)
        low, high = int((u - shift) * size), int((u + shift) * size) + 1
        lows[q] = own[low] - slack if u - shift > 0 else -np.inf
        highs[q] = own[high] + slack if high < size else np.inf
    rows, columns = fits.shape
    for row in range(rows):
        for column in range(columns):
            if fits[row, column] and profiles[row, column, _PROFILE_BEAMS - 1] > 0:
                for q in range(PROFILE):
                    r = profiles[row, column, ranks[q]]
                    if r < lows[q] or r > highs[q]:
                        fits[row, column] = False
                        break
    return fits
