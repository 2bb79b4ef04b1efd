"""`wallkit calib overlay`: LiDAR points drawn on images, to see with one's own eyes."""

from __future__ import annotations

from pathlib import Path

import click

from wallkit.cli import common

FILE = click.Path(path_type=Path)


@click.command()
@click.argument("inputs", nargs=-1, required=True, type=FILE, metavar="LOG|FILES...")
@click.option("--calib", "calibration", required=True, type=FILE, metavar="FILE", help="Camera and place of the LiDAR.")
@click.option("-o", "--out", required=True, type=FILE, metavar="DIR", help="Where the pictures go.")
@click.option("--scans", type=FILE, metavar="FOLDER", help="Scans of pictures: .pcd, .csv or .npz.")
@click.option("--count", type=click.IntRange(1), default=12, show_default=True, help="Pictures, evenly spread.")
@click.option("--scan", "scan_topic", metavar="TOPIC", help="LiDAR topic of a log, when there are several.")
@click.option("--image", "image_topic", metavar="TOPIC", help="Camera topic of a log, when there are several.")
@click.option("--allow-unverified", is_flag=True, help="Draw with a calibration whose verdict is FAIL.")
@common.overwrite_option
@common.json_option
@common.quiet_option
@common.dry_run_option
def overlay(
    inputs: tuple[Path, ...],
    calibration: Path,
    out: Path,
    scans: Path | None,
    count: int,
    scan_topic: str | None,
    image_topic: str | None,
    allow_unverified: bool,
    overwrite: bool,
    as_json: bool,
    quiet: bool,
    dry_run: bool,
) -> None:
    """Draw the LiDAR's points on the camera's images, coloured by range, as PNG files.

    Points should lie on the things that they hit: look at edges of doors, boards and pillars, near and far.

    \b
    Examples:
      wallkit calib overlay log.mcap --calib cal.toml -o overlay/
      wallkit calib overlay pictures/ --scans clouds/ --calib cal.toml -o overlay/ --count 5
    """
    from wallkit.pipelines.calib.overlay import OverlayRequest, draw_overlays

    request = OverlayRequest(inputs, calibration, scans, count, scan_topic, image_topic, allow_unverified)
    if dry_run:
        click.echo(f"would draw up to {count} pictures of {', '.join(map(str, inputs))} into {out}")
        return
    with common.progress("drawing", count, quiet=quiet) as update:
        drawn = draw_overlays(request, out, overwrite=overwrite, progress=update)
    if as_json:
        rows = [{"file": out / d.file, "points": d.points, "in_image": d.in_image} for d in drawn]
        common.emit({"out": out, "pictures": rows})
        return
    click.echo(f"{len(drawn)} pictures in {out}")
    empty = [d.file for d in drawn if not d.in_image]
    if empty:
        common.warn(f"no point falls on {len(empty)} of them: is the transform lidar -> camera?", quiet=quiet)
