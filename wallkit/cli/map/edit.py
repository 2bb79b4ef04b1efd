"""`wallkit map move`, `rotate`, `rename`, `remove`, `reparent`, `array` and `set`: elements that are there, changed."""

from __future__ import annotations

from pathlib import Path

import click

from wallkit.cli.map.words import ANGLE, FILE, LENGTH, POINT, POINT_3, edit_options, finish

NAME = click.argument("name", metavar="NAME")
leave_option = click.option(
    "--leave-children", is_flag=True, help="What hangs on it stays where it is in the map, instead of going along."
)


@click.command()
@FILE
@click.argument("names", nargs=-1, required=True, metavar="NAME...")
@click.option("--by", type=POINT_3, metavar="X,Y[,Z]", help="By so much.")
@click.option("--to", type=POINT_3, metavar="X,Y[,Z]", help="To this place in the map.")
@click.option("--along", type=LENGTH, metavar="M", help="By so much along what it hangs on: a wall, from its start.")
@click.option(
    "--frame",
    type=click.Choice(["map", "parent", "own"]),
    default="map",
    show_default=True,
    help="Whose axes --by means: the map's, those of what it hangs on, or its own.",
)
@leave_option
@edit_options
def move(
    file: Path,
    names: tuple[str, ...],
    by: tuple[float, ...] | None,
    to: tuple[float, ...] | None,
    along: float | None,
    frame: str,
    leave_children: bool,
    dry_run: bool,
    as_json: bool,
) -> None:
    """Move elements, or an opening along its wall with what fills it.

    \b
    Examples:
      wallkit map move floor2.wkmap.urdf toilet_1 --by 0,-0.3
      wallkit map move floor2.wkmap.urdf sink_1 mirror_1 --along 25cm
      wallkit map move floor2.wkmap.urdf d1 --along 0.4 --dry-run
    """
    from wallkit.maps.edit import place
    from wallkit.maps.edit.changes import Step
    from wallkit.maps.edit.cut import close_only, cut_declared
    from wallkit.pipelines.map.edit import edit_file, links_of

    if sum(given is not None for given in (by, to, along)) != 1:
        raise click.UsageError("say where to with one of --by X,Y, --to X,Y and --along M")
    words = (along,) if along is not None else by or ()
    x, y, z = (*words, 0.0, 0.0, 0.0)[:3]
    axes: place.Frame = "parent" if along is not None else frame  # type: ignore[assignment]  # one of the choices
    links = links_of(file)
    steps: list[Step] = []
    for name in names:
        if along is not None and name not in links:
            steps += [
                lambda c, n=name: close_only(c, n),  # type: ignore[misc]  # mypy knows no default of a lambda
                lambda c, n=name, m=along: place.move_opening(c, n, m),  # type: ignore[misc]
                lambda c, n=name: cut_declared(c, n, quiet=True),  # type: ignore[misc]
            ]
        elif to is not None:
            goal = (*to, None)[:3]
            steps.append(lambda c, n=name, g=goal: place.move_to(c, n, g, leave_children=leave_children))  # type: ignore[misc]
        else:
            steps.append(
                lambda c, n=name: place.move(c, n, (x, y, z), frame=axes, leave_children=leave_children)  # type: ignore[misc]
            )
    finish(edit_file(file, *steps), dry_run=dry_run, as_json=as_json)


@click.command()
@FILE
@NAME
@click.option("--by", type=ANGLE, required=True, metavar="ANGLE", help="Anticlockwise from above: 90deg, or radians.")
@click.option("--about", type=POINT, metavar="X,Y", help="About this place in the map; else about its own frame.")
@leave_option
@edit_options
def rotate(
    file: Path,
    name: str,
    by: float,
    about: tuple[float, float] | None,
    leave_children: bool,
    dry_run: bool,
    as_json: bool,
) -> None:
    """Turn an element about the upright axis.

    \b
    Examples:
      wallkit map rotate floor2.wkmap.urdf trash_1 --by 90deg
      wallkit map rotate floor2.wkmap.urdf wall_w --by -0.3deg --leave-children
    """
    from wallkit.maps.edit import place
    from wallkit.pipelines.map.edit import edit_file

    edited = edit_file(file, lambda c: place.rotate(c, name, by, about=about, leave_children=leave_children))
    finish(edited, dry_run=dry_run, as_json=as_json)


@click.command()
@FILE
@click.argument("old", metavar="OLD")
@click.argument("new", metavar="NEW")
@click.option(
    "--kind",
    type=click.Choice(["link", "joint", "room", "class", "opening"]),
    help="What OLD names, where several things have the name.",
)
@edit_options
def rename(file: Path, old: str, new: str, kind: str | None, dry_run: bool, as_json: bool) -> None:
    """Rename an element, joint, room, class or opening, and everything that refers to it.

    With an element go its parts (NAME.part) and its joint (at_NAME, NAME_hinge, NAME_slide).

    \b
    Examples:
      wallkit map rename floor2.wkmap.urdf door_m door_men
      wallkit map rename floor2.wkmap.urdf restroom_m men --kind room
    """
    from wallkit.maps.edit import rename as verb
    from wallkit.pipelines.map.edit import edit_file

    edited = edit_file(file, lambda c: verb.rename(c, old, new, kind))  # type: ignore[arg-type]  # one of the choices
    finish(edited, dry_run=dry_run, as_json=as_json)


@click.command()
@FILE
@click.argument("names", nargs=-1, required=True, metavar="NAME...")
@click.option("--recursive", is_flag=True, help="With everything that hangs on it.")
@edit_options
def remove(file: Path, names: tuple[str, ...], recursive: bool, dry_run: bool, as_json: bool) -> None:
    """Remove elements with their joints, rooms or classes, and every reference to them.

    What an element filled stays open; `wallkit map fill` closes an opening.

    \b
    Examples:
      wallkit map remove floor2.wkmap.urdf urinal_1
      wallkit map remove floor2.wkmap.urdf wall_mid --recursive --dry-run
    """
    from wallkit.maps.edit import tree
    from wallkit.pipelines.map.edit import edit_file

    steps = [lambda c, n=name: tree.remove(c, n, recursive=recursive) for name in names]
    finish(edit_file(file, *steps), dry_run=dry_run, as_json=as_json)


@click.command()
@FILE
@NAME
@click.option("--to", "parent", required=True, metavar="PARENT", help="What it shall hang on.")
@edit_options
def reparent(file: Path, name: str, parent: str, dry_run: bool, as_json: bool) -> None:
    """Hang an element on another one; it keeps its place in the map.

    \b
    Examples:
      wallkit map reparent floor2.wkmap.urdf dispenser_1 --to wall_n
    """
    from wallkit.maps.edit import tree
    from wallkit.pipelines.map.edit import edit_file

    finish(edit_file(file, lambda c: tree.reparent(c, name, parent)), dry_run=dry_run, as_json=as_json)


@click.command()
@FILE
@NAME
@click.option("--count", type=int, required=True, metavar="N", help="How many there are then, NAME the first.")
@click.option("--pitch", type=LENGTH, metavar="M", help="From one to the next along what they hang on; - is backwards.")
@click.option(
    "--step", type=POINT_3, metavar="X,Y[,Z]", help="The same for what stands free: along the axes of its parent."
)
@edit_options
def array(
    file: Path,
    name: str,
    count: int,
    pitch: float | None,
    step: tuple[float, ...] | None,
    dry_run: bool,
    as_json: bool,
) -> None:
    """Copy an element into a row: urinals on a wall, columns in a hall.

    \b
    Examples:
      wallkit map array floor2.wkmap.urdf urinal_1 --count 4 --pitch -0.75
      wallkit map array floor2.wkmap.urdf column_1 --count 3 --step 0,4
    """
    from wallkit.maps.edit import copy
    from wallkit.pipelines.map.edit import edit_file

    if (pitch is None) == (step is None):
        raise click.UsageError("say how far apart with one of --pitch M and --step X,Y")
    words = (pitch,) if pitch is not None else step or ()
    x, y, z = (*words, 0.0, 0.0)[:3]
    finish(edit_file(file, lambda c: copy.array(c, name, count, (x, y, z))), dry_run=dry_run, as_json=as_json)


@click.command("set")
@FILE
@NAME
@click.argument("values", nargs=-1, required=True, metavar="KEY=VALUE...")
@edit_options
def set_(file: Path, name: str, values: tuple[str, ...], dry_run: bool, as_json: bool) -> None:
    """Set what is said of an element, room, class or opening; NAME `map` is the header. An empty VALUE takes KEY out.

    \b
    Examples:
      wallkit map set floor2.wkmap.urdf window_n class=glass sigma=0.02
      wallkit map set floor2.wkmap.urdf door_m prior='closed:0.5 open:0.5' upper=1.92
      wallkit map set floor2.wkmap.urdf map scan_plane=0.28 level=2
      wallkit map set floor2.wkmap.urdf door seg='2 9'
    """
    from wallkit.maps.edit.values import set_values
    from wallkit.pipelines.map.edit import edit_file

    words = dict(value.partition("=")[::2] for value in values)
    if wrong := [value for value in values if "=" not in value]:
        raise click.UsageError(f"'{wrong[0]}' is not KEY=VALUE")
    finish(edit_file(file, lambda c: set_values(c, name, words)), dry_run=dry_run, as_json=as_json)
