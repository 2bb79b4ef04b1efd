"""Several runs over one log -> it is opened and made into frames once; later runs get the same frames and reports.

Frames are held in memory while they fit into a limit; a log whose frames do not is read by every run for itself.
"""

from __future__ import annotations

import copy
from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from wallkit.core.types import CameraImage, Frame, Points
from wallkit.logs.loss import Loss
from wallkit.logs.reader import Log, open_log
from wallkit.logs.rig import Rig
from wallkit.logs.sync import SyncConfig, SyncReport, synchronise

# 90 s with a camera at 10 Hz in JPEG take some 100 MB; raw images take ten times that
LIMIT_MB = 400.0


@dataclass(frozen=True, eq=False)
class _Held:
    frames: tuple[Frame, ...]
    sync: SyncReport
    loss: Loss


class Shared:
    """What several runs need only once: `prepare(..., shared=shared)` for each of them, one after the other.

    Args:
        limit_mb: of 10^6 bytes; frames that would take more are not held.
    """

    def __init__(self, limit_mb: float = LIMIT_MB) -> None:
        self._left_bytes = limit_mb * 1e6
        self._logs: dict[tuple[Path, ...], Log] = {}
        self._held: dict[Hashable, _Held | None] = {}

    def log(self, paths: Sequence[Path]) -> Log:
        """The recording, of which this run has lost nothing yet.

        Raises:
            LogError: see open_log.
        """
        key = tuple(path.resolve() for path in paths)
        if key not in self._logs:
            self._logs[key] = open_log(paths)
        return self._logs[key].reopened()

    def frames(
        self,
        log: Log,
        rig: Rig,
        config: SyncConfig,
        *,
        report: SyncReport,
        start_ns: int | None = None,
        end_ns: int | None = None,
    ) -> Iterator[Frame]:
        """As `synchronise`, from memory where a run before has taken the same frames to their end.

        What a pass over the log has lost is added to `log.loss` when the frames end.
        """
        key = tuple(path.resolve() for path in log.paths), _words(rig), config, start_ns, end_ns
        held = self._held.get(key)
        if held is not None:
            yield from held.frames
        elif key in self._held:
            yield from synchronise(log, rig, config, report=report, start_ns=start_ns, end_ns=end_ns)
            return
        else:
            again = log.reopened()
            frames: list[Frame] = []
            room = _Room(self._left_bytes)
            for frame in synchronise(again, rig, config, report=report, start_ns=start_ns, end_ns=end_ns):
                if room.takes(frame):
                    frames.append(frame)
                else:
                    frames.clear()
                yield frame
            held = _Held(tuple(frames), copy.deepcopy(report), again.loss)
            self._held[key] = held if room.left_bytes >= 0 else None
            if room.left_bytes >= 0:
                self._left_bytes = room.left_bytes
        log.loss.add_all(held.loss)
        for field in fields(report):
            setattr(report, field.name, copy.deepcopy(getattr(held.sync, field.name)))


class _Room:
    """Bytes that are left for frames; below 0 when they did not fit."""

    def __init__(self, left_bytes: float) -> None:
        self.left_bytes = left_bytes
        self._images: set[int] = set()

    def takes(self, frame: Frame) -> bool:
        """Whether it and all before it fit."""
        if self.left_bytes < 0:
            return False
        self.left_bytes -= _bytes_of(frame.points) + _bytes_of(frame)
        for view in frame.views:
            self.left_bytes -= self._new_bytes(view.image)
        return self.left_bytes >= 0

    def _new_bytes(self, image: CameraImage) -> int:
        """Of an image that no frame before has brought along; one that is held keeps its identity."""
        if id(image) in self._images:
            return 0
        self._images.add(id(image))
        return len(image.data)


def _bytes_of(item: Frame | Points) -> int:
    """Of the arrays that it holds itself."""
    values = (getattr(item, field.name) for field in fields(item))
    return sum(value.nbytes for value in values if isinstance(value, np.ndarray))


def _words(rig: Rig) -> Hashable:
    """What of a rig frames depend on."""
    mount = rig.mount.matrix.tobytes()
    return rig.scan, rig.odometry, rig.base_frame, rig.lidar_frame, mount, rig.cameras
