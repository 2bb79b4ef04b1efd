"""A DXF file -> what a plan is drawn with: straight pieces by layer, quarter-circle door swings, named symbols."""

from __future__ import annotations

import logging
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from wallkit.core.types import Float64Array
from wallkit.errors import MapError
from wallkit.maps.importers.imported import LARGEST_BYTES

WHAT = "a DXF drawing of a floor plan"
# $INSUNITS of the DXF reference, those that buildings are drawn in
INSUNITS: dict[int, str] = {1: "in", 2: "ft", 4: "mm", 5: "cm", 6: "m", 14: "dm"}
WALL_WORDS = re.compile(
    r"(?<![a-z])(walls?|muros?|murs?|wand|w(ae|ä)nde|paret[ei]|pared(es)?|paredes?|tabiques?)(?![a-z])", re.I
)
DOOR_WORDS = re.compile(
    r"(?<![a-z])(doors?|doorswindows|openings?|puertas?|portes?|portas?|t(ue|ü)r(en)?|deur(en)?)(?![a-z])", re.I
)
# a door's swing is a quarter circle, drawn by hand
SWING_RAD = (math.radians(70), math.radians(110))
# chords leave a curve by at most so much of the curve's own size
CHORD = 0.005
# inserts within inserts, no deeper
DEEPEST = 8


@dataclass(frozen=True)
class Swing:
    """A door as drawn, in the drawing's unit: its hinge and both ends of its arc (2,), and which end is the open one."""

    hinge: Float64Array
    ends: tuple[Float64Array, Float64Array]
    open_end: int | None

    @property
    def leaf(self) -> float:
        """Length of the leaf: the arc's radius."""
        return float(np.hypot(*(self.ends[0] - self.hinge)))


@dataclass(frozen=True)
class Symbol:
    """An inserted block: its name without prefixes, the middle of what it draws (x, y), and its turn [rad]."""

    name: str
    middle: tuple[float, float]
    yaw_rad: float


@dataclass
class Drawing:
    """What a drawing holds, in its own unit.

    Attributes:
        unit: the unit its header declares; None if it declares none.
        pieces: {layer: list of (x0, y0, x1, y1)} straight pieces, curves as chords.
        door_blocks: how many inserted blocks are doors by their name.
        passed_over: kind and layer of every entity that draws no line.
        extent: (4,) smallest and largest x, y of all pieces and symbols.
    """

    unit: str | None
    pieces: dict[str, list[tuple[float, float, float, float]]] = field(default_factory=dict)
    swings: list[Swing] = field(default_factory=list)
    symbols: list[Symbol] = field(default_factory=list)
    door_blocks: int = 0
    passed_over: list[str] = field(default_factory=list)
    extent: Float64Array = field(default_factory=lambda: np.array([np.inf, np.inf, -np.inf, -np.inf]))


def read_drawing(path: Path) -> Drawing:
    """The model space of a DXF file.

    Raises:
        MapError: ezdxf is not installed, or the file is not a readable DXF.
    """
    try:
        from ezdxf import recover
        from ezdxf.lldxf.const import DXFError
    except ImportError as error:
        raise MapError("reading DXF needs the package ezdxf", where=path, hint="pip install 'wallkit[dxf]'") from error
    _check_is_dxf(path)
    # ezdxf logs what it mends; without a handler Python would print that
    logging.getLogger("ezdxf").addHandler(logging.NullHandler())
    try:
        document, _ = recover.readfile(path)
        drawing = _collect(document)
    except (DXFError, OSError) as error:
        raise MapError(f"not a readable DXF: {error}", where=path, hint=f"name {WHAT}") from error
    except (ValueError, TypeError, KeyError, IndexError, AttributeError, ArithmeticError) as error:
        # what a damaged file makes of ezdxf's own reading
        message = f"a damaged DXF: {type(error).__name__} {error}"
        raise MapError(message, where=path, hint="open and save it again in the drawing program") from error
    return drawing


def _check_is_dxf(path: Path) -> None:
    try:
        with path.open("rb") as file:
            head = file.read(4096)
        size = path.stat().st_size
    except OSError as error:
        raise MapError(f"cannot read it: {error.strerror}", where=path, hint=f"name {WHAT}") from error
    is_dxf = head.startswith(b"AutoCAD Binary DXF") or re.search(rb"^\s*0\s*\r?\n\s*SECTION", head, re.M)
    if not is_dxf or size > LARGEST_BYTES:
        hint = "save the drawing as DXF" if head.startswith(b"AC10") else f"name {WHAT}"
        raise MapError("is not a DXF, or larger than 200 MB", where=path, hint=hint)


def _collect(document: Any) -> Drawing:
    drawing = Drawing(INSUNITS.get(int(document.header.get("$INSUNITS", 0))))
    loose: dict[str, list[Any]] = {}
    for entity in document.modelspace():
        _add(drawing, entity, loose, 0)
    for layer, arcs in loose.items():
        drawing.swings += _swings(arcs, drawing.pieces.get(layer, []))
    return drawing


def _add(drawing: Drawing, entity: Any, loose: dict[str, list[Any]], depth: int) -> None:
    """One entity, and of an insert all it draws."""
    kind, layer = entity.dxftype(), str(entity.dxf.layer)
    if kind == "INSERT":
        name = str(entity.dxf.name).split("$")[-1]
        drawn = list(entity.virtual_entities()) if depth < DEEPEST else []
        if DOOR_WORDS.search(name):
            drawing.door_blocks += 1
            inside = [piece for part in drawn for piece in _pieces(part)]
            drawing.swings += _swings([part for part in drawn if part.dxftype() == "ARC"], inside)
            _widen(drawing, inside)
            return
        inside = [piece for part in drawn for piece in _pieces(part)]
        _widen(drawing, inside)
        if inside:
            box = np.array(inside).reshape(-1, 2)
            middle = (box.min(axis=0) + box.max(axis=0)) / 2
            drawing.symbols.append(
                Symbol(name, (float(middle[0]), float(middle[1])), math.radians(float(entity.dxf.rotation)))
            )
        for part in drawn:
            # a whole plan may be one block: what lies on layers of its own in it is drawing, not symbol
            if part.dxftype() == "INSERT" or WALL_WORDS.search(str(part.dxf.layer)):
                _add(drawing, part, loose, depth + 1)
        return
    pieces = _pieces(entity)
    if not pieces:
        kind = f"{kind} without length" if kind in LINE_KINDS else kind
        drawing.passed_over.append(f"{kind} on {layer}")
        return
    _widen(drawing, pieces)
    drawing.pieces.setdefault(layer, []).extend(pieces)
    if kind == "ARC" and DOOR_WORDS.search(layer):
        loose.setdefault(layer, []).append(entity)


def _pieces(entity: Any) -> list[tuple[float, float, float, float]]:
    """The entity as straight pieces in the plane; [] for kinds that are no lines."""
    from ezdxf import path as ezdxf_path

    if entity.dxftype() not in LINE_KINDS:
        return []
    outline = ezdxf_path.make_path(entity)
    if not len(outline):
        return []
    corners = np.array([(p.x, p.y) for p in outline.control_vertices()])
    size = float(np.ptp(corners, axis=0).max())
    if not (np.isfinite(corners).all() and size > 0):
        return []
    points = [(float(p.x), float(p.y)) for p in outline.flattening(CHORD * size)]
    return [(*a, *b) for a, b in pairwise(points) if a != b]


def _swings(arcs: list[Any], pieces: list[tuple[float, float, float, float]]) -> Iterator[Swing]:
    """The arcs that are quarter circles, with the end that a line from the hinge leads to: the leaf is drawn open."""
    lines = np.array(pieces, dtype=np.float64).reshape(-1, 2, 2)
    for arc in arcs:
        hinge = np.array(arc.ocs().to_wcs(arc.dxf.center))[:2].astype(np.float64)
        ends = tuple(np.array((point.x, point.y)) for point in (arc.start_point, arc.end_point))
        radius = float(np.hypot(*(ends[0] - hinge)))
        first, second = ((end - hinge) / radius for end in ends)
        if not SWING_RAD[0] <= math.acos(float(np.clip(first @ second, -1, 1))) <= SWING_RAD[1]:
            continue
        near = 0.1 * radius
        leads = [
            bool(
                (
                    ((np.hypot(*(lines[:, 0] - hinge).T) < near) & (np.hypot(*(lines[:, 1] - end).T) < near))
                    | ((np.hypot(*(lines[:, 1] - hinge).T) < near) & (np.hypot(*(lines[:, 0] - end).T) < near))
                ).any()
            )
            for end in ends
        ]
        yield Swing(hinge, (ends[0], ends[1]), leads.index(True) if sum(leads) == 1 else None)


def _widen(drawing: Drawing, pieces: list[tuple[float, float, float, float]]) -> None:
    if pieces:
        points = np.array(pieces).reshape(-1, 2)
        drawing.extent = np.concatenate(
            [np.minimum(drawing.extent[:2], points.min(axis=0)), np.maximum(drawing.extent[2:], points.max(axis=0))]
        )


LINE_KINDS = frozenset({"LINE", "LWPOLYLINE", "POLYLINE", "ARC", "CIRCLE", "ELLIPSE", "SPLINE"})
