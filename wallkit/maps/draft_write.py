"""A draft -> the bytes of a wkmap 1.0 file: frames, joints, boxes cut round the openings, closed corners."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from xml.sax.saxutils import quoteattr

import numpy as np

from wallkit.core.geometry import relative
from wallkit.maps.classes import DEFAULT_TAXONOMY, RESTROOM_V1
from wallkit.maps.draft import (
    SLIVER_M,
    Draft,
    DraftFixture,
    DraftOpening,
    DraftPane,
    DraftWall,
    check_draft,
    classes_used,
)
from wallkit.maps.draft_doors import DraftDoor, Leaf, leaves_of
from wallkit.maps.draft_joints import end_closures
from wallkit.maps.grammar import FORMAT, UNITS

DECIMALS = 6


def write_draft(draft: Draft) -> bytes:
    """The draft as wkmap 1.0: UTF-8 XML, at most six decimals, the same bytes for the same draft.

    Raises:
        MapError: see check_draft.
    """
    check_draft(draft)
    placed = list(placed_walls(draft))
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<robot{_attributes(name=draft.name)} xmlns:wk="urn:wallkit:map:1">',
    ]
    lines += _header(draft)
    lines.append('  <link name="map"/>')
    for wall in placed:
        lines += _wall(wall)
    by_name = {wall.wall.name: wall for wall in placed}
    for fixture in draft.fixtures:
        lines += _fixture(fixture, by_name.get(fixture.wall or ""))
    return ("\n".join([*lines, "</robot>"]) + "\n").encode()


# ------------------------------------------------------------------------------------------- walls in place


@dataclass(frozen=True, slots=True)
class PlacedWall:
    """A wall with its corners closed: the pose of its frame, its length, and its openings from the new start."""

    wall: DraftWall
    pose: tuple[float, float, float]
    length_m: float
    openings: tuple[DraftOpening, ...]


def placed_walls(draft: Draft) -> Iterator[PlacedWall]:
    """The draft's walls as they are written, in the same order."""
    axes = np.array([(*wall.start, *wall.end) for wall in draft.walls], dtype=np.float64).reshape(-1, 4)
    closures = np.zeros((len(axes), 2))
    if draft.closed_corners:
        closures = end_closures(axes, np.array([wall.thickness_m for wall in draft.walls]))
    for wall, (at_start, at_end) in zip(draft.walls, closures.tolist(), strict=True):
        yaw = math.atan2(wall.end[1] - wall.start[1], wall.end[0] - wall.start[0])
        pose = (wall.start[0] - at_start * math.cos(yaw), wall.start[1] - at_start * math.sin(yaw), yaw)
        length_m = wall.length_m + at_start + at_end
        yield PlacedWall(wall, pose, length_m, tuple(_shifted(wall.openings, at_start, length_m)))


def _shifted(openings: tuple[DraftOpening, ...], shift_m: float, length_m: float) -> Iterator[DraftOpening]:
    """The openings in order, from the wall's new start; a corner that was closed takes from an opening beside it."""
    for opening in sorted(openings, key=lambda o: o.along):
        x0, x1 = (min(max(x + shift_m, 0.0), length_m) for x in opening.along)
        x0 = 0.0 if x0 < SLIVER_M else x0
        x1 = length_m if length_m - x1 < SLIVER_M else x1
        yield DraftOpening(opening.id, opening.kind, (x0, x1), opening.z, opening.fill)


# ---------------------------------------------------------------------------------------------------- XML


def _header(draft: Draft) -> Iterator[str]:
    plane = None if draft.scan_plane_m is None else _number(draft.scan_plane_m)
    yield (
        "  <wk:map"
        + _attributes(
            format=FORMAT,
            units=UNITS,
            up="z",
            level=draft.level,
            elevation=_number(draft.elevation_m),
            scan_plane=plane,
            taxonomy=DEFAULT_TAXONOMY,
            source=draft.source or None,
        )
        + ">"
    )
    if origin := draft.origin:
        yield (
            "    <wk:origin"
            + _attributes(
                kind=origin.kind,
                epsg=str(origin.epsg),
                east=_number(origin.east_m),
                north=_number(origin.north_m),
                yaw=_number(origin.yaw_rad),
            )
            + "/>"
        )
    table = {**RESTROOM_V1, **{info.name: info for info in draft.classes}}
    used = {class_name for _, class_name in classes_used(draft)} | {info.name for info in draft.classes}
    for info in table.values():
        if info.name in used:
            # of opaque and mirrored things the taxonomy knows it
            p_return = info.p_return if info.lidar in ("glass", "perforated") else None
            yield (
                "    <wk:class"
                + _attributes(
                    name=info.name,
                    seg=" ".join(map(str, info.seg)) or None,
                    lidar=info.lidar,
                    movable="true" if info.movable else None,
                    p_return=None if p_return is None else _number(p_return),
                )
                + "/>"
            )
    for room in draft.rooms:
        corners = room.floor if _signed_area(room.floor) > 0 else room.floor[::-1]
        yield "    <wk:room" + _attributes(id=room.id, kind=room.kind, floor="  ".join(map(_numbers, corners))) + "/>"
    yield "  </wk:map>"


def _wall(placed: PlacedWall) -> Iterator[str]:
    wall = placed.wall
    sigma = None if wall.sigma_m is None else _number(wall.sigma_m)
    body = [
        "    <wk:opening"
        + _attributes(
            id=opening.id,
            kind=opening.kind,
            along=_numbers(opening.along),
            z=_numbers(opening.z),
            fill=_fill_name(opening, wall),
        )
        + "/>"
        for opening in placed.openings
    ]
    for part, (x0, x1), (z0, z1) in _pieces(placed):
        body.append(
            _box(f"{wall.name}.{part}", ((x0 + x1) / 2, 0, (z0 + z1) / 2), (x1 - x0, wall.thickness_m, z1 - z0))
        )
    yield from _link(wall.name, _attributes(**{"class": wall.class_name}, sigma=sigma), body)
    yield _fixed(wall.name, "map", (*placed.pose[:2], 0), placed.pose[2])
    for opening in placed.openings:
        if isinstance(opening.fill, DraftPane):
            yield from _pane(opening, opening.fill, wall.name)
        elif opening.fill:
            for leaf in leaves_of(opening.fill, opening.along, opening.z, wall.thickness_m):
                yield from _door(opening.fill, leaf, wall.name)


def _pieces(placed: PlacedWall) -> Iterator[tuple[str, tuple[float, float], tuple[float, float]]]:
    """(part, x, z) of the boxes that leave exactly the openings: runs, then sill and head of each."""
    height_m = placed.wall.height_m
    edges = [0.0, *(x for opening in placed.openings for x in opening.along), placed.length_m]
    runs = [(x0, x1) for x0, x1 in zip(edges[::2], edges[1::2], strict=True) if x1 - x0 >= SLIVER_M]
    for number, run in enumerate(runs):
        yield "run" if len(runs) == 1 else f"run_{_letters(number)}", run, (0.0, height_m)
    for opening in placed.openings:
        z0, z1 = opening.z
        if z0 >= SLIVER_M:
            yield f"{opening.id}_sill", opening.along, (0.0, z0)
        if height_m - z1 >= SLIVER_M:
            yield f"{opening.id}_head", opening.along, (z1, height_m)


def _fill_name(opening: DraftOpening, wall: DraftWall) -> str | None:
    """The link that fills the opening: of a double door the first leaf, which the second one mimics."""
    if isinstance(opening.fill, DraftDoor):
        return leaves_of(opening.fill, opening.along, opening.z, wall.thickness_m)[0].link
    return opening.fill.name if opening.fill else None


def _pane(opening: DraftOpening, pane: DraftPane, wall: str) -> Iterator[str]:
    (x0, x1), (z0, z1) = opening.along, opening.z
    box = _box(f"{pane.name}.body", ((x1 - x0) / 2, 0, (z1 - z0) / 2), (x1 - x0, pane.thickness_m, z1 - z0))
    yield from _link(pane.name, _attributes(**{"class": pane.class_name}), [box])
    yield _fixed(pane.name, wall, (x0, 0, z0), 0.0)


def _door(door: DraftDoor, leaf: Leaf, wall: str) -> Iterator[str]:
    connects = " ".join(door.connects) if door.connects else None
    box = _box(f"{leaf.link}.leaf", leaf.centre, leaf.size)
    yield from _link(leaf.link, _attributes(**{"class": "door"}, connects=connects), [box])
    yield (
        f"  <joint{_attributes(name=leaf.joint, type=leaf.joint_type)}><parent{_attributes(link=wall)}/>"
        f"<child{_attributes(link=leaf.link)}/>{_origin(leaf.origin)}"
    )
    limit = _attributes(lower="0", upper=_number(leaf.upper), effort="20", velocity="1")
    yield f"    <axis{_attributes(xyz=_numbers(leaf.axis))}/><limit{limit}/>"
    if leaf.leads:
        yield f"    <mimic{_attributes(joint=leaf.leads)}/>"
    prior = " ".join(f"{state}:{_number(share)}" for state, share in door.prior.items())
    yield f"    <wk:state{_attributes(rest=_number(door.rest), prior=prior)}/></joint>"


def _fixture(fixture: DraftFixture, on: PlacedWall | None) -> Iterator[str]:
    deep, _, high = fixture.size_m
    # on a wall the frame is at the back, so that nothing of the box lies inside the wall
    box = _box(f"{fixture.name}.body", (deep / 2 if on else 0.0, 0, fixture.bottom_m + high / 2), fixture.size_m)
    yield from _link(fixture.name, _attributes(**{"class": fixture.class_name}), [box])
    x, y, yaw = relative(on.pose, fixture.pose).tolist() if on else fixture.pose
    yield _fixed(fixture.name, on.wall.name if on else "map", (x, y, 0), yaw)


def _link(name: str, meaning: str, body: list[str]) -> Iterator[str]:
    lines = [f"  <link{_attributes(name=name)}><wk:object{meaning}/>", *body]
    yield from lines[:-1]
    yield f"{lines[-1]}</link>"


def _box(name: str, centre: tuple[float, float, float], size: tuple[float, float, float]) -> str:
    shape = f"<geometry><box{_attributes(size=_numbers(size))}/></geometry>"
    return f"    <collision{_attributes(name=name)}>{_origin(centre)}{shape}</collision>"


def _fixed(name: str, parent: str, xyz: tuple[float, float, float], yaw_rad: float) -> str:
    return (
        f"  <joint{_attributes(name=f'at_{name}', type='fixed')}><parent{_attributes(link=parent)}/>"
        f"<child{_attributes(link=name)}/>{_origin(xyz, yaw_rad)}</joint>"
    )


def _origin(xyz: tuple[float, float, float], yaw_rad: float = 0.0) -> str:
    yaw = _number(yaw_rad)
    return "<origin" + _attributes(xyz=_numbers(xyz), rpy=None if yaw == "0" else f"0 0 {yaw}") + "/>"


def _attributes(**values: str | None) -> str:
    return "".join(f" {name}={quoteattr(value)}" for name, value in values.items() if value is not None)


def _numbers(values: tuple[float, ...]) -> str:
    return " ".join(map(_number, values))


def _number(value: float) -> str:
    text = f"{value:.{DECIMALS}f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def _letters(number: int) -> str:
    """a, b, ... z, ba, bb, ...: the digits of base 26."""
    head, digit = divmod(number, 26)
    return (_letters(head) if head else "") + chr(ord("a") + digit)


def _signed_area(corners: tuple[tuple[float, float], ...]) -> float:
    """Twice the shoelace area; positive when the corners go round anticlockwise."""
    return sum(a[0] * b[1] - b[0] * a[1] for a, b in zip(corners, (*corners[1:], corners[0]), strict=True))
