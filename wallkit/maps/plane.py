"""A map and a height -> what a LiDAR there sees and does not see, which floor is enclosed, and what a tilt changes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from wallkit.maps.classes import ClassInfo, Lidar
from wallkit.maps.geometry import Part, parts, slice_parts
from wallkit.maps.model import SemanticMap
from wallkit.maps.space import Region, free_space

WOBBLE_M = 0.05
Sight = Literal["in", "above", "below", "between"]
FLAT_CLASSES = ("floor", "ceiling")


@dataclass(frozen=True, slots=True)
class Standing:
    """How one element stands to a plane.

    Attributes:
        z_m: heights (low, high) that its shapes reach, joined where they touch, in the map frame.
        sight: "in" the plane; else all of it "above", all "below", or the plane passes "between" its shapes.
        lidar: what a LiDAR meets of its class.
        changes: at which heights within the wobble its sight changes; empty when it is the same all over.
    """

    link: str
    class_name: str
    lidar: Lidar
    z_m: tuple[tuple[float, float], ...]
    sight: Sight
    changes: tuple[float, ...]

    @property
    def is_seen(self) -> bool:
        """Whether the plane cuts it and a beam may come back from it."""
        return self.sight == "in" and self.lidar != "none"


@dataclass(frozen=True)
class PlaneView:
    """What a plane shows.

    Attributes:
        elements: everything with a shape but floors and ceilings, in the map's order.
        closed, open: free floor that is enclosed, with every door closed and with every leaf taken away.
        open_counts: (height, regions that the building encloses, leaves taken away) where that may change within the
            wobble, lowest first; else empty.
    """

    z_m: float
    wobble_m: float
    elements: tuple[Standing, ...]
    closed: tuple[Region, ...]
    open: tuple[Region, ...]
    open_counts: tuple[tuple[float, int], ...]

    @property
    def regions_change(self) -> bool:
        """Whether the enclosed floor is joined or parted within the wobble."""
        return len({count for _, count in self.open_counts}) > 1

    @property
    def changing(self) -> tuple[Standing, ...]:
        """Elements that a tilt brings into the plane or takes out of it."""
        return tuple(element for element in self.elements if element.changes)


def view_at(semantic_map: SemanticMap, z_m: float, *, wobble_m: float = WOBBLE_M) -> PlaneView:
    """What the plane at a height above the map's origin shows, every door at rest but for the regions."""
    solids = parts(semantic_map)
    leaves = {link for joint in semantic_map.doors for link in semantic_map.subtree(joint.child)}
    fixed = [part for part in solids if part.link not in leaves and part.class_name not in FLAT_CLASSES]
    building = [part for part in fixed if is_building(part, semantic_map.classes)]
    shut = [part for part in parts(semantic_map, semantic_map.door_states("closed")) if part.link in leaves]
    return PlaneView(
        z_m,
        wobble_m,
        tuple(standings(solids, semantic_map.classes, z_m, wobble_m)),
        enclosed([*fixed, *shut], z_m),
        enclosed(fixed, z_m),
        tuple(region_counts(building, z_m, wobble_m)),
    )


def is_building(part: Part, classes: Mapping[str, ClassInfo]) -> bool:
    """Whether a part belongs to the building itself: walls, columns, panes; what has no class may, too."""
    info = classes.get(part.class_name)
    return part.class_name not in FLAT_CLASSES and (info is None or info.mount == "structure")


def standings(solids: Sequence[Part], classes: Mapping[str, ClassInfo], z_m: float, wobble_m: float) -> list[Standing]:
    """How every element stands to a plane."""
    by_link: dict[str, list[Part]] = {}
    for part in solids:
        if part.class_name not in FLAT_CLASSES:
            by_link.setdefault(part.link, []).append(part)
    return [_standing(link, found, classes.get(found[0].class_name), z_m, wobble_m) for link, found in by_link.items()]


def enclosed(solids: Sequence[Part], z_m: float) -> tuple[Region, ...]:
    """Regions of floor that what a plane cuts encloses, largest first."""
    return tuple(region for region in free_space(slice_parts(solids, z_m)) if not region.is_outside)


def region_counts(solids: Sequence[Part], z_m: float, wobble_m: float) -> list[tuple[float, int]]:
    """(height, enclosed regions) wherever the parts cut change within z_m +- wobble_m, lowest first; [] if nowhere."""
    low, high = z_m - wobble_m, z_m + wobble_m
    edges = {edge for part in solids for edge in part.z_m if low < edge < high}
    if not edges:
        return []
    counts: dict[frozenset[int], int] = {}
    found = []
    for z in sorted({low, z_m, *edges}):
        cut = frozenset(index for index, part in enumerate(solids) if part.is_cut_by(z))
        if cut not in counts:
            counts[cut] = len(enclosed(solids, z))
        found.append((z, counts[cut]))
    return found


# -------------------------------------------------------------------------------------------- details

# heights are rounded to millimetres in drawings
_TOUCH_M = 1e-3


def _standing(link: str, found: Sequence[Part], info: ClassInfo | None, z_m: float, wobble_m: float) -> Standing:
    heights = _joined([part.z_m for part in found])
    if any(low <= z_m < high for low, high in heights):
        sight: Sight = "in"
    else:
        sight = "above" if heights[0][0] > z_m else "below" if heights[-1][1] <= z_m else "between"
    edges = [edge for interval in heights for edge in interval]
    changes = tuple(edge for edge in edges if z_m - wobble_m < edge < z_m + wobble_m)
    lidar: Lidar = info.lidar if info is not None else "opaque"
    return Standing(link, found[0].class_name, lidar, heights, sight, changes)


def _joined(intervals: Sequence[tuple[float, float]]) -> tuple[tuple[float, float], ...]:
    """The intervals as a union, lowest first; those that touch become one."""
    found: list[tuple[float, float]] = []
    for low, high in sorted(intervals):
        if found and low <= found[-1][1] + _TOUCH_M:
            found[-1] = (found[-1][0], max(found[-1][1], high))
        else:
            found.append((low, high))
    return tuple(found)
