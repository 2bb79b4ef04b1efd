"""Pictures a model is judged by: files, folders or logs, with the LiDAR's points in them where a calibration tells."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wallkit.calib.board.capture import SUFFIXES
from wallkit.calib.files.store import read_calibration
from wallkit.core.types import CameraImage, Float64Array, UInt8Array
from wallkit.errors import LogError, ModelError
from wallkit.logs.images import pixels_from_image
from wallkit.logs.reader import open_log
from wallkit.logs.topics import pick_image
from wallkit.pipelines.calib.frames import frames_of
from wallkit.points.project import project

_POINTS = 720


@dataclass(frozen=True, eq=False)
class Picture:
    """One picture.

    Attributes:
        rgb: (H, W, 3), or (H, W) grey.
        points: (K, 2) pixels where the LiDAR's points fall in it; None where nobody knows.
        encoded: as it was stored; None where only pixels are left.
    """

    name: str
    rgb: UInt8Array
    points: Float64Array | None = None
    encoded: CameraImage | None = None


@dataclass(frozen=True)
class PictureSource:
    """Where pictures come from.

    Attributes:
        inputs: files, folders of files, or one log. count: at most so many, evenly spread.
        calibration: file, to project the log's scans with.
    """

    inputs: tuple[Path, ...]
    count: int = 40
    calibration: Path | None = None
    image_topic: str | None = None
    scan_topic: str | None = None
    allow_unverified: bool = False


def pictures_of(source: PictureSource) -> list[Picture]:
    """The pictures.

    Raises:
        ModelError, LogError, CalibrationError: there are none, or one cannot be read.
    """
    found = list(_of_files(source) if all(map(_is_picture_place, source.inputs)) else _of_log(source))
    if not found:
        raise ModelError("no pictures", where=", ".join(map(str, source.inputs)), hint="name files, a folder or a log")
    return found


def scattered(shape: tuple[int, int]) -> Float64Array:
    """(720, 2) pixels spread evenly over an image (H, W) (Roberts' R2 sequence): what stands for points nobody knows."""
    k = np.arange(1, _POINTS + 1)[:, None]
    shares = (0.5 + k * np.array([0.7548776662466927, 0.5698402909980532])) % 1.0
    return np.asarray(shares * (shape[1], shape[0]) - 0.5)


# ------------------------------------------------------------------------------------------------ details


def _is_picture_place(path: Path) -> bool:
    if path.is_dir():
        return any(file.suffix.lower() in SUFFIXES for file in path.iterdir())
    return path.suffix.lower() in SUFFIXES


def _of_files(source: PictureSource) -> Iterator[Picture]:
    if source.calibration is not None:
        hint = "give a log, or leave --calib out"
        raise ModelError("pictures without a log have no LiDAR points", where=source.calibration, hint=hint)
    files: list[Path] = []
    for path in source.inputs:
        here = sorted(path.iterdir()) if path.is_dir() else [path]
        files += [file for file in here if file.suffix.lower() in SUFFIXES]
    for k in _spread(len(files), source.count):
        encoded = CameraImage(0, "", _encoding(files[k]), _bytes(files[k]))
        yield Picture(files[k].name, _pixels(encoded, files[k]), encoded=encoded)


def _of_log(source: PictureSource) -> Iterator[Picture]:
    if source.calibration is not None:
        yield from _with_points(source, source.calibration)
        return
    log = open_log(list(source.inputs))
    channel = pick_image(log, source.image_topic)
    if channel is None:
        raise LogError("holds no images", where=log.name, hint="name a folder of pictures")
    wanted = set(_spread(sum(1 for _ in log.raw([channel.topic])), source.count))
    for k, message in enumerate(log.messages([channel.topic])):
        if k in wanted and isinstance(message.value, CameraImage):
            name = f"{message.stamp_ns / 1e9:.3f}"
            yield Picture(name, pixels_from_image(message.value), encoded=message.value)


def _with_points(source: PictureSource, path: Path) -> Iterator[Picture]:
    calibration = read_calibration(path)
    topics = {"scan_topic": source.scan_topic, "image_topic": source.image_topic}
    for frame in frames_of(source.inputs, None, count=source.count, **topics):
        camera, shape = calibration.camera, frame.pixels.shape
        if (shape[0], shape[1]) != (camera.height, camera.width):
            said = f"the images are {shape[1]} x {shape[0]}, the calibration's {camera.width} x {camera.height}"
            raise ModelError(said, where=path, hint="calibrate at the size of the log's images")
        seen = project(calibration, frame.points_m, allow_unverified=source.allow_unverified)
        yield Picture(frame.name, frame.pixels, seen.pixels[seen.is_inside])


def _encoding(file: Path) -> str:
    suffix = file.suffix.lower().lstrip(".")
    return {"png": "png", "webp": "webp"}.get(suffix, "jpeg")


def _bytes(file: Path) -> bytes:
    try:
        return file.read_bytes()
    except OSError as error:
        raise ModelError(f"cannot be read: {error.strerror}", where=file) from error


def _pixels(encoded: CameraImage, file: Path) -> UInt8Array:
    try:
        return pixels_from_image(encoded)
    except LogError as error:
        raise ModelError(error.message, where=file, hint="is it whole? leave it out") from error


def _spread(total: int, count: int) -> list[int]:
    """At most `count` of 0 .. total - 1, the first and the last among them."""
    if total <= count:
        return list(range(total))
    return sorted(set(np.linspace(0, total - 1, count).round().astype(int).tolist()))
