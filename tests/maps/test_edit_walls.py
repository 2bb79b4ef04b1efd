"""What verbs do to walls, by hand: cut, fill, doors of every kind, split, join."""

from __future__ import annotations

import random

import pytest
import shapely

from tests.maps.floor import CUT, FLOOR, JUDGED, SPLIT, context_of, differ_m2, done, pose, solid
from wallkit.errors import MapError
from wallkit.maps.draft.draft import DraftOpening
from wallkit.maps.edit import cut as cutting
from wallkit.maps.edit import place
from wallkit.maps.edit.add_openings import DoorWords, Place, add_door
from wallkit.maps.edit.cut import cut, fill
from wallkit.maps.edit.walls import join, split
from wallkit.maps.geometry import parts
from wallkit.maps.rules import validate

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
    assert "WK-O001" in {f.code for f in validate(data, select=JUDGED).findings}
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
    findings = [f for f in validate(data, select=JUDGED).findings if f.severity != "info"]
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
    assert [f.message for f in validate(after, select=JUDGED).findings if f.severity != "info"] == []
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
    assert [f for f in validate(after, select=JUDGED).findings if f.severity != "info"] == []
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
    assert [f for f in validate(SPLIT, select=JUDGED).findings if f.severity != "info"] == []


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
    assert [f for f in validate(joined, select=JUDGED).findings if f.severity != "info"] == []
