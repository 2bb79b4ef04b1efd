"""The moments of a log when the board moved -> the offset between the camera's clock and the LiDAR's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wallkit.calib.board.detect import find_quickly
from wallkit.calib.board.pose import AMBIGUOUS, pose_of_board
from wallkit.calib.extrinsics.coarse_offset import FARTHEST_S, coarse_offset, traces_at
from wallkit.calib.extrinsics.time_offset import BoardTrack, TimeOffset, time_offset
from wallkit.core.types import CameraImage, PointCloud, Scan
from wallkit.logs.reader import Log, open_log
from wallkit.pipelines.calib.extrinsics import ExtrinsicsRun, Gathered, outline_of
from wallkit.pipelines.calib.log import grey_of

# so many seconds of motion say as much as is needed, and cost some seconds
SECONDS = 20.0
_NEAR_NS = 150_000_000


def with_clock(run: ExtrinsicsRun) -> tuple[ExtrinsicsRun, TimeOffset | None]:
    """The run with the time offset of its log where it can be told; None of files."""
    source = run.gathered.log
    if source is None or run.result.kind == "refused":
        return run, None
    windows = _chosen(source.moving)
    if not windows:
        said = "the board never moves before both sensors: the offset of their clocks cannot be told"
        return run, TimeOffset(0.0, np.inf, 0.0, 0.0, "cannot tell", said)
    log = open_log(list(source.paths))
    track = _track(log, source.images, run.gathered, windows)
    if track is None:
        return run, TimeOffset(0.0, np.inf, 0.0, 0.0, "cannot tell", "the board is blurred whenever it moves")
    scans = _scans(log, source.scans, track)
    (plate, known), T, sigma_m = outline_of(run.gathered.board), run.result.T, run.options.sigma_range_m
    coarse_s = coarse_offset(track, scans, T, plate, sigma_range_m=sigma_m, plate_is_known=known)
    traces = traces_at(track, scans, T, plate, coarse_s, sigma_range_m=sigma_m, plate_is_known=known)
    found = time_offset(track, traces, T, sigma_range_m=sigma_m, start_s=coarse_s)
    if any(isinstance(scan, PointCloud) and scan.offsets_s is None for scan in scans):
        found = replace(
            found, words=f"{found.words}; the clouds carry no times, so up to a sweep of the LiDAR is in it"
        )
    if found.verdict != "known":
        return run, found
    gathered = replace(
        run.gathered, time_offset_ns=round(found.tau_s * 1e9), time_offset_sigma_ns=round(found.sigma_s * 1e9, 1)
    )
    return replace(run, gathered=gathered), found


# ------------------------------------------------------------------------------------------------ details


def _chosen(moving: tuple[tuple[int, int], ...]) -> list[tuple[int, int]]:
    """The longest stretches of motion, in order, up to the seconds that are enough."""
    chosen: list[tuple[int, int]] = []
    seconds = 0.0
    for begin, end in sorted(moving, key=lambda window: window[0] - window[1]):
        if seconds < SECONDS:
            chosen.append((begin, min(end, begin + int((SECONDS - seconds) * 1e9))))
            seconds += (chosen[-1][1] - begin) / 1e9
    return sorted(chosen)


def _track(log: Log, topic: str, gathered: Gathered, windows: list[tuple[int, int]]) -> BoardTrack | None:
    stamps, poses = [], []
    for message in log.messages([topic], windows[0][0], windows[-1][1]):
        image = message.value
        if not isinstance(image, CameraImage) or not any(b <= message.stamp_ns <= e for b, e in windows):
            continue
        corners = find_quickly(grey_of(image), gathered.board, is_thorough=True)
        if corners is None:
            continue
        pose = pose_of_board(gathered.camera, gathered.board.object_points[corners.ids], corners.pixels)
        if pose.ambiguity >= AMBIGUOUS:
            stamps.append(message.stamp_ns)
            poses.append(pose.T_camera_board)
    if len(stamps) < 8:
        return None
    order = np.argsort(stamps, kind="stable")
    return BoardTrack(np.array(stamps, dtype=np.int64)[order], np.array(poses)[order])


def _scans(log: Log, topic: str, track: BoardTrack) -> list[Scan | PointCloud]:
    """Scans of the times when the board was seen, whatever the offset is."""
    reach = _NEAR_NS + int(FARTHEST_S * 1e9)
    scans: list[Scan | PointCloud] = []
    for message in log.messages([topic], int(track.stamps_ns[0]) - reach, int(track.stamps_ns[-1]) + reach):
        scan = message.value
        if isinstance(scan, (Scan, PointCloud)) and int(np.abs(track.stamps_ns - scan.stamp_ns).min()) <= reach:
            scans.append(scan)
    return scans
