"""`wallkit map info`, `ls` and `import`: what is in a map, and maps from other programs' files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from wallkit.cli import common
from wallkit.cli.map.words import FILE, LENGTH

if TYPE_CHECKING:
    from wallkit.pipelines.map.look import ElementRow, MapInfo


@click.command()
@FILE
@common.json_option
def info(file: Path, as_json: bool) -> None:
    """Say what is in a map: level, extent, rooms, and how many elements of each class.

    The map must be sound as URDF; `wallkit map validate` says where it is not.

    \b
    Examples:
      wallkit map info floor2.wkmap.urdf
      wallkit map info floor2.wkmap.urdf --json | jq .classes
    """
    from dataclasses import asdict

    from wallkit.maps.read import load_map
    from wallkit.pipelines.map.look import info_of

    found = info_of(load_map(file))
    if as_json:
        rooms = [{"id": room, "kind": kind, "area_m2": area_m2} for room, kind, area_m2 in found.rooms]
        common.emit({**asdict(found), "rooms": rooms})
    else:
        click.echo("\n".join(_info_lines(found)))


@click.command()
@FILE
@click.option("--class", "class_name", metavar="CLASS", help="Only elements of this class.")
@click.option("--room", metavar="ID", help="Only elements that stand in, bound or name this room.")
@common.json_option
def ls(file: Path, class_name: str | None, room: str | None, as_json: bool) -> None:
    """List the elements of a map: class, place and heading in the map with every door at rest, heights, rooms.

    \b
    Examples:
      wallkit map ls floor2.wkmap.urdf
      wallkit map ls floor2.wkmap.urdf --class door --room restroom_m
      wallkit map ls floor2.wkmap.urdf --json | jq '.elements[] | select(.z_m[0] > 0.3).link'
    """
    from dataclasses import asdict

    from wallkit.maps.read import load_map
    from wallkit.pipelines.map.look import elements_of

    found = elements_of(load_map(file), class_name=class_name, room=room)
    if as_json:
        common.emit({"elements": [asdict(row) for row in found]})
        return
    headers = ["link", "class", "x", "y", "yaw", "heights", "on", "joint", "rooms"]
    click.echo(common.table(headers, [_element_cells(row) for row in found], right=(2, 3, 4)))


@click.command("import")
@FILE
@common.out_option
@click.option("--format", "format_name", metavar="rmf|pgm|lines|dxf|csv|urdf", help="Of FILE; else its content tells.")
@click.option("--units", metavar="m|cm|mm|in|ft", help="Of FILE's lengths; else as it declares.")
@click.option("--thickness", "thickness_m", type=LENGTH, metavar="M", help="Of walls drawn without one.")
@click.option("--height", "height_m", type=LENGTH, metavar="M", help="Of walls without one; else 2.5.")
@click.option(
    "--layer", "layers", multiple=True, metavar="NAME", help="Layer that holds walls, * allowed (repeatable)."
)
@click.option(
    "--tolerance", "tolerance_m", type=LENGTH, metavar="M", help="Of lines fitted to a raster; else one cell."
)
@click.option("--scan-plane", "scan_plane_m", type=LENGTH, metavar="M", help="Height of the LiDAR, for the header.")
@common.overwrite_option
@common.dry_run_option
@common.json_option
@click.pass_context
def import_(
    ctx: click.Context,
    /,
    file: Path,
    out: Path | None,
    format_name: str | None,
    overwrite: bool,
    dry_run: bool,
    as_json: bool,
    **given: object,
) -> None:
    """Make maps of another program's file, one per level, and say everything that was read, guessed and left out.

    Reads RMF building.yaml, map_server YAML + image, line lists, DXF, CSV of boxes and plain URDF. PATH is a .urdf file
    for a single level, else a folder.

    Exits 0 if done, 1 if the import itself found an error (a wrong unit), 2 if it could not be done.

    \b
    Examples:
      wallkit map import office.building.yaml -o maps/
      wallkit map import plan.dxf -o plan.wkmap.urdf --units in --layer 'A-WALL*'
      wallkit map import floor.yaml -o floor.wkmap.urdf --scan-plane 0.3 --dry-run
    """
    from dataclasses import asdict

    from wallkit.maps.importers import ImportOptions
    from wallkit.pipelines.map.importing import import_levels, write_levels

    if out is None:
        raise click.UsageError("say where to: -o map.wkmap.urdf, or a folder")
    options = ImportOptions(**{key: value for key, value in given.items() if value is not None})  # type: ignore[arg-type]
    levels, notes = import_levels(file, out, options, format_name=format_name, overwrite=overwrite)
    if not dry_run:
        write_levels(levels)
    if as_json:
        written = [
            {"level": level.draft.level, "file": level.path, "walls": len(level.draft.walls)} for level in levels
        ]
        common.emit({"files": written, "notes": [asdict(note) for note in notes]})
    else:
        for note in notes:
            click.echo(str(note))
        for level in levels:
            said = "would write" if dry_run else "wrote"
            walls = f", {len(level.draft.walls)} walls" if level.draft.walls else ""
            click.echo(f"{said} {level.path}: level {level.draft.level}{walls}")
    ctx.exit(common.FAILED_CHECK if any(note.severity == "error" for note in notes) else common.OK)


# ------------------------------------------------------------------------------------------------ details


def _info_lines(found: MapInfo) -> list[str]:
    """The page of `map info`."""
    plane = "unknown (scan_plane in <wk:map>)" if found.scan_plane_m is None else f"{found.scan_plane_m:g} m"
    elevation = "" if found.elevation_m is None else f", {found.elevation_m:g} m above datum"
    lines = [
        f"map      {found.name} ({found.file})",
        f"format   {'wkmap ' + found.format if found.format else 'plain URDF'}",
        f"level    {found.level or '-'}{elevation}",
        f"lidar    scan plane {plane}",
        f"survey   {found.survey or '-'}",
        f"extent   {_extent_text(found)}",
        f"links    {found.links}: {_counts(found.classes)}",
        f"joints   {_counts(found.joints) or '-'}",
        f"openings {_counts(found.openings) or '-'}",
        f"doors    {', '.join(found.doors) or '-'}",
    ]
    rooms = [f"{room} ({kind or 'no kind'}, {area_m2:.1f} m2)" for room, kind, area_m2 in found.rooms]
    lines.append(f"rooms    {', '.join(rooms) or '-'}")
    if found.inferred:
        lines.append(f"note     {found.inferred} elements do not say their class; it is taken from their names")
    if found.meshes:
        lines.append(f"note     {found.meshes} shapes are meshes; they are not in the extent")
    return lines


def _extent_text(found: MapInfo) -> str:
    if found.extent_m is None:
        return "- (no box, cylinder or sphere)"
    x0, y0, z0, x1, y1, z1 = found.extent_m
    size = f"{x1 - x0:.2f} x {y1 - y0:.2f} x {z1 - z0:.2f} m"
    return f"{size}: x {x0:.2f} ... {x1:.2f}, y {y0:.2f} ... {y1:.2f}, z {z0:.2f} ... {z1:.2f}"


def _counts(counts: dict[str, int]) -> str:
    return ", ".join(f"{count} {name}" for name, count in counts.items())


def _element_cells(row: ElementRow) -> list[str]:
    heights = "-" if row.z_m is None else f"{row.z_m[0]:.2f} ... {row.z_m[1]:.2f}"
    class_name = f"({row.class_name or 'none'})" if row.class_is_inferred else row.class_name
    return [
        row.link,
        class_name,
        f"{round(row.x_m, 3) + 0.0:.3f}",
        f"{round(row.y_m, 3) + 0.0:.3f}",
        f"{round(row.yaw_rad, 4) + 0.0:.4f}",
        heights,
        row.parent,
        row.joint,
        " ".join(row.rooms) or "-",
    ]
