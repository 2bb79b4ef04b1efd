"""`wallkit map adopt`, `scale` and `origin`: a whole file made a map, in metres, in a frame of its own."""

from __future__ import annotations

from pathlib import Path

import click

from wallkit.cli import common
from wallkit.cli.map.words import ANGLE, FILE, LENGTH, POSE, edit_options, finish


@click.command()
@FILE
@click.option("--class", "classes", multiple=True, metavar="NAME=CLASS", help="Of elements whose name does not tell.")
@click.option("--level", default="1", show_default=True, help="Name of the level, for the header.")
@click.option(
    "--elevation", type=LENGTH, default=0.0, show_default=True, metavar="M", help="Its floor, for the header."
)
@click.option("--scan-plane", type=LENGTH, metavar="M", help="Height of the LiDAR, for the header.")
@edit_options
def adopt(
    file: Path,
    classes: tuple[str, ...],
    level: str,
    elevation: float,
    scan_plane: float | None,
    dry_run: bool,
    as_json: bool,
) -> None:
    """Make a plain URDF a semantic map: a header, and the class of every element as its name tells.

    \b
    Examples:
      wallkit map adopt apartment.urdf --scan-plane 0.3
      wallkit map adopt apartment.urdf --class island=furniture --dry-run
    """
    from wallkit.maps.edit import adopt as verb
    from wallkit.pipelines.map.edit import edit_file

    if wrong := [value for value in classes if "=" not in value]:
        raise click.UsageError(f"'{wrong[0]}' is not NAME=CLASS")
    words = dict(value.partition("=")[::2] for value in classes)
    edited = edit_file(
        file, lambda c: verb.adopt(c, words, level=level, elevation_m=elevation, scan_plane_m=scan_plane)
    )
    finish(edited, dry_run=dry_run, as_json=as_json)


@click.command()
@FILE
@click.argument("factor", type=common.Number(), metavar="FACTOR")
@click.argument("names", nargs=-1, metavar="[NAME]...")
@edit_options
def scale(file: Path, factor: float, names: tuple[str, ...], dry_run: bool, as_json: bool) -> None:
    """Multiply every length of a map by a factor; with NAMEs only the shapes of these elements.

    For maps in another unit: 0.001 from millimetres, 0.01 from centimetres, 0.0254 from inches. The header's elevation,
    scan plane and survey stay.

    \b
    Examples:
      wallkit map scale plan.wkmap.urdf 0.001
      wallkit map scale floor2.wkmap.urdf 0.001 sink_3
    """
    from wallkit.maps.edit import units
    from wallkit.pipelines.map.edit import edit_file

    finish(edit_file(file, lambda c: units.scale(c, factor, names)), dry_run=dry_run, as_json=as_json)


@click.command()
@FILE
@click.option("--to", type=POSE, metavar="X,Y[,YAW]", help="Where the new frame sits in the old one.")
@click.option("--to-corner", is_flag=True, help="The corner of the data in whole metres; so without any option.")
@click.option("--epsg", type=int, metavar="CODE", help="The projected system of --east and --north.")
@click.option("--east", type=LENGTH, metavar="M", help="Of the (new) origin on Earth.")
@click.option("--north", type=LENGTH, metavar="M", help="Of the (new) origin on Earth.")
@click.option("--yaw", type=ANGLE, metavar="ANGLE", help="From east to the map's x axis.")
@click.option("--kind", type=click.Choice(["none", "surveyed", "georef"]), help="How the place on Earth is known.")
@edit_options
def origin(
    file: Path,
    to: tuple[float, ...] | None,
    to_corner: bool,
    epsg: int | None,
    east: float | None,
    north: float | None,
    yaw: float | None,
    kind: str | None,
    dry_run: bool,
    as_json: bool,
) -> None:
    """Move the map's frame, and say where it lies on Earth; every element keeps its place in the building.

    With survey coordinates in the file (<wk:origin>) these follow the frame.

    \b
    Examples:
      wallkit map origin utm.wkmap.urdf
      wallkit map origin floor2.wkmap.urdf --to 1.2,0,90deg
      wallkit map origin floor2.wkmap.urdf --epsg 32654 --east 382145.2 --north 3948811.75 --yaw 15deg
    """
    from wallkit.maps.edit import origin as verb
    from wallkit.maps.edit.changes import Step
    from wallkit.pipelines.map.edit import edit_file

    if to is not None and to_corner:
        raise click.UsageError("--to and --to-corner say the same thing twice")
    given = verb.Survey(kind, epsg, east, north, yaw)
    is_survey = given != verb.Survey()
    steps: list[Step] = []
    if to is not None or to_corner or not is_survey:
        pose = None if to is None else (to[0], to[1], to[2] if len(to) > 2 else 0.0)
        steps.append(lambda c: verb.reorigin(c, pose))
    if is_survey:
        steps.append(lambda c: verb.survey(c, given))
    finish(edit_file(file, *steps), dry_run=dry_run, as_json=as_json)
