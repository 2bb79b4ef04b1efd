"""`wallkit ceiling`: a picture of the ceiling becomes a map."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from wallkit.cli import common
from wallkit.cli.localize import LOGS
from wallkit.cli.up_camera import camera_from_flags, up_camera_options

if TYPE_CHECKING:
    from wallkit.core.ceiling import CeilingMap
    from wallkit.pipelines.ceiling.build import Built
    from wallkit.pipelines.ceiling.fit import Fitted

_robot_options = common.options(
    click.option("--odom", metavar="TOPIC", help='Odometry topic or transform "odom->base_link".'),
    click.option("--base-frame", metavar="FRAME", help="Frame that odometry moves, when its messages do not say."),
    up_camera_options,
    click.option(
        "--urdf", type=click.Path(path_type=Path), metavar="FILE", help="Robot description to take poses from."
    ),
)


@click.group()
def ceiling() -> None:
    """Make the ceiling a map: scale a picture of it by a log, or stitch one from a log.

    `wallkit localize LOG --ceiling CEILING.yaml` uses it.
    """


@ceiling.command()
@LOGS
@click.option("--picture", type=click.Path(path_type=Path), required=True, metavar="FILE", help="Of any scale.")
@click.option(
    "--poses", metavar="RUN|FILE.tum|truth", help="Where the robot was in the map; else odometry scales it, unplaced."
)
@click.option("--matches", type=click.Path(path_type=Path), metavar="FILE.csv", help="stamp_s,u_px,v_px, no features.")
@_robot_options
@common.out_option
@common.overwrite_option
@common.config_option
@common.set_option
@common.json_option
@common.dry_run_option
def fit(
    logs: tuple[Path, ...], picture: Path, poses: str | None, matches: Path | None, as_json: bool, **flags: Any
) -> None:
    """Find the metres per pixel of a picture of the ceiling, with its height, turn and place, by least squares.

    Images are found in the picture by their features, mirrored or not. Odometry alone gives the scale, and puts the picture
    where odometry began; --poses puts it in the map. Writes a YAML and a PNG that lies over the floor plan.

    \b
    Examples:
      wallkit ceiling fit log.mcap --picture photo.jpg -o ceiling.yaml
      wallkit ceiling fit log.mcap --picture photo.jpg --poses log.wallkit -o ceiling.yaml
      wallkit ceiling fit log.mcap --picture plan.png --matches clicked.csv --json
    """
    from wallkit.pipelines.ceiling.fit import FitRequest, fit_ceiling
    from wallkit.pipelines.config import load_config

    config = load_config(flags["config_path"], flags["words"]).config
    out = flags["out"] or Path("ceiling.yaml")
    _check_out(out, overwrite=flags["overwrite"])
    fitted = fit_ceiling(FitRequest(logs, picture, poses, matches), camera_from_flags(flags), config)
    frame = "map" if poses else "odom at the beginning of the log"
    notes = (
        f"{picture.name} scaled by {fitted.found} of {fitted.looked} images; frame: {frame}",
        f"resolution {fitted.resolution.value:.6g} +- {fitted.resolution.sigma:.2g} m per pixel (1 sigma)",
    )
    if not flags["dry_run"]:
        _write(out, fitted.ceiling, notes)
    if as_json:
        common.emit({"out": out, **_fit_document(fitted, frame)})
    else:
        click.echo("\n".join(_fit_lines(fitted, frame, out)))


@ceiling.command()
@LOGS
@click.option(
    "--poses", metavar="RUN|FILE.tum|truth", help="Where the robot was in the map.  [default: the log's truth]"
)
@click.option(
    "--height", "height_m", type=common.Number(), metavar="M", help="Of the ceiling above the floor; else it is found."
)
@click.option(
    "--resolution", type=common.Number(), default=0.02, show_default=True, metavar="M", help="Side of a pixel."
)
@click.option(
    "--every", type=common.Number(), default=0.1, show_default=True, metavar="M", help="An image every so many metres."
)
@click.option("--as-exposed", is_flag=True, help="Do not bring images to one brightness.")
@_robot_options
@common.out_option
@common.overwrite_option
@common.config_option
@common.set_option
@common.json_option
@common.quiet_option
@common.dry_run_option
def build(logs: tuple[Path, ...], as_json: bool, **flags: Any) -> None:
    """Stitch a picture of the ceiling from a log whose poses are known, for example by its LiDAR.

    \b
    Examples:
      wallkit ceiling build log.mcap -o ceiling.yaml
      wallkit ceiling build log.mcap --poses log.wallkit --height 2.7 -o ceiling.yaml
    """
    from wallkit.pipelines.ceiling.build import BuildRequest, build_ceiling
    from wallkit.pipelines.config import load_config

    for name, least in (("resolution", 0.002), ("every", 0.0)):
        if not flags[name] >= least:
            raise click.UsageError(f"--{name} {flags[name]:g} is below {least:g}")
    config = load_config(flags["config_path"], flags["words"]).config
    out = flags["out"] or Path("ceiling.yaml")
    _check_out(out, overwrite=flags["overwrite"])
    request = BuildRequest(
        logs, flags["poses"], flags["height_m"], flags["resolution"], flags["every"], not flags["as_exposed"]
    )
    with common.progress("images", None, quiet=flags["quiet"]) as update:
        built = build_ceiling(request, camera_from_flags(flags), config, update)
    if not flags["dry_run"]:
        _write(out, built.ceiling, (f"stitched from {built.used} images of {logs[0].name}",))
    if as_json:
        common.emit({"out": out, **_build_document(built)})
    else:
        click.echo("\n".join(_build_lines(built, out)))


def _check_out(out: Path, *, overwrite: bool) -> None:
    from wallkit.pipelines.outputs import check_file_out

    if out.suffix not in (".yaml", ".yml"):
        raise click.UsageError(f"--out {out} is no YAML: name it ceiling.yaml, its picture goes beside it")
    check_file_out(out, overwrite=overwrite)
    check_file_out(out.with_suffix(".png"), overwrite=overwrite)


def _write(out: Path, ceiling_map: CeilingMap, notes: tuple[str, ...]) -> None:
    from wallkit.maps.ceiling.files import ceiling_files
    from wallkit.pipelines.outputs import write_whole

    image = out.with_suffix(".png")
    text, png = ceiling_files(ceiling_map, image.name, notes)
    write_whole(image, png)
    write_whole(out, text)


def _fit_document(fitted: Fitted, frame: str) -> dict[str, Any]:
    height = fitted.height
    return {
        "resolution_m": fitted.resolution.value,
        "resolution_sigma_m": fitted.resolution.sigma,
        "height_m": math.nan if height is None else height.value,
        "height_sigma_m": math.nan if height is None else height.sigma,
        "origin": fitted.ceiling.origin,
        "origin_sigma_m": fitted.lies.shift_sigma,
        "yaw_sigma_rad": fitted.lies.yaw_sigma,
        "residual_rms_m": fitted.lies.rms,
        "frame": frame.split()[0],
        "is_mirrored": fitted.is_mirrored,
        "images_found": fitted.found,
        "images": fitted.looked,
        "outliers": fitted.resolution.outliers,
    }


def _fit_lines(fitted: Fitted, frame: str, out: Path) -> list[str]:
    r, lies, height = fitted.resolution, fitted.lies, fitted.height
    x, y, yaw = fitted.ceiling.origin
    across, along = fitted.ceiling.size_m
    high = "not known" if height is None else f"{height.value:.3f} m above the floor, 1 sigma {height.sigma:.3f} m"
    return [
        f"scale    {r.value:.6f} m per pixel, 1 sigma {r.sigma:.6f} ({r.sigma / r.value:.2%}); {across:.1f} x {along:.1f} m",
        f"place    x {x:.3f} m, y {y:.3f} m, yaw {yaw:.4f} rad of the lower left corner in {frame}",
        f"         1 sigma {lies.shift_sigma:.3f} m, {lies.yaw_sigma:.4f} rad; residuals {lies.rms:.3f} m",
        f"height   {high}",
        f"images   {fitted.found} of {fitted.looked} found in the picture{', which is mirrored' * fitted.is_mirrored}",
        f"ceiling  {out}",
    ]


def _build_document(built: Built) -> dict[str, Any]:
    return {
        "height_m": built.ceiling.height_m,
        "height_sigma_m": math.nan if built.height is None else built.height.sigma,
        "size_m": list(built.ceiling.size_m),
        "seen": float(built.ceiling.is_seen.mean()),
        "images": built.used,
        "images_without_pose": built.left_out,
    }


def _build_lines(built: Built, out: Path) -> list[str]:
    across, along = built.ceiling.size_m
    sigma = (
        "as given" if built.height is None else f"1 sigma {built.height.sigma:.3f} m, from {built.height.count} pairs"
    )
    return [
        f"ceiling  {across:.1f} x {along:.1f} m, {built.ceiling.is_seen.mean():.0%} of it seen",
        f"height   {built.ceiling.height_m:.3f} m above the floor, {sigma}",
        f"images   {built.used} used, {built.left_out} without a pose",
        f"written  {out}",
    ]
