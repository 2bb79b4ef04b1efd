"""A calibration <-> wallkit's own TOML, which holds all of it; and whatever other file a calibration comes in."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wallkit.calib.files.store_yaml import (
    calibration_from_kalibr,
    calibration_from_ros,
    kalibr_from_calibration,
    kalibr_misses,
    read_yaml,
    ros_from_calibration,
    ros_misses,
)
from wallkit.core.calibration import COVARIANCE_ORDER, Calibration, Provenance
from wallkit.core.camera import Camera
from wallkit.errors import CalibrationError, closest

SCHEMA = 2
# 1 had no degrees of freedom and no elevations
READABLE = (1, 2)


@dataclass(frozen=True, slots=True)
class Format:
    """A file format of calibrations.

    Attributes:
        suffix: its usual one. text: the calibration in this format. misses: what of a calibration has no place in it.
    """

    suffix: str
    text: Callable[[Calibration], str]
    misses: Callable[[Calibration], list[str]]


def read_calibration(path: Path) -> Calibration:
    """The calibration in a file: wallkit's TOML, a ROS camera_info YAML, or a Kalibr camchain YAML.

    Raises:
        CalibrationError: it cannot be read, is none of these, or what it says cannot be.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise CalibrationError(f"cannot be read: {error.strerror}", where=path) from error
    except UnicodeDecodeError as error:
        raise CalibrationError("is no text file", where=path) from error
    try:
        return _toml(text) if path.suffix == ".toml" else _yaml(text)
    except CalibrationError as error:
        place = f"{path}: {error.where}" if error.where else path
        raise CalibrationError(error.message, where=place, hint=error.hint) from error


def _yaml(text: str) -> Calibration:
    document = read_yaml(text)
    if any(isinstance(value, dict) and "intrinsics" in value for value in document.values()):
        return calibration_from_kalibr(document)
    return calibration_from_ros(document)


# --------------------------------------------------------------------------------------------------------- own TOML


def toml_from_calibration(calibration: Calibration) -> str:
    """The whole calibration as TOML; reading it gives every number back to the last bit."""
    camera, lines = (
        calibration.camera,
        [f"schema = {SCHEMA}", f"verdict = {_text(calibration.verdict)}", "", "[camera]"],
    )
    lines += [f"name = {_text(camera.name)}", f"frame = {_text(camera.frame)}", f"model = {_text(camera.model)}"]
    lines += [f"width = {camera.width}", f"height = {camera.height}"]
    values = camera.parameters[:4].tolist()
    lines += [f"{name} = {value!r}" for name, value in zip(("fx", "fy", "cx", "cy"), values, strict=True)]
    lines += [f"# {', '.join(camera.lens.coefficients)}", f"D = {camera.D.tolist()}"]
    if calibration.camera_covariance is not None:
        lines += [f"# of {', '.join(camera.parameter_names)}; clustered by view", "covariance = ["]
        lines += [*_rows(calibration.camera_covariance), "]"]
    if calibration.T_camera_lidar is not None:
        lines += ["", "[lidar]", f"frame = {_text(calibration.lidar_frame)}"]
        lines += [
            "# p_camera = T_camera_lidar p_lidar [m]",
            "T_camera_lidar = [",
            *_rows(calibration.T_camera_lidar),
            "]",
        ]
        if calibration.covariance is not None:
            order = ", ".join(COVARIANCE_ORDER)
            lines += [f"# of {order} [rad, m], a perturbation from the left in the camera frame"]
            lines += ["covariance = [", *_rows(calibration.covariance), "]"]
            lines += ["# of freedom of the covariance: its intervals are Student's t"]
            lines += [f"degrees_of_freedom = {float(calibration.degrees)!r}"]
        if calibration.elevations is not None:
            lines += ["# lowest and highest beam above the LiDAR's xy plane"]
            lines += [f"elevations_rad = {calibration.elevations.tolist()}"]
        lines += ["# t_camera = t_lidar + offset", f"time_offset_ns = {calibration.time_offset_ns}"]
        if calibration.time_offset_sigma_ns is not None:
            lines.append(f"time_offset_sigma_ns = {calibration.time_offset_sigma_ns!r}")
        if calibration.pixel_error_95 is not None:
            lines += ["# range [m], and the error [px] that 95 % of the LiDAR points stay below"]
            lines += ["pixel_error_95 = [", *_rows(calibration.pixel_error_95), "]"]
    made = calibration.provenance
    lines += ["", "[provenance]", f"command = {_text(made.command)}", "notes = ["]
    lines += [*(f"  {_text(note)}," for note in made.notes), "]", "", "[provenance.versions]"]
    lines += [f"{_text(name)} = {_text(version)}" for name, version in sorted(made.versions.items())]
    lines += ["", "# sha256", "[provenance.inputs]"]
    lines += [f"{_text(name)} = {_text(digest)}" for name, digest in sorted(made.inputs.items())]
    return "\n".join(lines) + "\n"


def _rows(matrix: Any) -> list[str]:
    return [f"  {row}," for row in np.asarray(matrix).tolist()]


def _text(value: str) -> str:
    """A TOML basic string."""
    escaped = value.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c.isprintable() else f"\\u{ord(c):04x}" for c in escaped) + '"'


def _toml(text: str) -> Calibration:
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise CalibrationError(f"is no TOML: {error}") from error
    if "camera" not in document:
        raise CalibrationError("has no [camera] table: it is no calibration")
    if document.get("schema", SCHEMA) not in READABLE:
        hint = "it was written by another version of wallkit"
        known = " and ".join(map(str, READABLE))
        raise CalibrationError(f"schema = {document['schema']!r} is not known (these are: {known})", hint=hint)
    stored, lidar, made = document["camera"], document.get("lidar", {}), document.get("provenance", {})
    needed = ("model", "width", "height", "fx", "fy", "cx", "cy", "D")
    missing = [key for key in needed if key not in stored]
    if missing:
        raise CalibrationError(f"[camera] lacks {', '.join(missing)}", hint=f"it needs: {', '.join(needed)}")
    fx, fy, cx, cy = (stored[key] for key in ("fx", "fy", "cx", "cy"))
    try:
        camera = Camera(
            stored["model"],
            stored["width"],
            stored["height"],
            np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]], dtype=np.float64),
            np.array(stored["D"], dtype=np.float64),
            stored.get("name", ""),
            stored.get("frame", ""),
        )
        return Calibration(
            camera,
            T_camera_lidar=lidar.get("T_camera_lidar"),
            lidar_frame=lidar.get("frame", ""),
            covariance=lidar.get("covariance"),
            degrees=float(lidar.get("degrees_of_freedom", np.inf)),
            elevations=lidar.get("elevations_rad"),
            camera_covariance=stored.get("covariance"),
            time_offset_ns=lidar.get("time_offset_ns", 0),
            time_offset_sigma_ns=lidar.get("time_offset_sigma_ns"),
            verdict=document.get("verdict", ""),
            pixel_error_95=lidar.get("pixel_error_95"),
            provenance=_provenance(made),
        )
    except (TypeError, ValueError) as error:
        raise CalibrationError(f"a value has the wrong type: {error}") from error


def _provenance(made: Mapping[str, Any]) -> Provenance:
    inputs, versions, notes = made.get("inputs", {}), made.get("versions", {}), made.get("notes", ())
    return Provenance(dict(inputs), dict(versions), str(made.get("command", "")), tuple(notes))


def text_from_calibration(calibration: Calibration, format_name: str) -> str:
    """The calibration in a format of FORMATS.

    Raises:
        CalibrationError: no such format, or the camera's model does not exist in it.
    """
    if format_name not in FORMATS:
        raise CalibrationError(f"format '{format_name}' is not known", hint=closest(format_name, FORMATS))
    return FORMATS[format_name].text(calibration)


FORMATS: Mapping[str, Format] = {
    "toml": Format(".toml", toml_from_calibration, lambda calibration: []),
    "ros": Format(".yaml", ros_from_calibration, ros_misses),
    "kalibr": Format(".yaml", kalibr_from_calibration, kalibr_misses),
}
