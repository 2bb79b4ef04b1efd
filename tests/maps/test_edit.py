"""Every editing verb on a floor drawn here: own bytes only, a file that parses, words; then what each does, by hand."""

from __future__ import annotations

import math
import random
import re

import numpy as np
import pytest
import shapely

from tests.maps.drawn import HEAD
from wallkit.errors import MapError
from wallkit.maps.classes import ClassInfo
from wallkit.maps.document import apply_edits
from wallkit.maps.draft import DraftOpening, DraftWall
from wallkit.maps.edit import cut as cutting
from wallkit.maps.edit import place, snap
from wallkit.maps.edit.add import add_class, add_fixture, add_room, add_wall
from wallkit.maps.edit.add_openings import DoorWords, Place, add_door
from wallkit.maps.edit.adopt import adopt
from wallkit.maps.edit.changes import number_like
from wallkit.maps.edit.copy import array
from wallkit.maps.edit.cut import cut, fill
from wallkit.maps.edit.origin import Survey, reorigin, survey
from wallkit.maps.edit.place import move, move_to, rotate
from wallkit.maps.edit.rename import rename
from wallkit.maps.edit.tree import remove, reparent
from wallkit.maps.edit.units import scale
from wallkit.maps.edit.values import set_values
from wallkit.maps.edit.verbs import VERBS
from wallkit.maps.edit.walls import join, split
from wallkit.maps.geometry import parts
from wallkit.maps.rules import validate
from wallkit.maps.rules.base import Context
from wallkit.maps.xml import parse

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


def test_the_map_drawn_here_is_clean():
    assert [f for f in validate(FLOOR).findings if f.severity != "info"] == []


# ---------------------------------------------------------------------------------------------------- contract

P1 = DraftOpening("p1", "passage", (0.5, 1.5), (0.0, 2.1))
CUT = done(FLOOR, cut, "wall_s", P1)
SPLIT = done(FLOOR, split, "wall_mid", 2.5)
# verb -> (file, arguments, names of elements whose bytes may change, words that are said)
EXAMPLES = {
    "add wall": (FLOOR, (DraftWall("wall_x", (2.5, -0.05), (2.5, 2.05), 0.1, 2.5),), (), "wall_x: added"),
    "add door": (FLOOR, (Place("wall_e", (0.5, 1.4), (0, 2.1)), DoorWords()), ("wall_e",), "connects outside and hall"),
    "add window": (FLOOR, (Place("wall_n", (1.0, 2.0), (1.0, 2.0)),), ("wall_n",), "window_1: added"),
    "add fixture": (FLOOR, ("sink",), (), "on wall_mid at 2.4 m, left side (wash)"),
    "add room": (done(FLOOR, remove, "hall"), ("hall", "corridor"), (), "8 m2"),
    "add class": (FLOOR, (ClassInfo("locker", (14,), movable=True),), (), "seg 14"),
    "array": (FLOOR, ("urinal_1", 3, (-0.75, 0, 0)), (), "urinal_3: added"),
    "move": (FLOOR, ("sink_1", (0.1, 0, 0)), ("at_sink_1",), "3.2 2.1 0 -> 3.3 2.1 0"),
    "rotate": (FLOOR, ("sink_1", 0.1), ("at_sink_1",), "1.570796 -> 1.670796 rad"),
    "rename": (FLOOR, ("sink_1", "basin"), ("sink_1", "at_sink_1"), "sink_1 -> basin"),
    "remove": (FLOOR, ("sink_1",), ("sink_1", "at_sink_1"), "sink_1: removed (sink)"),
    "reparent": (FLOOR, ("sink_1", "map"), ("at_sink_1",), "wall_mid -> map"),
    "snap": (
        FLOOR.replace(b'4.05 0 0" rpy="0 0 1.5707963', b'4.05 0 0" rpy="0 0 1.5607963'),
        (),
        ("at_wall_e",),
        "1.570796",
    ),
    "cut": (FLOOR, ("wall_s", P1), ("wall_s",), "0.5 to 1.5 m along"),
    "fill": (CUT, ("p1",), ("wall_s",), "opening p1: removed"),
    "split": (FLOOR, ("wall_mid", 2.5), ("wall_mid", "at_sink_1"), "sink_1: hangs on wall_mid -> wall_mid_b"),
    "join": (
        SPLIT,
        ("wall_mid", "wall_mid_b"),
        ("wall_mid", "wall_mid_b", "at_wall_mid_b", "at_sink_1"),
        "wall_mid_b: removed",
    ),
    "adopt": (FLOOR.replace(b'<wk:object class="sink"/>', b""), (), ("sink_1",), "sink: 1 link"),
    "scale": (FLOOR, (2.0, ("sink_1",)), ("sink_1",), "5 numbers times 2"),
    "origin": (
        FLOOR,
        ((1.0, 0.0, 0.0),),
        (*(f"at_wall_{w}" for w in ("s", "n", "w", "e", "mid")), "hall", "wash", "wk:origin"),
        "now at (1, 0)",
    ),
    "set": (FLOOR, ("sink_1", {"sigma": "0.02"}), ("sink_1",), "sigma nothing -> 0.02"),
}
KWARGS = {"add fixture": {"on": ("wall_mid", 2.4, "wash")}, "add room": {"at": (1.0, 1.0)}}


def example(name: str):
    data, args, own, words = EXAMPLES[name]
    context = context_of(data)
    return data, VERBS[name](context, *args, **KWARGS.get(name, {})), own, words


def test_every_verb_has_an_example():
    assert set(EXAMPLES) == set(VERBS)


@pytest.mark.parametrize("name", VERBS)
def test_a_verb_changes_the_bytes_of_its_own_elements_only(name):
    data, changes, own, words = example(name)
    assert changes.edits
    assert words in "\n".join(changes.said)
    root = context_of(data).root
    spans = [e.span for e in root.iter() if e.get("name") in own or e.get("id") in own or e.name in own]
    for edit in changes.edits:
        inside = any(span.offset <= edit.offset and edit.offset + edit.length <= span.end for span in spans)
        # an element that goes takes the line end before it along; an insertion stands between elements
        goes = (
            edit.text == b""
            and data[edit.offset : edit.offset + edit.length].lstrip()[:1] == b"<"
            and any(edit.offset + edit.length == span.end for span in spans)
        )
        between = (
            edit.length == 0 and edit.text.strip().startswith(b"<") and data[edit.offset - 1 : edit.offset] == b">"
        )
        assert inside or goes or between, data[edit.offset : edit.offset + edit.length]


@pytest.mark.parametrize("name", VERBS)
def test_what_a_verb_leaves_parses_keeps_comments_and_has_no_new_error(name):
    data, changes, *_ = example(name)
    after = apply_edits(data, changes.edits)
    assert re.findall(b"<!--.*?-->", after) == re.findall(b"<!--.*?-->", data)
    before = {f.code for f in validate(data).findings if f.severity == "error"}
    new = {f.code for f in validate(after).findings if f.severity == "error"} - before
    # a wall through a room, and a sink turned into its wall, are what was asked for
    assert new <= ({"WK-T003"} if name == "add wall" else {"WK-E010"} if name == "rotate" else set())


@pytest.mark.parametrize("name", VERBS)
def test_a_verb_writes_in_the_files_own_manner(name):
    """With other line ends, another prefix and another encoding the same edit says the same."""
    data, *_ = EXAMPLES[name]
    args, kwargs = EXAMPLES[name][1], KWARGS.get(name, {})
    plain = done(data, VERBS[name], *args, **kwargs)

    def foreign(text: bytes) -> bytes:
        text = text.replace(b"UTF-8", b"iso-8859-1").replace(b"drawn by hand", b"gez\xe4hlt")
        return (
            text.replace(b"xmlns:wk", b"xmlns:k")
            .replace(b"<wk:", b"<k:")
            .replace(b"</wk:", b"</k:")
            .replace(b"\n", b"\r\n")
        )

    assert done(foreign(data), VERBS[name], *args, **kwargs) == foreign(plain)


@pytest.mark.parametrize(
    ("verb", "args"),
    [
        (move, ("snk_1", (1, 0, 0))),
        (rotate, ("snk_1", 1.0)),
        (rename, ("snk_1", "x")),
        (remove, ("snk_1",)),
        (reparent, ("snk_1", "map")),
        (array, ("snk_1", 2, (1, 0, 0))),
        (scale, (2.0, ("snk_1",))),
    ],
)
def test_an_unknown_name_is_answered_with_the_closest(verb, args):
    with pytest.raises(MapError) as refused:
        verb(context_of(FLOOR), *args)
    assert "'snk_1'" in refused.value.message
    assert "did you mean 'sink_1'" in refused.value.hint


# ----------------------------------------------------------------------------------------------------- numbers


@pytest.mark.parametrize(
    ("word", "value", "text"),
    [
        ("0.50", 0.5, "0.50"),
        ("0.50", 0.75, "0.75"),
        ("0.50", 1.0, "1.00"),
        ("4.0", 0.0, "0"),
        ("1", -0.0000001, "0"),
        ("3", 1 / 3, "0.333333"),
        ("1e-1", 0.1, "1e-1"),
        ("1e-1", 0.2, "0.2"),
        ("", -1.25, "-1.25"),
        ("0.1234567", 0.5, "0.500000"),
    ],
)
def test_a_number_is_written_like_the_one_it_replaces(word, value, text):
    assert number_like(word, value) == text
    # where no number of the file has zeros at its end, none gets them
    short = text.rstrip("0").rstrip(".") if "." in text and text != word else text
    assert number_like(word, value, keeps_zeros=False) == short


@pytest.mark.parametrize(
    ("verb", "args"), [(move, ("sink_1", (1, 0, 0))), (rotate, ("sink_1", 1.0)), (reorigin, ((1.0, 0.0, 0.0),))]
)
def test_what_cannot_be_read_is_not_written_anew(verb, args):
    data = FLOOR.replace(b'"3.2 0.05 0"', b'"3,2 0.05 0"').replace(b'"-0.1 5.15 0"', b'"-0.1 nan 0"')
    with pytest.raises(MapError, match="cannot be read") as refused:
        verb(context_of(data), *args)
    assert refused.value.where.startswith("t.urdf:")


def test_what_other_programs_draw_is_named():
    data = FLOOR.replace(b'<collision name="wall_s.run">', b"<visual><geometry/></visual><collision name='wall_s.run'>")
    assert "wall_s: its 1 <visual> stays as before" in cut(context_of(data), "wall_s", P1).said


# ------------------------------------------------------------------------------------------------ move, rotate


def test_move_in_every_frame():
    # sink_1 hangs on wall_mid at x = 3.2 and faces +y; its own x axis is the map's y
    assert pose(FLOOR, "sink_1") == pytest.approx([3.2, 2.1, 0, math.pi / 2], abs=1e-6)
    for frame, by, to in (
        ("map", (0.1, 0.2, 0.3), (3.3, 2.3, 0.3)),
        ("parent", (0.1, 0.2, 0), (3.3, 2.3, 0)),
        ("own", (0.1, 0.2, 0), (3.0, 2.2, 0)),
    ):
        assert pose(done(FLOOR, move, "sink_1", by, frame=frame), "sink_1")[:3] == pytest.approx(to, abs=1e-6)
    # urinal_1 hangs on wall_w, which runs north: the map's y is along it
    after = done(FLOOR, move, "urinal_1", (0, -0.5, 0))
    assert b'<origin xyz="4.0 -0.05 0" rpy="0 0 -1.5707963"/>' in after
    assert pose(done(FLOOR, move_to, "sink_1", (1.0, None, None)), "sink_1")[:2] == pytest.approx([1.0, 2.1], abs=1e-6)


@pytest.mark.parametrize("seed", range(20))
def test_move_and_move_back_are_the_same_bytes(seed):
    rng = random.Random(seed)
    name = rng.choice(["sink_1", "urinal_1", "wall_mid", "wall_e"])
    by = tuple(rng.randint(-9, 9) / 10 for _ in range(3))
    moved = done(FLOOR, move, name, by)
    back = done(moved, move, name, tuple(-b for b in by))
    # a zero in the file has no digits to come back to
    assert back == FLOOR or [
        p == pytest.approx(q, abs=1e-6) for p, q in zip(pose(back, name), pose(FLOOR, name), strict=True)
    ]
    assert differ_m2(back, FLOOR) < 1e-6


def test_children_go_along_or_stay():
    for verb, args in ((move, ("wall_mid", (0.5, 0, 0))), (rotate, ("wall_mid", 0.3))):
        along, stays = (done(FLOOR, verb, *args, leave_children=leave) for leave in (False, True))
        context = context_of(along)
        # on the wall nothing changes, so the bytes of the children do not
        assert along.count(b'<origin xyz="3.2 0.05 0" rpy="0 0 1.5707963"/>') == 1
        assert pose(along, "sink_1") != pytest.approx(pose(FLOOR, "sink_1"), abs=1e-3)
        assert context.map.parent_joint("sink_1").parent == "wall_mid"
        for child in ("sink_1", "door_1"):
            assert pose(stays, child) == pytest.approx(pose(FLOOR, child), abs=2e-6)
        assert pose(stays, "wall_mid") == pytest.approx(pose(along, "wall_mid"), abs=1e-9)


def test_rotate_about_itself_and_about_a_place():
    assert pose(done(FLOOR, rotate, "urinal_1", 0.25), "urinal_1") == pytest.approx([0, 4.5, 0, 0.25], abs=1e-6)
    # a quarter turn about (4, 2.05) takes the start of wall_mid, 4 m west of it, 4 m south of it
    turned = done(FLOOR, rotate, "wall_mid", math.pi / 2, about=(4.0, 2.05))
    assert pose(turned, "wall_mid") == pytest.approx([4.0, -1.95, 0, math.pi / 2], abs=1e-6)
    assert done(done(FLOOR, rotate, "sink_1", 0.25), rotate, "sink_1", -0.25) == FLOOR


def test_a_leaning_wall_keeps_its_tilt_when_moved_and_turned():
    data = FLOOR.replace(b'"-0.1 5.15 0"', b'"-0.1 5.15 0" rpy="0.1 0.2 0.3"')
    turned = done(data, rotate, "wall_n", 0.5)
    assert b'rpy="0.1 0.2 0.8"' in turned
    assert b'rpy="0.1 0.2 0.3"' in done(data, move, "wall_n", (1, 0, 0))


@pytest.mark.parametrize(
    ("verb", "args", "said"),
    [
        (move, ("map", (1, 0, 0)), "'map' hangs on nothing"),
        (move, ("door_1", (0.1, 0, 0)), "fills opening 'd1'"),
        (rotate, ("door_1", 0.1), "fills opening 'd1'"),
        (rotate, ("sink_1", 90.0), "14.3 turns"),
        (rotate, ("sink_1", math.nan), "nan rad"),
        (place.move_opening, ("d1", 2.5), "would reach from 3.5 to 4.4 m, wall 'wall_mid' goes from 0 to 4 m"),
        (place.move_opening, ("d2", 2.5), "no opening 'd2'"),
        (array, ("urinal_1", 1, (1, 0, 0)), "a row of 1"),
        (array, ("urinal_1", 3, (0, 0, 0)), "0 m"),
        (array, ("urinal_1", 3, (0.5, 0, 0)), "4.325 to 5.675 m, wall 'wall_w' goes from 0 to 5.1 m"),
        (array, ("wall_mid", 2, (0, 1, 0)), "hangs on 'wall_mid'"),
        (array, ("door_1", 2, (1, 0, 0)), "moves"),
        (reparent, ("wall_mid", "sink_1"), "'sink_1' hangs on 'wall_mid' itself"),
        (reparent, ("door_1", "wall_n"), "fills opening 'd1'"),
        (remove, ("wall_mid",), "'door_1', 'sink_1' hang on 'wall_mid'"),
        (remove, ("map",), "what everything hangs on"),
        (remove, ("wall",), "elements are of class 'wall'"),
        (rename, ("map", "world"), "the map's root"),
        (rename, ("sink_1", "urinal_1"), "taken"),
        (rename, ("sink_1", "a b"), "no name"),
        (rename, ("urinal", "pissoir"), "the taxonomy's"),
        (rename, ("hall", "wash"), "a room 'wash' already"),
        (fill, ("d1",), "'door_1' fills opening 'd1'"),
        (cut, ("wall_s", DraftOpening("p", "passage", (3.5, 4.5), (0, 2))), "leaves wall 'wall_s', 0 to 4.2 m"),
        (cut, ("wall_s", DraftOpening("p", "passage", (1, 2), (0, 3))), "0 to 3 m up, leaves wall"),
        (cut, ("wall_s", DraftOpening("p", "passage", (2, 1), (0, 2))), "is empty"),
        (cut, ("wall_s", DraftOpening("d1", "passage", (1, 2), (0, 2))), "an opening 'd1' already"),
        (cut, ("wall_mid", DraftOpening("p", "passage", (1.5, 2.5), (0, 2))), "overlaps opening 'd1', 1 to 1.9 m"),
        (cut, ("sink_1", DraftOpening("p", "passage", (1, 2), (0, 2))), "no wall but sink"),
        (split, ("wall_mid", 1.5), "lies in opening 'd1', 1 to 1.9 m"),
        (split, ("wall_mid", 4.0), "not inside wall 'wall_mid', 0 to 4 m"),
        (split, ("wall_mid", 3.0, "wall_e"), "'wall_e' is taken"),
        (join, ("wall_s", "wall_e"), "90 deg off"),
        (join, ("wall_s", "wall_n"), "5.2 m beside"),
        (join, ("wall_s", "wall_s"), "itself"),
        (scale, (-1.0,), "-1"),
        (scale, (1.0,), "1"),
        (add_wall, (DraftWall("wall_s", (0, 0), (1, 0), 0.1),), "taken"),
        (add_wall, (DraftWall("x", (0, 0), (0, 0), 0.1),), "a length of 0 m"),
        (add_wall, (DraftWall("x", (0, 0), (1, 0), -0.1),), "a thickness of -0.1 m"),
        (add_room, ("hall",), "a room 'hall' already"),
        (add_class, (ClassInfo("wall"),), "has 'wall' already"),
        (add_class, (ClassInfo("x", (1,)),), "class 'wall' has the segmentation id 1"),
        (add_class, (ClassInfo("x", p_return=1.5),), "p_return is 1.5"),
        (add_fixture, ("snk",), "no class 'snk'"),
        (add_fixture, ("sink",), "where does 'sink_2' stand"),
        (set_values, ("sink_1", {"class": "snk"}), "no class 'snk'"),
        (set_values, ("sink_1", {"sigma": "2cm"}), "not 1 number: '2cm'"),
        (set_values, ("sink_1", {"sigma": "-1"}), "sigma=-1"),
        (set_values, ("sink_1", {"sigm": "1"}), "no attribute 'sigm'"),
        (set_values, ("sink_1", {"class": ""}), "cannot do without class"),
        (set_values, ("door_1", {"prior": "closed:0.7"}), "no distribution"),
        (set_values, ("d1", {"along": "1 2"}), "not set alone"),
        (set_values, ("wall", {"lidar": "glas"}), "lidar=glas"),
        (set_values, ("door_1", {"connects": "hall wsh"}), "no room 'wsh'"),
        (set_values, ("nobody", {"class": "sink"}), "nothing is named 'nobody'"),
        (reorigin, ((math.inf, 0, 0),), "no place"),
        (survey, (Survey(east_m=1.0, epsg=None),), None),
    ],
)
def test_what_makes_no_sense_is_refused_with_its_numbers(verb, args, said):
    context = context_of(FLOOR)
    if said is None:
        assert verb(context, *args).edits
        return
    with pytest.raises(MapError) as refused:
        verb(context, *args)
    assert said in refused.value.message
    assert refused.value.hint


# ---------------------------------------------------------------------------------------------------- openings


def test_cut_leaves_exactly_the_hole_and_fill_brings_the_bytes_back():
    walls = {part.name: part for part in parts(context_of(CUT).map)}
    assert {name: tuple(walls[f"wall_s.{name}"].shape.size) for name in ("run", "run_b", "p1_head")} == {
        "run": (0.5, 0.1, 2.5),
        "run_b": (2.7, 0.1, 2.5),
        "p1_head": (1.0, 0.1, 0.4),
    }
    hole = solid(FLOOR)[1.2].difference(solid(CUT)[1.2]).buffer(-1e-6).buffer(1e-6, join_style="mitre")
    assert hole.bounds == pytest.approx((0.4, -0.1, 1.4, 0.0))
    assert hole.area == pytest.approx(0.1)
    assert differ_m2(done(CUT, fill, "p1"), FLOOR) < 1e-6
    assert done(CUT, fill, "p1") == FLOOR


@pytest.mark.parametrize("seed", range(30))
def test_cut_then_fill_is_the_same_geometry_anywhere(seed):
    rng = random.Random(seed)
    wall = rng.choice(["wall_s", "wall_n", "wall_e", "wall_w", "wall_mid"])
    end = {"wall_mid": 4.0, "wall_s": 4.2, "wall_n": 4.2}.get(wall, 5.1)
    low = 1.9 if wall == "wall_mid" else 0.0
    x0, x1 = sorted(rng.choice([low, end, round(rng.uniform(low, end), 2)]) for _ in range(2))
    z0, z1 = sorted(rng.choice([0.0, 2.5, round(rng.uniform(0, 2.5), 2)]) for _ in range(2))
    if x1 - x0 < 0.01 or z1 - z0 < 0.01:
        return
    opening = DraftOpening("p1", "passage", (x0, x1), (z0, z1))
    is_end = (z1 - z0 == 2.5 and x1 == end) or (z1 == 2.5 and (x0, x1) == (0.0, end))
    if is_end:
        with pytest.raises(MapError, match="take the end of wall"):
            cut(context_of(FLOOR), wall, opening)
        return
    after = done(FLOOR, cut, wall, opening)
    removed_m2 = {z: solid(FLOOR)[z].area - solid(after)[z].area for z in (0.1, 1.2, 2.3)}
    for z, area in removed_m2.items():
        assert area == pytest.approx(0.1 * (x1 - x0) if z0 <= z < z1 else 0.0, abs=1e-6)
    codes = {f.code for f in validate(after, select=["O001", "O002", "O005", "O006"]).findings}
    assert not codes & {"WK-O001", "WK-O002", "WK-O005", "WK-O006"}
    assert differ_m2(done(after, fill, "p1"), FLOOR) < 1e-6


def test_openings_beside_each_other_are_filled_one_by_one():
    both = done(CUT, cut, "wall_s", DraftOpening("p2", "window", (1.5, 2.5), (1.0, 2.0)))
    assert [f.code for f in validate(both, select=["O"]).findings if f.severity == "error"] == []
    assert differ_m2(done(both, fill, "p2"), CUT) < 1e-6
    # whatever the order, at last the wall is whole
    assert differ_m2(done(done(both, fill, "p1"), fill, "p2"), FLOOR) < 1e-6


def test_a_declared_opening_is_cut_where_its_boxes_stand_in_it():
    """What WK-O001 proposes."""
    data = FLOOR.replace(
        b'<collision name="wall_s.run">',
        b'<wk:opening id="p1" kind="passage" along="0.5 1.5" z="0 2.1"/>\n    <collision name="wall_s.run">',
    )
    assert "WK-O001" in {f.code for f in validate(data).findings}
    assert done(data, cutting.cut_declared, "p1", "wall_s") == CUT


def test_an_opening_moves_with_its_door():
    data = FLOOR
    for verb, args in (
        (cutting.close_only, ("d1",)),
        (place.move_opening, ("d1", 0.5)),
        (cutting.cut_declared, ("d1",)),
    ):
        data = done(data, verb, *args)
    assert b'along="1.50 2.40"' in data
    assert pose(data, "door_1")[:2] == pytest.approx([1.51, 2.1])
    findings = [f for f in validate(data).findings if f.severity != "info"]
    assert findings == []


def test_fill_takes_the_door_along_when_asked():
    after = done(FLOOR, fill, "d1", recursive=True)
    semantic_map = context_of(after).map
    assert "door_1" not in semantic_map.links
    assert "door_1_hinge" not in semantic_map.joints
    assert solid(after)[0.1].area - solid(FLOOR)[0.1].area == pytest.approx(0.9 * 0.1 - 0.88 * 0.04)


@pytest.mark.parametrize("motion", ["hinged", "double_hinged", "sliding", "double_sliding"])
@pytest.mark.parametrize("hinge", ["left", "right"])
@pytest.mark.parametrize("swing", ["in", "out", "hall"])
def test_a_door_of_any_kind_is_clean(motion, hinge, swing):
    # doors of 0.8 m in the middle of the south wall: a sliding leaf has its own width beside it on both sides
    words = DoorWords("door_x", motion, swing, hinge)
    after = done(FLOOR, add_door, Place("wall_s", (1.7, 2.5), (0, 2.1)), words)
    assert [f.message for f in validate(after).findings if f.severity != "info"] == []
    semantic_map = context_of(after).map
    joints = [joint for joint in semantic_map.joints.values() if joint.child.startswith("door_x")]
    opened = semantic_map.poses({joint.name: joint.upper for joint in joints if joint.mimic is None})
    leaf = [part for part in parts(semantic_map, poses=opened) if part.link.startswith("door_x")]
    middle = shapely.union_all([part.footprint for part in leaf]).centroid
    # open, a hinged leaf stands in the room it swings to: in is north of the south wall
    assert (middle.y > -0.05) == (swing != "out")
    if motion == "hinged":
        assert middle.x == pytest.approx(1.6 + 0.01 + 0.02 if hinge == "left" else 2.4 - 0.01 - 0.02, abs=1e-4)
    assert semantic_map.links[joints[0].child].connects == ("outside", "hall")


def test_a_door_fills_an_opening_that_is_there():
    after = done(CUT, add_door, Place("wall_s", opening="p1"), DoorWords("gate"))
    assert b'kind="door" along="0.5 1.5" z="0 2.1" fill="gate"' in after
    assert [f for f in validate(after).findings if f.severity != "info"] == []
    with pytest.raises(MapError, match=r"is 1 m wide; 1.2 m was asked for"):
        add_door(context_of(CUT), Place("wall_s", (0.5, 1.7), (0, 2.1), "p1"), DoorWords())
    with pytest.raises(MapError, match="is filled by 'door_1'"):
        add_door(context_of(FLOOR), Place("wall_mid", opening="d1"), DoorWords())
    with pytest.raises(MapError, match="no room for 1 leaf"):
        add_door(context_of(FLOOR), Place("wall_s", (0.5, 0.52), (0, 2.1)), DoorWords())
    with pytest.raises(MapError, match=r"would reach from -0.\d+ to 1.\d+ m"):
        add_door(context_of(FLOOR), Place("wall_s", (0.5, 1.4), (0, 2.1)), DoorWords(motion="sliding"))


# --------------------------------------------------------------------------------------------- split and join


def test_split_parts_what_stands_on_each_side():
    semantic_map = context_of(SPLIT).map
    assert semantic_map.parent_joint("door_1").parent == "wall_mid"
    assert semantic_map.parent_joint("sink_1").parent == "wall_mid_b"
    assert semantic_map.links["wall_mid_b"].separates == ("hall", "wash")
    for link in ("sink_1", "door_1"):
        assert pose(SPLIT, link) == pytest.approx(pose(FLOOR, link), abs=1e-6)
    assert pose(SPLIT, "wall_mid_b") == pytest.approx([2.5, 2.05, 0, 0], abs=1e-6)
    assert [f for f in validate(SPLIT).findings if f.severity != "info"] == []


@pytest.mark.parametrize(
    ("wall", "at"), [("wall_mid", 0.6), ("wall_mid", 1.9), ("wall_mid", 1.0), ("wall_w", 2.2), ("wall_s", 4.1)]
)
def test_split_then_join_is_the_same_geometry(wall, at):
    parted = done(FLOOR, split, wall, at, "other")
    assert differ_m2(parted, FLOOR) < 1e-6
    joined = done(parted, join, wall, "other")
    assert differ_m2(joined, FLOOR) < 1e-6
    for link in context_of(FLOOR).map.links:
        assert pose(joined, link) == pytest.approx(pose(FLOOR, link), abs=2e-6)
    assert len(context_of(joined).map.links[wall].shapes) == len(context_of(FLOOR).map.links[wall].shapes)
    assert [f for f in validate(joined).findings if f.severity != "info"] == []


# -------------------------------------------------------------------------------------------------- references


@pytest.mark.parametrize(
    ("old", "new", "count"),
    [
        ("wall_mid", "wall_m", 5 + 3),
        ("door_1", "gate", 5),
        ("hall", "aisle", 3),
        ("d1", "gap", 2),
        ("wall", "mur", 6),
    ],
)
def test_rename_reaches_every_reference_and_back_again(old, new, count):
    after = done(FLOOR, rename, old, new)
    assert len(re.findall(rb"(?<![\w])%s(?![\w])" % new.encode(), after)) >= 1
    assert done(after, rename, new, old) == FLOOR
    assert [f.code for f in validate(after).findings if f.severity == "error"] == []
    context = context_of(FLOOR)
    assert len(rename(context, old, new).edits) == count


def test_rename_reaches_mimics_and_says_when_a_name_has_two_meanings():
    two = done(FLOOR, add_door, Place("wall_s", (1.2, 2.8), (0, 2.1)), DoorWords("gate", "double_hinged"))
    after = done(two, rename, "gate_a_hinge", "leader")
    assert b'<mimic joint="leader"/>' in after
    after = done(two, rename, "gate_a", "leaf")
    assert b'<mimic joint="leaf_hinge"/>' in after
    both = FLOOR.replace(b'"hall"', b'"sink_1"').replace(b"hall wash", b"sink_1 wash")
    with pytest.raises(MapError, match="names a link and a room"):
        rename(context_of(both), "sink_1", "x")
    assert b'<wk:room id="x"' in done(both, rename, "sink_1", "x", "room")


def test_a_renamed_link_whose_class_was_guessed_says_so():
    data = FLOOR.replace(b'<wk:object class="sink"/>', b"")
    assert "its class was guessed from its name (sink), now none" in "\n".join(
        rename(context_of(data), "sink_1", "x").said
    )


def test_remove_leaves_no_reference():
    after = done(FLOOR, remove, "wall_mid", recursive=True)
    assert not {"wall_mid", "door_1", "sink_1"} & set(context_of(after).map.links)
    assert validate(after, select=["X", "S", "G"]).findings == ()
    for name in (b"wall_mid", b"door_1", b"sink_1"):
        assert name not in after
    assert b"fill=" not in done(FLOOR, remove, "door_1")
    gone = done(FLOOR, remove, "wash")
    assert b"wash" not in gone.replace(b"washroom", b"")
    two = done(FLOOR, add_door, Place("wall_s", (1.2, 2.8), (0, 2.1)), DoorWords("gate", "double_hinged"))
    assert b"<mimic" not in done(two, remove, "gate_a")


@pytest.mark.parametrize("name", ["add wall", "add fixture", "add class"])
def test_add_then_remove_are_the_same_bytes(name):
    data, changes, *_ = example(name)
    added = {"add wall": "wall_x", "add fixture": "sink_2", "add class": "locker"}[name]
    assert done(apply_edits(data, changes.edits), remove, added) == data


def test_reparent_keeps_the_place():
    after = done(FLOOR, reparent, "sink_1", "wall_e")
    assert pose(after, "sink_1") == pytest.approx(pose(FLOOR, "sink_1"), abs=1e-6)
    assert context_of(after).map.parent_joint("sink_1").parent == "wall_e"
    assert done(after, reparent, "sink_1", "wall_mid") == FLOOR


# --------------------------------------------------------------------------------------------------------- add


def test_a_wall_stops_at_the_faces_of_the_walls_it_is_drawn_into():
    after = done(FLOOR, add_wall, DraftWall("wall_x", (2.5, -0.05), (2.5, 2.05), 0.1, 2.5))
    (part,) = [part for part in parts(context_of(after).map) if part.link == "wall_x"]
    assert part.footprint.bounds == pytest.approx((2.45, 0.0, 2.55, 2.0), abs=1e-6)
    oblique = done(FLOOR, add_wall, DraftWall("wall_x", (2.0, -0.05), (3.0, 2.05), 0.1, 2.5))
    codes = {f.code for f in validate(oblique, select=["E"]).findings}
    assert not codes & {"WK-E020", "WK-E022", "WK-E015", "WK-E023"}


def test_a_flooded_room_is_what_the_walls_enclose():
    bare = done(done(FLOOR, remove, "hall"), remove, "wash")
    room = context_of(done(bare, add_room, "wash", at=(2.0, 4.0))).map.rooms["wash"]
    assert shapely.Polygon(room.floor).symmetric_difference(shapely.box(0, 2.1, 4, 5.1)).area < 1e-3
    assert len(room.floor) == 4
    for at, said in (((9.0, 9.0), "not enclosed"), ((2.0, 2.05), "solid")):
        with pytest.raises(MapError, match=said):
            add_room(context_of(bare), "x", at=at)
    with pytest.raises(MapError, match="would share 8 m2 with room 'hall'"):
        add_room(context_of(FLOOR), "x", at=(1.0, 1.0))
    with pytest.raises(MapError, match="no polygon"):
        add_room(context_of(FLOOR), "x", floor=np.array([[9.0, 9], [10, 10], [10, 9], [9, 10]]))


def test_a_fixture_hangs_on_the_side_that_is_named():
    for side, y, yaw in (("left", 2.1, math.pi / 2), ("right", 2.0, -math.pi / 2), ("hall", 2.0, -math.pi / 2)):
        after = done(FLOOR, add_fixture, "radiator", "heater", on=("wall_mid", 2.4, side), size_m=(0.1, 0.6, 0.5))
        assert pose(after, "heater") == pytest.approx([2.4, y, 0, yaw], abs=2e-6)
    # only one side of wall_n is a room
    assert pose(done(FLOOR, add_fixture, "mirror", "m", on=("wall_n", 1.1, "")), "m")[1] == pytest.approx(5.1)
    for on, said in (
        (("wall_mid", 3.9, "left"), "3.625 to 4.175 m, wall 'wall_mid' goes from 0 to 4 m"),
        (("wall_mid", 2.4, ""), "which side"),
    ):
        with pytest.raises(MapError, match=said):
            add_fixture(context_of(FLOOR), "sink", on=on)


# ---------------------------------------------------------------------------------------- snap, scale, origin


def test_snap_squares_a_wall_and_closes_the_gap():
    crooked = FLOOR.replace(b'4.05 0 0" rpy="0 0 1.5707963', b'4.05 0 0" rpy="0 0 1.5657963')
    assert done(crooked, snap.straighten) == FLOOR
    short = FLOOR.replace(
        b'<origin xyz="2.95 0 1.25"/><geometry><box size="2.10 0.1 2.5"/>',
        b'<origin xyz="2.94 0 1.25"/><geometry><box size="2.08 0.1 2.5"/>',
    )
    assert "WK-E022" in {f.code for f in validate(short).findings}
    closed = done(short, snap.close_gaps)
    assert differ_m2(closed, FLOOR) < 1e-6
    assert done(FLOOR, snap.straighten) == FLOOR == done(FLOOR, snap.close_gaps)
    # a wall at an angle on purpose stays
    assert done(crooked, snap.straighten, within_rad=1e-3) == crooked


@pytest.mark.parametrize("factor", [1000, 0.5, 39.37])
def test_scale_scales_every_length(factor):
    after = done(FLOOR, scale, factor)
    a, b = (parts(context_of(data).map) for data in (FLOOR, after))
    for one, other in zip(a, b, strict=True):
        np.testing.assert_allclose(other.corners, one.corners * factor, atol=2e-6 * max(factor, 1))
    rooms = [context_of(data).map.rooms["wash"].floor for data in (FLOOR, after)]
    np.testing.assert_allclose(rooms[1], rooms[0] * factor, atol=1e-6)
    assert context_of(after).map.header.scan_plane_m == 0.3
    assert context_of(after).map.joints["door_1_hinge"].upper == pytest.approx(math.pi / 2, abs=1e-6)
    slid = done(FLOOR, add_door, Place("wall_s", (1.7, 2.5), (0, 2.1)), DoorWords("x", "sliding"))
    upper = [context_of(data).map.joints["x_slide"].upper for data in (slid, done(slid, scale, factor))]
    assert upper[1] == pytest.approx(upper[0] * factor, abs=1e-6)


@pytest.mark.parametrize("to", [(1.0, 0.5, 0.0), (-2.0, 3.0, 0.7), (0.0, 0.0, math.pi / 2)])
def test_a_new_origin_moves_nothing_on_earth(to):
    """East and north of every corner stay, and so do the rooms about them; findings are those of before."""
    after = done(FLOOR, reorigin, to)

    def on_earth(data: bytes) -> np.ndarray:
        semantic_map = context_of(data).map
        found = semantic_map.header.survey
        corners = [part.corners[:, :2] for part in parts(semantic_map)] + [r.floor for r in semantic_map.rooms.values()]
        c, s = math.cos(found.yaw_rad), math.sin(found.yaw_rad)
        return np.concatenate(corners) @ np.array([[c, s], [-s, c]]) + [found.east_m, found.north_m]

    # the survey is written to millimetres
    np.testing.assert_allclose(on_earth(after), on_earth(FLOOR), atol=2e-3)
    assert pose(after, "map") == [0, 0, 0, 0]
    assert [f.code for f in validate(after).findings] == [f.code for f in validate(FLOOR).findings]


def test_coordinates_of_a_survey_become_an_origin():
    far = done(
        FLOOR.replace(FLOOR[FLOOR.index(b"<wk:origin") : FLOOR.index(b"<wk:class")], b""),
        reorigin,
        (-382145.0, -8811.0, 0.0),
    )
    assert b'<wk:origin kind="surveyed" east="-382145" north="-8811" yaw="0"/>' in far
    assert "WK-E042" in {f.code for f in validate(far).findings}
    near = done(far, reorigin)
    assert pose(near, "wall_s")[:2] == pytest.approx([0.9, 0.95])


# ------------------------------------------------------------------------------------------------ adopt and set


def test_adopt_makes_a_plain_urdf_a_map():
    plain = re.sub(rb"\s*<(/?)wk:[^>]*>", b"", FLOOR).replace(b' xmlns:wk="urn:wallkit:map:1"', b"")
    assert b"wk:" not in plain
    plain = plain.replace(b"urinal_1", b"thing")
    after = done(plain, adopt, {"thing": "urinal"}, level="2", scan_plane_m=0.3)
    semantic_map = context_of(after).map
    assert {link.name: link.class_name for link in semantic_map.links.values() if link.semantics} == {
        "thing": "urinal",
        "sink_1": "sink",
        "door_1": "door",
        **{f"wall_{w}": "wall" for w in ("s", "n", "w", "e", "mid")},
    }
    assert (semantic_map.header.level, semantic_map.header.scan_plane_m) == ("2", 0.3)
    assert not [f for f in validate(after, select=["X", "S", "G"]).findings if f.severity != "info"]
    assert adopt(context_of(after)).edits == ()
    assert differ_m2(after, FLOOR) < 1e-9
    assert "thing" in "\n".join(adopt(context_of(plain)).said)


def test_set_makes_the_element_it_needs():
    data = FLOOR.replace(b'\n    <wk:state rest="0" prior="closed:0.7 open:0.2 unknown:0.1"/>', b"")
    after = done(data, set_values, "door_1", {"rest": "0.5", "upper": "1.2"})
    joint = context_of(after).map.joints["door_1_hinge"]
    assert (joint.rest, joint.upper) == (0.5, 1.2)
    header = context_of(done(FLOOR, set_values, "map", {"max-range": "20", "level": "3"})).map.header
    assert (header.max_range_m, header.level) == (20.0, "3")
    two = context_of(done(FLOOR, set_values, "sink_1", {"note": "a & b", "sigma": "0.02"})).map.links["sink_1"]
    assert (two.note, two.sigma_m) == ("a & b", 0.02)
    assert done(done(FLOOR, set_values, "sink_1", {"note": "x"}), set_values, "sink_1", {"note": ""}) == FLOOR


def test_verbs_of_the_head_need_one():
    bare = (HEAD + '<link name="map"/></robot>').encode()
    for verb, args in ((add_class, (ClassInfo("x"),)), (add_room, ("x",)), (set_values, ("map", {"level": "1"}))):
        kwargs = {"floor": np.array([[0.0, 0], [1, 0], [1, 1]])} if verb is add_room else {}
        with pytest.raises(MapError) as refused:
            verb(context_of(bare), *args, **kwargs)
        assert "wallkit map adopt" in refused.value.hint


# ---------------------------------------------------------------------------------------------- yourdfpy agrees


@pytest.mark.parametrize("name", VERBS)
def test_yourdfpy_places_every_link_where_we_do(name, tmp_path):
    import yourdfpy

    data, changes, *_ = example(name)
    after = apply_edits(data, changes.edits)
    path = tmp_path / "t.urdf"
    path.write_bytes(after)
    robot = yourdfpy.URDF.load(str(path), build_scene_graph=True, load_meshes=False)
    for link, T in context_of(after).map.poses().items():
        np.testing.assert_allclose(robot.get_transform(link, "map"), T, atol=1e-9)
