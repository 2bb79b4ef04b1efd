"""What calibration hands to everybody else: the camera, where it is to the LiDAR, and how far either may be trusted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from wallkit.core.camera import Camera
from wallkit.core.types import Float64Array
from wallkit.errors import CalibrationError

Verdict = Literal["PASS", "FAIL", "CANNOT TELL", ""]
VERDICTS: tuple[str, ...] = ("PASS", "FAIL", "CANNOT TELL", "")
COVARIANCE_ORDER = ("w_x", "w_y", "w_z", "t_x", "t_y", "t_z")


@dataclass(frozen=True, slots=True)
class Provenance:
    """What a calibration was made from.

    Attributes:
        inputs: file name -> sha256, hexadecimal.
        versions: program -> version.
        command: as typed. notes: what a reader should know, one sentence each.
    """

    inputs: Mapping[str, str] = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=dict)
    command: str = ""
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Calibration:
    """A camera and its place relative to a LiDAR, with their uncertainty and the verdict; arrays are read-only.

    Attributes:
        camera: intrinsics. Its `frame` is the optical frame.
        T_camera_lidar: (4, 4) float64, p_camera = T_camera_lidar p_lidar [m]; None of a camera alone.
        lidar_frame: name of the LiDAR's frame.
        covariance: (6, 6) of T_camera_lidar in the order (w_x w_y w_z t_x t_y t_z) [rad, m], a perturbation from the
            left in the camera frame: R <- Exp(w) R, t <- t + dt. None when not known.
        degrees: of freedom of that covariance, of the axis that has fewest; inf where nobody counted them.
        elevations: (2,) [rad] lowest and highest beam of the LiDAR above its xy plane, 0 0 of a planar one; None when not
            known.
        camera_covariance: (4 + n, 4 + n) of `camera.parameters`, clustered by view; None when not known.
        time_offset_ns: t_camera = t_lidar + offset. time_offset_sigma_ns: None when it was not estimated.
        verdict: of `wallkit calib verify`; empty as long as nobody verified it.
        pixel_error_95: (R, 2) range [m] ascending and the error [px] that 95 % of the LiDAR points at that range stay
            below; None when not known.
        provenance: inputs, versions, command.

    Raises:
        CalibrationError: what is wrong, with the value.
    """

    camera: Camera
    T_camera_lidar: Float64Array | None = None
    lidar_frame: str = ""
    covariance: Float64Array | None = None
    degrees: float = np.inf
    elevations: Float64Array | None = None
    camera_covariance: Float64Array | None = None
    time_offset_ns: int = 0
    time_offset_sigma_ns: float | None = None
    verdict: Verdict = ""
    pixel_error_95: Float64Array | None = None
    provenance: Provenance = field(default_factory=Provenance)

    def __post_init__(self) -> None:
        if self.verdict not in VERDICTS:
            hint = f"one of: {', '.join(v for v in VERDICTS if v)}, or empty while unverified"
            raise CalibrationError(f"verdict '{self.verdict}' is not known", hint=hint)
        for name, size in (("covariance", 6), ("camera_covariance", len(self.camera.parameters))):
            object.__setattr__(self, name, _checked_covariance(getattr(self, name), size, name))
        object.__setattr__(self, "T_camera_lidar", _checked_transform(self.T_camera_lidar))
        object.__setattr__(self, "pixel_error_95", _checked_table(self.pixel_error_95))
        object.__setattr__(self, "elevations", _checked_elevations(self.elevations))
        if not self.degrees > 0:
            raise CalibrationError(f"degrees of freedom of the covariance are not positive: {self.degrees!r}")

    @property
    def camera_frame(self) -> str:
        """Name of the camera's optical frame."""
        return self.camera.frame

    def pixel_error_95_at(self, range_m: ArrayLike) -> Float64Array:
        """(...,) 95 % pixel error of a LiDAR point at a range [m] (...,); NaN when it is not known.

        The error is sqrt(a^2 + (b / r)^2), convex in 1/r, so everything here is at or above it: linear in 1/r between
        the ranges of the table, growing with 1/r below the nearest, and constant beyond the farthest.
        """
        ranges = np.asarray(range_m, dtype=np.float64)
        if self.pixel_error_95 is None:
            return np.full(ranges.shape, np.nan)
        known, errors = self.pixel_error_95.T
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse = 1 / np.where(ranges > 0, ranges, np.nan)
            between = np.interp(inverse, 1 / known[::-1], errors[::-1])
            return np.asarray(np.where(ranges < known[0], errors[0] * known[0] * inverse, between))


def _checked_transform(given: ArrayLike | None) -> Float64Array | None:
    if given is None:
        return None
    T = np.array(given, dtype=np.float64)
    if T.shape != (4, 4) or not np.isfinite(T).all():
        raise CalibrationError(f"T_camera_lidar is not a finite 4 x 4 matrix: {T.tolist()}")
    R = T[:3, :3]
    if np.abs(R @ R.T - np.eye(3)).max() > 1e-6 or np.linalg.det(R) < 0 or (T[3] != (0, 0, 0, 1)).any():
        hint = "its upper left 3 x 3 block must be a rotation, its last row 0 0 0 1"
        raise CalibrationError("T_camera_lidar is no rigid transform", hint=hint)
    T.flags.writeable = False
    return T


def _checked_covariance(given: ArrayLike | None, size: int, name: str) -> Float64Array | None:
    if given is None:
        return None
    C = np.array(given, dtype=np.float64)
    if C.shape != (size, size) or not np.isfinite(C).all():
        raise CalibrationError(f"{name} is not a finite {size} x {size} matrix, but {C.shape}")
    scale = np.sqrt(np.outer(np.abs(np.diag(C)), np.abs(np.diag(C)))) + 1e-300
    if (np.diag(C) < 0).any() or (np.abs(C - C.T) > 1e-6 * scale).any():
        raise CalibrationError(f"{name} is not symmetric with a positive diagonal")
    C.flags.writeable = False
    return C


def _checked_elevations(given: ArrayLike | None) -> Float64Array | None:
    if given is None:
        return None
    pair = np.array(given, dtype=np.float64)
    if pair.shape != (2,) or not -np.pi / 2 <= pair[0] <= pair[1] <= np.pi / 2:
        raise CalibrationError(f"elevations are not the lowest and the highest beam [rad]: {pair.tolist()}")
    pair.flags.writeable = False
    return pair


def _checked_table(given: ArrayLike | None) -> Float64Array | None:
    if given is None:
        return None
    table = np.array(given, dtype=np.float64)
    if table.ndim != 2 or table.shape[1] != 2 or not len(table) or not np.isfinite(table).all():
        raise CalibrationError(f"pixel_error_95 is not a table of (range [m], error [px]): {table.tolist()}")
    if (table <= 0).any() or (np.diff(table[:, 0]) <= 0).any():
        raise CalibrationError(f"pixel_error_95 needs positive, ascending ranges: {table[:, 0].tolist()}")
    table.flags.writeable = False
    return table
