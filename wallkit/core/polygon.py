"""Points and polygons with holes -> which polygon each point lies in, by crossing number, winding number, even-odd or mask.

All agree but for points on an edge (Hormann & Agathos 2001), where rounding decides; the mask is as coarse as its pixels.
They agree as long as the rings of a polygon do not cross each other or themselves.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from wallkit.core.types import Float64Array, Int64Array

Int32Array = NDArray[np.int32]
OUTSIDE = -1
_BANDS = 32


@dataclass(frozen=True, eq=False)
class Polygons:
    """Polygons as the kernels take them.

    Attributes:
        edges: (5, E) float64: x, y of where each edge begins, x, y of where it ends, and dx / dy (0 where dy is).
        starts: (P + 1,) int64, edges of polygon p are starts[p] ... starts[p + 1] - 1.
        boxes: (P, 4) float64 lowest x, lowest y, highest x, highest y.
        bands: (P, B + 1) int64: a polygon's box is cut into B bands, and band b's edges are members[bands[p, b]] ...
            members[bands[p, b + 1] - 1], so that a point asks only the edges that are level with it.
        members: (M,) int64, edges.
    """

    edges: Float64Array
    starts: Int64Array
    boxes: Float64Array
    bands: Int64Array
    members: Int64Array

    def __len__(self) -> int:
        return len(self.boxes)


def packed(polygons: Sequence[Sequence[ArrayLike]]) -> Polygons:
    """Polygons given as rings (V, 2) each, the outline first, then its holes; whichever way they run, closed or not.

    A ring of fewer than three corners holds nothing.
    """
    around = np.tile(np.array([np.inf, np.inf, -np.inf, -np.inf]), (len(polygons), 1))
    rings = [(p, number, corners) for p, given in enumerate(polygons) for number, ring in enumerate(given)
             if len(corners := np.asarray(ring, dtype=np.float64).reshape(-1, 2)) >= 3]  # fmt: skip
    sizes = np.array([len(corners) for _, _, corners in rings], dtype=np.int64)
    owners = np.array([p for p, _, _ in rings], dtype=np.int64)
    firsts = np.concatenate([[0], np.cumsum(np.bincount(owners, sizes, len(polygons)))]).astype(np.int64)
    edges = np.zeros((5, int(sizes.sum())))
    if rings:
        corners, begin = np.concatenate([ring for _, _, ring in rings]), np.cumsum(sizes) - sizes
        following = np.arange(1, len(corners) + 1)
        following[begin + sizes - 1] = begin
        ends = corners[following]
        areas = np.add.reduceat(corners[:, 0] * ends[:, 1] - corners[:, 1] * ends[:, 0], begin)
        # outlines run one way and holes the other, so that they cancel in the winding number
        outlines = np.array([number == 0 for _, number, _ in rings])
        turned = np.repeat((areas > 0) != outlines, sizes)[:, None]
        edges[:2], edges[2:4] = np.where(turned, ends, corners).T, np.where(turned, corners, ends).T
        rise = edges[3] - edges[1]
        edges[4] = (edges[2] - edges[0]) / np.where(rise == 0, np.inf, rise)
        boxes = np.concatenate([np.minimum.reduceat(corners, begin), np.maximum.reduceat(corners, begin)], axis=1)
        around[owners[outlines]] = boxes[outlines]
    bands = np.zeros((len(around), _BANDS + 1), dtype=np.int64)
    members = np.empty(_count_bands(edges, firsts, around, bands), dtype=np.int64)
    _fill_bands(edges, firsts, around, bands, members)
    return Polygons(edges, firsts, around, bands, members)


def crossing_number(points: ArrayLike, polygons: Polygons) -> Int64Array:
    """(K,) the first polygon that each point (K, 2) lies in, OUTSIDE without one; NaN is outside.

    A ray to the right crosses the edges of a polygon an odd number of times from inside (Sunday 2001, cn_PnPoly).
    """
    return _located(_crossing, points, polygons)


def winding_number(points: ArrayLike, polygons: Polygons) -> Int64Array:
    """As `crossing_number`: the polygon winds round the point a number of times that is not 0 (Sunday 2001, wn_PnPoly)."""
    return _located(_winding, points, polygons)


def even_odd(points: ArrayLike, polygons: Polygons) -> Int64Array:
    """As `crossing_number`: every edge that the ray meets changes sides, edge by edge (Franklin 1970, PNPOLY)."""
    return _located(_even_odd, points, polygons)


def mask_lookup(points: ArrayLike, polygons: Polygons) -> Int64Array:
    """As `crossing_number`, at the pixel's centre that is nearest to the point, from a mask drawn for this call."""
    if not len(polygons):
        return np.full(len(np.asarray(points).reshape(-1, 2)), OUTSIDE)
    low, high = np.floor(polygons.boxes[:, :2].min(axis=0)), np.ceil(polygons.boxes[:, 2:].max(axis=0))
    if not np.isfinite(low).all():
        return np.full(len(np.asarray(points).reshape(-1, 2)), OUTSIDE)
    width, height = (high - low + 1).astype(int)
    moved = Polygons(
        polygons.edges - np.array([*low, *low, 0.0])[:, None],
        polygons.starts,
        polygons.boxes - np.concatenate([low, low]),
        polygons.bands,
        polygons.members,
    )
    return looked_up(np.asarray(points, dtype=np.float64).reshape(-1, 2) - low, mask_from(moved, (height, width)))


def mask_from(polygons: Polygons, shape: tuple[int, int]) -> Int32Array:
    """(H, W) the first polygon that each pixel's centre (u, v) lies in, OUTSIDE without one; (0, 0) is the top left."""
    mask = np.full(shape, OUTSIDE, dtype=np.int32)
    _draw(polygons.edges, polygons.starts, polygons.boxes, mask)
    return mask


def looked_up(points: ArrayLike, mask: Int32Array) -> Int64Array:
    """(K,) what the mask (H, W) says at points (K, 2); OUTSIDE beside it."""
    at = np.ascontiguousarray(np.asarray(points, dtype=np.float64).reshape(-1, 2))
    found = np.empty(len(at), dtype=np.int64)
    _look_up(at, mask, found)
    return found


def _located(kernel: Any, points: ArrayLike, polygons: Polygons) -> Int64Array:
    at = np.ascontiguousarray(np.asarray(points, dtype=np.float64).reshape(-1, 2))
    found = np.empty(len(at), dtype=np.int64)
    kernel(at, polygons.edges, polygons.boxes, polygons.bands, polygons.members, found)
    return found


# ------------------------------------------------------------------------------------------------------- the kernels


@njit(cache=True, nogil=True)
def _crossing(points: Any, edges: Any, boxes: Any, bands: Any, members: Any, found: Any) -> None:
    for k in range(len(points)):
        x, y = points[k, 0], points[k, 1]
        found[k] = -1
        for p in range(len(boxes)):
            if not _is_in_box(x, y, boxes, p):
                continue
            crossed = 0
            band = _band_of(y, boxes, p, bands.shape[1] - 1)
            for m in range(bands[p, band], bands[p, band + 1]):
                e = members[m]
                y0 = edges[1, e]
                spans = (y0 > y) != (edges[3, e] > y)
                crossed += spans & (x < edges[0, e] + (y - y0) * edges[4, e])
            if crossed & 1:
                found[k] = p
                break


@njit(cache=True, nogil=True)
def _winding(points: Any, edges: Any, boxes: Any, bands: Any, members: Any, found: Any) -> None:
    for k in range(len(points)):
        x, y = points[k, 0], points[k, 1]
        found[k] = -1
        for p in range(len(boxes)):
            if not _is_in_box(x, y, boxes, p):
                continue
            winds = 0
            band = _band_of(y, boxes, p, bands.shape[1] - 1)
            for m in range(bands[p, band], bands[p, band + 1]):
                e = members[m]
                x0, y0, x1, y1 = edges[0, e], edges[1, e], edges[2, e], edges[3, e]
                left = (x1 - x0) * (y - y0) - (x - x0) * (y1 - y0)
                winds += (y0 <= y) & (y1 > y) & (left > 0)
                winds -= (y0 > y) & (y1 <= y) & (left < 0)
            if winds != 0:
                found[k] = p
                break


@njit(cache=True, nogil=True)
def _even_odd(points: Any, edges: Any, boxes: Any, bands: Any, members: Any, found: Any) -> None:
    for k in range(len(points)):
        x, y = points[k, 0], points[k, 1]
        found[k] = -1
        for p in range(len(boxes)):
            if not _is_in_box(x, y, boxes, p):
                continue
            is_in = False
            band = _band_of(y, boxes, p, bands.shape[1] - 1)
            for m in range(bands[p, band], bands[p, band + 1]):
                e = members[m]
                x0, y0, x1, y1 = edges[0, e], edges[1, e], edges[2, e], edges[3, e]
                if (y0 > y) != (y1 > y) and x < (x1 - x0) * (y - y0) / (y1 - y0) + x0:
                    is_in = not is_in
            if is_in:
                found[k] = p
                break


@njit(inline="always")
def _is_in_box(x: Any, y: Any, boxes: Any, p: int) -> Any:
    return boxes[p, 0] <= x and x <= boxes[p, 2] and boxes[p, 1] <= y and y <= boxes[p, 3]


@njit(inline="always")
def _band_of(y: Any, boxes: Any, p: int, count: int) -> Any:
    """The band of a polygon's box that a height is in."""
    tall = boxes[p, 3] - boxes[p, 1]
    return min(count - 1, max(0, int((y - boxes[p, 1]) / tall * count))) if tall > 0 else 0


@njit(cache=True, nogil=True)
def _count_bands(edges: Any, starts: Any, boxes: Any, bands: Any) -> int:
    """bands[p, b + 1] = edges of polygon p in its band b; how many there are in all bands."""
    total, count = 0, bands.shape[1] - 1
    for p in range(len(boxes)):
        for e in range(starts[p], starts[p + 1]):
            low = _band_of(min(edges[1, e], edges[3, e]), boxes, p, count)
            high = _band_of(max(edges[1, e], edges[3, e]), boxes, p, count)
            total += high - low + 1
            for b in range(low, high + 1):
                bands[p, b + 1] += 1
    return total


@njit(cache=True, nogil=True)
def _fill_bands(edges: Any, starts: Any, boxes: Any, bands: Any, members: Any) -> None:
    """From numbers of edges to where they begin, and the edges themselves."""
    at, count = 0, bands.shape[1] - 1
    next_free = np.empty(count, np.int64)
    for p in range(len(boxes)):
        bands[p, 0] = at
        for b in range(count):
            next_free[b] = at
            at += bands[p, b + 1]
            bands[p, b + 1] = at
        for e in range(starts[p], starts[p + 1]):
            low = _band_of(min(edges[1, e], edges[3, e]), boxes, p, count)
            high = _band_of(max(edges[1, e], edges[3, e]), boxes, p, count)
            for b in range(low, high + 1):
                members[next_free[b]] = e
                next_free[b] += 1


@njit(cache=True, nogil=True)
def _draw(edges: Any, starts: Any, boxes: Any, mask: Any) -> None:
    """Row by row: where the row meets the edges, sorted, every second stretch is inside."""
    height, width = mask.shape
    for p in range(len(boxes) - 1, -1, -1):
        first, last = starts[p], starts[p + 1]
        if first == last:
            continue
        places = np.empty(last - first)
        for v in range(max(0, int(np.ceil(boxes[p, 1]))), min(height - 1, int(np.floor(boxes[p, 3]))) + 1):
            count = 0
            for e in range(first, last):
                y0 = edges[1, e]
                if (y0 > v) != (edges[3, e] > v):
                    places[count] = edges[0, e] + (v - y0) * edges[4, e]
                    count += 1
            ordered = np.sort(places[:count])
            for pair in range(0, count - 1, 2):
                begin = max(0, int(np.ceil(ordered[pair])))
                for u in range(begin, min(width, int(np.ceil(ordered[pair + 1])))):
                    mask[v, u] = p


@njit(cache=True, nogil=True)
def _look_up(points: Any, mask: Any, found: Any) -> None:
    height, width = mask.shape
    for k in range(len(points)):
        u, v = np.floor(points[k, 0] + 0.5), np.floor(points[k, 1] + 0.5)
        found[k] = mask[int(v), int(u)] if u >= 0 and v >= 0 and u < width and v < height else -1


POINT_IN_POLYGON: Mapping[str, Callable[[ArrayLike, Polygons], Int64Array]] = {
    "crossing_number": crossing_number,
    "winding_number": winding_number,
    "even_odd": even_odd,
    "mask": mask_lookup,
}
