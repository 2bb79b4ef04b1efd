"""Open-RMF building.yaml (traffic editor) -> a draft per level: walls, doors with their motion, fixtures.

Coordinates are pixels of a drawing, y down, each level scaled by the mean metres per pixel of its measurements, as in
rmf_building_map_tools (`Level.calculate_scale_using_measurements`); levels are laid over each other by their fiducials.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from wallkit.core.types import Float64Array
from wallkit.errors import MapError, closest
from wallkit.maps.classes import class_from_name
from wallkit.maps.draft.doors import DoorMotion, DraftDoor
from wallkit.maps.draft.draft import Draft, DraftFixture, DraftOpening, DraftWall
from wallkit.maps.importers.doorways import hang_doors
from wallkit.maps.importers.fixtures import EXTRA_CLASSES, USUAL_SIZES, place_fixture
from wallkit.maps.importers.gaps import find_gaps, find_misses, find_near_duplicates, gap_list
from wallkit.maps.importers.imported import Imported, ImportOptions, Names, Notes, tally
from wallkit.maps.importers.units import Evidence, finding_of, judge_units
from wallkit.maps.importers.yaml import line_of, load_yaml, number

WHAT = "an Open-RMF building.yaml"
# rmf_building_map_tools builds walls 0.1 m thick (wall.py) and doors 2.2 m high (doors/door.py)
THICKNESS_M = 0.1
DOOR_HEIGHT_M = 2.2
# telescopes are said and simplified: their panels run as one
MOTIONS: dict[str, DoorMotion] = {
    "hinged": "hinged",
    "double_hinged": "double_hinged",
    "sliding": "sliding",
    "single_sliding": "sliding",
    "double_sliding": "double_sliding",
    "single_telescope": "sliding",
    "double_telescope": "double_sliding",
}


def read_rmf(path: Path, options: ImportOptions) -> Imported:
    """All levels of a building.

    Raises:
        MapError: not a building file, its coordinates are not metric, a level has no scale, or an entry is malformed.
    """
    building = load_yaml(path, WHAT)
    levels = building.get("levels")
    if not isinstance(levels, dict) or not levels:
        raise MapError("has no levels", where=path, hint=f"name {WHAT}")
    system = str(building.get("coordinate_system", "reference_image"))
    if system not in ("reference_image", "cartesian_meters"):
        raise MapError(
            f"coordinate_system is {system}: degrees on Earth or Mercator units, not metres",
            where=f"{path}:{line_of(building, 'coordinate_system')}",
            hint="in the traffic editor save the building as cartesian_meters, then import that",
        )
    notes = Notes(path)
    reader = _Reader(path, options, notes, system == "reference_image")
    reference = str(building.get("reference_level_name", next(iter(levels))))
    read = {str(name): reader.level(str(name), level) for name, level in levels.items()}
    drafts = [_aligned(level, read.get(reference, level), notes) for level in read.values()]
    if lifts := building.get("lifts"):
        notes.skipped(
            f"{len(lifts)} lifts ({', '.join(map(str, lifts))}): a level's map has no cabin",
            hint="add the shaft's walls and the landing doors by hand",
            line=line_of(building, "lifts"),
        )
    _judge_scale(drafts, path, notes)
    return Imported(tuple(drafts), tuple(notes.found))


@dataclass(frozen=True)
class _Level:
    draft: Draft
    fiducials: dict[str, Float64Array]


@dataclass(frozen=True)
class _Reader:
    """Reads the levels of one file."""

    path: Path
    options: ImportOptions
    notes: Notes
    is_image: bool

    def level(self, name: str, level: Any) -> _Level:
        if not isinstance(level, dict):
            raise self._fail(f"level '{name}' is {level!r}, not a table", None, "")
        for key in ("vertices", "measurements", "walls", "doors", "models", "floors", "holes", "fiducials"):
            if not isinstance(level.get(key) or [], list):
                raise self._fail(f"'{key}' of level '{name}' is not a list", line_of(level, key), "")
        pixels = self._points(level, "vertices")
        scale = self._scale(name, level, pixels) if self.is_image else 1.0
        per_m = np.array([scale, -scale if self.is_image else scale])
        points = pixels * per_m
        names = Names()
        walls = list(self._walls(level, points, names))
        doors = list(self._doors(level, points, names))
        walls_with_doors = hang_doors(doors, walls)
        fixtures = tuple(self._fixtures(name, level, per_m, walls, names))
        draft = Draft(
            f"{self.path.name.split('.')[0]}_{name}",
            tuple(walls_with_doors),
            fixtures,
            classes=tuple(info for name, info in EXTRA_CLASSES.items() if any(f.class_name == name for f in fixtures)),
            level=name,
            elevation_m=number(level.get("elevation", 0)) or 0.0,
            scan_plane_m=self.options.scan_plane_m,
            source=self.path.name,
        )
        self._say(name, level, walls, doors, points)
        marks = zip(level.get("fiducials") or [], self._points(level, "fiducials") * per_m, strict=True)
        return _Level(draft, {str(entry[2]): point for entry, point in marks if len(entry) > 2})

    def _points(self, level: Any, key: str) -> Float64Array:
        """(N, 2) of a list of [x, y, ...], as written."""
        found = []
        for index, entry in enumerate(level.get(key) or []):
            xy = [number(value) for value in entry[:2]] if isinstance(entry, list) else []
            if len(xy) != 2 or None in xy:
                line = line_of(level[key], index)
                raise self._fail(f"entry {index} of '{key}' is {entry!r}", line, "it begins with two numbers, x and y")
            found.append(xy)
        return np.array(found, dtype=np.float64).reshape(-1, 2)

    def _edges(
        self, level: Any, key: str, points: Float64Array
    ) -> Iterator[tuple[int, int, dict[str, Any], int | None]]:
        """(start, end, parameters, line) of walls, doors or measurements; parameters without RMF's type tags."""
        for index, entry in enumerate(level.get(key) or []):
            line = line_of(level[key], index)
            parameters = entry[2] if isinstance(entry, list) and len(entry) > 2 else {}
            if not isinstance(entry, list) or len(entry) < 2 or not isinstance(parameters, dict):
                raise self._fail(f"entry {index} of '{key}' is {entry!r}", line, "[vertex, vertex, {parameters}]")
            for vertex in entry[:2]:
                if isinstance(vertex, bool) or not isinstance(vertex, int) or not 0 <= vertex < len(points):
                    hint = f"the level has vertices 0 to {len(points) - 1}"
                    raise self._fail(f"entry {index} of '{key}' names the vertex {vertex!r}", line, hint)
            plain = {str(k): v[1] if isinstance(v, list) and len(v) == 2 else v for k, v in parameters.items()}
            yield entry[0], entry[1], plain, line

    def _scale(self, name: str, level: Any, pixels: Float64Array) -> float:
        """Mean metres per pixel over the level's measurements."""
        ratios = []
        for a, b, parameters, line in self._edges(level, "measurements", pixels):
            distance_m, length = number(parameters.get("distance")), math.dist(pixels[a], pixels[b])
            if distance_m is None or not distance_m > 0 or not length > 0:
                message = f"a measurement says {parameters.get('distance')!r} m over {length:.6g} pixels"
                raise self._fail(message, line, "both are above 0")
            ratios.append(distance_m / length)
        if not ratios:
            hint = "in the traffic editor add one measurement whose length is known"
            raise self._fail(f"level '{name}' has no measurements, so its pixels have no size", line_of(level), hint)
        scale = float(np.mean(ratios))
        spread = (max(ratios) - min(ratios)) / scale
        text = f"{len(ratios)} measurements agree to {spread:.1%}" if len(ratios) > 1 else "from a single measurement"
        self.notes.read(f"level {name}: {scale:.6g} m per pixel, {text}", scale_m=scale, spread=spread)
        return scale

    def _walls(self, level: Any, points: Float64Array, names: Names) -> Iterator[DraftWall]:
        thickness_m = self.options.thickness_m or THICKNESS_M
        for a, b, parameters, line in self._edges(level, "walls", points):
            if math.dist(points[a], points[b]) < thickness_m / 2:
                text = f"a wall of {math.dist(points[a], points[b]):.3f} m between vertices {a} and {b}"
                self.notes.skipped(f"{text}: shorter than half its thickness", line=line)
                continue
            height_m = number(parameters.get("texture_height")) or self.options.height_m
            yield DraftWall(names.take(f"wall_{a}_{b}"), _xy(points[a]), _xy(points[b]), thickness_m, height_m)

    def _doors(self, level: Any, points: Float64Array, names: Names) -> Iterator[DraftWall]:
        """Each door as a piece of wall that is all opening."""
        for a, b, parameters, line in self._edges(level, "doors", points):
            kind, length_m = str(parameters.get("type", "hinged")), math.dist(points[a], points[b])
            if kind not in MOTIONS or length_m < 0.2:
                self.notes.skipped(
                    f"the door '{parameters.get('name', '')}' of type '{kind}', {length_m:.2f} m wide",
                    hint=closest(kind, MOTIONS) if kind not in MOTIONS else "widen it to at least 0.2 m",
                    line=line,
                )
                continue
            if kind.endswith("telescope"):
                self.notes.guessed(
                    f"the {kind} door '{parameters.get('name', '')}' slides as one panel a side", line=line
                )
            name = names.take(str(parameters.get("name") or f"door_{a}_{b}"))
            is_start = parameters.get("motion_axis", "start") == "start"
            turn = number(parameters.get("motion_direction", 1)) or 1.0
            # the editor turns by +motion_direction in an image whose y points down, so +1 is to the right of start -> end
            # for a leaf at the start, and for both of a double door; the other way round for a leaf at the end
            to_right = (turn > 0) == (is_start or kind.startswith("double"))
            travel = math.radians(abs(number(parameters.get("motion_degrees", 90)) or 90.0))
            door = DraftDoor(
                name, MOTIONS[kind], "start" if is_start else "end", "right" if to_right else "left", travel
            )
            height_m = self.options.height_m
            opening = DraftOpening(f"{name}_hole", "door", (0.0, length_m), (0.0, min(DOOR_HEIGHT_M, height_m)), door)
            wall = names.take(f"over_{name}")
            thickness_m = self.options.thickness_m or THICKNESS_M
            yield DraftWall(wall, _xy(points[a]), _xy(points[b]), thickness_m, height_m, (opening,))

    def _fixtures(
        self, name: str, level: Any, per_m: Float64Array, walls: list[DraftWall], names: Names
    ) -> Iterator[DraftFixture]:
        moved, left_out, kinds = [], [], []
        for index, model in enumerate(level.get("models") or []):
            line = line_of(level["models"], index)
            keys = ("x", "y", "yaw")
            x, y, yaw = (number(model.get(k, 0)) for k in keys) if isinstance(model, dict) else (None,) * 3
            if x is None or y is None or yaw is None:
                raise self._fail(f"model {index} has no numbers x, y, yaw", line, "{model_name, x, y, yaw}")
            model_name = str(model.get("model_name", "")).split("/")[-1]
            class_name = class_from_name(model_name) or model_name.lower()
            if class_name not in USUAL_SIZES:
                left_out.append(model_name)
                continue
            at = np.array([x, y]) * per_m
            fixture, shift_m = place_fixture(names.take(class_name), class_name, (*_xy(at), yaw), walls)
            moved.append(shift_m)
            kinds.append(class_name)
            yield fixture
        if kinds:
            self.notes.guessed(
                f"level {name}: {tally(kinds)} of usual size (the file names meshes it does not hold), their backs to "
                f"the wall beside them, {np.median(moved):.2f} m (at most {max(moved):.2f} m) from where they are drawn"
            )
        if left_out:
            self.notes.skipped(
                f"level {name}: {len(left_out)} models of unknown size: {tally(left_out)}",
                hint="add those that stay where they are with `wallkit map add fixture`",
                line=line_of(level, "models"),
            )

    def _say(self, name: str, level: Any, walls: list[DraftWall], doors: list[DraftWall], points: Float64Array) -> None:
        """What was read of a level, and where its walls nearly meet."""
        widths = ", ".join(f"{door.length_m:.2f}" for door in sorted(doors, key=lambda d: d.length_m))
        self.notes.read(
            f"level {name}: {len(walls)} walls, {sum(wall.length_m for wall in walls):.1f} m; {len(doors)} doors"
            + (f" ({widths} m)" if doors else ""),
            walls=len(walls),
            length_m=sum(wall.length_m for wall in walls),
            doors=len(doors),
        )
        sheer = [p for *_, p, _ in self._edges(level, "walls", points) if (number(p.get("alpha", 1)) or 0.0) < 1]
        if sheer:
            self.notes.guessed(
                f"level {name}: {len(sheer)} walls are drawn transparent (alpha below 1), and read as opaque walls",
                hint="if they are of glass, set their class: `wallkit map set FILE NAME class=glass`",
            )
        if count := len(level.get("floors") or []):
            self.notes.skipped(f"level {name}: {count} floor polygons: ground textures, not rooms")
        self._say_gaps(name, walls, points)

    def _say_gaps(self, name: str, walls: list[DraftWall], points: Float64Array) -> None:
        axes = np.array([(*wall.start, *wall.end) for wall in walls]).reshape(-1, 4)
        if not len(axes):
            return
        if gaps := find_gaps(axes):
            text = f"level {name}: {len(gaps)} gaps of up to 0.3 m between wall ends: {gap_list(gaps)}"
            self.notes.add("WK-E020", "warning", text, hint="`wallkit map snap` closes them", gaps=len(gaps))
        if misses := find_misses(axes, np.array([wall.thickness_m for wall in walls])):
            text = f"level {name}: {len(misses)} walls stop short of the wall they run into: {gap_list(misses)}"
            self.notes.add("WK-E022", "warning", text, hint="`wallkit map snap` closes them", gaps=len(misses))
        if twins := find_near_duplicates(points):
            pairs = ", ".join(f"{i} and {j} ({apart_m * 1000:.0f} mm)" for i, j, apart_m in twins)
            text = f"level {name}: {len(twins)} vertices are nearly the same: {pairs}"
            hint = "merge them in the traffic editor"
            self.notes.add("import.duplicates", "warning", text, hint=hint, pairs=len(twins))

    def _fail(self, message: str, line: int | None, hint: str) -> MapError:
        return MapError(message, where=f"{self.path}:{line}" if line else self.path, hint=hint or f"name {WHAT}")


def _aligned(level: _Level, reference: _Level, notes: Notes) -> Draft:
    """The level moved so that its fiducials lie on those of the same name on the reference level."""
    shared = sorted(set(level.fiducials) & set(reference.fiducials))
    if level is reference:
        return level.draft
    if not shared:
        if level.draft.walls:
            notes.guessed(
                f"level {level.draft.level} shares no fiducial with {reference.draft.level}: left where it is"
            )
        return level.draft
    apart = np.array([reference.fiducials[name] - level.fiducials[name] for name in shared])
    dx, dy = apart.mean(axis=0)
    left_m = float(np.hypot(*(apart - apart.mean(axis=0)).T).max())
    notes.read(
        f"level {level.draft.level} moved by ({dx:.3f}, {dy:.3f}) m onto {reference.draft.level} by {len(shared)} "
        f"fiducials, which then agree to {left_m:.3f} m",
        residual_m=left_m,
    )

    def moved(at: tuple[float, float]) -> tuple[float, float]:
        return at[0] + float(dx), at[1] + float(dy)

    return replace(
        level.draft,
        walls=tuple(replace(wall, start=moved(wall.start), end=moved(wall.end)) for wall in level.draft.walls),
        fixtures=tuple(replace(f, pose=(*moved(f.pose[:2]), f.pose[2])) for f in level.draft.fixtures),
    )


def _judge_scale(drafts: list[Draft], path: Path, notes: Notes) -> None:
    """Doors tell whether the measurements were made in metres."""
    openings = [opening for draft in drafts for wall in draft.walls for opening in wall.openings]
    leaves = [
        (o.along[1] - o.along[0]) / (2 if o.fill.motion.startswith("double") else 1)
        for o in openings
        if isinstance(o.fill, DraftDoor)
    ]
    finding = finding_of(judge_units("m", [Evidence("door leaf", np.array(leaves))]), path)
    if finding:
        notes.found.append(finding)


def _xy(point: Float64Array) -> tuple[float, float]:
    return float(point[0]), float(point[1])
