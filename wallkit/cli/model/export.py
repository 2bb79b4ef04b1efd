"""`wallkit model export`: a checkpoint of Ultralytics as an ONNX file, by an interpreter that has it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from wallkit.cli import common
from wallkit.cli.model.inspect import document as inspected_document
from wallkit.cli.model.inspect import page as inspected_page
from wallkit.cli.model.verify import document as verified_document
from wallkit.cli.model.verify import is_agreed, picture_options, pictures_from_flags
from wallkit.cli.model.verify import page as verified_page
from wallkit.cli.model.words import size_from_words

if TYPE_CHECKING:
    from wallkit.pipelines.model.export import Exported

FILE = click.Path(path_type=Path)


@click.command()
@click.argument("checkpoint", required=False, type=FILE, metavar="BEST.pt")
@click.option("-o", "--out", type=FILE, metavar="FILE", help="Else BEST.onnx beside it.")
@click.option("--imgsz", "size", callback=size_from_words, metavar="HxW", help="Input, in steps of 32; else 320.")
@click.option("--camera", type=FILE, metavar="FILE", help="Calibration: 320 along its longer side, no needless grey.")
@click.option(
    "--nms",
    "thinning",
    type=click.Choice(["raw", "in-graph", "none"]),
    default="raw",
    show_default=True,
    help="Overlapping boxes: left to wallkit, thinned inside the file, or an end-to-end head that has none.",
)
@click.option(
    "--images", multiple=True, type=FILE, metavar="FOLDER|LOG", help="Compare it with the checkpoint on these."
)
@picture_options
@click.option(
    "--python", type=FILE, metavar="FILE", help="Interpreter with Ultralytics; else WALLKIT_YOLO_PYTHON, or yolo's."
)
@click.option(
    "--trust", is_flag=True, help="Load all that the checkpoint holds, not only weights: it may run anything."
)
@click.option("--print-setup", is_flag=True, help="Print the commands that make such an interpreter, and end.")
@common.overwrite_option
@common.config_option
@common.set_option
@common.json_option
@common.quiet_option
@common.dry_run_option
@click.pass_context
def export(ctx: click.Context, /, checkpoint: Path | None, **flags: Any) -> None:
    """Export a YOLO-seg checkpoint to ONNX, look at what came out, and compare it with the checkpoint.

    Ultralytics is AGPL-3.0 and no part of wallkit: it runs in another interpreter as a child process, offline, installs
    nothing, and loads only weights unless --trust. Beside the ONNX a JSON file says how it was made.

    Exits 0 if it is what was asked for, 1 if it does not agree with the checkpoint on --images, 2 if it could not be done.

    \b
    Examples:
      wallkit model export --print-setup
      wallkit model export best.pt --python yv/bin/python --imgsz 192x320
      wallkit model export best.pt --camera front.toml --images log.mcap -o front.onnx
    """
    from wallkit.segment.child import SETUP

    if flags["print_setup"]:
        click.echo(SETUP, nl=False)
        return
    if checkpoint is None:
        raise click.UsageError("Missing argument 'BEST.pt'.")
    from wallkit.pipelines.config import load_config
    from wallkit.pipelines.model.export import check_request, export_model

    request = _request(checkpoint, flags)
    settings = load_config(flags["config_path"], flags["words"]).config.segment
    pictures = pictures_from_flags(flags["images"], flags) if flags["images"] else []
    if flags["dry_run"]:
        python = check_request(request).python
        click.echo(f"would run {python} and write {request.out} ({request.size[0]}x{request.size[1]}) and its .json")
        return
    with common.progress("comparing", len(pictures), quiet=flags["quiet"]) as update:
        done = export_model(request, settings, pictures, progress=update)
    if flags["as_json"]:
        common.emit(_document(done))
    else:
        click.echo("\n".join(_page(done, len(pictures))))
        for note in done.inspection.notes:
            common.warn(note, quiet=flags["quiet"])
    is_good = done.verified is None or is_agreed(done.verified.agreement)
    ctx.exit(common.OK if is_good else common.FAILED_CHECK)


# ------------------------------------------------------------------------------------------------ details


def _request(checkpoint: Path, flags: dict[str, Any]) -> Any:
    from wallkit.pipelines.model.export import ExportRequest, size_for_camera
    from wallkit.pipelines.outputs import check_file_out

    if flags["size"] is not None and flags["camera"] is not None:
        raise click.UsageError("take the size from one of --imgsz and --camera")
    out = flags["out"] or checkpoint.with_suffix(".onnx")
    for file in (out, out.with_suffix(".json")):
        check_file_out(file, overwrite=flags["overwrite"])
    size = size_for_camera(flags["camera"]) if flags["camera"] else flags["size"] or (320, 320)
    return ExportRequest(checkpoint, out, size, flags["thinning"], flags["python"], flags["trust"])


def _page(done: Exported, pictures: int) -> list[str]:
    versions = ", ".join(f"{name} {version}" for name, version in done.versions.items())
    lines = [*inspected_page(done.inspection), f"versions  {versions or 'not said'}", f"record    {done.record}"]
    if done.verified is None:
        return [*lines, "verify    not compared with the checkpoint: name pictures with --images"]
    verdict = (
        "agrees with the checkpoint" if is_agreed(done.verified.agreement) else "does NOT agree with the checkpoint"
    )
    return [*lines, "", *verified_page(done.verified, pictures), f"verdict  {verdict}"]


def _document(done: Exported) -> dict[str, Any]:
    return {
        **inspected_document(done.inspection),
        "record": done.record,
        "versions": done.versions,
        "verified": None if done.verified is None else verified_document(done.verified),
    }
