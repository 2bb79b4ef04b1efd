"""Frames -> the same frames with what their images show, looked at in a thread of its own ahead of the filter.

While the filter works on one frame, the images of the next few are segmented. An image is looked at once, however many
scans share it; others are skipped by rate, or when somebody says that they are not needed. What is skipped depends on
stamps and on the frames before, never on how fast the machine is.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass

from wallkit.core.segmentation import Segmentation
from wallkit.core.types import CameraImage, Frame

Look = Callable[[CameraImage], Segmentation | None]


@dataclass(frozen=True, eq=False)
class Seen:
    """What an image of a stamp shows."""

    stamp_ns: int
    segmentation: Segmentation


@dataclass
class LookReport:
    """What became of the images that frames brought along, each counted once.

    Attributes:
        looked: segmented. by_rate, by_need: skipped. unreadable: could not be decoded.
        without_image: frames that had none.
    """

    looked: int = 0
    by_rate: int = 0
    by_need: int = 0
    unreadable: int = 0
    without_image: int = 0

    def lines(self) -> list[str]:
        """One sentence for each kind that happened."""
        said = (
            (self.looked, "images segmented"),
            (self.by_rate, "images skipped by segment.rate_hz"),
            (self.by_need, "images skipped: not needed"),
            (self.unreadable, "images that could not be read"),
            (self.without_image, "scans without an image"),
        )
        return [f"{count} {words}" for count, words in said if count]


def look_ahead(
    frames: Iterable[Frame],
    look: Look,
    *,
    rate_hz: float = 0.0,
    is_needed: Callable[[Frame], bool] = lambda _: True,
    frames_ahead: int = 2,
    report: LookReport | None = None,
) -> Iterator[tuple[Frame, Seen | None]]:
    """Each frame with what its image shows; None without an image, and for those that are skipped.

    Args:
        look: decodes and segments an image, None when it cannot be decoded; called from one other thread only.
        rate_hz: images per second of stamps at most; 0: all.
        is_needed: asked, in the caller's thread, when a frame is read, which is `frames_ahead` before it is handed out.
        report: filled on the way.
    """
    state = _Ahead(look, rate_hz, report if report is not None else LookReport())
    waiting: deque[tuple[Frame, _Job | None]] = deque()
    with ThreadPoolExecutor(max_workers=1, thread_name_prefix="segment") as pool:
        try:
            for frame in frames:
                waiting.append((frame, state.job(frame, is_needed, pool)))
                if len(waiting) > frames_ahead:
                    yield state.done(*waiting.popleft())
            while waiting:
                yield state.done(*waiting.popleft())
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


# -------------------------------------------------------------------------------------------- details

_Job = tuple[int, "Future[Segmentation | None]"]


class _Ahead:
    """The image looked at last, and when the next one is due."""

    def __init__(self, look: Look, rate_hz: float, report: LookReport) -> None:
        self._look, self._report = look, report
        self._period_ns = 1e9 / rate_hz if rate_hz > 0 else 0.0
        self._image: tuple[str, int] | None = None
        self._job: _Job | None = None
        self._interval_ns = 0
        self._due_ns = -math.inf
        self._unreadable_ns: int | None = None

    def job(self, frame: Frame, is_needed: Callable[[Frame], bool], pool: ThreadPoolExecutor) -> _Job | None:
        """The look at a frame's image, begun now or before; None where there is none."""
        image = frame.image
        if image is None:
            self._report.without_image += 1
            return None
        key = image.frame_id, image.stamp_ns
        is_new = self._image != key
        if is_new:
            before = image.stamp_ns if self._image is None else self._image[1]
            self._image, self._job, self._interval_ns = key, None, max(image.stamp_ns - before, 0)
        if self._job is not None:
            return self._job
        if image.stamp_ns + self._interval_ns / 2 < self._due_ns:
            self._report.by_rate += is_new
        elif not is_needed(frame):
            self._report.by_need += is_new
        else:
            # a scan before may have had no need of it
            self._report.by_need -= not is_new
            self._report.looked += 1
            self._set_due(image.stamp_ns)
            self._job = image.stamp_ns, pool.submit(self._look, image)
        return self._job

    def done(self, frame: Frame, job: _Job | None) -> tuple[Frame, Seen | None]:
        """A frame with what was seen, as soon as that is known."""
        if job is None:
            return frame, None
        stamp_ns, future = job
        found = future.result()
        if found is not None:
            return frame, Seen(stamp_ns, found)
        if stamp_ns != self._unreadable_ns:
            self._report.looked -= 1
            self._report.unreadable += 1
            self._unreadable_ns = stamp_ns
        return frame, None

    def _set_due(self, stamp_ns: int) -> None:
        """The next moment on the beat of the first image; the image nearest to it is the one."""
        if not self._period_ns:
            return
        if self._due_ns == -math.inf:
            self._due_ns = stamp_ns
        beats = math.floor((stamp_ns + self._interval_ns / 2 - self._due_ns) / self._period_ns) + 1
        self._due_ns += beats * self._period_ns
