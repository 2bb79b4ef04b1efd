"""`wallkit model quantize`: the same model in fewer bits, if it still sees the same."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from wallkit.cli import common
from wallkit.cli.model.verify import agreement_numbers, agreement_page, picture_options, pictures_from_flags

if TYPE_CHECKING:
    from wallkit.pipelines.model.quantize import Quantised

FILE = click.Path(path_type=Path)


@click.command()
@click.argument("model", type=FILE, metavar="MODEL.onnx")
@click.option("--images", multiple=True, required=True, type=FILE, metavar="FOLDER|LOG", help="Pictures.")
@picture_options
@click.option("-o", "--out", type=FILE, metavar="FILE", help="Else MODEL-int8.onnx beside it.")
@click.option(
    "--to", "kind", type=click.Choice(["int8", "fp16"]), default="int8", show_default=True, help="Fewer bits."
)
@click.option(
    "--min-match",
    type=common.Number(0, 1),
    default=0.8,
    show_default=True,
    help="Else it is not written: share of things.",
)
@common.overwrite_option
@common.config_option
@common.set_option
@common.json_option
@common.quiet_option
@common.dry_run_option
@click.pass_context
def quantize(ctx: click.Context, /, model: Path, **flags: Any) -> None:
    """Write a model that counts with 8 bits, about twice as fast; its decoding stays in float. Needs `onnx`.

    Every other picture calibrates, the rest judge: what the float model finds there must be found again. fp16 halves the
    file and is not faster on a CPU.

    Exits 0 if it is written, 1 if it sees too little and is not.

    \b
    Examples:
      wallkit model quantize best.onnx --images log.mcap
      wallkit model quantize best.onnx --images pictures/ --min-match 0.9 -o small.onnx
      wallkit model quantize best.onnx --images log.mcap --to fp16
    """
    from wallkit.pipelines.config import load_config
    from wallkit.pipelines.model.quantize import check_model, quantise_model
    from wallkit.pipelines.outputs import check_file_out

    out = flags["out"] or model.with_name(f"{model.stem}-{flags['kind']}.onnx")
    check_file_out(out, overwrite=flags["overwrite"])
    settings = load_config(flags["config_path"], flags["words"]).config.segment
    check_model(model, settings)
    pictures = pictures_from_flags(flags["images"], flags)
    if flags["dry_run"]:
        click.echo(f"would calibrate and judge with {len(pictures)} pictures and write {out}")
        return
    with common.progress("judging", None, quiet=flags["quiet"]) as update:
        done = quantise_model(
            model, out, pictures, settings, kind=flags["kind"], min_match=flags["min_match"], progress=update
        )
    if flags["as_json"]:
        common.emit(_document(done, model, out))
    else:
        click.echo("\n".join(_page(done, out, flags["min_match"])))
        if done.is_judged_by_same:
            common.warn(f"{done.judged} pictures are few: they calibrated and judged at once", quiet=flags["quiet"])
    ctx.exit(common.OK if done.is_written else common.FAILED_CHECK)


def _page(done: Quantised, out: Path, min_match: float) -> list[str]:
    before, after = done.bytes_before / 1e6, done.bytes_after / 1e6
    lines = [
        f"file     {before:.1f} -> {after:.1f} MB; {done.kept_float} of its nodes stay in float",
        f"network  {done.network_ms[0]:.1f} -> {done.network_ms[1]:.1f} ms CPU",
        f"judged   by {done.judged} pictures, calibrated with {done.calibrated}",
        *agreement_page(done.agreement, has_lidar=False),
    ]
    if done.is_written:
        return [*lines, f"verdict  {done.agreement.share:.0%} of the things are found again: wrote {out}"]
    asked = f"{min_match:.0%} were asked (--min-match)"
    return [
        *lines,
        f"verdict  only {done.agreement.share:.0%} of the things are found again, {asked}: nothing is written",
    ]


def _document(done: Quantised, model: Path, out: Path) -> dict[str, Any]:
    return {
        "model": model,
        "out": out if done.is_written else None,
        "calibrated_pictures": done.calibrated,
        "judged_pictures": done.judged,
        "judged_by_calibration_pictures": done.is_judged_by_same,
        "float_nodes": done.kept_float,
        "size_bytes_before": done.bytes_before,
        "size_bytes_after": done.bytes_after,
        "network_cpu_ms_before": done.network_ms[0],
        "network_cpu_ms_after": done.network_ms[1],
        **agreement_numbers(done.agreement),
        "written": done.is_written,
    }
