"""Images of several cameras as they come -> for each sweep the one of each camera that is nearest in time."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from wallkit.core.types import CameraImage
from wallkit.logs.rig import CameraTopic

_HELD = 10


@dataclass(frozen=True, slots=True)
class Taken:
    """An image, its topic, and when it was taken by the LiDAR's clock."""

    topic: str
    image: CameraImage
    moment_ns: int


class Eyes:
    """The last few images of each camera.

    Args:
        tolerance_s: an image farther than this from a sweep does not belong to it.
    """

    def __init__(self, cameras: Sequence[CameraTopic], tolerance_s: float) -> None:
        self._offsets = {camera.topic: camera.offset_ns for camera in cameras}
        self._held: dict[str, deque[Taken]] = {camera.topic: deque(maxlen=_HELD) for camera in cameras}
        self._tolerance_ns = round(tolerance_s * 1e9)

    @property
    def held(self) -> Iterator[Taken]:
        """Every image that is still there."""
        return (taken for images in self._held.values() for taken in images)

    def take(self, topic: str, image: CameraImage) -> Taken:
        """Keep the next image."""
        taken = Taken(topic, image, image.stamp_ns - self._offsets[topic])
        self._held[topic].append(taken)
        return taken

    def offer(self, chosen: dict[str, Taken], moment_ns: int, taken: Taken) -> None:
        """Put an image into a sweep's `chosen` (by topic), if it is near that moment and nearer than the one there."""
        away_ns, best = abs(taken.moment_ns - moment_ns), chosen.get(taken.topic)
        if away_ns <= self._tolerance_ns and (best is None or away_ns < abs(best.moment_ns - moment_ns)):
            chosen[taken.topic] = taken

    def have_seen(self, moment_ns: int) -> bool:
        """Whether every camera's newest image is from then or later, so that no nearer one can come."""
        return all(images and images[-1].moment_ns >= moment_ns for images in self._held.values())
