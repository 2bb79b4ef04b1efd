"""Two pictures of one ceiling -> where the middle of the one is in the other, how it is turned, and how large it is there.

SIFT (Lowe 2004), matched by ratio and one to one, and a similarity by RANSAC. Descriptors know left from right, so
a mirrored picture does not match: that is how a photograph taken from below is told from a plan.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from wallkit.core.types import Float64Array, UInt8Array

_RATIO = 0.8
_LEAST_INLIERS = 5
_REPROJECTION_PX = 4.0


@dataclass(frozen=True)
class Match:
    """A small picture found in a large one: its middle (2,) [px, row 0 on top], its turn [rad], px there for 1 px here."""

    at: Float64Array
    yaw: float
    scale: float
    inliers: int


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture (H, W) grey with its features, found once."""

    grey: UInt8Array

    @cached_property
    def features(self) -> tuple[Float64Array, Any]:
        """(F, 2) places, and their descriptors."""
        import cv2

        # OpenCV 4 has both names, its type stubs and OpenCV 5 have this one
        points, descriptors = cv2.SIFT.create(contrastThreshold=0.008).detectAndCompute(self.grey, None)
        return np.array([point.pt for point in points], dtype=np.float64).reshape(-1, 2), descriptors


def found_in(small: Picture, large: Picture, middle: Float64Array) -> Match | None:
    """Where `middle` (2,) of a small picture is in a large one; None where too little agrees."""
    import cv2

    (at, own), (there, known) = small.features, large.features
    if len(at) < _LEAST_INLIERS or len(there) < _LEAST_INLIERS:
        return None
    pairs = cv2.BFMatcher().knnMatch(own, known, k=2)
    best: dict[int, Any] = {}
    for m, n in (pair for pair in pairs if len(pair) == 2):
        rival = best.get(m.trainIdx)
        if m.distance < _RATIO * n.distance and (rival is None or m.distance < rival.distance):
            best[m.trainIdx] = m
    good = list(best.values())
    if len(good) < _LEAST_INLIERS:
        return None
    a = np.array([at[m.queryIdx] for m in good])
    b = np.array([there[m.trainIdx] for m in good])
    M, mask = cv2.estimateAffinePartial2D(
        a, b, method=cv2.RANSAC, ransacReprojThreshold=_REPROJECTION_PX, maxIters=2000, confidence=0.999
    )
    inliers = 0 if M is None else int(mask.sum())
    if M is None or inliers < _LEAST_INLIERS or not 0.05 < math.hypot(M[0, 0], M[1, 0]) < 20:
        return None
    return Match(M[:, :2] @ middle + M[:, 2], math.atan2(M[1, 0], M[0, 0]), math.hypot(M[0, 0], M[1, 0]), inliers)


def grey_of(pixels: UInt8Array) -> UInt8Array:
    """(H, W) brightness of RGB."""
    import cv2

    return np.asarray(cv2.cvtColor(np.ascontiguousarray(pixels[..., :3]), cv2.COLOR_RGB2GRAY))
