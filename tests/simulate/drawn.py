"""Worlds drawn in a test: a room of boxes, whatever stands in it, and doors."""

from __future__ import annotations

import math

from wallkit.simulate.world import Body, Room, Solid, World, upright


def room(x1: float = 6.0, y1: float = 4.0, *more: Solid, bodies: tuple[Body, ...] = ()) -> World:
    """A room from (0, 0) to (x1, y1), its walls outside of that."""
    t, h = 0.1, 2.5
    walls = [
        ("s", (x1 + 2 * t, t, h), (x1 / 2, -t / 2)),
        ("n", (x1 + 2 * t, t, h), (x1 / 2, y1 + t / 2)),
        ("w", (t, y1, h), (-t / 2, y1 / 2)),
        ("e", (t, y1, h), (x1 + t / 2, y1 / 2)),
    ]
    solids = [Solid(f"wall_{name}", "wall", "box", size, upright(x, y, 0.0, h / 2)) for name, size, (x, y) in walls]
    floor = ((0.0, 0.0), (x1, 0.0), (x1, y1), (0.0, y1))
    return World("room", (*solids, *more), bodies, (Room("room", "office", floor),), h, "room.urdf")


def standing(name: str, size: tuple[float, float, float], x: float, y: float, yaw: float = 0.0, **more) -> Solid:
    """A box on the floor."""
    class_name = more.pop("class_name", "furniture")
    return Solid(name, class_name, "box", size, upright(x, y, yaw, size[2] / 2), **more)


def door(name: str, x: float, y: float, width: float) -> tuple[Solid, Body]:
    """A leaf that turns about (x, y); shut it runs along +x."""
    leaf = Solid(name, "door", "box", (width, 0.04, 2.0), upright(width / 2, 0.0, 0.0, 1.0), body=f"{name}_hinge")
    hinge = Body(f"{name}_hinge", "revolute", T_parent_body=upright(x, y, 0.0), limits=(0.0, math.pi / 2))
    return leaf, hinge
