"""Something that stands where the map has nothing -> the lines of URDF that put it there."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from wallkit.maps.audit.nouns import Cluster
from wallkit.maps.numbers import text_from_number

# a planar LiDAR does not see how high things are: what is usual [m]
HEIGHTS_M: Mapping[str, float] = {"wall": 2.5, "column": 2.5, "toilet": 0.8, "sink": 0.9, "furniture": 1.0}
_LEAST_M = 0.02


def unused_name(class_name: str, taken: Collection[str]) -> str:
    """furniture_1, or the next number that no link has."""
    number = 1
    while f"{class_name}_{number}" in taken:
        number += 1
    return f"{class_name}_{number}"


def command_for(cluster: Cluster, name: str) -> str:
    """The command that puts it there; FILE stands for the map."""
    x, y, yaw = _pose_texts(cluster)
    size = ",".join(_text(max(value, _LEAST_M)) for value in (*cluster.size_m, HEIGHTS_M.get(cluster.class_name, 1.0)))
    return f"wallkit map add fixture FILE {cluster.class_name} {name} --pose {x},{y},{yaw} --size {size}"


def paste_for(cluster: Cluster, name: str) -> str:
    """A link and its joint, two lines: a box on the floor, placed in frame map."""
    height = HEIGHTS_M.get(cluster.class_name, 1.0)
    x, y, yaw = _pose_texts(cluster)
    long_m, deep_m = (_text(max(size, _LEAST_M)) for size in cluster.size_m)
    box = f'<geometry><box size="{long_m} {deep_m} {_text(height)}"/></geometry>'
    body = f'<collision name="{name}.body"><origin xyz="0 0 {_text(height / 2)}"/>{box}</collision>'
    place = f'xyz="{x} {y} 0" rpy="0 0 {yaw}"'
    return (
        f'<link name="{name}"><wk:object class="{cluster.class_name}"/>{body}</link>\n'
        f'<joint name="at_{name}" type="fixed"><parent link="map"/><child link="{name}"/><origin {place}/></joint>'
    )


def _pose_texts(cluster: Cluster) -> tuple[str, str, str]:
    # an angle at full length: a rounded right angle is a finding of its own (WK-E030)
    x, y, yaw = cluster.pose
    return _text(x), _text(y), text_from_number(round(yaw, 8) + 0.0)


def _text(value: float) -> str:
    """To a millimetre."""
    return text_from_number(round(value, 3) + 0.0)
