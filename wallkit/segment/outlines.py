"""A class for every pixel -> the polygons of its connected parts, with their holes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from wallkit.core.segmentation import Polygon
from wallkit.core.types import BoolArray, Float32Array, Float64Array, Int64Array

# an outline of fewer pixels is noise of the network
_LEAST_AREA_PX = 20


def polygons_of(ids: Int64Array, confidences: Float32Array | float, labels: Sequence[int]) -> list[Polygon]:
    """The connected parts of these classes in (H, W) ids, largest first.

    Args:
        confidences: (H, W), or one number for all pixels.
    """
    found: list[tuple[float, Polygon]] = []
    for label in labels:
        mask = ids == label
        if mask.any():
            found += _parts(mask, confidences, label)
    return [polygon for _, polygon in sorted(found, key=lambda pair: -pair[0])]


def _parts(mask: BoolArray, confidences: Float32Array | float, label: int) -> list[tuple[float, Polygon]]:
    import cv2

    contours, tree = cv2.findContours(mask.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_SIMPLE)
    found = []
    for number, (_, _, first_hole, parent) in enumerate(tree[0].tolist() if contours else []):
        area = float(cv2.contourArea(contours[number]))
        if parent >= 0 or area < _LEAST_AREA_PX:
            continue
        holes, hole = [], first_hole
        while hole >= 0:
            if cv2.contourArea(contours[hole]) >= _LEAST_AREA_PX:
                holes.append(_ring(contours[hole]))
            hole = tree[0][hole][0]
        polygon = Polygon(label, _mean_in(mask, confidences, contours[number]), (_ring(contours[number]), *holes))
        found.append((area, polygon))
    return found


def _ring(contour: Any) -> Float64Array:
    return np.asarray(contour[:, 0], dtype=np.float64)


def _mean_in(mask: BoolArray, confidences: Float32Array | float, contour: Any) -> float:
    """Mean confidence over the part of the mask that an outline holds."""
    import cv2

    if not isinstance(confidences, np.ndarray):
        return float(confidences)
    u, v, width, height = cv2.boundingRect(contour)
    inside = np.zeros((height, width), dtype=np.uint8)
    cv2.drawContours(inside, [contour], 0, 1, cv2.FILLED, offset=(-u, -v))
    part = (slice(v, v + height), slice(u, u + width))
    return float(confidences[part][(inside > 0) & mask[part]].mean())
