"""The camera_info that a log was recorded with, against the camera that its pictures give."""

from __future__ import annotations

from dataclasses import dataclass

from wallkit.calib.camera.projection_uncertainty import PixelMap, projection_difference
from wallkit.core.camera import Camera, camera_from_info
from wallkit.errors import CalibrationError
from wallkit.logs.reader import open_log
from wallkit.logs.topics import pick_image
from wallkit.pipelines.calib.captures import CaptureRequest, is_pictures


@dataclass(frozen=True)
class Published:
    """What the log says of its own camera.

    Attributes:
        topic: of the camera_info. difference: where its pixels are from the new camera's, a common turn taken out; None
            where it is no usable camera. fault: why not; else "".
    """

    topic: str
    difference: PixelMap | None
    fault: str

    @property
    def words(self) -> str:
        """In a sentence."""
        if self.difference is None:
            return f"the log's own {self.topic} is no camera: {self.fault}"
        off = self.difference
        return (
            f"the log's own {self.topic} puts pixels elsewhere by {off.median:.2f} px (median), {off.worst:.2f} (worst)"
        )


def published_against(request: CaptureRequest, camera: Camera) -> Published | None:
    """The camera_info beside the images, compared; None of files, and where the log has none."""
    if request.inputs[0].suffix.lower() == ".npz" or is_pictures(request.inputs):
        return None
    log = open_log(request.inputs)
    images = pick_image(log, request.topic or None)
    infos = log.static.camera_infos
    if images is None or not infos:
        return None
    stem = images.topic.rsplit("/", 1)[0]
    near = [topic for topic in infos if topic.rsplit("/", 1)[0] in (stem, stem.rsplit("/", 1)[0])]
    topic = near[0] if near else next(iter(infos)) if len(infos) == 1 else ""
    if not topic:
        return None
    info = infos[topic]
    if (info.width, info.height) != (camera.width, camera.height):
        sizes = f"it is for {info.width} x {info.height} px, the images have {camera.width} x {camera.height}"
        return Published(topic, None, sizes)
    try:
        other = camera_from_info(info)
    except CalibrationError as error:
        return Published(topic, None, error.message)
    return Published(topic, projection_difference(camera, other), "")
