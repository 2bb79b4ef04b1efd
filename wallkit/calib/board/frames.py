"""A long film of a board, read once -> the frames worth searching in full: sharp, still and different from each other."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from wallkit.calib.board.boards import Board
from wallkit.calib.board.detect import find_roughly, sharpness
from wallkit.core.types import Float64Array, UInt8Array
from wallkit.errors import CalibrationError, LogError

MOST_CHOSEN = 100
# frames of a film that are looked at: five minutes at two and a half a second
_MOST_LOOKED_AT = 750
# frames kept while the film runs; from this many on they are thinned to MOST_CHOSEN
_MOST_KEPT = 160
_ROUGH_WIDTH = 300
_BLURRED, _STILL_PX, _ENOUGH_STILL = 0.35, 1.0, 20
_UNLIKE = 0.05
_SAMPLES = 6


@dataclass(frozen=True, slots=True)
class Picture:
    """One picture that is decoded when it is looked at.

    Attributes:
        name: of the file, or the stamp. grey: (shrink) -> (H, W) uint8, shrunk by 1, 2, 4 or 8 while decoding.
    """

    name: str
    grey: Callable[[int], UInt8Array]
    stamp_ns: int | None = None


@dataclass(frozen=True, slots=True)
class Glimpse:
    """A board seen in a shrunken frame: corners (n, 2) in full pixels, sharpness, and motion [px] to the next frame."""

    picture: Picture
    pixels: Float64Array
    sharpness: float
    motion_px: float = float("nan")


@dataclass(frozen=True)
class Chosen:
    """The frames to search in full, in the order of time.

    Attributes:
        size: height and width of the first frame. samples: a few evenly spread, to explain why nothing was found.
        left_out: why frames are not among them -> how many.
    """

    glimpses: tuple[Glimpse, ...]
    size: tuple[int, int]
    samples: tuple[Picture, ...]
    left_out: Counter[str]


@dataclass
class _Pool:
    """Glimpses so far, thinned when there are too many."""

    glimpses: list[Glimpse] = field(default_factory=list)
    sharpnesses: list[float] = field(default_factory=list)
    left_out: Counter[str] = field(default_factory=Counter)

    def add(self, glimpse: Glimpse) -> None:
        self.glimpses.append(glimpse)
        self.sharpnesses.append(glimpse.sharpness)
        if len(self.glimpses) >= _MOST_KEPT:
            self.thin()

    def thin(self) -> None:
        """Leaves out the blurred, the moving where enough stand still, and what looks much like another."""
        if not self.glimpses:
            return
        limit = _BLURRED * float(np.median(self.sharpnesses))
        sharp = [g for g in self.glimpses if g.sharpness >= limit]
        still = [g for g in sharp if not g.motion_px >= _STILL_PX]
        pool = still if len(still) >= _ENOUGH_STILL else sharp
        chosen = _most_different(pool, MOST_CHOSEN)
        for why, many in (
            ("blurred", len(self.glimpses) - len(sharp)),
            ("moving by more than 1 px a frame", len(sharp) - len(pool)),
            ("much like a view that is used", len(pool) - len(chosen)),
        ):
            self.left_out += Counter({why: many})
        self.glimpses = chosen


def choose_frames(
    pictures: Iterable[Picture], board: Board, count: int, progress: Callable[[int], None] = lambda done: None
) -> Chosen:
    """Goes through a film once; only the frames that may be chosen stay in memory.

    The board is looked for in shrunken frames, in every one or every few of them; its motion to the very next frame comes
    from optical flow (Lucas & Kanade).

    Raises:
        CalibrationError, LogError: frames of two sizes, or none that can be decoded.
    """
    stride = max(1, -(-count // _MOST_LOOKED_AT))
    wanted = set(np.linspace(0, count - 1, min(_SAMPLES, count)).astype(int).tolist())
    pool, samples, shrink = _Pool(), [], 1
    first: Picture | None = None
    size, small_size = (0, 0), (0, 0)
    waiting: tuple[Glimpse, UInt8Array] | None = None
    failed: CalibrationError | LogError | None = None
    for index, picture in enumerate(pictures):
        is_looked_at = index % stride == 0
        if index in wanted:
            samples.append(picture)
        if not is_looked_at:
            pool.left_out["between those looked at"] += 1
            if waiting is None:
                continue
        try:
            if first is None:
                size = _size(picture)
                first, shrink = picture, _shrink_of(size[1])
                small_size = _shape(picture.grey(shrink))
            small = picture.grey(shrink)
        except (CalibrationError, LogError) as error:
            failed = failed or error
            # a frame that was cut short while recording costs that frame, not the calibration
            if is_looked_at:
                pool.left_out["cannot be decoded"] += 1
            continue
        if small.shape != small_size:
            raise two_sizes(first, picture)
        if waiting is not None:
            pool.add(replace(waiting[0], motion_px=_motion(waiting[0], waiting[1], small, shrink)))
            waiting = None
        if not is_looked_at:
            continue
        progress(index + 1)
        found = find_roughly(small, board)
        if found is None:
            pool.left_out["no board found"] += 1
        else:
            waiting = Glimpse(picture, (found + 0.5) * shrink - 0.5, sharpness(small, found)), small
    if waiting is not None:
        pool.add(waiting[0])
    if first is None:
        raise failed or CalibrationError("there are no pictures")
    pool.thin()
    return Chosen(tuple(pool.glimpses), size, tuple(samples), pool.left_out)


def two_sizes(first: Picture, other: Picture) -> CalibrationError:
    """The error about pictures that cannot be of one camera."""
    (a_height, a_width), (b_height, b_width) = _size(first), _size(other)
    sizes = f"{first.name} is {a_width} x {a_height}, {other.name} is {b_width} x {b_height} px"
    return CalibrationError(
        f"pictures of two sizes: {sizes}", hint="calibrate each camera and each resolution by itself"
    )


def _size(picture: Picture) -> tuple[int, int]:
    return _shape(picture.grey(1))


def _shape(grey: UInt8Array) -> tuple[int, int]:
    return grey.shape[0], grey.shape[1]


def _shrink_of(width: int) -> int:
    return max(s for s in (1, 2, 4, 8) if s == 1 or width / s >= _ROUGH_WIDTH)


def _motion(glimpse: Glimpse, before: UInt8Array, after: UInt8Array, shrink: int) -> float:
    """Median distance [px of the full frame] of the corners to where they are in the next frame; inf when they are lost."""
    import cv2

    corners = np.asarray((glimpse.pixels + 0.5) / shrink - 0.5, dtype=np.float32).reshape(-1, 1, 2)
    # the third argument is only written to
    flowed, status, _ = cv2.calcOpticalFlowPyrLK(before, after, corners, np.empty_like(corners), winSize=(9, 9))
    seen = np.asarray(status).ravel() == 1
    if 2 * int(seen.sum()) < len(seen):
        return float("inf")
    steps = np.linalg.norm((np.asarray(flowed) - corners).reshape(-1, 2)[seen], axis=1)
    return float(np.median(steps)) * shrink


def _most_different(glimpses: Sequence[Glimpse], most: int) -> list[Glimpse]:
    """The farthest-point choice (k-centre) on place, size and shape of the board in the image, in the order of time."""
    if len(glimpses) <= 2:
        return list(glimpses)
    features = np.array([_features(glimpse.pixels) for glimpse in glimpses])
    features = (features - features.mean(axis=0)) / np.maximum(features.std(axis=0), 1e-9)
    chosen = [int(np.argmax(np.linalg.norm(features, axis=1)))]
    distances = np.full(len(features), np.inf)
    while len(chosen) < min(most, len(features)):
        distances = np.minimum(distances, np.linalg.norm(features - features[chosen[-1]], axis=1))
        farthest = int(np.argmax(distances))
        if distances[farthest] <= _UNLIKE:
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
