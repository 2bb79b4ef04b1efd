"""`wallkit simulate boards`: captures to calibrate with, of which the truth is known."""

from __future__ import annotations

from pathlib import Path

import click

from wallkit.cli import common
from wallkit.cli.calib.board import board_option


@click.command("boards")
@board_option
@click.option(
    "--robot", "robot_path", type=click.Path(path_type=Path), metavar="URDF", help="Else one with three cameras."
)
@click.option(
    "--scenario", type=click.Path(path_type=Path), metavar="TOML", help="Its first camera and its LiDAR count."
)
@click.option("--count", type=click.IntRange(3, 500), default=20, show_default=True, help="Poses of the board.")
@click.option(
    "--near", "near_m", type=common.Number(), default=0.7, show_default=True, metavar="M", help="Nearest to the camera."
)
@click.option(
    "--far", "far_m", type=common.Number(), default=2.2, show_default=True, metavar="M", help="Farthest from it."
)
@click.option(
    "--tilt",
    "tilt_deg",
    type=common.Number(),
    default=45.0,
    show_default=True,
    metavar="DEG",
    help="Most it is tilted.",
)
@click.option(
    "--rings", "ring_count", type=click.IntRange(2, 256), metavar="N", help="A 3-D LiDAR of so many; else a planar one."
)
@click.option(
    "--ring-span",
    "span_deg",
    type=common.Number(1, 170),
    default=30.0,
    show_default=True,
    metavar="DEG",
    help="From its lowest ring to its highest.",
)
@click.option("--anywhere", is_flag=True, help="For the camera alone: the LiDAR need not see the board.")
@common.set_option
@common.seed_option
@common.out_option
@common.overwrite_option
@common.json_option
@common.quiet_option
def boards(
    board_words: str,
    robot_path: Path | None,
    scenario: Path | None,
    count: int,
    near_m: float,
    far_m: float,
    tilt_deg: float,
    ring_count: int | None,
    span_deg: float,
    anywhere: bool,
    words: tuple[str, ...],
    seed: int,
    out: Path | None,
    overwrite: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """Show a board to camera and LiDAR in many poses: a log, pictures and scans by number, and the exact truth.

    The folder holds log.mcap, images/, scans/ (.npz, of a 3-D LiDAR .pcd), board.toml, camera.toml (the true lens) and
    truth.toml (that, and where the LiDAR truly is to the camera). Calibrate from either, and compare. The pictures are
    of a board and a camera that stand still in good light: sharp, with the noise, vignette and exposure of the
    scenario's `photo`. Needs OpenGL; see `wallkit doctor`.

    \b
    Examples:
      wallkit simulate boards --board charuco:5x7:0.1:0.075:5X5_100 -o boards
      wallkit simulate boards --board chessboard:5x7:0.095 --rings 16 -s lidar.scanner.fov_rad=6.28 -o cloud
      wallkit simulate boards --board chessboard:9x6:0.025 --anywhere --far 0.6 --near 0.3 -o lens
      wallkit calib extrinsics boards/images --scans boards/scans --board boards/board.toml --camera boards/camera.toml
    """
    import math

    from wallkit.calib.board.boards import board_from
    from wallkit.pipelines.simulate.boards import BoardRequest, simulate_boards
    from wallkit.simulate.board_room import BoardPoses
    from wallkit.simulate.robot import DEFAULT_ROBOT
    from wallkit.simulate.scanner import Rings
    from wallkit.simulate.scenario import read_scenario

    poses = BoardPoses(count, near_m, far_m, tilt_deg, anywhere=anywhere)
    out = out or Path(f"boards-{seed}")
    rings = Rings(ring_count, math.radians(span_deg)) if ring_count else None
    request = BoardRequest(
        board_from(board_words), read_scenario(scenario, words), poses, rings, robot_path or DEFAULT_ROBOT, seed
    )
    with common.progress("boards", count, quiet=quiet) as update:
        held = simulate_boards(request, out, overwrite=overwrite, progress=update)
    if as_json:
        common.emit({"out": out, "seed": seed, "poses": len(held)})
    else:
        click.echo(f"boards   {out}: {len(held)} poses of {request.board.words}; the truth is in {out / 'truth.toml'}")
