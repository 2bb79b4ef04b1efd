"""LiDAR points and a calibration -> pixels, with what is behind the camera and what is beside the image marked."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from wallkit.core.calibration import Calibration
from wallkit.core.types import BoolArray, Float64Array
from wallkit.errors import CalibrationError


@dataclass(frozen=True, eq=False)
class Projection:
    """Where points land, in the order given.

    Attributes:
        pixels: (K, 2) float64 (u, v); NaN where the camera cannot see the point at all, however large the image.
        depths_m: (K,) float64 along the optical axis; not positive behind the camera.
        is_inside: (K,) the pixel is on the image.
    """

    pixels: Float64Array
    depths_m: Float64Array
    is_inside: BoolArray

    @property
    def is_behind(self) -> BoolArray:
        """(K,) the point is not in front of the camera."""
        return np.asarray(~(self.depths_m > 0))


def project(calibration: Calibration, points_m: ArrayLike, *, allow_unverified: bool = False) -> Projection:
    """Where points (K, 3) of the LiDAR frame [m] land in the image; points that are not finite land nowhere.

    Raises:
        CalibrationError: see `check_usable`.
    """
    T = check_usable(calibration, allow_unverified=allow_unverified)
    points = np.asarray(points_m, dtype=np.float64).reshape(-1, 3)
    seen = points @ T[:3, :3].T + T[:3, 3]
    pixels = calibration.camera.project(seen)
    depths = seen[:, 2]
    return Projection(pixels, depths, calibration.camera.is_inside(pixels))


def check_usable(calibration: Calibration, *, allow_unverified: bool = False) -> Float64Array:
    """(4, 4) T_camera_lidar of a calibration that may be used.

    Raises:
        CalibrationError: it has no transform, or its verdict is FAIL and `allow_unverified` is not given.
    """
    if calibration.T_camera_lidar is None:
        hint = "make one with `wallkit calib extrinsics` or `wallkit calib from-urdf`"
        raise CalibrationError("the calibration does not say where the LiDAR is to the camera", hint=hint)
    if calibration.verdict == "FAIL" and not allow_unverified:
        why = next((note for note in calibration.provenance.notes if note.startswith("verify: FAIL")), "")
        said = why.removeprefix("verify: FAIL: ") or "`wallkit calib verify` contradicts it"
        hint = "calibrate again, or pass --allow-unverified to use it all the same"
        raise CalibrationError(f"the calibration's verdict is FAIL ({said})", hint=hint)
    return calibration.T_camera_lidar
