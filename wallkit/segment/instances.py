"""Detections and prototypes of a YOLO-seg model -> a class at any pixel, without making mask images.

A thing's mask is where the sum of its coefficients times the prototypes, between cells bilinear, is positive, inside its
box. LiDAR points need that sum at some hundred pixels only.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from wallkit.core.segmentation import Polygon
from wallkit.core.types import BoolArray, Float32Array, Float64Array, Int64Array
from wallkit.segment.class_map import chosen, mask_of
from wallkit.segment.detections import Detections
from wallkit.segment.letterbox import Letterbox
from wallkit.segment.outlines import polygons_of


@dataclass(frozen=True, eq=False)
class Instances:
    """A Segmentation of things. Where masks overlap, the thing with the highest score times sigmoid of its sum counts.

    The confidence of a class is that product; of the background the product of (1 - score * sigmoid) of all things whose
    box holds the pixel.

    Attributes:
        names, roles: of the classes, the background last.
        prototypes: (M, h, w) float32.
    """

    names: tuple[str, ...]
    roles: tuple[str, ...]
    frame: Letterbox
    detections: Detections
    prototypes: Float32Array

    @property
    def shape(self) -> tuple[int, int]:
        """See Segmentation."""
        return self.frame.image

    def classes_at(self, pixels: ArrayLike) -> tuple[Int64Array, Float32Array]:
        """See Segmentation."""
        at = np.asarray(pixels, dtype=np.float64).reshape(-1, 2)
        labels, confidences = np.empty(len(at), dtype=np.int64), np.empty(len(at), dtype=np.float32)
        d, size = self.detections, np.array(self.shape[::-1], dtype=np.float64)
        things = d.boxes, d.scores, d.labels, d.coefficients
        _sample(at, self.frame.net_from_image(at), size, *things, self.prototypes, self._cell, labels, confidences)
        labels[labels == _NOTHING] = len(self.names) - 1
        return labels, confidences

    def labels(self) -> Int64Array:
        """See Segmentation."""
        return self._painted[0]

    def mask(self, roles: Collection[str]) -> BoolArray:
        """See Segmentation."""
        return mask_of(self.labels(), self.roles, roles)

    def polygons(self, roles: Collection[str] | None = None) -> list[Polygon]:
        """See Segmentation."""
        return polygons_of(*self._painted, chosen(self.roles, roles))

    def masks(self, *, of_net: bool = False) -> BoolArray:
        """(D, H, W) mask of each thing by itself, in the camera's image or in the network's input."""
        d, (u, v) = self.detections, self._grid(of_net=of_net)
        out = np.zeros((len(d), len(v), len(u)), dtype=np.bool_)
        _paint_each(self._sums, d.boxes, u, v, self._cell, out)
        return out

    @property
    def _cell(self) -> Float64Array:
        """Width and height of a prototype's cell [px of the input]."""
        _, rows, columns = self.prototypes.shape
        return np.array([self.frame.net[1] / columns, self.frame.net[0] / rows])

    @property
    def _sums(self) -> Float32Array:
        """(D, h, w) what decides the mask of each thing, at the prototypes' cells."""
        flat = self.prototypes.reshape(len(self.prototypes), -1)
        return (self.detections.coefficients @ flat).reshape(-1, *self.prototypes.shape[1:])

    @cached_property
    def _painted(self) -> tuple[Int64Array, Float32Array]:
        labels = np.empty(self.shape, dtype=np.int64)
        confidences = np.empty(self.shape, dtype=np.float32)
        d, (u, v) = self.detections, self._grid(of_net=False)
        _paint(self._sums, d.boxes, d.scores, d.labels, u, v, self._cell, labels, confidences)
        labels[labels == _NOTHING] = len(self.names) - 1
        return labels, confidences

    def _grid(self, *, of_net: bool) -> tuple[Float64Array, Float64Array]:
        """Columns and rows of the input where the pixels of the image, or of the input itself, lie."""
        if of_net:
            return np.arange(self.frame.net[1], dtype=np.float64), np.arange(self.frame.net[0], dtype=np.float64)
        height, width = self.shape
        u = self.frame.net_from_image(np.stack([np.arange(width), np.zeros(width)], axis=1))[:, 0]
        v = self.frame.net_from_image(np.stack([np.zeros(height), np.arange(height)], axis=1))[:, 1]
        return np.ascontiguousarray(u), np.ascontiguousarray(v)


# ------------------------------------------------------------------------------------------------ kernels

_NOTHING = -2


@njit(cache=True, nogil=True)
def _between(at: float, cell: float, count: int) -> tuple[int, int, float]:
    """The two cells that a pixel lies between, and the share of the second; the border's cells reach outwards."""
    position = min(max((at + 0.5) / cell - 0.5, 0.0), count - 1.0)
    first = int(position)
    return first, min(first + 1, count - 1), position - first


@njit(inline="always")
def _between_cells(sums: Any, rows: Any, columns: Any) -> Any:
    """Bilinear, between the rows and the columns that `_between` gives."""
    top, bottom, b = rows
    left, right, a = columns
    upper = sums[top, left] * (1 - a) + sums[top, right] * a
    lower = sums[bottom, left] * (1 - a) + sums[bottom, right] * a
    return upper * (1 - b) + lower * b


@njit(cache=True, nogil=True, fastmath=True)
def _sample(pixels, at, size, boxes, scores, labels, coefficients, prototypes, cell, out, sure):  # type: ignore[no-untyped-def]
    """Fills `out` and `sure` (K,) for pixels (K, 2) of an image of a size (2,) that lie `at` (K, 2) in the input."""
    depth, rows, columns = prototypes.shape
    here = np.empty(depth, dtype=np.float32)
    for k in range(len(pixels)):
        out[k], sure[k] = -1, 0.0
        u, v = pixels[k, 0], pixels[k, 1]
        if not (u >= -0.5 and v >= -0.5 and u < size[0] - 0.5 and v < size[1] - 0.5):
            continue
        x, y = at[k, 0], at[k, 1]
        out[k], best, nothing, is_sampled = _NOTHING, 0.0, 1.0, False
        for d in range(len(boxes)):
            if x < boxes[d, 0] or x >= boxes[d, 2] or y < boxes[d, 1] or y >= boxes[d, 3]:
                continue
            if not is_sampled:
                left, right, a = _between(x, cell[0], columns)
                top, bottom, b = _between(y, cell[1], rows)
                w00, w01 = np.float32((1 - a) * (1 - b)), np.float32(a * (1 - b))
                w10, w11 = np.float32((1 - a) * b), np.float32(a * b)
                for m in range(depth):
                    upper = prototypes[m, top, left] * w00 + prototypes[m, top, right] * w01
                    here[m] = upper + prototypes[m, bottom, left] * w10 + prototypes[m, bottom, right] * w11
                is_sampled = True
            total = np.float32(0.0)
            for m in range(depth):
                total += here[m] * coefficients[d, m]
            chance = scores[d] / (1.0 + np.exp(-total))
            nothing *= 1.0 - chance
            if total > 0 and chance > best:
                best, out[k] = chance, labels[d]
        sure[k] = best if out[k] >= 0 else nothing


@njit(cache=True, nogil=True, fastmath=True)
def _paint(sums, boxes, scores, labels, u, v, cell, out, sure):  # type: ignore[no-untyped-def]
    """Fills `out` and `sure` (H, W) for pixels at columns u (W,) and rows v (H,) of the input."""
    out[:] = _NOTHING
    sure[:] = 1.0
    best = np.zeros(out.shape, dtype=np.float32)
    for d in range(len(boxes)):
        for i in range(len(v)):
            if v[i] < boxes[d, 1] or v[i] >= boxes[d, 3]:
                continue
            rows = _between(v[i], cell[1], sums.shape[1])
            for j in range(len(u)):
                if u[j] < boxes[d, 0] or u[j] >= boxes[d, 2]:
                    continue
                total = _between_cells(sums[d], rows, _between(u[j], cell[0], sums.shape[2]))
                chance = scores[d] / (1.0 + np.exp(-total))
                if total > 0 and chance > best[i, j]:
                    best[i, j], out[i, j] = chance, labels[d]
                sure[i, j] *= 1.0 - chance
    for i in range(len(v)):
        for j in range(len(u)):
            if out[i, j] >= 0:
                sure[i, j] = best[i, j]


@njit(cache=True, nogil=True)
def _paint_each(sums, boxes, u, v, cell, out):  # type: ignore[no-untyped-def]
    """Fills `out` (D, H, W): upsampled first, cropped to the box then."""
    for d in range(len(boxes)):
        for i in range(len(v)):
            if v[i] < boxes[d, 1] or v[i] >= boxes[d, 3]:
                continue
            rows = _between(v[i], cell[1], sums.shape[1])
            for j in range(len(u)):
                if u[j] < boxes[d, 0] or u[j] >= boxes[d, 2]:
                    continue
                out[d, i, j] = _between_cells(sums[d], rows, _between(u[j], cell[0], sums.shape[2])) > 0
