"""A log with images and scans -> pairs at the moments when the board stood still before both.

The log is read twice: images at two a second, to find the board, and then the scans nearest to the images that are kept.
Neither is ever in memory as a whole.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wallkit.calib.board.boards import Board
from wallkit.calib.board.detect import find_quickly
from wallkit.calib.board.pattern import explain_larger, explain_nothing_found
from wallkit.calib.board.pose import AMBIGUOUS, pose_of_board
from wallkit.calib.extrinsics.scan_board import returns_of
from wallkit.calib.extrinsics.sightings import BoardPose
from wallkit.calib.files.store import read_calibration
from wallkit.core.camera import Camera, camera_from_info
from wallkit.core.types import CameraImage, Float64Array, PointCloud, Scan, UInt8Array
from wallkit.errors import CalibrationError
from wallkit.logs.images import pixels_from_image
from wallkit.logs.reader import Log, open_log
from wallkit.logs.topics import pick_image, pick_scan
from wallkit.pipelines.calib.extrinsics import Gathered, LeftOut, LogSource, Pair

PERIOD_S = 0.5
STILL_M_PER_S = 0.02
TOLERANCE_S = 0.1
MOST_VIEWS = 60
_FEWEST_STILL = 5
_THOROUGH = 5


@dataclass(frozen=True, eq=False)
class _Moment:
    """A board in an image of the log: its pose, and the corners of its plate (4, 3) in the camera frame."""

    stamp_ns: int
    pose: BoardPose
    corners: Float64Array


def gather_log(
    inputs: Sequence[Path],
    board: Board,
    camera_file: Path | None,
    *,
    scan_topic: str | None = None,
    image_topic: str | None = None,
    done: Callable[[int], None] = lambda count: None,
) -> Gathered:
    """Board poses and the scans of the same moments.

    Raises:
        LogError: the log cannot be read, or has no images or scans.
        CalibrationError: no intrinsics, images of another size than they are for, or no board in any image.
    """
    log = open_log(list(inputs))
    scans = pick_scan(log, scan_topic)
    images = pick_image(log, image_topic)
    if images is None:
        raise CalibrationError("the log has no images", where=log.name, hint="record the camera's image topic too")
    stored = read_calibration(camera_file) if camera_file else None
    camera = stored.camera if stored else camera_of(log, images.topic)
    moments, looked_at, left_out = _moments(log, images.topic, camera, board, done)
    if not moments:
        raise explain_nothing_found(_few_greys(log, images.topic, []), board, looked_at)
    larger = explain_larger(_few_greys(log, images.topic, moments), board)
    if larger is not None:
        raise larger
    speeds = _speeds(moments)
    kept, notes = _still(moments, speeds)
    nearest, frame = _nearest_scans(log, scans.topic, [m.stamp_ns for m in kept])
    pairs = []
    for moment in kept:
        scan = nearest.get(moment.stamp_ns)
        name = f"{moment.stamp_ns / 1e9:.3f}"
        if scan is None:
            left_out.append(LeftOut(name, f"no scan within {TOLERANCE_S * 1e3:.0f} ms"))
        elif not _has_returns(scan):
            left_out.append(LeftOut(name, "the scan is empty: nothing in it is a return"))
        else:
            pairs.append(_pair(name, moment, scan))
    covariance = stored.camera_covariance if stored else None
    files = (*inputs, *([camera_file] if camera_file else []))
    return Gathered(
        camera=camera,
        camera_covariance=covariance,
        board=board,
        pairs=tuple(pairs),
        looked_at=looked_at,
        left_out=tuple(left_out),
        files=files,
        lidar_frame=frame,
        notes=tuple(notes),
        log=LogSource(tuple(inputs), scans.topic, images.topic, _moving(moments, speeds)),
    )


# ------------------------------------------------------------------------------------------------ details


def _moments(
    log: Log, topic: str, camera: Camera, board: Board, done: Callable[[int], None]
) -> tuple[list[_Moment], int, list[LeftOut]]:
    moments: list[_Moment] = []
    left_out: list[LeftOut] = []
    next_ns, looked_at, was_there = 0, 0, False
    for message in log.messages([topic]):
        if message.stamp_ns < next_ns or not isinstance(message.value, CameraImage):
            continue
        next_ns = message.stamp_ns + int(PERIOD_S * 1e9) - 20_000_000
        looked_at += 1
        done(looked_at)
        grey = grey_of(message.value)
        if grey.shape != (camera.height, camera.width):
            sizes = f"{grey.shape[1]} x {grey.shape[0]} px, the intrinsics are for {camera.width} x {camera.height}"
            raise CalibrationError(
                f"images of {topic} have {sizes}", where=log.name, hint="give --camera of this camera and mode"
            )
        # a board that was there half a second ago is looked for well; else now and then
        corners = find_quickly(grey, board, is_thorough=was_there or looked_at % _THOROUGH == 1)
        was_there = corners is not None
        if corners is None:
            continue
        name = f"{message.stamp_ns / 1e9:.3f}"
        points = board.object_points[corners.ids]
        pose = pose_of_board(camera, points, corners.pixels, name=name)
        if pose.ambiguity < AMBIGUOUS:
            left_out.append(LeftOut(name, f"the board may be tilted either way (error ratio {pose.ambiguity:.2f})"))
            continue
        T = pose.T_camera_board
        moments.append(_Moment(message.stamp_ns, pose, board.plate_corners @ T[:3, :3].T + T[:3, 3]))
    return moments, looked_at, left_out


def _few_greys(log: Log, topic: str, moments: Sequence[_Moment], wanted: int = 3) -> Iterator[UInt8Array]:
    """Images of some moments; when there are none, images spread over the log."""
    stamps = [m.stamp_ns for m in moments]
    if not stamps:
        stamps = [m.stamp_ns for m in log.messages([topic]) if isinstance(m.value, CameraImage)]
    chosen = {stamps[int(i)] for i in np.linspace(0, len(stamps) - 1, wanted + 2)[1:-1]} if stamps else set()
    for message in log.messages([topic]):
        if message.stamp_ns in chosen and isinstance(message.value, CameraImage):
            yield grey_of(message.value)


def _has_returns(scan: Scan | PointCloud) -> bool:
    if isinstance(scan, Scan):
        return len(returns_of(scan).points_m) > 0
    return bool(np.isfinite(scan.points_m).all(axis=1).any())


def grey_of(image: CameraImage) -> UInt8Array:
    """(H, W) uint8 grey of an image."""
    import cv2

    pixels = pixels_from_image(image)
    return pixels if pixels.ndim == 2 else np.asarray(cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY), dtype=np.uint8)


def _speeds(moments: list[_Moment]) -> list[float]:
    """How fast the board's corners move [m/s] at each moment; inf where no other moment is near."""
    speeds = [np.inf] * len(moments)
    for i in range(len(moments) - 1):
        first, second = moments[i], moments[i + 1]
        seconds = (second.stamp_ns - first.stamp_ns) / 1e9
        if 0 < seconds < 2.5 * PERIOD_S:
            speed = float(np.linalg.norm(second.corners - first.corners, axis=1).mean()) / seconds
            speeds[i], speeds[i + 1] = min(speeds[i], speed), min(speeds[i + 1], speed)
    return speeds


def _moving(moments: list[_Moment], speeds: list[float]) -> tuple[tuple[int, int], ...]:
    """Stretches (begin, end) [ns] in which the board is seen and moves."""
    stretches: list[list[int]] = []
    for first, second, speed in zip(moments, moments[1:], speeds[1:], strict=False):
        gap_ns = second.stamp_ns - first.stamp_ns
        if gap_ns > 2.5e9 * PERIOD_S or not STILL_M_PER_S < speed < np.inf:
            continue
        if stretches and stretches[-1][1] == first.stamp_ns:
            stretches[-1][1] = second.stamp_ns
        else:
            stretches.append([first.stamp_ns, second.stamp_ns])
    return tuple((begin, end) for begin, end in stretches)


def _still(moments: list[_Moment], speeds: list[float]) -> tuple[list[_Moment], list[str]]:
    """One moment of every time the board was held still; all of them when it never was, with a warning."""
    groups: list[list[_Moment]] = []
    for moment, speed in zip(moments, speeds, strict=True):
        if speed > STILL_M_PER_S:
            continue
        same = groups and np.linalg.norm(groups[-1][-1].corners - moment.corners, axis=1).max() < 0.02
        if same:
            groups[-1].append(moment)
        else:
            groups.append([moment])
    still = [group[len(group) // 2] for group in groups]
    notes = []
    if len(still) < _FEWEST_STILL:
        notes.append(
            f"the board stood still {len(still)} times only, so moments in motion are used: a wrong clock moves the answer"
        )
        still = moments
    if len(still) > MOST_VIEWS:
        chosen = np.linspace(0, len(still) - 1, MOST_VIEWS).round().astype(int)
        still = [still[int(i)] for i in chosen]
    return still, notes


def _nearest_scans(log: Log, topic: str, wanted_ns: Sequence[int]) -> tuple[dict[int, Scan | PointCloud], str]:
    """The scan nearest to each stamp, by stamp, and the frame of the scans."""
    wanted = np.array(sorted(wanted_ns), dtype=np.int64)
    best: dict[int, tuple[int, Scan | PointCloud]] = {}
    frame = ""
    for message in log.messages([topic]):
        scan = message.value
        if not isinstance(scan, (Scan, PointCloud)):
            continue
        frame = scan.frame_id
        at = int(np.searchsorted(wanted, message.stamp_ns))
        for i in (at - 1, at):
            if 0 <= i < len(wanted):
                key, gap = int(wanted[i]), abs(int(wanted[i]) - message.stamp_ns)
                if gap <= TOLERANCE_S * 1e9 and (key not in best or gap < best[key][0]):
                    best[key] = gap, scan
    return {key: scan for key, (_, scan) in best.items()}, frame


def _pair(name: str, moment: _Moment, scan: Scan | PointCloud) -> Pair:
    if isinstance(scan, Scan):
        returns = returns_of(scan)
        return Pair(name, moment.pose, returns, returns.points_m, stamp_ns=scan.stamp_ns)
    return Pair(name, moment.pose, None, scan.points_m.astype(np.float64), scan.rings, scan.stamp_ns)


def camera_of(log: Log, topic: str) -> Camera:
    """The camera_info that belongs to an image topic: of the same name space, or the only one."""
    infos = log.static.camera_infos
    stem = topic.rsplit("/", 1)[0]
    near = [info for name, info in infos.items() if name.rsplit("/", 1)[0] in (stem, stem.rsplit("/", 1)[0])]
    chosen = near[:1] or (list(infos.values()) if len(infos) == 1 else [])
    if not chosen:
        hint = "give --camera FILE, or make one with `wallkit calib intrinsics`"
        raise CalibrationError(f"the log has no camera_info for {topic}", where=log.name, hint=hint)
    return camera_from_info(chosen[0], name=topic)
