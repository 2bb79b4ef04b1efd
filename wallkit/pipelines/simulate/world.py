"""A semantic map -> the world the simulator builds: solids with class and behaviour to light, doors that can move."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from wallkit.errors import MapError
from wallkit.simulate.world import MAP, Body, Room, Solid, World

if TYPE_CHECKING:
    from wallkit.core.types import Float64Array
    from wallkit.maps.model import SemanticMap
    from wallkit.maps.nouns import Joint, Shape

_DEFAULT_HEIGHT_M = 2.7


def world_from_map(semantic_map: SemanticMap) -> World:
    """Everything solid in a map, each link an instance of its class, each movable joint a body.

    Raises:
        MapError: a link has no class or an unknown one, or a mesh is not on disk.
    """
    bodies = _bodies(semantic_map)
    carried_by = _carriers(semantic_map, {body.name for body in bodies})
    zero = {name: 0.0 for name, joint in semantic_map.joints.items() if joint.is_movable and joint.mimic is None}
    T_map_link = semantic_map.poses(zero)
    solids = []
    for link in semantic_map.links.values():
        if link.name not in T_map_link:
            continue
        info = semantic_map.class_of(link.name)
        if link.shapes and info is None:
            said = f"the unknown class '{link.class_name}'" if link.class_name else "no class"
            hint = "wallkit map validate says what else is wrong; wallkit map adopt writes classes"
            raise MapError(f"link '{link.name}' has {said}", where=semantic_map.source, hint=hint)
        body = carried_by[link.name]
        T_map_body = T_map_link[semantic_map.joints[body].child] if body else np.eye(4)
        for shape in link.shapes:
            assert info is not None
            T_body_solid = np.linalg.inv(T_map_body) @ T_map_link[link.name] @ shape.T_link_shape
            solids.append(
                Solid(
                    link.name,
                    info.name,
                    shape.kind,
                    tuple(float(v) for v in shape.size),
                    T_body_solid,
                    body=body,
                    light="glass" if info.lidar == "perforated" else info.lidar,
                    p_return=1.0 if info.p_return is None else info.p_return,
                    mesh=_mesh_of(semantic_map, shape),
                )
            )
    rooms = tuple(
        Room(room.id, room.kind, tuple(map(tuple, room.floor.tolist())))
        for room in semantic_map.rooms.values()
        if room.floor is not None
    )
    return World(semantic_map.name, tuple(solids), bodies, rooms, _height(solids, T_map_link), semantic_map.source)


def _bodies(semantic_map: SemanticMap) -> tuple[Body, ...]:
    """A body for every movable joint, parents first, with everything fixed between two of them taken together."""
    zero = {name: 0.0 for name, joint in semantic_map.joints.items() if joint.is_movable and joint.mimic is None}
    T_map_link = semantic_map.poses(zero)
    found: dict[str, Body] = {}
    waiting = [(semantic_map.root or "", MAP)]
    while waiting:
        link, carrier = waiting.pop()
        for joint in semantic_map.children_of(link):
            if joint.child not in T_map_link:
                continue
            below = carrier
            if joint.is_movable:
                parent = T_map_link[semantic_map.joints[carrier].child] if carrier else np.eye(4)
                found[joint.name] = _body(joint, carrier, np.linalg.inv(parent) @ T_map_link[joint.child])
                below = joint.name
            waiting.append((joint.child, below))
    return tuple(found.values())


def _body(joint: Joint, carrier: str, T_parent_body: Float64Array) -> Body:
    lower, upper = joint.travel
    follows = (joint.mimic.joint, joint.mimic.multiplier, joint.mimic.offset) if joint.mimic else None
    axis = tuple((joint.axis / np.linalg.norm(joint.axis)).tolist())
    motion = "prismatic" if joint.kind == "prismatic" else "revolute"
    return Body(joint.name, motion, carrier, T_parent_body, axis, (lower, upper), joint.rest, follows)  # type: ignore[arg-type]


def _carriers(semantic_map: SemanticMap, movable: set[str]) -> dict[str, str]:
    """The body that each link belongs to: the nearest movable joint above it."""
    found = {semantic_map.root or "": MAP}
    waiting = [semantic_map.root or ""]
    while waiting:
        link = waiting.pop()
        for joint in semantic_map.children_of(link):
            if joint.child not in found:
                found[joint.child] = joint.name if joint.name in movable else found[link]
                waiting.append(joint.child)
    return found


def _mesh_of(semantic_map: SemanticMap, shape: Shape):  # type: ignore[no-untyped-def]
    if shape.mesh is None:
        return None
    if not shape.mesh.is_on_disk():
        why = shape.mesh.problem or "no such file"
        raise MapError(
            f"mesh '{shape.mesh.filename}' cannot be used: {why}",
            where=semantic_map.source,
            hint="put it beside the map, or replace it by boxes",
        )
    return shape.mesh.path


def _height(solids: list[Solid], T_map_link: dict[str, Float64Array]) -> float:
    """The ceiling lies on the highest wall."""
    tops = [
        float(solid.T_body_solid[2, 3] + solid.size[2] / 2)
        for solid in solids
        if solid.class_name == "wall" and solid.kind == "box" and solid.body == MAP
    ]
    return max(tops, default=_DEFAULT_HEIGHT_M)
