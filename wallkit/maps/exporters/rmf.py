"""A semantic map -> Open-RMF building.yaml: a level of walls, doors with their motion, models, floors.

Coordinates are pixels, y down, as the traffic editor draws them; pixel (0, 0) is the map's origin, and measurements carry
the scale. `wallkit.maps.importers.rmf` reads the same walls and doors back.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from wallkit.core.types import Float64Array
from wallkit.errors import MapError
from wallkit.maps.exporters.exported import Exported, ExportOptions, Notes, lose_meaning, things
from wallkit.maps.exporters.rmf_doors import RmfDoor, rmf_doors
from wallkit.maps.exporters.rmf_lines import Line, lines_and_gaps
from wallkit.maps.geometry import Part, parts
from wallkit.maps.importers.imported import tally
from wallkit.maps.importers.rmf import DOOR_HEIGHT_M, THICKNESS_M
from wallkit.maps.model import SemanticMap
from wallkit.maps.walls import wall_axes

METRES_PER_PIXEL = 0.01
# vertices this close are one; RMF's walls share them
VERTEX_M = 0.001
# what RMF has only walls for; those that are seen through are drawn so
WALL_CLASSES = ("wall", "partition", "glass", "window", "column")
SEE_THROUGH_ALPHA = 0.5
# rmf_building_map_tools builds every wall this high
HEIGHT_M = 2.5
# models of the RMF demos' library (app.gazebosim.org, OpenRobotics)
MODELS = {"toilet": "Toilet", "sink": "BathroomSink", "shower": "Shower", "trash": "TrashBin"}
FLOOR_LOOK = {
    "texture_name": [1, "blue_linoleum"],
    "texture_rotation": [3, 0],
    "texture_scale": [3, 1],
    "indoor": [2, 0],
}


def export_rmf(semantic_map: SemanticMap, out: Path, options: ExportOptions) -> Exported:
    """One .building.yaml with the map's level.

    Raises:
        MapError: there is no wall, so nothing could carry the scale.
    """
    notes = Notes(semantic_map.source, "RMF")
    poses = semantic_map.poses(semantic_map.door_states("closed"))
    solids = parts(semantic_map, poses=poses)
    fills = {opening.fill for link in semantic_map.links.values() for opening in link.openings}
    leaves = {link for joint in semantic_map.doors for link in semantic_map.subtree(joint.child)}
    standing = [part for part in solids if part.link not in fills | leaves]
    runs = wall_axes(semantic_map, standing, classes=WALL_CLASSES)
    lines, gaps = lines_and_gaps(semantic_map, runs, poses)
    doors, doorless = rmf_doors(semantic_map, gaps)
    if not lines:
        raise MapError(
            "has no wall that RMF could draw", where=semantic_map.source, hint="boxes of class wall make walls"
        )
    vertices = _Vertices()
    walls = [_wall(semantic_map, line, vertices) for line in lines]
    hung = [[vertices.at(door.start), vertices.at(door.end), door.parameters] for door in doors]
    floors = [
        {"parameters": FLOOR_LOOK, "vertices": [vertices.at(corner) for corner in room.floor]}
        for room in semantic_map.rooms.values()
        if room.floor is not None
    ]
    run_links = {run.link for run in runs}
    others = [link.name for link in things(semantic_map) if link.name not in run_links | fills | leaves]
    models = list(_models(semantic_map, others, standing, poses, notes))
    level = semantic_map.header.level or "L1"
    name = semantic_map.name or out.name.split(".")[0]
    elevation_m = semantic_map.header.elevation_m or 0.0
    entries: dict[str, list[Any]] = {
        "doors": hung,
        "floors": floors,
        "measurements": vertices.measurements(),
        "models": models,
        "vertices": vertices.rows(),
        "walls": walls,
    }
    widths = ", ".join(f"{door.width_m:.2f}" for door in sorted(doors, key=lambda door: door.width_m))
    length_m = sum(line.length_m for line in lines)
    notes.wrote(
        f"level {level}: {len(lines)} walls, {length_m:.1f} m; {len(doors)} doors{f' ({widths} m)' if doors else ''}; "
        f"{len(models)} models; {len(floors)} floors",
        walls=len(lines),
        length_m=length_m,
        doors=len(doors),
    )
    _say_lost(notes, semantic_map, lines, doors, others, models)
    notes.lose("door without an opening", doorless, many="doors without an opening")
    return Exported({out: _yaml(name, level, elevation_m, entries)}, notes.all())


class _Vertices:
    """The points of a level, each once."""

    def __init__(self) -> None:
        self._points: list[Float64Array] = []
        self._cells: dict[tuple[int, int], int] = {}

    def at(self, point: Float64Array) -> int:
        """Index of a point (2,) [m], new if none is within VERTEX_M."""
        column, row = (int(v) for v in np.floor(np.asarray(point) / VERTEX_M))
        for near in ((column + i, row + j) for i in (0, -1, 1) for j in (0, -1, 1)):
            index = self._cells.get(near)
            if index is not None and np.hypot(*(self._points[index] - point)) <= VERTEX_M:
                return index
        self._cells[column, row] = len(self._points)
        self._points.append(np.asarray(point, dtype=np.float64))
        return len(self._points) - 1

    def rows(self) -> list[list[Any]]:
        return [[_pixels(x), _pixels(-y), 0, ""] for x, y in self._points]

    def measurements(self) -> list[list[Any]]:
        """The longest distances in x and in y, so that the scale is known to rounding."""
        points = np.array(self._points)
        ends = [int(pick(points[:, axis])) for axis in (0, 1) for pick in (np.argmin, np.argmax)]
        pairs = {tuple(sorted(pair)) for pair in combinations(ends, 2) if pair[0] != pair[1]}
        longest = sorted(pairs, key=lambda pair: -float(np.hypot(*(points[pair[0]] - points[pair[1]]))))[:2]
        return [[a, b, {"distance": [3, round(math.dist(points[a], points[b]), 6)]}] for a, b in longest]


def _wall(semantic_map: SemanticMap, line: Line, vertices: _Vertices) -> list[Any]:
    info = semantic_map.class_of(line.run.link)
    is_seen_through = info is not None and info.lidar in ("glass", "perforated", "none")
    look = {
        "alpha": [3, SEE_THROUGH_ALPHA if is_seen_through else 1],
        "texture_height": [3, round(line.run.height_m, 4)],
        "texture_name": [1, "default"],
        "texture_scale": [3, 1],
        "texture_width": [3, 1],
    }
    return [vertices.at(line.start), vertices.at(line.end), look]


def _models(
    semantic_map: SemanticMap,
    links: Sequence[str],
    standing: Sequence[Part],
    poses: Mapping[str, Float64Array],
    notes: Notes,
) -> Iterator[dict[str, Any]]:
    """What is neither wall nor door, at the middle of what it covers."""
    import shapely

    by_link: dict[str, list[Part]] = {}
    for part in standing:
        by_link.setdefault(part.link, []).append(part)
    nameless = []
    for name in links:
        if name not in by_link:
            continue
        class_name = semantic_map.links[name].class_name or "unknown"
        centre = shapely.union_all([part.footprint for part in by_link[name]]).envelope.centroid
        T = poses[name]
        model = f"OpenRobotics/{MODELS[class_name]}" if class_name in MODELS else class_name
        if class_name not in MODELS:
            nameless.append(class_name)
        yield {
            "model_name": model,
            "name": name,
            "static": True,
            "x": _pixels(centre.x),
            "y": _pixels(-centre.y),
            "yaw": round(math.atan2(T[1, 0], T[0, 0]), 6),
            "z": round(min(part.z_m[0] for part in by_link[name]), 6) + 0.0,
        }
    if nameless:
        notes.taken(
            f"{len(nameless)} models carry the name of their class, for which RMF's library has none: {tally(nameless)}"
        )


def _say_lost(
    notes: Notes,
    semantic_map: SemanticMap,
    lines: Sequence[Line],
    doors: Sequence[RmfDoor],
    others: Sequence[str],
    models: Sequence[Mapping[str, Any]],
) -> None:
    not_walls = {line.run.link: semantic_map.links[line.run.link].class_name for line in lines}
    odd = tally(name for name in not_walls.values() if name != "wall")
    if odd:
        notes.taken(f"walls too: {odd}")
    thicknesses = {line.run.link for line in lines if abs(line.run.thickness_m - THICKNESS_M) > VERTEX_M}
    heights = {line.run.link for line in lines if abs(line.run.height_m - HEIGHT_M) > VERTEX_M}
    tall = sum(abs(door.height_m - DOOR_HEIGHT_M) > VERTEX_M for door in doors)
    openings = [opening for link in semantic_map.links.values() for opening in link.openings]
    notes.lose(
        f"thickness other than {THICKNESS_M:g} m", len(thicknesses), many=f"thicknesses other than {THICKNESS_M:g} m"
    )
    notes.lose("height", len(heights) + tall)
    notes.lose("size of a model", len(models), many="sizes of models")
    notes.lose("element without a footprint", len(others) - len(models), many="elements without a footprint")
    notes.lose("name of a room", len(semantic_map.rooms), many="names of rooms")
    notes.lose("window", sum(opening.kind == "window" for opening in openings))
    lose_meaning(notes, semantic_map, but={"class", "declared opening", "room"})


def _pixels(metres: float) -> float:
    return round(metres / METRES_PER_PIXEL, 4) + 0.0


def _yaml(name: str, level: str, elevation_m: float, entries: Mapping[str, list[Any]]) -> bytes:
    """The file: block style for what is long, JSON (which is YAML) for each entry, as the traffic editor writes it."""
    lines = ["coordinate_system: reference_image", "graphs: {}", "levels:", f"  {json.dumps(level)}:"]
    lines += ['    drawing: {filename: ""}', f"    elevation: {elevation_m:.9g}", "    lanes: []"]
    for key, rows in entries.items():
        lines.append(f"    {key}:" if rows else f"    {key}: []")
        lines += [f"      - {json.dumps(row)}" for row in rows]
    lines += ["lifts: {}", f"name: {json.dumps(name)}", f"reference_level_name: {json.dumps(level)}"]
    return ("\n".join(lines) + "\n").encode()
