"""`wallkit calib extrinsics`: where the LiDAR is to the camera."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from wallkit.cli import common
from wallkit.cli.calib.board import board_option
from wallkit.cli.calib.urdf import matrix_lines

if TYPE_CHECKING:
    from wallkit.calib.extrinsics.time_offset import TimeOffset
    from wallkit.pipelines.calib.extrinsics import ExtrinsicsRun

_REFERENCE_M = 3.0


@click.command()
@click.argument("inputs", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="INPUT...")
@board_option
@click.option(
    "--camera",
    "camera_file",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Intrinsics; of a log else its camera_info.",
)
@click.option(
    "--scans", type=click.Path(path_type=Path), metavar="FOLDER", help="Scans of pictures: .pcd, .csv or .npz."
)
@click.option("--scan", "scan_topic", metavar="TOPIC", help="LiDAR topic of a log, when there are several.")
@click.option("--image", "image_topic", metavar="TOPIC", help="Camera topic of a log, when there are several.")
@click.option("--sigma-range", metavar="LENGTH|LIDAR", help="Noise of a range: 15mm, or a LiDAR: vlp-16, lds-01, ...")
@click.option(
    "--urdf", type=click.Path(path_type=Path), metavar="FILE", help="The robot; its transform is the first guess."
)
@click.option("--lidar", "lidar_link", metavar="LINK", help="The LiDAR's frame in the URDF.")
@click.option("--camera-frame", "camera_link", metavar="LINK", help="The camera's optical frame in the URDF.")
@click.option("--hold", is_flag=True, help="What the boards do not show is held where the URDF has it.")
@click.option(
    "--prior", default="1deg,10mm", show_default=True, metavar="TURN,SHIFT", help="How far to trust the URDF."
)
@click.option(
    "--sides",
    type=click.Choice(["auto", "always", "never"]),
    default="auto",
    show_default=True,
    help="Use the plate's sides in a cloud; auto: where planes alone leave something weak.",
)
@common.seed_option
@common.out_option
@common.overwrite_option
@common.quiet_option
@common.json_option
@click.pass_context
def extrinsics(
    ctx: click.Context,
    /,
    inputs: tuple[Path, ...],
    board_words: str,
    out: Path | None,
    overwrite: bool,
    quiet: bool,
    as_json: bool,
    **given: Any,
) -> None:
    """Find where a 2-D or 3-D LiDAR is to a camera, from a board that both have seen, and how sure that is.

    INPUT is a log with images and scans, pictures or a folder of them, or an .npz of corners; pictures and corners need
    --scans and --camera. A scan belongs to a picture by stamp in its name, or by the same name or number.

    What the boards cannot show is named, never made up: the answer then is yaw and two shifts (a level LiDAR), or with
    --hold the URDF's value. Views that do not fit are left out and always listed.

    Exits 0 if done, 1 if the declared square size is contradicted, 4 if six degrees of freedom are not constrained.

    \b
    Examples:
      wallkit calib extrinsics log.mcap --board board.toml --sigma-range lds-01 -o cal.toml
      wallkit calib extrinsics pictures/ --scans scans/ --camera cam.toml --board chessboard:11x8:0.019
      wallkit calib extrinsics corners.npz --scans clouds/ --camera cam.yaml --board board.toml
    """
    from dataclasses import replace

    from wallkit.calib.board.boards import board_from
    from wallkit.pipelines.calib.clock import with_clock
    from wallkit.pipelines.calib.extrinsics import run_extrinsics
    from wallkit.pipelines.calib.request import gather, options_from_words, provenance
    from wallkit.pipelines.outputs import check_file_out, write_whole

    if out is not None:
        check_file_out(out, overwrite=overwrite)
    board = board_from(board_words)
    options, notes = options_from_words(
        sigma_range=given["sigma_range"],
        urdf=given["urdf"],
        lidar=given["lidar_link"],
        camera=given["camera_link"],
        hold=given["hold"],
        prior=given["prior"],
        sides=given["sides"],
        seed=given["seed"],
    )
    topics = (given["scan_topic"], given["image_topic"])
    with common.progress("looking for the board", None, quiet=quiet) as done:
        gathered = gather(inputs, given["scans"], board, given["camera_file"], topics=topics, done=done)
    # files do not name the LiDAR's frame
    gathered = replace(gathered, lidar_frame=gathered.lidar_frame or given["lidar_link"] or "")
    run, clock = with_clock(run_extrinsics(gathered, options))
    warnings = [*notes, *gathered.notes, *run.result.warnings, *([run.scale.words] if run.scale.is_suspect else [])]
    warnings += [run.bias.words] if run.bias is not None and run.bias.is_suspect else []
    made = run.calibration(provenance(gathered, common.typed(ctx), notes=tuple(warnings)))
    is_written = out is not None and made is not None
    if out is not None and made is not None:
        from wallkit.calib.files.store import toml_from_calibration

        write_whole(out, toml_from_calibration(made).encode())
    if as_json:
        common.emit({**_document(run, clock), "warnings": warnings, "out": out if is_written else None})
    else:
        click.echo("\n".join(_page(run, clock)))
        for warning in warnings:
            common.warn(warning, quiet=quiet)
        if out is not None:
            click.echo(f"{out}: {'written' if is_written else 'not written'}", err=True)
    bad = common.FAILED_CHECK if run.scale.is_suspect else common.OK
    ctx.exit(common.CANNOT_TELL if run.result.covariance is None else bad)


# ------------------------------------------------------------------------------------------------ details


def _page(run: ExtrinsicsRun, clock: TimeOffset | None) -> list[str]:
    """What a user reads, the answer and what to do next at the end."""
    from wallkit.calib.extrinsics.extrinsics import sigma_words

    result, seen = run.result, run.result.observability
    used = sum(result.used)
    lines = [f"{used} views of {run.gathered.looked_at} decided, {'2-D' if run.is_planar else '3-D'} LiDAR, "]
    lines[0] += f"sigma of a range {run.options.sigma_range_m * 1e3:.0f} mm ({run.options.sigma_source})"
    lines += [f"left out  {item.name}: {item.why}" for item in run.left_out]
    lines += [f"left out  {view.name}: {view.why}" for view in result.views if view.why]
    lines.append(f"fit       points lie {run.plane_rms_mm:.1f} mm (RMS) off the boards; this is fit, not quality")
    lines.append(f"squares   {run.scale.words}")
    if run.bias is not None:
        lines.append(f"ranges    {run.bias.words}, fitted beside the transform")
    if clock is not None:
        lines.append(f"clocks    {clock.words}")
    lines.append("")
    lines += matrix_lines(result.T) if result.covariance is not None else _partial(run)
    lines.append("")
    if result.kind != "refused":
        rows = [[name, sigma, source] for name, sigma, source in sigma_words(result)]
        lines.append(common.table(["of the LiDAR", "sigma", "from"], rows, right=(1,)))
        lines.append("")
    lines += _ending(run)
    if seen.reason:
        verb = "held at the URDF" if result.kind == "held" else "cannot tell"
        lines.append(f"{verb}: {seen.reason}")
    return lines


def _partial(run: ExtrinsicsRun) -> list[str]:
    """What can be said without six degrees of freedom."""
    import numpy as np

    from wallkit.calib.extrinsics.planar import planar_answer

    names = ", ".join(run.result.observability.unseen)
    lines = [f"six degrees of freedom: CANNOT TELL; not seen: {names}"]
    if run.result.kind == "planar":
        yaw, x, z = planar_answer(run.result.placement)
        lines.append(f"for a level LiDAR: yaw {np.degrees(yaw):+.2f} deg (about the camera's y axis), ")
        lines[-1] += f"x {x * 1e3:+.1f} mm (right), z {z * 1e3:+.1f} mm (before the camera)"
    return lines


def _ending(run: ExtrinsicsRun) -> list[str]:
    lines = []
    if run.pixel_error is not None:
        import numpy as np

        at = run.pixel_error
        px = float(np.interp(1 / _REFERENCE_M, 1 / at[::-1, 0], at[::-1, 1]))
        lines.append(f"at {_REFERENCE_M:g} m a LiDAR point lands within {px:.1f} px (95 %)")
    count = sum(run.result.used)
    if run.advice is not None:
        more = f" ({12 - count} more views at least)" if count < 12 else ""
        lines.append(f"next      {run.advice.words}: helps {run.advice.direction}{more}")
    if run.result.covariance is not None:
        lines.append("then      wallkit calib verify: only that is a verdict")
    return lines


def _document(run: ExtrinsicsRun, clock: TimeOffset | None) -> dict[str, Any]:
    from dataclasses import asdict

    import numpy as np

    from wallkit.calib.extrinsics.observability import DEGREES_OF_FREEDOM
    from wallkit.calib.extrinsics.planar import planar_answer
    from wallkit.calib.extrinsics.rigid import rpy_from_matrix

    result, seen = run.result, run.result.observability
    sigmas = dict(zip(DEGREES_OF_FREEDOM, result.sigmas, strict=True))
    document: dict[str, Any] = {
        "kind": result.kind,
        "T_camera_lidar": result.T if result.covariance is not None else None,
        "xyz_m": result.T[:3, 3] if result.covariance is not None else None,
        "rpy_rad": rpy_from_matrix(result.T) if result.covariance is not None else None,
        "covariance": result.covariance,
        "sigma_deg": {k: np.degrees(sigmas[k]) for k in DEGREES_OF_FREEDOM[:3]},
        "sigma_mm": {k: 1e3 * sigmas[k] for k in DEGREES_OF_FREEDOM[3:]},
        "from_data": dict(zip(DEGREES_OF_FREEDOM, result.from_data, strict=True)),
        "degrees_of_freedom": result.degrees,
        "plane_rms_mm": run.plane_rms_mm,
        "unseen": seen.unseen,
        "reason": seen.reason,
        "singular_values": seen.singular_values,
        "directions": [{"words": d.words, "sight": d.sight, "sigma_over_prior": d.ratio} for d in seen.directions],
        "square_scale": run.scale.value,
        "square_scale_sigma": run.scale.sigma,
        "square_scale_is_suspect": run.scale.is_suspect,
        "range_bias_mm": None if run.bias is None else 1e3 * run.bias.value,
        "pixel_error_95": None if run.pixel_error is None else [{"range_m": r, "px": e} for r, e in run.pixel_error],
        "views": [asdict(view) for view in result.views],
        "left_out": [{"name": i.name, "why": i.why} for i in run.left_out]
        + [{"name": v.name, "why": v.why} for v in result.views if v.why],
        "time_offset": None if clock is None else asdict(clock),
        "next": None if run.advice is None else run.advice.words,
    }
    if result.kind == "planar":
        yaw, x, z = planar_answer(result.placement)
        document["planar"] = {"yaw_deg": np.degrees(yaw), "x_mm": 1e3 * x, "z_mm": 1e3 * z}
    return document
