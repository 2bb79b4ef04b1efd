"""What a semantic map is made of: shapes, links with openings, joints with door states, rooms, the header.

Conventions of the format (metres, radians, z up; T_ab maps coordinates in b to a):

* a wall's frame sits at the start of its axis on the floor: +x along the wall, y = 0 its centre plane, +z up;
* a fixture's frame sits at its mounting point, +x points into the room;
* a door is a movable joint on its wall; at joint state 0 the leaf stands as it was drawn, closed.

Numbers that could not be read are NaN here (whole matrix, vector or size), never a plausible default; the schema rules say
why, and stop the geometry rules. Every noun keeps the `element` it came from.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from wallkit.core.types import Float64Array
from wallkit.maps.document import Element

ShapeKind = Literal["box", "cylinder", "sphere", "mesh"]
MOVABLE_TYPES = ("revolute", "continuous", "prismatic")
QUARTER_TURN_RAD = math.pi / 2


@dataclass(frozen=True, slots=True)
class MeshFile:
    """A mesh as the map names it.

    Attributes:
        filename: as written.
        path: the file in or below the map's folder; None when the name leads elsewhere.
        problem: why there is no path ("package:// ...", "absolute path", "URL", "leaves the map's folder"), else "".
    """

    filename: str
    path: Path | None
    problem: str = ""

    def is_on_disk(self) -> bool:
        """Whether the file is there now."""
        return self.path is not None and self.path.is_file()


@dataclass(frozen=True, slots=True)
class Shape:
    """One collision shape of a link.

    Attributes:
        size: box (x, y, z) full lengths; cylinder (radius, length), axis z; sphere (radius,); mesh (x, y, z) scale.
            NaN where it could not be read.
        T_link_shape: (4, 4), the shape's centre in the link's frame.
        name: of the collision element, or "".
        element: the <collision>. geometry: the <box>, <cylinder>, <sphere> or <mesh>.
    """

    kind: ShapeKind
    size: Float64Array
    T_link_shape: Float64Array
    name: str
    element: Element
    geometry: Element
    mesh: MeshFile | None = None


@dataclass(frozen=True, slots=True)
class Opening:
    """A hole declared in a wall.

    Attributes:
        along_m: (x0, x1) in the wall's frame. z_m: (z0, z1). NaN where unreadable.
        fill: name of the link that fills it, or "".
    """

    id: str
    kind: str
    along_m: tuple[float, float]
    z_m: tuple[float, float]
    fill: str
    swing: str
    element: Element


@dataclass(frozen=True, slots=True)
class Link:
    """A wall, door leaf, fixture, or just a frame.

    Attributes:
        class_name: from <wk:object>, else inferred from the name; "" when neither tells.
        class_is_inferred: the file does not say the class itself.
        connects, separates: ids of rooms.
        semantics: the <wk:object>, or None.
    """

    name: str
    class_name: str
    class_is_inferred: bool
    shapes: tuple[Shape, ...]
    openings: tuple[Opening, ...]
    element: Element
    connects: tuple[str, ...] = ()
    separates: tuple[str, ...] = ()
    room: str = ""
    sigma_m: float | None = None
    source: str = ""
    note: str = ""
    semantics: Element | None = None


@dataclass(frozen=True, slots=True)
class DoorState:
    """What is believed about a joint.

    Attributes:
        rest: joint state the map is drawn at; None when the file does not say.
        prior: probability by state name ("closed", "open", "unknown", ...), as written; None when unreadable.
        prior_text: as written.
        tolerance: how far a state may be off and still count, in the joint's unit.
    """

    rest: float | None
    prior: Mapping[str, float] | None
    prior_text: str
    tolerance: float | None
    element: Element


@dataclass(frozen=True, slots=True)
class Mimic:
    """q = multiplier * q(joint) + offset."""

    joint: str
    multiplier: float
    offset: float
    element: Element


@dataclass(frozen=True, slots=True)
class Joint:
    """How a child link hangs on its parent; joint states are radians, or metres for prismatic ones.

    Attributes:
        kind: the URDF type as written.
        T_parent_child: (4, 4) at joint state 0.
        axis: (3,) in the child's frame, as written (URDF's default is 1 0 0).
        lower, upper: travel; None where the file gives none or none that can be read.
    """

    name: str
    kind: str
    parent: str
    child: str
    T_parent_child: Float64Array
    axis: Float64Array
    element: Element
    lower: float | None = None
    upper: float | None = None
    effort: float | None = None
    velocity: float | None = None
    mimic: Mimic | None = None
    state: DoorState | None = None

    @property
    def is_movable(self) -> bool:
        """Whether a joint state moves the child."""
        return self.kind in MOVABLE_TYPES

    @property
    def travel(self) -> tuple[float, float]:
        """(lowest, highest) state; unlimited for continuous joints, (0, 0) for fixed ones and missing limits."""
        if self.kind == "continuous":
            return -math.inf, math.inf
        return (self.lower or 0.0, self.upper or 0.0) if self.is_movable else (0.0, 0.0)

    @property
    def rest(self) -> float:
        """The state the map is drawn at: what <wk:state rest> says, else 0."""
        return self.state.rest if self.state is not None and self.state.rest is not None else 0.0

    @property
    def closed(self) -> float:
        """The state in which a door is shut: 0, or what is nearest to it within the travel."""
        low, high = self.travel
        return min(max(0.0, low), high) if low <= high else 0.0

    @property
    def open(self) -> float:
        """The end of the travel farthest from closed; a quarter turn for a continuous joint."""
        if self.kind == "continuous":
            return QUARTER_TURN_RAD
        return max(self.travel, key=lambda state: abs(state - self.closed))

    def motion(self, state: float) -> Float64Array:
        """T_child0_child (4, 4): how the child moves at a joint state; NaN about a zero axis, identity for fixed joints."""
        T = np.eye(4)
        if not self.is_movable or state == 0.0:
            return T
        length = float(np.linalg.norm(self.axis))
        unit = self.axis / length if length > 0 else np.full(3, np.nan)
        if self.kind == "prismatic":
            T[:3, 3] = unit * state
        else:
            T[:3, :3] = _rotation_about(unit, state)
        return T


@dataclass(frozen=True, slots=True)
class Room:
    """A named part of the floor: floor (V, 2) corners in the map frame, without repeating the first; None if unreadable."""

    id: str
    kind: str
    floor: Float64Array | None
    element: Element


@dataclass(frozen=True, slots=True)
class Survey:
    """<wk:origin>: where the map's origin lies in the world, as written."""

    kind: str
    epsg: int | None
    east_m: float | None
    north_m: float | None
    yaw_rad: float | None
    element: Element


@dataclass(frozen=True, slots=True)
class Header:
    """<wk:map> and <wk:check>; without a header in the file every field is empty and element None."""

    format: str = ""
    units: str = ""
    level: str = ""
    elevation_m: float | None = None
    scan_plane_m: float | None = None
    taxonomy: str = ""
    created: str = ""
    source: str = ""
    sigma_m: float | None = None
    max_range_m: float | None = None
    robot_radius_m: float | None = None
    labels: str = ""
    survey: Survey | None = None
    element: Element | None = None


def _rotation_about(axis: Float64Array, angle_rad: float) -> Float64Array:
    """Rotation (3, 3) about a unit axis (Rodrigues' formula)."""
    x, y, z = axis.tolist()
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    k = 1.0 - c
    return np.array(
        [
            [c + x * x * k, x * y * k - z * s, x * z * k + y * s],
            [y * x * k + z * s, c + y * y * k, y * z * k - x * s],
            [z * x * k - y * s, z * y * k + x * s, c + z * z * k],
        ]
    )
