"""A floor of three rooms with doors and furniture, and what a robot that drives through it records; truth known exactly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tests.movers import legs, tour, walk
from tests.plan import Plan, cast
from wallkit.core.geometry import compose
from wallkit.maps.audit.nouns import Logged
from wallkit.maps.draft.doors import DraftDoor
from wallkit.maps.draft.draft import Draft, DraftFixture, DraftOpening, DraftRoom, DraftWall
from wallkit.maps.draft.write import write_draft
from wallkit.maps.geometry import slice_at
from wallkit.maps.model import SemanticMap
from wallkit.maps.read import read_map
from wallkit.maps.xml import parse

Z_M = 0.3
SIGMA_M = 0.01
VIEWS_HZ = 2.5


def door_in(start, kind="door", name="door_a", **more):
    door = DraftDoor(name, **more) if kind == "door" else None
    return DraftOpening(f"{name}_hole", kind, (start, start + 0.9), (0, 2.1), door)


WALLS = (
    DraftWall("south", (0, 0), (10, 0), 0.12),
    DraftWall("east", (10, 0), (10, 7), 0.12),
    DraftWall("north", (10, 7), (0, 7), 0.12),
    DraftWall("west", (0, 7), (0, 0), 0.12),
    DraftWall("middle", (5, 0), (5, 7), 0.12, openings=(door_in(1.0), door_in(5.2, "passage", "gap"))),
    DraftWall("cross", (0, 3.8), (5, 3.8), 0.12, openings=(door_in(3.0, "passage", "gap_b"),)),
)
FIXTURES = (
    DraftFixture("cupboard", "furniture", (0.06, 1.2, 0.0), (0.5, 1.0, 1.8), wall="west"),
    DraftFixture("shelf", "furniture", (9.94, 4.5, np.pi), (0.4, 1.4, 1.8), wall="east"),
    DraftFixture("column", "column", (7.5, 3.6, 0.0), (0.4, 0.4, 2.5)),
)
ROOMS = (
    DraftRoom("a", "office", ((0.06, 0.06), (4.94, 0.06), (4.94, 3.74), (0.06, 3.74))),
    DraftRoom("b", "office", ((0.06, 3.86), (4.94, 3.86), (4.94, 6.94), (0.06, 6.94))),
    DraftRoom("c", "office", ((5.06, 0.06), (9.94, 0.06), (9.94, 6.94), (5.06, 6.94))),
)
FLOOR = Draft("floor", WALLS, FIXTURES, ROOMS, scan_plane_m=Z_M)
ROUTE = [(1.5, 2.6), (3.4, 2.2), (3.45, 5.2), (1.4, 5.4), (3.4, 5.6), (6.2, 5.65), (8.8, 6.0), (8.6, 1.2), (6.2, 1.5)]
AROUND = [(6.0, 1.0), (9.0, 1.5), (8.8, 5.8), (6.2, 5.6)]


def map_of(draft: Draft = FLOOR) -> SemanticMap:
    return read_map(parse(write_draft(draft), "floor.wkmap.urdf"))


def without(name: str) -> Draft:
    kept = tuple(f for f in FLOOR.fixtures if f.name != name)
    return replace(FLOOR, fixtures=kept, walls=tuple(w for w in WALLS if w.name != name))


def with_wall(name: str, start, end) -> Draft:
    """The floor with a wall drawn elsewhere."""
    return replace(FLOOR, walls=tuple(replace(w, start=start, end=end) if w.name == name else w for w in WALLS))


def logged_in(
    truth: SemanticMap,
    seed: int,
    *,
    doors: dict[str, float] | None = None,
    people: int = 0,
    pose_sd: tuple[float, float] = (0.0, 0.0),
    sd: tuple[float, float, float] = (0.02, 0.02, 0.005),
    is_absolute: bool = True,
    beams: int = 181,
    route=ROUTE,
) -> Logged:
    """What a robot sees on its way through the rooms; pose_sd [m, rad] is put on the poses it is said to have been at."""
    rng = np.random.default_rng(seed)
    plan = Plan(slice_at(truth, Z_M, doors).segments)
    poses = tour(route, VIEWS_HZ)
    stamps = np.arange(len(poses)) / VIEWS_HZ
    bearings = np.linspace(-np.pi, np.pi, beams, endpoint=False)
    mount = np.array([0.15, 0.0, 0.0])
    walkers = [walk(AROUND, 0.9, stamps, start_m=7.0 * k) for k in range(people)]
    ranges = np.empty((len(poses), beams))
    for i, pose in enumerate(poses):
        discs = np.zeros((0, 3))
        if walkers:
            discs = legs(np.stack([w[i] for w in walkers]), np.full(people, 0.9 * stamps[i]))
        lidar = compose(pose, mount)
        ranges[i] = cast(plan, discs, lidar[:2], lidar[2] + bearings, 12.0) + SIGMA_M * rng.standard_normal(beams)
    said = poses + rng.standard_normal(poses.shape) * [pose_sd[0], pose_sd[0], pose_sd[1]]
    return Logged(
        stamps,
        said,
        np.tile(sd, (len(poses), 1)).astype(float),
        np.repeat(np.arange(len(poses)), beams),
        np.tile(bearings, len(poses)),
        ranges.ravel(),
        mount[:2],
        12.0,
        is_absolute,
    )


def scaled(factor: float) -> Draft:
    """The floor with every place (not thickness or size) multiplied."""
    walls = tuple(
        replace(
            w,
            start=(w.start[0] * factor, w.start[1] * factor),
            end=(w.end[0] * factor, w.end[1] * factor),
            openings=tuple(replace(o, along=(o.along[0] * factor, o.along[1] * factor)) for o in w.openings),
        )
        for w in WALLS
    )
    fixtures = tuple(replace(f, pose=(f.pose[0] * factor, f.pose[1] * factor, f.pose[2])) for f in FIXTURES)
    rooms = tuple(replace(r, floor=tuple((x * factor, y * factor) for x, y in r.floor)) for r in ROOMS)
    return replace(FLOOR, walls=walls, fixtures=fixtures, rooms=rooms)
