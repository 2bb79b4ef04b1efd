"""Messages of a log -> images with odometry at their header stamps, for what needs a camera and no LiDAR.

As in `sync`, only header stamps are compared. Memory holds the images that wait for odometry, and the odometry since then.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

from wallkit.core.types import CameraImage, Float64Array, Odometry
from wallkit.errors import LogError
from wallkit.logs.odometry import OdometryBuffer
from wallkit.logs.reader import Log
from wallkit.logs.sync import SyncConfig, SyncReport
from wallkit.logs.topics import Track
from wallkit.logs.trajectories import poses_of

_WAITING_MOST = 100


@dataclass(frozen=True, slots=True)
class CameraFrame:
    """An image, T_odom_base (3,) at its stamp, and the longest silence of the odometry since the frame before."""

    image: CameraImage
    odometry: Float64Array
    gap_s: float

    @property
    def stamp_ns(self) -> int:
        return self.image.stamp_ns


def camera_frames(
    log: Log,
    topic: str,
    odometry: Track,
    config: SyncConfig | None = None,
    *,
    report: SyncReport | None = None,
    start_ns: int | None = None,
    end_ns: int | None = None,
) -> Iterator[CameraFrame]:
    """Images of a topic whose odometry is known, in the order of their stamps.

    Args:
        report: filled while the frames are taken; its scans are the images.
        start_ns, end_ns: only images stamped in [start, end).

    Raises:
        LogError: no image has odometry.
    """
    config, report = config or SyncConfig(), report if report is not None else SyncReport()
    buffer, waiting = OdometryBuffer(), deque[CameraImage]()
    report.odometry_dropped = buffer.dropped
    gap_max_ns, last_ns = round(config.odometry_gap_max_s * 1e9), -1
    for channel, _, value in log.decoded({topic, *odometry.topics}):
        if isinstance(value, CameraImage) and channel.topic == topic:
            if (start_ns is not None and value.stamp_ns < start_ns) or (
                end_ns is not None and value.stamp_ns >= end_ns
            ):
                continue
            report.scans += 1
            if value.stamp_ns <= last_ns:
                report.scans_dropped["repeated stamp" if value.stamp_ns == last_ns else "stamp goes back"] += 1
                continue
            last_ns = value.stamp_ns
            waiting.append(value)
        elif isinstance(value, Odometry):
            buffer.add(value.stamp_ns, value.pose)
        elif value is not None:
            for stamp_ns, pose in poses_of(value, odometry):
                buffer.add(stamp_ns, pose)
        while waiting and _is_settled(waiting[0], buffer, len(waiting)):
            yield from _frame(waiting.popleft(), buffer, report, gap_max_ns)
    for image in waiting:
        yield from _frame(image, buffer, report, gap_max_ns)
    if not report.frames:
        raise LogError(
            f"none of the {report.scans} images on {topic} has odometry: {'; '.join(report.lines()) or 'there is none'}",
            where=log.name,
            hint="`wallkit log info` shows stamps and rates of all topics",
        )


def _is_settled(image: CameraImage, buffer: OdometryBuffer, waiting: int) -> bool:
    return waiting > _WAITING_MOST or (buffer.last_ns is not None and buffer.last_ns >= image.stamp_ns)


def _frame(image: CameraImage, buffer: OdometryBuffer, report: SyncReport, gap_max_ns: int) -> Iterator[CameraFrame]:
    stamp = image.stamp_ns
    reason = ""
    if buffer.begin_ns is None or buffer.last_ns is None:
        reason = "no odometry"
    elif stamp < buffer.begin_ns:
        report.at_the_ends += buffer.begin_ns - stamp <= gap_max_ns
        reason = "before the first odometry"
    elif stamp > buffer.last_ns:
        report.at_the_ends += stamp - buffer.last_ns <= gap_max_ns
        reason = "after the last odometry"
    elif buffer.gap_between(stamp, stamp) > gap_max_ns:
        reason = f"no odometry for more than {gap_max_ns / 1e9:g} s around it"
    if reason:
        report.scans_dropped[reason] += 1
        return
    pose, gap_s = buffer.pose_at(stamp), buffer.take_gap(stamp) * 1e-9
    report.frames += 1
    report.odometry_gap_max_s = max(report.odometry_gap_max_s, gap_s)
    yield CameraFrame(image, pose, gap_s)
