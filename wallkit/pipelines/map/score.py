"""A map file and a robot -> its localisability as figures, words and a heat map; or the scan expected at one pose."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wallkit.core.types import Float64Array
from wallkit.errors import MapError
from wallkit.maps.draft.write import write_draft
from wallkit.maps.importers import ImportOptions, import_map
from wallkit.maps.read import load_map
from wallkit.maps.rules.base import Context
from wallkit.maps.rules.outlook import robot_in_words, score_settings, world
from wallkit.maps.rules.tolerances import Tolerances
from wallkit.maps.score.rivals import CONTINUUM, MOST_RIVALS
from wallkit.maps.score.score import Ambiguity, Localisability, score
from wallkit.maps.score.world import ScoreSettings, World
from wallkit.maps.sight import cast_beams, index_segments
from wallkit.maps.xml import parse
from wallkit.pipelines.maps import is_semantic

# a raster says nothing of heights: its walls are cut here
_RASTER_PLANE_M = 0.3


@dataclass(frozen=True, eq=False)
class Scored:
    """A map's world, the robot in words, and what came out."""

    world: World
    robot: str
    result: Localisability


@dataclass(frozen=True, eq=False)
class Probe:
    """The scan expected at a pose.

    Attributes:
        bearings_rad: (K,) from the heading. ranges_m: (K,) infinite for no return.
        links, classes: (K,) what each beam meets, "" for nothing. Beams pass through what seldom returns.
    """

    world: World
    robot: str
    pose: tuple[float, float, float]
    bearings_rad: Float64Array
    ranges_m: Float64Array
    links: tuple[str, ...]
    classes: tuple[str, ...]

    def shares(self) -> dict[str, float]:
        """Share of the beams per class met, most first; "" for none."""
        names, counts = np.unique(np.array(self.classes), return_counts=True)
        order = np.lexsort((names, -counts))
        return {str(names[i]): float(counts[i] / len(self.classes)) for i in order}

    def nearest(self) -> list[tuple[str, str, int, float]]:
        """(link, class, beams, shortest range [m]) of all that is met, most beams first."""
        rows = []
        for link in sorted(set(self.links) - {""}):
            hit = np.array([name == link for name in self.links])
            class_name = self.classes[int(np.flatnonzero(hit)[0])]
            rows.append((link, class_name, int(hit.sum()), float(self.ranges_m[hit].min())))
        return sorted(rows, key=lambda row: (-row[2], row[0]))


def score_map(path: Path, tolerances: Tolerances, *, poses: int, seed: int) -> Scored:
    """The localisability of a map.

    Raises:
        MapError: it cannot be read, has no world at the LiDAR's height, or the robot fits nowhere.
    """
    context = _context(path, tolerances)
    found = context.once(world)
    return Scored(found, _robot(context), score(found, score_settings(context, poses=poses), seed=seed))


def probe_map(path: Path, tolerances: Tolerances, pose: tuple[float, float, float]) -> Probe:
    """What the LiDAR should measure at a pose (x, y, yaw) of frame map.

    Raises:
        MapError: as `score_map`; or nobody can be there.
    """
    from shapely import Point

    context = _context(path, tolerances)
    found, cut = context.once(world), context.scan_slice
    assert cut is not None
    where = f"({pose[0]:g}, {pose[1]:g})"
    place = Point(*pose[:2])
    for part, polygon in zip(cut.parts, cut.polygons, strict=True):
        if polygon.contains(place):
            raise MapError(
                f"{where} is inside '{part.link}', a {part.class_name or 'thing'}",
                where=path,
                hint=_free_hint(found, place),
            )
    if not found.free.buffer(1e-6).contains(place):
        raise MapError(f"{where} is outside: no floor is there", where=path, hint=_free_hint(found, place))
    settings = score_settings(context)
    bearings = (np.arange(settings.beams) / settings.beams - 0.5) * math.radians(settings.fov_deg)
    returns = found.p_return >= settings.p_return_min
    sight = index_segments(found.segments, seen=returns)
    seen = cast_beams(sight, np.array([pose]), bearings, range_max_m=settings.max_range_m)
    met = seen.segments[0].tolist()
    owners = cut.owners
    return Probe(
        found,
        _robot(context),
        pose,
        bearings,
        seen.ranges_m[0],
        tuple(owners[s] if s >= 0 else "" for s in met),
        tuple(found.class_names[found.classes[s]] if s >= 0 else "" for s in met),
    )


def summary_lines(scored: Scored) -> list[str]:
    """The score in five lines: ambiguity, with labels, what helps, directions, what is in sight; then the worst places."""
    result = scored.result
    plain, labelled = result.plain, result.labelled
    lines = [
        f"{_percent(plain.share)} of {len(result.poses)} poses are ambiguous by ranges alone: {_modes(plain)}",
        f"{_percent(labelled.share)} when every return also tells its class"
        + ("" if labelled is not plain or not plain.share else " (no class but one is in sight)"),
        _landmarks(result),
        _directions(result),
        _in_sight(result),
    ]
    for i in plain.worst(result.poses).tolist():
        lines.append(
            f"  worst {_pose(result.poses[i])}: {_alike(int(plain.modes[i]))}, one of them {_pose(plain.rivals[i])}"
        )
    return lines


def score_document(scored: Scored) -> dict[str, Any]:
    """The score for JSON."""
    result, settings = scored.result, scored.result.settings
    seen = result.seen
    return {
        "file": scored.world.source,
        "robot": {"max_range_m": settings.max_range_m, "radius_m": settings.robot_radius_m, "beams": settings.beams},
        "poses": len(result.poses),
        "plain": _ambiguity_document(result.plain),
        "labelled": _ambiguity_document(result.labelled),
        "landmarks": result.landmarks,
        "degenerate": {"share": float(seen.degenerate.mean()), "direction_rad": seen.open_direction},
        "glass_share": seen.glass_share,
        "movable_share": seen.movable_share,
        "empty_share": float(seen.is_empty.mean()),
        "seen_from": seen.from_share,
        "worst": [
            {"pose": result.poses[i], "modes": _number(int(result.plain.modes[i])), "rival": result.plain.rivals[i]}
            for i in result.plain.worst(result.poses).tolist()
        ],
    }


# -------------------------------------------------------------------------------------------- details


def _context(path: Path, tolerances: Tolerances) -> Context:
    if is_semantic(path):
        return Context(load_map(path).document, tolerances)
    drafts = import_map(path, ImportOptions(scan_plane_m=_RASTER_PLANE_M)).drafts
    if not drafts:
        raise MapError("holds no walls", where=path, hint="name a .wkmap.urdf or a map_server YAML")
    return Context(parse(write_draft(drafts[0]), str(path)), tolerances)


def _robot(context: Context) -> str:
    return f"scan plane {context.scan_plane_m:g} m, {robot_in_words(context)}, {context.tolerances.beams} beams"


def _free_hint(found: World, place: Any) -> str:
    from shapely.ops import nearest_points

    settings = ScoreSettings()
    inner = found.free.buffer(-settings.robot_radius_m)
    near, _ = nearest_points(inner if not inner.is_empty else found.free, place)
    return f"the nearest place that a robot can be is {near.x:.2f} {near.y:.2f}"


def _ambiguity_document(ambiguity: Ambiguity) -> dict[str, Any]:
    modes = {"continuum" if m == CONTINUUM else str(m): count for m, count in ambiguity.mode_counts.items()}
    return {"ambiguous_share": ambiguity.share, "typical_modes": _number(ambiguity.typical_modes), "modes": modes}


def _number(modes: int) -> int | str:
    return "continuum" if modes == CONTINUUM else modes


def _modes(ambiguity: Ambiguity) -> str:
    total = len(ambiguity.modes)
    pieces = [f"{_alike(m)} from {_percent(count / total)}" for m, count in ambiguity.mode_counts.items()]
    return ", ".join(pieces[:4])


def _alike(modes: int) -> str:
    if modes == CONTINUUM:
        return "a whole line of poses alike"
    if modes > MOST_RIVALS:
        return f"more than {MOST_RIVALS} modes"
    return f"{modes} mode{'s' if modes != 1 else ''}"


def _landmarks(result: Localisability) -> str:
    if not result.plain.share:
        return "no landmark is needed"
    best = sorted(result.landmarks.items(), key=lambda item: (item[1], item[0]))[:3]
    if not best:
        return "no class of the map would help: add a landmark of another class (a door, a column, a bin)"
    return "recognising one class alone would leave: " + ", ".join(f"{name} {_percent(left)}" for name, left in best)


def _directions(result: Localisability) -> str:
    share, direction = float(result.seen.degenerate.mean()), result.seen.open_direction
    if direction is None:
        return "walls in both directions are in range from everywhere"
    return f"from {_percent(share)} of the floor nothing tells the place along {math.degrees(direction):.0f} deg"


def _in_sight(result: Localisability) -> str:
    seen = result.seen
    glass, movable = _percent(seen.glass_share), _percent(seen.movable_share)
    boundary = f"{glass} of the visible boundary is glass or mirror, {movable} movable"
    return f"{boundary}; nothing is in range from {_percent(float(seen.is_empty.mean()))} of the floor"


def _percent(share: float) -> str:
    return f"{share:.1%}" if 0 < share < 0.1 else f"{share:.0%}"


def _pose(pose: Float64Array) -> str:
    x, y, yaw = pose.tolist()
    return f"({x:.2f}, {y:.2f}, {math.degrees(yaw) % 360:.0f} deg)"
