"""A semantic map -> one static model of SDFormat 1.9 for Gazebo: links, joints, collisions, visuals, materials by class.

Every link's pose is written in the model's frame, with the doors where they are asked to stand; joints sit in the frame of
their child and count from there, so limits shift by the state. What SDFormat has no word for stays as elements of wallkit's
namespace, which it allows (http://sdformat.org/tutorials?tut=custom_elements_attributes_proposal).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from wallkit.core.types import Float64Array
from wallkit.maps.classes import ClassInfo
from wallkit.maps.document import WK_NAMESPACE
from wallkit.maps.exporters.colors import rgba_of
from wallkit.maps.exporters.exported import Exported, ExportOptions, Notes, doors_of, lose_meaning
from wallkit.maps.importers.imported import Names
from wallkit.maps.model import SemanticMap
from wallkit.maps.nouns import Joint, Link, Shape
from wallkit.maps.numbers import text_from_number

JOINT_TYPES = ("fixed", "revolute", "continuous", "prismatic")


def export_sdf(semantic_map: SemanticMap, out: Path, options: ExportOptions) -> Exported:
    """One .sdf file; doors stand at rest unless told otherwise.

    Raises:
        MapError: doors as probabilities.
    """
    notes = Notes(semantic_map.source, "SDFormat 1.9")
    doors = doors_of(semantic_map, options)
    states = semantic_map.door_states(doors)
    poses = semantic_map.poses(states)
    names = _sibling_names(semantic_map)
    writer = _Writer(semantic_map, names, poses, states)
    joints = [joint for joint in semantic_map.joints.values() if joint.kind in JOINT_TYPES and joint.child in poses]
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<sdf version="1.9" xmlns:wk="{WK_NAMESPACE}">',
        f"  <model{_attributes(name=_valid(semantic_map.name or 'map'))}>",
        "    <static>true</static>",
        *(line for name in poses for line in writer.link(semantic_map.links[name])),
        *(line for joint in joints for line in writer.joint(joint)),
        "  </model>",
        "</sdf>",
    ]
    shapes = [shape for name in poses for shape in semantic_map.links[name].shapes]
    notes.wrote(f"{len(poses)} links, {len(joints)} joints, {len(shapes)} collisions and visuals; doors: {doors}")
    if semantic_map.doors:
        notes.taken("the model is static, so doors stay as they are: <static>false</static> lets them move")
    renamed = [written for key, written in names.items() if written != key.partition(":")[2]]
    if renamed:
        notes.taken(f"{len(renamed)} names are changed: in a model no two links or joints share one", names=renamed)
    bare = len(semantic_map.links) - len(poses)
    notes.lose("link that hangs on nothing", bare, many="links that hang on nothing")
    notes.lose("floating or planar joint", len(semantic_map.joints) - len(joints))
    notes.lose("mimic", sum(joint.mimic is not None for joint in joints))
    lost = sum(bool(shape.mesh and not shape.mesh.is_on_disk()) for shape in shapes)
    notes.lose("mesh that is not there", lost, many="meshes that are not there")
    lose_meaning(notes, semantic_map, but={"class"})
    return Exported({out: ("\n".join(lines) + "\n").encode()}, notes.all())


@dataclass(frozen=True)
class _Writer:
    """Writes the elements of one model.

    Attributes:
        names: what links ("link:NAME") and joints ("joint:NAME") are called. poses: T_map_link. states: of the joints.
    """

    semantic_map: SemanticMap
    names: Mapping[str, str]
    poses: Mapping[str, Float64Array]
    states: Mapping[str, float]

    def link(self, link: Link) -> Iterator[str]:
        info = self.semantic_map.classes.get(link.class_name)
        yield f"    <link{_attributes(name=self.names[f'link:{link.name}'])}>"
        yield f"      {_pose(self.poses[link.name], relative_to='__model__')}"
        if link.class_name:
            yield f"      <wk:object{_attributes(**{'class': link.class_name})}/>"
        taken = Names()
        for number, shape in enumerate(link.shapes, start=1):
            name = taken.take(shape.name or f"{link.name}.{number}")
            geometry = f"{_pose(shape.T_link_shape)}<geometry>{_geometry(shape)}</geometry>"
            yield f"      <collision{_attributes(name=name)}>{geometry}</collision>"
            yield f"      <visual{_attributes(name=f'{name}.visual')}>{geometry}{_material(info, link.class_name)}</visual>"
        yield "    </link>"

    def joint(self, joint: Joint) -> Iterator[str]:
        yield f"    <joint{_attributes(name=self.names[f'joint:{joint.name}'], type=joint.kind)}>"
        yield f"      <parent>{_text(self.names[f'link:{joint.parent}'])}</parent>"
        yield f"      <child>{_text(self.names[f'link:{joint.child}'])}</child>"
        if joint.is_movable:
            yield f"      <axis>{self._axis(joint)}</axis>"
        yield "    </joint>"

    def _axis(self, joint: Joint) -> str:
        unit = joint.axis / np.linalg.norm(joint.axis)
        xyz = f"<xyz>{_numbers(unit)}</xyz>"
        if joint.kind == "continuous":
            return xyz
        state = self.semantic_map.joint_state(joint.name, self.states)
        lower, upper = (text_from_number(limit - state) for limit in joint.travel)
        rest = {"effort": joint.effort, "velocity": joint.velocity}
        more = "".join(f"<{tag}>{text_from_number(value)}</{tag}>" for tag, value in rest.items() if value is not None)
        return f"{xyz}<limit><lower>{lower}</lower><upper>{upper}</upper>{more}</limit>"


def rpy_from_rotation(R: Float64Array) -> tuple[float, float, float]:
    """Roll, pitch, yaw of R = Rz(yaw) Ry(pitch) Rx(roll); at pitch +-90 degrees all of the turn is yaw."""
    across = math.hypot(R[2, 1], R[2, 2])
    pitch = math.atan2(-R[2, 0], across)
    if across < 1e-9:
        return 0.0, pitch, math.atan2(-R[0, 1], R[1, 1])
    return math.atan2(R[2, 1], R[2, 2]), pitch, math.atan2(R[1, 0], R[0, 0])


# -------------------------------------------------------------------------------------------- details


def _sibling_names(semantic_map: SemanticMap) -> dict[str, str]:
    """Unique names over links and joints together, as SDFormat wants siblings; links keep theirs."""
    found: dict[str, str] = {}
    used: set[str] = set()
    for kind, names in (("link", semantic_map.links), ("joint", semantic_map.joints)):
        for name in names:
            written, number = _valid(name), 1
            while written in used:
                number += 1
                written = f"{_valid(name)}_{kind if number == 2 else f'{kind}{number}'}"
            used.add(written)
            found[f"{kind}:{name}"] = written
    return found


def _valid(name: str) -> str:
    """A name that SDFormat does not keep for itself: `world`, `__names__`, and `::` for nesting."""
    name = name.replace("::", "_")
    is_reserved = name in ("world", "") or (name.startswith("__") and name.endswith("__"))
    return f"wk_{name.strip('_')}" if is_reserved else name


def _geometry(shape: Shape) -> str:
    size = [text_from_number(float(value)) for value in shape.size]
    if shape.kind == "box":
        return f"<box><size>{' '.join(size)}</size></box>"
    if shape.kind == "cylinder":
        return f"<cylinder><radius>{size[0]}</radius><length>{size[1]}</length></cylinder>"
    if shape.kind == "sphere":
        return f"<sphere><radius>{size[0]}</radius></sphere>"
    filename = shape.mesh.filename if shape.mesh else ""
    return f"<mesh><uri>{_text(filename)}</uri><scale>{' '.join(size)}</scale></mesh>"


def _material(info: ClassInfo | None, class_name: str) -> str:
    red, green, blue, opacity = rgba_of(info, class_name)
    rgba = _numbers(np.round([red, green, blue, 1.0], 3))
    transparency = f"<transparency>{text_from_number(1 - opacity, 3)}</transparency>" if opacity < 1 else ""
    return f"<material><ambient>{rgba}</ambient><diffuse>{rgba}</diffuse></material>{transparency}"


def _pose(T: Float64Array, *, relative_to: str = "") -> str:
    where = _attributes(relative_to=relative_to) if relative_to else ""
    return f"<pose{where}>{_numbers([*T[:3, 3], *rpy_from_rotation(T[:3, :3])])}</pose>"


def _numbers(values: object) -> str:
    # a rounding error beside zero is zero
    cleaned = [0.0 if abs(value) < 1e-12 else float(value) for value in np.asarray(values).tolist()]
    return " ".join(text_from_number(value, 12) for value in cleaned)


def _attributes(**values: str) -> str:
    return "".join(f" {name}={quoteattr(value)}" for name, value in values.items())


def _text(text: str) -> str:
    return text.replace("&", "&amp;").replace("<", "&lt;")
