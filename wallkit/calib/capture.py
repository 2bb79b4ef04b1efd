"""Pictures of a board -> a capture: which frames were searched, which are worth using, and why the others are not."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from wallkit.calib.boards import Board
from wallkit.calib.detect import find_corners, find_roughly, sharpness
from wallkit.calib.pattern import explain_larger, explain_nothing_found
from wallkit.calib.views import Capture, View
from wallkit.core.types import Float64Array, UInt8Array
from wallkit.errors import CalibrationError

SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp", ".pgm")
# more pictures than this are first searched in a shrunken copy, and the most different ones then in full
_SEARCH_ALL = 100
_MOST_LOOKED_AT = 1500
_ROUGH_WIDTH = 300
_BLURRED, _STILL_PX, _ENOUGH_STILL = 0.35, 1.0, 20


@dataclass(frozen=True, slots=True)
class Picture:
    """One picture that is decoded when it is looked at.

    Attributes:
        name: of the file, or the stamp. grey: (shrink) -> (H, W) uint8, shrunk by 1, 2, 4 or 8 while decoding.
    """

    name: str
    grey: Callable[[int], UInt8Array]
    stamp_ns: int | None = None


Pictures = Callable[[], Iterable[Picture]]
"""Starts over at the first picture each time it is called: a log is read twice rather than kept in memory."""


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
    pictures: Pictures,
    board: Board,
    count: int,
    *,
    half_window: int | None = None,
    progress: Callable[[int], None] = lambda done: None,
) -> Capture:
    """The views of a board in pictures of one camera.

    Args:
        count: how many pictures there are.
        half_window: see `find_corners`.
        progress: told how many pictures were searched.

    Raises:
        CalibrationError: no pictures, pictures of two sizes, or the board in none of them, with what is seen instead.
    """
    first = next(iter(pictures()), None)
    if first is None:
        raise CalibrationError("there are no pictures")
    height, width = first.grey(1).shape
    left_out: Counter[str] = Counter()
    wanted = None
    if count > _SEARCH_ALL:
        shrink = max(s for s in (1, 2, 4, 8) if s == 1 or width / s >= _ROUGH_WIDTH)
        wanted = _worth_a_look(pictures, board, count, shrink, left_out, progress)
    views, looked_at = [], 0
    for index, picture in enumerate(pictures()):
        if wanted is not None and index not in wanted:
            continue
        grey = picture.grey(1)
        _check_size(grey.shape, (height, width), first.name, picture.name)
        found = find_corners(grey, board, half_window=half_window)
        looked_at += 1
        if wanted is None:
            progress(looked_at)
        if found is None:
            left_out["no board found"] += 1
            continue
        motion = wanted[index] if wanted is not None else float("nan")
        views.append(View(picture.name, found.ids, found.pixels, found.sharpness, motion, picture.stamp_ns))
    if not views:
        raise explain_nothing_found((p.grey(1) for p in _spread(pictures, count)), board, count)
    wrong = explain_larger((p.grey(1) for p in _named(pictures, views)), board)
    if wrong is not None:
        raise wrong
    if wanted is None:
        views = _sharp(views, left_out)
    return Capture(board, width, height, tuple(views), count, tuple(sorted(left_out.items())))


def _check_size(shape: tuple[int, ...], first: tuple[int, ...], first_name: str, name: str) -> None:
    if shape != first:
        sizes = f"{first_name} is {first[1]} x {first[0]}, {name} is {shape[1]} x {shape[0]} px"
        raise CalibrationError(
            f"pictures of two sizes: {sizes}", hint="calibrate each camera and each resolution by itself"
        )


def _spread(pictures: Pictures, count: int, wanted: int = 6) -> list[Picture]:
    """A few pictures, evenly spread."""
    chosen = set(np.linspace(0, count - 1, min(wanted, count)).astype(int).tolist())
    return [picture for index, picture in enumerate(pictures()) if index in chosen]


def _named(pictures: Pictures, views: Sequence[View], wanted: int = 3) -> list[Picture]:
    """The pictures of a few views, evenly spread."""
    names = {views[i].name for i in np.linspace(0, len(views) - 1, min(wanted, len(views))).astype(int)}
    return [picture for picture in pictures() if picture.name in names]


def _sharp(views: list[View], left_out: Counter[str]) -> list[View]:
    limit = _BLURRED * float(np.median([view.sharpness for view in views]))
    sharp = [view for view in views if view.sharpness >= limit]
    if len(views) > len(sharp):
        left_out["blurred"] += len(views) - len(sharp)
    return sharp


# ------------------------------------------------------------------------------------------- choosing among many frames


@dataclass(frozen=True, slots=True)
class Glimpse:
    """A board seen in a shrunken frame: its number, corners (n, 2) in full pixels, sharpness, and motion [px] a frame."""

    index: int
    pixels: Float64Array
    sharpness: float
    motion_px: float = float("nan")


def _worth_a_look(
    pictures: Pictures,
    board: Board,
    count: int,
    shrink: int,
    left_out: Counter[str],
    progress: Callable[[int], None],
) -> dict[int, float]:
    """Numbers of the frames to search in full -> motion: sharp, still where there are enough, and different."""
    stride = max(1, -(-count // _MOST_LOOKED_AT))
    glimpses: list[Glimpse] = []
    for index, picture in enumerate(pictures()):
        if index % stride:
            continue
        progress(index + 1)
        small = picture.grey(shrink)
        found = find_roughly(small, board)
        if found is not None:
            glimpses.append(Glimpse(index, (found + 0.5) * shrink - 0.5, sharpness(small, found)))
        else:
            left_out["no board found"] += 1
    if stride > 1:
        left_out["between those looked at"] += count - -(-count // stride)
    if not glimpses:
        # the board may be too small for shrunken frames: a few are searched in full, and explained if that fails too
        return dict.fromkeys(np.linspace(0, count - 1, 2 * _ENOUGH_STILL).astype(int).tolist(), float("nan"))
    glimpses = _with_motion(glimpses, stride)
    limit = _BLURRED * float(np.median([g.sharpness for g in glimpses]))
    sharp = [g for g in glimpses if g.sharpness >= limit]
    still = [g for g in sharp if g.motion_px < _STILL_PX]
    pool = still if len(still) >= _ENOUGH_STILL else sharp
    chosen = _most_different(pool, _SEARCH_ALL)
    for why, many in (
        ("blurred", len(glimpses) - len(sharp)),
        ("moving by more than 1 px a frame", len(sharp) - len(pool)),
        ("much like a view that is used", len(pool) - len(chosen)),
    ):
        if many:
            left_out[why] += many
    return {glimpse.index: glimpse.motion_px for glimpse in chosen}


def _with_motion(glimpses: Sequence[Glimpse], stride: int) -> list[Glimpse]:
    """Each with the smaller of its median corner displacements to the frames before and after it."""
    moved = []
    for i, glimpse in enumerate(glimpses):
        steps = []
        for other in (*glimpses[max(0, i - 1) : i], *glimpses[i + 1 : i + 2]):
            frames = abs(other.index - glimpse.index)
            if frames <= 2 * stride and other.pixels.shape == glimpse.pixels.shape:
                steps.append(float(np.median(np.linalg.norm(other.pixels - glimpse.pixels, axis=1))) / frames)
        moved.append(replace(glimpse, motion_px=min(steps, default=float("nan"))))
    return moved


def _most_different(glimpses: Sequence[Glimpse], most: int) -> list[Glimpse]:
    """The farthest-point choice (k-centre) on place, size and shape of the board in the image, in the order of time."""
    if len(glimpses) <= most:
        return list(glimpses)
    features = np.array([_features(glimpse.pixels) for glimpse in glimpses])
    features = (features - features.mean(axis=0)) / np.maximum(features.std(axis=0), 1e-9)
    chosen = [int(np.argmax(np.linalg.norm(features, axis=1)))]
    distances = np.full(len(features), np.inf)
    while len(chosen) < most:
        distances = np.minimum(distances, np.linalg.norm(features - features[chosen[-1]], axis=1))
        farthest = int(np.argmax(distances))
        if distances[farthest] <= 0.05:
            break
        chosen.append(farthest)
    return [glimpses[i] for i in sorted(chosen)]


def _features(pixels: Float64Array) -> list[float]:
    """Place, log size, and how the outline leans: (u, v, size, aspect, shear)."""
    centre = pixels.mean(axis=0)
    xx, yy = pixels.var(axis=0)
    xy = float(np.prod(pixels - centre, axis=1).mean())
    return [
        *centre.tolist(),
        float(np.log(xx + yy)) * 2,
        float(np.log(xx / max(yy, 1e-9))),
        xy / float(np.sqrt(xx * yy)),
    ]
