"""`wallkit calib convert`: a calibration in another file format."""

from __future__ import annotations

from pathlib import Path

import click

from wallkit.cli import common


@click.command()
@click.argument("calibration", type=click.Path(path_type=Path), metavar="FILE")
@click.option(
    "--to",
    "format_name",
    type=click.Choice(["toml", "ros", "kalibr"]),
    default="toml",
    show_default=True,
    help="wallkit's TOML, ROS camera_info YAML, or Kalibr camchain YAML.",
)
@common.out_option
@common.overwrite_option
@common.quiet_option
@click.pass_context
def convert(
    ctx: click.Context, /, calibration: Path, format_name: str, out: Path | None, overwrite: bool, quiet: bool
) -> None:
    """Write a calibration in another format: wallkit's TOML, ROS camera_info YAML or Kalibr camchain YAML.

    Without --out it is printed. What the format has no place for is named.

    Exits 0 if everything was taken along, 3 if something had no place, 2 if it could not be done.

    \b
    Examples:
      wallkit calib convert front.toml --to ros -o front.yaml
      wallkit calib convert camchain.yaml -o front.toml
    """
    from wallkit.calib.files.store import FORMATS, read_calibration, text_from_calibration
    from wallkit.pipelines.outputs import check_file_out, write_whole

    given = read_calibration(calibration)
    text = text_from_calibration(given, format_name)
    missed = FORMATS[format_name].misses(given)
    if out is None:
        click.echo(text, nl=False)
    else:
        check_file_out(out, overwrite=overwrite)
        write_whole(out, text.encode())
        click.echo(f"{out}: written", err=True)
    if missed:
        common.warn(f"{format_name} has no place for {', '.join(missed)}", quiet=quiet)
    ctx.exit(common.DATA_LOST if missed else common.OK)
