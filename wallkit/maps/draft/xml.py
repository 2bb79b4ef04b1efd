"""Pieces of a draft -> lines of wkmap XML: walls cut round their openings, leaves, panes, fixtures, their joints."""

from __future__ import annotations

from collections.abc import Iterator
from xml.sax.saxutils import quoteattr

from wallkit.core.geometry import relative
from wallkit.maps.classes import ClassInfo
from wallkit.maps.draft.doors import DraftDoor, Leaf, leaves_of
from wallkit.maps.draft.draft import SLIVER_M, DraftFixture, DraftOpening, DraftPane, DraftRoom, DraftWall
from wallkit.maps.draft.placed import PlacedWall

DECIMALS = 6
# at the far end of a long wall an angle is a length
ANGLE_DECIMALS = 7


def wall_lines(placed: PlacedWall) -> Iterator[str]:
    """A wall with its joint to the map, and what fills its openings."""
    wall = placed.wall
    sigma = None if wall.sigma_m is None else number_text(wall.sigma_m)
    body = [opening_line(opening, _fill_name(opening, wall)) for opening in placed.openings]
    for part, (x0, x1), (z0, z1) in pieces_of(placed):
        body.append(
            box_line(f"{wall.name}.{part}", ((x0 + x1) / 2, 0, (z0 + z1) / 2), (x1 - x0, wall.thickness_m, z1 - z0))
        )
    yield from link_lines(wall.name, attributes(**{"class": wall.class_name}, sigma=sigma), body)
    yield fixed_line(wall.name, "map", (*placed.pose[:2], 0), placed.pose[2])
    for opening in placed.openings:
        if isinstance(opening.fill, DraftPane):
            yield from pane_lines(opening, opening.fill, wall.name)
        elif opening.fill:
            for leaf in leaves_of(opening.fill, opening.along, opening.z, wall.thickness_m):
                yield from door_lines(opening.fill, leaf, wall.name)


def pieces_of(placed: PlacedWall) -> Iterator[tuple[str, tuple[float, float], tuple[float, float]]]:
    """(part, x, z) of the boxes that leave exactly the openings: runs, then sill and head of each."""
    height_m = placed.wall.height_m
    edges = [0.0, *(x for opening in placed.openings for x in opening.along), placed.length_m]
    runs = [(x0, x1) for x0, x1 in zip(edges[::2], edges[1::2], strict=True) if x1 - x0 >= SLIVER_M]
    for number, run in enumerate(runs):
        yield "run" if len(runs) == 1 else f"run_{letters(number)}", run, (0.0, height_m)
    for opening in placed.openings:
        z0, z1 = opening.z
        if z0 >= SLIVER_M:
            yield f"{opening.id}_sill", opening.along, (0.0, z0)
        if height_m - z1 >= SLIVER_M:
            yield f"{opening.id}_head", opening.along, (z1, height_m)


def opening_line(opening: DraftOpening, fill: str | None) -> str:
    """The declaration of an opening, and what fills it."""
    return (
        "    <wk:opening"
        + attributes(
            id=opening.id, kind=opening.kind, along=numbers_text(opening.along), z=numbers_text(opening.z), fill=fill
        )
        + "/>"
    )


def _fill_name(opening: DraftOpening, wall: DraftWall) -> str | None:
    """The link that fills the opening: of a double door the first leaf, which the second one mimics."""
    if isinstance(opening.fill, DraftDoor):
        return leaves_of(opening.fill, opening.along, opening.z, wall.thickness_m)[0].link
    return opening.fill.name if opening.fill else None


def pane_lines(opening: DraftOpening, pane: DraftPane, wall: str) -> Iterator[str]:
    """A pane that fills an opening, with its joint."""
    (x0, x1), (z0, z1) = opening.along, opening.z
    box = box_line(f"{pane.name}.body", ((x1 - x0) / 2, 0, (z1 - z0) / 2), (x1 - x0, pane.thickness_m, z1 - z0))
    yield from link_lines(pane.name, attributes(**{"class": pane.class_name}), [box])
    yield fixed_line(pane.name, wall, (x0, 0, z0), 0.0)


def door_lines(door: DraftDoor, leaf: Leaf, wall: str) -> Iterator[str]:
    """One leaf of a door, with its joint."""
    connects = " ".join(door.connects) if door.connects else None
    box = box_line(f"{leaf.link}.leaf", leaf.centre, leaf.size)
    yield from link_lines(leaf.link, attributes(**{"class": "door"}, connects=connects), [box])
    yield (
        f"  <joint{attributes(name=leaf.joint, type=leaf.joint_type)}><parent{attributes(link=wall)}/>"
        f"<child{attributes(link=leaf.link)}/>{origin_tag(leaf.origin)}"
    )
    limit = attributes(lower="0", upper=number_text(leaf.upper), effort="20", velocity="1")
    yield f"    <axis{attributes(xyz=numbers_text(leaf.axis))}/><limit{limit}/>"
    if leaf.leads:
        yield f"    <mimic{attributes(joint=leaf.leads)}/>"
    prior = " ".join(f"{state}:{number_text(share)}" for state, share in door.prior.items())
    yield f"    <wk:state{attributes(rest=number_text(door.rest), prior=prior)}/></joint>"


def fixture_lines(fixture: DraftFixture, on: PlacedWall | None) -> Iterator[str]:
    """A fixture with its joint, to its wall or to the map."""
    deep, _, high = fixture.size_m
    # on a wall the frame is at the back, so that nothing of the box lies inside the wall
    box = box_line(f"{fixture.name}.body", (deep / 2 if on else 0.0, 0, fixture.bottom_m + high / 2), fixture.size_m)
    yield from link_lines(fixture.name, attributes(**{"class": fixture.class_name}), [box])
    x, y, yaw = relative(on.pose, fixture.pose).tolist() if on else fixture.pose
    yield fixed_line(fixture.name, on.wall.name if on else "map", (x, y, 0), yaw)


def class_line(info: ClassInfo) -> str:
    """A row of the class table."""
    # of opaque and mirrored things the taxonomy knows it
    p_return = info.p_return if info.lidar in ("glass", "perforated") else None
    return (
        "    <wk:class"
        + attributes(
            name=info.name,
            seg=" ".join(map(str, info.seg)) or None,
            lidar=info.lidar,
            movable="true" if info.movable else None,
            p_return=None if p_return is None else number_text(p_return),
        )
        + "/>"
    )


def room_line(room: DraftRoom) -> str:
    """A room, its corners counter-clockwise."""
    corners = room.floor if _signed_area(room.floor) > 0 else room.floor[::-1]
    floor = "  ".join(map(numbers_text, corners))
    return "    <wk:room" + attributes(id=room.id, kind=room.kind or None, floor=floor) + "/>"


def link_lines(name: str, meaning: str, body: list[str]) -> Iterator[str]:
    """A link with its <wk:object> and what is in it, a line each."""
    lines = [f"  <link{attributes(name=name)}><wk:object{meaning}/>", *body]
    yield from lines[:-1]
    yield f"{lines[-1]}</link>"


def box_line(name: str, centre: tuple[float, float, float], size: tuple[float, float, float]) -> str:
    """One box of a link."""
    shape = f"<geometry><box{attributes(size=numbers_text(size))}/></geometry>"
    return f"    <collision{attributes(name=name)}>{origin_tag(centre)}{shape}</collision>"


def fixed_line(name: str, parent: str, xyz: tuple[float, float, float], yaw_rad: float) -> str:
    """The fixed joint that places a link."""
    return (
        f"  <joint{attributes(name=f'at_{name}', type='fixed')}><parent{attributes(link=parent)}/>"
        f"<child{attributes(link=name)}/>{origin_tag(xyz, yaw_rad)}</joint>"
    )


def origin_tag(xyz: tuple[float, float, float], yaw_rad: float = 0.0) -> str:
    yaw = number_text(yaw_rad, ANGLE_DECIMALS)
    return "<origin" + attributes(xyz=numbers_text(xyz), rpy=None if yaw == "0" else f"0 0 {yaw}") + "/>"


def attributes(**values: str | None) -> str:
    """Attributes as they are written; those without a value are left out."""
    return "".join(f" {name}={quoteattr(value)}" for name, value in values.items() if value is not None)


def numbers_text(values: tuple[float, ...]) -> str:
    """Numbers with single spaces."""
    return " ".join(map(number_text, values))


def number_text(value: float, decimals: int = DECIMALS) -> str:
    """A number with at most so many decimals."""
    text = f"{value:.{decimals}f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def letters(number: int) -> str:
    """a, b, ... z, ba, bb, ...: the digits of base 26."""
    head, digit = divmod(number, 26)
    return (letters(head) if head else "") + chr(ord("a") + digit)


def _signed_area(corners: tuple[tuple[float, float], ...]) -> float:
    """Twice the shoelace area; positive when the corners go round anticlockwise."""
    return sum(a[0] * b[1] - b[0] * a[1] for a, b in zip(corners, (*corners[1:], corners[0]), strict=True))
