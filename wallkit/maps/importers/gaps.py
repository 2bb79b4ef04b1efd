"""Wall axes -> the places where their ends nearly meet: gaps, near-duplicate corners, T-junctions that miss."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wallkit.core.types import Float64Array
from wallkit.maps.draft.joints import MEETING_M, meetings

# rule WK-E020: what is wider is meant
WIDEST_GAP_M = 0.3
# corners this close are one corner clicked twice
DUPLICATE_M = 0.05


@dataclass(frozen=True, slots=True)
class Gap:
    """Two points that nearly meet: of which walls (by index), where (x, y) and how far apart [m]."""

    first: int
    second: int
    at: tuple[float, float]
    gap_m: float

    def __str__(self) -> str:
        return f"{self.gap_m:.3f} m at ({self.at[0]:.2f}, {self.at[1]:.2f})"


def find_gaps(axes: Float64Array) -> list[Gap]:
    """Corners up to WIDEST_GAP_M apart that no wall joins: of a free end, or nearly the same.

    Args:
        axes: (N, 4) x, y of start and end [m].
    """
    corners, walls_at = _corners(axes)
    return [
        Gap(walls_at[i][0], walls_at[j][0], _middle(corners[i], corners[j]), apart)
        for i, j, apart in _close(corners, WIDEST_GAP_M)
        if (min(len(walls_at[i]), len(walls_at[j])) == 1 or apart <= DUPLICATE_M)
        and not set(walls_at[i]) & set(walls_at[j])
    ]


def find_misses(axes: Float64Array, thicknesses_m: Float64Array) -> list[Gap]:
    """Free ends that stop up to WIDEST_GAP_M short of the face of another wall's middle; thicknesses_m: (N,)."""
    from shapely import STRtree, linestrings, points

    corners, walls_at = _corners(axes)
    neighbours = [set[int]() for _ in axes]
    for walls_here in walls_at:
        for wall in walls_here:
            neighbours[wall].update(walls_here)
    free = [index for index, walls in enumerate(walls_at) if len(walls) == 1]
    if not free:
        return []
    lines = linestrings(axes.reshape(-1, 2, 2))
    reach = WIDEST_GAP_M + float(thicknesses_m.max()) / 2
    ends, walls = STRtree(lines).query(points(corners[free]), predicate="dwithin", distance=reach)
    found: dict[int, Gap] = {}
    for end, wall in zip(ends.tolist(), walls.tolist(), strict=True):
        own, corner = walls_at[free[end]][0], corners[free[end]]
        start, stop = axes[wall, :2], axes[wall, 2:]
        along = float((corner - start) @ (stop - start)) / float((stop - start) @ (stop - start))
        # beside the ends of the other wall it is a gap between ends
        aside = thicknesses_m[wall] / 2 / float(np.hypot(*(stop - start)))
        short_m = float(np.hypot(*(start + along * (stop - start) - corner)) - thicknesses_m[wall] / 2)
        if wall in neighbours[own] or not aside < along < 1 - aside or not MEETING_M < short_m <= WIDEST_GAP_M:
            continue
        if end not in found or short_m < found[end].gap_m:
            found[end] = Gap(own, wall, (float(corner[0]), float(corner[1])), short_m)
    return list(found.values())


def find_near_duplicates(points_m: Float64Array) -> list[tuple[int, int, float]]:
    """(i, j, distance) of points (N, 2) that are not the same but closer than DUPLICATE_M."""
    return _close(points_m, DUPLICATE_M)


def gap_list(gaps: Sequence[Gap]) -> str:
    """The gaps in words, the first five of them."""
    rest = f", and {len(gaps) - 5} more" if len(gaps) > 5 else ""
    return ", ".join(map(str, gaps[:5])) + rest


def _corners(axes: Float64Array) -> tuple[Float64Array, list[list[int]]]:
    """Distinct end points (K, 2), and the walls that end at each."""
    ends = axes.reshape(-1, 2)
    shared = list(meetings(ends))
    alone = set(range(len(ends))) - {int(end) for group in shared for end in group}
    groups = [*([int(end) for end in group] for group in shared), *([end] for end in sorted(alone))]
    return np.array([ends[group[0]] for group in groups]), [[end // 2 for end in group] for group in groups]


def _close(points_m: Float64Array, within_m: float) -> list[tuple[int, int, float]]:
    """(i, j, distance) with i < j of points that are apart, but not further than within_m."""
    from scipy.spatial import cKDTree

    if len(points_m) < 2:
        return []
    pairs = cKDTree(points_m).query_pairs(within_m, output_type="ndarray")
    pairs = pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]
    apart = np.hypot(*(points_m[pairs[:, 0]] - points_m[pairs[:, 1]]).T)
    return [(int(i), int(j), float(d)) for (i, j), d in zip(pairs, apart, strict=True) if d > MEETING_M]


def _middle(a: Float64Array, b: Float64Array) -> tuple[float, float]:
    return float(a[0] + b[0]) / 2, float(a[1] + b[1]) / 2
