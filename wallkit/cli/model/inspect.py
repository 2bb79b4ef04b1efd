"""`wallkit model inspect`: what is this ONNX file, and can it be used?"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from wallkit.cli import common

if TYPE_CHECKING:
    from wallkit.segment.inspection import Inspection

FILE = click.Path(path_type=Path)
_MOST_NAMES = 8


@click.command()
@click.argument("model", type=FILE, metavar="MODEL.onnx")
@click.option("--require", default="", metavar="ROLES", help="Roles that it must have a class for: wall,door.")
@common.config_option
@common.set_option
@common.json_option
@common.quiet_option
@click.pass_context
def inspect(
    ctx: click.Context,
    model: Path,
    require: str,
    config_path: Path | None,
    words: tuple[str, ...],
    as_json: bool,
    quiet: bool,
) -> None:
    """Say what a model wants and answers, what its classes count as, and under which licence it stands.

    The layout of the outputs is read from the file. Exits 0 if the model can be used, 1 if it lacks a role of --require,
    2 if it is no segmentation model.

    \b
    Examples:
      wallkit model inspect best.onnx
      wallkit model inspect best.onnx --require wall,door
      wallkit model inspect best.onnx --set 'segment.roles.wall=["cladding", "tiles"]'
    """
    from wallkit.errors import ConfigError, closest
    from wallkit.pipelines.config import load_config
    from wallkit.segment.inspection import inspect_model
    from wallkit.segment.roles import Roles

    wanted = tuple(role for role in require.replace(",", " ").split() if role)
    for role in wanted:
        if role not in Roles.names():
            raise ConfigError(f"no role is called '{role}'", where="--require", hint=closest(role, Roles.names()))
    found = inspect_model(model, load_config(config_path, words).config.segment)
    lacking = found.lacking(wanted)
    if as_json:
        common.emit({**document(found), "lacking_roles": list(lacking)})
    else:
        click.echo("\n".join(page(found)))
        if wanted:
            click.echo(
                f"required  {_listed(wanted)}: "
                + (f"no class counts as {_listed(lacking)}" if lacking else "all there")
            )
        for note in found.notes:
            common.warn(note, quiet=quiet)
    ctx.exit(common.FAILED_CHECK if lacking else common.OK)


def page(found: Inspection) -> list[str]:
    """What a person reads."""
    segmenter, graph = found.segmenter, found.graph
    model = segmenter.model
    height, width = segmenter.size
    open_size = None in model.inputs[0].shape[2:]
    version = model.metadata.get("version", "")
    lines = [
        f"file      {model.path}, {found.size_bytes / 1e6:.1f} MB, sha256 {found.sha256[:16]}",
        f"made by   {' '.join(w for w in (model.metadata.get('author', model.producer), version) if w) or 'nobody named'};"
        f" {graph.parameters / 1e6:.2f} M parameters, opset {graph.opset}" + (", 8-bit" if graph.is_quantised else ""),
        f"licence   {found.licence or 'not said'}",
        f"layout    {segmenter.layout}: {_says(segmenter.layout)}",
        f"input     {model.inputs[0]}: RGB, {_range(segmenter)}, {width} x {height} px"
        + (" (any multiple of 32)" if open_size else ""),
    ]
    lines += [f"output    {tensor}: {meaning}" for tensor, meaning in found.outputs]
    if segmenter.layout.startswith("yolo"):
        lines.append(f"thinned   {_thinning(found)}")
    names = [name for name in segmenter.names if name != "background"]
    lines += [f"classes   {len(names)}, and what they count as:"]
    rows = [[f"  {role}", _shortened(words)] for role, words in found.role_words().items() if role != "background"]
    return [*lines, *(f"{role.ljust(12)}  {text}" for role, text in rows)]


def document(found: Inspection) -> dict[str, Any]:
    """What a program reads."""
    segmenter, graph = found.segmenter, found.graph
    model = segmenter.model
    return {
        "file": model.path,
        "size_bytes": found.size_bytes,
        "sha256": found.sha256,
        "layout": segmenter.layout,
        "input": {"name": model.inputs[0].name, "shape": model.inputs[0].shape, "dtype": model.inputs[0].dtype},
        "input_size_px": list(segmenter.size),
        "outputs": [
            {"name": t.name, "shape": t.shape, "dtype": t.dtype, "meaning": meaning} for t, meaning in found.outputs
        ],
        "classes": [
            {"id": k, "name": name, "role": role}
            for k, (name, role) in enumerate(zip(segmenter.names, segmenter.roles, strict=True))
            if name != "background"
        ],
        "licence": found.licence,
        "opset": graph.opset,
        "ir_version": graph.ir_version,
        "parameters": graph.parameters,
        "is_quantised": graph.is_quantised,
        "nodes": graph.nodes,
        "baked_min_score": graph.min_score,
        "baked_max_overlap": graph.max_overlap,
        "metadata": dict(model.metadata),
        "notes": list(found.notes),
    }


# ------------------------------------------------------------------------------------------------ details


def _says(layout: str) -> str:
    from wallkit.segment.layouts import LAYOUTS

    return LAYOUTS[layout].says


def _range(segmenter: Any) -> str:
    mean, std = segmenter.preparation.mean, segmenter.preparation.std
    if mean == (0, 0, 0) and std == (1, 1, 1):
        return "0 to 1"
    return f"0 to 1, less {_numbers(mean)}, by {_numbers(std)}"


def _thinning(found: Inspection) -> str:
    graph, settings = found.graph, found.segmenter.settings
    if graph.max_overlap is not None:
        least = "" if graph.min_score is None else f", score above {graph.min_score:g}"
        return f"inside the file: overlap (IoU) up to {graph.max_overlap:g}{least}; then score above {settings.min_score:g}"
    if found.segmenter.layout == "yolo-rows":
        return f"end-to-end, nothing is left to thin; score above {settings.min_score:g}"
    return f"by wallkit: score above {settings.min_score:g}, overlap (IoU) up to {settings.max_overlap:g}"


def _numbers(values: tuple[float, ...]) -> str:
    return " ".join(f"{value:g}" for value in values)


def _shortened(words: list[str]) -> str:
    more = len(words) - _MOST_NAMES
    return ", ".join(words[:_MOST_NAMES]) + (f" and {more} more" if more > 0 else "")


def _listed(words: tuple[str, ...]) -> str:
    return ", ".join(words)
