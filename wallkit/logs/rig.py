"""A log and the user's words -> what to read from it: topics, frames, and where the LiDAR sits."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from wallkit.core.types import Odometry
from wallkit.errors import LogError
from wallkit.logs.message import Channel
from wallkit.logs.mount import Mount, find_mount
from wallkit.logs.reader import Log
from wallkit.logs.topics import CLOUD_KINDS, Track, frame_of, pick_odometry, pick_scan


@dataclass(frozen=True, slots=True)
class CameraTopic:
    """A camera's images: their topic, and its clock against the LiDAR's: t_camera = t_lidar + offset."""

    topic: str
    offset_ns: int = 0


@dataclass(frozen=True, slots=True)
class Wanted:
    """What the user named; None leaves the choice to the log.

    Attributes:
        scan, odometry: topics; odometry may be a transform "odom->base_link".
        cameras: whose images are wanted; none: the filter does without.
        base_frame: the frame that odometry moves, where its messages do not name it.
        lidar_pose: T_base_lidar as "X,Y,YAW" or "X,Y,Z,ROLL,PITCH,YAW" [m, rad].
        urdf: the robot's description, to take the LiDAR's place from.
    """

    scan: str | None = None
    odometry: str | None = None
    base_frame: str | None = None
    lidar_pose: str | None = None
    urdf: Path | None = None
    cameras: tuple[CameraTopic, ...] = ()


@dataclass(frozen=True, slots=True)
class Rig:
    """What to read from a log.

    Attributes:
        scan: topic of sweeps; is_cloud: whether they are 3-D clouds.
        odometry: topic or transform. base_frame, lidar_frame: T_base_lidar is `mount`.
        cameras: whose images belong to the frames.
    """

    scan: Channel
    odometry: Track
    base_frame: str
    lidar_frame: str
    mount: Mount
    cameras: tuple[CameraTopic, ...] = ()

    @property
    def is_cloud(self) -> bool:
        """Whether the sweeps are 3-D clouds, of which a slice is used."""
        return self.scan.kind in CLOUD_KINDS

    @property
    def topics(self) -> set[str]:
        """What to read."""
        return {self.scan.topic, *self.odometry.topics, *(camera.topic for camera in self.cameras)}


def find_rig(log: Log, wanted: Wanted | None = None) -> Rig:
    """What to read from the log to localize the robot.

    Raises:
        LogError: no scan, no odometry, several of them, or nothing tells where the LiDAR sits.
    """
    wanted = wanted or Wanted()
    scan = pick_scan(log, wanted.scan)
    odometry = pick_odometry(log, wanted.odometry)
    first = log.first(scan.topic)
    if not first:
        raise LogError(f"the scan topic {scan.topic} holds no readable message", where=log.name)
    lidar_frame = frame_of(first[0].value)
    base_frame = wanted.base_frame or _moving_frame(log, odometry)
    mount = find_mount(log, base_frame, lidar_frame, words=wanted.lidar_pose, urdf=wanted.urdf)
    return Rig(scan, odometry, base_frame, lidar_frame, mount, wanted.cameras)


def _moving_frame(log: Log, odometry: Track) -> str:
    if odometry.child:
        return odometry.child
    first = log.first(odometry.topics[0])
    if not first:
        raise LogError(f"the odometry topic {odometry} holds no readable message", where=log.name)
    value = first[0].value
    return value.child_frame_id if isinstance(value, Odometry) else ""
