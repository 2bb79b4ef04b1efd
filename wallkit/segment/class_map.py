"""A class for every pixel of an image -> a Segmentation: recorded masks, and models that answer with class ids."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wallkit.core.segmentation import BACKGROUND, Polygon
from wallkit.core.types import BoolArray, Float32Array, Int64Array
from wallkit.segment.outlines import polygons_of
from wallkit.segment.roles import Roles

_USUAL = Roles()


@dataclass(frozen=True, eq=False)
class ClassMap:
    """A Segmentation that has a class for every pixel of the camera's image.

    Attributes:
        ids: (H, W) int64 place in `names`, -1 where nobody can tell.
        confidences: (H, W) float32, or one number for all pixels.
    """

    ids: Int64Array
    names: tuple[str, ...]
    roles: tuple[str, ...]
    confidences: Float32Array | float = 1.0

    @property
    def shape(self) -> tuple[int, int]:
        """See Segmentation."""
        height, width = self.ids.shape
        return height, width

    def classes_at(self, pixels: ArrayLike) -> tuple[Int64Array, Float32Array]:
        """See Segmentation; the nearest pixel decides."""
        rows, columns, inside = nearest_cells(pixels, self.shape)
        found = np.where(inside, self.ids[rows, columns], -1)
        sure = self.confidences if np.isscalar(self.confidences) else np.asarray(self.confidences)[rows, columns]
        return found, np.where(found >= 0, sure, 0).astype(np.float32)

    def labels(self) -> Int64Array:
        """See Segmentation."""
        return self.ids

    def mask(self, roles: Collection[str]) -> BoolArray:
        """See Segmentation."""
        return mask_of(self.ids, self.roles, roles)

    def polygons(self, roles: Collection[str] | None = None) -> list[Polygon]:
        """See Segmentation."""
        return polygons_of(self.ids, self.confidences, chosen(self.roles, roles))


def class_map(
    ids: NDArray[np.integer], names: tuple[str, ...], roles: Roles = _USUAL, *, nothing: int | None = None
) -> ClassMap:
    """The Segmentation of ids (H, W); `nothing` is the id of pixels that nobody can tell, as are ids without a name."""
    known = np.asarray(ids, dtype=np.int64)
    is_unknown = (known < 0) | (known >= len(names)) | (known == (-1 if nothing is None else nothing))
    return ClassMap(np.where(is_unknown, -1, known), tuple(names), roles.of(names))


def nearest_cells(pixels: ArrayLike, shape: tuple[int, int]) -> tuple[Int64Array, Int64Array, BoolArray]:
    """(K,) row, column and whether it is on the image, of pixels (K, 2); those that are not have row and column 0."""
    at = np.asarray(pixels, dtype=np.float64).reshape(-1, 2)
    with np.errstate(invalid="ignore"):
        inside = np.asarray(((at >= -0.5) & (at < (shape[1] - 0.5, shape[0] - 0.5))).all(axis=1))
    columns, rows = np.floor(np.where(inside[:, None], at, 0) + 0.5).astype(np.int64).T
    return rows, columns, inside


def mask_of(ids: Int64Array, class_roles: tuple[str, ...], roles: Collection[str]) -> BoolArray:
    """(H, W) whether the class of a pixel, -1 for none, counts as one of these."""
    counts = np.array([*(role in roles for role in class_roles), False])
    return np.asarray(counts[ids])


def chosen(class_roles: tuple[str, ...], roles: Collection[str] | None) -> list[int]:
    """The classes that count as one of these; None: all but the background."""
    if roles is None:
        return [label for label, role in enumerate(class_roles) if role != BACKGROUND]
    return [label for label, role in enumerate(class_roles) if role in roles]
