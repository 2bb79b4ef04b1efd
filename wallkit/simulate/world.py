"""What stands in a simulated place: solids with class, instance and behaviour to light, and the bodies that carry them.

The world speaks no engine's language and knows no map format: a pipeline makes it of a semantic map, a scenario changes it,
`scene` hands it to MuJoCo.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np

from wallkit.core.types import Float64Array
from wallkit.errors import SimulationError, closest

Kind = Literal["box", "cylinder", "sphere", "capsule", "mesh"]
Light = Literal["opaque", "glass", "mirror", "none"]
MAP = ""


@dataclass(frozen=True, eq=False)
class Solid:
    """One convex shape, or a mesh.

    Attributes:
        instance: the thing it is part of ("urinal_2", "person_0"). class_name: of that thing.
        kind, size: box (x, y, z) full lengths; cylinder and capsule (radius, length), axis z, a capsule's length without
            its caps; sphere (radius,); mesh (x, y, z) scale [m].
        T_body_solid: (4, 4), its centre. body: what carries it; MAP for what never moves.
        light: opaque, glass (answers with p_return, else is looked through), mirror (shows what stands before it), or none
            (a LiDAR never meets it).
        look: name of a family of surfaces ("tiles", "plaster"); "" for that of its class.
        mesh: file, of a mesh.
    """

    instance: str
    class_name: str
    kind: Kind
    size: tuple[float, ...]
    T_body_solid: Float64Array
    body: str = MAP
    light: Light = "opaque"
    p_return: float = 1.0
    look: str = ""
    mesh: Path | None = None


@dataclass(frozen=True, eq=False)
class Body:
    """A frame that can move: a door's leaf, a person's shin, a cart, a calibration board.

    Attributes:
        T_parent_body: (4, 4) at joint state 0.
        motion: revolute or prismatic along `axis` (3,) in the body's own frame; "free" bodies are placed as a whole.
        limits: lowest and highest state [rad or m]. rest: where it is when nobody says otherwise.
        follows: (body, factor, offset) of one that moves with another, like the second leaf of a double door.
    """

    name: str
    motion: Literal["revolute", "prismatic", "free"] = "free"
    parent: str = MAP
    T_parent_body: Float64Array = field(default_factory=lambda: np.eye(4))
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    limits: tuple[float, float] = (-math.inf, math.inf)
    rest: float = 0.0
    follows: tuple[str, float, float] | None = None


@dataclass(frozen=True)
class Room:
    """A named piece of floor: corners (C, 2) [m] anticlockwise."""

    id: str
    kind: str
    floor: tuple[tuple[float, float], ...]


@dataclass(frozen=True, eq=False)
class World:
    """Everything that stands in a place.

    Attributes:
        solids, bodies: bodies before those that hang on them.
        rooms: the floor by room. height_m: of the ceiling above the floor at z = 0.
        source: the map's file, for messages.
    """

    name: str
    solids: tuple[Solid, ...]
    bodies: tuple[Body, ...] = ()
    rooms: tuple[Room, ...] = ()
    height_m: float = 2.7
    source: str = ""

    @cached_property
    def body(self) -> dict[str, Body]:
        """Bodies by name."""
        return {body.name: body for body in self.bodies}

    @property
    def class_names(self) -> tuple[str, ...]:
        """Every class in the world, sorted: the ids of oracle labels are their places in this list."""
        return tuple(sorted({solid.class_name for solid in self.solids}))

    @property
    def extent(self) -> Float64Array:
        """(2, 2) lowest and highest x, y of the centres of what stands fast; of the rooms where there are any."""
        points = [corner for room in self.rooms for corner in room.floor]
        points = points or [tuple(solid.T_body_solid[:2, 3]) for solid in self.solids if solid.body == MAP]
        found = np.array(points, dtype=np.float64).reshape(-1, 2)
        return np.array([found.min(axis=0), found.max(axis=0)])

    def poses(self, states: Mapping[str, float] | None = None) -> dict[str, Float64Array]:
        """T_map_body (4, 4) of every jointed body at given states [rad or m]; those not named are at rest.

        Raises:
            SimulationError: no such body, or one that takes no state.
        """
        given = dict(states or {})
        jointed = {body.name: body for body in self.bodies if body.motion != "free"}
        for name in given:
            if name not in jointed or jointed[name].follows:
                takers = [body.name for body in jointed.values() if not body.follows]
                hint = closest(name, takers) if takers else "nothing in this map moves"
                raise SimulationError(f"nothing that moves is called '{name}'", where=self.source, hint=hint)
        placed = {MAP: np.eye(4)}
        for body in jointed.values():
            state = given.get(body.name, body.rest)
            if body.follows:
                leader, factor, offset = body.follows
                state = factor * given.get(leader, jointed[leader].rest) + offset
            placed[body.name] = placed[body.parent] @ body.T_parent_body @ motion(body, state)
        del placed[MAP]
        return placed


def motion(body: Body, state: float) -> Float64Array:
    """(4, 4) motion of a body by its joint state, in its own frame."""
    from scipy.spatial.transform import Rotation

    T = np.eye(4)
    axis = np.asarray(body.axis, dtype=np.float64)
    if body.motion == "prismatic":
        T[:3, 3] = axis * state
    elif body.motion == "revolute":
        T[:3, :3] = Rotation.from_rotvec(axis * state).as_matrix()
    return T


def upright(x: float, y: float, yaw_rad: float, z: float = 0.0) -> Float64Array:
    """(4, 4) of something that stands at a place, turned about the vertical."""
    c, s = math.cos(yaw_rad), math.sin(yaw_rad)
    return np.array([[c, -s, 0, x], [s, c, 0, y], [0, 0, 1, z], [0, 0, 0, 1]], dtype=np.float64)
