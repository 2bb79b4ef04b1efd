"""A semantic map -> its floor plan, drawn: rooms, walls, glass, doors with their swing, fixtures by their symbols.

The one renderer: `draw_plan` says what lies where, in metres of the map frame; `wallkit.maps.draw.svg` and `png`
put the same drawing into a file. Every link with a solid part is one group that carries the link's name.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from wallkit.core.types import Float64Array
from wallkit.errors import MapError
from wallkit.maps.draw.marks import INK, PAPER, Area, Drawing, Group, Line, Mark, Style, colour_or, mixed
from wallkit.maps.draw.symbols import symbol_of
from wallkit.maps.geometry import Part, parts
from wallkit.maps.model import SemanticMap
from wallkit.maps.nouns import Joint

if TYPE_CHECKING:
    from shapely import Geometry

    from wallkit.maps.rules.base import MapFinding

# what architects cut a plan at: above desks and basins, through windows and doors
CUT_M = 1.2
# classes drawn by what the plane cuts of them; the others lie on the plan as seen from above
CUT_CLASSES = ("wall", "column", "partition", "window", "glass", "door")
NOT_DRAWN = ("floor", "ceiling")
_ORDER = (
    "furniture",
    "trash",
    "radiator",
    "toilet",
    "urinal",
    "sink",
    "dispenser",
    "mirror",
    "partition",
    "column",
    "wall",
)
_ARC_STEPS = 25
# what ends so much lower than its wall is no rounding
_STEP_M = 0.01
_GREY = "#9aa5b1"


@dataclass(frozen=True, slots=True)
class PlanSettings:
    """How a plan is drawn.

    Attributes:
        z_m: height of a plane: what it cuts is bold, all else light. None: a floor plan as architects draw it.
        width_px, height_px: the plan is as large as fits into them.
        names: the links' names are written beside them.
    """

    z_m: float | None = None
    width_px: float = 1000.0
    height_px: float = 1000.0
    names: bool = False


def plan_svg(semantic_map: SemanticMap, settings: PlanSettings | None = None) -> bytes:
    """The floor plan as an SVG file whose plan is in metres of the map frame.

    Raises:
        MapError: nothing in the map can be drawn.
    """
    from wallkit.maps.draw.svg import svg_from_drawing

    return svg_from_drawing(draw_plan(semantic_map, settings))


def draw_plan(
    semantic_map: SemanticMap, settings: PlanSettings | None = None, findings: Sequence[MapFinding] = ()
) -> Drawing:
    """The floor plan with its title, scale bar, axes and legend, and with findings marked where they are.

    Raises:
        MapError: nothing in the map can be drawn.
    """
    from wallkit.maps.draw.page import page_of

    settings = settings or PlanSettings()
    poses = semantic_map.poses()
    solids = [part for part in parts(semantic_map, poses=poses) if part.class_name not in NOT_DRAWN]
    if not solids and not any(room.floor is not None for room in semantic_map.all_rooms):
        raise MapError(
            "there is nothing to draw",
            where=semantic_map.source,
            hint="boxes, cylinders, spheres and rooms are drawn, meshes are not",
        )
    doors = _door_marks(semantic_map, poses, solids)
    groups = [*_rooms(semantic_map), *_links(semantic_map, poses, solids, doors, settings)]
    return page_of(semantic_map, groups, styles_of(semantic_map, solids), solids, settings, findings)


def styles_of(semantic_map: SemanticMap, solids: Sequence[Part]) -> dict[str, Style]:
    """The look of everything in the plan, by name; a class keeps the colour that the map or the taxonomy gives it."""
    styles = {
        "room": Style(fill="#f6f4ef"),
        "symbol": Style(stroke=INK, width_px=0.9),
        "over": Style(fill="#f6f4ef", stroke=_GREY, width_px=0.8, dash_px=(4, 3)),
        "under": Style(fill="#e4e7eb", stroke=_GREY, width_px=0.8),
        "light": Style(fill="#f1f3f5", stroke="#b8c0c8", width_px=0.8, dash_px=(3, 2.5)),
        "light-symbol": Style(stroke="#b8c0c8", width_px=0.7),
        "swing": Style(stroke="#7b8794", width_px=0.9),
        "open-leaf": Style(fill=PAPER, stroke="#7b8794", width_px=0.9),
    }
    for name in {part.class_name for part in solids}:
        info = semantic_map.classes.get(name)
        colour = colour_or(info.color if info else "", _GREY)
        if name in ("wall", "column"):
            style = Style(fill=colour, stroke=colour, width_px=0.6)
        elif name in CUT_CLASSES or (info is not None and info.mount == "structure"):
            style = Style(fill=mixed(colour, PAPER, 0.15), stroke=mixed(colour, INK, 0.45), width_px=0.9)
        else:
            style = Style(fill=mixed(colour, PAPER, 0.62), stroke=mixed(colour, INK, 0.5), width_px=1.0)
        styles[class_style(name)] = style
    return styles


def class_style(class_name: str) -> str:
    """The name of a class's style."""
    return "c-" + "".join(c if c.isalnum() else "-" for c in class_name or "none")


# -------------------------------------------------------------------------------------------- details


def _rooms(semantic_map: SemanticMap) -> list[Group]:
    return [
        Group(f"room:{room.id}", "room", (Area((room.floor,), "room"),), f"{room.id} ({room.kind or 'room'})")
        for room in semantic_map.rooms.values()
        if room.floor is not None
    ]


def _links(
    semantic_map: SemanticMap,
    poses: Mapping[str, Float64Array],
    solids: Sequence[Part],
    doors: Mapping[str, tuple[Mark, ...]],
    settings: PlanSettings,
) -> list[Group]:
    """A group for every link with a part, what lies on top last."""
    by_link: dict[str, list[Part]] = {}
    for part in solids:
        by_link.setdefault(part.link, []).append(part)
    groups = []
    for name, own in by_link.items():
        class_name = own[0].class_name
        low, high = min(part.z_m[0] for part in own), max(part.z_m[1] for part in own)
        marks = [*doors.get(name, ()), *_solid_marks(own, class_name, settings)]
        marks += _symbol_marks(name, class_name, poses[name], own, settings)
        title = f"{name}: {class_name or 'no class'}, {low:.2f} to {high:.2f} m high"
        groups.append(Group(name, class_name or "none", tuple(marks), title))
    rank = {name: index for index, name in enumerate(_ORDER)}
    return sorted(groups, key=lambda group: rank.get(group.kind, len(rank)))


def _solid_marks(own: Sequence[Part], class_name: str, settings: PlanSettings) -> list[Mark]:
    """What of a link is cut, and what is above or below, each as the outline of all its parts together."""
    by_style: dict[str, list[Geometry]] = {}
    top_m = max(part.z_m[1] for part in own)
    for part in own:
        if settings.z_m is not None:
            is_cut, look = part.is_cut_by(settings.z_m), "light"
            shape = part.cut(settings.z_m) if is_cut else part.footprint
        elif class_name in CUT_CLASSES and len(own) > 1:
            # the heads and sills of openings, wherever the sill ends; a low wall of one box is drawn as it is
            is_sill = part.z_m[1] < top_m - _STEP_M
            is_cut = part.is_cut_by(CUT_M) and not is_sill
            look = "over" if part.z_m[0] > CUT_M else "under"
            shape = part.cut(CUT_M) if is_cut else part.footprint
        else:
            is_cut, look, shape = True, "", part.footprint
        by_style.setdefault(class_style(class_name) if is_cut else look, []).append(shape)
    marks = []
    for style in sorted(by_style, key=lambda name: (name.startswith("c-"), name)):
        marks += areas_of(by_style[style], style)
    return marks


def areas_of(shapes: Sequence[Geometry], style: str) -> list[Mark]:
    """The areas that shapes cover together."""
    import shapely

    marks: list[Mark] = []
    for polygon in shapely.get_parts(shapely.union_all(list(shapes))):
        if polygon.geom_type == "Polygon":
            rings = [polygon.exterior, *polygon.interiors]
            marks.append(Area(tuple(shapely.get_coordinates(ring)[:-1] for ring in rings), style))
    return marks


def _symbol_marks(
    name: str, class_name: str, T_map_link: Float64Array, own: Sequence[Part], settings: PlanSettings
) -> list[Mark]:
    """The class's symbol inside the link's footprint, in its own directions; none for a link that lies on its side."""
    if abs(T_map_link[2, 2]) < 0.9:
        return []
    R, t = T_map_link[:2, :2], T_map_link[:2, 3]
    points = (np.concatenate([part.corners for part in own])[:, :2] - t) @ R
    (u0, v0), (u1, v1) = points.min(axis=0).tolist(), points.max(axis=0).tolist()
    is_light = settings.z_m is not None and not any(part.is_cut_by(settings.z_m) for part in own)
    style = "light-symbol" if is_light else "symbol"
    return [Line(line @ R.T + t, style) for line in symbol_of(class_name, name, (u0, v0, u1, v1))]


def _door_marks(
    semantic_map: SemanticMap, poses: Mapping[str, Float64Array], solids: Sequence[Part]
) -> dict[str, tuple[Mark, ...]]:
    """Where each leaf goes: its outline when open, and the way there."""
    found: dict[str, tuple[Mark, ...]] = {}
    for joint in semantic_map.doors:
        own = [part for part in solids if part.link == joint.child]
        closed, state = (_state(semantic_map, joint, position) for position in ("closed", "open"))
        T_map_joint = poses.get(joint.parent, np.full((4, 4), np.nan)) @ joint.T_parent_child
        if not own or not np.all(np.isfinite(T_map_joint @ joint.motion(state))):
            continue
        local = np.concatenate([part.corners for part in own])
        T_child_map = np.linalg.inv(poses[joint.child])
        local = local @ T_child_map[:3, :3].T + T_child_map[:3, 3]
        states = np.linspace(closed, state, _ARC_STEPS)
        moved = [T_map_joint @ joint.motion(float(q)) for q in states]
        corners = np.array([local @ T[:3, :3].T + T[:3, 3] for T in moved])[..., :2]
        marks: list[Mark] = [*_outline(corners[-1], "open-leaf")]
        if joint.kind == "prismatic":
            marks += _arrow(corners[0].mean(axis=0), corners[-1].mean(axis=0))
        else:
            # the far edge of the leaf draws the arc
            far = int(np.argmax(np.hypot(local[:, 0], local[:, 1])))
            marks.append(Line(corners[:, far], "swing"))
        found[joint.child] = tuple(marks)
    return found


def _state(semantic_map: SemanticMap, joint: Joint, position: Literal["open", "closed"]) -> float:
    """Where a leaf stands when its door is open or closed; one that follows another goes where that one takes it."""
    if joint.mimic is None:
        return float(getattr(joint, position))
    return semantic_map.joint_state(joint.name, semantic_map.door_states(position))


def _outline(points: Float64Array, style: str) -> list[Mark]:
    from shapely import MultiPoint

    hull = MultiPoint(points).convex_hull
    return areas_of([hull], style) if hull.geom_type == "Polygon" else []


def _arrow(start: Float64Array, end: Float64Array) -> list[Mark]:
    """From where a sliding leaf stands to where it goes."""
    length = float(np.hypot(*(end - start)))
    if length == 0.0:
        return []
    along = (end - start) / length
    across = np.array([-along[1], along[0]])
    head = 0.1 * min(1.0, length)
    points = [end - along * head + across * head / 2, end, end - along * head - across * head / 2]
    return [Line(np.array([start, end]), "swing"), Line(np.array(points), "swing")]
