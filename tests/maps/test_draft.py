"""Drafts as wkmap files: yourdfpy loads them with the poses the draft says, corners are closed, doors clear their jambs."""

from __future__ import annotations

import math
import re
from itertools import combinations

import numpy as np
import pytest
import yourdfpy
from lxml import etree
from shapely import affinity, box, union_all
from shapely.geometry import LineString, Polygon

from wallkit.errors import MapError
from wallkit.maps.classes import ClassInfo
from wallkit.maps.draft.doors import CLEARANCE_M, DraftDoor
from wallkit.maps.draft.draft import Draft, DraftFixture, DraftOpening, DraftOrigin, DraftPane, DraftRoom, DraftWall
from wallkit.maps.draft.joints import end_closures
from wallkit.maps.draft.write import write_draft

DOOR = DraftOpening("d1", "door", (1.0, 1.9), (0.0, 2.1), DraftDoor("door_1"))


def ring(points, thickness=0.12, **extra):
    """Walls from each point to the next, the last to the first."""
    ends = zip(points, points[1:] + points[:1], strict=True)
    return tuple(DraftWall(f"w{i}", a, b, thickness, **extra) for i, (a, b) in enumerate(ends))


def loaded(draft, tmp_path, **joints):
    path = tmp_path / "draft.wkmap.urdf"
    path.write_bytes(write_draft(draft))
    robot = yourdfpy.URDF.load(str(path), build_scene_graph=True, load_meshes=False)
    robot.update_cfg({name: value for name, value in joints.items() if name in robot.actuated_joint_names})
    assert robot.validate()
    return robot


def footprints(robot, *, at_z=None):
    """{collision name: polygon in the map} of the boxes, those that a height cuts or all, by yourdfpy's own kinematics."""
    found = {}
    for link in robot.robot.links:
        T_map_link = robot.get_transform(link.name, "map")
        for part in link.collisions:
            T = T_map_link @ (np.eye(4) if part.origin is None else part.origin)
            dx, dy, dz = part.geometry.box.size
            if at_z is None or abs(at_z - T[2, 3]) < dz / 2:
                corners = [
                    (T @ [sx * dx / 2, sy * dy / 2, 0, 1])[:2] for sx, sy in ((1, 1), (-1, 1), (-1, -1), (1, -1))
                ]
                found[part.name] = Polygon(corners)
    return found


def outline(points, thickness):
    """What a draughtsman draws: the ring of axes, `thickness` wide, with sharp corners."""
    return LineString([*points, points[0], points[1]]).buffer(thickness / 2, cap_style="flat", join_style="mitre")


@pytest.mark.parametrize("yaw", [0.0, 0.3, 2.0])
def test_a_rectangle_of_walls_is_closed_without_overlap(tmp_path, yaw):
    corners = [(0.0, 0.0), (5.0, 0.0), (5.0, 4.0), (0.0, 4.0)]
    turned = [tuple(p) for p in np.array(affinity.rotate(Polygon(corners), yaw, use_radians=True).exterior.coords)[:4]]
    pieces = list(footprints(loaded(Draft("room", ring(turned)), tmp_path)).values())
    assert max(a.intersection(b).area for a, b in combinations(pieces, 2)) < 1e-5
    assert union_all(pieces).buffer(1e-5).symmetric_difference(outline(turned, 0.12)).area < 1e-3
    assert len(union_all(pieces).buffer(1e-5).interiors) == 1


@pytest.mark.parametrize("angle_deg", [20, 40, 60, 75, 100, 120, 140, 155, 170])
def test_a_corner_of_any_angle_leaks_nowhere(angle_deg):
    # a kite with the angle at the origin, closed far away
    a = math.radians(angle_deg)
    axes = np.array([[3, 0, 0, 0], [0, 0, 3 * math.cos(a), 3 * math.sin(a)]], dtype=float)
    grown = end_closures(axes, np.array([0.12, 0.12]))
    boxes = []
    for (x0, y0, x1, y1), (e0, e1) in zip(axes, grown, strict=True):
        u = np.array([x1 - x0, y1 - y0]) / 3
        boxes.append(
            LineString([np.array([x0, y0]) - e0 * u, np.array([x1, y1]) + e1 * u]).buffer(0.06, cap_style="flat")
        )
    walls = union_all(boxes)
    # nothing of either axis is left outside of the walls, and they are one piece
    axis = LineString([(3, 0), (0, 0), (3 * math.cos(a), 3 * math.sin(a))])
    assert axis.difference(walls.buffer(1e-9)).length < 1e-9
    assert walls.geom_type == "Polygon"
    # and nothing sticks out further than a wall is thick beyond the sharp corner
    assert walls.difference(axis.buffer(0.06 + 0.12)).area < 1e-9


def test_a_wall_that_ends_on_another_stops_at_its_face_however_it_was_drawn():
    through = [0.0, 0.0, 4.0, 0.0]
    for drawn_to in (0.0, 0.03, 0.06):
        grown = end_closures(np.array([through, [2.0, drawn_to, 2.0, 3.0]]), np.array([0.12, 0.10]))
        np.testing.assert_allclose(grown, [[0, 0], [drawn_to - 0.06, 0]], atol=1e-12)


def test_ends_that_miss_each_other_are_left_as_drawn():
    # 2 cm apart at the corner, 5 cm short of the face at the T: gaps are for the validator to report, not to hide
    axes = np.array([[0, 0, 4, 0], [4.02, 0, 4.02, 3], [2, 0.11, 2, 3]], dtype=float)
    np.testing.assert_array_equal(end_closures(axes, np.full(3, 0.12)), np.zeros((3, 2)))


def test_four_walls_that_meet_form_a_cross_without_overlap(tmp_path):
    arms = [(2.0, 0.0), (-2.0, 0.0), (0.0, 2.0), (0.0, -2.0)]
    walls = tuple(DraftWall(f"w{i}", (0.0, 0.0), end, 0.1) for i, end in enumerate(arms))
    pieces = list(footprints(loaded(Draft("cross", walls), tmp_path)).values())
    assert max(a.intersection(b).area for a, b in combinations(pieces, 2)) < 1e-6
    assert union_all(pieces).area == pytest.approx(4 * 2 * 0.1 - 0.1**2, abs=1e-5)


def test_openings_leave_exactly_their_hole(tmp_path):
    window = DraftOpening("win", "window", (2.5, 3.5), (1.0, 2.0), DraftPane("pane_1"))
    wall = DraftWall("w", (1.0, 1.0), (1.0, 5.0), 0.12, 2.7, (window, DOOR))
    robot = loaded(Draft("openings", (wall,)), tmp_path)
    solid = box(-0.06, 0, 0.06, 4)
    for z, holes in ((0.5, [(1.0, 1.9)]), (1.5, [(1.0, 1.9), (2.5, 3.5)]), (2.05, [(1.0, 1.9)]), (2.5, [])):
        runs = [p for name, p in footprints(robot, at_z=z).items() if name.startswith("w.")]
        expected = affinity.translate(solid.difference(union_all([box(-1, a, 1, b) for a, b in holes])), 1, 1)
        assert union_all(runs).symmetric_difference(expected).area < 1e-5
    assert footprints(robot)["pane_1.body"].symmetric_difference(box(0.995, 3.5, 1.005, 4.5)).area < 1e-5


def test_an_opening_is_kept_in_place_when_its_wall_grows(tmp_path):
    corners = [(0.0, 0.0), (5.0, 0.0), (5.0, 4.0), (0.0, 4.0)]
    walls = tuple(
        DraftWall(w.name, w.start, w.end, w.thickness_m, openings=(DOOR,) if w.name == "w0" else ())
        for w in ring(corners)
    )
    pieces = footprints(loaded(Draft("room", walls), tmp_path), at_z=0.3)
    free = box(0, -0.06, 5, 0.06).difference(
        union_all([p for n, p in pieces.items() if n.startswith("w")]).buffer(1e-7)
    )
    assert free.bounds == pytest.approx((1.0, -0.06, 1.9, 0.06), abs=1e-5)


@pytest.mark.parametrize("hinge", ["start", "end"])
@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("motion", ["hinged", "double_hinged", "sliding", "double_sliding"])
def test_a_door_fills_its_hole_shut_clears_it_open_and_never_touches_its_wall(tmp_path, motion, hinge, side):
    door = DraftDoor("door", motion, hinge, side, travel_rad=math.pi / 2)
    opening = DraftOpening("d", "door", (1.0, 2.0), (0.0, 2.1), door)
    draft = Draft("door", (DraftWall("w", (0.0, 0.0), (4.0, 0.0), 0.12, openings=(opening,)),))
    robot = loaded(draft, tmp_path)
    (lead,) = robot.actuated_joint_names
    upper = robot.joint_map[lead].limit.upper
    out = 1 if side == "left" else -1
    for share in np.linspace(0, 1, 31):
        parts = footprints(loaded(draft, tmp_path, **{lead: share * upper}) if share else robot)
        leaves = [p for name, p in parts.items() if name.startswith("door")]
        runs = [p for name, p in parts.items() if name.startswith("w.run")]
        assert len(leaves) == (2 if motion.startswith("double") else 1)
        assert all(leaf.intersection(run).area == 0 for leaf in leaves for run in runs)
        if len(leaves) == 2:
            assert leaves[0].intersection(leaves[1]).area == 0
        spanned = union_all(leaves).intersection(box(1, -1, 2, 1)).bounds
        if share == 0:
            assert spanned[0] == pytest.approx(1.0 + CLEARANCE_M, abs=1e-6)
            assert spanned[2] == pytest.approx(2.0 - CLEARANCE_M, abs=1e-6)
            face = max if out > 0 else min
            if motion.endswith("hinged"):
                assert face(spanned[1], spanned[3]) == pytest.approx(out * 0.06, abs=1e-6)
    # wide open: nothing is left between the jambs but, of hinged leaves, their thickness
    clear = LineString([(1.0, 0.0), (2.0, 0.0)])
    assert clear.difference(union_all(leaves)).length == pytest.approx(1.0)
    moved = union_all(leaves).centroid
    if motion == "hinged":
        assert (moved.x < 1.5) == (hinge == "start")
        assert moved.y * out > 0.3
    if motion == "sliding":
        assert (moved.x < 1.0) == (hinge == "start")


def test_a_double_doors_second_leaf_mimics_the_first():
    door = DraftDoor("door", "double_hinged")
    wall = DraftWall("w", (0.0, 0.0), (4.0, 0.0), 0.1, openings=(DraftOpening("d", "door", (1, 2.8), (0, 2.1), door),))
    tree = etree.fromstring(write_draft(Draft("double", (wall,))))
    (mimic,) = tree.findall("joint/mimic")
    assert mimic.get("joint") == "door_a_hinge"
    assert mimic.getparent().get("name") == "door_b_hinge"


def test_fixtures_stand_where_the_draft_says(tmp_path):
    wall = DraftWall("w_e", (5.06, 0.0), (5.06, 4.0), 0.12)
    fixtures = (
        DraftFixture("sink_1", "sink", (5.0, 2.0, math.pi), (0.42, 0.5, 0.18), 0.7, "w_e"),
        DraftFixture("bin_1", "trash", (2.0, 1.0, 0.7), (0.3, 0.4, 0.6)),
    )
    robot = loaded(Draft("fixtures", (wall,), fixtures), tmp_path)
    for fixture in fixtures:
        T = robot.get_transform(fixture.name, "map")
        np.testing.assert_allclose(T[:3, 3], [*fixture.pose[:2], 0], atol=2e-6)
        np.testing.assert_allclose(T[:2, 0], [math.cos(fixture.pose[2]), math.sin(fixture.pose[2])], atol=2e-6)
    found = footprints(robot)
    assert found["sink_1.body"].bounds == pytest.approx((4.58, 1.75, 5.0, 2.25), abs=1e-5)
    assert found["bin_1.body"].centroid.coords[0] == pytest.approx((2.0, 1.0), abs=1e-5)
    assert robot.joint_map["at_sink_1"].parent == "w_e"
    assert "sink_1.body" in footprints(robot, at_z=0.79)
    assert "sink_1.body" not in footprints(robot, at_z=0.69)


def test_the_header_says_what_the_draft_knows():
    draft = Draft(
        "floor2",
        fixtures=(DraftFixture("shower_1", "shower", (1, 1, 0), (0.9, 0.9, 2.0)),),
        rooms=(DraftRoom("hall", "circulation", ((0, 0), (0, 2), (5, 2), (5, 0))),),
        classes=(ClassInfo("shower", (17,), "glass", 0.3),),
        level="2",
        elevation_m=4.2,
        scan_plane_m=0.3,
        origin=DraftOrigin("surveyed", 32654, 382145.2, 3948811.75, 0.2618),
        source="plan.dxf",
    )
    text = write_draft(draft).decode()
    assert 'level="2" elevation="4.2" scan_plane="0.3"' in text
    assert '<wk:origin kind="surveyed" epsg="32654" east="382145.2" north="3948811.75" yaw="0.2618"/>' in text
    assert '<wk:class name="shower" seg="17" lidar="glass" p_return="0.3"/>' in text
    # corners go round anticlockwise whichever way they were given
    assert '<wk:room id="hall" kind="circulation" floor="5 0  5 2  0 2  0 0"/>' in text


def test_numbers_are_short_and_names_are_unique_and_tell_their_link():
    corners = [(0.0, 0.0), (math.pi, 1 / 3), (2.0, 4.0)]
    walls = ring(corners)
    text = write_draft(Draft("t", (*walls, DraftWall("door_wall", (9, 0), (12, 0), 0.1, openings=(DOOR,))))).decode()
    tree = etree.fromstring(text.encode())
    for keys, decimals in ((("xyz", "size", "along", "z"), 6), (("rpy",), 7)):
        numbers = [n for e in tree.iter() for k in keys for n in e.get(k, "").split()]
        assert all(re.fullmatch(rf"-?\d+(\.\d{{0,{decimals - 1}}}[1-9])?", n) and n != "-0" for n in numbers)
    parts = [(c.getparent().get("name"), c.get("name")) for c in tree.iter("collision")]
    assert len({name for _, name in parts}) == len(parts)
    assert all(name.startswith(f"{link}.") for link, name in parts)


def test_the_same_draft_gives_the_same_bytes():
    draft = Draft("room", ring([(0.0, 0.0), (5.0, 0.0), (5.0, 4.0)]))
    assert write_draft(draft) == write_draft(draft)


def test_names_are_escaped():
    draft = Draft('a "b" <c> & d', (DraftWall("w&1", (0, 0), (1, 0), 0.1),))
    assert etree.fromstring(write_draft(draft)).get("name") == 'a "b" <c> & d'


@pytest.mark.parametrize(
    ("draft", "says"),
    [
        (Draft("d", (DraftWall("a", (0, 0), (1, 0), 0.1), DraftWall("a", (2, 0), (3, 0), 0.1))), "'a' is used 2 times"),
        (Draft("d", (DraftWall("a", (0, 0), (0, 0), 0.1),)), "wall 'a' measures 0 x 0.1 x 2.5 m"),
        (Draft("d", (DraftWall("a", (0, 0), (1, 0), math.nan),)), "wall 'a' measures 1 x nan"),
        (Draft("d", fixtures=(DraftFixture("f", "toilett", (0, 0, 0), (1, 1, 1)),)), "did you mean 'toilet'"),
        (Draft("d", fixtures=(DraftFixture("f", "sink", (0, 0, 0), (1, 1, 0)),)), "'f' measures 1 x 1 x 0 m"),
        (
            Draft("d", fixtures=(DraftFixture("f", "sink", (0, 0, 0), (1, 1, 1), wall="w"),)),
            "the wall 'w', which is not",
        ),
        (Draft("d", (DraftWall("a", (0, 0), (1.5, 0), 0.1, openings=(DOOR,)),)), "does not fit into wall 'a'"),
    ],
)
def test_what_cannot_be_written_is_refused_with_a_reason(draft, says):
    with pytest.raises(MapError) as caught:
        write_draft(draft)
    assert says in str(caught.value)
    assert caught.value.hint
