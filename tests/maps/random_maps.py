"""Random clean maps: rooms on both sides of a corridor, with doors, windows and fixtures, turned by any angle."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from wallkit.maps.draft.doors import DraftDoor
from wallkit.maps.draft.draft import Draft, DraftFixture, DraftOpening, DraftPane, DraftRoom, DraftWall
from wallkit.maps.draft.write import write_draft

THICK_M = 0.12
# (deep, wide, high), underside above the floor; what hangs on a wall
FIXTURES = {
    "toilet": ((0.6, 0.4, 0.45), 0.0),
    "urinal": ((0.32, 0.35, 0.6), 0.55),
    "sink": ((0.42, 0.5, 0.18), 0.69),
    "radiator": ((0.1, 1.0, 0.6), 0.1),
}


def clean_map(rng: np.random.Generator, *, turned: bool = True) -> bytes:
    """A building of one to three rooms on each side of a corridor, with nothing wrong in it.

    Args:
        turned: by any angle about any point; else along the axes, from the origin.
    """
    widths = [_spread(rng, int(rng.integers(1, 4))) for _ in range(2)]
    length = max(sum(w) for w in widths)
    corridor, (depth_below, depth_above) = rng.uniform(1.8, 2.6), rng.uniform(3.5, 5.5, 2)
    low, high = depth_below, depth_below + corridor
    walls: list[DraftWall] = []
    fixtures: list[DraftFixture] = []
    rooms = [DraftRoom("corridor", "circulation", _inner(0, low, length, high))]
    for side, (near, far) in {"a": (low, 0.0), "b": (high, high + depth_above)}.items():
        edges = np.round(np.concatenate([[0.0], np.cumsum(widths["ab".index(side)])]), 2)
        edges = edges * (length / edges[-1])
        doors, windows = [], []
        for k, (x0, x1) in enumerate(pairwise(edges.tolist())):
            room = f"room_{side}{k}"
            rooms.append(DraftRoom(room, "office", _inner(x0, min(near, far), x1, max(near, far))))
            doors.append(_door(rng, f"{side}{k}", x0 + 0.3, room))
            windows += _window(rng, f"{side}{k}", x0, x1)
            fixtures += _fixtures(rng, f"{side}{k}", (x0, x1), near, far, f"back_{side}")
        walls.append(DraftWall(f"near_{side}", (0, near), (length, near), THICK_M, openings=tuple(doors)))
        walls.append(DraftWall(f"back_{side}", (0, far), (length, far), THICK_M, openings=tuple(windows)))
        ends = [(min(near, far), max(near, far))]
        walls += [
            DraftWall(f"part_{side}{k}", (x, ends[0][0]), (x, ends[0][1]), THICK_M)
            for k, x in enumerate(edges[1:-1].tolist())
        ]
    top = high + depth_above
    walls += [DraftWall("west", (0, 0), (0, top), THICK_M), DraftWall("east", (length, 0), (length, top), THICK_M)]
    draft = Draft("random", tuple(walls), tuple(fixtures), tuple(rooms), scan_plane_m=0.3)
    return write_draft(_turned(rng, draft) if turned else draft)


def _spread(rng: np.random.Generator, count: int) -> list[float]:
    return np.round(rng.uniform(3.0, 5.0, count), 2).tolist()


def _inner(x0: float, y0: float, x1: float, y1: float) -> tuple[tuple[float, float], ...]:
    """The floor between four wall axes."""
    h = THICK_M / 2
    return ((x0 + h, y0 + h), (x1 - h, y0 + h), (x1 - h, y1 - h), (x0 + h, y1 - h))


def _door(rng: np.random.Generator, name: str, x: float, room: str) -> DraftOpening:
    """A door near the room's left end that opens into the room."""
    width = float(rng.choice([0.8, 0.9, 1.0]))
    side = "right" if room.startswith("room_a") else "left"
    motion = "hinged" if rng.random() < 0.8 else "sliding"
    hinge = "start" if motion == "hinged" else "end"
    door = DraftDoor(f"door_{name}", motion, hinge, side, connects=("corridor", room))
    return DraftOpening(f"d_{name}", "door", (x, x + width), (0.0, 2.1), door)


def _window(rng: np.random.Generator, name: str, x0: float, x1: float) -> list[DraftOpening]:
    if rng.random() < 0.5:
        return []
    at, width = (x0 + x1) / 2 - 0.5, float(rng.uniform(0.8, 1.2))
    return [DraftOpening(f"w_{name}", "window", (at, at + width), (1.0, 2.0), DraftPane(f"pane_{name}"))]


def _fixtures(
    rng: np.random.Generator, name: str, between: tuple[float, float], near: float, far: float, wall: str
) -> list[DraftFixture]:
    """Things on the back wall below its window, and a piece of furniture in the middle."""
    facing = math.pi / 2 if far < near else -math.pi / 2
    face = far + math.copysign(THICK_M / 2, near - far)
    kind = str(rng.choice(list(FIXTURES)))
    size, bottom = FIXTURES[kind]
    x = between[0] + 0.75 + float(rng.uniform(0.0, 0.2))
    found = [DraftFixture(f"{kind}_{name}", kind, (x, face, facing), size, bottom, wall)]
    if rng.random() < 0.5:
        middle = (between[0] + between[1]) / 2 + 0.4
        found.append(DraftFixture(f"desk_{name}", "furniture", (middle, (near + 2 * far) / 3, 0.1), (0.7, 1.0, 0.75)))
    return found


def _turned(rng: np.random.Generator, draft: Draft) -> Draft:
    """The draft moved by any rigid motion."""
    from dataclasses import replace

    yaw, (dx, dy) = float(rng.uniform(-math.pi, math.pi)), rng.uniform(-5, 5, 2)
    c, s = math.cos(yaw), math.sin(yaw)

    def at(p: tuple[float, float]) -> tuple[float, float]:
        return float(c * p[0] - s * p[1] + dx), float(s * p[0] + c * p[1] + dy)

    return replace(
        draft,
        walls=tuple(replace(w, start=at(w.start), end=at(w.end)) for w in draft.walls),
        fixtures=tuple(replace(f, pose=(*at(f.pose[:2]), f.pose[2] + yaw)) for f in draft.fixtures),
        rooms=tuple(replace(r, floor=tuple(map(at, r.floor))) for r in draft.rooms),
    )
