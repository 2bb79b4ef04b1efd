"""A recording and a calibration -> PNG files with the LiDAR's points on the camera's images."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wallkit.calib.files.store import read_calibration
from wallkit.core.calibration import Calibration
from wallkit.core.types import UInt8Array
from wallkit.errors import CalibrationError
from wallkit.pipelines.calib.frames import LookFrame, frames_of
from wallkit.pipelines.outputs import result_folder
from wallkit.points.overlay import draw_points, png_bytes
from wallkit.points.project import check_usable, project

_SUFFIX = re.compile(r"\.[a-zA-Z]+$")


@dataclass(frozen=True)
class OverlayRequest:
    """What to draw: inputs (a log; or pictures, with their scans), a calibration file, and how many pictures."""

    inputs: tuple[Path, ...]
    calibration: Path
    scans: Path | None = None
    count: int = 12
    scan_topic: str | None = None
    image_topic: str | None = None
    allow_unverified: bool = False


@dataclass(frozen=True)
class Drawn:
    """One picture: its file name, how many points the scan has, and how many fall on the image."""

    file: str
    points: int
    in_image: int


def draw_overlays(
    request: OverlayRequest, out: Path, *, overwrite: bool = False, progress: Callable[[int], None] = lambda done: None
) -> list[Drawn]:
    """Draw and write them into the folder `out`, which is whole or not there.

    Raises:
        CalibrationError, LogError, OutputError: what cannot be read, used or written.
    """
    calibration = read_calibration(request.calibration)
    try:
        check_usable(calibration, allow_unverified=request.allow_unverified)
    except CalibrationError as error:
        raise CalibrationError(error.message, where=request.calibration, hint=error.hint) from error
    frames = frames_of(
        request.inputs,
        request.scans,
        count=request.count,
        scan_topic=request.scan_topic,
        image_topic=request.image_topic,
    )
    drawn: list[Drawn] = []
    with result_folder(out, overwrite=overwrite) as folder:
        for frame in frames:
            picture, inside = picture_of(calibration, frame)
            name = f"{len(drawn):03d}_{_SUFFIX.sub('', frame.name)}.png"
            (folder / name).write_bytes(png_bytes(picture))
            drawn.append(Drawn(name, len(frame.points_m), inside))
            progress(len(drawn))
        if not drawn:
            hint = "are images and scans stamped by the same clock?"
            raise CalibrationError("no image has a scan within 0.1 s", where=request.inputs[0], hint=hint)
        files = [{"file": d.file, "points": d.points, "in_image": d.in_image} for d in drawn]
        made = {"command": "wallkit calib overlay", "calibration": str(request.calibration), "pictures": files}
        (folder / "run.json").write_text(json.dumps(made, indent=2) + "\n", encoding="utf-8")
    return drawn


def picture_of(calibration: Calibration, frame: LookFrame, *, title: str = "") -> tuple[UInt8Array, int]:
    """(H, W, 3) the frame with its points, and how many fall on the image.

    Raises:
        CalibrationError: the image is not of the size that the calibration is for.
    """
    camera = calibration.camera
    if frame.pixels.shape[:2] != (camera.height, camera.width):
        size = f"{frame.pixels.shape[1]} x {frame.pixels.shape[0]} px"
        hint = "the intrinsics are of another camera or mode"
        raise CalibrationError(
            f"image {frame.name} has {size}, the calibration is for {camera.width} x {camera.height}", hint=hint
        )
    projection = project(calibration, frame.points_m, allow_unverified=True)
    ranges = np.linalg.norm(frame.points_m, axis=1)
    words = title or f"{frame.name}, {int(projection.is_inside.sum())} points"
    return draw_points(frame.pixels, projection, ranges, title=words), int(projection.is_inside.sum())
