"""A log, calibrations and the user's words -> the cameras that filters look through, checked before the first scan."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wallkit.calib.files.store import read_calibration
from wallkit.core.calibration import Calibration
from wallkit.core.types import CameraImage, CameraInfo, UInt8Array
from wallkit.errors import CalibrationError, ConfigError, LogError, closest
from wallkit.logs.images import pixels_from_image
from wallkit.logs.message import Message
from wallkit.logs.reader import Log
from wallkit.logs.rig import CameraTopic
from wallkit.logs.topics import IMAGE_KINDS, ORACLE, camera_of_topic, is_copy, is_picture_name
from wallkit.points.project import check_usable

# the model that asks the simulator, instead of looking
ORACLE_MODEL = "oracle"
# images that tell how often they come
_FIRST = 12
# intrinsics that differ more are of another camera or mode
_SAME_FOCAL = 0.02


@dataclass(frozen=True)
class CameraRequest:
    """What the user says about cameras.

    Attributes:
        calibrations: a file for each camera. cameras: their topics or names, in the same order; none: found by the files.
        model: an ONNX file, "oracle" for what a simulator recorded, "default" for the one inside the package; "" for the
            settings' own, else the default.
        allow_unverified: use a calibration whose verdict is FAIL.
        may_fall_back: go on with the LiDAR alone where the cameras cannot be used.
        overlays: pictures to draw.
    """

    calibrations: tuple[Path, ...] = ()
    cameras: tuple[str, ...] = ()
    model: str = ""
    allow_unverified: bool = False
    may_fall_back: bool = False
    overlays: int = 0


@dataclass(frozen=True, eq=False)
class Camera:
    """One camera of a run.

    Attributes:
        name: for people. topic: of what is segmented: its pictures, or the oracle's labels of them.
        picture_topic: of its pictures; "" where the log has only labels.
        calibration, source: and the file it came from.
        notes: what is odd about it, a sentence each.
        interval_s: median time between its first images; None of a single one.
    """

    name: str
    topic: str
    picture_topic: str
    calibration: Calibration
    source: Path
    notes: tuple[str, ...] = ()

    interval_s: float | None = None

    @property
    def wanted(self) -> CameraTopic:
        """What frames need to know."""
        return CameraTopic(self.topic, self.calibration.time_offset_ns)


def find_cameras(log: Log, request: CameraRequest, *, is_oracle: bool, lidar_frame: str) -> tuple[Camera, ...]:
    """The cameras to look through, in the order of the calibrations.

    Raises:
        CalibrationError: a file cannot be read or used, or is of another camera. LogError: the log has no such images.
        ConfigError: the words do not fit together.
    """
    if not request.calibrations:
        hint = "--calib FILE; make one with `wallkit calib extrinsics`, check it with `wallkit calib verify`"
        raise ConfigError("a camera filter needs to know where LiDAR points land in the image", hint=hint)
    if request.cameras and len(request.cameras) != len(request.calibrations):
        message = f"{len(request.cameras)} cameras and {len(request.calibrations)} calibrations"
        raise ConfigError(message, where="--camera", hint="--camera once for each --calib, in their order")
    known = _image_topics(log, is_oracle=is_oracle)
    found: list[Camera] = []
    for number, path in enumerate(request.calibrations):
        calibration = _usable(path, request, lidar_frame)
        name = request.cameras[number] if request.cameras else ""
        topic = _topic_of(log, known, calibration, path, name, alone=len(request.calibrations) == 1)
        if any(camera.topic == topic for camera in found):
            raise ConfigError(
                f"two calibrations are for {topic}", where="--calib", hint="name each camera with --camera"
            )
        found.append(_checked(log, topic, calibration, path, allow_unverified=request.allow_unverified))
    return tuple(found)


def oracle_names(log: Log) -> tuple[str, ...]:
    """Names of the numbers in a simulated log's labels.

    Raises:
        LogError: it has none.
    """
    for message in log.first(f"{ORACLE}names"):
        return tuple(json.loads(str(message.value))["classes"])
    hint = "`wallkit simulate log MAP --masks raster` records them; for other logs give --model FILE.onnx"
    raise LogError(f"holds no labels of a simulator ({ORACLE}names)", where=log.name, hint=hint)


def _usable(path: Path, request: CameraRequest, lidar_frame: str) -> Calibration:
    calibration = read_calibration(path)
    try:
        check_usable(calibration, allow_unverified=request.allow_unverified)
    except CalibrationError as error:
        raise CalibrationError(error.message, where=path, hint=error.hint) from error
    is_other = bool(calibration.lidar_frame and lidar_frame and calibration.lidar_frame != lidar_frame)
    if is_other and not request.allow_unverified:
        message = f"is of the LiDAR '{calibration.lidar_frame}', the scans are of '{lidar_frame}'"
        raise CalibrationError(message, where=path, hint="choose the other --scan, or pass --allow-unverified")
    return calibration


def _image_topics(log: Log, *, is_oracle: bool) -> tuple[str, ...]:
    """Topics that can be segmented.

    Raises:
        LogError: there are none.
    """
    names = dict.fromkeys(channel.topic for channel in log.channels_of(*IMAGE_KINDS))
    if is_oracle:
        oracle_names(log)
        found = tuple(t for t in names if t.startswith(ORACLE) and t.endswith("/classes"))
        what, hint = (
            "no labels of a simulator for any camera",
            "record them with `wallkit simulate log MAP --masks raster`",
        )
    else:
        found = tuple(t for t in names if is_picture_name(t))
        what = "no camera images"
        hint = "record the camera's topic too, or filter without a camera: --filter line_fit; or --fallback lidar"
    if not found:
        raise LogError(f"holds {what}", where=log.name, hint=hint)
    return found


def _topic_of(log: Log, known: Sequence[str], calibration: Calibration, path: Path, name: str, *, alone: bool) -> str:
    """The topic of a calibration's camera: the one named, else the one of its frame or name, else the only one.

    Raises:
        LogError: nothing, or more than one thing, is called so. CalibrationError: its camera is not in the log.
    """
    if exact := [t for t in known if name in (t, t.lstrip("/"))]:
        return exact[0]
    frames = {topic: message.value.frame_id for topic in known for message in log.first(topic)
              if isinstance(message.value, CameraImage)}  # fmt: skip
    topics = [t for t in known if not is_copy(t, frames)]
    if name:
        found = [t for t in topics if _name_of(t) == name]
        if not found:
            hint = closest(name, [*known, *(_name_of(t) for t in known)])
            raise LogError(f"no camera '{name}' whose images can be used", where=log.name, hint=hint)
        return _only(found, log, f"of a camera '{name}'", frames)
    camera = calibration.camera
    said = f"the camera of this calibration ('{camera.name}', frame '{camera.frame}')"
    found = [t for t in topics if camera.frame and frames.get(t) == camera.frame]
    found = found or [t for t in topics if camera.name and _name_of(t) == camera.name]
    if found:
        return _only(found, log, f"of {said}", frames)
    if len(topics) == 1 and alone and not (camera.frame and frames.get(topics[0], camera.frame) != camera.frame):
        return topics[0]
    listed = ", ".join(f"{_name_of(t)} ({t}, frame {frames.get(t) or '(none)'})" for t in topics)
    hint = f"say which it is, for example --camera {_name_of(topics[0])}"
    raise CalibrationError(f"{said} is not in the log: {listed}", where=path, hint=hint)


def _only(found: Sequence[str], log: Log, whose: str, frames: Mapping[str, str]) -> str:
    """The one topic that was found; of several, such as raw and rectified images, nobody can tell which was calibrated.

    Raises:
        LogError: there are several.
    """
    if len(found) == 1:
        return found[0]
    lines = "".join(f"\n    {topic}  frame {frames.get(topic) or '(none)'}" for topic in found)
    hint = f"name the whole topic that was calibrated, for example --camera {found[0]}"
    raise LogError(f"{len(found)} topics have images {whose}:{lines}", where=log.name, hint=hint)


def _name_of(topic: str) -> str:
    return topic.split("/")[2] if topic.startswith(ORACLE) else camera_of_topic(topic)


def _checked(log: Log, topic: str, calibration: Calibration, path: Path, *, allow_unverified: bool) -> Camera:
    """The camera of a topic, whose images are as large as its calibration and its camera_info say.

    Raises:
        CalibrationError: they are not. LogError: none of the first images can be read.
    """
    first = log.first(topic, _FIRST)
    image, (height, width) = _first_readable(log, topic, first)
    camera, notes = calibration.camera, _doubts(calibration, path)
    if (width, height) != (camera.width, camera.height):
        message = f"is for images of {camera.width} x {camera.height}, those of {topic} have {width} x {height}"
        hint = "the images were resized or cropped after calibrating: calibrate the mode that was recorded"
        raise CalibrationError(message, where=path, hint=hint)
    pictures = [t for t in _pictures_beside(log, topic) if _name_of(t) == _name_of(topic)]
    info = _info_of(log, pictures[0] if pictures else topic, image.frame_id)
    if info is not None:
        notes += _compared(info, calibration, (width, height), topic, path, allow_unverified=allow_unverified)
    return Camera(
        _name_of(topic), topic, pictures[0] if pictures else "", calibration, path, tuple(notes), _interval_s(first)
    )


def _first_readable(log: Log, topic: str, messages: Sequence[Message]) -> tuple[CameraImage, tuple[int, int]]:
    """An image, and its height and width; a recording may begin with a damaged one."""
    why = "there is none"
    for image in (message.value for message in messages if isinstance(message.value, CameraImage)):
        try:
            pixels = ids_from_png(image) if topic.startswith(ORACLE) else pixels_from_image(image)
        except LogError as error:
            why = error.message
        else:
            return image, (pixels.shape[0], pixels.shape[1])
    raise LogError(
        f"the topic {topic} begins with no readable image: {why}", where=log.name, hint="choose another --camera"
    )


def _interval_s(messages: Sequence[Message]) -> float | None:
    """Median time between stamps; None of fewer than two messages."""
    apart_ns = np.diff([message.stamp_ns for message in messages])
    return float(np.median(apart_ns)) * 1e-9 if len(apart_ns) else None


def too_seldom(camera: Camera, tolerance_s: float) -> tuple[str, ...]:
    """What is odd about how far from a scan an image may be: scans between two images have none."""
    if camera.interval_s is None or camera.interval_s / 2 < tolerance_s:
        return ()
    said = f"images of {camera.topic} come every {camera.interval_s:.2g} s, and one farther than {tolerance_s:g} s from"
    return (
        f"{said} a scan is not used: --set logs.image_tolerance_s={0.6 * camera.interval_s:.2g} leaves no scan out",
    )


def _doubts(calibration: Calibration, path: Path) -> list[str]:
    """What a calibration does not say of itself."""
    found = []
    if calibration.verdict != "PASS":
        said = calibration.verdict or "never verified"
        found.append(f"{path}: {said}: check it with `wallkit calib verify`")
    if calibration.pixel_error_95 is None:
        found.append(f"{path}: has no pixel_error_95, so points.look.unknown_error_px stands in for it")
    return found


def _pictures_beside(log: Log, topic: str) -> tuple[str, ...]:
    if not topic.startswith(ORACLE):
        return (topic,)
    return tuple(c.topic for c in log.channels_of(*IMAGE_KINDS) if is_picture_name(c.topic))


def _info_of(log: Log, topic: str, frame_id: str) -> CameraInfo | None:
    """The camera_info that is published beside a topic of images; None without one."""
    infos = log.static.camera_infos
    beside = {t: info for t, info in infos.items() if topic.startswith(t.rpartition("/")[0] + "/")}
    if beside:
        return beside[max(beside, key=len)]
    return next((info for info in infos.values() if frame_id and info.frame_id == frame_id), None)


def _compared(
    info: CameraInfo, calibration: Calibration, size: tuple[int, int], topic: str, path: Path, *, allow_unverified: bool
) -> list[str]:
    """What is odd about a camera_info.

    Raises:
        CalibrationError: it is of images of another size.
    """
    if (info.width, info.height) != size:
        message = f"camera_info says {info.width} x {info.height}, the images of {topic} have {size[0]} x {size[1]}"
        if allow_unverified:
            return [message]
        hint = "one of them was resized on the way; if the calibration is of the images as recorded, --allow-unverified"
        raise CalibrationError(message, where=path, hint=hint)
    focal, ours = float(info.k[0, 0]), float(calibration.camera.K[0, 0])
    if focal > 0 and abs(focal / ours - 1) > _SAME_FOCAL:
        return [f"{path}: fx is {ours:.1f} px, the log's camera_info says {focal:.1f}: another camera or zoom?"]
    return []


def ids_from_png(image: CameraImage) -> UInt8Array:
    """(H, W) numbers of an oracle's label image.

    Raises:
        LogError: it is none.
    """
    import cv2

    found = cv2.imdecode(np.frombuffer(image.data, np.uint8), cv2.IMREAD_UNCHANGED)
    if found is None or found.ndim != 2:
        raise LogError(f"{len(image.data)} bytes are no label image", where=f"image at {image.stamp_ns / 1e9:.3f} s")
    return np.asarray(found)
