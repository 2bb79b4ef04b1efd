"""`wallkit map cut`, `fill`, `split`, `join` and `snap`: walls and the holes in them."""

from __future__ import annotations

from pathlib import Path

import click

from wallkit.cli.map.words import ANGLE, FILE, LENGTH, edit_options, finish

at_option = click.option("--at", type=LENGTH, metavar="M", help="Where it begins, from the wall's start.")
width_option = click.option("--width", type=LENGTH, metavar="M", help="How wide it is.")


@click.command()
@FILE
@click.argument("wall", metavar="WALL")
@click.argument("opening", default="", metavar="[ID]")
@at_option
@width_option
@click.option("--sill", type=LENGTH, default=0.0, metavar="M", help="How far above the wall's floor it begins; else 0.")
@click.option("--height", type=LENGTH, metavar="M", help="How high it is; else up to the wall's top.")
@click.option(
    "--kind",
    type=click.Choice(["door", "window", "passage"]),
    default="passage",
    show_default=True,
    help="What it is for.",
)
@edit_options
def cut(
    file: Path,
    wall: str,
    opening: str,
    at: float | None,
    width: float | None,
    sill: float,
    height: float | None,
    kind: str,
    dry_run: bool,
    as_json: bool,
) -> None:
    """Cut an opening into a wall: it is declared, and the wall's boxes leave exactly that hole.

    With the ID of an opening that is declared, and no --at, only the boxes are cut (WK-O001).

    \b
    Examples:
      wallkit map cut floor2.wkmap.urdf wall_e --at 1 --width 1.2 --height 2.1
      wallkit map cut floor2.wkmap.urdf wall_mid d1
    """
    from wallkit.maps.edit import cut as verb
    from wallkit.maps.edit.add_openings import Place, new_opening
    from wallkit.maps.edit.changes import Changes
    from wallkit.maps.edit.lookup import wall_named
    from wallkit.maps.rules.base import Context
    from wallkit.pipelines.map.edit import edit_file

    if opening and at is None and width is None:
        finish(edit_file(file, lambda c: verb.cut_declared(c, opening, wall)), dry_run=dry_run, as_json=as_json)
        return
    if at is None or width is None:
        raise click.UsageError("say where: --at M --width M, or the ID of an opening that is declared")

    def step(context: Context) -> Changes:
        top = wall_named(context, wall).bounds[3] if height is None else sill + height
        place = Place(wall, (at, at + width), (sill, top))
        return verb.cut(context, wall, new_opening(context, place, kind, opening))  # type: ignore[arg-type]  # a choice

    finish(edit_file(file, step), dry_run=dry_run, as_json=as_json)


@click.command()
@FILE
@click.argument("opening", metavar="ID")
@click.option("--in", "wall", default="", metavar="WALL", help="Its wall, where several have an opening of that ID.")
@click.option("--recursive", is_flag=True, help="With the door or pane that fills it.")
@edit_options
def fill(file: Path, opening: str, wall: str, recursive: bool, dry_run: bool, as_json: bool) -> None:
    """Close an opening: its declaration goes, and the wall's boxes join over the hole. Undoes a cut.

    \b
    Examples:
      wallkit map fill floor2.wkmap.urdf p1
      wallkit map fill floor2.wkmap.urdf win1 --recursive
    """
    from wallkit.maps.edit import cut as verb
    from wallkit.pipelines.map.edit import edit_file

    edited = edit_file(file, lambda c: verb.fill(c, opening, wall, recursive=recursive))
    finish(edited, dry_run=dry_run, as_json=as_json)


@click.command()
@FILE
@click.argument("wall", metavar="WALL")
@click.option("--at", type=LENGTH, required=True, metavar="M", help="Where, from the wall's start.")
@click.option("--name", default="", metavar="NEW", help="Of the part behind; else WALL_b.")
@edit_options
def split(file: Path, wall: str, at: float, name: str, dry_run: bool, as_json: bool) -> None:
    """Split a wall in two: openings, doors and fixtures go with the part they stand in.

    \b
    Examples:
      wallkit map split floor2.wkmap.urdf wall_n --at 3.5 --name wall_ne
    """
    from wallkit.maps.edit import walls
    from wallkit.pipelines.map.edit import edit_file

    finish(edit_file(file, lambda c: walls.split(c, wall, at, name)), dry_run=dry_run, as_json=as_json)


@click.command()
@FILE
@click.argument("first", metavar="FIRST")
@click.argument("second", metavar="SECOND")
@edit_options
def join(file: Path, first: str, second: str, dry_run: bool, as_json: bool) -> None:
    """Join two walls in line, of which SECOND goes on where FIRST ends, under the name FIRST.

    \b
    Examples:
      wallkit map join floor2.wkmap.urdf wall_n wall_ne
    """
    from wallkit.maps.edit import walls
    from wallkit.pipelines.map.edit import edit_file

    finish(edit_file(file, lambda c: walls.join(c, first, second)), dry_run=dry_run, as_json=as_json)


@click.command()
@FILE
@click.option("--gap", type=LENGTH, metavar="M", help="Wall ends up to so far apart are meant to meet; else 0.3 m.")
@click.option(
    "--angle", type=ANGLE, metavar="ANGLE", help="Angles so near to a right one are meant to be one; else 1deg."
)
@click.option("--no-angles", is_flag=True, help="Leave the angles as they are.")
@click.option("--no-gaps", is_flag=True, help="Leave the gaps as they are.")
@edit_options
def snap(
    file: Path,
    gap: float | None,
    angle: float | None,
    no_angles: bool,
    no_gaps: bool,
    dry_run: bool,
    as_json: bool,
) -> None:
    """Make nearly right angles between walls exact, then extend wall ends to the walls they stop short of.

    Angles are made square to the direction that most walls have; what hangs on a wall turns with it.

    \b
    Examples:
      wallkit map snap floor2.wkmap.urdf --dry-run
      wallkit map snap imported.wkmap.urdf --gap 0.15 --angle 0.5deg
    """
    from wallkit.maps.edit.snap import snap_steps
    from wallkit.pipelines.map.edit import edit_file

    if no_angles and no_gaps:
        raise click.UsageError("with --no-angles and --no-gaps nothing is left to do")
    steps = snap_steps(within_rad=angle, gap_m=gap, right_angles=not no_angles, gaps=not no_gaps)
    finish(edit_file(file, *steps), dry_run=dry_run, as_json=as_json)
