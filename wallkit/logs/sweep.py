"""One sweep and the robot's motion during it -> points at one moment in frame base.

A LiDAR that turns while the robot moves sees each beam from another place. With T_odom_base known at every beam's time
t_k, a return p_k seen then is moved to the sweep's stamp t_0 by

    p_base(t_0) = T_base(t_0)_base(t_k)  T_base_lidar  p_lidar,k
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from wallkit.core.geometry import relative
from wallkit.core.types import Float64Array, Int64Array, Points, Scan

PosesAt = Callable[[Int64Array], Float64Array]


def beam_times(scan: Scan) -> Int64Array | None:
    """(K,) when each beam was measured [ns]; None when the driver does not say or all were at the stamp."""
    if scan.offsets_s is not None and len(scan.offsets_s):
        return scan.stamp_ns + np.round(scan.offsets_s.astype(np.float64) * 1e9).astype(np.int64)
    if scan.beam_interval_s and len(scan.ranges_m) > 1:
        return scan.stamp_ns + np.round(np.arange(len(scan.ranges_m)) * (scan.beam_interval_s * 1e9)).astype(np.int64)
    return None


def sweep_span(scan: Scan) -> tuple[int, int]:
    """First and last moment [ns] at which the robot's pose is needed for a sweep; the stamp is always inside."""
    times = beam_times(scan)
    if times is None:
        return scan.stamp_ns, scan.stamp_ns
    return min(scan.stamp_ns, int(times.min())), max(scan.stamp_ns, int(times.max()))


def points_from_scan(
    scan: Scan, mount: Float64Array, poses_at: PosesAt, *, range_min_m: float, range_max_m: float
) -> Points:
    """Returns of a sweep in frame base, at the sweep's stamp.

    Args:
        mount: (4, 4) T_base_lidar, of any tilt.
        poses_at: stamps (M,) [ns] -> T_odom_base (M, 3).
        range_min_m, range_max_m: narrower limits than the driver's, where they are.

    Returns:
        Returns between the limits. +inf and what is at or beyond the far limit are misses, with their bearing: the beam
        was free that far. NaN, 0 and what is below the near limit tell nothing (too close, too dark, an error code);
        they are counted in `dropped`, as are finite returns that only the narrower far limit cut off.
    """
    far_m, near_m = min(scan.range_max_m, range_max_m), max(scan.range_min_m, range_min_m)
    ranges = scan.ranges_m
    is_far = ranges >= far_m
    is_return = (ranges >= near_m) & ~is_far & (ranges > 0)
    hits, misses = np.flatnonzero(is_return), np.flatnonzero(is_far)
    bearing = np.stack([np.cos(scan.angles_rad), np.sin(scan.angles_rad)], axis=-1, dtype=np.float64)

    local = np.zeros((len(hits), 3))
    local[:, :2] = bearing[hits] * ranges[hits, None]
    if scan.heights_m is not None:
        local[:, 2] = scan.heights_m[hits]
    xyz = local @ mount[:3, :3].T + mount[:3, 3]
    away = bearing[misses] @ mount[:2, :2].T
    misses_rad = np.arctan2(away[:, 1], away[:, 0])

    times, offsets = beam_times(scan), None
    if times is not None:
        offsets = ((times[hits] - scan.stamp_ns) * 1e-9).astype(np.float32)
        poses = poses_at(np.append(times, scan.stamp_ns))
        motion = relative(poses[-1], poses[:-1])
        xyz[:, :2] = _turned(motion[hits], xyz[:, :2])
        misses_rad = misses_rad + motion[misses, 2]

    return Points(
        stamp_ns=scan.stamp_ns,
        xyz_m=xyz.astype(np.float32),
        ranges_m=np.linalg.norm(local, axis=1).astype(np.float32),
        beams=hits.astype(np.int64),
        origin_m=mount[:2, 3].copy(),
        range_max_m=float(far_m),
        misses_rad=misses_rad.astype(np.float32),
        dropped=_dropped(scan, near_m, far_m, is_return, is_far),
        offsets_s=offsets,
    )


def _turned(motion: Float64Array, points: Float64Array) -> Float64Array:
    """Points (K, 2), each moved by its own planar pose (K, 3)."""
    c, s = np.cos(motion[:, 2]), np.sin(motion[:, 2])
    x = c * points[:, 0] - s * points[:, 1] + motion[:, 0]
    y = s * points[:, 0] + c * points[:, 1] + motion[:, 1]
    return np.stack([x, y], axis=-1)


def _dropped(scan: Scan, near_m: float, far_m: float, is_return: np.ndarray, is_far: np.ndarray) -> dict[str, int]:
    ranges = scan.ranges_m
    if is_return.all():
        return {}
    is_nan, is_zero = np.isnan(ranges), ranges == 0
    counts = {
        "not a number": is_nan,
        "zero": is_zero,
        "below minimum range": ~(is_nan | is_zero | is_far | is_return),
        "beyond used range": is_far & (ranges < scan.range_max_m) & np.isfinite(ranges),
    }
    return {reason: n for reason, mask in counts.items() if (n := int(np.count_nonzero(mask)))}
