"""A log, or pictures and scans -> images with the LiDAR points of the same moment, evenly spread over the recording."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wallkit.calib.board.capture import pictures_of_files
from wallkit.calib.extrinsics.scan_board import returns_of
from wallkit.calib.extrinsics.scan_files import paired, read_scan, scan_files
from wallkit.core.types import CameraImage, Float64Array, PointCloud, Scan, UInt8Array
from wallkit.errors import CalibrationError, LogError
from wallkit.logs.images import pixels_from_image
from wallkit.logs.reader import open_log
from wallkit.logs.topics import pick_image, pick_scan

TOLERANCE_S = 0.1


@dataclass(frozen=True, eq=False)
class LookFrame:
    """What camera and LiDAR saw at one moment.

    Attributes:
        pixels: (H, W, 3) RGB or (H, W) uint8. points_m: (N, 3) in the LiDAR frame; of a planar scan in the order of bearing.
        intensities: (N,) or None.
    """

    name: str
    pixels: UInt8Array
    points_m: Float64Array
    intensities: Float64Array | None
    is_planar: bool


def frames_of(
    inputs: Sequence[Path],
    scans: Path | None,
    *,
    count: int,
    scan_topic: str | None = None,
    image_topic: str | None = None,
    named: Sequence[str] | None = None,
) -> Iterator[LookFrame]:
    """At most `count` frames, evenly spread; or those of these names (a file's, or the stamp as `calib` prints it).

    Raises:
        CalibrationError, LogError: nothing can be read, or no image belongs to a scan.
    """
    if scans is not None:
        return _frames_of_files(inputs, scans, count, named)
    return _frames_of_log(inputs, scan_topic, image_topic, count, named)


def _frames_of_files(
    inputs: Sequence[Path], scans: Path, count: int, named: Sequence[str] | None
) -> Iterator[LookFrame]:
    import cv2

    pictures, files = pictures_of_files(inputs), scan_files(scans)
    places = {p.name: p for path in inputs for p in (path.iterdir() if path.is_dir() else [path])}
    pairs = paired([p.name for p in pictures], [p.name for p in files], tolerance_s=TOLERANCE_S)
    if not pairs:
        hint = "name both by stamp in nanoseconds, or with the same number: pose7.png and pose7.pcd"
        raise CalibrationError("no picture belongs to a scan", where=scans, hint=hint)
    if named is not None:
        pairs = [(i, j) for i, j in pairs if pictures[i].name in named]
    for i, j in (pairs[k] for k in _spread(len(pairs), count)):
        data = np.frombuffer(places[pictures[i].name].read_bytes(), np.uint8)
        image = cv2.imdecode(data, cv2.IMREAD_COLOR)
        if image is None:
            raise CalibrationError("is no picture that can be read", where=places[pictures[i].name])
        scan = read_scan(files[j])
        yield LookFrame(
            pictures[i].name,
            np.asarray(image[..., ::-1], dtype=np.uint8),
            scan.points_m,
            scan.intensities,
            scan.is_planar,
        )


def _frames_of_log(
    inputs: Sequence[Path],
    scan_topic: str | None,
    image_topic: str | None,
    count: int,
    named: Sequence[str] | None,
) -> Iterator[LookFrame]:
    log = open_log(list(inputs))
    images, scans = pick_image(log, image_topic), pick_scan(log, scan_topic).topic
    if images is None:
        raise LogError("holds no images", where=log.name, hint="record the camera's image topic too")
    total = sum(1 for _ in log.raw([images.topic]))
    wanted = set(_spread(total, count)) if named is None else set(range(total))
    index = -1
    waiting: list[CameraImage] = []
    last: Scan | PointCloud | None = None
    for message in log.messages([images.topic, scans]):
        value = message.value
        if isinstance(value, CameraImage):
            index += 1
            if index in wanted and (named is None or f"{message.stamp_ns / 1e9:.3f}" in named):
                waiting.append(value)
        elif isinstance(value, (Scan, PointCloud)):
            for image in waiting:
                near = [s for s in (last, value) if s is not None]
                best = min(near, key=lambda scan: abs(scan.stamp_ns - image.stamp_ns))
                if abs(best.stamp_ns - image.stamp_ns) <= TOLERANCE_S * 1e9:
                    yield _frame(image, best)
            waiting, last = [], value
    for image in waiting:
        if last is not None and abs(last.stamp_ns - image.stamp_ns) <= TOLERANCE_S * 1e9:
            yield _frame(image, last)


def _frame(image: CameraImage, scan: Scan | PointCloud) -> LookFrame:
    name, pixels = f"{image.stamp_ns / 1e9:.3f}", pixels_from_image(image)
    if isinstance(scan, Scan):
        return LookFrame(name, pixels, returns_of(scan).points_m, None, True)
    intensities = None if scan.intensities is None else scan.intensities.astype(np.float64)
    return LookFrame(name, pixels, scan.points_m.astype(np.float64), intensities, False)


def _spread(total: int, count: int) -> list[int]:
    """At most `count` of 0 .. total - 1, the first and the last among them."""
    if total <= count:
        return list(range(total))
    return sorted(set(np.linspace(0, total - 1, count).round().astype(int).tolist()))
