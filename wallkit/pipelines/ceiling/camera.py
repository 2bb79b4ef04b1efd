"""A log -> which of its cameras looks up, where it is on the robot, and what it sees of the ceiling over time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from wallkit.core.camera import Camera
from wallkit.core.ceiling import CeilingSight
from wallkit.core.ceiling_eye import CeilingEye
from wallkit.core.types import CameraImage, Float64Array, Odometry, UInt8Array
from wallkit.errors import LogError, WallkitError
from wallkit.localize.ceiling_settings import CeilingSettings
from wallkit.logs.camera_frames import CameraFrame, camera_frames
from wallkit.logs.images import pixels_from_image
from wallkit.logs.message import Channel
from wallkit.logs.mount import find_mount
from wallkit.logs.reader import Log
from wallkit.logs.sync import SyncConfig, SyncReport
from wallkit.logs.topics import IMAGE_KINDS, Track, pick_image, pick_odometry
from wallkit.pipelines.calib.log import camera_of


@dataclass(frozen=True)
class CameraWords:
    """What the user said of the camera that looks up; None leaves it to the log.

    Attributes:
        image: its topic. odometry: topic or transform. base_frame: the frame that odometry moves.
        pose: T_base_optical as "X,Y,Z,ROLL,PITCH,YAW". urdf: the robot's description to take it from.
    """

    image: str | None = None
    odometry: str | None = None
    base_frame: str | None = None
    pose: str | None = None
    urdf: Path | None = None


@dataclass(frozen=True, eq=False)
class UpCamera:
    """A camera of a log that looks up.

    Attributes:
        channel: of its images. odometry, base_frame: what moves it.
        camera: its lens. T_base_optical: (4, 4). mount: in words where that comes from.
    """

    channel: Channel
    odometry: Track
    base_frame: str
    camera: Camera
    T_base_optical: Float64Array
    mount: str

    def eye(self, settings: CeilingSettings, height_m: float) -> CeilingEye:
        """The camera below a ceiling of a height.

        Raises:
            CalibrationError: see CeilingEye.
        """
        return CeilingEye(
            self.camera,
            self.T_base_optical,
            height_m,
            side=settings.side,
            spacing_m=settings.spacing_m,
            smooth_m=settings.smooth_m,
        )


def find_up_camera(log: Log, words: CameraWords) -> UpCamera:
    """The camera that looks up: the one named, or the only one that does.

    Raises:
        LogError: there is none, or several, or nothing tells where it sits.
        CalibrationError: it has no camera_info.
    """
    odometry = pick_odometry(log, words.odometry)
    base = words.base_frame or odometry.child or _moving_frame(log, odometry)
    topics = [c for c in log.channels_of(*IMAGE_KINDS) if "depth" not in c.topic.lower() and "oracle" not in c.topic]
    if words.image is not None or len(topics) < 2:
        channel = pick_image(log, words.image)
        if channel is None:
            raise LogError("no camera image topic", where=log.name, hint="record a camera that looks at the ceiling")
        return _up_camera(log, channel, odometry, base, words)
    upward, reasons = [], []
    for channel in topics:
        try:
            camera = _up_camera(log, channel, odometry, base, words)
        except WallkitError as error:
            reasons.append(f"{channel.topic}: {error.message}")
            continue
        if camera.camera.is_inside(camera.camera.project(camera.T_base_optical[2, :3])):
            upward.append(camera)
        else:
            reasons.append(f"{channel.topic}: does not look up")
    if len(upward) != 1:
        listed = ", ".join(camera.channel.topic for camera in upward) or "; ".join(reasons)
        raise LogError(
            f"{len(upward) or 'none'} of {len(topics)} cameras look{'' if upward else 's'} up: {listed}",
            where=log.name,
            hint="name the one below the ceiling with --image TOPIC",
        )
    return upward[0]


def _up_camera(log: Log, channel: Channel, odometry: Track, base: str, words: CameraWords) -> UpCamera:
    camera = camera_of(log, channel.topic)
    first = log.first(channel.topic)
    if not first or not isinstance(first[0].value, CameraImage):
        raise LogError(f"{channel.topic} holds no readable image", where=log.name)
    frame = first[0].value.frame_id or camera.frame
    mount = find_mount(log, base, frame, words=words.pose, urdf=words.urdf, what="camera", flag="--camera-pose")
    return UpCamera(channel, odometry, base, replace(camera, frame=frame), mount.matrix, mount.source)


def _moving_frame(log: Log, odometry: Track) -> str:
    first = log.first(odometry.topics[0])
    value = first[0].value if first else None
    return value.child_frame_id if isinstance(value, Odometry) else ""


def frames_of(
    log: Log,
    up: UpCamera,
    config: SyncConfig,
    *,
    report: SyncReport | None = None,
    window_ns: tuple[int | None, int | None] = (None, None),
) -> Iterator[CameraFrame]:
    """The camera's images with odometry, in order."""
    return camera_frames(
        log, up.channel.topic, up.odometry, config, report=report, start_ns=window_ns[0], end_ns=window_ns[1]
    )


def sights_of(
    log: Log,
    up: UpCamera,
    eye: CeilingEye,
    config: SyncConfig,
    *,
    report: SyncReport | None = None,
    window_ns: tuple[int | None, int | None] = (None, None),
) -> Iterator[CeilingSight]:
    """What the camera sees of the ceiling, image by image."""
    for frame in frames_of(log, up, config, report=report, window_ns=window_ns):
        yield CeilingSight(eye.view(frame.stamp_ns, colours_of(frame.image)), frame.odometry, frame.gap_s)


def colours_of(image: CameraImage) -> UInt8Array:
    """(H, W, 3) RGB of an image; of a grey one three times the same."""
    pixels = pixels_from_image(image)
    return np.repeat(pixels[..., None], 3, axis=2) if pixels.ndim == 2 else pixels


def is_grey(image: CameraImage) -> bool:
    """Whether an image has no colour at all."""
    pixels = pixels_from_image(image)
    return pixels.ndim == 2 or int(np.ptp(pixels.astype(np.int16), axis=2).max()) <= 2
