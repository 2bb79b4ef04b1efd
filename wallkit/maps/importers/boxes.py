"""CSV of boxes -> walls and fixtures, exactly as long as the table says.

Columns name, class, x, y, z, yaw, sx, sy, sz in any order: the middle of the box [m], its turn [rad], its size along its own
x, y, z [m]. Lines that begin with # are remarks.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from wallkit.errors import MapError, closest
from wallkit.maps.classes import RESTROOM_V1, ClassInfo
from wallkit.maps.draft.draft import Draft, DraftFixture, DraftWall
from wallkit.maps.importers.imported import Imported, ImportOptions, Names, Notes, read_text, tally
from wallkit.maps.importers.units import METRES, Evidence, check_unit, finding_of, judge_units

COLUMNS = ("name", "class", "x", "y", "z", "yaw", "sx", "sy", "sz")
WHAT = f"a CSV with the header {','.join(COLUMNS)}"
# a box whose underside is this near the floor stands on it
ON_FLOOR_M = 0.001


def read_boxes(path: Path, options: ImportOptions) -> Imported:
    """All boxes of the table as one level; class wall becomes walls, the rest fixtures.

    Raises:
        MapError: no such header, or a row that is not nine good values; with its line.
    """
    unit = check_unit(options.units or "m", path)
    notes = Notes(path)
    walls: list[DraftWall] = []
    fixtures: list[DraftFixture] = []
    for name, class_name, (x, y, z, yaw, sx, sy, sz) in _rows(path, METRES[unit]):
        bottom_m = z - sz / 2
        if class_name == "wall" and abs(bottom_m) < ON_FLOOR_M:
            ahead = (sx / 2 * math.cos(yaw), sx / 2 * math.sin(yaw))
            start, end = (x - ahead[0], y - ahead[1]), (x + ahead[0], y + ahead[1])
            walls.append(DraftWall(name, start, end, sy, sz))
        else:
            fixtures.append(DraftFixture(name, class_name, (x, y, yaw), (sx, sy, sz), bottom_m))
    kinds = [*("wall" for _ in walls), *(fixture.class_name for fixture in fixtures)]
    notes.read(f"{len(kinds)} boxes: {tally(kinds)}", boxes=len(kinds))
    if not options.units:
        notes.guessed("lengths are taken as metres: the table does not say", hint="--units decides")
        if finding := finding_of(judge_units("m", _evidence(walls, fixtures)), path):
            notes.found.append(finding)
    own = {fixture.class_name for fixture in fixtures} - set(RESTROOM_V1)
    if own:
        notes.guessed(f"classes the taxonomy does not have are declared as opaque: {', '.join(sorted(own))}")
    draft = Draft(
        path.stem,
        tuple(walls),
        tuple(fixtures),
        classes=tuple(ClassInfo(name) for name in sorted(own)),
        scan_plane_m=options.scan_plane_m,
        source=path.name,
        # a box in the table is a box in the map
        closed_corners=False,
    )
    return Imported((draft,), tuple(notes.found))


def _rows(path: Path, scale: float) -> Iterator[tuple[str, str, list[float]]]:
    """(name, class, seven numbers in metres and radians) of every row."""

    def fail(message: str, line: int, hint: str) -> MapError:
        return MapError(message, where=f"{path}:{line}", hint=hint)

    text = read_text(path, WHAT)
    kept = [(number, line) for number, line in enumerate(text.splitlines(), start=1) if _is_row(line)]
    if not kept:
        raise MapError("is empty", where=path, hint=f"name {WHAT}")
    header = [column.strip().lower() for column in next(csv.reader([kept[0][1]]))]
    if sorted(header) != sorted(COLUMNS):
        missing, odd = sorted(set(COLUMNS) - set(header)), sorted(set(header) - set(COLUMNS))
        message = f"the header lacks {', '.join(missing)}" if missing else "the header names a column twice"
        if odd:
            message += f" and has {', '.join(repr(o) for o in odd)}"
        raise fail(message, kept[0][0], f"the first line is {','.join(COLUMNS)}")
    names, seen = Names(), dict[str, int]()
    for number, line in kept[1:]:
        try:
            values = next(csv.reader([line], strict=True))
        except csv.Error as error:
            raise fail(f"not a row of CSV: {error}", number, "close the quotes") from error
        if len(values) != len(COLUMNS):
            raise fail(f"{len(values)} values, not {len(COLUMNS)}", number, f"one for each of {','.join(header)}")
        row = {column: value.strip() for column, value in zip(header, values, strict=True)}
        numbers = [_number(row[column]) for column in COLUMNS[2:]]
        for column, found in zip(COLUMNS[2:], numbers, strict=True):
            if found is None:
                raise fail(f"{column} is '{row[column]}', not a number", number, "digits with a decimal point")
        x, y, z, yaw, sx, sy, sz = (found for found in numbers if found is not None)
        if min(sx, sy, sz) <= 0:
            raise fail(f"the size is {sx:g} x {sy:g} x {sz:g}", number, "sx, sy and sz are above 0")
        if abs(yaw) > math.tau:
            raise fail(f"yaw is {yaw:g}, more than a turn", number, "radians, not degrees: 90 degrees are 1.570796")
        if not row["name"] or not row["class"]:
            raise fail(f"the {'name' if not row['name'] else 'class'} is empty", number, "give it one")
        if row["name"] in seen:
            raise fail(f"the name '{row['name']}' is taken by line {seen[row['name']]}", number, "give it another")
        seen[row["name"]] = number
        if not row["class"].replace("_", "").replace("-", "").isalnum():
            raise fail(f"the class is '{row['class']}'", number, closest(row["class"], RESTROOM_V1))
        lengths = [value * scale for value in (x, y, z, sx, sy, sz)]
        yield names.take(row["name"]), row["class"], [*lengths[:3], yaw, *lengths[3:]]


def _is_row(line: str) -> bool:
    return bool(line.strip()) and not line.lstrip().startswith("#")


def _number(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) and abs(value) < 1e9 else None


def _evidence(walls: list[DraftWall], fixtures: list[DraftFixture]) -> list[Evidence]:
    """Sizes that tell the unit, if it is not metres."""
    doors = [max(fixture.size_m[:2]) for fixture in fixtures if fixture.class_name == "door"]
    toilets = [max(fixture.size_m[:2]) for fixture in fixtures if fixture.class_name == "toilet"]
    return [
        Evidence("door leaf", np.array(doors)),
        Evidence("toilet", np.array(toilets)),
        Evidence("wall thickness", np.array([wall.thickness_m for wall in walls])),
        Evidence("storey height", np.array([wall.height_m for wall in walls])),
    ]
