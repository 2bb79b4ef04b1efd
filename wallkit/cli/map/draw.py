"""`wallkit map show`: the floor plan as SVG, PNG or text."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from wallkit.cli import common
from wallkit.cli.map.words import FILE, PLANE

if TYPE_CHECKING:
    from wallkit.maps.model import SemanticMap
    from wallkit.pipelines.map.verdicts import Selection


@click.command()
@FILE
@common.out_option
@click.option(
    "--findings",
    "with_findings",
    is_flag=True,
    help="Mark the errors and warnings of `map validate`, by number and code.",
)
@click.option(
    "--z", "plane", type=PLANE, metavar="M|lidar", help="Bold what a plane at this height cuts, all else light."
)
@click.option("--names", is_flag=True, help="Write every link's name beside it.")
@click.option("--width", "width_px", type=click.IntRange(200, 8000), default=1000, show_default=True, help="In pixels.")
@common.config_option
@common.set_option
@common.overwrite_option
@common.dry_run_option
@common.color_option
@click.pass_context
def show(
    ctx: click.Context,
    /,
    file: Path,
    out: Path | None,
    with_findings: bool,
    plane: float | str | None,
    names: bool,
    width_px: int,
    config_path: Path | None,
    words: tuple[str, ...],
    overwrite: bool,
    dry_run: bool,
    color: str,
) -> None:
    """Draw the floor plan: walls to scale, doors with their swing, fixtures, rooms with areas, scale bar, north.

    PATH ends in .svg (in metres of the map frame, a group per link) or .png. Without it a preview is printed: coloured on
    a terminal, letters in a file.

    \b
    Examples:
      wallkit map show floor2.wkmap.urdf
      wallkit map show floor2.wkmap.urdf -o floor2.svg
      wallkit map show floor2.wkmap.urdf -o seen.png --z lidar
      wallkit map show floor2.wkmap.urdf -o wrong.svg --findings --overwrite
    """
    from wallkit.maps.draw.findings import MOST_MARKED
    from wallkit.maps.draw.plan import PlanSettings
    from wallkit.pipelines.map import draw as pipeline

    if out is not None:
        pipeline.check_target(out, overwrite=overwrite)
    semantic_map, findings = pipeline.map_with_findings(file, _selection(config_path, words) if with_findings else None)
    z_m = pipeline.plane_of(semantic_map, plane)
    if out is None:
        _print_preview(semantic_map, z_m, color)
        for number, finding in enumerate(findings, start=1):
            click.echo(f"{number} {finding.severity} {finding.code} line {finding.line}: {finding.message}")
    elif dry_run:
        click.echo(f"would write {out}")
    else:
        settings = PlanSettings(z_m=z_m, width_px=width_px, height_px=float(width_px), names=names)
        size = pipeline.write_plan(out, semantic_map, settings, findings)
        first = f"{MOST_MARKED} of " if len(findings) > MOST_MARKED else ""
        marked = f", {first}{len(findings)} findings marked" if with_findings else ""
        click.echo(f"wrote {out}: {size / 1000:.0f} kB{marked}")
    ctx.exit(common.OK)


# ------------------------------------------------------------------------------------------------ details


def _selection(config_path: Path | None, words: tuple[str, ...]) -> Selection:
    import datetime

    from wallkit.pipelines.config import load_config
    from wallkit.pipelines.map.verdicts import Selection

    today = datetime.datetime.now().astimezone().date()
    return Selection(load_config(config_path, words).config.rules, today)


def _print_preview(semantic_map: SemanticMap, z_m: float | None, color: str) -> None:
    """Half blocks where the terminal has colours, letters elsewhere."""
    import shutil

    from wallkit.maps.draw.text import cells_of, coloured_from_cells, plain_from_cells

    size = shutil.get_terminal_size((100, 40))
    columns, lines = max(20, min(size.columns - 1, 110)), max(12, min(size.lines - 4, 50))
    plan = cells_of(semantic_map, columns=columns, lines=lines, z_m=z_m)
    if common.console(color).color_system:
        click.echo(coloured_from_cells(plan, semantic_map), nl=False, color=True)
    else:
        click.echo(plain_from_cells(plan), nl=False)
