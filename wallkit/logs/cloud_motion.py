"""A 3-D cloud and the robot's motion during its sweep -> all its points at one moment in frame base, as in sweep.py."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from wallkit.core.geometry import relative
from wallkit.core.types import Float32Array, Float64Array, PointCloud
from wallkit.logs.clouds import transformed
from wallkit.logs.sweep import PosesAt

# moments of a sweep at which the robot's motion is worked out for a cloud, 1 ms apart in the usual 0.1 s; linear between
_MOMENTS = 101


def cloud_in_base(
    cloud: PointCloud, mount: Float64Array, poses_at: PosesAt, *, span_ns: tuple[int, int]
) -> Float32Array:
    """(P, 3) float32, all points of a cloud in frame base at its stamp; only mounted if nobody says when each was measured.

    Args:
        mount: (4, 4) T_base_lidar.
        poses_at: see points_from_scan.
        span_ns: of the scan that is a slice of the cloud. A point from before or after is moved as the first or last in it.
    """
    if cloud.offsets_s is None:
        return transformed(cloud.points_m, mount)
    first_ns, last_ns = span_ns
    moments = first_ns + np.arange(_MOMENTS) * (last_ns - first_ns) // (_MOMENTS - 1)
    poses = poses_at(np.append(moments, cloud.stamp_ns))
    x, y, yaw = relative(poses[-1], poses[:-1]).T
    c, s = np.cos(yaw), np.sin(yaw)
    # (M, 3, 4): T_base(t_0)_base(t)  T_base_lidar at each moment t
    motion = np.zeros((_MOMENTS, 3, 4))
    motion[:, 0, 0], motion[:, 0, 1], motion[:, 0, 3] = c, -s, x
    motion[:, 1, 0], motion[:, 1, 1], motion[:, 1, 3] = s, c, y
    motion[:, 2, 2] = 1
    moved = np.empty((len(cloud.points_m), 3), dtype=np.float32)
    seconds = (first_ns - cloud.stamp_ns) * 1e-9, max(last_ns - first_ns, 1) * 1e-9
    _move(cloud.points_m, cloud.offsets_s, motion @ mount, seconds, moved)
    return moved


@njit(cache=True, nogil=True)
def _move(points: Any, offsets: Any, matrices: Any, seconds: Any, moved: Any) -> None:
    """moved[k] = points[k] by the matrix (3, 4) at its offset, of those spread evenly over (first, length) seconds."""
    first, length = seconds
    last = len(matrices) - 1
    for k in range(len(points)):
        at = (offsets[k] - first) / length * last
        # not a number counts as the first
        at = min(at, float(last)) if at > 0 else 0.0
        i = min(int(at), last - 1)
        share = at - i
        for row in range(3):
            before, after = matrices[i, row], matrices[i + 1, row]
            sum_before, sum_after = before[3], after[3]
            for column in range(3):
                sum_before += before[column] * points[k, column]
                sum_after += after[column] * points[k, column]
            moved[k, row] = sum_before + share * (sum_after - sum_before)
