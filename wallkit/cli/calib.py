"""`wallkit calib`: the words that can follow."""

from __future__ import annotations

import click

from wallkit.cli.calib_board import board
from wallkit.cli.calib_convert import convert
from wallkit.cli.calib_extrinsics import extrinsics
from wallkit.cli.calib_intrinsics import intrinsics
from wallkit.cli.calib_overlay import overlay
from wallkit.cli.calib_urdf import from_urdf, to_urdf
from wallkit.cli.calib_verify import verify


@click.group()
def calib() -> None:
    """Calibrate cameras and the place of a LiDAR to them, and say how far the result may be trusted."""


for command in (board, intrinsics, extrinsics, verify, overlay, from_urdf, to_urdf, convert):
    calib.add_command(command)
