"""`wallkit calib from-urdf` and `to-urdf`: what the robot's description says, and what it should say."""

from __future__ import annotations

from pathlib import Path

import click

from wallkit.cli import common

ROBOT = click.argument("robot", type=click.Path(path_type=Path), metavar="ROBOT")
LIDAR = click.option("--lidar", required=True, metavar="LINK", help="The LiDAR's frame.")
CAMERA = click.option("--camera", required=True, metavar="LINK", help="The camera's optical frame (z forward).")


def arguments_of(_: click.Context, __: click.Parameter, values: tuple[str, ...]) -> dict[str, str]:
    """{name: value} of --arg NAME=VALUE."""
    if any("=" not in value for value in values):
        raise click.BadParameter("NAME=VALUE, for example namespace=")
    return dict(value.split("=", 1) for value in values)


@click.command("from-urdf")
@ROBOT
@LIDAR
@CAMERA
@click.option("--any-axis", is_flag=True, help="Take a camera frame whose z axis points up.")
@click.option(
    "--arg",
    "arguments",
    multiple=True,
    callback=arguments_of,
    metavar="NAME=VALUE",
    help="For a ${NAME} left by xacro.",
)
@common.quiet_option
@common.json_option
def from_urdf(
    robot: Path, lidar: str, camera: str, any_axis: bool, arguments: dict[str, str], quiet: bool, as_json: bool
) -> None:
    """Print T_camera_lidar as the robot's URDF has it, in numbers and in words, with what looks wrong.

    p_camera = T_camera_lidar p_lidar. A camera frame that is not optical is refused; xacro that nobody expanded, joints
    that can move and a LiDAR that looks backwards are reported.

    \b
    Examples:
      wallkit calib from-urdf robot.urdf --lidar laser --camera camera_optical_frame
      wallkit calib from-urdf tb3.urdf --lidar base_scan --camera camera_rgb_optical_frame --arg namespace=
    """
    from wallkit.calib.extrinsics.rigid import rpy_from_matrix
    from wallkit.calib.files.from_urdf import place_words, transform_from_urdf

    found = transform_from_urdf(robot, lidar, camera, any_axis=any_axis, arguments=arguments)
    if as_json:
        common.emit(
            {
                "camera": camera,
                "lidar": lidar,
                "T_camera_lidar": found.T,
                "xyz_m": found.T[:3, 3],
                "rpy_rad": rpy_from_matrix(found.T),
                "joints": found.chain,
                "warnings": found.warnings,
            }
        )
        return
    click.echo("\n".join(matrix_lines(found.T)))
    click.echo(place_words(found.T))
    click.echo(f"joints   {' '.join(found.chain) or '-'}")
    for warning in found.warnings:
        common.warn(warning, quiet=quiet)


@click.command("to-urdf")
@click.argument("calibration", type=click.Path(path_type=Path), metavar="CALIBRATION")
@ROBOT
@LIDAR
@CAMERA
@click.option("--joint", default="", metavar="NAME", help="The joint to move; else the one that holds the LiDAR.")
@common.out_option
@common.overwrite_option
@common.dry_run_option
def to_urdf(
    calibration: Path,
    robot: Path,
    lidar: str,
    camera: str,
    joint: str,
    out: Path | None,
    overwrite: bool,
    dry_run: bool,
) -> None:
    """Write a calibration into a robot's URDF as the <origin> of one joint; no other byte of the file changes.

    Without --out the file goes to stdout.

    \b
    Examples:
      wallkit calib to-urdf cal.toml robot.urdf --lidar laser --camera cam_optical -o robot.urdf --overwrite
      wallkit calib to-urdf cal.toml robot.urdf --lidar laser --camera cam_optical --dry-run
    """
    import numpy as np

    from wallkit.calib.files.store import read_calibration
    from wallkit.calib.files.urdf_origin import joints_of, with_calibration
    from wallkit.errors import CalibrationError
    from wallkit.pipelines.outputs import check_file_out, write_whole

    stored = read_calibration(calibration)
    if stored.T_camera_lidar is None:
        hint = "`wallkit calib extrinsics` makes one that has it"
        raise CalibrationError("does not say where the LiDAR is", where=calibration, hint=hint)
    if out is not None:
        check_file_out(out, overwrite=overwrite)
    try:
        data = robot.read_bytes()
    except OSError as error:
        raise CalibrationError(f"cannot be read: {error.strerror}", where=robot) from error
    edited, before = with_calibration(data, stored.T_camera_lidar, lidar, camera, joint=joint, source=robot)
    after = next(j for j in joints_of(edited, robot) if j.name == before.name)
    shift_mm = 1e3 * float(np.linalg.norm(np.subtract(after.xyz, before.xyz)))
    said = f"joint {before.name}: xyz {_numbers(before.xyz)} -> {_numbers(after.xyz)} ({shift_mm:.1f} mm), "
    click.echo(f"{said}rpy {_numbers(before.rpy)} -> {_numbers(after.rpy)}", err=True)
    if dry_run:
        return
    if out is None:
        click.echo(edited, nl=False)
    else:
        write_whole(out, edited)


def matrix_lines(T: object) -> list[str]:
    """T_camera_lidar as four rows, and as xyz and rpy."""
    import numpy as np

    from wallkit.calib.extrinsics.rigid import rpy_from_matrix

    matrix = np.asarray(T)
    rows = [" ".join(f"{value + 0.0:10.6f}" for value in np.where(np.abs(row) < 5e-7, 0.0, row)) for row in matrix]
    labels = ["T_camera_lidar", *[""] * 3]
    lines = [f"{label:15}{row}" for label, row in zip(labels, rows, strict=True)]
    lines.append(f"{'xyz':15}{_numbers(matrix[:3, 3])} m")
    lines.append(f"{'rpy':15}{_numbers(rpy_from_matrix(matrix))} rad")
    back = np.linalg.inv(matrix)
    lines.append(
        f"{'the other way':15}{_numbers(back[:3, 3])} m, {_numbers(rpy_from_matrix(back))} rad (camera in the LiDAR)"
    )
    return lines


def _numbers(values: object) -> str:
    import numpy as np

    return " ".join(f"{value:.6f}" for value in np.where(np.abs(np.asarray(values)) < 5e-7, 0.0, np.asarray(values)))
