"""A recording without a board -> what the room itself says about a calibration: gates that need no target."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from wallkit.calib.verify.free import profile_gate, profiles
from wallkit.calib.verify.free_lines import LineOffsets, floor_offsets, lines_gate, vertical_offsets
from wallkit.calib.verify.free_nid import NidFrame, nid_frame, nid_scores
from wallkit.calib.verify.gates import Gate
from wallkit.core.calibration import Calibration
from wallkit.core.types import Float64Array, UInt8Array
from wallkit.errors import CalibrationError
from wallkit.pipelines.calib.frames import LookFrame, frames_of

if TYPE_CHECKING:
    from wallkit.pipelines.calib.verify import VerifyRequest

FRAMES = 20
_LEAST_POINTS = 200
_NID_BASIS = "normalised information distance, 16 bins: the place of its minimum over +-1 deg and +-10 cm"


def free_gates(
    request: VerifyRequest, calibration: Calibration, progress: Callable[[int], None]
) -> tuple[tuple[Gate, ...], int, bool]:
    """The gates of the kind of LiDAR in the recording, how many frames were looked at, and whether it is planar.

    Raises:
        CalibrationError: the calibration has no transform, or no frame has an image and a scan of the same moment.
    """
    if calibration.T_camera_lidar is None:
        hint = "give --board to verify a camera alone, or make a transform with `wallkit calib extrinsics`"
        raise CalibrationError("holds no transform to verify", where=request.calibration, hint=hint)
    camera, T = calibration.camera, calibration.T_camera_lidar
    clouds: list[NidFrame] = []
    verticals: list[LineOffsets] = []
    floors: list[LineOffsets] = []
    count, is_planar = 0, False
    frames = frames_of(
        request.inputs, request.scans, count=FRAMES, scan_topic=request.scan_topic, image_topic=request.image_topic
    )
    for frame in frames:
        count += 1
        progress(count)
        grey = _grey(frame, calibration)
        if frame.is_planar:
            is_planar = True
            verticals.append(vertical_offsets(camera, T, grey, frame.points_m))
            if request.lidar_height_m is not None:
                floors.append(floor_offsets(camera, T, grey, frame.points_m, height_m=request.lidar_height_m))
        elif frame.intensities is not None:
            cloud = nid_frame(camera, T, grey, frame.points_m, frame.intensities)
            clouds += [cloud] if len(cloud.points_m) >= _LEAST_POINTS else []
    if not count:
        hint = "are images and scans stamped by the same clock?"
        raise CalibrationError("no image has a scan within 0.1 s", where=request.inputs[0], hint=hint)
    if is_planar:
        gates = [lines_gate("vertical edges of the room", verticals, camera, sees="yaw, left")]
        if floors:
            gates.append(lines_gate("floor line", floors, camera, sees="pitch, height"))
        return tuple(gates), count, True
    if not clouds:
        wanted, reason = "minimum at the calibration", "the clouds carry no intensity, or hardly meet the picture"
        return (Gate("NID", np.nan, "", wanted, "CANNOT TELL", reason),), count, False

    def score(place: Float64Array) -> Float64Array:
        return nid_scores(camera, place, clouds)

    return (profile_gate("NID", profiles(T, score, len(clouds)), basis=_NID_BASIS),), count, False


def _grey(frame: LookFrame, calibration: Calibration) -> UInt8Array:
    import cv2

    camera = calibration.camera
    if frame.pixels.shape[:2] != (camera.height, camera.width):
        sizes = f"{frame.pixels.shape[1]} x {frame.pixels.shape[0]} px"
        hint = "the intrinsics are of another camera or mode"
        raise CalibrationError(
            f"image {frame.name} has {sizes}, the calibration is for {camera.width} x {camera.height}", hint=hint
        )
    if frame.pixels.ndim == 2:
        return frame.pixels
    return np.asarray(cv2.cvtColor(np.ascontiguousarray(frame.pixels), cv2.COLOR_RGB2GRAY), dtype=np.uint8)
