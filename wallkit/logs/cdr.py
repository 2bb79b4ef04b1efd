"""Bytes of the messages that fill a log (LaserScan, Odometry, TFMessage in CDR) -> core types, without an object between.

`rosbags` decodes every message there is and is the oracle of the tests; these three are read by hand because they are
what a localization run decodes tens of thousands of. Anything unexpected raises ValueError or struct.error, and the
caller then asks rosbags.
"""

from __future__ import annotations

import math
import struct
from functools import lru_cache

import numpy as np

from wallkit.core.geometry import matrix_from_quaternion
from wallkit.core.types import Float32Array, Float64Array, Odometry, Scan, Transform

_TIME = struct.Struct("<iI")
_LENGTH = struct.Struct("<I")
_POSE = struct.Struct("<7d")
_SCAN = struct.Struct("<7f")
_LITTLE_ENDIAN = b"\x00\x01"
ENCAPSULATION_BYTES = 4
# pose covariance, twist with covariance
_ODOMETRY_TAIL_BYTES = 8 * (36 + 6 + 36)


def odometry_from_cdr(data: bytes) -> Odometry:
    """nav_msgs/Odometry as a planar pose."""
    stamp_ns, frame_id, position = _header(data, ENCAPSULATION_BYTES)
    child_frame_id, position = _text(data, position)
    position = _aligned(position, 8)
    x, y, _, qx, qy, qz, qw = _POSE.unpack_from(data, position)
    _check_end(data, position + _POSE.size + _ODOMETRY_TAIL_BYTES)
    pose = planar_pose(x, y, qx, qy, qz, qw)
    return Odometry(stamp_ns, pose, frame_name(frame_id), frame_name(child_frame_id))


def scan_from_cdr(data: bytes) -> Scan:
    """sensor_msgs/LaserScan."""
    stamp_ns, frame_id, position = _header(data, ENCAPSULATION_BYTES)
    position = _aligned(position, 4)
    angle_min, _, increment, interval, _, range_min, range_max = _SCAN.unpack_from(data, position)
    position += _SCAN.size
    (count,) = _LENGTH.unpack_from(data, position)
    position += 4
    ranges = np.frombuffer(data, "<f4", count, position)
    position += 4 * count
    (intensities,) = _LENGTH.unpack_from(data, position)
    _check_end(data, position + 4 + 4 * intensities)
    angles = beam_angles(angle_min, increment, count)
    return Scan(stamp_ns, frame_name(frame_id), ranges, angles, interval, range_min, range_max)


def transforms_from_cdr(data: bytes, *, is_static: bool) -> tuple[Transform, ...]:
    """tf2_msgs/TFMessage."""
    if data[:2] != _LITTLE_ENDIAN:
        raise ValueError("not little-endian CDR")
    (count,) = _LENGTH.unpack_from(data, ENCAPSULATION_BYTES)
    position = ENCAPSULATION_BYTES + 4
    transforms = []
    for _ in range(count):
        stamp_ns, parent, position = _header(data, _aligned(position, 4))
        child, position = _text(data, position)
        position = _aligned(position, 8)
        numbers = _POSE.unpack_from(data, position)
        position += _POSE.size
        matrix = matrix_from_quaternion(numbers[:3], numbers[3:])
        transforms.append(Transform(stamp_ns, frame_name(parent), frame_name(child), matrix, is_static))
    _check_end(data, position)
    return tuple(transforms)


def frame_name(name: str) -> str:
    """A frame's name without the leading slashes that ROS 1 allowed."""
    return name.lstrip("/")


@lru_cache(maxsize=16)
def beam_angles(angle_min_rad: float, increment_rad: float, count: int) -> Float32Array:
    """(K,) float32 bearings angle_min + k * increment, read-only; the increment may be negative.

    As in ROS the stated increment counts, not angle_max: drivers are often one beam off there. What cannot be true is
    refused: beams that do not move, or that go round more than once.

    Raises:
        ValueError: the angles are not finite, or count and increment contradict each other.
    """
    if not (math.isfinite(angle_min_rad) and math.isfinite(increment_rad)):
        raise ValueError(f"scan angles are not finite: {angle_min_rad}, increment {increment_rad}")
    if count > 1 and (increment_rad == 0 or abs(increment_rad) * (count - 1) > 2 * math.pi + 1e-3):
        raise ValueError(f"{count} ranges do not fit an angle increment of {increment_rad:.6g} rad")
    angles = (angle_min_rad + increment_rad * np.arange(count)).astype(np.float32)
    angles.setflags(write=False)
    return angles


def planar_pose(x_m: float, y_m: float, qx: float, qy: float, qz: float, qw: float) -> Float64Array:
    """(3,) x [m], y [m], heading [rad] of a position and a quaternion, which need not have unit length.

    Raises:
        ValueError: a number is not finite, or the quaternion is zero.
    """
    norm = qx * qx + qy * qy + qz * qz + qw * qw
    if not (1e-18 < norm < math.inf and math.isfinite(x_m) and math.isfinite(y_m)):
        raise ValueError(f"not a pose: position {[x_m, y_m]}, quaternion {[qx, qy, qz, qw]}")
    # the numerator and denominator of the unit quaternion's heading, both times the squared norm
    return np.array((x_m, y_m, math.atan2(2 * (qw * qz + qx * qy), qw * qw + qx * qx - qy * qy - qz * qz)))


def _header(data: bytes, position: int) -> tuple[int, str, int]:
    """Stamp [ns], frame and the position behind a std_msgs/Header."""
    if data[:2] != _LITTLE_ENDIAN:
        raise ValueError("not little-endian CDR")
    seconds, nanoseconds = _TIME.unpack_from(data, position)
    frame_id, position = _text(data, position + _TIME.size)
    return seconds * 1_000_000_000 + nanoseconds, frame_id, position


def _text(data: bytes, position: int) -> tuple[str, int]:
    position = _aligned(position, 4)
    (length,) = _LENGTH.unpack_from(data, position)
    stop = position + 4 + length
    if stop > len(data):
        raise ValueError("a text is longer than its message")
    return data[position + 4 : stop - 1].decode(), stop


def _aligned(position: int, size: int) -> int:
    """The next multiple of size, counted from behind the encapsulation header."""
    return position + (ENCAPSULATION_BYTES - position) % size


def _check_end(data: bytes, position: int) -> None:
    # some middlewares pad to the next 4 or 8 bytes
    if not 0 <= len(data) - position <= 7:
        raise ValueError(f"the message has {len(data)} bytes where its type needs {position}")
