"""Messages of a log -> frames for the filter: one for each sweep, with odometry and images at the sweep's header stamp.

Only header stamps are compared. Record time, which may be days off, says just one thing: how long a sweep has waited for
messages that were recorded after it. Memory holds the sweeps that wait, the odometry since the oldest of them, and a second
of images at most, never the log.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from wallkit.core.config import setting
from wallkit.core.geometry import relative
from wallkit.core.types import CameraImage, Float32Array, Frame, Odometry, PointCloud, Scan, View
from wallkit.errors import LogError
from wallkit.logs.clouds import scan_from_cloud
from wallkit.logs.eyes import Eyes, Taken
from wallkit.logs.message import Value
from wallkit.logs.odometry import OdometryBuffer
from wallkit.logs.reader import Log
from wallkit.logs.rig import Rig
from wallkit.logs.sweep import points_from_scan, sweep_span
from wallkit.logs.trajectories import poses_of

# a raw image takes megabytes: so many sweeps at most may wait for odometry while each holds one
_WAITING_WITH_IMAGES = 50
_SPEED_OVER_NS = 100_000_000


@dataclass(frozen=True)
class SyncConfig:
    """How sweeps, odometry and images are brought together."""

    image_tolerance_s: float = setting(
        0.06,
        "an image farther than this from the sweep's middle is not used; half the time between images",
        low=0,
        high=4e9,
    )
    odometry_gap_max_s: float = setting(1.0, "longest time without odometry that is interpolated over", low=0, high=4e9)
    lookahead_s: float = setting(
        10.0, "how much later than a sweep its odometry and image may be recorded", low=0, high=4e9
    )
    range_min_m: float = setting(0.0, "nearer returns are not used (the driver's own limit counts too)", low=0)
    range_max_m: float = setting(
        100.0, "farther returns are not used (the driver's own limit counts too)", low=0, high=1e4
    )
    slice_low_m: float = setting(0.2, "bottom of the slice of a 3-D cloud, z in frame base")
    slice_high_m: float = setting(0.5, "top of the slice of a 3-D cloud, z in frame base")


@dataclass
class SyncReport:
    """What became of the messages: frames, and how many of what were dropped and why.

    Attributes:
        scans: sweeps in the chosen time. frames: those that became one. scans_dropped, odometry_dropped: by reason.
        at_the_ends: of the dropped, those where odometry began a moment later or ended a moment earlier than the sweeps,
            as it does in every recording.
        beams_dropped: by reason, summed over all frames.
        images: used, of all cameras. frames_without_image: when cameras are used, those that no image belongs to.
        odometry_gap_max_s: longest time without odometry between two frames.
    """

    scans: int = 0
    frames: int = 0
    at_the_ends: int = 0
    images: int = 0
    frames_without_image: int = 0
    odometry_gap_max_s: float = 0.0
    scans_dropped: Counter[str] = field(default_factory=Counter)
    odometry_dropped: Counter[str] = field(default_factory=Counter)
    beams_dropped: Counter[str] = field(default_factory=Counter)

    @property
    def share_dropped(self) -> float:
        """Sweeps that did not become a frame, in [0, 1]; those at the ends of the recording are not counted."""
        scans = self.scans - self.at_the_ends
        return 1 - self.frames / scans if scans else 0.0

    def lines(self) -> list[str]:
        """One sentence for each thing that was dropped."""
        counted = ((n, f"sweeps dropped: {reason}") for reason, n in sorted(self.scans_dropped.items()))
        odometry = ((n, f"odometry messages left out: {reason}") for reason, n in sorted(self.odometry_dropped.items()))
        return [f"{n} {text}" for n, text in (*counted, *odometry)]


def synchronise(
    log: Log,
    rig: Rig,
    config: SyncConfig | None = None,
    *,
    report: SyncReport | None = None,
    start_ns: int | None = None,
    end_ns: int | None = None,
) -> Iterator[Frame]:
    """One frame for each sweep whose odometry is known, by header stamp.

    Args:
        report: filled while the frames are taken.
        start_ns, end_ns: only sweeps stamped in [start, end).

    Raises:
        LogError: no sweep became a frame.
    """
    state = _Synchroniser(rig, config or SyncConfig(), report if report is not None else SyncReport(), start_ns, end_ns)
    for channel, log_ns, value in log.decoded(rig.topics):
        if value is not None:
            state.take(channel.topic, value, log_ns)
        if state.waiting:
            yield from state.ready(log_ns)
    yield from state.ready(None)
    if not state.report.frames:
        raise LogError(
            state.why_nothing(), where=log.name, hint="`wallkit log info` shows stamps and rates of all topics"
        )


@dataclass(slots=True)
class _Waiting:
    scan: Scan
    log_ns: int
    span_ns: tuple[int, int]
    cloud: PointCloud | None = None
    images: dict[str, Taken] = field(default_factory=dict)

    @property
    def middle_ns(self) -> int:
        """Of the time that the sweep took."""
        return (self.span_ns[0] + self.span_ns[1]) // 2


class _Synchroniser:
    def __init__(
        self, rig: Rig, config: SyncConfig, report: SyncReport, start_ns: int | None, end_ns: int | None
    ) -> None:
        self.report = report
        self._rig, self._config = rig, config
        self._start_ns, self._end_ns = start_ns, end_ns
        self._odometry = OdometryBuffer()
        report.odometry_dropped = self._odometry.dropped
        self.waiting: deque[_Waiting] = deque()
        self._eyes = Eyes(rig.cameras, config.image_tolerance_s)
        self._last_scan_ns: int | None = None
        self._scan_span_ns: tuple[int, int] | None = None
        self._lookahead_ns = round(config.lookahead_s * 1e9)
        self._gap_max_ns = round(config.odometry_gap_max_s * 1e9)

    def take(self, topic: str, value: Value, log_ns: int) -> None:
        """Sort a message into the buffers."""
        if isinstance(value, Odometry):
            self._odometry.add(value.stamp_ns, value.pose)
        elif topic == self._rig.scan.topic:
            cloud = value if isinstance(value, PointCloud) else None
            if cloud is not None:
                limits = {"low_m": self._config.slice_low_m, "high_m": self._config.slice_high_m}
                value = scan_from_cloud(cloud, self._rig.mount.matrix, **limits)
            if isinstance(value, Scan):
                self._take_scan(value, log_ns, cloud if self._rig.cameras else None)
        elif isinstance(value, CameraImage):
            taken = self._eyes.take(topic, value)
            for waiting in self.waiting:
                self._eyes.offer(waiting.images, waiting.middle_ns, taken)
        else:
            for stamp_ns, pose in poses_of(value, self._rig.odometry):
                self._odometry.add(stamp_ns, pose)
        last_ns = self._odometry.last_ns
        if not self.waiting and last_ns is not None:
            self._odometry.forget_before(last_ns - self._lookahead_ns)

    def ready(self, now_ns: int | None) -> Iterator[Frame]:
        """Frames that can be made. `now_ns` is the record time reached, None at the end of the log."""
        while self.waiting:
            head = self.waiting[0]
            is_full = bool(self._rig.cameras) and len(self.waiting) > _WAITING_WITH_IMAGES
            is_late = now_ns is None or now_ns - head.log_ns > self._lookahead_ns or is_full
            if not is_late and not self._is_complete(head):
                return
            self.waiting.popleft()
            frame = self._frame(head)
            if frame is not None:
                yield frame

    def why_nothing(self) -> str:
        """Why no sweep became a frame."""
        if not self.report.scans:
            return f"no sweep on {self._rig.scan.topic} in the chosen time"
        spans = [("sweeps", self._scan_span_ns)]
        if self._odometry.begin_ns is not None and self._odometry.last_ns is not None:
            spans.append(("odometry", (self._odometry.begin_ns, self._odometry.last_ns)))
        stamps = ", ".join(f"{part} from {s[0] / 1e9:.3f} to {s[1] / 1e9:.3f} s" for part, s in spans if s)
        reasons = "; ".join(self.report.lines())
        return f"none of the {self.report.scans} sweeps has odometry: {reasons} (header stamps: {stamps})"

    def _take_scan(self, scan: Scan, log_ns: int, cloud: PointCloud | None) -> None:
        if (self._start_ns is not None and scan.stamp_ns < self._start_ns) or (
            self._end_ns is not None and scan.stamp_ns >= self._end_ns
        ):
            return
        self.report.scans += 1
        first, last = self._scan_span_ns or (scan.stamp_ns, scan.stamp_ns)
        self._scan_span_ns = min(first, scan.stamp_ns), max(last, scan.stamp_ns)
        last_ns = self._last_scan_ns
        if scan.frame_id != self._rig.lidar_frame:
            self._dropped(f"frame '{scan.frame_id}' is not '{self._rig.lidar_frame}'")
        elif last_ns is not None and scan.stamp_ns <= last_ns:
            self._dropped("repeated stamp" if scan.stamp_ns == last_ns else "stamp goes back")
        else:
            self._last_scan_ns = scan.stamp_ns
            waiting = _Waiting(scan, log_ns, sweep_span(scan), cloud)
            for image in self._eyes.held:
                self._eyes.offer(waiting.images, waiting.middle_ns, image)
            # the next sweep is later than this one, and so is its middle than this one's beginning
            self._eyes.forget_before(waiting.span_ns[0])
            self.waiting.append(waiting)

    def _is_complete(self, waiting: _Waiting) -> bool:
        last_ns = self._odometry.last_ns
        needed_ns = max([waiting.span_ns[1], *(image.moment_ns for image in waiting.images.values())])
        return last_ns is not None and last_ns >= needed_ns and self._eyes.have_seen(waiting.middle_ns)

    def _views(self, waiting: _Waiting) -> tuple[View, ...]:
        """The sweep's images, with the robot's pose at each; without those whose pose odometry does not tell."""
        odometry, found = self._odometry, []
        for topic, taken in sorted(waiting.images.items()):
            is_held = odometry.last_ns is not None and odometry.held_from_ns <= taken.moment_ns <= odometry.last_ns
            if is_held:
                pose = odometry.pose_at(taken.moment_ns)
                before_ns = max(odometry.held_from_ns, taken.moment_ns - _SPEED_OVER_NS)
                driven = relative(odometry.pose_at(before_ns), pose) / max(1e-9 * (taken.moment_ns - before_ns), 1e-3)
                speed, turn = float(np.hypot(driven[0], driven[1])), abs(float(driven[2]))
                found.append(View(topic, taken.image, taken.moment_ns, pose, speed, turn))
        return tuple(found)

    def _cloud(self, waiting: _Waiting) -> Float32Array | None:
        """The whole cloud that the sweep is a slice of."""
        if waiting.cloud is None:
            return None
        from wallkit.logs.cloud_motion import cloud_in_base  # numba, for those who have a cloud and a camera

        return cloud_in_base(waiting.cloud, self._rig.mount.matrix, self._odometry.poses_at, span_ns=waiting.span_ns)

    def _frame(self, waiting: _Waiting) -> Frame | None:
        scan = waiting.scan
        if reason := self._why_no_odometry(*waiting.span_ns):
            self._dropped(reason)
            return None
        limits = {"range_min_m": self._config.range_min_m, "range_max_m": self._config.range_max_m}
        points = points_from_scan(scan, self._rig.mount.matrix, self._odometry.poses_at, **limits)
        if not len(points.xyz_m):
            self._dropped("no return between the range limits")
            return None
        pose, views = self._odometry.pose_at(scan.stamp_ns), self._views(waiting)
        cloud_m = self._cloud(waiting) if views else None
        gap_s = self._odometry.take_gap(scan.stamp_ns) * 1e-9
        self.report.frames += 1
        self.report.beams_dropped.update(points.dropped)
        self.report.odometry_gap_max_s = max(self.report.odometry_gap_max_s, gap_s)
        self.report.images += len(views)
        if self._rig.cameras and not views:
            self.report.frames_without_image += 1
        return Frame(scan.stamp_ns, points, pose, gap_s, views, cloud_m=cloud_m)

    def _why_no_odometry(self, start_ns: int, end_ns: int) -> str:
        """Why the robot's pose is not known throughout a sweep; empty when it is."""
        odometry = self._odometry
        if odometry.begin_ns is None or odometry.last_ns is None:
            return "no odometry"
        if start_ns < odometry.begin_ns:
            self.report.at_the_ends += odometry.begin_ns - start_ns <= self._gap_max_ns
            return "before the first odometry"
        if end_ns > odometry.last_ns:
            self.report.at_the_ends += end_ns - odometry.last_ns <= self._gap_max_ns
            return "odometry ends before the sweep does"
        if start_ns < odometry.held_from_ns:
            return f"recorded more than {self._config.lookahead_s:g} s after its odometry"
        if odometry.gap_between(start_ns, end_ns) > self._gap_max_ns:
            return f"no odometry for more than {self._config.odometry_gap_max_s:g} s around it"
        return ""

    def _dropped(self, reason: str) -> None:
        self.report.scans_dropped[reason] += 1
