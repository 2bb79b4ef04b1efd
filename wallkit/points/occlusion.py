"""LiDAR points, the whole cloud and a camera -> which of the points the camera cannot see, as something stands before them.

A cloud is points with nothing between them, and a camera beside the LiDAR sees the same surfaces from elsewhere. That a
point has nearer ones around its pixel proves nothing: on a wall seen at a slant every point has. What tells the two apart is
how much nearer they are for how far aside, which from the point itself is an angle: a plane seen at s degrees to its normal
has nothing of itself within 90 - s degrees of the line from any of its points to the camera. So a point is hidden if another
one stands in a cone that narrow about that line.

Cones from a point to the eye that other points leave empty are in Pintus, Gobbetti & Agus, Real-time Rendering of Massive
Unstructured Raw Point Clouds using Screen-space Operators (2011). Ours begin a margin away from the point, for noise, and
end where points are too far apart in the image to be on one line of sight.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from wallkit.core.camera import Camera
from wallkit.core.projection import project_points
from wallkit.core.types import BoolArray, Float32Array, Float64Array


def hidden(
    camera: Camera,
    T: Float64Array,
    points_m: Float32Array,
    cloud_m: Float32Array,
    *,
    reach_deg: float,
    margin_m: float,
    slant_deg: float,
) -> BoolArray:
    """(K,) which points have something else before them as the camera sees it; none of those that are not on the image.

    Args:
        T: (4, 4) moves points to the camera.
        points_m: (K, 3). cloud_m: (P, 3) everything known to be there, `points_m` among it or not.
        reach_deg: so near in direction two points are on one line of sight. At least half the angle between rings.
        margin_m: what is not so much nearer to the camera hides nothing.
        slant_deg: a plane seen at up to this angle to its normal hides nothing of itself.
    """
    pixels, _, inside = project_points(camera, T, points_m)
    found = np.zeros(len(pixels), dtype=np.bool_)
    seen = np.flatnonzero(inside)
    if not len(seen):
        return found
    others, _, there = project_points(camera, T, cloud_m)
    reach_px = float(camera.K[0, 0]) * math.tan(math.radians(reach_deg))
    numbers = (reach_px, margin_m, math.tan(math.radians(90 - slant_deg)))
    eye = -T[:3, :3].T @ T[:3, 3]
    _find(points_m, pixels, seen, cloud_m, others, there, eye, (camera.width, camera.height), numbers, found)
    return found


@njit(cache=True, nogil=True)
def _find(
    points: Any,
    pixels: Any,
    seen: Any,
    cloud: Any,
    others: Any,
    there: Any,
    eye: Any,
    size: Any,
    numbers: Any,
    found: Any,
) -> None:
    """found[i] of the points `seen`: each of the cloud asks those that land near it, by cells as wide as that."""
    reach, margin, narrow = numbers
    columns, rows = int(size[0] / reach) + 3, int(size[1] / reach) + 3
    first, following = np.full((rows, columns), -1, dtype=np.int32), np.empty(len(points), dtype=np.int32)
    for i in seen:
        column, row = int((pixels[i, 0] + 0.5) / reach) + 1, int((pixels[i, 1] + 0.5) / reach) + 1
        following[i], first[row, column] = first[row, column], i
    for j in range(len(cloud)):
        if not there[j]:
            continue
        column, row = int((others[j, 0] + 0.5) / reach) + 1, int((others[j, 1] + 0.5) / reach) + 1
        for near_row in range(row - 1, row + 2):
            for near_column in range(column - 1, column + 2):
                i = first[near_row, near_column]
                while i >= 0:
                    right, down = others[j, 0] - pixels[i, 0], others[j, 1] - pixels[i, 1]
                    if not found[i] and right * right + down * down <= reach * reach:
                        before, aside = _before(points, i, cloud, j, eye)
                        found[i] = aside < narrow * (before - margin)
                    i = following[i]


@njit(inline="always")
def _before(points: Any, i: int, cloud: Any, j: int, eye: Any) -> Any:
    """How much nearer to the eye j is than i, along the line from i to the eye, and how far aside of that line [m]."""
    ax, ay, az = cloud[j, 0] - points[i, 0], cloud[j, 1] - points[i, 1], cloud[j, 2] - points[i, 2]
    ex, ey, ez = eye[0] - points[i, 0], eye[1] - points[i, 1], eye[2] - points[i, 2]
    before = (ax * ex + ay * ey + az * ez) / math.sqrt(ex * ex + ey * ey + ez * ez)
    return before, math.sqrt(max(ax * ax + ay * ay + az * az - before * before, 0.0))
