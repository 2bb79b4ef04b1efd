"""Clouds with intensity and pictures -> normalised information distance: do grey value and reflectance know each other?

NID = (2 H(I, L) - H(I) - H(L)) / H(I, L) (Pandey et al. 2015; Koide et al., ICRA 2023, eq. 5). Its value means nothing; the
place of its minimum does. Grey values are equalised and intensities are replaced by their ranks, so that no camera's gamma
and no LiDAR's scale matters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wallkit.core.camera import Camera
from wallkit.core.types import BoolArray, Float64Array, Int64Array, UInt8Array

BINS = 16
_CELL_PX = 12
# a point so much farther than the nearest in its cell is hidden from the camera
_HIDDEN_SHARE = 0.08
_MOST_POINTS = 40_000


@dataclass(frozen=True, eq=False)
class NidFrame:
    """One cloud and its picture: points (N, 3) that the camera can see, their intensity bins (N,), grey bins (H, W)."""

    points_m: Float64Array
    bins: Int64Array
    grey: Int64Array


def nid_frame(
    camera: Camera, T: Float64Array, grey: UInt8Array, points_m: Float64Array, intensities: Float64Array
) -> NidFrame:
    """The frame, with what the camera cannot see from the transform T left out once and for all."""
    import cv2

    visible = _visible(camera, T, points_m)
    points, strength = points_m[visible], intensities[visible]
    if len(points) > _MOST_POINTS:
        stride = len(points) // _MOST_POINTS + 1
        points, strength = points[::stride], strength[::stride]
    ranks = np.argsort(np.argsort(strength, kind="stable"), kind="stable")
    # equal intensities get one rank, that of the first
    _, first, which = np.unique(strength, return_index=True, return_inverse=True)
    bins = ranks[first][which] * BINS // max(len(points), 1)
    levels = cv2.GaussianBlur(cv2.equalizeHist(np.ascontiguousarray(grey)), (0, 0), 1.5)
    return NidFrame(points, bins.astype(np.int64), levels.astype(np.int64) * BINS // 256)


def nid_scores(camera: Camera, T: Float64Array, frames: Sequence[NidFrame]) -> Float64Array:
    """(F,) NID of each frame; 1 (nothing in common) where no point falls on the image."""
    return np.array([_nid(_joint(camera, T, frame)) for frame in frames])


def _joint(camera: Camera, T: Float64Array, frame: NidFrame) -> Float64Array:
    """(BINS, BINS) counts of grey value and intensity."""
    pixels = camera.project(frame.points_m @ T[:3, :3].T + T[:3, 3])
    inside = camera.is_inside(pixels)
    u, v = np.round(pixels[inside]).astype(np.int64).T
    both = frame.grey[v, u] * BINS + frame.bins[inside]
    return np.bincount(both, minlength=BINS * BINS).reshape(BINS, BINS).astype(np.float64)


def _nid(joint: Float64Array) -> float:
    total = joint.sum()
    if total == 0:
        return 1.0
    p = joint / total
    both, grey, strength = _entropy(p.ravel()), _entropy(p.sum(axis=1)), _entropy(p.sum(axis=0))
    return float((2 * both - grey - strength) / both) if both > 0 else 1.0


def _entropy(p: Float64Array) -> float:
    p = p[p > 0]
    return float(-(p * np.log(p)).sum())


def _visible(camera: Camera, T: Float64Array, points: Float64Array) -> BoolArray:
    """(N,) in the image, and not behind something that the LiDAR saw past the camera's line of sight."""
    seen = points @ T[:3, :3].T + T[:3, 3]
    pixels = camera.project(seen)
    inside = camera.is_inside(pixels)
    visible = np.zeros(len(points), dtype=bool)
    if not inside.any():
        return visible
    columns = camera.width // _CELL_PX + 2
    u, v = (np.round(pixels[inside]).astype(np.int64) // _CELL_PX).T
    cells = v * columns + u
    nearest = np.full((camera.height // _CELL_PX + 2) * columns, np.inf)
    np.minimum.at(nearest, cells, seen[inside, 2])
    visible[np.flatnonzero(inside)] = seen[inside, 2] <= nearest[cells] * (1 + _HIDDEN_SHARE)
    return visible
