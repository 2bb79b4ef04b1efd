"""What rules about space share: openings as plugs, leaves as they close, and floods of the floor between the structure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from wallkit.core.types import Float64Array
from wallkit.maps.geometry import Part, Slice, parts, slice_parts
from wallkit.maps.nouns import Link, Opening
from wallkit.maps.rules.base import Context
from wallkit.maps.rules.solids import leaf_links, sound_runs, structure
from wallkit.maps.space import Region, free_space

if TYPE_CHECKING:
    from shapely import Polygon

# where the floor plan is cut when the map does not say how high its LiDAR looks
FLOOD_PLANE_M = 0.3


@dataclass(frozen=True, slots=True, eq=False)
class Hole:
    """A declared opening, standing in the map.

    Attributes:
        footprint: of the hole, as deep as its wall is thick. centre (2,), across (2,): unit vector through the wall.
        z_m: (lowest, highest) in the map frame.
    """

    wall: Link
    opening: Opening
    footprint: Polygon
    centre: Float64Array
    across: Float64Array
    thickness_m: float
    z_m: tuple[float, float]


def flood_plane_m(context: Context) -> float:
    """The height of the floor plan: the LiDAR's plane where it is known."""
    return FLOOD_PLANE_M if context.scan_plane_m is None else context.scan_plane_m


def holes(context: Context) -> list[Hole]:
    """Every opening of a wall that stands in the map."""
    from shapely import Polygon

    thickness_m: dict[str, float] = {}
    for run in context.once(sound_runs):
        thickness_m.setdefault(run.link, run.thickness_m)
    found = []
    for link in context.map.links.values():
        for opening in link.openings:
            if link.name not in thickness_m or not np.all(np.isfinite([*opening.along_m, *opening.z_m])):
                continue
            T_map_wall, half_m = context.poses[link.name], thickness_m[link.name] / 2
            (x0, x1), (z0, z1) = opening.along_m, opening.z_m
            corners = [(x0, -half_m, z0, 1), (x1, -half_m, z0, 1), (x1, half_m, z0, 1), (x0, half_m, z0, 1)]
            ring = np.array(corners) @ T_map_wall.T
            top = T_map_wall @ [x0, 0.0, z1, 1.0]
            centre, across = ring[:, :2].mean(axis=0), T_map_wall[:2, 1] / max(np.hypot(*T_map_wall[:2, 1]), 1e-9)
            z_m = (float(min(ring[0, 2], top[2])), float(max(ring[0, 2], top[2])))
            found.append(Hole(link, opening, Polygon(ring[:, :2]), centre, across, 2 * half_m, z_m))
    return found


def closed_leaves(context: Context) -> list[Part]:
    """The doors' parts with every door closed."""
    links = context.once(leaf_links)
    if not links:
        return []
    return [part for part in parts(context.map, context.map.door_states("closed")) if part.link in links]


def sealed(context: Context) -> list[Polygon]:
    """Cuts of the floor plan with doors closed and every declared opening filled."""
    plane_m = flood_plane_m(context)
    cut = slice_parts([*context.once(structure), *context.once(closed_leaves)], plane_m)
    return [*cut.polygons, *(hole.footprint for hole in context.once(holes) if hole.z_m[0] <= plane_m < hole.z_m[1])]


def sealed_regions(context: Context) -> list[Region]:
    """Regions of the floor that declared openings and doors do not join; ways as narrow as a touching joint count."""
    return flood(context.once(sealed), context.tolerances.gap_min_m)


def closed_regions(context: Context) -> list[Region]:
    """Regions with every door closed; openings without a leaf are ways."""
    if not context.map.doors:
        return context.once(open_regions)
    cut = slice_parts([*context.once(structure), *context.once(closed_leaves)], flood_plane_m(context))
    return free_space(cut, passage_m=context.tolerances.passage_m)


def open_regions(context: Context) -> list[Region]:
    """Regions with every door taken away."""
    cut = slice_parts(context.once(structure), flood_plane_m(context))
    return free_space(cut, passage_m=context.tolerances.passage_m)


def flood(solids: list[Polygon], passage_m: float) -> list[Region]:
    """Regions between polygons that are already cut."""
    return free_space(Slice(0.0, (), tuple(solids)), passage_m=passage_m)
