"""A robot's URDF -> where its LiDAR and its cameras are on it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wallkit.core.types import Float64Array
from wallkit.errors import SimulationError, closest

DEFAULT_ROBOT = Path(__file__).with_name("robot.urdf")
_LIDAR = re.compile(r"laser|lidar|scan|(^|_)ls\d*(_|$)", re.IGNORECASE)
_OPTICAL = re.compile(r"optical", re.IGNORECASE)
_BASES = ("base_footprint", "base_link")


@dataclass(frozen=True, eq=False)
class Robot:
    """Frames of a robot by name, T_base_frame (4, 4); the base is what stands on the floor."""

    name: str
    base: str
    frames: Mapping[str, Float64Array]
    source: str = ""

    def lidar_frame(self, wanted: str = "") -> str:
        """The frame asked for, or the only one that is called like a LiDAR.

        Raises:
            SimulationError: there is none, or more than one and none is asked for.
        """
        return self._frame(wanted, _LIDAR, "LiDAR", "lidar.frame")

    def camera_frame(self, wanted: str = "") -> str:
        """The frame asked for, or the only optical one.

        Raises:
            SimulationError: there is none, or more than one and none is asked for.
        """
        return self._frame(wanted, _OPTICAL, "camera's optical", "frame")

    @property
    def optical_frames(self) -> tuple[str, ...]:
        """Every frame that is called an optical one."""
        return tuple(name for name in self.frames if _OPTICAL.search(name))

    def _frame(self, wanted: str, pattern: re.Pattern[str], what: str, key: str) -> str:
        if wanted:
            if wanted not in self.frames:
                raise SimulationError(
                    f"there is no frame '{wanted}'", where=self.source, hint=closest(wanted, self.frames)
                )
            return wanted
        found = [name for name in self.frames if pattern.search(name)]
        if len(found) == 1:
            return found[0]
        many = f"{len(found)} frames could be: {', '.join(found)}" if found else "no link is called like one"
        raise SimulationError(
            f"which is the {what} frame? {many}",
            where=self.source,
            hint=f"set {key} to one of: {', '.join(self.frames)}",
        )


def robot_from_urdf(path: Path = DEFAULT_ROBOT) -> Robot:
    """The frames of a robot with every joint at zero.

    Raises:
        SimulationError: it cannot be read as URDF, or has no links.
    """
    import yourdfpy

    if not path.is_file():
        raise SimulationError("there is no such robot", where=str(path), hint="name a URDF file with --robot")
    try:
        urdf = yourdfpy.URDF.load(
            str(path), build_scene_graph=True, load_meshes=False, build_collision_scene_graph=False
        )
        links = [link.name for link in urdf.robot.links]
        base = next((name for name in _BASES if name in links), urdf.base_link)
        frames = {name: np.asarray(urdf.get_transform(name, base), dtype=np.float64) for name in links}
    # the library raises whatever it trips over
    except Exception as error:
        raise SimulationError(
            f"cannot be read as a robot: {error}", where=str(path), hint="check it with `wallkit calib from-urdf`"
        ) from error
    left_over = [name for name in links if "${" in name]
    if left_over:
        raise SimulationError(
            f"link '{left_over[0]}' is an unexpanded xacro expression", where=str(path), hint="run xacro on it first"
        )
    return Robot(urdf.robot.name, base, frames, str(path))
