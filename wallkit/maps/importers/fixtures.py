"""A symbol of a plan ("toilet, somewhere here") -> a fixture of usual size, its back on the wall beside it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wallkit.maps.classes import ClassInfo
from wallkit.maps.draft.draft import DraftFixture, DraftWall

# how far a symbol's reference point may be from the wall that carries it: half a toilet and some
REACH_M = 0.7
# overlaps below this are touching
TOUCHING_M2 = 1e-4


@dataclass(frozen=True, slots=True)
class UsualSize:
    """Size (deep, wide, high) [m] of a kind of fixture, its underside above the floor, and whether a wall carries it."""

    size_m: tuple[float, float, float]
    bottom_m: float = 0.0
    on_wall: bool = True


def place_fixture(
    name: str, class_name: str, pose: tuple[float, float, float], walls: Sequence[DraftWall]
) -> tuple[DraftFixture, float]:
    """A fixture of usual size at a symbol's pose (x, y, yaw), and how far [m] its middle moved to stand at its wall.

    The nearest wall within REACH_M takes it: back on the wall's face, +x into the room. Without one, or for kinds that stand
    free, it stays where it is drawn.
    """
    usual = USUAL_SIZES[class_name]
    near = _nearest_face(pose[:2], walls) if usual.on_wall else None
    if near is None:
        return DraftFixture(name, class_name, pose, usual.size_m, usual.bottom_m), 0.0
    wall, foot, yaw = near
    foot = _slid_clear(foot, yaw, usual, [other for other in walls if other is not wall])
    fixture = DraftFixture(name, class_name, (*foot, yaw), usual.size_m, usual.bottom_m, wall.name)
    half = usual.size_m[0] / 2
    middle = (foot[0] + half * math.cos(yaw), foot[1] + half * math.sin(yaw))
    return fixture, math.dist(middle, pose[:2])


def _nearest_face(
    at: tuple[float, float], walls: Sequence[DraftWall]
) -> tuple[DraftWall, tuple[float, float], float] | None:
    """The wall beside a point, the point's foot on its face (x, y), and the direction from the face into the room."""
    best: tuple[float, DraftWall, tuple[float, float], float] | None = None
    for wall in walls:
        start, end, point = np.array(wall.start), np.array(wall.end), np.array(at)
        along = (end - start) / wall.length_m
        normal = np.array([-along[1], along[0]])
        x, y = float((point - start) @ along), float((point - start) @ normal)
        if not 0 <= x <= wall.length_m or abs(y) - wall.thickness_m / 2 > REACH_M or (best and abs(y) >= best[0]):
            continue
        side = 1.0 if y >= 0 else -1.0
        foot = start + x * along + side * wall.thickness_m / 2 * normal
        best = (abs(y), wall, (float(foot[0]), float(foot[1])), math.atan2(side * normal[1], side * normal[0]))
    return best[1:] if best else None


def _slid_clear(
    foot: tuple[float, float], yaw: float, usual: UsualSize, walls: Sequence[DraftWall]
) -> tuple[float, float]:
    """The foot moved along its wall, at most half the fixture's width, until the other walls are clear of it."""
    from shapely import LineString, union_all

    deep, wide, _ = usual.size_m
    around = [wall for wall in walls if _distance(wall, foot) < deep + wide]
    solid = union_all([LineString([w.start, w.end]).buffer(w.thickness_m / 2, cap_style="flat") for w in around])
    into, sideways = np.array([math.cos(yaw), math.sin(yaw)]), np.array([-math.sin(yaw), math.cos(yaw)])
    for shift in sorted(np.linspace(-wide / 2, wide / 2, 41), key=abs):
        back = np.array(foot) + shift * sideways
        body = LineString([back, back + deep * into]).buffer(wide / 2, cap_style="flat")
        if body.intersection(solid).area < TOUCHING_M2:
            return float(back[0]), float(back[1])
    return foot


def _distance(wall: DraftWall, at: tuple[float, float]) -> float:
    start, along, point = np.array(wall.start), np.subtract(wall.end, wall.start), np.array(at)
    share = min(max(float((point - start) @ along) / float(along @ along), 0.0), 1.0)
    return float(np.hypot(*(start + share * along - point)))


# of the common ceramic and steel ware; a plan's symbols say where a thing is, not how large
USUAL_SIZES: dict[str, UsualSize] = {
    "toilet": UsualSize((0.70, 0.38, 0.78)),
    "urinal": UsualSize((0.32, 0.35, 0.60), 0.55),
    "sink": UsualSize((0.45, 0.55, 0.18), 0.68),
    "shower": UsualSize((0.90, 0.90, 2.00)),
    "trash": UsualSize((0.30, 0.30, 0.60), on_wall=False),
}
# classes of USUAL_SIZES that the taxonomy does not have: a shower is mostly its glass
EXTRA_CLASSES: dict[str, ClassInfo] = {"shower": ClassInfo("shower", lidar="glass", p_return=0.15)}
