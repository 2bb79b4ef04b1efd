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
Needed = Callable[[Frame], bool]


@dataclass(frozen=True, eq=False)
class Seen:
    """What an image of a topic and stamp shows."""

    topic: str
    stamp_ns: int
    segmentation: Segmentation


def look_ahead(
    frames: Iterable[Frame],
    look: Look,
    *,
    rate_hz: float = 0.0,
    is_needed: Needed = lambda _: True,
    frames_ahead: int = 2,
) -> Iterator[tuple[Frame, tuple[Seen, ...]]]:
    """Each frame with what its images show, of each camera one; without those that are skipped.

    Args:
        look: decodes and segments an image, None when it cannot be decoded; called from one other thread only.
        rate_hz: images per second of stamps at most, of each camera; 0: all.
        is_needed: asked, in the caller's thread, when a frame is read, which is `frames_ahead` before it is handed out.
    """
    cameras: dict[str, _Ahead] = {}
    waiting: deque[tuple[Frame, list[tuple[_Ahead, _Job]]]] = deque()
    with ThreadPoolExecutor(max_workers=1, thread_name_prefix="segment") as pool:
        try:
            for frame in frames:
                jobs = []
                for view in frame.views:
                    camera = cameras.setdefault(view.topic, _Ahead(view.topic, look, rate_hz))
                    job = camera.job(frame, view.image, is_needed, pool)
                    jobs += [(camera, job)] if job is not None else []
                waiting.append((frame, jobs))
                if len(waiting) > frames_ahead:
                    yield _done(*waiting.popleft())
            while waiting:
                yield _done(*waiting.popleft())
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


# -------------------------------------------------------------------------------------------- details

_Job = tuple[int, "Future[Segmentation | None]"]


def _done(frame: Frame, jobs: list[tuple[_Ahead, _Job]]) -> tuple[Frame, tuple[Seen, ...]]:
    """A frame with what was seen, as soon as that is known."""
    found = [camera.done(job) for camera, job in jobs]
    return frame, tuple(seen for seen in found if seen is not None)


class _Ahead:
    """The image of one camera that was looked at last, and when the next one is due."""

    def __init__(self, topic: str, look: Look, rate_hz: float) -> None:
        self._topic, self._look = topic, look
        self._period_ns = 1e9 / rate_hz if rate_hz > 0 else 0.0
        self._image_ns: int | None = None
        self._job: _Job | None = None
        self._interval_ns = 0
        self._due_ns = -math.inf

    def job(self, frame: Frame, image: CameraImage, is_needed: Needed, pool: ThreadPoolExecutor) -> _Job | None:
        """The look at a frame's image, begun now or before; None where there is none."""
        if self._image_ns != image.stamp_ns:
            before_ns = image.stamp_ns if self._image_ns is None else self._image_ns
            self._image_ns, self._job, self._interval_ns = image.stamp_ns, None, max(image.stamp_ns - before_ns, 0)
        if self._job is not None:
            return self._job
        is_due = image.stamp_ns + self._interval_ns / 2 >= self._due_ns
        # a scan before may have had no need of it
        if is_due and is_needed(frame):
            self._set_due(image.stamp_ns)
            self._job = image.stamp_ns, pool.submit(self._look, image)
        return self._job

    def done(self, job: _Job) -> Seen | None:
        """What was seen, as soon as that is known; None where the image cannot be read."""
        stamp_ns, future = job
        found = future.result()
        return None if found is None else Seen(self._topic, stamp_ns, found)

    def _set_due(self, stamp_ns: int) -> None:
        """The next moment on the beat of the first image; the image nearest to it is the one."""
        if not self._period_ns:
            return
        if self._due_ns == -math.inf:
            self._due_ns = stamp_ns
        beats = math.floor((stamp_ns + self._interval_ns / 2 - self._due_ns) / self._period_ns) + 1
        self._due_ns += beats * self._period_ns
