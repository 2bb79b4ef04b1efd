"""A moving board -> by how much the camera's clock is ahead of the LiDAR's, how sure that is, and whether it can be told.

t_camera = t_lidar + tau. The board's pose is interpolated to the time of every return, and tau joins the transform as one
more unknown: dr/dtau = n_dot (R p + t) - d_dot is the speed of the board along its normal at the return. A board that never
moves says nothing about tau.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wallkit.calib.extrinsics.covariance import quantiles, spread_of
from wallkit.calib.extrinsics.rigid import rotation_from_vector, vector_from_rotation
from wallkit.core.types import Float64Array, Int64Array

GAP_MAX_S = 0.15
_ROUNDS = 12
# slower than this, 10 ms of offset are less than a tenth of a millimetre
_MOVES_M_PER_S = 0.02
_TELLS_S = 0.010


@dataclass(frozen=True, eq=False)
class BoardTrack:
    """Board poses of successive images: stamps_ns (N,) ascending by the camera's clock, poses (N, 4, 4) T_camera_board."""

    stamps_ns: Int64Array
    poses: Float64Array


@dataclass(frozen=True, eq=False)
class TimedTrace:
    """Returns of one scan on the board: points_m (K, 3), times_ns (K,) int64 by the LiDAR's clock."""

    points_m: Float64Array
    times_ns: Int64Array


@dataclass(frozen=True)
class TimeOffset:
    """The answer.

    Attributes:
        tau_s, sigma_s: of the offset; sigma from the scatter between the scans.
        speed: RMS speed of the board along its normal at the returns [m/s].
        correlation: largest correlation of tau with a degree of freedom of the transform.
        verdict: "known", "cannot tell" (sigma above 10 ms or no motion) or "cannot separate" (|correlation| > 0.9).
        words: in a sentence.
    """

    tau_s: float
    sigma_s: float
    speed: float
    correlation: float
    verdict: str
    words: str


def time_offset(
    track: BoardTrack, traces: Sequence[TimedTrace], T: Float64Array, *, sigma_range_m: float, start_s: float = 0.0
) -> TimeOffset:
    """tau beside the transform T_camera_lidar, which starts at T and is free to follow.

    Scans at times when the board was not seen within 0.15 s before and after say nothing and are left out.
    """
    tau, T = start_s, T.copy()
    blocks: list[tuple[Float64Array, Float64Array]] = []
    for _ in range(_ROUNDS):
        blocks = [b for trace in traces if (b := _rows(track, trace, T, tau)) is not None]
        if len(blocks) < 8:
            return _nothing(f"the board is seen by both in {len(blocks)} scans; 8 is the least")
        J, r = np.concatenate([b[0] for b in blocks]), np.concatenate([b[1] for b in blocks])
        weights = 1 / np.maximum(1.0, np.abs(r) / (3 * max(1.4826 * float(np.median(np.abs(r))), 1e-6)))
        root = np.sqrt(weights)
        scale = np.maximum(np.linalg.norm(J, axis=0), 1e-12)
        step = np.linalg.lstsq(J * root[:, None] / scale, -r * root, rcond=1e-8)[0] / scale
        T[:3, :3] = rotation_from_vector(step[:3]) @ T[:3, :3]
        T[:3, 3] += step[3:6]
        tau += float(np.clip(step[6], -0.1, 0.1))
        if abs(step[6]) < 1e-7:
            break
    return _judged(blocks, tau, sigma_range_m)


def poses_at(track: BoardTrack, times_ns: Int64Array) -> tuple[Float64Array, Float64Array]:
    """Poses between the two images around each time (slerp and linear), and how fast they change.

    Returns:
        (K, 4, 4), NaN where the images are too far apart; and (K, 6) turn [rad/s] about the board's origin and shift [m/s],
        in camera axes.
    """
    after = np.clip(np.searchsorted(track.stamps_ns, times_ns, side="right"), 1, len(track.stamps_ns) - 1)
    begin, end = track.stamps_ns[after - 1], track.stamps_ns[after]
    span = (end - begin) / 1e9
    share = (times_ns - begin) / np.maximum(end - begin, 1)
    first, second = track.poses[after - 1], track.poses[after]
    turn = vector_from_rotation(second[:, :3, :3] @ first[:, :3, :3].transpose(0, 2, 1))
    poses = np.tile(np.eye(4), (len(times_ns), 1, 1))
    poses[:, :3, :3] = rotation_from_vector(share[:, None] * turn) @ first[:, :3, :3]
    poses[:, :3, 3] = first[:, :3, 3] + share[:, None] * (second[:, :3, 3] - first[:, :3, 3])
    velocity = np.concatenate([turn, second[:, :3, 3] - first[:, :3, 3]], axis=1) / span[:, None]
    outside = (span > GAP_MAX_S) | (share < 0) | (share > 1)
    poses[outside] = np.nan
    return poses, velocity


# ------------------------------------------------------------------------------------------------ details


def _rows(
    track: BoardTrack, trace: TimedTrace, T: Float64Array, tau: float
) -> tuple[Float64Array, Float64Array] | None:
    """(K, 7) d r / d (w, dt, tau) and (K,) distances from the board as it was then; None when nobody saw it."""
    poses, velocity = poses_at(track, trace.times_ns + np.int64(round(tau * 1e9)))
    if not np.isfinite(poses).all():
        return None
    turned = trace.points_m @ T[:3, :3].T
    points = turned + T[:3, 3]
    normals, origins = poses[:, :3, 2], poses[:, :3, 3]
    away = points - origins
    distances = (normals * away).sum(axis=1)
    # the surface moves by w x (q - c) + v; the return stays
    surface = np.cross(velocity[:, :3], away) + velocity[:, 3:]
    by_tau = -(normals * surface).sum(axis=1)
    return np.column_stack([np.cross(turned, normals), normals, by_tau]), distances


def _judged(blocks: Sequence[tuple[Float64Array, Float64Array]], tau: float, sigma_m: float) -> TimeOffset:
    rows = max(len(b[1]) for b in blocks)
    J, r = np.zeros((len(blocks), rows, 7)), np.zeros((len(blocks), rows))
    for g, (slopes, left) in enumerate(blocks):
        J[g, : len(left)], r[g, : len(left)] = slopes / sigma_m, left / sigma_m
    speed = float(np.sqrt(np.mean(np.concatenate([b[0][:, 6] for b in blocks]) ** 2)))
    if speed < _MOVES_M_PER_S:
        return _nothing(f"the board hardly moves ({speed * 1e3:.0f} mm/s): move it towards the LiDAR and away", speed)
    try:
        spread = spread_of(J, r)
    except np.linalg.LinAlgError:
        # what the boards cannot show of the transform does not hinder the clock, unless it looks like the clock
        spread = spread_of(J[:, :, 6:], r)
    sigmas = spread.sigmas
    sigma = float(sigmas[-1])
    correlation = _share_in_others(J.reshape(-1, 7))
    if len(sigmas) == 7:
        correlation = float(np.abs(spread.covariance[6, :6] / (sigmas[6] * sigmas[:6])).max())
    interval_ms = 1e3 * sigma * float(quantiles(spread.degrees[-1:])[0])
    said = f"the camera's clock is {tau * 1e3:+.1f} +- {interval_ms:.1f} ms (95 %) against the LiDAR's"
    if sigma > _TELLS_S:
        return TimeOffset(
            tau, sigma, speed, correlation, "cannot tell", f"{said}: too uncertain, move the board faster"
        )
    if correlation > 0.9:
        return TimeOffset(
            tau, sigma, speed, correlation, "cannot separate", f"{said}, but a shift of the LiDAR would look the same"
        )
    return TimeOffset(tau, sigma, speed, correlation, "known", said)


def _share_in_others(J: Float64Array) -> float:
    """Multiple correlation of the last column with the others, which may depend on each other."""
    others, last = J[:, :-1] / np.maximum(np.linalg.norm(J[:, :-1], axis=0), 1e-12), J[:, -1]
    left = last - others @ np.linalg.lstsq(others, last, rcond=1e-8)[0]
    return float(np.sqrt(max(0.0, 1 - (left @ left) / (last @ last))))


def _nothing(words: str, speed: float = 0.0) -> TimeOffset:
    return TimeOffset(0.0, np.inf, speed, 0.0, "cannot tell", words)
