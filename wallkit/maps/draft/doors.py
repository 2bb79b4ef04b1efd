"""A door in an opening -> the leaves that fill it, hinged or sliding on the wall's face.

Shapes and clearances are those of the restroom example: the leaf is 1 cm smaller than its hole on every side, 4 cm thick,
flush with the face it opens to, and turns about that face, so that it clears the jamb (WK-O010).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

DoorMotion = Literal["hinged", "double_hinged", "sliding", "double_sliding"]

CLEARANCE_M = 0.01
LEAF_M = 0.04
DEFAULT_PRIOR: Mapping[str, float] = {"closed": 0.7, "open": 0.2, "unknown": 0.1}


@dataclass(frozen=True, slots=True)
class DraftDoor:
    """What moves in a door opening, seen along its wall from start to end.

    Attributes:
        name: of the link; the two leaves of a double door are NAME_a (at the start) and NAME_b.
        hinge: the end of the opening the leaf hangs at, or slides towards; a double door has both.
        side: the side it opens to (hinged) or runs on (sliding); left is the wall's +y.
        travel_rad: of a hinged leaf, from shut to fully open.
        rest, prior: the belief about its state, as in <wk:state>; rest is in radians or metres of travel.
    """

    name: str
    motion: DoorMotion = "hinged"
    hinge: Literal["start", "end"] = "start"
    side: Literal["left", "right"] = "left"
    travel_rad: float = math.pi / 2
    rest: float = 0.0
    prior: Mapping[str, float] = field(default_factory=lambda: DEFAULT_PRIOR)
    connects: tuple[str, str] | None = None


@dataclass(frozen=True, slots=True)
class Leaf:
    """One moving panel: its link, its joint to the wall, its box; lengths in the wall's frame [m].

    Attributes:
        origin: (x, y, z) of the joint. axis: of the joint. centre, size: the box in the leaf's frame.
        leads: the joint this one mimics, of a double door's second leaf.
    """

    link: str
    joint: str
    joint_type: Literal["revolute", "prismatic"]
    origin: tuple[float, float, float]
    axis: tuple[float, float, float]
    upper: float
    centre: tuple[float, float, float]
    size: tuple[float, float, float]
    leads: str | None = None


def leaves_of(
    door: DraftDoor, along: tuple[float, float], z: tuple[float, float], thickness_m: float
) -> tuple[Leaf, ...]:
    """The leaf, or both leaves, that fill the hole `along` x `z` of a wall of the given thickness."""
    is_double = door.motion.startswith("double")
    # a double door's leaves also keep the clearance between them
    width_m = along[1] - along[0] - 2 * CLEARANCE_M
    width_m = (width_m - CLEARANCE_M) / 2 if is_double else width_m
    ends: tuple[Literal["start", "end"], ...] = ("start", "end") if is_double else (door.hinge,)
    make = _hinged if door.motion.endswith("hinged") else _sliding
    leaves: list[Leaf] = []
    for end, suffix in zip(ends, ("_a", "_b") if is_double else ("",), strict=True):
        leads = leaves[0].joint if leaves else None
        leaves.append(make(door, door.name + suffix, end, (*along, *z), (width_m, thickness_m), leads))
    return tuple(leaves)


def _hinged(
    door: DraftDoor,
    link: str,
    end: Literal["start", "end"],
    hole: tuple[float, float, float, float],
    sizes_m: tuple[float, float],
    leads: str | None,
) -> Leaf:
    x0, x1, z0, z1 = hole
    width_m, thickness_m = sizes_m
    deep_m = min(LEAF_M, thickness_m)
    into = 1.0 if end == "start" else -1.0
    out = 1.0 if door.side == "left" else -1.0
    return Leaf(
        link,
        f"{link}_hinge",
        "revolute",
        (x0 + CLEARANCE_M if end == "start" else x1 - CLEARANCE_M, out * thickness_m / 2, z0),
        # from along the wall to the side it opens to, the positive way round
        (0.0, 0.0, into * out),
        door.travel_rad,
        (into * width_m / 2, -out * deep_m / 2, (z1 - z0) / 2),
        (width_m, deep_m, z1 - z0 - 2 * CLEARANCE_M),
        leads,
    )


def _sliding(
    door: DraftDoor,
    link: str,
    end: Literal["start", "end"],
    hole: tuple[float, float, float, float],
    sizes_m: tuple[float, float],
    leads: str | None,
) -> Leaf:
    """A panel that hangs in front of the wall's face, so that the wall need not be hollow."""
    x0, x1, z0, z1 = hole
    width_m, thickness_m = sizes_m
    into = 1.0 if end == "start" else -1.0
    out = 1.0 if door.side == "left" else -1.0
    return Leaf(
        link,
        f"{link}_slide",
        "prismatic",
        (
            x0 + CLEARANCE_M if end == "start" else x1 - CLEARANCE_M,
            out * (thickness_m / 2 + CLEARANCE_M + LEAF_M / 2),
            z0,
        ),
        (-into, 0.0, 0.0),
        width_m,
        (into * width_m / 2, 0.0, (z1 - z0) / 2),
        (width_m, LEAF_M, z1 - z0 - 2 * CLEARANCE_M),
        leads,
    )
