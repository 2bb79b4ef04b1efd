"""A camera <-> ROS camera_info YAML and Kalibr camchain YAML; neither has a place for a LiDAR or a covariance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from wallkit.core.calibration import Calibration
from wallkit.core.camera import Camera
from wallkit.core.types import Float64Array
from wallkit.errors import CalibrationError

_KALIBR_MODELS = {"plumb_bob": "radtan", "equidistant": "equidistant"}


def read_yaml(text: str) -> dict[str, Any]:
    """The mapping a YAML document holds.

    Raises:
        CalibrationError: no YAML, or no mapping.
    """
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    try:
        document = YAML(typ="safe", pure=True).load(text)
    except YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = f"line {mark.line + 1}: " if mark else ""
        raise CalibrationError(f"{line}is no YAML: {getattr(error, 'problem', error)}") from error
    if not isinstance(document, dict):
        raise CalibrationError("is no calibration: a YAML mapping is expected")
    return document


# ----------------------------------------------------------------------------------------------- ROS camera_info


def ros_from_calibration(calibration: Calibration) -> str:
    """The camera as ROS's camera_calibration_parsers write it."""
    camera = calibration.camera
    projection = np.concatenate([camera.K, np.zeros((3, 1))], axis=1)
    lines = [
        f"image_width: {camera.width}",
        f"image_height: {camera.height}",
        f"camera_name: {camera.name or 'camera'}",
    ]
    lines += _matrix("camera_matrix", camera.K)
    lines.append(f"distortion_model: {camera.model}")
    lines += _matrix("distortion_coefficients", camera.D[None])
    lines += _matrix("rectification_matrix", np.eye(3))
    lines += _matrix("projection_matrix", projection)
    return "\n".join(lines) + "\n"


def ros_misses(calibration: Calibration) -> list[str]:
    """What of a calibration camera_info has no place for."""
    return [*_lidar_misses(calibration), *(["the camera's frame"] if calibration.camera.frame else [])]


def _matrix(name: str, matrix: Float64Array) -> list[str]:
    rows, columns = matrix.shape
    return [f"{name}:", f"  rows: {rows}", f"  cols: {columns}", f"  data: {matrix.ravel().tolist()}"]


def calibration_from_ros(document: Mapping[str, Any]) -> Calibration:
    """The camera of a camera_info file, or of a camera_info message written out (width, K, D; k, d in ROS 2).

    Raises:
        CalibrationError: a key is missing or its value cannot be.
    """
    width = _first(document, "image_width", "width")
    height = _first(document, "image_height", "height")
    K = _numbers(_first(document, "camera_matrix", "K", "k"), "camera_matrix")
    D = _numbers(_first(document, "distortion_coefficients", "D", "d"), "distortion_coefficients")
    if len(K) != 9:
        raise CalibrationError(f"camera_matrix has {len(K)} numbers, not 9")
    header = document.get("header")
    frame = header.get("frame_id", "") if isinstance(header, dict) else ""
    name = document.get("camera_name", "")
    model = document.get("distortion_model", "")
    return Calibration(Camera(str(model), _whole(width), _whole(height), K.reshape(3, 3), D, str(name), str(frame)))


def _first(document: Mapping[str, Any], *keys: str) -> Any:
    for key in keys:
        if key in document:
            return document[key]
    raise CalibrationError(
        f"lacks {keys[0]}", hint="a camera_info file has image_width, image_height, camera_matrix, ..."
    )


def _whole(value: Any) -> int:
    if not isinstance(value, int) or isinstance(value, bool):
        raise CalibrationError(f"an image size of {value!r} is no whole number")
    return value


def _numbers(value: Any, name: str) -> Float64Array:
    """(n,) numbers of a list or of {rows, cols, data}."""
    values = value.get("data") if isinstance(value, dict) else value
    if not isinstance(values, Sequence) or isinstance(values, str):
        raise CalibrationError(f"{name} holds no list of numbers")
    for number in values:
        if isinstance(number, (str, bool)) or not isinstance(number, (int, float)):
            raise CalibrationError(f"{name} holds {number!r}, which is no number")
    return np.array(values, dtype=np.float64)


# ----------------------------------------------------------------------------------------------- Kalibr camchain


def kalibr_from_calibration(calibration: Calibration) -> str:
    """The camera as the only one of a camchain.

    Raises:
        CalibrationError: Kalibr has no such model: only pinhole with radtan (k1 k2 p1 p2) or equidistant.
    """
    camera = calibration.camera
    if camera.model not in _KALIBR_MODELS:
        hint = "calibrate with --model plumb_bob or equidistant"
        raise CalibrationError(f"Kalibr has no {camera.model} model", hint=hint)
    D = camera.D
    if camera.model == "plumb_bob":
        if D[4] != 0:
            hint = "calibrate with --model radtan: k3 is then held at 0"
            raise CalibrationError(f"Kalibr's radtan has no k3, but it is {D[4]:g} here", hint=hint)
        D = D[:4]
    lines = [
        "cam0:",
        "  camera_model: pinhole",
        f"  intrinsics: {camera.parameters[:4].tolist()}",
        f"  distortion_model: {_KALIBR_MODELS[camera.model]}",
        f"  distortion_coeffs: {D.tolist()}",
        f"  resolution: [{camera.width}, {camera.height}]",
    ]
    if camera.name:
        lines.append(f"  rostopic: {camera.name}")
    return "\n".join(lines) + "\n"


def kalibr_misses(calibration: Calibration) -> list[str]:
    """What of a calibration a camchain has no place for."""
    return [*_lidar_misses(calibration), *(["the camera's frame"] if calibration.camera.frame else [])]


def calibration_from_kalibr(document: Mapping[str, Any]) -> Calibration:
    """The first camera of a camchain.

    Raises:
        CalibrationError: a key is missing, or a camera or distortion model that is not supported.
    """
    name = sorted(key for key, value in document.items() if isinstance(value, dict) and "intrinsics" in value)[0]
    stored = document[name]
    model = stored.get("camera_model", "pinhole")
    if model != "pinhole":
        raise CalibrationError(f"camera_model '{model}' is not supported", where=name, hint="only pinhole is")
    fx, fy, cx, cy = _four(stored.get("intrinsics"), "intrinsics", name)
    width, height = (_whole(v) for v in _pair(stored.get("resolution"), name))
    K = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    D = _numbers(stored.get("distortion_coeffs"), f"{name} distortion_coeffs")
    lens = {kalibr: own for own, kalibr in _KALIBR_MODELS.items()}.get(
        stored.get("distortion_model", ""), stored.get("distortion_model", "")
    )
    return Calibration(Camera(str(lens), width, height, K, D, str(stored.get("rostopic", ""))))


def _four(value: Any, key: str, name: str) -> list[float]:
    numbers = _numbers(value, f"{name} {key}")
    if len(numbers) != 4:
        raise CalibrationError(f"{key} has {len(numbers)} numbers, not fx, fy, cx, cy", where=name)
    return list(numbers.tolist())


def _pair(value: Any, name: str) -> list[Any]:
    if not isinstance(value, list) or len(value) != 2:
        raise CalibrationError(f"resolution = {value!r} is not [width, height]", where=name)
    return value


def _lidar_misses(calibration: Calibration) -> list[str]:
    missed = [] if calibration.T_camera_lidar is None else ["T_camera_lidar"]
    if calibration.covariance is not None or calibration.camera_covariance is not None:
        missed.append("the covariance")
    if calibration.verdict:
        missed.append("the verdict")
    return missed
