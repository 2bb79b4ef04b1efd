"""Where the LiDAR sits on the robot: T_base_lidar from the user's words, TF, or the robot's URDF. Never assumed."""

from __future__ import annotations

import io
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wallkit.core.types import Float64Array, Transform
from wallkit.errors import LogError
from wallkit.logs.frames import FrameTree, fixed_transforms
from wallkit.logs.reader import Log
from wallkit.logs.topics import transform_topics

_POSE_HINT = "give it with {} X,Y,YAW or X,Y,Z,ROLL,PITCH,YAW [m, rad]"


@dataclass(frozen=True, slots=True)
class Mount:
    """T_base_lidar (4, 4), and in words where it comes from."""

    matrix: Float64Array
    source: str


def find_mount(
    log: Log,
    base: str,
    sensor: str,
    *,
    words: str | None = None,
    urdf: Path | None = None,
    what: str = "LiDAR",
    flag: str = "--lidar-pose",
) -> Mount:
    """The place of a LiDAR, or another sensor, on the robot.

    The user's words win, then the user's URDF; else a scan already in the base frame, /tf_static, transforms of /tf
    that never change, and a robot_description in the log, in this order.

    Args:
        base: the frame whose motion odometry tells. sensor: the frame of what it measures.
        words: X,Y,YAW or X,Y,Z,ROLL,PITCH,YAW [m, rad], as typed.
        what, flag: the sensor and the option for its pose, for messages.

    Raises:
        LogError: none of them knows it.
    """
    if words is not None:
        return Mount(matrix_from_words(words, flag), flag)
    if urdf is not None:
        transforms = transforms_from_urdf(urdf.read_text(encoding="utf-8"), str(urdf))
        return Mount(FrameTree(transforms).lookup(base, sensor), str(urdf))
    if not base:
        hint = f"{_POSE_HINT.format(flag)}, then the frame is not needed; or name it with --base-frame"
        raise LogError(
            "odometry does not name the frame that moves (child_frame_id is empty)", where=log.name, hint=hint
        )
    if base == sensor:
        return Mount(np.eye(4), f"scans are in the base frame '{base}'")
    known: set[str] = set()
    for source, transforms in _sources(log):
        tree = FrameTree(transforms)
        matrix = tree.find(base, sensor)
        if matrix is not None:
            return Mount(matrix, source)
        known.update(tree.frames)
    listed = ", ".join(sorted(known)) or "none"
    message = f"nothing tells where the {what} '{sensor}' sits on the robot '{base}'; known frames: {listed}"
    raise LogError(message, where=log.name, hint=f"{_POSE_HINT.format(flag)}, or name the robot's URDF")


def matrix_from_words(words: str, flag: str = "--lidar-pose") -> Float64Array:
    """(4, 4) transform of "X,Y,YAW" or "X,Y,Z,ROLL,PITCH,YAW" [m, rad], angles about fixed axes as in URDF.

    Raises:
        LogError: not three or six finite numbers.
    """
    try:
        numbers = [float(w) for w in words.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in (3, 6) or not np.isfinite(numbers).all():
        raise LogError(f"'{words}' is no pose", where=flag, hint="X,Y,YAW or X,Y,Z,ROLL,PITCH,YAW [m, rad]")
    x, y, z, roll, pitch, yaw = numbers if len(numbers) == 6 else (*numbers[:2], 0.0, 0.0, 0.0, numbers[2])
    (cr, cp, cy), (sr, sp, sy) = np.cos((roll, pitch, yaw)), np.sin((roll, pitch, yaw))
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr, x],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr, y],
            [-sp, cp * sr, cp * cr, z],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def transforms_from_urdf(text: str, source: str) -> list[Transform]:
    """The joints of a URDF as transforms: fixed ones as they are, movable ones at their zero position.

    Raises:
        LogError: it is not a URDF.
    """
    from lxml.etree import XMLSyntaxError
    from yourdfpy import URDF

    hint = "expand a xacro file first: `xacro robot.urdf.xacro > robot.urdf`"
    try:
        robot = URDF.load(
            io.StringIO(text), build_scene_graph=False, load_meshes=False, build_collision_scene_graph=False
        )
    except (XMLSyntaxError, ValueError, KeyError, AttributeError, TypeError) as error:
        raise LogError(f"not a URDF that can be read: {error}", where=source, hint=hint) from error
    return [
        Transform(0, j.parent, j.child, np.eye(4) if j.origin is None else np.asarray(j.origin, float), is_static=True)
        for j in robot.robot.joints
    ]


def _sources(log: Log) -> Iterator[tuple[str, list[Transform]]]:
    """Where transforms may come from, each only read when those before did not help."""
    static = list(log.static.transforms)
    yield "/tf_static", static
    topics = transform_topics(log)
    if topics:
        yield ", ".join(topics), static + fixed_transforms(log, topics)
    for topic, text in log.static.robot_descriptions.items():
        yield topic, static + transforms_from_urdf(text, topic)
