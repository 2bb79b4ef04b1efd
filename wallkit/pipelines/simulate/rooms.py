"""A room of some kind -> what stands in it: cubicles, urinals and sinks with mirrors; desks and cupboards; shelves."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from wallkit.maps.draft.doors import DraftDoor
from wallkit.maps.draft.draft import DraftFixture, DraftOpening, DraftWall

# before a door nothing stands
_BEFORE_DOOR_M = 1.15


@dataclass(frozen=True)
class Plot:
    """An empty room: u runs along its corridor wall, v from that wall to the far one [m].

    Attributes:
        inner: x0, x1, y0, y1 of its floor. is_above: whether it lies on the +y side of the corridor, v along +y.
        walls: names of the near, far, left and right wall. door: from, to along u, in the near wall.
    """

    name: str
    inner: tuple[float, float, float, float]
    is_above: bool
    walls: Mapping[str, str]
    door: tuple[float, float]
    height_m: float

    @property
    def width_m(self) -> float:
        return self.inner[1] - self.inner[0]

    @property
    def depth_m(self) -> float:
        return self.inner[3] - self.inner[2]

    def at(self, u: float, v: float) -> tuple[float, float]:
        """x, y."""
        x0, _, y0, y1 = self.inner
        return (x0 + u, y0 + v if self.is_above else y1 - v)

    def yaw(self, wall: str) -> float:
        """Of something that has its back to a wall and looks into the room."""
        inward = math.pi / 2 if self.is_above else -math.pi / 2
        return {"near": inward, "far": -inward, "left": 0.0, "right": math.pi}[wall]

    def on(self, wall: str, along_m: float) -> tuple[float, float, float]:
        """Pose of something on a wall; along the near and far wall it is u, else v."""
        u = {"left": 0.0, "right": self.width_m}.get(wall, along_m)
        v = {"near": 0.0, "far": self.depth_m}.get(wall, along_m)
        return (*self.at(u, v), self.yaw(wall))


@dataclass
class Furnished:
    """What stands in a room."""

    plot: Plot
    fixtures: list[DraftFixture] = field(default_factory=list)
    walls: list[DraftWall] = field(default_factory=list)

    def put(
        self, class_name: str, wall: str, along_m: float, size_m: tuple[float, float, float], bottom_m: float = 0.0
    ) -> None:
        """Something with its back to a wall."""
        pose = self.plot.on(wall, along_m)
        self.fixtures.append(
            DraftFixture(self._name(class_name), class_name, pose, size_m, bottom_m, self.plot.walls[wall])
        )

    def stand(self, class_name: str, u: float, v: float, yaw: float, size_m: tuple[float, float, float]) -> None:
        """Something in the middle of the room."""
        pose = (*self.plot.at(u, v), yaw)
        self.fixtures.append(DraftFixture(self._name(class_name), class_name, pose, size_m))

    def _name(self, class_name: str) -> str:
        return f"{class_name}_{self.plot.name}_{len(self.fixtures)}"


def restroom(rng: np.random.Generator, plot: Plot) -> Furnished:
    """Cubicles along the far wall, urinals on the right one, sinks beside the door."""
    made = Furnished(plot)
    depth = _cubicles(rng, made) if plot.depth_m > 3.0 and rng.random() < 0.85 else 0.0
    room_m = plot.depth_m - depth - 0.35
    if rng.random() < 0.75:
        _urinals(rng, made, room_m)
    _sinks(rng, made)
    if rng.random() < 0.6 and room_m > 1.7:
        made.put("trash", "left", min(room_m - 0.3, 2.0), (0.25, 0.35, float(rng.uniform(0.5, 0.8))))
    if rng.random() < 0.6 and room_m > 1.6:
        made.put("dispenser", "left", 1.45, (0.12, float(rng.uniform(0.25, 0.35)), 0.35), 1.1)
    return made


def _cubicles(rng: np.random.Generator, made: Furnished) -> float:
    """Toilets between panels, behind a front with a door for each; the depth they take."""
    plot = made.plot
    pitch, depth = float(rng.uniform(0.9, 1.15)), float(rng.uniform(1.4, 1.6))
    count = min(int(rng.integers(1, 5)), int((plot.width_m - 0.1) // pitch))
    tall, gap = float(rng.uniform(1.8, 2.1)), float(rng.uniform(0.1, 0.2))
    deep, wide, high = float(rng.uniform(0.55, 0.68)), float(rng.uniform(0.34, 0.4)), float(rng.uniform(0.38, 0.46))
    has_front = rng.random() < 0.7
    begin = plot.width_m - count * pitch
    for k in range(count):
        u = begin + (k + 0.5) * pitch
        made.put("toilet", "far", u, (deep, wide, high))
        made.put(
            "partition", "far", u - pitch / 2 + (0.02 if k == 0 and begin < 0.03 else 0.0), (depth, 0.03, tall), gap
        )
    if has_front:
        v = plot.depth_m - depth - 0.025
        start, end = plot.at(begin - 0.015, v), plot.at(plot.width_m + 0.02, v)
        leaf = float(rng.uniform(0.6, 0.68))
        doors = []
        for k in range(count):
            along = 0.015 + (k + 0.5) * pitch
            side = "right" if plot.is_above else "left"
            door = DraftDoor(f"stall_{plot.name}_{k}", "hinged", "start", side, connects=None)  # type: ignore[arg-type]
            span = (along - leaf / 2, along + leaf / 2)
            doors.append(DraftOpening(f"s_{plot.name}_{k}", "door", span, (0.0, tall - 0.05), door))
        made.walls.append(DraftWall(f"front_{plot.name}", start, end, 0.03, tall, tuple(doors), "partition"))
    return depth


def _urinals(rng: np.random.Generator, made: Furnished, room_m: float) -> None:
    pitch = float(rng.uniform(0.7, 0.85))
    count = min(int(rng.integers(1, 5)), int(max(room_m - 0.3, 0) // pitch))
    size = (float(rng.uniform(0.28, 0.38)), float(rng.uniform(0.3, 0.4)), float(rng.uniform(0.5, 0.75)))
    bottom = float(rng.uniform(0.35, 0.6))
    screens = rng.random() < 0.5
    for k in range(count):
        v = 0.35 + (k + 0.5) * pitch
        made.put("urinal", "right", v, size, bottom)
        if screens and k:
            made.put("partition", "right", v - pitch / 2, (0.42, 0.03, 0.9), 0.5)


def _sinks(rng: np.random.Generator, made: Furnished) -> None:
    """Beside the door, each with a mirror, or all with one."""
    plot = made.plot
    begin = plot.door[1] + 0.25
    pitch = float(rng.uniform(0.65, 0.9))
    count = min(int(rng.integers(1, 4)), int(max(plot.width_m - 0.5 - begin, 0) // pitch))
    size = (float(rng.uniform(0.4, 0.5)), float(rng.uniform(0.42, 0.55)), float(rng.uniform(0.14, 0.25)))
    mirror = (float(rng.uniform(0.6, 1.0)), float(rng.uniform(1.0, 1.2)))
    one = rng.random() < 0.4
    for k in range(count):
        u = begin + (k + 0.5) * pitch
        made.put("sink", "near", u, size, float(rng.uniform(0.62, 0.7)))
        if not one:
            made.put("mirror", "near", u, (0.01, 0.75 * pitch, mirror[0]), mirror[1])
    if one and count:
        made.put("mirror", "near", begin + count * pitch / 2, (0.01, count * pitch - 0.1, mirror[0]), mirror[1])


def office(rng: np.random.Generator, plot: Plot) -> Furnished:
    """Desks with chairs, cupboards along the right wall, a radiator under the window."""
    made = Furnished(plot)
    u, v = plot.width_m, plot.depth_m
    if rng.random() < 0.6:
        made.put("radiator", "far", u / 2, (0.1, float(rng.uniform(0.6, 1.4)), 0.5), 0.12)
    at = 0.4
    while at < v - 1.0 and rng.random() < 0.75:
        wide = float(rng.uniform(0.6, 1.2))
        made.put("furniture", "right", at + wide / 2, (0.4, wide, float(rng.uniform(0.7, 2.1))))
        at += wide + float(rng.uniform(0.02, 0.5))
    for k in range(int(rng.integers(1, 3))):
        x = 0.9 + k * 1.9
        y = float(rng.uniform(max(_BEFORE_DOOR_M + 0.8, 0.5 * v), v - 0.9))
        if x > u - 1.4:
            break
        turn = float(rng.uniform(-0.15, 0.15))
        made.stand("furniture", x, y, turn, (float(rng.uniform(1.2, 1.5)), 0.7, float(rng.uniform(0.7, 0.77))))
        made.stand("furniture", x, y - 0.65, turn, (0.45, 0.45, float(rng.uniform(0.45, 0.95))))
    if rng.random() < 0.35 and u > 4:
        side = float(rng.uniform(0.25, 0.45))
        made.stand("column", u - 0.9 - side, 0.35 * v + 0.4, 0.0, (side, side, plot.height_m))
    return made


def store(rng: np.random.Generator, plot: Plot) -> Furnished:
    """Shelves along the walls, boxes and bins on the floor."""
    made = Furnished(plot)
    for wall, begin, end in (("far", 0.5, plot.width_m - 0.5), ("left", _BEFORE_DOOR_M + 0.2, plot.depth_m - 0.6)):
        at = begin
        while at + 0.8 < end:
            wide = float(rng.uniform(0.5, 1.0))
            if rng.random() < 0.6:
                made.put(
                    "furniture", wall, at + wide / 2, (float(rng.uniform(0.3, 0.5)), wide, float(rng.uniform(0.4, 2.1)))
                )
            at += wide + 0.05
    first, last = plot.door[1] + 0.4, plot.width_m - 0.5
    for u in np.arange(first, last, 0.9).tolist():
        if rng.random() < 0.4:
            continue
        v = float(rng.uniform(0.8, plot.depth_m - 1.2))
        size = tuple(rng.uniform(0.2, 0.55, 3).tolist())
        made.stand(str(rng.choice(["furniture", "trash"])), u, v, float(rng.uniform(-1, 1)), size)
    return made


FURNISHERS: Mapping[str, Callable[[np.random.Generator, Plot], Furnished]] = {
    "restroom": restroom,
    "office": office,
    "store": store,
}
