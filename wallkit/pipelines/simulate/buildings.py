"""A random generator -> the draft of a building that nobody has seen: rooms of several kinds on both sides of a corridor."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from typing import Literal

import numpy as np

from wallkit.maps.draft.doors import DoorMotion, DraftDoor
from wallkit.maps.draft.draft import Draft, DraftFixture, DraftOpening, DraftPane, DraftRoom, DraftWall
from wallkit.pipelines.simulate.rooms import FURNISHERS, Plot

DOOR_M = 2.1
# how often a room is what
KINDS = {"restroom": 0.5, "office": 0.3, "store": 0.2}


@dataclass
class _Plan:
    """What is drawn so far."""

    height_m: float
    thick_m: float
    walls: list[DraftWall] = field(default_factory=list)
    fixtures: list[DraftFixture] = field(default_factory=list)
    rooms: list[DraftRoom] = field(default_factory=list)


def random_building(rng: np.random.Generator) -> Draft:
    """One to two rooms on each side of a corridor, each with a door to it; restrooms are the most frequent.

    The first room is always a restroom or an office; sizes, heights, wall thickness and all furniture are drawn.
    """
    plan = _Plan(float(rng.uniform(2.4, 3.4)), float(rng.choice([0.1, 0.12, 0.15, 0.2])))
    widths = [rng.uniform(3.4, 6.0, int(rng.integers(1, 3))) for _ in range(2)]
    length = float(max(w.sum() for w in widths))
    corridor = float(rng.uniform(1.6, 3.2))
    depths = rng.uniform(3.6, 6.0, 2)
    low, high = float(depths[0]), float(depths[0]) + corridor
    top = high + float(depths[1])
    plan.rooms.append(DraftRoom("corridor", "circulation", _inner(plan, 0.0, low, length, high)))
    for side, (near, far) in {"a": (low, 0.0), "b": (high, top)}.items():
        shares = np.cumsum(widths["ab".index(side)])
        edges = [0.0, *(shares / shares[-1] * length).tolist()]
        _row(rng, plan, side, near, far, edges)
    plan.walls += [
        DraftWall("west", (0, 0), (0, top), plan.thick_m, plan.height_m),
        DraftWall("east", (length, 0), (length, top), plan.thick_m, plan.height_m),
    ]
    _furnish_corridor(rng, plan, length, low, high)
    return Draft("random", tuple(plan.walls), tuple(plan.fixtures), tuple(plan.rooms), scan_plane_m=0.3)


def _row(rng: np.random.Generator, plan: _Plan, side: str, near: float, far: float, edges: list[float]) -> None:
    """The rooms on one side of the corridor, with the walls between them."""
    openings: dict[str, list[DraftOpening]] = {"near": [], "back": []}
    for k, (x0, x1) in enumerate(pairwise(edges)):
        name = f"{side}{k}"
        kind = str(rng.choice(list(KINDS), p=list(KINDS.values())))
        h = plan.thick_m / 2
        walls = {
            "near": f"near_{side}",
            "far": f"back_{side}",
            "left": "west" if k == 0 else f"part_{side}{k - 1}",
            "right": "east" if k == len(edges) - 2 else f"part_{side}{k}",
        }
        inner = (x0 + h, x1 - h, min(near, far) + h, max(near, far) - h)
        door_m, at = float(rng.choice([0.8, 0.9, 1.0])), float(rng.uniform(0.15, 0.5))
        plot = Plot(name, inner, far > near, walls, (at, at + door_m), plan.height_m)
        plan.rooms.append(DraftRoom(f"room_{name}", kind, _inner(plan, x0, min(near, far), x1, max(near, far))))
        openings["near"] += _openings(rng, name, kind, plot, h + x0)
        if kind != "restroom" and rng.random() < 0.6:
            middle, width = (x0 + x1) / 2, float(rng.uniform(0.8, 1.8))
            pane = DraftPane(f"pane_{name}", "window")
            z = (float(rng.uniform(0.7, 1.1)), float(rng.uniform(1.7, 2.2)))
            openings["back"].append(
                DraftOpening(f"w_{name}", "window", (middle - width / 2, middle + width / 2), z, pane)
            )
        furnished = FURNISHERS[kind](rng, plot)
        plan.fixtures += furnished.fixtures
        plan.walls += furnished.walls
    length = edges[-1]
    for name, y in (("near", near), ("back", far)):
        wall = DraftWall(f"{name}_{side}", (0, y), (length, y), plan.thick_m, plan.height_m, tuple(openings[name]))
        plan.walls.append(wall)
    for k, x in enumerate(edges[1:-1]):
        ends = sorted((near, far))
        plan.walls.append(DraftWall(f"part_{side}{k}", (x, ends[0]), (x, ends[1]), plan.thick_m, plan.height_m))


def _openings(rng: np.random.Generator, name: str, kind: str, plot: Plot, x0: float) -> list[DraftOpening]:
    """The room's door, and of an office now and then a pane to the corridor."""
    # a sliding leaf would run over the sinks
    motion: DoorMotion = "hinged" if kind == "restroom" or rng.random() < 0.75 else "sliding"
    opens: Literal["left", "right"] = "left" if plot.is_above else "right"
    door = DraftDoor(
        f"door_{name}", motion, "start" if motion == "hinged" else "end", opens, connects=("corridor", f"room_{name}")
    )
    from_m, to_m = plot.door
    found = [DraftOpening(f"d_{name}", "door", (x0 + from_m, x0 + to_m), (0.0, DOOR_M), door)]
    width = plot.width_m - to_m - 0.9
    if kind == "office" and width > 0.8 and motion == "hinged" and rng.random() < 0.6:
        bottom = float(rng.choice([0.05, 0.9]))
        along = (x0 + to_m + 0.4, x0 + to_m + 0.4 + min(width, float(rng.uniform(0.8, 2.4))))
        found.append(DraftOpening(f"g_{name}", "window", along, (bottom, 2.1), DraftPane(f"glazing_{name}", "glass")))
    return found


def _furnish_corridor(rng: np.random.Generator, plan: _Plan, length: float, low: float, high: float) -> None:
    """A bin, a bench, a column or a cabinet by the end walls, and clutter."""
    h = plan.thick_m / 2
    middle = (low + high) / 2
    for name, x, yaw in (("west", h, 0.0), ("east", length - h, np.pi)):
        draw = rng.random()
        if draw < 0.35:
            size = (float(rng.uniform(0.3, 0.5)), float(rng.uniform(0.6, 1.4)), float(rng.uniform(0.45, 2.0)))
            plan.fixtures.append(DraftFixture(f"furniture_{name}", "furniture", (x, middle, yaw), size, 0.0, name))
        elif draw < 0.6:
            size = (float(rng.uniform(0.08, 0.14)), float(rng.uniform(0.6, 1.4)), 0.6)
            plan.fixtures.append(DraftFixture(f"radiator_{name}", "radiator", (x, middle, yaw), size, 0.12, name))
    if high - low > 2.6 and rng.random() < 0.6:
        side = float(rng.uniform(0.25, 0.5))
        at = (float(rng.uniform(0.35, 0.65)) * length, middle, 0.0)
        plan.fixtures.append(DraftFixture("column_corridor", "column", at, (side, side, plan.height_m)))


def _inner(plan: _Plan, x0: float, y0: float, x1: float, y1: float) -> tuple[tuple[float, float], ...]:
    """The floor between four wall axes."""
    h = plan.thick_m / 2
    return ((x0 + h, y0 + h), (x1 - h, y0 + h), (x1 - h, y1 - h), (x0 + h, y1 - h))
