"""Wall axes that meet in a point -> how far each wall runs past, or stops short of, its end so that the corner is closed.

Boxes end square, so two walls drawn to a common point leave a notch outside and overlap inside. As in the restroom example
one wall runs through to the other's outer face and the other stops at its near face: closed, and nothing overlaps.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import combinations

import numpy as np

from wallkit.core.types import Float64Array, Int64Array

# ends this close are one point: drawings that share vertices agree to rounding; anything wider is a gap to be reported
MEETING_M = 0.001
# up to this bend two walls continue each other (mitred); above it one stops at the other
CONTINUES_RAD = math.radians(30)
# a wall never loses so much at its ends that less than this is left
SHORTEST_M = 0.01


def end_closures(axes: Float64Array, thicknesses_m: Float64Array) -> Float64Array:
    """Metres to add (or, negative, to take off) at the start and end of each wall.

    Ends that come to lie inside another wall stop at its face (T); of ends that share a point the straightest pair
    continues and the others stop at it (T, X), or else the thickest, then longest wall runs through (L).

    Args:
        axes: (N, 4) x, y of the start and x, y of the end [m], none of zero length. thicknesses_m: (N,).

    Returns:
        (N, 2). Ends that meet nothing: 0.
    """
    closures = np.zeros((len(axes), 2))
    if len(axes) < 2:
        return closures
    ends = np.asarray(axes, dtype=np.float64).reshape(-1, 2)
    lengths = np.hypot(*(ends[1::2] - ends[0::2]).T)
    # from each end into its wall, unit length
    inward = np.repeat((ends[1::2] - ends[0::2]) / lengths[:, None], 2, axis=0)
    inward[1::2] *= -1
    walls = np.repeat(np.arange(len(axes)), 2)
    flat = closures.reshape(-1)
    stopped = np.zeros(len(ends), dtype=bool)
    for end, wall in _ends_inside_walls(ends, thicknesses_m):
        flat[end] = stop_at(
            ends[end] - ends[2 * wall], inward[end], thicknesses_m[walls[end]], inward[2 * wall], thicknesses_m[wall]
        )
        stopped[end] = True
    for meeting in meetings(ends):
        here = meeting[~stopped[meeting]]
        if len(here) > 1:
            flat[here] = _close_meeting(inward[here], thicknesses_m[walls[here]], lengths[walls[here]])
    too_short = lengths + closures.sum(axis=1) < SHORTEST_M
    closures[too_short] = np.maximum(closures[too_short], 0.0)
    return closures


def _close_meeting(inward: Float64Array, thicknesses_m: Float64Array, lengths_m: Float64Array) -> Float64Array:
    """Closures (K,) of K ends that share a point."""
    closures = np.zeros(len(inward))
    bends = {
        (i, j): math.acos(np.clip(-inward[i] @ inward[j], -1.0, 1.0)) for i, j in combinations(range(len(inward)), 2)
    }
    pair = min(bends, key=lambda ends: bends[ends])
    if bends[pair] <= CONTINUES_RAD:
        closures[list(pair)] = thicknesses_m[list(pair)].max() / 2 * math.tan(bends[pair] / 2)
        through = list(pair)
    else:
        longest = max(range(len(inward)), key=lambda i: (thicknesses_m[i], lengths_m[i]))
        through = [longest]
        closures[longest] = max(
            _cover(inward[longest], thicknesses_m[longest], inward[i], thicknesses_m[i])
            for i in range(len(inward))
            if i != longest
        )
    for i in set(range(len(inward))) - set(through):
        closures[i] = max(
            stop_at(np.zeros(2), inward[i], thicknesses_m[i], inward[wall], thicknesses_m[wall]) for wall in through
        )
    return closures


def stop_at(
    offset: Float64Array, inward: Float64Array, thickness_m: float, along: Float64Array, through_m: float
) -> float:
    """How much a wall must grow so that both corners of its end touch the near face of the wall it runs into.

    offset (2,): its end, seen from any point of the other wall's axis, which runs along `along`.
    """
    normal = np.array([-along[1], along[0]])
    if normal @ inward < 0:
        normal = -normal
    sine, cosine = float(normal @ inward), abs(float(along @ inward))
    if sine < math.sin(CONTINUES_RAD):
        return 0.0
    wanted = through_m / 2 - thickness_m / 2 * cosine
    return float((normal @ offset - wanted) / sine)


def _cover(inward: Float64Array, thickness_m: float, other_inward: Float64Array, other_m: float) -> float:
    """How far a wall runs past the point it shares with a stopping one, to reach the outer edge of the corner."""
    cosine = float(-inward @ other_inward)
    sine = math.sqrt(max(0.0, 1.0 - cosine * cosine))
    if sine < math.sin(CONTINUES_RAD):
        return 0.0
    return float(np.clip((other_m - thickness_m * cosine) / 2 / sine, 0.0, max(thickness_m, other_m)))


def _ends_inside_walls(ends: Float64Array, thicknesses_m: Float64Array) -> Iterator[tuple[int, int]]:
    """(end, wall) where an end lies on another wall, away from that wall's own ends and not along it."""
    from shapely import STRtree, linestrings, points

    starts, stops = ends[0::2], ends[1::2]
    tree = STRtree(linestrings(np.stack([starts, stops], axis=1)))
    reach = float(thicknesses_m.max()) / 2 + MEETING_M
    end_index, wall_index = tree.query(points(ends), predicate="dwithin", distance=reach)
    along = stops[wall_index] - starts[wall_index]
    lengths = np.hypot(*along.T)
    along /= lengths[:, None]
    offset = ends[end_index] - starts[wall_index]
    at = (offset * along).sum(axis=1)
    away = np.abs(offset[:, 0] * along[:, 1] - offset[:, 1] * along[:, 0])
    own = stops[end_index // 2] - starts[end_index // 2]
    sine = np.abs(own[:, 0] * along[:, 1] - own[:, 1] * along[:, 0]) / np.hypot(*own.T)
    is_inside = (
        (end_index // 2 != wall_index)
        & (at > MEETING_M)
        & (at < lengths - MEETING_M)
        & (away <= thicknesses_m[wall_index] / 2 + MEETING_M)
        & (sine >= math.sin(CONTINUES_RAD))
    )
    # of several walls the nearest axis is the one it runs into
    order = np.flatnonzero(is_inside)[np.argsort(-away[is_inside], kind="stable")]
    nearest = dict(zip(end_index[order].tolist(), wall_index[order].tolist(), strict=True))
    yield from sorted(nearest.items())


def meetings(ends: Float64Array) -> Iterator[Int64Array]:
    """Indices of the ends (M, 2) that share a point, at least two at a time; MEETING_M apart is one point."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    pairs = cKDTree(ends).query_pairs(MEETING_M, output_type="ndarray")
    if not len(pairs):
        return
    links = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(ends), len(ends)))
    _, labels = connected_components(links, directed=False)
    order = np.argsort(labels, kind="stable")
    for group in np.split(order, np.flatnonzero(np.diff(labels[order])) + 1):
        if len(group) > 1:
            yield group
