"""Walls seen from the side, in their own frame, and how large what fills their openings is there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from wallkit.core.types import Float64Array
from wallkit.maps.document import Element
from wallkit.maps.geometry import Part
from wallkit.maps.nouns import Link
from wallkit.maps.rules.base import Context
from wallkit.maps.rules.floods import closed_leaves
from wallkit.maps.rules.solids import leaf_links, sound_parts

if TYPE_CHECKING:
    from shapely import Geometry

# boxes turned by more against the wall's x axis belong to another stretch of a polyline wall
_PARALLEL = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class Elevation:
    """A wall seen from the side, in its own frame: x along the wall, z up.

    Attributes:
        boxes: its parts on the x axis, each with (x0, z0, x1, z1). solid: all of them as one geometry.
    """

    link: Link
    boxes: tuple[tuple[Part, tuple[float, float, float, float]], ...]
    solid: Geometry

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """(x0, z0, x1, z1) of the whole wall."""
        x0, z0, x1, z1 = self.solid.bounds
        return x0, z0, x1, z1


def elevations(context: Context) -> dict[str, Elevation]:
    """The walls by name that have a box on their x axis."""
    import shapely

    found = {}
    by_link: dict[str, list[Part]] = {}
    for part in context.once(sound_parts):
        if part.class_name == "wall" or context.map.links[part.link].openings:
            by_link.setdefault(part.link, []).append(part)
    for name, own in by_link.items():
        boxes = tuple((part, bounds) for part in own if (bounds := _on_axis(part)) is not None)
        if boxes:
            solid = shapely.union_all([shapely.box(*bounds) for _, bounds in boxes])
            found[name] = Elevation(context.map.links[name], boxes, solid)
    return found


def fill_extents(context: Context) -> dict[Element, tuple[float, float, float, float]]:
    """(x0, z0, x1, z1) in the wall's frame of what fills an opening, by the opening's element; doors closed."""
    leaves = context.once(leaf_links)
    still = [part for part in context.once(sound_parts) if part.link not in leaves]
    by_link: dict[str, list[Part]] = {}
    for part in [*context.once(closed_leaves), *still]:
        by_link.setdefault(part.link, []).append(part)
    found = {}
    for wall in context.map.links.values():
        for opening in wall.openings:
            names = context.map.subtree(opening.fill) if opening.fill in context.map.links else ()
            corners = [part.corners for name in names for part in by_link.get(name, ())]
            if corners and wall.name in context.poses:
                points = in_frame(np.vstack(corners), context.poses[wall.name])
                (x0, _, z0), (x1, _, z1) = points.min(axis=0), points.max(axis=0)
                found[opening.element] = (float(x0), float(z0), float(x1), float(z1))
    return found


def in_frame(points: Float64Array, T_map_frame: Float64Array) -> Float64Array:
    """Points (N, 3) of the map in another frame."""
    return np.asarray((points - T_map_frame[:3, 3]) @ T_map_frame[:3, :3])


def _on_axis(part: Part) -> tuple[float, float, float, float] | None:
    """(x0, z0, x1, z1) of a box in its link's frame; None when it is turned or stands beside the x axis."""
    T = part.shape.T_link_shape
    if part.shape.kind != "box" or np.abs(T[:3, :3]).max(axis=0).min() < 1 - _PARALLEL:
        return None
    half = np.abs(T[:3, :3]) @ part.shape.size / 2
    low, high = T[:3, 3] - half, T[:3, 3] + half
    if not low[1] < 0 < high[1]:
        return None
    return float(low[0]), float(low[2]), float(high[0]), float(high[2])
