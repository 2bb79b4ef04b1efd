"""A segmentation's polygons -> the class at any pixel by asking which polygon holds it, as the paper does."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from wallkit.core.polygon import POINT_IN_POLYGON, packed
from wallkit.core.segmentation import BACKGROUND, Polygon, Segmentation
from wallkit.core.types import Float32Array, Int64Array
from wallkit.points.look import ClassesAt


def classes_by_outlines(segmentation: Segmentation, method: str) -> ClassesAt:
    """`classes_at` of a segmentation's polygons, see `classes_in`."""
    return classes_in(segmentation.polygons(), segmentation.names, segmentation.shape, method)


def classes_in(polygons: Sequence[Polygon], names: Sequence[str], shape: tuple[int, int], method: str) -> ClassesAt:
    """The class at any pixel of an image: of the polygons that hold it the last, which stands in front as the smallest.

    What no polygon holds is background, where the model has one.

    Args:
        polygons: largest first. shape: (H, W). method: of POINT_IN_POLYGON.
    """
    ordered = polygons[::-1]
    held = packed([polygon.rings for polygon in ordered])
    rest = names.index(BACKGROUND) if BACKGROUND in names else -1
    labels = np.array([*(polygon.label for polygon in ordered), rest], dtype=np.int64)
    sure = np.array([*(polygon.confidence for polygon in ordered), 0.0 if rest < 0 else 1.0], dtype=np.float32)
    within = POINT_IN_POLYGON[method]
    height, width = shape

    def classes_at(pixels: ArrayLike) -> tuple[Int64Array, Float32Array]:
        at = np.asarray(pixels, dtype=np.float64)
        found = within(at, held)
        with np.errstate(invalid="ignore"):
            inside = ((at >= -0.5) & (at < (width - 0.5, height - 0.5))).all(axis=1)
        return np.where(inside, labels[found], -1), np.where(inside, sure[found], np.float32(0.0))

    return classes_at
