"""What a user names, logs, folders of pictures or detected corners -> the views of a board."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from wallkit.calib.board.boards import Board
from wallkit.calib.board.capture import SUFFIXES, capture_from_pictures, grey_from_bytes, pictures_of_files
from wallkit.calib.board.frames import Picture
from wallkit.calib.board.views import Capture, capture_from_npz
from wallkit.core.types import CameraImage, UInt8Array
from wallkit.errors import LogError
from wallkit.logs.encode import COMPRESSED
from wallkit.logs.images import pixels_from_image
from wallkit.logs.reader import Log, open_log
from wallkit.logs.topics import pick_image


@dataclass(frozen=True, slots=True)
class CaptureRequest:
    """Where the views of a board come from.

    Attributes:
        inputs: an .npz of corners; pictures and folders of them; or logs.
        topic: of the images in a log; empty: the only one.
        size: width and height of the images behind an .npz. half_window: see `find_corners`.
    """

    inputs: tuple[Path, ...]
    board: Board
    topic: str = ""
    size: tuple[int, int] | None = None
    half_window: int | None = None


def capture_from(request: CaptureRequest, progress: Callable[[int], None] = lambda done: None) -> Capture:
    """The views of the board in everything that was named.

    Raises:
        CalibrationError, LogError: what cannot be read, and why no board was found.
    """
    first = request.inputs[0]
    if first.suffix.lower() == ".npz" and len(request.inputs) == 1:
        return capture_from_npz(first, request.board, request.size)
    if is_pictures(request.inputs):
        files = pictures_of_files(request.inputs)
        return capture_from_pictures(
            files, request.board, len(files), half_window=request.half_window, progress=progress
        )
    log = open_log(request.inputs)
    channel = pick_image(log, request.topic or None)
    if channel is None:
        raise LogError("holds no images", where=log.name, hint="`wallkit log info` lists what it holds")
    topic = channel.topic
    frame = next((m.value.frame_id for m in log.first(topic) if isinstance(m.value, CameraImage)), "")
    count = channel.count if channel.count is not None else sum(1 for _ in log.raw([topic]))
    found = capture_from_pictures(
        pictures_of_log(log, topic), request.board, count, half_window=request.half_window, progress=progress
    )
    return replace(found, camera_name=topic.strip("/").split("/")[0], frame=frame)


def is_pictures(inputs: Sequence[Path]) -> bool:
    """Whether pictures or folders of pictures are named, rather than logs."""
    return all(
        any(p.suffix.lower() in SUFFIXES for p in path.iterdir()) if path.is_dir() else path.suffix.lower() in SUFFIXES
        for path in inputs
    )


def pictures_of_log(log: Log, topic: str) -> Iterator[Picture]:
    """The images of a topic, decoded only when they are looked at."""
    for message in log.messages([topic]):
        if isinstance(message.value, CameraImage):
            yield Picture(str(message.stamp_ns), _reader(message.value), message.stamp_ns)


def _reader(image: CameraImage) -> Callable[[int], UInt8Array]:
    if image.encoding.lower() in COMPRESSED:
        return lambda shrink: grey_from_bytes(image.data, f"image at {image.stamp_ns / 1e9:.3f} s", shrink)
    whole = cache(lambda: _grey(pixels_from_image(image)))
    return lambda shrink: _shrunk(whole(), shrink)


def _grey(pixels: UInt8Array) -> UInt8Array:
    import cv2

    return pixels if pixels.ndim == 2 else np.asarray(cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY), dtype=np.uint8)


def _shrunk(grey: UInt8Array, shrink: int) -> UInt8Array:
    import cv2

    if shrink == 1:
        return grey
    small = cv2.resize(grey, None, fx=1 / shrink, fy=1 / shrink, interpolation=cv2.INTER_AREA)
    return np.asarray(small, dtype=np.uint8)


def input_files(inputs: Iterable[Path]) -> list[Path]:
    """Every file behind the inputs, in order: what a result was made from."""
    return [f for p in inputs for f in (sorted(q for q in p.rglob("*") if q.is_file()) if p.is_dir() else [p])]
