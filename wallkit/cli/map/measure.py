"""`wallkit map measure` and `tree`: how far, how wide, how large; and what hangs on what."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click

from wallkit.cli import common

if TYPE_CHECKING:
    from wallkit.maps.measure import Extent, Measurement
    from wallkit.maps.model import SemanticMap

FILE = click.argument("file", type=click.Path(path_type=Path), metavar="FILE")


@click.command()
@FILE
@click.argument("a", metavar="[A]", required=False)
@click.argument("b", metavar="[B]", required=False)
@click.option("--area", "room", metavar="ROOM", help="Area of a room, and how much of it nothing stands on.")
@common.json_option
def measure(file: Path, a: str | None, b: str | None, room: str | None, as_json: bool) -> None:
    """Measure from A to B, or how large A is.

    A and B are links, openings, rooms, or points x,y (write -- before one that begins with a minus). Between two things:
    the distance of their frames, of their nearest surfaces seen from above, the angle from one's +x to the other's, and the
    clear width where they lie parallel and face each other. Of an opening alone: what an open door leaves of it.

    \b
    Examples:
      wallkit map measure floor2.wkmap.urdf wall_s wall_mid
      wallkit map measure floor2.wkmap.urdf toilet_1 2.5,4
      wallkit map measure floor2.wkmap.urdf wall_mid/d1
      wallkit map measure floor2.wkmap.urdf --area restroom_m --json
    """
    from dataclasses import asdict

    from wallkit.maps.measure import extent_of
    from wallkit.maps.measure import measure as between
    from wallkit.maps.read import load_map

    if (a is None) == (room is None):
        raise click.UsageError("name one thing, or two, or --area ROOM")
    semantic_map = load_map(file)
    found: Measurement | Extent
    if a is not None and b is not None:
        found = between(semantic_map, a, b)
        lines = _measurement_lines(found)
    else:
        found = extent_of(semantic_map, f"room:{room}" if room is not None else str(a))
        lines = _extent_lines(found)
    if as_json:
        common.emit(asdict(found))
    else:
        click.echo("\n".join(lines))


@click.command()
@FILE
@click.option("--depth", type=click.IntRange(min=1), help="Show so many levels.")
def tree(file: Path, depth: int | None) -> None:
    """Show what hangs on what, with classes, joints and the doors' travel.

    \b
    Examples:
      wallkit map tree floor2.wkmap.urdf
      wallkit map tree floor2.wkmap.urdf --depth 1
    """
    from wallkit.maps.read import load_map

    semantic_map = load_map(file)
    for root in semantic_map.roots:
        click.echo(root)
        for line in _branches(semantic_map, root, "", depth):
            click.echo(line)


# ------------------------------------------------------------------------------------------------ details


def _measurement_lines(found: Measurement) -> list[str]:
    x, y, z = found.by_m
    (ax, ay), (bx, by) = found.points_m
    lines = [
        f"from {found.a} to {found.b}",
        f"frames    {found.frames_m:.3f} m (x {x:+.3f}, y {y:+.3f}, z {z:+.3f})",
        f"surfaces  {found.surfaces_m:.3f} m, from ({ax:.3f}, {ay:.3f}) to ({bx:.3f}, {by:.3f})",
    ]
    if found.over_m > 0:
        lines.append(f"heights   {found.over_m:.3f} m of air between them")
    if found.clear_m is not None and found.facing_m is not None:
        lines.append(f"clear     {found.clear_m:.3f} m, along {found.facing_m:.3f} m")
    if found.angle_rad is not None:
        lines.append(f"angle     {math.degrees(found.angle_rad):+.3f} deg ({found.angle_rad:+.5f} rad)")
    return lines


def _extent_lines(found: Extent) -> list[str]:
    along, across, high = found.size_m
    lines = [
        f"{found.kind} {found.name}",
        f"size      {along:.3f} x {across:.3f} m, {high:.3f} m high",
        f"area      {found.area_m2:.3f} m2, perimeter {found.perimeter_m:.3f} m",
    ]
    if found.free_m2 is not None:
        lines.append(f"free      {found.free_m2:.3f} m2 without what stands or hangs there")
    if found.clear_m is not None:
        lines.append(f"clear     {found.clear_m:.3f} m wide with its door open")
    return lines


def _branches(semantic_map: SemanticMap, link: str, indent: str, depth: int | None) -> Iterator[str]:
    """The lines below a link."""
    if depth == 0:
        return
    joints = [joint for joint in semantic_map.children_of(link) if joint.child in semantic_map.links]
    for number, joint in enumerate(joints, start=1):
        is_last = number == len(joints)
        child = semantic_map.links[joint.child]
        said = f" [{child.class_name}]" if child.class_name else ""
        if joint.is_movable:
            unit = "m" if joint.kind == "prismatic" else "rad"
            low, high = joint.travel
            said += f" {joint.kind} {low:g} to {high:g} {unit}" + (
                f", follows {joint.mimic.joint}" if joint.mimic else ""
            )
        if child.openings:
            said += f" with {', '.join(opening.id for opening in child.openings)}"
        yield f"{indent}{'└─ ' if is_last else '├─ '}{joint.child}{said}"
        deeper = None if depth is None else depth - 1
        yield from _branches(semantic_map, joint.child, indent + ("   " if is_last else "│  "), deeper)
