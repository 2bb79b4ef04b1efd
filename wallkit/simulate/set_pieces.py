"""A world and its wardrobe -> the pieces that a renderer draws: meshes with texture coordinates, and plain shapes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from wallkit.core.types import Float64Array, Int64Array
from wallkit.simulate.looks import Surface, Wardrobe
from wallkit.simulate.panels import Panel, floor_triangles, panels_of, room_numbers
from wallkit.simulate.world import MAP, Solid, World

# before what they lie on, so that they win; far less than a pixel
_POSTER_M, _FLOOR_M = 0.002, 0.001


@dataclass(frozen=True, eq=False)
class Piece:
    """A mesh of one surface: vertices (V, 3) in the frame of the solid's body, triangles (M, 3), uvs (V, 2)."""

    solid: int
    surface: Surface
    vertices: Float64Array
    triangles: Int64Array
    uvs: Float64Array


@dataclass(frozen=True, eq=False)
class Primitive:
    """A shape of one surface as it is."""

    solid: int
    surface: Surface
    shape: Solid


@dataclass(frozen=True, eq=False)
class Pieces:
    """Everything to draw, and the ceiling's lowest corner (2,) and size."""

    all: tuple[Piece | Primitive, ...]
    ceiling: tuple[Float64Array, tuple[float, float]]


def pieces_of(wardrobe: Wardrobe) -> Pieces:
    """Every solid of the world as it looks; posters on the walls, a floor for every room, one ceiling."""
    world = wardrobe.world
    found: list[Piece | Primitive] = []
    for number, solid in enumerate(world.solids):
        if solid.light == "mirror" and solid.kind == "box":
            found.append(Primitive(number, wardrobe.mirror, _mirror(world, solid)))
        elif solid.kind == "box":
            found += _box(wardrobe, number)
        else:
            found.append(Primitive(number, wardrobe.plain(solid), solid))
    return Pieces(tuple(found), _ceiling(world))


def _box(wardrobe: Wardrobe, number: int) -> Iterator[Piece]:
    """The faces of a box, those of one surface together."""
    world, solid = wardrobe.world, wardrobe.world.solids[number]
    if solid.class_name == "floor":
        yield from _floors(wardrobe, number)
    by_surface: dict[int, tuple[Surface, list[Panel]]] = {}
    for panel in panels_of(world, number):
        is_ceiling = solid.class_name == "ceiling" and panel.side == "bottom"
        surface = wardrobe.ceiling(panel.size_m[::-1]) if is_ceiling else wardrobe.panel(panel)
        if is_ceiling:
            yield _under_side(panel, solid, surface)
            continue
        by_surface.setdefault(id(surface), (surface, []))[1].append(panel)
        yield from _posters(wardrobe, panel)
    for surface, panels in by_surface.values():
        yield _piece(number, surface, panels)


def _piece(number: int, surface: Surface, panels: list[Panel]) -> Piece:
    texture = None if surface.fits else surface.texture
    place = (None,) if texture is None else (texture.size_m, texture.begins_m)
    vertices, triangles, uvs = zip(*(panel.grid(*place) for panel in panels), strict=True)
    before = np.cumsum([0, *(len(part) for part in vertices[:-1])])
    joined = np.concatenate([part + offset for part, offset in zip(triangles, before, strict=True)])
    return Piece(number, surface, np.concatenate(vertices), joined, np.concatenate(uvs))


def _posters(wardrobe: Wardrobe, panel: Panel) -> Iterator[Piece]:
    """Posters on a piece of wall, at the height of eyes, apart from each other."""
    solid, (width, height) = wardrobe.world.solids[panel.solid], panel.size_m
    if solid.class_name != "wall" or not panel.room or width < 0.8 or height < 2.0 or panel.side in ("top", "bottom"):
        return
    name = f"{panel.solid} {panel.side} {panel.start_m[0]:.2f}"
    rng = wardrobe.rng(f"posters {name}")
    at = 0.2 + rng.exponential(1.0)
    while at < width - 0.7:
        w, h = float(rng.uniform(0.3, 0.6)), float(rng.uniform(0.4, 0.85))
        if rng.random() < wardrobe.looks.posters * 1.5:
            hung = panel.within(at, float(rng.uniform(1.1, 1.4)), (w, h), _POSTER_M)
            yield _piece(panel.solid, wardrobe.poster(f"{name} {at:.2f}", (round(w, 2), round(h, 2))), [hung])
        at += w + 0.1 + rng.exponential(0.8)


def _floors(wardrobe: Wardrobe, number: int) -> Iterator[Piece]:
    """The floor of every room on top of the slab."""
    solid = wardrobe.world.solids[number]
    top = float(solid.T_body_solid[2, 3] + solid.size[2] / 2) + _FLOOR_M
    for room in wardrobe.world.rooms:
        corners, triangles = floor_triangles(room)
        surface = wardrobe.floor(room.kind, room.id)
        w, h = surface.texture.size_m if surface.texture else (1.0, 1.0)
        vertices = np.column_stack([corners, np.full(len(corners), top)])
        yield Piece(number, surface, vertices, triangles, np.column_stack([corners[:, 0] / w, -corners[:, 1] / h]))


def _under_side(panel: Panel, solid: Solid, surface: Surface) -> Piece:
    """The ceiling from below: the picture's columns along +x of the map, its rows along +y."""
    vertices, triangles, _ = panel.grid(None)
    R, t = solid.T_body_solid[:3, :3], solid.T_body_solid[:3, 3]
    flat = ((vertices - t) @ R)[:, :2] + np.array(solid.size[:2]) / 2
    size = solid.size[:2] if surface.fits or surface.texture is None else surface.texture.size_m
    return Piece(panel.solid, surface, vertices, triangles, flat / size)


def _ceiling(world: World) -> tuple[Float64Array, tuple[float, float]]:
    for solid in world.solids:
        if solid.class_name == "ceiling":
            size = (float(solid.size[0]), float(solid.size[1]))
            return solid.T_body_solid[:2, 3] - np.array(size) / 2, size
    low, high = world.extent
    return low, (float(high[0] - low[0]), float(high[1] - low[1]))


def _mirror(world: World, solid: Solid) -> Solid:
    """The same box with its z axis out of the side that shows: MuJoCo reflects on that one only.

    That is the broad side which looks into a room; of two that do, or none, the front.
    """
    axis = int(np.argmin(solid.size))
    R, t = solid.T_body_solid[:3, :3], solid.T_body_solid[:3, 3]
    normal = R[:, axis]
    if world.rooms and solid.body == MAP:
        before = room_numbers(world.rooms, np.array([(t + 0.06 * sign * normal)[:2] for sign in (1, -1)]))
        if before[0] < 0 <= before[1]:
            normal = -normal
    others = [k for k in range(3) if k != axis]
    x = R[:, others[0]]
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = np.column_stack([x, np.cross(normal, x), normal]), t
    size = (solid.size[others[0]], solid.size[others[1]], solid.size[axis])
    return replace(solid, size=size, T_body_solid=T)
