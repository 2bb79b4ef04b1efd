"""What verbs do, by hand: move, rotate, rename, remove, add, snap, scale, origin, adopt, set."""

from __future__ import annotations

import math
import random
import re

import numpy as np
import pytest
import shapely

from tests.maps.drawn import HEAD
from tests.maps.floor import FLOOR, JUDGED, context_of, differ_m2, done, pose
from wallkit.errors import MapError
from wallkit.maps.classes import ClassInfo
from wallkit.maps.draft.draft import DraftWall
from wallkit.maps.edit import snap
from wallkit.maps.edit.add import add_class, add_fixture, add_room, add_wall
from wallkit.maps.edit.add_openings import DoorWords, Place, add_door
from wallkit.maps.edit.adopt import adopt
from wallkit.maps.edit.origin import reorigin
from wallkit.maps.edit.place import move, move_to, rotate
from wallkit.maps.edit.rename import rename
from wallkit.maps.edit.tree import remove, reparent
from wallkit.maps.edit.units import scale
from wallkit.maps.edit.values import set_values
from wallkit.maps.geometry import parts
from wallkit.maps.rules import validate

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
    assert [f.code for f in validate(after, select=JUDGED).findings if f.severity == "error"] == []
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
    assert "WK-E022" in {f.code for f in validate(short, select=JUDGED).findings}
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
    assert [f.code for f in validate(after, select=JUDGED).findings] == [
        f.code for f in validate(FLOOR, select=JUDGED).findings
    ]


def test_coordinates_of_a_survey_become_an_origin():
    far = done(
        FLOOR.replace(FLOOR[FLOOR.index(b"<wk:origin") : FLOOR.index(b"<wk:class")], b""),
        reorigin,
        (-382145.0, -8811.0, 0.0),
    )
    assert b'<wk:origin kind="surveyed" east="-382145" north="-8811" yaw="0"/>' in far
    assert "WK-E042" in {f.code for f in validate(far, select=JUDGED).findings}
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
