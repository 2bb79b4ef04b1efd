"""Images of several cameras as they come -> for each sweep the one of each camera that is nearest in time."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from wallkit.core.types import CameraImage
from wallkit.logs.rig import CameraTopic

# a sweep may be recorded so much later than it was; and whatever a camera's rate and stamps, no more images than that
_LATE_NS, _HELD_MOST = 1_000_000_000, 120


@dataclass(frozen=True, slots=True)
class Taken:
    """An image, its topic, and when it was taken by the LiDAR's clock."""

    topic: str
    image: CameraImage
    moment_ns: int


class Eyes:
    """Of each camera the images of the last second and the tolerance, but none that a sweep has left behind.

    Args:
        tolerance_s: an image farther than this from a sweep does not belong to it.
    """

    def __init__(self, cameras: Sequence[CameraTopic], tolerance_s: float) -> None:
        self._offsets = {camera.topic: camera.offset_ns for camera in cameras}
        self._held: dict[str, deque[Taken]] = {camera.topic: deque(maxlen=_HELD_MOST) for camera in cameras}
        self._newest_ns: dict[str, int | None] = dict.fromkeys(self._offsets)
        self._tolerance_ns = round(tolerance_s * 1e9)
        self._held_ns = _LATE_NS + self._tolerance_ns

    @property
    def held(self) -> Iterator[Taken]:
        """Every image that is still there."""
        return (taken for images in self._held.values() for taken in images)

    def take(self, topic: str, image: CameraImage) -> Taken:
        """Keep the next image, and forget those that are too far from it.

        The one before has to agree, so that one wrong stamp costs nothing; after two, stamps have jumped.
        """
        taken = Taken(topic, image, image.stamp_ns - self._offsets[topic])
        before_ns = self._newest_ns[topic]
        low, high = sorted((taken.moment_ns, taken.moment_ns if before_ns is None else before_ns))
        images = self._held[topic]
        while images and not low - self._held_ns <= images[0].moment_ns <= high + self._held_ns:
            images.popleft()
        images.append(taken)
        self._newest_ns[topic] = taken.moment_ns
        return taken

    def forget_before(self, moment_ns: int) -> None:
        """Drop images that are too old for every sweep whose middle is at this moment or later."""
        for images in self._held.values():
            while images and images[0].moment_ns < moment_ns - self._tolerance_ns:
                images.popleft()

    def offer(self, chosen: dict[str, Taken], moment_ns: int, taken: Taken) -> None:
        """Put an image into a sweep's `chosen` (by topic), if it is near that moment and nearer than the one there."""
        away_ns, best = abs(taken.moment_ns - moment_ns), chosen.get(taken.topic)
        if away_ns <= self._tolerance_ns and (best is None or away_ns < abs(best.moment_ns - moment_ns)):
            chosen[taken.topic] = taken

    def have_seen(self, moment_ns: int) -> bool:
        """Whether every camera's newest image is from then or later, so that no nearer one can come."""
        return all(newest is not None and newest >= moment_ns for newest in self._newest_ns.values())
