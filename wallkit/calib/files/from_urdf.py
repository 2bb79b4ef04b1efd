"""A robot's URDF -> where the LiDAR is to the camera, with the mistakes that such files come with."""

from __future__ import annotations

import io
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wallkit.core.types import Float64Array
from wallkit.errors import CalibrationError, closest

_LEFTOVER = re.compile(r"\$[{(][^})]*[})]|<xacro:[\w]+")
_UP = np.array([0.0, 0.0, 1.0])
_MOSTLY = 0.7


@dataclass(frozen=True, eq=False)
class UrdfTransform:
    """T_camera_lidar (4, 4) of a robot at rest.

    Attributes:
        lidar, camera: links. chain: joints between them, from the camera's side.
        warnings: a sentence each.
    """

    T: Float64Array
    lidar: str
    camera: str
    chain: tuple[str, ...]
    warnings: tuple[str, ...]


def transform_from_urdf(
    path: Path, lidar: str, camera: str, *, any_axis: bool = False, arguments: Mapping[str, str] | None = None
) -> UrdfTransform:
    """T_camera_lidar as the robot's description has it: p_camera = T p_lidar.

    Args:
        camera: the optical frame (x right, y down, z forward). any_axis: take it even when its z axis points up.
        arguments: values of xacro arguments that were left in the file as ${name}.

    Raises:
        CalibrationError: the file is no URDF, lacks a link, or the camera frame is not optical.
    """
    text = read_urdf(path, arguments)
    robot = _loaded(text, path)
    links = list(robot.link_map)
    left = leftovers(text)
    for role, name in (("lidar", lidar), ("camera", camera)):
        if name not in links:
            hint = f"{closest(name, links)}"
            if left:
                hint += f"; {left[0]}"
            raise CalibrationError(f"there is no link '{name}' for --{role}", where=path, hint=hint)
    # yourdfpy names the frames the other way round: this maps points of the LiDAR into the camera
    T = np.asarray(robot.get_transform(frame_to=lidar, frame_from=camera), dtype=np.float64)
    chain, moving = _chain(robot, lidar, camera)
    warnings = [*left]
    if moving:
        warnings.append(f"joint {', '.join(moving)} between them can move; its zero position was taken")
    axes = np.asarray(robot.get_transform(frame_to=camera, frame_from=robot.base_link), dtype=np.float64)[:3, :3]
    warnings += _axis_findings(path, camera, axes, links, any_axis=any_axis)
    warnings += _direction_findings(T, lidar)
    return UrdfTransform(T, lidar, camera, tuple(chain), tuple(warnings))


def read_urdf(path: Path, arguments: Mapping[str, str] | None = None) -> str:
    """The text of a URDF, ${name} and $(arg name) replaced where a value is given.

    Raises:
        CalibrationError: it cannot be read.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise CalibrationError(f"cannot be read: {error}", where=path) from error
    for name, value in (arguments or {}).items():
        text = text.replace("${" + name + "}", value).replace(f"$(arg {name})", value)
    return text


def leftovers(text: str) -> list[str]:
    """One sentence about xacro that nobody expanded; empty when there is none."""
    found = [(text.count("\n", 0, m.start()) + 1, m[0]) for m in _LEFTOVER.finditer(text)]
    if not found:
        return []
    kinds = sorted({word for _, word in found})
    name = re.fullmatch(r"\$[{(](?:arg )?(\w+)[})]", kinds[0])
    how = f"give --arg {name[1]}=VALUE, or expand it" if name else "expand it"
    where = f"{len(found)} pieces of xacro were never expanded ({', '.join(kinds[:3])}, first in line {found[0][0]})"
    return [f"{where}: {how} with `xacro robot.urdf.xacro > robot.urdf`"]


def place_words(T: Float64Array) -> str:
    """Where the LiDAR is, seen from the camera, in words; and where it looks."""
    x, y, z = T[:3, 3]
    parts = [
        f"{abs(value) * 1e3:.1f} mm {positive if value >= 0 else negative}"
        for value, positive, negative in ((x, "right", "left"), (y, "below", "above"), (z, "before", "behind"))
    ]
    names = ("right", "down", "forward"), ("left", "up", "backward")
    looks = []
    for axis, label in ((0, "x"), (2, "z")):
        strongest = int(np.abs(T[:3, axis]).argmax())
        looks.append(f"{label} axis points {names[int(T[strongest, axis] < 0)][strongest]}")
    return f"the LiDAR is {', '.join(parts)} the camera; its {' and its '.join(looks)} in the picture"


# ------------------------------------------------------------------------------------------------ details


def _loaded(text: str, path: Path) -> Any:
    from lxml.etree import XMLSyntaxError
    from yourdfpy import URDF

    hint = "expand a xacro file first: `xacro robot.urdf.xacro > robot.urdf`"
    try:
        return URDF.load(
            io.StringIO(text), build_scene_graph=True, load_meshes=False, build_collision_scene_graph=False
        )
    except (XMLSyntaxError, ValueError, KeyError, AttributeError, TypeError, IndexError) as error:
        raise CalibrationError(f"not a URDF that can be read: {error}", where=path, hint=hint) from error


def _chain(robot: Any, lidar: str, camera: str) -> tuple[list[str], list[str]]:
    """Joints on the way from the camera to the LiDAR, and those of them that can move."""
    up = {joint.child: joint for joint in robot.joint_map.values()}

    def to_root(link: str) -> list[Any]:
        joints = []
        while link in up:
            joints.append(up[link])
            link = up[link].parent
        return joints

    first, second = to_root(camera), to_root(lidar)
    shared = {joint.name for joint in first} & {joint.name for joint in second}
    way = [j for j in first if j.name not in shared] + [j for j in reversed(second) if j.name not in shared]
    return [j.name for j in way], [j.name for j in way if j.type != "fixed"]


def _axis_findings(path: Path, camera: str, axes: Float64Array, links: list[str], *, any_axis: bool) -> list[str]:
    """What the camera frame's axes say, seen from the robot's base whose z is up."""
    z, y = float(_UP @ axes[:, 2]), float(_UP @ axes[:, 1])
    if z > _MOSTLY:
        said = f"the z axis of '{camera}' points up: it is no optical frame (x right, y down, z forward)"
        if any_axis:
            return [said]
        optical = [link for link in links if "optical" in link]
        hint = f"use {' or '.join(optical)}" if optical else "add a link turned by rpy -1.5708 0 -1.5708"
        raise CalibrationError(said, where=path, hint=f"{hint}; --any-axis takes it as it is")
    if z < -_MOSTLY:
        return [f"the z axis of '{camera}' points down: a camera that looks at the floor?"]
    if y > _MOSTLY:
        return [f"the y axis of '{camera}' points up: the camera is mounted upside down, or the frame is not optical"]
    return []


def _direction_findings(T: Float64Array, lidar: str) -> list[str]:
    findings = []
    if T[2, 0] < -_MOSTLY:
        findings.append(
            f"the x axis of '{lidar}' points against the camera's view; LiDARs mounted backwards exist, mistakes too"
        )
    if np.linalg.norm(T[:3, 3]) > 2.0:
        findings.append(f"LiDAR and camera are {np.linalg.norm(T[:3, 3]):.1f} m apart; lengths of a URDF are metres")
    return findings
