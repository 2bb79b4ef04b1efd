"""Mesh files -> how large they are, and the solids that stand in the place of a map's boxes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product
from pathlib import Path
from typing import Literal

import numpy as np

from wallkit.core.config import setting
from wallkit.core.types import Float64Array
from wallkit.errors import SimulationError
from wallkit.simulate.scene import mujoco_module
from wallkit.simulate.world import Solid

Axis = Literal["x", "-x", "y", "-y", "z", "-z"]
# thinner than this there is nothing to stretch
_FLAT_M = 1e-6
_SIGNS = np.array(list(product((-1, 1), repeat=3)), dtype=np.float64)


@dataclass(frozen=True)
class MeshFor:
    """What is a box in the map looks, to rays and cameras, like a mesh that is stretched to that box."""

    of: str = setting("", "what it stands for: a class, or one thing by its link in the map")
    file: str = setting("", "OBJ or binary STL, relative to the scenario's file")
    up: Axis = setting("z", "which of the file's axes points up; in most files made for pictures y")
    front: Axis = setting("x", "and which one to where the thing looks, from the wall into the room")


def fitted(mesh: MeshFor, parts: Sequence[Solid]) -> Solid:
    """One mesh in the place of all parts of a thing, as large as the box around them in the first one's axes.

    Raises:
        SimulationError: see bounds_of, axes_of.
    """
    first = parts[0]
    T_first_body = np.linalg.inv(first.T_body_solid)
    corners = np.concatenate([(T_first_body @ part.T_body_solid @ corners_of(part).T).T[:, :3] for part in parts])
    low, high = corners.min(axis=0), corners.max(axis=0)
    R = axes_of(mesh)
    bounds = bounds_of(Path(mesh.file))
    scale = np.abs(R.T) @ (high - low) / (bounds[1] - bounds[0])
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, (low + high) / 2 - R @ (scale * bounds.mean(axis=0))
    size = tuple(float(v) for v in scale)
    return replace(first, kind="mesh", size=size, T_body_solid=first.T_body_solid @ T, mesh=Path(mesh.file))


def axes_of(mesh: MeshFor) -> Float64Array:
    """(3, 3) rotation from the file's axes to those of a map's thing: x forward, y left, z up.

    Raises:
        SimulationError: up and front are the same axis.
    """
    forward, up = _unit(mesh.front), _unit(mesh.up)
    if forward @ up:
        raise SimulationError(
            f"up is '{mesh.up}' and front is '{mesh.front}'", where=mesh.file, hint="name two different axes"
        )
    return np.stack([forward, np.cross(up, forward), up])


@lru_cache(maxsize=256)
def bounds_of(path: Path) -> Float64Array:
    """(2, 3) lowest and highest corner of a mesh, in the file's own axes and unit.

    Raises:
        SimulationError: there is no such file, MuJoCo cannot read it, or it is flat.
    """
    mujoco = mujoco_module()
    if not path.is_file():
        raise SimulationError("no such file", where=path, hint="give the path of an OBJ or STL")
    spec = mujoco.MjSpec()
    spec.add_mesh(name="mesh", file=str(path.absolute()), inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL)
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="mesh", contype=0, conaffinity=0)
    try:
        model = spec.compile()
    except ValueError as error:
        why = " ".join(str(error).removeprefix("Error: ").split())
        raise SimulationError(f"no mesh that can be used: {why}", where=path, hint="export it again as OBJ") from error
    # MuJoCo turns a mesh to its axes of inertia, and says how
    R = np.zeros(9)
    mujoco.mju_quat2Mat(R, model.mesh_quat[0])
    vertices = model.mesh_vert.astype(np.float64) @ R.reshape(3, 3).T + model.mesh_pos[0]
    bounds = np.stack([vertices.min(axis=0), vertices.max(axis=0)])
    if np.ptp(bounds, axis=0).min() < _FLAT_M:
        raise SimulationError("the mesh is flat", where=path, hint="give it some depth")
    return bounds


def corners_of(solid: Solid) -> Float64Array:
    """(8, 4) homogeneous corners of the box around a solid, in its own frame.

    Raises:
        SimulationError: see bounds_of.
    """
    low, high = -_half(solid), _half(solid)
    if solid.kind == "mesh":
        assert solid.mesh is not None
        low, high = bounds_of(solid.mesh) * solid.size
    return np.column_stack([np.where(_SIGNS < 0, low, high), np.ones(8)])


def _half(solid: Solid) -> Float64Array:
    if solid.kind in ("box", "mesh"):
        return np.array(solid.size) / 2
    if solid.kind == "sphere":
        return np.full(3, solid.size[0])
    radius, length = solid.size
    return np.array([radius, radius, length / 2 + (radius if solid.kind == "capsule" else 0.0)])


def _unit(axis: Axis) -> Float64Array:
    unit = np.zeros(3)
    unit["xyz".index(axis[-1])] = -1.0 if axis.startswith("-") else 1.0
    return unit
