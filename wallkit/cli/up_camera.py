"""Flags for the camera that looks at the ceiling, and what the user said with them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from wallkit.cli import common

if TYPE_CHECKING:
    from wallkit.pipelines.ceiling.camera import CameraWords

up_camera_options = common.options(
    click.option("--image", metavar="TOPIC", help="Camera that looks at the ceiling, when several do."),
    click.option("--camera-pose", metavar="X,Y,Z,ROLL,PITCH,YAW", help="Its optical frame on the robot [m, rad]."),
)


def camera_from_flags(flags: dict[str, Any]) -> CameraWords:
    """What the user said of the camera that looks up."""
    from wallkit.pipelines.ceiling.camera import CameraWords

    return CameraWords(flags["image"], flags["odom"], flags["base_frame"], flags["camera_pose"], flags["urdf"])
