"""The plan's groups -> the page around them: title, room names, scale bar, axes, legend, and findings with their numbers."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from wallkit.core.types import Float64Array
from wallkit.maps.draw.findings import FINDING_STYLES, finding_groups
from wallkit.maps.draw.marks import INK, MUTED, Area, Drawing, Group, Line, Mark, Style, Text, mixed, text_width_px
from wallkit.maps.geometry import Part
from wallkit.maps.model import SemanticMap

if TYPE_CHECKING:
    from wallkit.maps.draw.plan import PlanSettings
    from wallkit.maps.rules.base import MapFinding

_MARGIN_PX = 28.0
_HEAD_PX = 58.0
_FOOT_PX = 44.0
_LEGEND_PX = 20.0
_LEAST_WIDTH_PX = 480.0
# the room around the walls
_AIR_M = 0.25

PAGE_STYLES: Mapping[str, Style] = {
    "bar": Style(fill=INK),
    "bar-light": Style(fill="#ffffff", stroke=INK, width_px=1.0),
    "tag": Style(fill="#ffffff", opacity=0.8),
    "north": Style(fill="#b03a2e"),
}


def page_of(
    semantic_map: SemanticMap,
    plan: Sequence[Group],
    styles: Mapping[str, Style],
    solids: Sequence[Part],
    settings: PlanSettings,
    findings: Sequence[MapFinding],
) -> Drawing:
    """The whole drawing: as large as the settings allow, with a page around the plan."""
    corners = [mark_points(mark) for group in plan for mark in group.marks]
    corners += [np.array([finding.xyz[:2]]) for finding in findings if len(finding.xyz) >= 2]
    points = np.concatenate(corners)
    low, high = points.min(axis=0) - _AIR_M, points.max(axis=0) + _AIR_M
    across, up = (high - low).tolist()
    scale = min((settings.width_px - 2 * _MARGIN_PX) / across, (settings.height_px - _HEAD_PX - _FOOT_PX) / up)
    width = max(across * scale + 2 * _MARGIN_PX, _LEAST_WIDTH_PX)
    left = (width - across * scale) / 2
    origin = (left - float(low[0]) * scale, _HEAD_PX + float(high[1]) * scale)
    drawing = Drawing((width, 0.0), scale, origin, dict(styles), tuple(plan), title=_title(semantic_map))
    bottom = _HEAD_PX + up * scale
    page = [
        _heading(semantic_map, solids, settings, len(findings) if findings else None),
        *_room_names(semantic_map, solids, drawing),
        *(_link_names(solids, drawing) if settings.names else []),
        *_window_heights(semantic_map, solids, drawing),
        _scale_bar(drawing, bottom + 14),
        _axes(semantic_map, width - _MARGIN_PX - 30, bottom + 24),
    ]
    legend, bottom = _legend(semantic_map, solids, settings, (width, bottom + _FOOT_PX))
    page.append(legend)
    marks, bottom = finding_groups(semantic_map, findings, solids, drawing, bottom)
    return Drawing(
        (round(width), round(bottom + 16)),
        scale,
        origin,
        {**styles, **PAGE_STYLES, **FINDING_STYLES},
        tuple(plan),
        (*page, *marks),
        drawing.title,
    )


def mark_points(mark: Mark) -> Float64Array:
    """(N, 2) of a mark in the plan."""
    if isinstance(mark, Area):
        return mark.rings[0]
    return mark.points if isinstance(mark, Line) else np.array([mark.at])


# -------------------------------------------------------------------------------------------- details


def _title(semantic_map: SemanticMap) -> str:
    level = semantic_map.header.level
    return f"Floor plan of {semantic_map.name or 'a map'}" + (f", level {level}" if level else "")


def _heading(semantic_map: SemanticMap, solids: Sequence[Part], settings: PlanSettings, findings: int | None) -> Group:
    header = semantic_map.header
    said = [f"level {header.level}" if header.level else ""]
    said.append(f"{header.elevation_m:+.2f} m above datum" if header.elevation_m is not None else "")
    walls = [part.z_m[1] for part in solids if part.class_name == "wall"]
    said.append(f"walls up to {max(walls):.2f} m" if walls else "")
    if settings.z_m is not None:
        said.append(f"bold: what a plane at {settings.z_m:.2f} m cuts")
    elif header.scan_plane_m is not None:
        said.append(f"LiDAR at {header.scan_plane_m:.2f} m")
    said.append("" if findings is None else f"{findings} finding{'s' * (findings != 1)}")
    line = "  ·  ".join(text for text in said if text)
    marks = (
        Text((_MARGIN_PX, 22), semantic_map.name or "map", 17, is_bold=True),
        Text((_MARGIN_PX, 42), line, 11.5, colour=MUTED),
    )
    return Group("page:title", "title", marks)


def _room_names(semantic_map: SemanticMap, solids: Sequence[Part], drawing: Drawing) -> list[Group]:
    """Each name where most of the floor is free, with the room's area."""
    import shapely

    swings = [shapely.MultiPoint(points).convex_hull for points in _swept_points(drawing)]
    footprints = np.array([*(part.footprint for part in solids), *swings], dtype=object)
    tree = shapely.STRtree(footprints)
    groups = []
    for room in semantic_map.rooms.values():
        if room.floor is None:
            continue
        floor = shapely.make_valid(shapely.Polygon(room.floor))
        if floor.is_empty or floor.area == 0.0:
            continue
        inside = footprints[tree.query(floor, predicate="intersects")]
        free = floor.difference(shapely.union_all(list(inside))) if len(inside) else floor
        circle = shapely.maximum_inscribed_circle(free if not free.is_empty else floor, tolerance=0.05)
        (x, y) = drawing.to_page(shapely.get_coordinates(circle)[:1])[0].tolist()
        bounds = floor.bounds
        across = (bounds[2] - bounds[0]) * drawing.scale
        size = min(14.0, max(7.0, across / max(0.62 * len(room.id), 1.0)))
        marks = (
            Text((x, y - 0.55 * size), room.id, size, "middle", is_bold=True),
            Text((x, y + 0.65 * size), f"{floor.area:.1f} m²", max(0.82 * size, 7.0), "middle", MUTED),
        )
        groups.append(Group(f"name:{room.id}", "room-name", marks))
    return groups


def _swept_points(drawing: Drawing) -> list[Float64Array]:
    """Of every door, the leaf and its way: where no name should stand."""
    doors = [group for group in drawing.plan if any(getattr(mark, "style", "") == "swing" for mark in group.marks)]
    return [np.concatenate([mark_points(mark) for mark in group.marks]) for group in doors]


def _link_names(solids: Sequence[Part], drawing: Drawing) -> list[Group]:
    first: dict[str, Part] = {}
    for part in solids:
        first.setdefault(part.link, part)
    groups = []
    for link, part in first.items():
        x, y = drawing.to_page(np.array(part.footprint.centroid.coords))[0].tolist()
        width = text_width_px(link, 8.5) + 4
        tag = Area((_box(x - width / 2, y + 4, width, 12),), "tag")
        groups.append(Group(f"link-name:{link}", "link-name", (tag, Text((x, y + 10), link, 8.5, "middle", "#7a4b00"))))
    return groups


def _window_heights(semantic_map: SemanticMap, solids: Sequence[Part], drawing: Drawing) -> list[Group]:
    """Sill and head of every window, outside of the building."""
    centre = np.mean([part.footprint.centroid.coords[0] for part in solids], axis=0) if solids else np.zeros(2)
    poses = semantic_map.poses()
    groups = []
    for link in semantic_map.links.values():
        T = poses.get(link.name)
        for opening in link.openings:
            if T is None or opening.kind != "window" or not np.all(np.isfinite([*opening.along_m, *opening.z_m])):
                continue
            middle = (T @ [sum(opening.along_m) / 2, 0.0, 0.0, 1.0])[:2]
            along = T[:2, 0]
            out = np.array([-along[1], along[0]])
            out = out if (middle - centre) @ out >= 0 else -out
            deep_m = max((shape.size[1] for shape in link.shapes if shape.kind == "box"), default=0.0)
            x, y = drawing.to_page((middle + out * (deep_m / 2 + 8 / drawing.scale))[None])[0].tolist()
            turn = math.degrees(math.atan2(along[1], along[0]))
            turn = (turn + 90) % 180 - 90
            words = f"{opening.z_m[0]:.2f} – {opening.z_m[1]:.2f}"
            text = Text((x, y), words, 8.0, "middle", MUTED, turn_deg=round(turn, 3) + 0.0)
            groups.append(Group(f"heights:{link.name}:{opening.id}", "heights", (text,)))
    return groups


def _scale_bar(drawing: Drawing, y: float) -> Group:
    """Four stretches, dark and light."""
    wanted_m = 150 / drawing.scale
    step = 10 ** math.floor(math.log10(wanted_m))
    length_m = max((n * step for n in (1, 2, 5) if n * step <= wanted_m), default=step)
    quarter = length_m * drawing.scale / 4
    marks: list[Mark] = [
        Area((_box(_MARGIN_PX + k * quarter, y, quarter, 6.0),), "bar" if k % 2 == 0 else "bar-light") for k in range(4)
    ]
    for share, text in ((0.0, "0"), (0.5, f"{length_m / 2:g}"), (1.0, f"{length_m:g} m")):
        marks.append(Text((_MARGIN_PX + 4 * quarter * share, y + 16), text, 10, "middle", MUTED))
    return Group("page:scale", "scale", tuple(marks))


def _axes(semantic_map: SemanticMap, x: float, y: float) -> Group:
    """The map's x and y, and north where the map is surveyed: <wk:origin yaw> turns the map's x from east."""
    marks: list[Mark] = []
    arrows = [(0.0, "x", INK), (math.pi / 2, "y", INK)]
    survey = semantic_map.header.survey
    if survey is not None and survey.kind != "none" and survey.yaw_rad is not None:
        arrows.append((math.pi / 2 - survey.yaw_rad, "N", "#b03a2e"))
        x -= 50
    for index, (angle, name, colour) in enumerate(arrows):
        base = np.array([x + 50, y + 4]) if index == 2 else np.array([x, y + 10])
        along = np.array([math.cos(angle), -math.sin(angle)])
        across = np.array([-along[1], along[0]])
        length = 22.0
        tip = base + along * length
        shaft = [
            base - across * 0.6,
            base + across * 0.6,
            tip + across * 0.6 - along * 5,
            tip - across * 0.6 - along * 5,
        ]
        head = [tip, tip - along * 7 + across * 3, tip - along * 7 - across * 3]
        style = "north" if index == 2 else "bar"
        marks += [Area((np.array(shaft),), style), Area((np.array(head),), style)]
        u, v = (tip + along * 7).tolist()
        marks.append(Text((u, v), name, 10, "middle", colour, is_bold=index == 2))
    return Group("page:axes", "axes", tuple(marks))


def _legend(
    semantic_map: SemanticMap, solids: Sequence[Part], settings: PlanSettings, at: tuple[float, float]
) -> tuple[Group, float]:
    """A patch and a word for every class in the plan, in rows; and where the rows end."""
    from wallkit.maps.draw.plan import class_style

    width, y = at
    counts: dict[str, set[str]] = {}
    for part in solids:
        counts.setdefault(part.class_name, set()).add(part.link)
    entries = [(class_style(name), f"{name or 'no class'} {len(links)}") for name, links in counts.items()]
    if settings.z_m is not None:
        entries.append(("light", f"not cut at {settings.z_m:g} m"))
    marks: list[Mark] = []
    x, y = _MARGIN_PX, y + 6
    for style, words in entries:
        needed = 22 + text_width_px(words, 10.5) + 16
        if x + needed > width - _MARGIN_PX and x > _MARGIN_PX:
            x, y = _MARGIN_PX, y + _LEGEND_PX
        marks.append(Area((_box(x, y - 5, 14, 10),), style))
        marks.append(Text((x + 20, y), words, 10.5, colour=mixed(INK, MUTED, 0.5)))
        x += needed
    return Group("page:legend", "legend", tuple(marks)), y + 8


def _box(x: float, y: float, width: float, height: float) -> Float64Array:
    return np.array([(x, y), (x + width, y), (x + width, y + height), (x, y + height)])
