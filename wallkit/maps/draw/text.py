"""A semantic map -> a preview of its plan in characters: letters for a file, half blocks for a terminal with colours."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wallkit.core.types import Int64Array
from wallkit.errors import MapError
from wallkit.maps.draw.marks import colour_or
from wallkit.maps.draw.plan import CUT_CLASSES, CUT_M, NOT_DRAWN
from wallkit.maps.geometry import Part, parts
from wallkit.maps.model import SemanticMap

# what a class is in plain text; a class not named here is the first letter of its name
LETTERS = {
    "wall": "#",
    "window": ":",
    "glass": ":",
    "door": "D",
    "partition": "|",
    "column": "O",
    "mirror": "M",
    "toilet": "T",
    "urinal": "U",
    "sink": "S",
    "trash": "b",
    "dispenser": "d",
    "radiator": "r",
    "furniture": "f",
}
# a character is about twice as high as it is wide
_ASPECT = 2
_OUTSIDE, _FLOOR = -1, -2


@dataclass(frozen=True, eq=False)
class Cells:
    """The plan in square cells.

    Attributes:
        classes: names that `cells` counts.
        cells: (H, W), row 0 in the north: index of a class, -2 floor of a room, -1 nothing.
        names: (row, column of the middle, words) of each room.
    """

    classes: tuple[str, ...]
    cells: Int64Array
    names: tuple[tuple[int, int, str], ...]
    cell_m: float


def cells_of(semantic_map: SemanticMap, *, columns: int, lines: int = 1000, z_m: float | None = None) -> Cells:
    """The plan on a lattice of cells; where several things meet in one, what is rarer wins, so that doors are seen.

    Args:
        columns, lines: the text is no wider and no higher.
        z_m: only what a plane there cuts; None: as `draw_plan` draws it.

    Raises:
        MapError: nothing in the map can be drawn.
    """
    import shapely

    solids = [part for part in parts(semantic_map) if part.class_name not in NOT_DRAWN and _is_shown(part, z_m)]
    floors = [(room.id, shapely.Polygon(room.floor)) for room in semantic_map.rooms.values() if room.floor is not None]
    shapes = [part.footprint if z_m is None else part.cut(z_m) for part in solids]
    everything = [*shapes, *(floor for _, floor in floors)]
    if not everything:
        raise MapError(
            "there is nothing to draw", where=semantic_map.source, hint="boxes, cylinders and rooms are drawn"
        )
    left, bottom, right, top = shapely.total_bounds(np.array(everything, dtype=object)).tolist()
    cell_m = max((right - left) / columns, (top - bottom) / (lines * _ASPECT), 1e-3)
    # a rounding error is no further column
    columns, rows = (max(1, math.ceil(extent / cell_m - 1e-9)) for extent in (right - left, top - bottom))
    rows += rows % _ASPECT
    x = left + cell_m * np.arange(columns)
    y = top - cell_m * np.arange(1, rows + 1)
    boxes = shapely.box(x[None, :], y[:, None], x[None, :] + cell_m, y[:, None] + cell_m)
    tree = shapely.STRtree(boxes.ravel())
    cells = np.full(rows * columns, _OUTSIDE, dtype=np.int64)
    for _, floor in floors:
        cells[tree.query(floor, predicate="intersects")] = _FLOOR
    names = [part.class_name or "unknown" for part in solids]
    extent = {name: sum(s.area for s, n in zip(shapes, names, strict=True) if n == name) for name in set(names)}
    classes = tuple(sorted(extent, key=lambda name: (-extent[name], name)))
    for index, name in enumerate(classes):
        for shape, own in zip(shapes, names, strict=True):
            if own == name:
                cells[tree.query(shape, predicate="intersects")] = index
    labels = []
    for room, floor in floors:
        point = floor.representative_point()
        labels.append((int((top - point.y) / cell_m), int((point.x - left) / cell_m), room))
    return Cells(classes, cells.reshape(rows, columns), tuple(labels), cell_m)


def plain_from_cells(plan: Cells) -> str:
    """Lines of letters; a character stands for two cells one above the other."""
    grid = _halved(plan.cells)
    letters = {index: LETTERS.get(name, name[:1]) for index, name in enumerate(plan.classes)}
    letters |= {_OUTSIDE: " ", _FLOOR: "."}
    lines = [[letters[int(value)] for value in row] for row in grid]
    _write_names(plan, grid, lambda row, column, letter: lines[row].__setitem__(column, letter))
    legend = "  ".join(f"{letters[index]} {name}" for index, name in enumerate(plan.classes))
    return "\n".join("".join(line).rstrip() for line in lines) + f"\n{legend}  (a column is {plan.cell_m:.2f} m)\n"


def coloured_from_cells(plan: Cells, semantic_map: SemanticMap) -> str:
    """Lines of half blocks in 24-bit colour, two cells a character."""
    colours = [_rgb(semantic_map, name) for name in plan.classes]
    shades = dict(enumerate(colours)) | {_FLOOR: (246, 244, 239)}
    words: dict[tuple[int, int], str] = {}
    _write_names(plan, _halved(plan.cells), lambda row, column, letter: words.__setitem__((row, column), letter))
    lines = []
    for row in range(len(plan.cells) // 2):
        line = []
        for column, (upper, lower) in enumerate(zip(plan.cells[2 * row], plan.cells[2 * row + 1], strict=True)):
            word = words.get((row, column))
            line.append(_block(shades.get(int(upper)), shades.get(int(lower)), word))
        lines.append("".join(line) + "\x1b[0m")
    legend = "  ".join(f"{_block(colours[i], colours[i], None)}\x1b[0m {name}" for i, name in enumerate(plan.classes))
    return "\n".join(lines) + f"\n{legend}  (a column is {plan.cell_m:.2f} m)\n"


# -------------------------------------------------------------------------------------------- details

_Rgb = tuple[int, int, int]


def _is_shown(part: Part, z_m: float | None) -> bool:
    """With a plane, what it cuts; without, all but the heads of doors and windows."""
    if z_m is not None:
        return part.is_cut_by(z_m)
    return part.class_name not in CUT_CLASSES or part.z_m[0] <= CUT_M


def _halved(cells: Int64Array) -> Int64Array:
    """(H / 2, W): of two cells the rarer class, which has the higher index; anything rather than floor."""
    pair = cells.reshape(len(cells) // _ASPECT, _ASPECT, -1)
    return np.asarray(np.where(pair.max(axis=1) >= 0, pair.max(axis=1), pair.min(axis=1)))


def _write_names(plan: Cells, grid: Int64Array, put: Callable[[int, int, str], object]) -> None:
    """The rooms' names, letter by letter, where they cover nothing but floor."""
    for row, column, words in plan.names:
        row, start = min(row // _ASPECT, len(grid) - 1), max(column - len(words) // 2, 0)
        cells = grid[row, start : start + len(words)]
        if len(cells) == len(words) and (cells < 0).all():
            for offset, letter in enumerate(words):
                put(row, start + offset, letter)


def _rgb(semantic_map: SemanticMap, class_name: str) -> _Rgb:
    info = semantic_map.classes.get(class_name)
    colour = colour_or(info.color if info else "", "#9aa5b1")
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)


def _block(upper: _Rgb | None, lower: _Rgb | None, word: str | None) -> str:
    """One character: its upper half in one colour, its lower half in the other."""
    if word is not None:
        back = upper or lower or (255, 255, 255)
        return f"\x1b[0;48;2;{_code(back)};38;2;31;41;51m{word}"
    if upper is None:
        return "\x1b[0m " if lower is None else f"\x1b[0;38;2;{_code(lower)}m▄"
    return f"\x1b[0;38;2;{_code(upper)}{'' if lower is None else ';48;2;' + _code(lower)}m▀"


def _code(colour: _Rgb) -> str:
    return ";".join(map(str, colour))
