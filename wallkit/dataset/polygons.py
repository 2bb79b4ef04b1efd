"""A mask -> polygons without holes, one for each of its parts, that fill to the same mask again.

YOLO-seg knows one closed polygon and no holes. A hole is joined to its part's outline by a bridge without width: the way
goes in, round the hole, and back. Filled by the even-odd rule, as cv2.fillPoly does, the hole stays open.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from wallkit.core.types import BoolArray, Float64Array, Int64Array

_MOST_PX = 1.0
# an outline may move by so much of the mean half width of its shape: thin things stay as they are
_SHARE = 0.02


@dataclass(frozen=True)
class Tracing:
    """How finely masks become polygons."""

    min_area_px: int = 20
    min_hole_px: int = 6


def polygons_from_mask(mask: BoolArray, tracing: Tracing = Tracing()) -> list[Int64Array]:
    """Closed polygons (P, 2) of pixel centres (column, row), one for each part that is large enough, by place.

    Outlines are simplified by at most a pixel.
    """
    import cv2

    contours, tree = cv2.findContours(mask.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    if not contours:
        return []
    found = []
    for number, (_, _, first_hole, parent) in enumerate(tree[0].tolist()):
        if parent >= 0:
            continue
        holes, hole = [], first_hole
        while hole >= 0:
            # the contour of a hole runs on the pixels around it
            if _filled_px(contours[hole]) - len(contours[hole]) >= tracing.min_hole_px:
                holes.append(_simplified(contours[hole]))
            hole = tree[0][hole][0]
        if _filled_px(contours[number]) < tracing.min_area_px:
            continue
        found.append(_bridged(_simplified(contours[number]), holes))
    return sorted(found, key=lambda polygon: (polygon[0, 1], polygon[0, 0]))


def mask_from_polygons(polygons: list[Int64Array] | list[Float64Array], shape: tuple[int, int]) -> BoolArray:
    """(H, W) what polygons of pixel centres fill."""
    import cv2

    canvas = np.zeros(shape, dtype=np.uint8)
    for polygon in polygons:
        part = np.zeros(shape, dtype=np.uint8)
        cv2.fillPoly(part, [np.asarray(polygon, dtype=np.int32)], 1)
        canvas |= part
    return canvas.astype(bool)


def yolo_line(number: int, polygon: Int64Array, shape: tuple[int, int]) -> str:
    """`class x1 y1 x2 y2 ...`, shares of width and height; a pixel's centre lies half a pixel from its edge."""
    shares = (polygon + 0.5) / (shape[1], shape[0])
    return " ".join([str(number), *(f"{value:.6f}".rstrip("0") for value in shares.ravel().tolist())])


def polygons_from_yolo(text: str, shape: tuple[int, int]) -> list[tuple[int, Int64Array]]:
    """(class, polygon of pixel centres) of each line of a label file."""
    found = []
    for line in text.splitlines():
        number, *shares = line.split()
        points = np.array(shares, dtype=np.float64).reshape(-1, 2) * (shape[1], shape[0])
        found.append((int(number), np.floor(points).astype(np.int64)))
    return found


# -------------------------------------------------------------------------------------------- details


def _filled_px(contour: Any) -> float:
    """Pixels in and on a contour, by Pick's theorem."""
    import cv2

    return float(cv2.contourArea(contour)) + len(contour) / 2 + 1


def _simplified(contour: Any) -> Int64Array:
    """(P, 2) the contour with fewer points, three or more: a line one pixel thin goes there and back.

    Readers of label files take a row of two points for a box, and throw the whole picture away.
    """
    import cv2

    most = min(_MOST_PX, _SHARE * _filled_px(contour) / len(contour))
    fewer = cv2.approxPolyDP(contour, most, closed=True)[:, 0]
    return np.resize(fewer, (max(len(fewer), 3), 2)).astype(np.int64)


def _bridged(outline: Int64Array, holes: list[Int64Array]) -> Int64Array:
    """One way around the outline and all holes: always the hole nearest to what is joined already comes next."""
    joined, left = outline, list(holes)
    while left:
        gaps = [np.sum((joined[:, None] - hole[None]) ** 2, axis=2) for hole in left]
        nearest = int(np.argmin([gap.min() for gap in gaps]))
        hole = left.pop(nearest)
        here, there = np.unravel_index(int(np.argmin(gaps[nearest])), gaps[nearest].shape)
        around = np.concatenate([hole[there:], hole[: there + 1]])
        joined = np.concatenate([joined[: here + 1], around, joined[here:]])
    return joined
