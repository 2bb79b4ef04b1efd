"""`wallkit map new` and `add`: a map from a template, and walls, doors, windows, fixtures, rooms and classes in it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from wallkit.cli import common
from wallkit.cli.map.walls import at_option, width_option
from wallkit.cli.map.words import BOX, FILE, LENGTH, POINT, POSE, edit_options, finish

if TYPE_CHECKING:
    from wallkit.maps.edit.add_openings import Place

wall_option = click.option("--in", "wall", required=True, metavar="WALL", help="The wall it is cut into.")
name_option = click.argument("name", default="", metavar="[NAME]")
opening_option = click.option(
    "--opening", default="", metavar="ID", help="Of the new opening; or one that is there, without --at and --width."
)


@click.command()
@FILE
@click.option(
    "--template",
    type=click.Choice(["room", "corridor", "restroom"]),
    default="room",
    show_default=True,
    help="What to draw.",
)
@click.option("--size", type=POINT, default="5,4", show_default=True, metavar="X,Y", help="Free floor along x and y.")
@click.option("--height", type=LENGTH, default=2.7, show_default=True, metavar="M", help="Of the walls.")
@click.option("--thickness", type=LENGTH, default=0.12, show_default=True, metavar="M", help="Of the walls.")
@click.option("--door", type=LENGTH, default=0.9, show_default=True, metavar="M", help="Width of the doors.")
@click.option("--corridor", type=LENGTH, default=2.0, show_default=True, metavar="M", help="Before a restroom.")
@click.option("--toilets", type=int, default=2, show_default=True, help="In a restroom.")
@click.option("--urinals", type=int, default=2, show_default=True, help="In a restroom.")
@click.option("--sinks", type=int, default=2, show_default=True, help="In a restroom, each with a mirror.")
@click.option("--level", default="1", show_default=True, help="Name of the level, for the header.")
@click.option("--scan-plane", type=LENGTH, default=0.3, show_default=True, metavar="M", help="Height of the LiDAR.")
@click.option("--name", default="", metavar="NAME", help="Of the map; else of the file.")
@common.overwrite_option
@edit_options
def new(
    file: Path,
    template: str,
    size: tuple[float, float],
    name: str,
    overwrite: bool,
    dry_run: bool,
    as_json: bool,
    **given: float,
) -> None:
    """Write a new map from a template: walls with closed corners, doors, rooms; a restroom with its fixtures.

    \b
    Examples:
      wallkit map new office.wkmap.urdf --size 6,4.5
      wallkit map new hall.wkmap.urdf --template corridor --size 20,2.4 --scan-plane 0.25
      wallkit map new wc.wkmap.urdf --template restroom --size 5,4 --toilets 3 --urinals 0
    """
    from wallkit.maps.edit.templates import TemplateSizes
    from wallkit.pipelines.map.edit import new_file

    level, counts = given.pop("level"), {key: given.pop(key) for key in ("toilets", "urinals", "sinks")}
    lengths = {f"{key}_m": value for key, value in given.items()}
    words = {**lengths, **counts, "length_m": size[0], "width_m": size[1], "level": level}
    sizes = TemplateSizes(**words)  # type: ignore[arg-type]  # click made their types
    finish(new_file(file, template, sizes, name=name, overwrite=overwrite), dry_run=dry_run, as_json=as_json)


@click.group()
def add() -> None:
    """Add to a map: walls, doors, windows, fixtures, rooms and classes."""


@add.command()
@FILE
@click.argument("name", metavar="NAME")
@click.option("--from", "start", type=POINT, required=True, metavar="X,Y", help="Start of its axis in the map.")
@click.option("--to", "end", type=POINT, required=True, metavar="X,Y", help="End of its axis.")
@click.option("--thickness", type=LENGTH, default=0.12, show_default=True, metavar="M", help="How thick it is.")
@click.option("--height", type=LENGTH, default=2.7, show_default=True, metavar="M", help="How high it is.")
@click.option("--class", "class_name", default="wall", show_default=True, metavar="CLASS", help="What it is.")
@edit_options
def wall(
    file: Path,
    name: str,
    start: tuple[float, float],
    end: tuple[float, float],
    thickness: float,
    height: float,
    class_name: str,
    dry_run: bool,
    as_json: bool,
) -> None:
    """Add a straight wall. An end drawn into another wall stops at that wall's face.

    \b
    Examples:
      wallkit map add wall floor2.wkmap.urdf wall_x --from 2.5,0 --to 2.5,2
    """
    from wallkit.maps.draft.draft import DraftWall
    from wallkit.maps.edit.add import add_wall
    from wallkit.pipelines.map.edit import edit_file

    drawn = DraftWall(name, start, end, thickness, height, class_name=class_name)
    finish(edit_file(file, lambda c: add_wall(c, drawn)), dry_run=dry_run, as_json=as_json)


@add.command()
@FILE
@name_option
@wall_option
@at_option
@width_option
@click.option("--height", type=LENGTH, default=2.1, show_default=True, metavar="M", help="How high the opening is.")
@opening_option
@click.option("--swing", default="in", show_default=True, metavar="SIDE", help="in (left of the wall), out, or a room.")
@click.option(
    "--hinge",
    type=click.Choice(["left", "right"]),
    default="left",
    show_default=True,
    help="Seen from outside looking in: left is towards the wall's start. A sliding door slides that way.",
)
@click.option(
    "--motion",
    type=click.Choice(["hinged", "double_hinged", "sliding", "double_sliding"]),
    default="hinged",
    show_default=True,
    help="How it opens.",
)
@click.option("--connects", metavar="ROOM,ROOM", help="Else the rooms on its two sides.")
@edit_options
def door(
    file: Path,
    name: str,
    wall: str,
    at: float | None,
    width: float | None,
    height: float,
    opening: str,
    swing: str,
    hinge: str,
    motion: str,
    connects: str | None,
    dry_run: bool,
    as_json: bool,
) -> None:
    """Add a door: its opening is cut, its leaf hangs on the face it opens to, 1 cm clear all round.

    \b
    Examples:
      wallkit map add door floor2.wkmap.urdf --in wall_mid --at 1.0 --width 0.9 --swing in --hinge left
      wallkit map add door floor2.wkmap.urdf door_w --in wall_e --at 3 --width 1.6 --motion double_hinged --swing corridor
      wallkit map add door floor2.wkmap.urdf --in wall_e --opening p1
    """
    from wallkit.maps.edit.add_openings import DoorWords, add_door
    from wallkit.pipelines.map.edit import edit_file

    place = _place(wall, at, width, (0.0, height), opening)
    rooms = tuple(connects.replace(",", " ").split()) if connects else ()
    words = DoorWords(name, motion, swing, hinge, rooms)  # type: ignore[arg-type]  # choices
    finish(edit_file(file, lambda c: add_door(c, place, words)), dry_run=dry_run, as_json=as_json)


@add.command()
@FILE
@name_option
@wall_option
@at_option
@width_option
@click.option("--sill", type=LENGTH, default=1.0, show_default=True, metavar="M", help="Above the wall's floor.")
@click.option("--height", type=LENGTH, default=1.0, show_default=True, metavar="M", help="How high the opening is.")
@opening_option
@click.option("--class", "class_name", default="glass", show_default=True, metavar="CLASS", help="Of the pane.")
@edit_options
def window(
    file: Path,
    name: str,
    wall: str,
    at: float | None,
    width: float | None,
    sill: float,
    height: float,
    opening: str,
    class_name: str,
    dry_run: bool,
    as_json: bool,
) -> None:
    """Add a window: its opening is cut, and a pane of 1 cm fills it.

    \b
    Examples:
      wallkit map add window floor2.wkmap.urdf window_n --in wall_n --at 2 --width 1.2
    """
    from wallkit.maps.edit.add_openings import add_window
    from wallkit.pipelines.map.edit import edit_file

    place = _place(wall, at, width, (sill, sill + height), opening)
    edited = edit_file(file, lambda c: add_window(c, place, name=name, class_name=class_name))
    finish(edited, dry_run=dry_run, as_json=as_json)


@add.command()
@FILE
@click.argument("class_name", metavar="CLASS")
@name_option
@click.option("--in", "wall", metavar="WALL", help="The wall it is fixed to.")
@click.option("--at", type=LENGTH, metavar="M", help="Its middle, from the wall's start.")
@click.option("--side", default="", metavar="SIDE", help="left or right of the wall, or a room; else the only room.")
@click.option("--pose", type=POSE, metavar="X,Y[,YAW]", help="Of what stands free: its middle in the map.")
@click.option("--size", type=BOX, metavar="DEEP,WIDE,HIGH", help="Else usual for CLASS.")
@click.option("--bottom", type=LENGTH, metavar="M", help="Its underside above the floor; else usual for CLASS.")
@edit_options
def fixture(
    file: Path,
    class_name: str,
    name: str,
    wall: str | None,
    at: float | None,
    side: str,
    pose: tuple[float, ...] | None,
    size: tuple[float, float, float] | None,
    bottom: float | None,
    dry_run: bool,
    as_json: bool,
) -> None:
    """Add a box of a class, its back on a wall or standing free.

    \b
    Examples:
      wallkit map add fixture floor2.wkmap.urdf urinal --in wall_w --at 4 --side restroom_m
      wallkit map add fixture floor2.wkmap.urdf trash bin_1 --pose 1.2,0.4
      wallkit map add fixture floor2.wkmap.urdf furniture desk --pose 2,3,90deg --size 0.8,1.6,0.75
    """
    from wallkit.maps.edit.add import add_fixture
    from wallkit.pipelines.map.edit import edit_file

    if (wall is None) != (at is None):
        raise click.UsageError("on a wall: --in WALL --at M")
    on = None if wall is None or at is None else (wall, at, side)
    free = None if pose is None else (pose[0], pose[1], pose[2] if len(pose) > 2 else 0.0)
    edited = edit_file(file, lambda c: add_fixture(c, class_name, name, on=on, pose=free, size_m=size, bottom_m=bottom))
    finish(edited, dry_run=dry_run, as_json=as_json)


@add.command()
@FILE
@click.argument("name", metavar="ID")
@click.option("--kind", default="", metavar="KIND", help="corridor, restroom, office ...")
@click.option(
    "--at", type=POINT, metavar="X,Y", help="A point in it: its floor is what the walls enclose, doors closed."
)
@click.option("--floor", metavar="'X Y  X Y ...'", help="Its corners, in metres.")
@edit_options
def room(
    file: Path, name: str, kind: str, at: tuple[float, float] | None, floor: str | None, dry_run: bool, as_json: bool
) -> None:
    """Add a room, by a point in it or by the corners of its floor.

    \b
    Examples:
      wallkit map add room floor2.wkmap.urdf store --kind storage --at 1.5,1
      wallkit map add room floor2.wkmap.urdf nook --floor '0 0  1 0  1 2  0 2'
    """
    import numpy as np

    from wallkit.maps.edit.add import add_room
    from wallkit.maps.numbers import numbers_from_text
    from wallkit.pipelines.map.edit import edit_file

    if (at is None) == (floor is None):
        raise click.UsageError("say where with one of --at X,Y and --floor 'X Y  X Y  X Y'")
    numbers = numbers_from_text(floor) if floor is not None else ()
    if numbers is None or len(numbers) % 2:
        raise click.UsageError(f"--floor '{floor}' is no list of corners: an even count of numbers, spaces between")
    corners = np.array(numbers).reshape(-1, 2) if numbers else None
    finish(edit_file(file, lambda c: add_room(c, name, kind, floor=corners, at=at)), dry_run=dry_run, as_json=as_json)


@add.command("class")
@FILE
@click.argument("name", metavar="NAME")
@click.option("--seg", type=int, multiple=True, metavar="ID", help="Of the segmentation model's classes (repeatable).")
@click.option(
    "--lidar",
    type=click.Choice(["opaque", "glass", "mirror", "perforated", "none"]),
    default="opaque",
    show_default=True,
    help="What a LiDAR sees of it.",
)
@click.option("--p-return", type=common.Number(), metavar="P", help="Share of beams on glass that come back.")
@click.option("--movable", is_flag=True, help="It changes place while the map holds.")
@edit_options
def class_(
    file: Path,
    name: str,
    seg: tuple[int, ...],
    lidar: str,
    p_return: float | None,
    movable: bool,
    dry_run: bool,
    as_json: bool,
) -> None:
    """Add a row to the class table.

    \b
    Examples:
      wallkit map add class floor2.wkmap.urdf locker --seg 14 --movable
      wallkit map add class floor2.wkmap.urdf shower --lidar glass --p-return 0.15
    """
    from wallkit.maps.classes import ClassInfo
    from wallkit.maps.edit.add import add_class
    from wallkit.pipelines.map.edit import edit_file

    info = ClassInfo(name, seg, lidar, p_return, movable)  # type: ignore[arg-type]  # a choice
    finish(edit_file(file, lambda c: add_class(c, info)), dry_run=dry_run, as_json=as_json)


# ------------------------------------------------------------------------------------------------- details


def _place(wall: str, at: float | None, width: float | None, z_m: tuple[float, float], opening: str) -> Place:
    """Where the opening is, from the flags."""
    from wallkit.maps.edit.add_openings import Place

    if at is None and width is None and opening:
        return Place(wall, opening=opening)
    if at is None or width is None:
        raise click.UsageError("say where: --at M --width M, or --opening ID of one that is there")
    return Place(wall, (at, at + width), z_m, opening)
