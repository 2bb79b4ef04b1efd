"""Pictures of a board -> a capture: which frames were searched, which are worth using, and why the others are not."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np

from wallkit.calib.board.boards import Board
from wallkit.calib.board.detect import find_corners
from wallkit.calib.board.frames import MOST_CHOSEN, Picture, choose_frames, two_sizes
from wallkit.calib.board.pattern import explain_larger, explain_nothing_found
from wallkit.calib.board.views import Capture, View
from wallkit.core.types import UInt8Array
from wallkit.errors import CalibrationError, LogError

SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp", ".pgm")
_BLURRED = 0.35


def pictures_of_files(paths: Sequence[Path]) -> list[Picture]:
    """Picture files, those of folders in the order of their names.

    Raises:
        CalibrationError: a path does not exist, or a folder holds no pictures.
    """
    files: list[Path] = []
    for path in paths:
        if not path.exists():
            raise CalibrationError("no such file or folder", where=path)
        found = sorted(p for p in path.iterdir() if p.suffix.lower() in SUFFIXES) if path.is_dir() else [path]
        if not found:
            raise CalibrationError("holds no pictures", where=path, hint=f"known are {', '.join(SUFFIXES)}")
        files += found
    return [Picture(file.name, _reader(file), _stamp(file)) for file in files]


def _stamp(file: Path) -> int | None:
    """The nanoseconds a file name is, where it is."""
    return int(file.stem) if file.stem.isdecimal() and len(file.stem) >= 16 else None


def _reader(file: Path) -> Callable[[int], UInt8Array]:
    def grey(shrink: int) -> UInt8Array:
        return grey_from_bytes(file.read_bytes(), str(file), shrink)

    return grey


def grey_from_bytes(data: bytes, where: str, shrink: int = 1) -> UInt8Array:
    """(H, W) uint8 grey of a compressed picture, shrunk by 1, 2, 4 or 8 while it is decoded.

    Raises:
        CalibrationError: the bytes are no picture.
    """
    import cv2

    flag = cv2.IMREAD_GRAYSCALE if shrink == 1 else getattr(cv2, f"IMREAD_REDUCED_GRAYSCALE_{shrink}")
    pixels = cv2.imdecode(np.frombuffer(data, np.uint8), flag) if data else None
    if pixels is None:
        raise CalibrationError(f"{len(data)} bytes are no picture", where=where)
    return np.asarray(pixels, dtype=np.uint8)


def capture_from_pictures(
    pictures: Iterable[Picture],
    board: Board,
    count: int,
    *,
    half_window: int | None = None,
    progress: Callable[[int], None] = lambda done: None,
) -> Capture:
    """The views of a board in pictures of one camera; the pictures are gone through once.

    Args:
        count: how many pictures there are. Of more than 100 only the most different ones are searched in full.
        half_window: see `find_corners`.
        progress: told how many pictures were searched.

    Raises:
        CalibrationError, LogError: no pictures, none that can be decoded, pictures of two sizes, or the board in none of
            them, with what is seen instead.
    """
    if count == 0:
        raise CalibrationError("there are no pictures")
    left_out: Counter[str] = Counter()
    if count > MOST_CHOSEN:
        chosen = choose_frames(pictures, board, count, progress)
        left_out.update(chosen.left_out)
        # the board may be too small for shrunken frames: a few are searched in full, and explained if that fails too
        motion = {g.picture.name: g.motion_px for g in chosen.glimpses}
        searched = [g.picture for g in chosen.glimpses] or list(chosen.samples)
        if not chosen.glimpses:
            left_out["no board found"] -= len(searched)
    else:
        searched, motion = list(pictures), {}
    views: list[View] = []
    readable: list[Picture] = []
    size, failed = None, None
    for number, picture in enumerate(searched, start=1):
        if count <= MOST_CHOSEN:
            progress(number)
        try:
            grey = picture.grey(1)
        except (CalibrationError, LogError) as error:
            failed = failed or error
            left_out["cannot be decoded"] += 1
            continue
        size = size or (grey.shape[0], grey.shape[1])
        if grey.shape != size:
            raise two_sizes(readable[0], picture)
        readable.append(picture)
        found = find_corners(grey, board, half_window=half_window)
        if found is None:
            left_out["no board found"] += 1
            continue
        still = motion.get(picture.name, float("nan"))
        views.append(View(picture.name, found.ids, found.pixels, found.sharpness, still, picture.stamp_ns))
    if not readable:
        raise failed or CalibrationError("there are no pictures")
    if not views:
        raise explain_nothing_found((p.grey(1) for p in _spread(readable, 6)), board, count)
    names = {view.name for view in views}
    wrong = explain_larger((p.grey(1) for p in _spread([p for p in readable if p.name in names], 3)), board)
    if wrong is not None:
        raise wrong
    if not motion:
        views = _sharp(views, left_out)
    height, width = size or (0, 0)
    return Capture(board, width, height, tuple(views), count, tuple(sorted((+left_out).items())))


def _spread(pictures: Sequence[Picture], wanted: int) -> list[Picture]:
    """A few of the pictures, evenly spread."""
    return [pictures[i] for i in np.linspace(0, len(pictures) - 1, min(wanted, len(pictures))).astype(int).tolist()]


def _sharp(views: list[View], left_out: Counter[str]) -> list[View]:
    limit = _BLURRED * float(np.median([view.sharpness for view in views]))
    sharp = [view for view in views if view.sharpness >= limit]
    if len(views) > len(sharp):
        left_out["blurred"] += len(views) - len(sharp)
    return sharp
