"""A floor drawn for the tests of the editing verbs: a hall and a washroom, a door between them; and how it is looked at."""

from __future__ import annotations

import math

import shapely

from wallkit.maps.document import apply_edits
from wallkit.maps.draft.draft import DraftOpening
from wallkit.maps.edit.cut import cut
from wallkit.maps.edit.walls import split
from wallkit.maps.geometry import parts
from wallkit.maps.rules.base import Context
from wallkit.maps.xml import parse

# all but localizability, which takes seconds and of which no edit is to blame
JUDGED = ("X", "S", "G", "E", "O", "T", "C", "P")
HALF = "1.5707963"
# two rooms one behind the other, 4 m wide: a hall of 2 m and a washroom of 3 m; a door between them, a window in the north
FLOOR = f"""<?xml version="1.0" encoding="UTF-8"?>
<!-- drawn by hand -->
<robot name="t" xmlns:wk="urn:wallkit:map:1">
  <wk:map format="1.0" units="m rad" level="1" elevation="0" scan_plane="0.30">
    <wk:origin kind="surveyed" epsg="32654" east="1000.00" north="2000.00" yaw="{HALF}"/>
    <wk:class name="wall" seg="1" lidar="opaque"/>
    <wk:room id="hall" kind="corridor" floor="0 0  4 0  4 2  0 2"/>
    <wk:room id="wash" kind="restroom" floor="0 2.1  4 2.1  4 5.1  0 5.1"/>
  </wk:map>
  <link name="map"/>
  <link name="wall_s"><wk:object class="wall"/>
    <collision name="wall_s.run">
      <origin xyz="2.10 0 1.25"/><geometry><box size="4.20 0.1 2.5"/></geometry></collision></link>
  <joint name="at_wall_s" type="fixed"><parent link="map"/><child link="wall_s"/><origin xyz="-0.1 -0.05 0"/></joint>
  <link name="wall_n"><wk:object class="wall"/>
    <collision name="wall_n.run">
      <origin xyz="2.1 0 1.25"/><geometry><box size="4.2 0.1 2.5"/></geometry></collision></link>
  <joint name="at_wall_n" type="fixed"><parent link="map"/><child link="wall_n"/><origin xyz="-0.1 5.15 0"/></joint>
  <link name="wall_w"><wk:object class="wall"/>
    <collision name="wall_w.run">
      <origin xyz="2.55 0 1.25"/><geometry><box size="5.10 0.1 2.5"/></geometry></collision></link>
  <joint name="at_wall_w" type="fixed"><parent link="map"/><child link="wall_w"/>
    <origin xyz="-0.05 0 0" rpy="0 0 {HALF}"/></joint>
  <link name="wall_e"><wk:object class="wall"/>
    <collision name="wall_e.run">
      <origin xyz="2.55 0 1.25"/><geometry><box size="5.10 0.1 2.5"/></geometry></collision></link>
  <joint name="at_wall_e" type="fixed"><parent link="map"/><child link="wall_e"/>
    <origin xyz="4.05 0 0" rpy="0 0 {HALF}"/></joint>
  <!-- the wall between: its door opens into the washroom -->
  <link name="wall_mid"><wk:object class="wall" separates="hall wash"/>
    <wk:opening id="d1" kind="door" along="1.00 1.90" z="0 2.10" fill="door_1"/>
    <collision name="wall_mid.run_a">
      <origin xyz="0.50 0 1.25"/><geometry><box size="1.00 0.1 2.5"/></geometry></collision>
    <collision name="wall_mid.run_b">
      <origin xyz="2.95 0 1.25"/><geometry><box size="2.10 0.1 2.5"/></geometry></collision>
    <collision name="wall_mid.d1_head">
      <origin xyz="1.45 0 2.30"/><geometry><box size="0.90 0.1 0.40"/></geometry></collision>
  </link>
  <joint name="at_wall_mid" type="fixed"><parent link="map"/><child link="wall_mid"/><origin xyz="0 2.05 0"/></joint>
  <link name="door_1"><wk:object class="door" connects="hall wash"/>
    <collision name="door_1.leaf">
      <origin xyz="0.44 -0.02 1.05"/><geometry><box size="0.88 0.04 2.08"/></geometry></collision></link>
  <joint name="door_1_hinge" type="revolute"><parent link="wall_mid"/><child link="door_1"/><origin xyz="1.01 0.05 0"/>
    <axis xyz="0 0 1"/><limit lower="0" upper="{HALF}" effort="20" velocity="1"/>
    <wk:state rest="0" prior="closed:0.7 open:0.2 unknown:0.1"/></joint>
  <link name="urinal_1"><wk:object class="urinal"/>
    <collision name="urinal_1.body">
      <origin xyz="0.16 0 0.85"/><geometry><box size="0.32 0.35 0.60"/></geometry></collision></link>
  <joint name="at_urinal_1" type="fixed"><parent link="wall_w"/><child link="urinal_1"/>
    <origin xyz="4.5 -0.05 0" rpy="0 0 -{HALF}"/></joint>
  <link name="sink_1"><wk:object class="sink"/>
    <collision name="sink_1.body">
      <origin xyz="0.21 0 0.78"/><geometry><box size="0.42 0.50 0.18"/></geometry></collision></link>
  <joint name="at_sink_1" type="fixed"><parent link="wall_mid"/><child link="sink_1"/>
    <origin xyz="3.2 0.05 0" rpy="0 0 {HALF}"/></joint>
  <!-- the end -->
</robot>
""".encode()


def context_of(data: bytes) -> Context:
    document = parse(data, "t.urdf")
    assert document.root is not None
    return Context(document)


def done(data: bytes, verb, *args, **kwargs) -> bytes:
    context = context_of(data)
    return apply_edits(data, verb(context, *args, **kwargs).edits)


def solid(data: bytes) -> dict[tuple[float, float], shapely.Geometry]:
    """The cut of the map at some heights."""
    from wallkit.maps.geometry import slice_parts

    placed = parts(context_of(data).map)
    return {z: slice_parts(placed, z).solid for z in (0.1, 0.3, 1.2, 2.3)}


def differ_m2(a: bytes, b: bytes) -> float:
    one, other = solid(a), solid(b)
    return max(one[z].symmetric_difference(other[z]).area for z in one)


def pose(data: bytes, link: str) -> list[float]:
    T = context_of(data).map.poses()[link]
    return [float(T[0, 3]), float(T[1, 3]), float(T[2, 3]), math.atan2(T[1, 0], T[0, 0])]


P1 = DraftOpening("p1", "passage", (0.5, 1.5), (0.0, 2.1))
CUT = done(FLOOR, cut, "wall_s", P1)
SPLIT = done(FLOOR, split, "wall_mid", 2.5)
