"""`wallkit map export`: a map as files of other programs."""

from __future__ import annotations

from pathlib import Path

import click

from wallkit.cli import common
from wallkit.cli.map.words import FILE, HEIGHT, Number

FORMATS = "pgm|fields|urdf|svg|geojson|sdf|rmf"


@click.command("export")
@FILE
@common.out_option
@click.option("--format", "format_name", metavar=FORMATS, help="Of PATH; else its suffix tells.")
@click.option("--z", "z_m", type=HEIGHT, metavar="M", help="Height of the cut; else the scan plane.")
@click.option(
    "--resolution",
    "cell_m",
    type=Number("length", above=0.0),
    metavar="M",
    help="Side of a cell; else 0.05 (pgm), 0.025 (fields).",
)
@click.option(
    "--doors",
    type=click.Choice(["closed", "open", "rest", "prior"]),
    help="How doors stand; prior draws them as probabilities (pgm).  [default: closed (pgm), else rest]",
)
@click.option("--solid", "is_solid", is_flag=True, help="Insides of walls are occupied too (pgm).")
@click.option(
    "--crs",
    type=click.Choice(["local", "epsg", "wgs84"]),
    default="local",
    show_default=True,
    help="Coordinates: metres of the map, of its <wk:origin>, or degrees (geojson).",
)
@common.overwrite_option
@common.dry_run_option
@common.json_option
def export(
    *,
    file: Path,
    out: Path | None,
    format_name: str | None,
    overwrite: bool,
    dry_run: bool,
    as_json: bool,
    **given: object,
) -> None:
    """Write a map as another program's files, and say everything that those cannot hold.

    \b
    pgm      map_server raster: PATH.yaml and PATH.pgm; only surfaces that free space sees
    fields   a folder of distance fields per class: fields.npz, a PNG each, fields.json
    urdf     the map itself with <visual>s coloured by class; no byte of it changes
    svg      a drawing to scale
    geojson  a feature for every element, opening and room
    sdf      a static model for Gazebo (SDFormat 1.9)
    rmf      Open-RMF building.yaml

    Exits 0 if done, 2 if it could not be done (the map has errors of the groups X, S, G; nothing is cut at this height).

    \b
    Examples:
      wallkit map export floor2.wkmap.urdf -o floor2.yaml --doors open
      wallkit map export floor2.wkmap.urdf -o floor2.yaml --z 0.85 --resolution 0.02
      wallkit map export floor2.wkmap.urdf -o fields/ --format fields
      wallkit map export floor2.wkmap.urdf -o floor2.geojson --crs wgs84
      wallkit map export floor2.wkmap.urdf -o floor2.building.yaml --dry-run
    """
    from dataclasses import asdict

    from wallkit.maps.exporters import ExportOptions
    from wallkit.pipelines.map.export import plan_export, write_export

    if out is None:
        raise click.UsageError("say where to: -o floor.yaml, floor.sdf, ...")
    options = ExportOptions(**{key: value for key, value in given.items() if value is not None})  # type: ignore[arg-type]
    plan = plan_export(file, out, options, format_name=format_name, overwrite=overwrite)
    if not dry_run:
        write_export(plan)
    exported = plan.exported
    if as_json:
        files = [{"file": path, "bytes": len(data)} for path, data in exported.files.items()]
        common.emit({"files": files, "notes": [asdict(note) for note in exported.notes]})
        return
    for note in exported.notes:
        click.echo(str(note))
    for path, data in exported.files.items():
        click.echo(f"{'would write' if dry_run else 'wrote'} {path}: {len(data):,} bytes")
