"""Door leaves in openings -> the traffic editor's doors: hinged or sliding, single or double, from which end, which way."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wallkit.core.types import Float64Array
from wallkit.maps.exporters.rmf_lines import Gap
from wallkit.maps.model import SemanticMap
from wallkit.maps.nouns import Joint


@dataclass(frozen=True)
class RmfDoor:
    """A door from start to end (2,) [m] in frame map, with RMF's parameters."""

    start: Float64Array
    end: Float64Array
    height_m: float
    parameters: Mapping[str, Any]

    @property
    def width_m(self) -> float:
        return float(np.hypot(*(self.end - self.start)))


def rmf_doors(semantic_map: SemanticMap, gaps: Sequence[Gap]) -> tuple[list[RmfDoor], int]:
    """The gaps that doors close, and how many leaves hang in none."""
    shut = semantic_map.poses(semantic_map.door_states("closed"))
    wide = semantic_map.poses(semantic_map.door_states("open"))
    doors, hung = [], set[str]()
    for gap in gaps:
        leaves = [joint for joint in semantic_map.doors if _hangs_in(semantic_map, joint, gap, shut)]
        if leaves:
            hung.update(joint.child for joint in leaves)
            height_m = gap.opening.z_m[1] - gap.opening.z_m[0]
            doors.append(RmfDoor(gap.start, gap.end, height_m, _parameters(semantic_map, gap, leaves, shut, wide)))
    return doors, sum(joint.child not in hung for joint in semantic_map.doors)


def _hangs_in(semantic_map: SemanticMap, joint: Joint, gap: Gap, shut: Mapping[str, Float64Array]) -> bool:
    """Whether a leaf fills a gap: it is named, follows the one that is, or hangs on the wall and stands in the hole."""
    if joint.child == gap.opening.fill:
        return True
    if joint.parent != gap.wall or joint.child not in shut:
        return False
    middle = _middle(semantic_map, joint.child, gap.wall, shut)
    low, high = gap.opening.along_m
    return middle is not None and low < float(middle[0]) < high


def _parameters(
    semantic_map: SemanticMap,
    gap: Gap,
    leaves: Sequence[Joint],
    shut: Mapping[str, Float64Array],
    wide: Mapping[str, Float64Array],
) -> dict[str, Any]:
    first = next((joint for joint in leaves if joint.child == gap.opening.fill), leaves[0])
    is_double, is_sliding = len(leaves) > 1, first.kind == "prismatic"
    hinge = np.linalg.inv(shut[gap.wall]) @ shut[first.child]
    before, after = (_middle(semantic_map, first.child, gap.wall, poses) for poses in (shut, wide))
    way = np.zeros(2) if before is None or after is None else after - before
    if is_sliding:
        # a panel slides towards the end it parks at, in front of the face it runs on
        is_start, is_right = bool(way[0] <= 0), bool(hinge[1, 3] < 0)
    else:
        low, high = gap.opening.along_m
        is_start, is_right = abs(hinge[0, 3] - low) <= abs(hinge[0, 3] - high), bool(way[1] < 0)
    is_start = bool(is_start or is_double)
    travel = abs(first.open - first.closed)
    return {
        "motion_axis": [1, "start" if is_start else "end"],
        "motion_degrees": [3, 90 if is_sliding else round(math.degrees(travel), 3)],
        # the inverse of the importer's rule: +1 turns to the right of start -> end for a leaf at the start
        "motion_direction": [2, 1 if is_right == is_start else -1],
        "name": [1, _name(first.child, is_double=is_double)],
        "plugin": [1, "normal"],
        "right_left_ratio": [3, 1],
        "type": [1, ("double_" if is_double else "") + ("sliding" if is_sliding else "hinged")],
    }


def _middle(semantic_map: SemanticMap, leaf: str, wall: str, poses: Mapping[str, Float64Array]) -> Float64Array | None:
    """(2,) the middle of a leaf's shapes in the wall's frame, or None without shapes."""
    shapes = semantic_map.links[leaf].shapes
    if not shapes:
        return None
    T_wall_leaf = np.linalg.inv(poses[wall]) @ poses[leaf]
    middles = [(T_wall_leaf @ shape.T_link_shape)[:2, 3] for shape in shapes]
    return np.asarray(np.mean(middles, axis=0))


def _name(leaf: str, *, is_double: bool) -> str:
    """A door's name: without the letter that the importer gives to the leaves of a double door."""
    return leaf.removesuffix("_a").removesuffix("_b") if is_double else leaf
