"""DXF floor plan -> thin walls along its drawn lines, doors from their swings, fixtures from named blocks.

A plan draws a wall by its faces, and a face is what a LiDAR sees: every line on a wall layer becomes a thin wall of its own.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from fnmatch import fnmatchcase
from pathlib import Path

import numpy as np

from wallkit.core.types import Float64Array
from wallkit.errors import MapError
from wallkit.maps.classes import class_from_name
from wallkit.maps.draft.doors import CLEARANCE_M, DraftDoor
from wallkit.maps.draft.draft import Draft, DraftFixture, DraftOpening, DraftWall
from wallkit.maps.importers.dxf_drawing import WALL_WORDS, Drawing, Swing, read_drawing
from wallkit.maps.importers.fixtures import EXTRA_CLASSES, USUAL_SIZES, place_fixture
from wallkit.maps.importers.imported import Imported, ImportOptions, Names, Notes, tally
from wallkit.maps.importers.units import METRES, NAMES, Evidence, UnitVerdict, check_unit, finding_of, judge_units

FACE_M = 0.02
DOOR_WALL_M = 0.1
DOOR_HEIGHT_M = 2.1
# shorter pieces are ticks and corners of symbols
SHORTEST_M = 0.02
# of the longest lines so many tell the thickness of walls
THICKNESS_SAMPLE = 1000
# beyond this a drawing's origin is far away (rule WK-E042)
FAR_M = 1000.0


def read_dxf(path: Path, options: ImportOptions) -> Imported:
    """The model space of a drawing as one level.

    The unit is the user's, else the header's; where door leaves, wall thicknesses and the extent speak for another one,
    a finding (WK-E041) proposes it and nothing is converted.

    Raises:
        MapError: see read_drawing; no unit, or no line on a wall layer.
    """
    drawing = read_drawing(path)
    notes = Notes(path)
    layers = _wall_layers(path, drawing, options)
    lines = np.array([piece for layer in layers for piece in drawing.pieces[layer]]).reshape(-1, 4)
    unit = _unit(path, drawing, lines, options, notes)
    scale = METRES[unit]
    names = Names()
    walls = list(_faces(lines * scale, options, names, notes))
    solid = walls.copy()
    walls += _doors(drawing.swings, lines, scale, options, names)
    fixtures = tuple(_fixtures(drawing, scale, solid, names, notes))
    _say(drawing, layers, walls, unit, notes)
    draft = Draft(
        path.stem,
        tuple(walls),
        fixtures,
        classes=tuple(info for name, info in EXTRA_CLASSES.items() if any(f.class_name == name for f in fixtures)),
        scan_plane_m=options.scan_plane_m,
        source=path.name,
    )
    return Imported((draft,), tuple(notes.found))


def _wall_layers(path: Path, drawing: Drawing, options: ImportOptions) -> list[str]:
    """The layers that hold walls: those the user names, else those whose name says so."""
    if options.layers:
        layers = [layer for layer in drawing.pieces if any(fnmatchcase(layer, wanted) for wanted in options.layers)]
    else:
        layers = [layer for layer in drawing.pieces if WALL_WORDS.search(layer)]
    if not layers:
        wanted = f"no layer matches {', '.join(options.layers)}" if options.layers else "no layer's name means wall"
        sizes = sorted(((len(pieces), layer) for layer, pieces in drawing.pieces.items()), reverse=True)
        listed = ", ".join(f"'{layer}' ({count} lines)" for count, layer in sizes[:12])
        raise MapError(
            f"{wanted}; there are {listed}" if listed else "draws no lines",
            where=path,
            hint="name the wall layers with --layer; * stands for any text"
            if listed
            else "export the plan's model space",
        )
    return layers


def _unit(path: Path, drawing: Drawing, lines: Float64Array, options: ImportOptions, notes: Notes) -> str:
    """The unit to read in; a finding where the drawing's things speak against it."""
    width = float((drawing.extent[2:] - drawing.extent[:2]).max())
    evidence = [
        Evidence("door leaf", np.array([swing.leaf for swing in drawing.swings])),
        Evidence("wall thickness", _spacings(lines)),
        Evidence("extent", np.array([width])),
    ]
    unit = check_unit(options.units, path) if options.units else drawing.unit
    verdict = judge_units(unit, evidence)
    if unit is None:
        raise MapError(
            f"the header ($INSUNITS) declares no unit; {_opinion(verdict)}",
            where=path,
            hint=f"name it: --units {verdict.inferred or '|'.join(METRES)}",
        )
    said = "as the user says" if options.units else "as the header declares"
    if options.units and drawing.unit and drawing.unit != options.units:
        said += f", not {NAMES[drawing.unit]} as the header declares"
    notes.read(f"lengths are {NAMES[unit]}, {said}", unit=unit, declared=drawing.unit)
    if finding := finding_of(verdict, path):
        notes.found.append(finding)
    return unit


def _opinion(verdict: UnitVerdict) -> str:
    if verdict.inferred is None:
        return "and nothing in the drawing tells it"
    return f"it looks drawn in {NAMES[verdict.inferred]}: {'; '.join(verdict.reasons)}"


def _spacings(lines: Float64Array) -> Float64Array:
    """Distance from each of the longer lines to the nearest parallel one beside it: mostly the thickness of a wall."""
    lengths = np.hypot(lines[:, 2] - lines[:, 0], lines[:, 3] - lines[:, 1])
    longest = np.argsort(-lengths, kind="stable")[:THICKNESS_SAMPLE]
    lines, lengths = lines[longest], lengths[longest]
    starts, along = lines[:, :2], (lines[:, 2:] - lines[:, :2]) / lengths[:, None]
    spacings = []
    for start, direction, length in zip(starts, along, lengths, strict=True):
        parallel = np.abs(along @ np.array([-direction[1], direction[0]])) < math.sin(math.radians(1))
        first = (starts - start) @ direction
        second = first + lengths * (along @ direction)
        overlap = np.minimum(np.maximum(first, second), length) - np.maximum(np.minimum(first, second), 0.0)
        away = np.abs((starts - start) @ np.array([-direction[1], direction[0]]))
        beside = parallel & (overlap > np.minimum(length, lengths) / 2) & (away > length * 1e-3)
        if beside.any():
            spacings.append(float(away[beside].min()))
    return np.array(spacings)


def _faces(lines_m: Float64Array, options: ImportOptions, names: Names, notes: Notes) -> Iterator[DraftWall]:
    """The drawn lines [m] as thin walls, each once."""
    thickness_m = options.thickness_m or FACE_M
    seen: set[tuple[tuple[float, float], ...]] = set()
    twice, short = 0, 0
    for x0, y0, x1, y1 in lines_m.tolist():
        key = tuple(sorted((round(x, 3), round(y, 3)) for x, y in ((x0, y0), (x1, y1))))
        if math.dist((x0, y0), (x1, y1)) < max(SHORTEST_M, thickness_m):
            short += 1
        elif key in seen:
            twice += 1
        else:
            seen.add(key)
            yield DraftWall(names.take(f"face_{len(seen)}"), (x0, y0), (x1, y1), thickness_m, options.height_m)
    if twice or short:
        notes.skipped(
            f"{twice} lines drawn twice, {short} shorter than {max(SHORTEST_M, thickness_m):g} m",
            twice=twice,
            short=short,
        )
    notes.guessed(f"every wall is {thickness_m:g} m thick about its drawn line and {options.height_m:g} m high")


def _doors(
    swings: list[Swing], lines: Float64Array, scale: float, options: ImportOptions, names: Names
) -> Iterator[DraftWall]:
    """Each swing as a hinged door in a doorway of its own, drawn open, shut at the other end of its arc."""
    for swing in swings:
        shut_end = 1 - swing.open_end if swing.open_end is not None else _end_at_wall(swing, lines)
        hinge, shut, opened = (p * scale for p in (swing.hinge, swing.ends[shut_end], swing.ends[1 - shut_end]))
        width_m = float(np.hypot(*(shut - hinge)))
        if width_m <= 4 * CLEARANCE_M:
            # at the scale read there is no such door; the unit finding tells of it
            continue
        along = (shut - hinge) / width_m
        normal = np.array([-along[1], along[0]])
        is_left = float((opened - hinge) @ normal) > 0
        # the hinge is on the face of the side it opens to
        start = hinge - CLEARANCE_M * along - (DOOR_WALL_M / 2 if is_left else -DOOR_WALL_M / 2) * normal
        end = start + (width_m + 2 * CLEARANCE_M) * along
        name = names.take("door")
        door = DraftDoor(name, "hinged", "start", "left" if is_left else "right")
        height_m = min(DOOR_HEIGHT_M, options.height_m)
        opening = DraftOpening(f"{name}_hole", "door", (0.0, width_m + 2 * CLEARANCE_M), (0.0, height_m), door)
        yield DraftWall(
            names.take(f"over_{name}"),
            (float(start[0]), float(start[1])),
            (float(end[0]), float(end[1])),
            DOOR_WALL_M,
            options.height_m,
            (opening,),
        )


def _end_at_wall(swing: Swing, lines: Float64Array) -> int:
    """The end of the arc nearer to a drawn wall."""
    from shapely import STRtree, linestrings, points

    tree = STRtree(linestrings(lines.reshape(-1, 2, 2)))
    away = tree.query_nearest(points(swing.ends), return_distance=True, all_matches=False)[1]
    return int(np.argmin(away))


def _fixtures(
    drawing: Drawing, scale: float, walls: list[DraftWall], names: Names, notes: Notes
) -> Iterator[DraftFixture]:
    left_out: list[str] = []
    placed: list[str] = []
    for symbol in drawing.symbols:
        class_name = class_from_name(symbol.name) or symbol.name.lower()
        if class_name not in USUAL_SIZES:
            left_out.append(symbol.name)
            continue
        middle = (symbol.middle[0] * scale, symbol.middle[1] * scale, symbol.yaw_rad)
        placed.append(class_name)
        yield place_fixture(names.take(class_name), class_name, middle, walls)[0]
    if placed:
        notes.guessed(f"{tally(placed)} of usual size, with their backs to the wall beside them")
    if left_out:
        notes.skipped(
            f"{len(left_out)} blocks whose names mean no fixture: {tally(left_out)}",
            hint="add those that stay where they are with `wallkit map add fixture`",
        )


def _say(drawing: Drawing, layers: list[str], walls: list[DraftWall], unit: str, notes: Notes) -> None:
    scale = METRES[unit]
    width_m, depth_m = (drawing.extent[2:] - drawing.extent[:2]) * scale
    notes.read(f"the drawing measures {width_m:.1f} x {depth_m:.1f} m", width_m=float(width_m), depth_m=float(depth_m))
    doors = [wall.openings[0] for wall in walls if wall.openings]
    faces = [wall for wall in walls if not wall.openings]
    length_m = sum(wall.length_m for wall in faces)
    notes.read(
        f"{len(faces)} lines, {length_m:.1f} m, as walls from the layers {', '.join(repr(layer) for layer in layers)}",
        walls=len(faces),
        length_m=length_m,
    )
    if drawing.swings or drawing.door_blocks:
        listed = ", ".join(sorted(f"{door.along[1] - 2 * CLEARANCE_M:.2f}" for door in doors))
        widths = f" ({listed} m)" if doors else ""
        notes.read(
            f"{len(doors)} doors of {len(drawing.swings)} drawn swings{widths}, {drawing.door_blocks} door blocks",
            doors=len(doors),
            door_blocks=drawing.door_blocks,
        )
        notes.guessed(f"doors are {DOOR_HEIGHT_M:g} m high in walls {DOOR_WALL_M:g} m thick: a plan has no heights")
    others = {layer: len(pieces) for layer, pieces in drawing.pieces.items() if layer not in layers}
    if others:
        listed = ", ".join(f"'{layer}' ({count})" for layer, count in sorted(others.items(), key=lambda o: -o[1]))
        notes.skipped(f"lines on layers that hold no walls: {listed}", hint="--layer names the layers to read")
    if drawing.passed_over:
        notes.skipped(f"{len(drawing.passed_over)} entities that draw no line: {tally(drawing.passed_over)}")
    if float(np.abs(drawing.extent).max()) * scale > FAR_M:
        text = f"coordinates reach {float(np.abs(drawing.extent).max()) * scale:,.0f} m from the origin"
        notes.add("WK-E042", "warning", text, hint="`wallkit map origin` moves frame map to the data")
