"""`wallkit calib intrinsics`: how the camera maps rays to pixels, and how sure that is."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

import click

from wallkit.cli import common
from wallkit.cli.calib.board import board_option

if TYPE_CHECKING:
    from wallkit.pipelines.calib.intrinsics import CameraResult

EXITS = {"PASS": common.OK, "FAIL": common.FAILED_CHECK, "CANNOT TELL": common.CANNOT_TELL}
MODELS = ["auto", "k1k2", "radtan", "plumb_bob", "rational_polynomial", "equidistant"]


@click.command()
@click.argument("inputs", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="LOG|FOLDER|FILE...")
@board_option
@click.option(
    "--model",
    type=click.Choice(MODELS),
    default="auto",
    show_default=True,
    help="Lens model; auto: the leanest within 2 % of the best error on views held out.",
)
@click.option("--image", "topic", default="", metavar="TOPIC", help="Image topic of a log that has several.")
@click.option("--size", "size_words", default="", metavar="WxH", help="Image size behind an .npz of corners.")
@click.option(
    "--half-window", type=click.IntRange(1, 50), help="Of the corner refinement [px]; else by corner spacing."
)
@click.option("--name", default="", help="Name of the camera in the result.")
@click.option("--frame", default="", help="Optical frame of the camera in the result.")
@common.out_option
@click.option("--ros", type=click.Path(path_type=Path), metavar="FILE", help="Also write a ROS camera_info YAML.")
@click.option(
    "--report",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Also write an HTML page with figures and reasons.",
)
@common.overwrite_option
@common.config_option
@common.set_option
@common.json_option
@common.quiet_option
@common.dry_run_option
@click.pass_context
def intrinsics(
    ctx: click.Context,
    /,
    inputs: tuple[Path, ...],
    board_words: str,
    model: str,
    topic: str,
    size_words: str,
    half_window: int | None,
    name: str,
    frame: str,
    out: Path | None,
    ros: Path | None,
    report: Path | None,
    overwrite: bool,
    config_path: Path | None,
    words: tuple[str, ...],
    as_json: bool,
    quiet: bool,
    dry_run: bool,
) -> None:
    """Calibrate a camera from pictures of a board, and say how far the result may be trusted.

    The inputs are logs with images, pictures and folders of them, or one .npz with an array of corners for each view. The
    result (--out) is wallkit's TOML with covariance, verdict and provenance.

    Exits 0 for PASS, 1 for FAIL, 4 when the views cannot tell (too few, too much alike), 2 if it could not be done.

    \b
    Examples:
      wallkit calib intrinsics log.mcap --board board.toml -o front.toml
      wallkit calib intrinsics pictures/ --board chessboard:9x6:0.025 -o front.toml --ros front.yaml --report front.html
      wallkit calib intrinsics corners.npz --size 1920x1208 --board chessboard:7x5:0.095 --model equidistant --json
    """
    from wallkit.calib.board.boards import board_from
    from wallkit.pipelines.calib.captures import CaptureRequest
    from wallkit.pipelines.calib.intrinsics import calibrate_camera, document
    from wallkit.pipelines.config import load_config
    from wallkit.pipelines.outputs import check_file_out

    board, size = board_from(board_words), _size(size_words)
    for path in (p for p in (out, ros, report) if p is not None):
        check_file_out(path, overwrite=overwrite)
    if dry_run:
        click.echo(f"would look for {board.words} in {', '.join(map(str, inputs))} and write {out or 'nothing'}")
        return
    limits = load_config(config_path, words).config.calib.camera
    request = CaptureRequest(inputs, board, topic, size, half_window)
    with common.progress("searching", None, quiet=quiet) as update:
        result = calibrate_camera(
            request, model=model, name=name, frame=frame, command=common.typed(ctx), limits=limits, progress=update
        )
    _write(result, out, ros)
    if report is not None:
        from wallkit.pipelines.calib.intrinsics_page import page_of
        from wallkit.pipelines.outputs import write_whole

        write_whole(report, page_of(result, [str(path) for path in inputs]).encode())
    if as_json:
        common.emit(document(result))
    else:
        click.echo("\n".join(_lines(result)))
    ctx.exit(EXITS[result.verdict])


def _size(words: str) -> tuple[int, int] | None:
    if not words:
        return None
    found = re.fullmatch(r"(\d+)x(\d+)", words)
    if not found:
        raise click.UsageError(f"--size {words}: write it as WIDTHxHEIGHT, as 640x480")
    return int(found[1]), int(found[2])


def _write(result: CameraResult, out: Path | None, ros: Path | None) -> None:
    from wallkit.calib.files.store import text_from_calibration
    from wallkit.pipelines.outputs import write_whole

    for path, form in ((out, "toml"), (ros, "ros")):
        if path is not None:
            write_whole(path, text_from_calibration(result.calibration, form).encode())


def _lines(result: CameraResult) -> list[str]:
    """The page of `calib intrinsics`."""
    found, camera, capture = result.found, result.found.camera, result.capture
    lines = [
        f"camera   {camera.model}, {camera.width} x {camera.height} px",
        f"views    {len(found.views)} used, of {capture.looked_at} pictures",
    ]
    lines += [f"left out {count} pictures: {why}" for why, count in capture.left_out]
    lines += [f"rejected view {name}: {why}" for name, why in found.rejected_views.items()]
    if found.rejected_corners:
        lines.append(f"rejected {found.rejected_corners} corners farther than 5 sigma")
    rows = [
        [name, f"{value:.4f}", f"{sigma:.4f}" if free else "held", f"+- {half:.4f}" if free else ""]
        for name, value, sigma, half, free in zip(
            camera.parameter_names,
            camera.parameters,
            found.sigmas,
            found.spread.half_widths(),
            found.free,
            strict=True,
        )
    ]
    lines += ["", *common.table(["", "value", "sigma", "95 %"], rows, right=(1, 2, 3)).splitlines(), ""]
    lines.append(f"fit      {found.fit.rms_px:.4f} px RMS over corners (fit, not quality); sigma is clustered by view")
    far = result.sigma_far
    lines.append(
        f"error    1 sigma at infinity: centre {far.centre:.2f}, outer {far.outer:.2f}, worst {far.worst:.2f} px"
    )
    if result.tried:
        rows = [
            [c.model, str(c.parameters), f"{c.fit_rms_px:.4f}", f"{c.held_out_rms_px:.4f}", f"{c.bic:.0f}", _sound(c)]
            for c in result.tried
        ]
        heads = ["model", "unknowns", "fit px", "held out px", "BIC", "up to the corners"]
        lines += ["", *common.table(heads, rows, right=(1, 2, 3, 4)).splitlines()]
    if result.difference is not None:
        name, difference = result.difference
        lines.append(
            f"{name} puts pixels elsewhere by {difference.median:.2f} px (median), {difference.worst:.2f} (worst)"
        )
    if result.published is not None:
        lines.append(result.published.words)
    rows = [[g.verdict, g.name, f"{g.value:.4g} {g.unit}".rstrip(), g.wanted, g.reason] for g in result.gates]
    lines += ["", *common.table(["", "asked", "found", "wanted", ""], rows).splitlines()]
    return [*lines, "", f"verdict  {result.verdict}"]


def _sound(candidate: object) -> str:
    return "sound" if getattr(candidate, "grows_to_corner", False) else "folds back"
