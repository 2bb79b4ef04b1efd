"""A score of every class for every cell of a grid, or the class itself -> a class at any pixel of the camera's image."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from wallkit.core.segmentation import Polygon
from wallkit.core.types import BoolArray, Float32Array, Float64Array, Int64Array
from wallkit.segment.class_map import chosen, mask_of, nearest_cells
from wallkit.segment.letterbox import Letterbox
from wallkit.segment.outlines import polygons_of


@dataclass(frozen=True, eq=False)
class ScoreMap:
    """A Segmentation of stuff: between cells the scores are bilinear, the highest one counts.

    How sure a class is, is bilinear too, between how sure each cell is of its own class.

    Attributes:
        scores: (h, w, C) float32 over the network's input, at any fraction of its size.
        is_probability: they sum to 1 over the classes; else they are logits, and the confidence is their softmax.
    """

    names: tuple[str, ...]
    roles: tuple[str, ...]
    frame: Letterbox
    scores: Float32Array
    is_probability: bool

    @property
    def shape(self) -> tuple[int, int]:
        """See Segmentation."""
        return self.frame.image

    def classes_at(self, pixels: ArrayLike) -> tuple[Int64Array, Float32Array]:
        """See Segmentation."""
        at = np.ascontiguousarray(pixels, dtype=np.float64).reshape(-1, 2)
        labels, confidences = np.empty(len(at), dtype=np.int64), np.empty(len(at), dtype=np.float32)
        (height, width), (gain_u, gain_v), (top, left) = self.shape, self.frame.gains, self.frame.corner
        rows, columns, _ = self.scores.shape
        per_u, per_v = columns / self.frame.net[1], rows / self.frame.net[0]
        first = (0.5 * gain_u + left) * per_u - 0.5, (0.5 * gain_v + top) * per_v - 0.5
        lies = width, height, gain_u * per_u, gain_v * per_v, *first
        _sample(at, self.scores, self.is_probability, *self._winners, lies, labels, confidences)
        return labels, confidences

    def labels(self) -> Int64Array:
        """See Segmentation."""
        return self._labels

    def mask(self, roles: Collection[str]) -> BoolArray:
        """See Segmentation."""
        return mask_of(self._labels, self.roles, roles)

    def polygons(self, roles: Collection[str] | None = None) -> list[Polygon]:
        """See Segmentation; the confidences are those of the nearest cells."""
        columns, rows = (np.rint(line).astype(np.int64) for line in self._lines())
        best, sure = self._winners
        _find_winners(self.scores, self.is_probability, best, sure)
        return polygons_of(self._labels, sure[np.ix_(rows, columns)], chosen(self.roles, roles))

    @cached_property
    def _winners(self) -> tuple[NDArray[np.int16], Float32Array]:
        """(h, w) the class of each cell, and how sure it is; -1 until somebody asks for the cell.

        Exponentials are what costs, and a scan touches one cell in ten.
        """
        cells = self.scores.shape[:2]
        return np.full(cells, -1, dtype=np.int16), np.empty(cells, dtype=np.float32)

    @cached_property
    def _labels(self) -> Int64Array:
        columns, rows = self._lines()
        return np.asarray(_highest(self.scores, columns, rows))

    def _lines(self) -> tuple[Float64Array, Float64Array]:
        """Columns (W,) and rows (H,) of the grid where the image's pixels lie."""
        height, width = self.shape
        columns = self._cells(np.stack([np.arange(width), np.zeros(width)], axis=1))[:, 0]
        rows = self._cells(np.stack([np.zeros(height), np.arange(height)], axis=1))[:, 1]
        return np.ascontiguousarray(columns), np.ascontiguousarray(rows)

    def _cells(self, pixels: Float64Array) -> Float64Array:
        """(K, 2) column and row in the grid, between its border cells, where pixels (K, 2) of the image lie."""
        rows, columns, _ = self.scores.shape
        cell = self.frame.net[1] / columns, self.frame.net[0] / rows
        at = (self.frame.net_from_image(pixels) + 0.5) / cell - 0.5
        return np.asarray(np.clip(at, 0, (columns - 1, rows - 1)))


@dataclass(frozen=True, eq=False)
class IdMap:
    """A Segmentation of stuff whose cells hold the class itself: the nearest one counts, and nobody knows how sure.

    Attributes:
        ids: (h, w) int64 over the network's input; what has no name is -1.
    """

    names: tuple[str, ...]
    roles: tuple[str, ...]
    frame: Letterbox
    ids: Int64Array

    @property
    def shape(self) -> tuple[int, int]:
        """See Segmentation."""
        return self.frame.image

    def classes_at(self, pixels: ArrayLike) -> tuple[Int64Array, Float32Array]:
        """See Segmentation."""
        at = np.asarray(pixels, dtype=np.float64).reshape(-1, 2)
        _, _, inside = nearest_cells(at, self.shape)
        found = np.where(inside, self._ids_at(np.where(inside[:, None], at, 0)), -1)
        return found, (found >= 0).astype(np.float32)

    def labels(self) -> Int64Array:
        """See Segmentation."""
        return self._labels

    def mask(self, roles: Collection[str]) -> BoolArray:
        """See Segmentation."""
        return mask_of(self._labels, self.roles, roles)

    def polygons(self, roles: Collection[str] | None = None) -> list[Polygon]:
        """See Segmentation."""
        return polygons_of(self._labels, 1.0, chosen(self.roles, roles))

    @cached_property
    def _labels(self) -> Int64Array:
        height, width = self.shape
        v, u = np.mgrid[:height, :width]
        return self._ids_at(np.stack([u.ravel(), v.ravel()], axis=1)).reshape(self.shape)

    def _ids_at(self, pixels: ArrayLike) -> Int64Array:
        cell = self.frame.net[1] / self.ids.shape[1], self.frame.net[0] / self.ids.shape[0]
        at = np.floor((self.frame.net_from_image(pixels) + 0.5) / cell).astype(np.int64)
        columns, rows = np.clip(at, 0, (self.ids.shape[1] - 1, self.ids.shape[0] - 1)).T
        return np.asarray(self.ids[rows, columns])


@njit(cache=True, nogil=True)
def _find_winners(scores: Any, is_probability: Any, best: Any, sure: Any) -> None:
    """Fills best and sure (h, w) in all cells."""
    rows, columns, _ = scores.shape
    for i in range(rows):
        for j in range(columns):
            _find_winner(scores, is_probability, best, sure, i, j)


@njit(cache=True, nogil=True)
def _find_winner(scores: Any, is_probability: Any, best: Any, sure: Any, i: Any, j: Any) -> None:
    """Fills best and sure (h, w) in one cell, unless they are."""
    if best[i, j] >= 0:
        return
    classes = scores.shape[2]
    winner = 0
    for c in range(1, classes):
        if scores[i, j, c] > scores[i, j, winner]:
            winner = c
    if is_probability:
        sure[i, j] = scores[i, j, winner]
    else:
        total = np.float32(0.0)
        for c in range(classes):
            total += np.exp(scores[i, j, c] - scores[i, j, winner])
        sure[i, j] = np.float32(1.0) / total
    # last, as another thread may be looking
    best[i, j] = winner


@njit(cache=True, nogil=True)
def _sample(
    pixels: Any, scores: Any, is_probability: Any, best: Any, sure: Any, lies: Any, labels: Any, confidences: Any
) -> None:
    """Fills labels and confidences (K,) for pixels (K, 2), and best and sure (h, w) where they lie.

    lies: width and height of the image, cells per pixel both ways, and where its first pixel is, see ScoreMap._cells.
    """
    width, height, per_u, per_v, first_x, first_y = lies
    rows, columns, classes = scores.shape
    here = np.empty(classes, dtype=np.float32)
    for k in range(len(pixels)):
        u, v = pixels[k, 0], pixels[k, 1]
        if not (u >= -0.5 and v >= -0.5 and u < width - 0.5 and v < height - 0.5):
            labels[k], confidences[k] = -1, 0.0
            continue
        x = min(max(u * per_u + first_x, 0.0), columns - 1.0)
        y = min(max(v * per_v + first_y, 0.0), rows - 1.0)
        left, top = int(x), int(y)
        right, bottom = min(left + 1, columns - 1), min(top + 1, rows - 1)
        a, b = np.float32(x - left), np.float32(y - top)
        if min(best[top, left], best[top, right], best[bottom, left], best[bottom, right]) < 0:
            for i, j in ((top, left), (top, right), (bottom, left), (bottom, right)):
                _find_winner(scores, is_probability, best, sure, i, j)
        upper = sure[top, left] * (1 - a) + sure[top, right] * a
        lower = sure[bottom, left] * (1 - a) + sure[bottom, right] * a
        confidences[k] = upper * (1 - b) + lower * b
        winner = best[top, left]
        # what wins in all four cells wins between them
        if best[top, right] != winner or best[bottom, left] != winner or best[bottom, right] != winner:
            for c in range(classes):
                upper = scores[top, left, c] * (1 - a) + scores[top, right, c] * a
                lower = scores[bottom, left, c] * (1 - a) + scores[bottom, right, c] * a
                here[c] = upper * (1 - b) + lower * b
            winner = 0
            for c in range(1, classes):
                if here[c] > here[winner]:
                    winner = c
        labels[k] = winner


@njit(cache=True, nogil=True)
def _highest(scores: Any, columns: Any, rows: Any) -> Any:
    """(H, W) the class with the highest bilinear score at rows (H,) and columns (W,)."""
    height, width, classes = scores.shape
    out = np.empty((len(rows), len(columns)), dtype=np.int64)
    line = np.empty((width, classes), dtype=np.float32)
    for i in range(len(rows)):
        top = int(rows[i])
        bottom, b = min(top + 1, height - 1), np.float32(rows[i] - top)
        for x in range(width):
            for c in range(classes):
                line[x, c] = scores[top, x, c] * (1 - b) + scores[bottom, x, c] * b
        for j in range(len(columns)):
            left = int(columns[j])
            right, a = min(left + 1, width - 1), np.float32(columns[j] - left)
            best = line[left, 0] * (1 - a) + line[right, 0] * a
            out[i, j] = 0
            for c in range(1, classes):
                value = line[left, c] * (1 - a) + line[right, c] * a
                if value > best:
                    best, out[i, j] = value, c
    return out
