"""A world -> a compiled MuJoCo scene that can be posed and asked what a ray meets; nothing here needs GL.

The map's own XML never reaches MuJoCo, which would fuse links and lose their names: every solid becomes a geom whose number
leads back to it. Nothing is simulated by forces; bodies are placed, and only kinematics is computed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from wallkit.core.geometry import quaternions_from_matrices
from wallkit.core.types import Float64Array, Int64Array
from wallkit.errors import SimulationError
from wallkit.simulate.world import MAP, Light, Solid, World

if TYPE_CHECKING:
    import mujoco

# geom groups, which a ray can look through one by one
GROUPS: Mapping[Light, int] = {"opaque": 0, "glass": 1, "mirror": 2, "none": 3}
_RAYS_SEE: tuple[Light, ...] = ("opaque", "glass", "mirror")
NOTHING = -1


@dataclass(frozen=True, eq=False)
class Hits:
    """What rays meet first.

    Attributes:
        ranges_m: (K,) distance, inf where nothing is met. solids: (K,) index into the world's solids, NOTHING for none.
        normals: (K, 3) unit normal of the surface on the ray's side; NaN for none.
    """

    ranges_m: Float64Array
    solids: Int64Array
    normals: Float64Array


class Scene:
    """A world that can be posed and looked at; `place` moves what can move, everything else answers for that moment.

    Raises:
        SimulationError: MuJoCo is not installed, or it does not take the world (with its message).
    """

    def __init__(self, world: World, *, spec: mujoco.MjSpec | None = None) -> None:
        mujoco = mujoco_module()
        self.world = world
        self.model = compiled(spec or spec_from_world(world), world)
        self.data = mujoco.MjData(self.model)
        self._mocap = {body.name: int(self.model.body(body.name).mocapid[0]) for body in world.bodies}
        self.solid_of_geom = np.full(self.model.ngeom, NOTHING, dtype=np.int64)
        for number in range(len(world.solids)):
            self.solid_of_geom[self.model.geom(_geom_name(number)).id] = number
        self.place(world.poses())

    def place(self, poses: Mapping[str, Float64Array]) -> None:
        """Puts bodies (by name, T_map_body (4, 4)) where they are at one moment; the others stay.

        Raises:
            KeyError: no such body.
        """
        pose_mocap(self.model, self.data, self._mocap, poses)

    def cast(
        self,
        origin: Float64Array,
        directions: Float64Array,
        *,
        unseen: tuple[Light, ...] = (),
        is_camera: bool = False,
    ) -> Hits:
        """What rays from one point (3,) along unit directions (K, 3) meet first, solids of some kinds left out.

        A camera also sees what no LiDAR meets.
        """
        mujoco = mujoco_module()
        count = len(directions)
        geoms, ranges = np.full(count, NOTHING, dtype=np.int32), np.zeros(count)
        normals = np.zeros(3 * count)
        groups = np.zeros(6, dtype=np.uint8)
        groups[[GROUPS[light] for light in (GROUPS if is_camera else _RAYS_SEE) if light not in unseen]] = 1
        rays = np.ascontiguousarray(directions, dtype=np.float64).ravel()
        cutoff = 1e6
        mujoco.mj_multiRay(
            *(self.model, self.data, np.asarray(origin, dtype=np.float64), rays, groups, 1, -1),
            *(geoms, ranges, normals, count, cutoff),
        )
        missed = (geoms == NOTHING) | (ranges < 0)
        solids = np.where(missed, NOTHING, self.solid_of_geom[geoms])
        normals = np.where(missed[:, None], np.nan, normals.reshape(-1, 3))
        # towards the ray, so that a cosine of incidence is never negative
        facing = np.sum(normals * directions, axis=1) > 0
        normals[facing] *= -1
        return Hits(np.where(missed, np.inf, ranges), solids, normals)

    # --------------------------------------------------------------------------------------- what a solid is

    @cached_property
    def class_ids(self) -> Int64Array:
        """(S,) of every solid, the place of its class in `world.class_names`."""
        places = {name: number for number, name in enumerate(self.world.class_names)}
        return np.array([places[solid.class_name] for solid in self.world.solids], dtype=np.int64)

    @cached_property
    def lights(self) -> np.ndarray:
        """(S + 1,) how each solid behaves to light; the last one stands for NOTHING."""
        return np.array([*(solid.light for solid in self.world.solids), "none"])

    @cached_property
    def p_return(self) -> Float64Array:
        """(S + 1,) probability that each solid answers a beam; the last one stands for NOTHING."""
        return np.array([*(solid.p_return for solid in self.world.solids), 1.0])

    @cached_property
    def instance_names(self) -> tuple[str, ...]:
        """Every thing in the world, in order of appearance."""
        return tuple(dict.fromkeys(solid.instance for solid in self.world.solids))

    @cached_property
    def instance_ids(self) -> Int64Array:
        """(S,) of every solid, the place of its thing in `instance_names`."""
        places = {name: number for number, name in enumerate(self.instance_names)}
        return np.array([places[solid.instance] for solid in self.world.solids], dtype=np.int64)

    def labels(self, solids: Int64Array, of: Int64Array) -> Int64Array:
        """Ids (K,) of hit solids (K,) by a table (S,); NOTHING where nothing was hit."""
        return np.where(solids == NOTHING, NOTHING, of[solids])


def spec_from_world(world: World) -> mujoco.MjSpec:
    """The world as an MjSpec that can still be added to: flat colours, no lights."""
    mujoco = mujoco_module()
    spec = mujoco.MjSpec()
    spec.modelname = world.name or "world"
    spec.option.gravity = (0.0, 0.0, 0.0)
    carriers = {MAP: spec.worldbody}
    for body in world.bodies:
        carriers[body.name] = spec.worldbody.add_body(name=body.name, mocap=True)
    for number, solid in enumerate(world.solids):
        add_primitive(spec, carriers[solid.body], solid, name=_geom_name(number), group=GROUPS[solid.light])
    return spec


def compiled(spec: mujoco.MjSpec, world: World) -> mujoco.MjModel:
    """The model of a spec.

    Raises:
        SimulationError: MuJoCo does not take it, with its message.
    """
    try:
        return spec.compile()
    except ValueError as error:
        raise SimulationError(
            f"MuJoCo does not take this world: {error}", where=world.source, hint="see the named shape in the map"
        ) from error


def pose_mocap(
    model: mujoco.MjModel, data: mujoco.MjData, mocap: Mapping[str, int], poses: Mapping[str, Float64Array]
) -> None:
    """Puts bodies (by name, T_map_body (4, 4)) where they are; `mocap` has the rows of the bodies."""
    if poses:
        rows = [mocap[name] for name in poses]
        matrices = np.stack(list(poses.values()))
        data.mocap_pos[rows] = matrices[:, :3, 3]
        # MuJoCo has w first
        data.mocap_quat[rows] = np.roll(quaternions_from_matrices(matrices), 1, axis=1)
    mujoco_module().mj_kinematics(model, data)


def mujoco_module() -> Any:
    """The mujoco package.

    Raises:
        SimulationError: it is not installed.
    """
    try:
        import mujoco
    except ImportError as error:
        raise SimulationError(
            "the simulator needs MuJoCo, which is not installed", hint="pip install 'wallkit[sim]'"
        ) from error
    return mujoco


# -------------------------------------------------------------------------------------------- details


def _geom_name(number: int) -> str:
    return f"solid{number}"


def add_primitive(spec: mujoco.MjSpec, body: Any, solid: Solid, **more: Any) -> None:
    """A solid as a geom of its body that nothing collides with."""
    mujoco = mujoco_module()
    types = mujoco.mjtGeom
    position, quaternion = _place(solid.T_body_solid)
    common = {"pos": position, "quat": quaternion, "contype": 0, "conaffinity": 0, **more}
    if solid.kind == "mesh":
        name = f"mesh of {more['name']}"
        spec.add_mesh(
            name=name,
            file=str(solid.mesh),
            scale=list(solid.size),
            inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
        )
        body.add_geom(type=types.mjGEOM_MESH, meshname=name, **common)
        return
    size = {
        "box": lambda s: [s[0] / 2, s[1] / 2, s[2] / 2],
        "cylinder": lambda s: [s[0], s[1] / 2, 0.0],
        "capsule": lambda s: [s[0], s[1] / 2, 0.0],
        "sphere": lambda s: [s[0], 0.0, 0.0],
    }[solid.kind](solid.size)
    body.add_geom(type=getattr(types, f"mjGEOM_{solid.kind.upper()}"), size=size, **common)


def _place(T: Float64Array) -> tuple[list[float], list[float]]:
    """Position and quaternion (w first) of a transform."""
    return T[:3, 3].tolist(), np.roll(quaternions_from_matrices(T[None])[0], 1).tolist()
