"""Particles x pixels -> how much colours differ: the loops of the ceiling's sensor models, compiled by Numba.

As in `kernels`, lengths are in pixels of the map, poses come from `grid.placed`, and maps carry a border of one pixel, here
one that is unseen. Pixels of a map lie together as (value, value, value, seen), 16 bytes: one look-up is one cache line.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

_f4 = np.float32
_ZERO, _ONE, _TWO, _FOUR, _BYTE = _f4(0.0), _f4(1.0), _f4(2.0), _f4(4.0), _f4(1.0 / 255.0)
# of a log brightness: there is none so low
UNKNOWN = _f4(-100.0)


@njit(fastmath=True, inline="always")
def _norm(a: Any, b: Any, c: Any, order: Any) -> Any:
    """The norm of some order of three lengths >= 0; 1, 2 and 4, the usual ones, without a power."""
    if order == _f4(4.0):
        a, b, c = a * a, b * b, c * c
        return _f4(math.sqrt(math.sqrt(a * a + b * b + c * c)))
    if order == _f4(2.0):
        return _f4(math.sqrt(a * a + b * b + c * c))
    if order == _f4(1.0):
        return a + b + c
    return _f4((a**order + b**order + c**order) ** (_ONE / order))


@njit(cache=True, fastmath=True, nogil=True)
def colour_costs(
    placed: Any, points: Any, colours: Any, order: Any, is_circle: Any, most: Any, unseen: Any, image: Any, out: Any
) -> None:
    """out[i] = mean_k min(|| colours[k] - image[pixel of point k seen from pose i] ||, most).

    Args:
        placed: (4, N) float32: cos and sin of the yaw, x and y in pixels (grid.placed).
        points: (2, K) float32, in frame base, in pixels.
        colours: (3, K) float32.
        order: of the norm. is_circle: the first channel is a circle of circumference 1.
        most: what a pixel can differ at most. unseen: what one counts that falls where the map is not known.
        image: (H, W, 4) float32, C-contiguous, with a border of one unseen pixel.
        out: (N,) float64, written.
    """
    height, width = image.shape[0], image.shape[1]
    flat = image.reshape(-1, 4)
    x_last, y_last, row = _f4(width - 1), _f4(height - 1), np.int32(width)
    px, py, z0, z1, z2 = points[0], points[1], colours[0], colours[1], colours[2]
    count = px.shape[0]
    for i in range(placed.shape[1]):
        c, s, x0, y0 = placed[0, i], placed[1, i], placed[2, i], placed[3, i]
        total = _ZERO
        for k in range(count):
            x = min(max(x0 + c * px[k] - s * py[k], _ZERO), x_last)
            y = min(max(y0 + s * px[k] + c * py[k], _ZERO), y_last)
            cell = np.uint32(np.int32(y) * row + np.int32(x))
            d0 = abs(z0[k] - flat[cell, 0])
            if is_circle:
                d0 = _TWO * min(d0, abs(_ONE - d0))
            d = _norm(d0, abs(z1[k] - flat[cell, 1]), abs(z2[k] - flat[cell, 2]), order)
            seen = flat[cell, 3]
            total += seen * min(d, most) + (_ONE - seen) * unseen
        out[i] = total / _f4(count)


@njit(cache=True, fastmath=True, nogil=True)
def exposed_costs(
    placed: Any, points: Any, colours: Any, order: Any, limit: Any, most: Any, unseen: Any, image: Any, out: Any
) -> None:
    """As `colour_costs` of RGB, with the exposure g in [1 / limit, limit] of each pose that explains the view best.

    g is the ratio of the summed brightness of view and map, twice more over the pixels that it explains: walls and lamps
    that are off must not rule. The costs are those of colours / g.

    Args:
        image: (H, W) uint32 of red, green, blue and 1 where it is known, a byte each from the lowest: a whole floor of them
            stays in the cache, which four floats a pixel do not.
    """
    px, py, z0, z1, z2 = points[0], points[1], colours[0], colours[1], colours[2]
    count = px.shape[0]
    bright = _f4(0.299) * z0 + _f4(0.587) * z1 + _f4(0.114) * z2
    flat, packed = image.reshape(-1), np.empty(count, np.uint32)
    # rows of one array would keep LLVM from seeing that they do not overlap, and the loops from being vectorised
    m0, m1, m2, grey = np.empty_like(z0), np.empty_like(z0), np.empty_like(z0), np.empty_like(z0)
    known = np.empty_like(z0)
    rounds = 2 if limit > _ONE else 0
    for i in range(placed.shape[1]):
        _look_up(placed[0, i], placed[1, i], placed[2, i], placed[3, i], px, py, flat, image.shape, packed)
        above, below = _f4(1e-6), _f4(1e-6)
        for k in range(count):
            v = packed[k]
            m0[k] = _f4(np.int32(v & np.uint32(255))) * _BYTE
            m1[k] = _f4(np.int32((v >> np.uint32(8)) & np.uint32(255))) * _BYTE
            m2[k] = _f4(np.int32((v >> np.uint32(16)) & np.uint32(255))) * _BYTE
            known[k] = _f4(np.int32(v >> np.uint32(24)))
            grey[k] = known[k] * (_f4(0.299) * m0[k] + _f4(0.587) * m1[k] + _f4(0.114) * m2[k])
            above += known[k] * bright[k]
            below += grey[k]
        g = min(max(above / below, _ONE / limit), limit)
        for _ in range(rounds):
            above, below = _f4(1e-6), _f4(1e-6)
            for k in range(count):
                fits = known[k] if abs(bright[k] - g * grey[k]) < most else _ZERO
                above += fits * bright[k]
                below += fits * grey[k]
            g = min(max(above / below, _ONE / limit), limit)
        # a loop for each of the usual orders: a choice inside would keep it from being vectorised
        if order == _TWO:
            total = _differing(z0, z1, z2, _ONE / g, m0, m1, m2, known, _TWO, most, unseen)
        elif order == _ONE:
            total = _differing(z0, z1, z2, _ONE / g, m0, m1, m2, known, _ONE, most, unseen)
        elif order == _FOUR:
            total = _differing(z0, z1, z2, _ONE / g, m0, m1, m2, known, _FOUR, most, unseen)
        else:
            total = _differing(z0, z1, z2, _ONE / g, m0, m1, m2, known, order, most, unseen)
        out[i] = total / _f4(count)


@njit(fastmath=True, inline="always")
def _look_up(c: Any, s: Any, x0: Any, y0: Any, px: Any, py: Any, flat: Any, shape: Any, found: Any) -> None:
    """found[k] = the pixel of point k seen from a pose, of an image of some shape, its rows one after the other."""
    x_last, y_last, row = _f4(shape[1] - 1), _f4(shape[0] - 1), np.int32(shape[1])
    for k in range(px.shape[0]):
        x = min(max(x0 + c * px[k] - s * py[k], _ZERO), x_last)
        y = min(max(y0 + s * px[k] + c * py[k], _ZERO), y_last)
        found[k] = flat[np.uint32(np.int32(y) * row + np.int32(x))]


@njit(fastmath=True, inline="always")
def _differing(
    z0: Any, z1: Any, z2: Any, per: Any, m0: Any, m1: Any, m2: Any, known: Any, order: Any, most: Any, unseen: Any
) -> Any:
    """sum_k min(|| z[k] * per - m[k] ||, most), `unseen` where m is not known."""
    total = _ZERO
    for k in range(z0.shape[0]):
        d = _norm(abs(z0[k] * per - m0[k]), abs(z1[k] * per - m1[k]), abs(z2[k] * per - m2[k]), order)
        total += known[k] * (min(d, most) - unseen)
    return total + _f4(z0.shape[0]) * unseen


@njit(cache=True, fastmath=True, nogil=True)
def gradient_costs(
    placed: Any, points: Any, values: Any, seen: Any, most: Any, unseen: Any, image: Any, out: Any
) -> None:
    """out[i] = mean over neighbours a, b of the grid of min(|(values[a] - m[a]) - (values[b] - m[b])|, most).

    m is the image at the points seen from pose i: what is added to all values changes nothing.

    Args:
        points: (2, R, C) float32, in frame base, in pixels. values: (R, C) float32. seen: (R, C) float32 of 0 or 1.
        image: (H, W) float32, far below any value where it is not known, with a border of such.
        placed, most, unseen, out: as `colour_costs`.
    """
    columns, count, flat = values.shape[1], values.size, image.reshape(-1)
    px, py, z, is_seen = points[0].reshape(-1), points[1].reshape(-1), values.reshape(-1), seen.reshape(-1)
    # how much a pair counts of a place and the one before it in its row (beside), or in its column (above)
    beside, above, pairs = np.zeros_like(z), np.zeros_like(z), _ZERO
    for k in range(count):
        beside[k] = is_seen[k] * is_seen[k - 1] if k % columns > 0 else _ZERO
        above[k] = is_seen[k] * is_seen[k - columns] if k >= columns else _ZERO
        pairs += beside[k] + above[k]
    found, rest, known = np.empty_like(z), np.empty_like(z), np.empty_like(z)
    for i in range(placed.shape[1]):
        _look_up(placed[0, i], placed[1, i], placed[2, i], placed[3, i], px, py, flat, image.shape, found)
        for k in range(count):
            known[k] = _ONE if found[k] > UNKNOWN else _ZERO
            rest[k] = z[k] - found[k]
        total = pairs * unseen
        for k in range(1, count):
            cost = min(abs(rest[k] - rest[k - 1]), most) - unseen
            total += beside[k] * known[k] * known[k - 1] * cost
        for k in range(columns, count):
            cost = min(abs(rest[k] - rest[k - columns]), most) - unseen
            total += above[k] * known[k] * known[k - columns] * cost
        out[i] = total / max(pairs, _ONE)


@njit(cache=True, fastmath=True, nogil=True)
def histogram_costs(placed: Any, offset: Any, roots: Any, unseen: Any, table: Any, out: Any) -> None:
    """out[i] = 1 - sum_b roots[b] * table[cell of pose i, b]: one less the Bhattacharyya coefficient of two histograms.

    Args:
        offset: (2,) float32 of the view's middle in frame base, in cells. roots: (B,) float32 roots of its shares.
        table: (H, W, B) float32 roots of the map's shares round every cell; all zeros where it is not known.
        placed, unseen, out: as `colour_costs`.
    """
    height, width, bins = table.shape
    for i in range(placed.shape[1]):
        c, s = placed[0, i], placed[1, i]
        x = placed[2, i] + c * offset[0] - s * offset[1]
        y = placed[3, i] + s * offset[0] + c * offset[1]
        column = min(max(np.int32(x), np.int32(0)), np.int32(width - 1))
        line = min(max(np.int32(y), np.int32(0)), np.int32(height - 1))
        same = _ZERO
        for b in range(bins):
            same += roots[b] * table[line, column, b]
        out[i] = max(_ONE - same, _ZERO) if same > _ZERO else unseen
