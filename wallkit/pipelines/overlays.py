"""Moments of a filtered run -> pictures like the paper's figure 3, as files of the run's folder and for its report."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from wallkit.core.types import CameraImage, UInt8Array
from wallkit.errors import LogError
from wallkit.logs.reader import Log
from wallkit.pipelines.sight import picture_of
from wallkit.pipelines.watch import Moment
from wallkit.points.overlay import jpeg_bytes, png_bytes
from wallkit.points.overlay_filter import colour_of, draw_filtered
from wallkit.report.data import Photo

OVERLAYS = "overlays"
# so many stand in the report when nobody asks for overlays, and at most
REPORT_DEFAULT, _REPORT_MOST = 3, 12
_PHOTO_PX = 1100
# a picture and its labels may have stamps that differ by rounding
_SAME_NS = 20_000_000


def write_overlays(folder: Path, log: Log, moments: Sequence[Moment], *, with_files: bool) -> tuple[Photo, ...]:
    """The pictures, for the report; and as PNG files in OVERLAYS, where they are asked for.

    The report's own copies are kept as JPEG in the same place, so that `wallkit report` draws the page again.
    """
    if not moments:
        return ()
    (folder / OVERLAYS).mkdir()
    pictures, photos = _pictures(log, moments), []
    first_ns = moments[0].stamp_ns
    for number, (moment, rgb) in enumerate(zip(moments, pictures, strict=True)):
        seconds = (moment.stamp_ns - first_ns) / 1e9
        title = f"camera {moment.camera.name}, scan {moment.stamp_ns / 1e9:.3f} s"
        drawn = draw_filtered(
            rgb, moment.ids, moment.classes, moment.pixels, moment.weights, moment.all_pixels, title=title
        )
        kept, count, every = int((moment.weights >= 0.5).sum()), len(moment.weights), len(moment.all_pixels)
        looked_up = "" if count == every else f", {count} of them are looked up (black)"
        caption = (
            f"Camera {moment.camera.name}, {seconds:.1f} s after the first of these: {every} returns fall on"
            f" the image (left){looked_up}, {kept} are kept (right, green)."
        )
        name = f"{number:03d}_{moment.camera.name}_{moment.stamp_ns}"
        if with_files:
            (folder / OVERLAYS / f"{name}.png").write_bytes(png_bytes(drawn))
        if number < _REPORT_MOST:
            photos.append(Photo(caption, jpeg_bytes(drawn, width=_PHOTO_PX)))
            (folder / OVERLAYS / f"{name}.jpg").write_bytes(photos[-1].jpeg)
            (folder / OVERLAYS / f"{name}.txt").write_text(caption + "\n", encoding="utf-8")
    return tuple(photos)


def read_overlays(folder: Path) -> tuple[Photo, ...]:
    """The pictures that a run left for its report."""
    return tuple(
        Photo(path.with_suffix(".txt").read_text(encoding="utf-8").strip(), path.read_bytes())
        for path in sorted((folder / OVERLAYS).glob("*.jpg"))
        if path.with_suffix(".txt").is_file()
    )


def _pictures(log: Log, moments: Sequence[Moment]) -> list[UInt8Array]:
    """(H, W, 3) of each moment: its image, found again in the log where only labels were read; else the masks' colours."""
    found: dict[int, UInt8Array] = {}
    wanted = {i: m for i, m in enumerate(moments) if m.camera.picture_topic}
    others = {m.camera.picture_topic for m in wanted.values() if m.camera.picture_topic != m.camera.topic}
    for i, m in wanted.items():
        if m.camera.picture_topic == m.camera.topic:
            found[i] = picture_of(m.view.image)
    for message in log.messages(others) if others else ():
        for i, m in wanted.items():
            is_it = m.camera.picture_topic == message.topic and abs(message.stamp_ns - m.view.image.stamp_ns) < _SAME_NS
            if is_it and i not in found and isinstance(message.value, CameraImage):
                try:
                    found[i] = picture_of(message.value)
                except LogError:
                    continue
    return [found[i] if i in found else _from_masks(m) for i, m in enumerate(moments)]


def _from_masks(moment: Moment) -> UInt8Array:
    palette = np.zeros((256, 3), dtype=np.uint8)
    palette[: len(moment.classes)] = [colour_of(name) for name in moment.classes]
    return np.asarray(palette[moment.ids])
