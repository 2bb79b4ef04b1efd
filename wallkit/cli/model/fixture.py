"""`wallkit model fixture`: a model whose answers are known beforehand."""

from __future__ import annotations

from pathlib import Path

import click

from wallkit.cli import common
from wallkit.cli.model.words import size_from_words

FILE = click.Path(path_type=Path)


@click.command()
@click.argument("out", type=FILE, metavar="OUT.onnx")
@click.option("--classes", type=FILE, metavar="FILE.toml", help="`name = [r, g, b]` a line; else six usual ones.")
@click.option(
    "--imgsz",
    "size",
    default="320",
    show_default=True,
    callback=size_from_words,
    metavar="HxW",
    help="Input, multiples of 32.",
)
@click.option(
    "--layout",
    type=click.Choice(["yolo-anchors", "yolo-rows", "class-scores", "class-ids"]),
    default="yolo-anchors",
    show_default=True,
    help="What the outputs look like.",
)
@common.overwrite_option
@common.json_option
@common.dry_run_option
def fixture(
    out: Path,
    classes: Path | None,
    size: tuple[int, int],
    layout: str,
    overwrite: bool,
    as_json: bool,
    dry_run: bool,
) -> None:
    """Write a model of 5 kB that segments by flat colour: for tests, demos and simulated cameras. Needs `onnx`.

    It has no weights, so it is nobody's but yours, and its answer to a flat-coloured picture is known beforehand.

    \b
    Examples:
      wallkit model fixture oracle.onnx
      wallkit model fixture oracle.onnx --imgsz 192x320 --layout class-scores
      wallkit model fixture oracle.onnx --classes colours.toml
    """
    from wallkit.pipelines.outputs import check_file_out, write_whole
    from wallkit.segment.fixture import colours_of, oracle

    check_file_out(out, overwrite=overwrite)
    colours = colours_of(classes)
    data = oracle(colours, size, layout)
    if not dry_run:
        write_whole(out, data)
    if as_json:
        common.emit(
            {
                "file": out,
                "size_bytes": len(data),
                "layout": layout,
                "colours": {k: list(v) for k, v in colours.items()},
            }
        )
        return
    click.echo(
        f"{'would write' if dry_run else 'wrote'} {out}, {len(data) / 1e3:.1f} kB: {layout}, {size[0]} x {size[1]} px"
    )
    for name, colour in colours.items():
        click.echo(f"  {name.ljust(10)} {colour[0]:3d} {colour[1]:3d} {colour[2]:3d}")
