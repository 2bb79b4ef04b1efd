"""A segmentation's polygons -> the class at any pixel by asking which polygon holds it, as the paper does."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from wallkit.core.polygon import POINT_IN_POLYGON, looked_up, mask_from, packed
from wallkit.core.segmentation import BACKGROUND, Polygon, Segmentation
from wallkit.core.tiles import Tiles, tiles_of
from wallkit.core.types import Float32Array, Int64Array
from wallkit.points.look import ClassesAt

# so many points make a table of tiles worth its cost
_MANY = 2000


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
    height, width = shape
    # a mask is drawn once for the image, not for every question
    mask = mask_from(held, shape) if method == "mask" else None

    tiles: list[Tiles | None] = []

    def classes_at(pixels: ArrayLike) -> tuple[Int64Array, Float32Array]:
        at = np.ascontiguousarray(pixels, dtype=np.float64)
        if method == "crossing_number" and (tiles or len(at) >= _MANY):
            if not tiles:
                tiles.append(tiles_of(held, shape))
            if tiles[0] is not None:
                return tiles[0].named(at, labels, sure)
        found = POINT_IN_POLYGON[method](at, held) if mask is None else looked_up(at, mask)
        confidences = np.empty(len(found), dtype=np.float32)
        _name(at, labels, sure, width, height, found, confidences)
        return found, confidences

    return classes_at


@njit(cache=True, nogil=True)
def _name(at: Any, labels: Any, sure: Any, width: Any, height: Any, found: Any, confidences: Any) -> None:
    """From polygons to classes, in `found`, and how sure each is; beside the image -1. The last label is of no polygon."""
    for k in range(len(found)):
        u, v = at[k, 0], at[k, 1]
        if u >= -0.5 and v >= -0.5 and u < width - 0.5 and v < height - 0.5:
            confidences[k] = sure[found[k]]
            found[k] = labels[found[k]]
        else:
            confidences[k] = 0.0
            found[k] = -1
