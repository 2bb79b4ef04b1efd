"""Hand-marked line lists -> thin walls: YAML with `features`, each with a `source` and a `target` point.

The format of ipa-apartment's `lineMap`: lines marked on what a LiDAR sees, so each is the face of something, not its middle.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from wallkit.errors import MapError
from wallkit.maps.draft.draft import Draft, DraftWall
from wallkit.maps.importers.gaps import find_gaps, gap_list
from wallkit.maps.importers.imported import Imported, ImportOptions, Names, Notes
from wallkit.maps.importers.units import METRES, Evidence, check_unit, finding_of, judge_units
from wallkit.maps.importers.yaml import line_of, load_yaml, number

WHAT = "a YAML of lines: features with source [x, y, z] and target [x, y, z]"
THICKNESS_M = 0.02
# a line shorter than its own thickness has no direction
SHORTEST = 1.0


def read_lines(path: Path, options: ImportOptions) -> Imported:
    """All lines of the file as one level.

    Raises:
        MapError: not such a file, or an entry is malformed; with its line.
    """
    table = load_yaml(path, WHAT)
    features = table.get("features")
    if not isinstance(features, list) or not features:
        raise MapError("has no list of features", where=path, hint=f"name {WHAT}")
    notes = Notes(path)
    unit = check_unit(options.units or "m", path)
    walls = tuple(_walls(path, features, METRES[unit], options, notes))
    axes = np.array([(*wall.start, *wall.end) for wall in walls]).reshape(-1, 4)
    length_m = float(sum(wall.length_m for wall in walls))
    notes.read(f"{len(walls)} lines, {length_m:.1f} m, as walls", walls=len(walls), length_m=length_m)
    if not options.units:
        notes.guessed("lengths are taken as metres: the file does not say", hint="--units decides")
        extents = [np.ptp(axes.reshape(-1, 2), axis=0).max()] if walls else []
        if finding := finding_of(judge_units("m", [Evidence("extent", np.array(extents))]), path):
            notes.found.append(finding)
    if options.thickness_m is None:
        notes.guessed(
            f"walls are {THICKNESS_M:g} m thick, centred on their line: a marked line is a face", hint="--thickness"
        )
    if gaps := find_gaps(axes):
        text = f"{len(gaps)} gaps of up to 0.3 m between line ends: {gap_list(gaps)}"
        notes.add("WK-E020", "warning", text, hint="`wallkit map snap` closes them", gaps=len(gaps))
    draft = Draft(path.stem, walls, scan_plane_m=options.scan_plane_m, source=path.name)
    return Imported((draft,), tuple(notes.found))


def _walls(path: Path, features: list[Any], scale: float, options: ImportOptions, notes: Notes) -> Iterator[DraftWall]:
    names = Names()
    thickness_m = options.thickness_m or THICKNESS_M
    for index, feature in enumerate(features):
        line = line_of(features, index)
        ends = [_point(feature.get(key)) if isinstance(feature, dict) else None for key in ("source", "target")]
        start, end = ends
        if start is None or end is None:
            message = f"feature {index} has no points source and target, each of two or three numbers"
            raise MapError(message, where=f"{path}:{line}" if line else path, hint="source: [1.0, 2.0, 0.0]")
        start, end = (start[0] * scale, start[1] * scale), (end[0] * scale, end[1] * scale)
        if math.dist(start, end) < SHORTEST * thickness_m:
            notes.skipped(f"line {index} is {math.dist(start, end):.4f} m long, less than it is thick", line=line)
            continue
        yield DraftWall(names.take(f"line_{feature.get('id', index)}"), start, end, thickness_m, options.height_m)


def _point(value: Any) -> tuple[float, float] | None:
    numbers = [number(v) for v in value] if isinstance(value, list) else []
    if len(numbers) not in (2, 3) or any(n is None for n in numbers):
        return None
    x, y = numbers[:2]
    return (x, y) if x is not None and y is not None else None
