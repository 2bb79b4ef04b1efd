"""`wallkit calib`: the words that can follow."""

from __future__ import annotations

import click

from wallkit.cli.calib.board import board
from wallkit.cli.calib.convert import convert
from wallkit.cli.calib.extrinsics import extrinsics
from wallkit.cli.calib.intrinsics import intrinsics
from wallkit.cli.calib.overlay import overlay
from wallkit.cli.calib.urdf import from_urdf, to_urdf
from wallkit.cli.calib.verify import verify


@click.group()
def calib() -> None:
    """Calibrate cameras and the place of a LiDAR to them, and say how far the result may be trusted."""


for command in (board, intrinsics, extrinsics, verify, overlay, from_urdf, to_urdf, convert):
    calib.add_command(command)
