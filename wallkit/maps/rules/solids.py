"""What the rules of groups E, O and T share: which parts are what, how deep two overlap, and edits that move a link."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from wallkit.core.types import Float64Array, Int64Array
from wallkit.maps.document import Attribute, Edit
from wallkit.maps.geometry import Part
from wallkit.maps.nouns import Joint
from wallkit.maps.numbers import numbers_from_text, text_from_number
from wallkit.maps.rules.base import Context
from wallkit.maps.rules.scale import outsized, wrong_unit
from wallkit.maps.walls import WallRun

if TYPE_CHECKING:
    from shapely import Polygon

# floors and ceilings lie under and over everything
FLAT_CLASSES = ("floor", "ceiling")
# partitions are built into walls and each other like walls, though they hang on them like fixtures
BUILT_IN_CLASSES = ("partition",)


def sound_parts(context: Context) -> list[Part]:
    """Parts at rest whose size is to be believed: none where the whole map is in a wrong unit (WK-E040, WK-E041)."""
    if context.once(wrong_unit) is not None:
        return []
    wrong = context.once(outsized)
    return [part for part in context.parts if part.link not in wrong] if wrong else context.parts


def sound_runs(context: Context) -> list[WallRun]:
    """Wall runs, likewise."""
    if context.once(wrong_unit) is not None:
        return []
    wrong = context.once(outsized)
    return [run for run in context.runs if run.link not in wrong]


def leaf_links(context: Context) -> dict[str, Joint]:
    """Links that move with a door, each with the door's joint."""
    return {link: joint for joint in context.map.doors for link in context.map.subtree(joint.child)}


def structure(context: Context) -> list[Part]:
    """What the building is made of: walls, columns, glass; no doors, floors or ceilings."""
    leaves = context.once(leaf_links)
    return [part for part in context.once(sound_parts) if part.link not in leaves and is_structure(context, part)]


def fixtures(context: Context) -> list[Part]:
    """Everything of a known class that stands or hangs in rooms."""
    leaves = context.once(leaf_links)
    return [
        part
        for part in context.once(sound_parts)
        if part.link not in leaves
        and (info := context.map.classes.get(part.class_name)) is not None
        and info.mount != "structure"
        and part.class_name != "unknown"
    ]


def is_structure(context: Context, part: Part) -> bool:
    """Whether a part belongs to the building itself."""
    info = context.map.classes.get(part.class_name)
    return info is not None and info.mount == "structure" and part.class_name not in FLAT_CLASSES


def assembly(context: Context, link: str) -> str:
    """The outermost fixture that a link is part of: a cabinet for its drawers."""
    top = link
    joint = context.map.parent_joint(link)
    while joint is not None and joint.parent in context.map.links:
        parent = context.map.links[joint.parent]
        info = context.map.classes.get(parent.class_name)
        if info is not None and info.mount == "structure":
            break
        if parent.shapes:
            top = parent.name
        joint = context.map.parent_joint(parent.name)
    return top


def overlapping(a: Sequence[Part], b: Sequence[Part]) -> list[tuple[int, int]]:
    """Pairs (index into a, index into b) whose footprints and heights meet, in order."""
    import shapely

    if not a or not b:
        return []
    pairs: Int64Array = shapely.STRtree([part.footprint for part in b]).query(
        [part.footprint for part in a], predicate="intersects"
    )
    found = [(int(i), int(j)) for i, j in pairs.T if shared_height_m(a[i].z_m, b[j].z_m) > 0]
    return sorted(found)


def shared_height_m(a: tuple[float, float], b: tuple[float, float]) -> float:
    """How much of their height two intervals share; not positive when none."""
    return min(a[1], b[1]) - max(a[0], b[0])


def penetration(a: Polygon, b: Polygon) -> tuple[float, Float64Array]:
    """How deep two convex polygons overlap, and the unit vector (2,) along which a leaves b by that way.

    The separating-axis theorem: the least overlap of their shadows on the normals of all edges; 0 when they are apart.
    """
    import shapely

    points = [shapely.get_coordinates(polygon)[:-1] for polygon in (a, b)]
    edges = np.vstack([np.roll(corners, -1, axis=0) - corners for corners in points])
    lengths = np.hypot(*edges.T)
    normals = np.column_stack([edges[:, 1], -edges[:, 0]])[lengths > 1e-12] / lengths[lengths > 1e-12, None]
    normals = np.vstack([normals, -normals])
    shadow_a, shadow_b = points[0] @ normals.T, points[1] @ normals.T
    # moving a along the normal by this frees it
    depth = shadow_b.max(axis=0) - shadow_a.min(axis=0)
    least = int(np.argmin(depth))
    return max(float(depth[least]), 0.0), normals[least]


def moved(context: Context, link: str, shift_m: Float64Array) -> tuple[Edit, ...]:
    """The edit that moves a link by (2,) metres in the map frame; none where its joint says no xyz."""
    joint = context.map.parent_joint(link)
    origin = joint.element.find("origin") if joint is not None else None
    attribute = origin.spot("xyz") if origin is not None else None
    if joint is None or not isinstance(attribute, Attribute) or joint.parent not in context.poses:
        return ()
    xyz = numbers_from_text(attribute.value, 3)
    if xyz is None:
        return ()
    R_map_parent = context.poses[joint.parent][:3, :3]
    new = np.array(xyz) + R_map_parent.T @ np.append(shift_m, 0.0)
    text = " ".join(text_from_number(0.0 if abs(value) < 5e-7 else round(value, 6)) for value in new.tolist())
    return (attribute.replaced_by(text),)


def joint_spot(context: Context, link: str) -> Attribute | None:
    """The xyz that places a link, for messages."""
    joint = context.map.parent_joint(link)
    origin = joint.element.find("origin") if joint is not None else None
    return origin.attribute("xyz") if origin is not None else None
