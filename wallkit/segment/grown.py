"""A Segmentation -> the same with some masks grown or shrunk by a disc, to study what their quality is worth."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from wallkit.core.segmentation import Polygon, Segmentation
from wallkit.core.types import BoolArray, Float32Array, Int64Array
from wallkit.segment.class_map import chosen, mask_of, nearest_cells
from wallkit.segment.outlines import polygons_of


@dataclass(frozen=True, eq=False)
class Grown:
    """A Segmentation in which pixels near a mask's edge have changed sides: they show what the nearest pixel there does.

    Attributes:
        classes: those that count as one of these make one mask.
        radius_px: pixels whose centre is at most so far from one of the mask join it. Below 0: pixels of the mask at most so
            far from another class join that; pixels that nobody can tell, and the image's border, take nothing away.
    """

    given: Segmentation
    classes: Collection[str]
    radius_px: float

    @property
    def names(self) -> tuple[str, ...]:
        """See Segmentation."""
        return self.given.names

    @property
    def roles(self) -> tuple[str, ...]:
        """See Segmentation."""
        return self.given.roles

    @property
    def shape(self) -> tuple[int, int]:
        """See Segmentation."""
        return self.given.shape

    def classes_at(self, pixels: ArrayLike) -> tuple[Int64Array, Float32Array]:
        """See Segmentation; the nearest pixel decides whether it has changed sides."""
        at = np.array(pixels, dtype=np.float64).reshape(-1, 2)
        rows, columns, inside = nearest_cells(at, self.shape)
        _move(*self._sides(), self.radius_px**2, rows, columns, inside, at)
        return self.given.classes_at(at)

    def labels(self) -> Int64Array:
        """See Segmentation."""
        return self._whole()[0]

    def mask(self, roles: Collection[str]) -> BoolArray:
        """See Segmentation."""
        return mask_of(self.labels(), self.roles, roles)

    def polygons(self, roles: Collection[str] | None = None) -> list[Polygon]:
        """See Segmentation."""
        return polygons_of(*self._whole(), chosen(self.roles, roles))

    def _sides(self) -> tuple[BoolArray, BoolArray]:
        """(H, W) pixels that others near them join, and pixels that may change sides."""
        ids = self.given.labels()
        mask = mask_of(ids, self.roles, self.classes)
        return (mask, ~mask) if self.radius_px > 0 else (~mask & (ids >= 0), mask)

    def _whole(self) -> tuple[Int64Array, Float32Array]:
        v, u = np.mgrid[: self.shape[0], : self.shape[1]]
        labels, sure = self.classes_at(np.stack([u.ravel(), v.ravel()], axis=1))
        return labels.reshape(self.shape), sure.reshape(self.shape)


@njit(cache=True, nogil=True)
def _move(winners: Any, losers: Any, square: float, rows: Any, columns: Any, inside: Any, at: Any) -> None:
    """at[k] = the centre of the nearest winner, where pixel k is a loser with one no farther than the root of `square`."""
    height, width = winners.shape
    reach = int(np.sqrt(square))
    for k in range(len(at)):
        i, j = rows[k], columns[k]
        if not inside[k] or not losers[i, j]:
            continue
        best = square + 1e-9
        for y in range(max(0, i - reach), min(height, i + reach + 1)):
            for x in range(max(0, j - reach), min(width, j + reach + 1)):
                away = float((y - i) ** 2 + (x - j) ** 2)
                if away <= best and winners[y, x] and (away < best or best > square):
                    best, at[k, 0], at[k, 1] = away, x, y


def grown(segmentation: Segmentation, classes: Collection[str], radius_px: float) -> Grown:
    """See Grown."""
    return Grown(segmentation, classes, radius_px)
