"""Particles x beams -> log-likelihoods: the fused loops that cost the time, compiled by Numba.

Lengths are in *grid cells*: `grid.placed` brings poses there, endpoints come divided by the resolution, and fields carry
a border of one cell, so that a clamped index is always valid and the loop has no branch that would keep LLVM from
vectorising it. The plain NumPy formulas stand in tests/localize/test_kernels.py as oracles.
"""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic

from wallkit.core.types import Float32Array, Float64Array

_f4 = np.float32
_ZERO, _ONE, _LN2 = np.float32(0.0), np.float32(1.0), np.float32(math.log(2.0))

# log2(m) = (m - 1) P(m) on [1, 2): least squares of degree 6; largest error of the natural logarithm 5e-7
_P0, _P1, _P2, _P3, _P4, _P5, _P6 = (
    np.float32(3.2466681003570557),
    np.float32(-3.8933818340301514),
    np.float32(3.6147305965423584),
    np.float32(-2.1844656467437744),
    np.float32(0.813970685005188),
    np.float32(-0.17014221847057343),
    np.float32(0.015279986895620823),
)


@intrinsic
def _bits_of(typingctx: Any, x: Any) -> Any:
    """The bits of a float32 as int32."""

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.bitcast(args[0], ir.IntType(32))

    return types.int32(types.float32), code


@intrinsic
def _float_of(typingctx: Any, i: Any) -> Any:
    """The float32 with the given bits."""

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.bitcast(args[0], ir.FloatType())

    return types.float32(types.int32), code


@njit(fastmath=True, inline="always")
def _log2(x: Any) -> Any:
    """log2 of a positive normal float32 without a library call, so that the beam loop stays vectorised."""
    i: Any = _bits_of(x)  # type: ignore[call-arg]  # numba passes the typing context itself
    exponent = _f4((i >> np.int32(23)) - np.int32(127))
    m = _float_of((i & np.int32(0x7FFFFF)) | np.int32(0x3F800000))
    p = ((((((_P6 * m + _P5) * m + _P4) * m + _P3) * m + _P2) * m + _P1) * m) + _P0
    return exponent + p * (m - _ONE)


@njit(cache=True, fastmath=True, nogil=True)
def sum_of_field(placed: Any, endpoints: Any, weights: Any, field: Any, out: Any) -> None:
    """out[i] = sum_k weights[k] * field[cell of endpoint k seen from pose i].

    Args:
        placed: (4, N) float32: cos and sin of the yaw, x and y in cells (grid.placed).
        endpoints: (2, K) float32, in frame base, in cells.
        weights: (K,) float32.
        field: (H, W) float32, C-contiguous, with a border of one cell.
        out: (N,) float64, written.
    """
    height, width = field.shape
    flat = field.reshape(-1)
    x_last, y_last, row = _f4(width - 1), _f4(height - 1), np.int32(width)
    ex, ey = endpoints[0], endpoints[1]
    for i in range(placed.shape[1]):
        c, s, x0, y0 = placed[0, i], placed[1, i], placed[2, i], placed[3, i]
        total = _ZERO
        for k in range(ex.shape[0]):
            x = min(max(x0 + c * ex[k] - s * ey[k], _ZERO), x_last)
            y = min(max(y0 + s * ex[k] + c * ey[k], _ZERO), y_last)
            total += weights[k] * flat[np.uint32(np.int32(y) * row + np.int32(x))]
        out[i] = total


@njit(cache=True, fastmath=True, nogil=True)
def sum_of_mixtures(placed: Any, endpoints: Any, gains: Any, floors: Any, field: Any, out: Any) -> None:
    """out[i] = sum_k log(gains[k] * field[cell of endpoint k seen from pose i] + floors[k]).

    As `sum_of_field`, with a mixture of its own for every beam; gains >= 0, floors > 0, (K,) float32.
    """
    height, width = field.shape
    flat = field.reshape(-1)
    x_last, y_last, row = _f4(width - 1), _f4(height - 1), np.int32(width)
    ex, ey = endpoints[0], endpoints[1]
    for i in range(placed.shape[1]):
        c, s, x0, y0 = placed[0, i], placed[1, i], placed[2, i], placed[3, i]
        total = _ZERO
        for k in range(ex.shape[0]):
            x = min(max(x0 + c * ex[k] - s * ey[k], _ZERO), x_last)
            y = min(max(y0 + s * ex[k] + c * ey[k], _ZERO), y_last)
            total += _log2(gains[k] * flat[np.uint32(np.int32(y) * row + np.int32(x))] + floors[k])
        out[i] = total * _LN2


@njit(cache=True, fastmath=True, nogil=True)
def sum_of_double_mixtures(
    placed: Any, endpoints: Any, gains: Any, own_gains: Any, floors: Any, field: Any, own_field: Any, out: Any
) -> None:
    """out[i] = sum_k log(gains[k] * field[cell] + own_gains[k] * own_field[cell] + floors[k]), cell of endpoint k at pose i.

    As `sum_of_mixtures`, with a second field of the same shape.
    """
    height, width = field.shape
    flat, own = field.reshape(-1), own_field.reshape(-1)
    x_last, y_last, row = _f4(width - 1), _f4(height - 1), np.int32(width)
    ex, ey = endpoints[0], endpoints[1]
    for i in range(placed.shape[1]):
        c, s, x0, y0 = placed[0, i], placed[1, i], placed[2, i], placed[3, i]
        total = _ZERO
        for k in range(ex.shape[0]):
            x = min(max(x0 + c * ex[k] - s * ey[k], _ZERO), x_last)
            y = min(max(y0 + s * ex[k] + c * ey[k], _ZERO), y_last)
            cell = np.uint32(np.int32(y) * row + np.int32(x))
            total += _log2(gains[k] * flat[cell] + own_gains[k] * own[cell] + floors[k])
        out[i] = total * _LN2


@njit(cache=True, nogil=True)
def rotate_drive_rotate(poses: Any, noise: Any, means: Any, sds: Any, out: Any) -> None:
    """out[i] = poses[i] turned, driven and turned by means[j] - sds[j] * noise[j, i]; see motion.DifferentialDrive."""
    for i in range(poses.shape[0]):
        heading = poses[i, 2] + means[0] - sds[0] * noise[0, i]
        driven = means[1] - sds[1] * noise[1, i]
        out[i, 0] = poses[i, 0] + driven * math.cos(heading)
        out[i, 1] = poses[i, 1] + driven * math.sin(heading)
        yaw = heading + means[2] - sds[2] * noise[2, i]
        out[i, 2] = yaw - 2 * math.pi * np.round(yaw / (2 * math.pi))


def in_threads(
    kernel: Any, placed: Float32Array, args: tuple[Any, ...], out: Float64Array | Float32Array, threads: int
) -> None:
    """Run a kernel over slices of the particles in parallel; a particle's result is the same for any number of threads."""
    n = placed.shape[1]
    if threads <= 1 or n < 2 * threads:
        kernel(placed, *args, out)
        return
    edges = [n * i // threads for i in range(threads + 1)]
    parts = [slice(a, b) for a, b in pairwise(edges)]
    # the slices of `placed` must be contiguous, or Numba would compile the kernel once more for them
    jobs = [partial(kernel, np.ascontiguousarray(placed[:, p]), *args, out[p]) for p in parts]
    # the calling thread takes a share itself: waking one thread less is half a millisecond on some machines
    tasks = [_pool(threads).submit(job) for job in jobs[1:]]
    jobs[0]()
    for task in tasks:
        task.result()


_POOLS: dict[int, ThreadPoolExecutor] = {}


def _pool(threads: int) -> ThreadPoolExecutor:
    if threads not in _POOLS:
        _POOLS[threads] = ThreadPoolExecutor(threads - 1, thread_name_prefix="wallkit-kernel")
    return _POOLS[threads]
