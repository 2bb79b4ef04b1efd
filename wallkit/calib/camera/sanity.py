"""A camera_info as published -> what cannot be true about it, a sentence each."""

from __future__ import annotations

import numpy as np

from wallkit.core.camera import Camera, camera_from_info
from wallkit.core.types import CameraInfo
from wallkit.errors import CalibrationError

_FOCAL_SHARE = 0.01


def faults_of_info(info: CameraInfo, width: int, height: int) -> tuple[str, ...]:
    """What is wrong with a camera_info for images of this size; empty when nothing is.

    A rectified image whose camera_info still has the raw K and D, an R that is no rotation, and a P that belongs to another
    K are the ones seen in the wild (image_pipeline #682).
    """
    faults = []
    if (info.width, info.height) != (width, height):
        faults.append(f"camera_info is for {info.width} x {info.height} px, the images have {width} x {height}")
    try:
        camera = camera_from_info(info)
    except CalibrationError as error:
        return (*faults, error.message)
    R, P = np.asarray(info.r, dtype=np.float64).reshape(3, 3), np.asarray(info.p, dtype=np.float64).reshape(3, 4)
    if not np.isfinite(R).all() or not np.isfinite(P).all():
        return (*faults, "R or P of camera_info holds numbers that are not finite")
    if np.abs(R @ R.T - np.eye(3)).max() > 1e-3 or np.linalg.det(R) < 0:
        faults.append("R of camera_info is no rotation")
    if P[0, 0] <= 0 or P[1, 1] <= 0 or np.abs(P[2] - (0, 0, 1, 0)).max() > 1e-9:
        faults.append("P of camera_info has no focal length, or a wrong last row")
    elif not info.d.any() and np.abs(R - np.eye(3)).max() < 1e-9:
        off = np.abs(P[[0, 1], [0, 1]] / info.k[[0, 1], [0, 1]] - 1).max()
        if off > _FOCAL_SHARE:
            faults.append(f"P and K of camera_info differ by {off:.0%}, though nothing is distorted or turned")
    return (*faults, *_centre_fault(camera))


def differs(info: CameraInfo, camera: Camera) -> str:
    """A sentence where the camera_info is not that of the calibration; empty where it is."""
    mine, other = camera.parameters[:4], np.asarray(info.k, dtype=np.float64)[[0, 1, 0, 1], [0, 1, 2, 2]]
    if np.isfinite(other).all() and np.abs(mine - other).max() < 0.5:
        return ""
    return (
        f"the log's camera_info is not the calibration's: fx {other[0]:.1f} against {mine[0]:.1f} px;"
        " the calibration's is used"
    )


def _centre_fault(camera: Camera) -> tuple[str, ...]:
    cx, cy = camera.K[0, 2], camera.K[1, 2]
    if 0 < cx < camera.width and 0 < cy < camera.height:
        return ()
    return (f"the principal point ({cx:.0f}, {cy:.0f}) lies outside the image of {camera.width} x {camera.height} px",)
