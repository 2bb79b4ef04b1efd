"""A moving board and whole scans or clouds -> roughly by how much the camera's clock is ahead, from nothing.

The fine stage follows the board's speed and needs returns that are on the board. Here every offset of a grid is tried: the
right one puts the board, as it was then, where the returns are.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wallkit.calib.extrinsics.cloud_board import returns_on_plate
from wallkit.calib.extrinsics.scan_board import Trace, find_trace, returns_of
from wallkit.calib.extrinsics.sightings import BoardPose
from wallkit.calib.extrinsics.time_offset import BoardTrack, TimedTrace, poses_at
from wallkit.core.types import Float64Array, PointCloud, Scan

# how far offsets are looked for, and in what steps
FARTHEST_S, _STEP_S = 0.8, 0.05
_SCANS = 40
# a board that is not where it should be counts as much as one that is so far off
_MISSED_M = 0.1


def coarse_offset(
    track: BoardTrack,
    scans: Sequence[Scan | PointCloud],
    T: Float64Array,
    plate_corners: Float64Array,
    *,
    sigma_range_m: float,
    plate_is_known: bool = True,
) -> float:
    """The offset tau [s], to some 50 ms, at which the returns lie nearest to the board; 0 when no scan shows it.

    A board that swings evenly has several offsets that look good; of equals the smallest is taken.

    Args:
        plate_corners: (4, 3) of the plate in the board frame. T: (4, 4) T_camera_lidar.
    """
    few = [scans[i] for i in np.unique(np.linspace(0, len(scans) - 1, min(_SCANS, len(scans))).astype(int))]
    best, best_s = np.inf, 0.0
    for tau_s in sorted(np.arange(-FARTHEST_S, FARTHEST_S + _STEP_S / 2, _STEP_S).tolist(), key=abs):
        off = []
        for scan in few:
            board = _board_at(track, scan, tau_s)
            if board is not None:
                trace = _trace(scan, board, plate_corners, T, sigma_range_m, plate_is_known)
                off.append(_MISSED_M if trace.why else min(_MISSED_M, _distance(trace, board, T)))
        # an offset that leaves most scans without a board cannot be judged
        if 2 * len(off) >= len(few) and off and float(np.mean(off)) < best - 1e-9:
            best, best_s = float(np.mean(off)), tau_s
    return best_s


def traces_at(
    track: BoardTrack,
    scans: Sequence[Scan | PointCloud],
    T: Float64Array,
    plate_corners: Float64Array,
    tau_s: float,
    *,
    sigma_range_m: float,
    plate_is_known: bool = True,
) -> list[TimedTrace]:
    """The returns on the board in every scan, found where the board was when the clocks differ by tau."""
    found = []
    for scan in scans:
        board = _board_at(track, scan, tau_s)
        if board is None:
            continue
        trace = _trace(scan, board, plate_corners, T, sigma_range_m, plate_is_known)
        if not trace.why and trace.offsets_s is not None:
            times = scan.stamp_ns + np.round(trace.offsets_s * 1e9).astype(np.int64)
            found.append(TimedTrace(trace.points_m, times))
    return found


def _board_at(track: BoardTrack, scan: Scan | PointCloud, tau_s: float) -> BoardPose | None:
    time = np.array([scan.stamp_ns + round(tau_s * 1e9)], dtype=np.int64)
    pose = poses_at(track, time)[0][0]
    return BoardPose(pose, np.eye(6)) if np.isfinite(pose).all() else None


def _trace(
    scan: Scan | PointCloud,
    board: BoardPose,
    plate: Float64Array,
    T: Float64Array,
    sigma_range_m: float,
    is_known: bool,
) -> Trace:
    if isinstance(scan, PointCloud):
        return returns_on_plate(scan, board, plate, T)
    return find_trace(returns_of(scan), board, plate, T, sigma_range_m=sigma_range_m, plate_is_known=is_known)


def _distance(trace: Trace, board: BoardPose, T: Float64Array) -> float:
    """How far [m] the returns are from the board's plane, on the whole."""
    return abs(float(np.median((trace.points_m @ T[:3, :3].T + T[:3, 3]) @ board.normal)) - board.distance_m)
