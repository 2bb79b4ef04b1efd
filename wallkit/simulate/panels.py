"""Solids -> flat panels with metric texture coordinates, cut where a wall passes from one room to the next.

MuJoCo projects a 2-D texture through a box along one axis, which leaves streaks on the others; a box therefore becomes a
mesh of its faces, each with coordinates of its own.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from wallkit.core.types import Float64Array, Int64Array
from wallkit.simulate.world import MAP, Room, World

SIDES = ("front", "back", "left", "right", "top", "bottom")
# x forward, y left, z up in the solid's own frame, as the fixtures of a map stand before their wall
_NORMALS = np.array([(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)], dtype=np.float64)
_CUT_STEP_M = 0.05
_BEFORE_M = 0.06
_CELL_M, _MOST_CELLS = 0.5, 60


@dataclass(frozen=True, eq=False)
class Panel:
    """A flat piece of one face of a box.

    Attributes:
        solid: its number in the world. side: of SIDES, in the solid's own frame.
        corners: (4, 3) in the frame of the solid's body, anticlockwise from the lower left one as seen from outside.
        size_m: (width, height). room: the room it looks into, "" for none or where rooms do not matter.
        start_m: (u, v) place of its lower left corner on the surface it belongs to [m].
    """

    solid: int
    side: str
    corners: Float64Array
    size_m: tuple[float, float]
    room: str
    start_m: tuple[float, float]

    def grid(
        self, texture_m: tuple[float, float] | None, begins_m: tuple[float, float] = (0.0, 0.0)
    ) -> tuple[Float64Array, Int64Array, Float64Array]:
        """Vertices (V, 3), triangles (M, 3) and texture coordinates (V, 2), (0, 0) the picture's upper left corner.

        Light is computed at vertices, so large panels are divided. Without a texture's size it fills the panel once.
        """
        low, high = np.zeros(2), np.ones(2)
        if texture_m is not None:
            low = (np.array(self.start_m) + begins_m) / texture_m
            high = low + np.array(self.size_m) / texture_m
        columns, rows = (max(1, min(_MOST_CELLS, int(np.ceil(side / _CELL_M)))) for side in self.size_m)
        u, v = (g.ravel()[:, None] for g in np.meshgrid(np.linspace(0, 1, columns + 1), np.linspace(0, 1, rows + 1)))
        a, b, _, d = self.corners
        first = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).ravel()[:, None]
        cells = first + np.array([0, 1, columns + 2, columns + 1])
        triangles = cells[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
        # a picture's rows go down
        uvs = np.hstack([low[0] + u * (high[0] - low[0]), 1 - (low[1] + v * (high[1] - low[1]))])
        return a + u * (b - a) + v * (d - a), triangles, uvs

    def within(self, u_m: float, v_m: float, size_m: tuple[float, float], off_m: float) -> Panel:
        """A smaller panel on this one, its lower left corner at (u, v) from this one's, so far before it."""
        right, up = (self.corners[k] - self.corners[0] for k in (1, 3))
        right, up = right / self.size_m[0], up / self.size_m[1]
        spans = np.array([(0, 0), (1, 0), (1, 1), (0, 1)]) * size_m + (u_m, v_m)
        corners = self.corners[0] + spans @ np.stack([right, up]) + off_m * np.cross(right, up)
        return Panel(self.solid, self.side, corners, size_m, self.room, (0.0, 0.0))


def panels_of(world: World, number: int) -> list[Panel]:
    """The six faces of a box; those of a wall that stands fast cut at the rooms' borders.

    Surfaces of what stands fast are continuous in the map: tiles run on from one piece of a wall to the next, and begin at
    the floor. What moves carries its own surface along.
    """
    solid = world.solids[number]
    x, y, z = solid.size
    extents = {0: (y, z, x), 2: (x, z, y), 4: (y, x, z)}
    found = []
    for k, (side, normal) in enumerate(zip(SIDES, _NORMALS, strict=True)):
        width, height, depth = extents[k - k % 2]
        up = np.array([0.0, 0, 1]) if k < 4 else np.array([1.0, 0, 0]) * (-1 if side == "top" else 1)
        right = np.cross(up, normal)
        middle = normal * depth / 2
        corners = middle + np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) @ np.stack(
            [right * width / 2, up * height / 2]
        )
        R, t = solid.T_body_solid[:3, :3], solid.T_body_solid[:3, 3]
        turned = corners @ R.T + t
        start = (0.0, 0.0)
        if solid.body == MAP:
            start = (float(turned[0] @ (R @ right)), float(turned[0] @ (R @ up)))
        whole = Panel(number, side, turned, (width, height), "", start)
        is_wall = solid.class_name == "wall" and solid.body == MAP and k < 4 and world.rooms
        found += _cut(whole, R @ normal, world.rooms) if is_wall else [whole]
    return found


def _cut(panel: Panel, normal: Float64Array, rooms: tuple[Room, ...]) -> list[Panel]:
    """The panel in pieces, each before one room."""
    along = panel.corners[1] - panel.corners[0]
    count = max(1, int(np.ceil(panel.size_m[0] / _CUT_STEP_M)))
    middles = panel.corners[0] + (np.arange(count)[:, None] + 0.5) / count * along + _BEFORE_M * normal
    numbers = room_numbers(rooms, middles[:, :2])
    edges = np.concatenate([[0], np.flatnonzero(np.diff(numbers)) + 1, [count]])
    pieces = []
    for a, b in pairwise((edges / count).tolist()):
        corners = panel.corners[[0, 0, 3, 3]] + np.array([a, b, b, a])[:, None] * along
        number = int(numbers[round(a * count)])
        start = (panel.start_m[0] + panel.size_m[0] * a, panel.start_m[1])
        size = (panel.size_m[0] * (b - a), panel.size_m[1])
        pieces.append(Panel(panel.solid, panel.side, corners, size, rooms[number].id if number >= 0 else "", start))
    return pieces


def room_numbers(rooms: tuple[Room, ...], points: Float64Array) -> Int64Array:
    """(K,) number of the room that points (K, 2) are in, -1 for none."""
    import shapely

    found = np.full(len(points), -1, dtype=np.int64)
    for number, room in enumerate(rooms):
        found[shapely.contains_xy(shapely.Polygon(room.floor), *points.T)] = number
    return found


def floor_triangles(room: Room) -> tuple[Float64Array, Int64Array]:
    """Corners (C, 2) and triangles (M, 3), anticlockwise, of a room's floor, none much longer than a metre."""
    import shapely

    x, y = np.array(room.floor).T
    columns, rows = np.arange(x.min(), x.max(), 2 * _CELL_M), np.arange(y.min(), y.max(), 2 * _CELL_M)
    u, v = (g.ravel() for g in np.meshgrid(columns, rows))
    cells = shapely.intersection(shapely.box(u, v, u + 2 * _CELL_M, v + 2 * _CELL_M), shapely.Polygon(room.floor))
    kept = cells[shapely.area(cells) > 1e-6]
    pieces = shapely.get_parts(shapely.constrained_delaunay_triangles(kept))
    rings = shapely.get_coordinates(shapely.orient_polygons(pieces)).reshape(-1, 4, 2)[:, :3]
    return rings.reshape(-1, 2), np.arange(3 * len(rings)).reshape(-1, 3)
