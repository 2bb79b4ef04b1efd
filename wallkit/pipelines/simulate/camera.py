"""A play and its cameras -> pictures, masks and camera_info of any moment. `render` is the door to all of it."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from wallkit.core.camera import Camera
from wallkit.core.geometry import matrix_from_pose
from wallkit.core.types import CameraImage, CameraInfo, Float64Array, Int64Array, UInt8Array
from wallkit.pipelines.simulate.play import START_NS, Message, Play
from wallkit.simulate.camera import Masks, Shot, Unit, exposed, shot_of, solids_by_raster, solids_by_rays
from wallkit.simulate.photo import developed, jpeg_from_pixels
from wallkit.simulate.scenario import CameraSetup
from wallkit.simulate.scene import NOTHING
from wallkit.simulate.timing import NEVER, Schedule

# what a mask's pixel says that shows nothing
NO_CLASS, NO_INSTANCE = 255, 65535


def render(
    play: Play,
    camera: Unit | str,
    at_ns: int,
    *,
    masks: Masks = "exact",
    pictures: bool = True,
    T_map_optical: Float64Array | None = None,
) -> Shot:
    """What a camera sees at a moment: its image, and the class and instance of every pixel.

    Args:
        camera: one of the scenario's by its name, or a unit of your own (see `unit_of`).
        at_ns: people and doors are where they are then; START_NS is the beginning.
        masks: exact by rays; raster by the renderer, ten times as fast; none: all pixels show nothing.
        pictures: False: masks only; exact ones need no OpenGL.
        T_map_optical: (4, 4) where the camera is; None: where the robot carries it.

    Raises:
        SimulationError: no such camera, or a picture is asked for and no OpenGL works.
    """
    unit = camera if isinstance(camera, Unit) else play.unit(camera)

    def place_of_camera(now_ns: int) -> Float64Array:
        if T_map_optical is not None:
            return T_map_optical
        return np.asarray(matrix_from_pose(play.pose_at(now_ns)) @ unit.T_base_true)

    def exposed_at(now_ns: int) -> UInt8Array:
        times = _open_shutter(unit, now_ns)
        places = [place_of_camera(t) for t in times]
        return exposed(play.studio, unit, places, lambda k: play.place_studio(times[k]))

    def solids_at(now_ns: int, rows: slice) -> Int64Array:
        T = place_of_camera(now_ns)
        if masks == "exact":
            play.place(now_ns)
            return solids_by_rays(play.scene, unit, T, rows)
        play.place_studio(now_ns)
        return solids_by_raster(play.studio, unit, T)[rows]

    image = None
    if pictures:
        light = _by_strips(unit, at_ns, lambda now_ns, rows: exposed_at(now_ns)[rows])
        rng = np.random.default_rng([play.seed, zlib.crc32(unit.name.encode()), at_ns])
        image = developed(rng, unit.photo, light, metered=_metered(unit, at_ns, exposed_at))
    if masks == "none":
        solids = np.full((unit.true.height, unit.true.width), NOTHING, dtype=np.int64)
    else:
        solids = _by_strips(unit, at_ns, solids_at)
    return shot_of(play.scene, image, solids)


def _by_strips(unit: Unit, at_ns: int, shown: Callable[[int, slice], np.ndarray]) -> np.ndarray:
    """What is shown of all rows at a moment; of a rolling shutter, which reads rows from the top on, each strip's own."""
    height, photo = unit.true.height, unit.photo
    if photo.readout_s == 0:
        return shown(at_ns, slice(height))
    edges = np.round(np.linspace(0, height, photo.strips + 1)).astype(int).tolist()
    return np.concatenate(
        [
            shown(at_ns + round(((a + b) / 2 / height - 0.5) * photo.readout_s * 1e9), slice(a, b))
            for a, b in pairwise(edges)
        ]
    )


def _metered(unit: Unit, at_ns: int, exposed_at: Callable[[int], UInt8Array]) -> UInt8Array | None:
    """What auto exposure goes by; None for the picture itself. Before the log begins, nothing has changed."""
    if unit.photo.exposure_lag_s == 0 or unit.photo.auto_exposure == 0:
        return None
    return exposed_at(max(min(at_ns, START_NS), at_ns - round(unit.photo.exposure_lag_s * 1e9)))


def _open_shutter(unit: Unit, at_ns: int) -> list[int]:
    """The moments that are averaged: `at_ns` is the middle."""
    if unit.photo.exposure_s == 0:
        return [at_ns]
    shares = (np.arange(unit.photo.exposures) + 0.5) / unit.photo.exposures - 0.5
    return [at_ns + round(float(share) * unit.photo.exposure_s * 1e9) for share in shares]


# -------------------------------------------------------------------------------------------- in a log


@dataclass(frozen=True, eq=False)
class CameraSensor:
    """A camera: its picture as JPEG with camera_info, and if asked for /oracle/NAME/classes and /instances as PNG."""

    play: Play
    setup: CameraSetup
    schedule: Schedule = NEVER
    unit: Unit = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "unit", self.play.unit(self.setup.name))

    def measure(self, at_ns: int, stamp_ns: int) -> Iterator[Message]:
        shot = render(self.play, self.unit, at_ns, masks=self.setup.masks, pictures=self.setup.pictures)
        frame, name = self.unit.frame, self.setup.name
        if shot.image is not None:
            jpeg = jpeg_from_pixels(shot.image, self.setup.photo.jpeg_quality)
            yield Message(f"/camera/{name}/image/compressed", CameraImage(stamp_ns, frame, "jpeg", jpeg))
        yield Message(f"/camera/{name}/camera_info", camera_info(self.unit.published, stamp_ns))
        if self.setup.masks != "none":
            for what, labels, nothing in (
                ("classes", shot.classes, NO_CLASS),
                ("instances", shot.instances, NO_INSTANCE),
            ):
                png = png_from_labels(labels, nothing)
                yield Message(f"/oracle/{name}/{what}", CameraImage(stamp_ns, frame, "png", png))


def png_from_labels(labels: Int64Array, nothing: int) -> bytes:
    """(H, W) labels as a PNG of 8 or 16 bits, `nothing` where they are negative."""
    import cv2

    dtype = np.uint8 if nothing < 256 else np.uint16
    _, data = cv2.imencode(".png", np.where(labels < 0, nothing, labels).astype(dtype))
    return bytes(data)


def camera_info(camera: Camera, stamp_ns: int) -> CameraInfo:
    """The camera as a driver publishes it."""
    P = np.hstack([camera.K, np.zeros((3, 1))])
    return CameraInfo(
        stamp_ns, camera.frame, camera.width, camera.height, camera.model, camera.D, camera.K, np.eye(3), P
    )
