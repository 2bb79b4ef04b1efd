"""A calibration -> the `<origin>` of one joint of a robot's URDF, without touching another byte of the file."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from xml.parsers import expat

import numpy as np

from wallkit.calib.extrinsics.rigid import matrix_from_rpy, rpy_from_matrix
from wallkit.core.types import Float64Array
from wallkit.errors import CalibrationError, closest

_ATTRIBUTE = rb"""(?<=\s)%s\s*=\s*("[^"]*"|'[^']*')"""


@dataclass(frozen=True)
class JointBytes:
    """One joint of a file: names, and the byte ranges of its start tag and of its <origin> tag (None without one)."""

    name: str
    parent: str
    child: str
    tag: tuple[int, int]
    origin: tuple[int, int] | None
    xyz: tuple[float, ...]
    rpy: tuple[float, ...]

    @property
    def matrix(self) -> Float64Array:
        """(4, 4) T_parent_child as written."""
        return matrix_from_rpy(self.xyz, self.rpy)


def with_calibration(
    data: bytes, T_camera_lidar: Float64Array, lidar: str, camera: str, *, joint: str = "", source: str | Path = "robot"
) -> tuple[bytes, JointBytes]:
    """The file with one joint moved so that the robot agrees with the calibration, and that joint as it was before.

    T_parent_child = T_parent_camera T_camera_lidar T_child_lidar^-1. Numbers have six decimals (1 um, 0.00006 deg).

    Args:
        joint: that is to move; else the one that holds the LiDAR. It must lie on the LiDAR's side of the robot only.

    Raises:
        CalibrationError: no such link or joint, or one that moves the camera too, or not the LiDAR.
    """
    joints = joints_of(data, source)
    by_name, above = {j.name: j for j in joints}, {j.child: j for j in joints}
    links = {j.child for j in joints} | {j.parent for j in joints}
    for role, name in (("LiDAR", lidar), ("camera", camera)):
        if name not in links:
            raise CalibrationError(f"there is no link '{name}' for the {role}", where=source, hint=closest(name, links))
    ways = {name: _to_root(above, name) for name in (lidar, camera)}
    if not joint and not ways[lidar]:
        raise CalibrationError(
            f"'{lidar}' is the root of the robot", where=source, hint="name the joint that is to move"
        )
    name = joint or ways[lidar][0].name
    if name not in by_name:
        raise CalibrationError(f"there is no joint '{name}'", where=source, hint=closest(name, by_name))
    moved = by_name[name]
    if moved not in ways[lidar] or moved in ways[camera]:
        good = [j.name for j in ways[lidar] if j not in ways[camera]]
        message = f"joint '{name}' does not move the LiDAR alone"
        raise CalibrationError(message, where=source, hint=f"one of: {', '.join(good)}" if good else "")
    root_camera, root_parent = _place(ways[camera]), _place(_to_root(above, moved.parent))
    below = ways[lidar][: ways[lidar].index(moved)]
    T = np.linalg.inv(root_parent) @ root_camera @ T_camera_lidar @ np.linalg.inv(_place(below))
    return _edited(data, moved, T), moved


def joints_of(data: bytes, source: str | Path = "robot") -> list[JointBytes]:
    """The joints of a URDF with their byte ranges.

    Raises:
        CalibrationError: it is not XML, or an origin is no six numbers.
    """
    found: list[JointBytes] = []
    open_: list[str] = []
    now: dict[str, object] = {}
    parser = expat.ParserCreate()

    def start(name: str, attributes: dict[str, str]) -> None:
        open_.append(name)
        at = parser.CurrentByteIndex
        span = (at, _tag_end(data, at))
        if open_[:2] == ["robot", "joint"] and len(open_) == 2:
            now.clear()
            now.update(name=attributes.get("name", ""), tag=span, origin=None, xyz=(0.0,) * 3, rpy=(0.0,) * 3)
        elif open_[:2] == ["robot", "joint"] and len(open_) == 3:
            if name == "origin":
                where = f"{source}:{parser.CurrentLineNumber}"
                now.update(origin=span, **{key: _three(attributes.get(key, "0 0 0"), where) for key in ("xyz", "rpy")})
            elif name in ("parent", "child"):
                now[name] = attributes.get("link", "")

    def end(_name: str) -> None:
        open_.pop()
        if len(open_) == 1 and now:
            if "parent" in now and "child" in now:
                found.append(JointBytes(**now))  # type: ignore[arg-type]
            now.clear()

    parser.StartElementHandler, parser.EndElementHandler = start, end
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        raise CalibrationError(f"is no XML: {error}", where=source) from error
    return found


# ------------------------------------------------------------------------------------------------ details


def _edited(data: bytes, joint: JointBytes, T: Float64Array) -> bytes:
    values = {b"xyz": _numbers(T[:3, 3]), b"rpy": _numbers(rpy_from_matrix(T))}
    if joint.origin is None:
        begin, end = joint.tag
        line = data.rfind(b"\n", 0, begin) + 1
        indent = data[line:begin] if not data[line:begin].strip() else b""
        newline = b"\r\n" if data[line - 2 : line] == b"\r\n" else b"\n"
        tag = b'<origin xyz="' + values[b"xyz"] + b'" rpy="' + values[b"rpy"] + b'"/>'
        return data[:end] + newline + indent + b"  " + tag + data[end:]
    begin, end = joint.origin
    tag = data[begin:end]
    for key, value in values.items():
        written = re.search(_ATTRIBUTE % key, tag)
        if written:
            first, last = written.span(1)
            tag = tag[: first + 1] + value + tag[last - 1 :]
        else:
            tag = tag[: len(b"<origin")] + b" " + key + b'="' + value + b'"' + tag[len(b"<origin") :]
    return data[:begin] + tag + data[end:]


def _numbers(values: Float64Array) -> bytes:
    return " ".join(f"{value + 0.0:.6f}".replace("-0.000000", "0.000000") for value in values).encode()


def _to_root(above: dict[str, JointBytes], link: str) -> list[JointBytes]:
    joints: list[JointBytes] = []
    while link in above and above[link] not in joints:
        joints.append(above[link])
        link = above[link].parent
    return joints


def _place(joints: list[JointBytes]) -> Float64Array:
    """(4, 4) of the last link of a way to the root, in the frame the way ends in; movable joints at zero."""
    T = np.eye(4)
    for joint in joints:
        T = joint.matrix @ T
    return T


def _tag_end(data: bytes, begin: int) -> int:
    """One past the > of a start tag; quotes may hold one."""
    quote = 0
    for at in range(begin, len(data)):
        byte = data[at]
        if quote:
            quote = 0 if byte == quote else quote
        elif byte in (0x22, 0x27):
            quote = byte
        elif byte == 0x3E:
            return at + 1
    return len(data)


def _three(words: str, where: str) -> tuple[float, ...]:
    try:
        values = tuple(float(word) for word in words.split())
    except ValueError:
        values = ()
    if len(values) != 3 or not np.isfinite(values).all():
        raise CalibrationError(f"'{words}' is not three numbers", where=where, hint="expand a xacro file first")
    return values
