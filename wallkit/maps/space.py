"""The room that the solid parts leave: free regions at a height, and what a door sweeps when it opens."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from wallkit.core.types import Float64Array
from wallkit.maps.geometry import Part, Slice, parts, slice_parts
from wallkit.maps.model import SemanticMap
from wallkit.maps.nouns import Joint

if TYPE_CHECKING:
    from shapely import Geometry, Polygon

# chinks of a closed door are narrower (WK-O018 names wider ones), and nobody passes through them
PASSAGE_M = 0.03
_FRAME_M = 1.0


@dataclass(frozen=True, slots=True)
class Region:
    """A connected piece of free floor.

    Attributes:
        is_outside: it reaches around the building, so it is no room.
    """

    polygon: Polygon
    is_outside: bool

    @property
    def area_m2(self) -> float:
        """Free area."""
        return float(self.polygon.area)


@dataclass(frozen=True, slots=True)
class DoorSweep:
    """A door on its way from closed to open.

    Attributes:
        states: (n,) joint states. leaves: what the leaf covers at each, seen from above.
        swept: all it touches on the way; between two states the hull of both.
        z_m: (lowest, highest) of the leaf.
        parts: the leaf's parts as the map has them at rest.
    """

    joint: Joint
    states: Float64Array
    leaves: tuple[Geometry, ...]
    swept: Geometry
    z_m: tuple[float, float]
    parts: tuple[Part, ...]


def free_space(cut: Slice, *, passage_m: float = PASSAGE_M) -> list[Region]:
    """Connected regions between the solids of a slice, largest first, the outside included.

    Regions are separate when the way between them is narrower than `passage_m`: the solids grow by half of it (keeping their
    corners) and what remains free grows back, so that areas are exact but for chinks. An empty slice has no regions.
    """
    import shapely

    if not cut.polygons:
        return []
    half_m = passage_m / 2
    grown = shapely.union_all(shapely.buffer(list(cut.polygons), half_m, join_style="mitre"))
    frame = shapely.box(*shapely.buffer(grown, _FRAME_M).bounds)
    pieces = shapely.get_parts(frame.difference(grown))
    reaches_frame = shapely.intersects(pieces, frame.exterior)
    regions = [
        Region(polygon, bool(outside))
        for piece, outside in zip(shapely.buffer(pieces, half_m, join_style="mitre"), reaches_frame, strict=True)
        for polygon in shapely.get_parts(piece)
    ]
    return sorted(regions, key=lambda region: (-region.area_m2, region.polygon.bounds))


def rooms_by_flood(
    semantic_map: SemanticMap,
    z_m: float,
    doors: Literal["rest", "open", "closed"] | Mapping[str, float] = "closed",
    *,
    passage_m: float = PASSAGE_M,
) -> list[Region]:
    """Regions that walls enclose at a height, largest first; the outside, and rooms that leak into it, are not among them.

    Args:
        doors: "closed" and "rest" move the leaves there. "open" takes them away: the question is then whether there is a
            way, and a leaf that stands open in a corner must not cut off a piece of floor. Joint states place them as given.
    """
    if doors == "open":
        leaves = {link for joint in semantic_map.doors for link in semantic_map.subtree(joint.child)}
        solids = [part for part in parts(semantic_map) if part.link not in leaves]
    else:
        states = semantic_map.door_states(doors) if isinstance(doors, str) else doors
        solids = parts(semantic_map, states)
    regions = free_space(slice_parts(solids, z_m), passage_m=passage_m)
    return [region for region in regions if not region.is_outside]


def door_sweep(
    semantic_map: SemanticMap,
    joint: Joint,
    *,
    steps: int = 32,
    poses: Mapping[str, Float64Array] | None = None,
    solids: Sequence[Part] | None = None,
) -> DoorSweep:
    """What a door's leaf, and all that hangs on it, covers from closed to open.

    Args:
        poses, solids: the map's, at rest, when they are at hand.

    Between states the outer edge of a turning leaf is short of its arc by r (1 - cos(step / 2)): 0.3 mm for 0.9 m in 32.
    """
    import shapely

    placed = semantic_map.poses() if poses is None else poses
    links = set(semantic_map.subtree(joint.child))
    leaf = tuple(part for part in (parts(semantic_map) if solids is None else solids) if part.link in links)
    states = np.linspace(joint.closed, joint.open, steps + 1)
    T_child_map = np.linalg.inv(placed[joint.child])
    T_map_joint = placed[joint.parent] @ joint.T_parent_child
    T_map_child = np.array([T_map_joint @ joint.motion(float(state)) for state in states])
    covered, swept = [], []
    for part in leaf:
        points = part.corners @ T_child_map[:3, :3].T + T_child_map[:3, 3]
        moved = (np.einsum("nij,cj->nci", T_map_child[:, :3, :3], points) + T_map_child[:, None, :3, 3])[..., :2]
        covered.append(_hulls(moved))
        swept.append(_hulls(np.concatenate([moved[:-1], moved[1:]], axis=1)))
    leaves = tuple(shapely.union_all(list(polygons)) for polygons in zip(*covered, strict=True))
    z_m = (min(part.z_m[0] for part in leaf), max(part.z_m[1] for part in leaf)) if leaf else (0.0, 0.0)
    area = shapely.union_all(np.concatenate(swept)) if swept else shapely.Polygon()
    return DoorSweep(joint, states, leaves, area, z_m, leaf)


def _hulls(groups: Float64Array) -> np.ndarray:
    """Convex hulls of point groups (n, C, 2)."""
    import shapely

    count, size, _ = groups.shape
    points = shapely.points(groups.reshape(-1, 2))
    return np.asarray(shapely.convex_hull(shapely.multipoints(points, indices=np.repeat(np.arange(count), size))))
