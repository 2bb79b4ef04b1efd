"""The map as nouns, and where its links are: against yourdfpy, and by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.maps.drawn import box, many_walls, placed, robot, wall
from wallkit.errors import MapError
from wallkit.maps.classes import class_from_name
from wallkit.maps.numbers import number_from_text, numbers_from_text, trouble_in
from wallkit.maps.read import load_map, mesh_file, prior_from_text, read_map
from wallkit.maps.xml import parse

HINGE = (
    '<joint name="{name}" type="{kind}"><parent link="map"/><child link="{name}_leaf"/><origin xyz="{xyz}"/>'
    '<axis xyz="{axis}"/><limit lower="{lower}" upper="{upper}" effort="1" velocity="1"/>{more}</joint>'
)


def door(name="d", kind="revolute", xyz="0 0 0", axis="0 0 1", lower="0", upper="1.5", more=""):
    joint = HINGE.format(name=name, kind=kind, xyz=xyz, axis=axis, lower=lower, upper=upper, more=more)
    return box(f"{name}_leaf", "0.9 0.04 2", at="0.45 0 1", wk_class="door") + joint


def model(*pieces):
    return read_map(parse(robot(*pieces)))


# ------------------------------------------------------------------------------------------------ poses


def poses_of_yourdfpy(path, states):
    yourdfpy = pytest.importorskip("yourdfpy")
    urdf = yourdfpy.URDF.load(str(path), load_meshes=False, build_scene_graph=True)
    urdf.update_cfg({name: states.get(name, 0.0) for name in urdf.actuated_joint_names})
    return {link.name: urdf.get_transform(link.name) for link in urdf.robot.links}


@pytest.mark.data
@pytest.mark.parametrize("state", [0.0, 0.5, 1.2, 1.5708])
def test_poses_of_the_example_agree_with_yourdfpy(data, state):
    path = data / "maps/wkmap_example/restroom.wkmap.urdf"
    ours = load_map(path).poses({"door_m_hinge": state})
    theirs = poses_of_yourdfpy(path, {"door_m_hinge": state})
    assert set(ours) == set(theirs)
    for name, pose in theirs.items():
        np.testing.assert_allclose(ours[name], pose, atol=1e-12)


@pytest.mark.data
def test_poses_of_the_iai_apartment_agree_with_yourdfpy(data):
    path = data / "maps/urdf_maps/iai_apartment/apartment.urdf"
    apartment = load_map(path)
    rng = np.random.default_rng(3)
    movable = [joint for joint in apartment.joints.values() if joint.is_movable and joint.mimic is None]
    states = {joint.name: float(rng.uniform(*joint.travel)) for joint in movable}
    ours, theirs = apartment.poses(states), poses_of_yourdfpy(path, states)
    assert (len(apartment.links), len(apartment.joints)) == (117, 116)
    kinds = [joint.kind for joint in apartment.joints.values()]
    assert (kinds.count("revolute"), kinds.count("prismatic")) == (15, 27)
    for name, pose in theirs.items():
        np.testing.assert_allclose(ours[name], pose, atol=1e-12)


@pytest.mark.data
def test_the_example_is_read_whole(data):
    example = load_map(data / "maps/wkmap_example/restroom.wkmap.urdf")
    assert (example.name, example.root, len(example.links), len(example.joints)) == ("floor2_restroom", "map", 13, 12)
    header = example.header
    assert (header.scan_plane_m, header.elevation_m, header.level) == (0.30, 4.20, "2")
    assert (header.survey.epsg, header.survey.east_m) == (32654, 382145.20)
    np.testing.assert_array_equal(example.rooms["restroom_m"].floor, [[0, 2.12], [5, 2.12], [5, 6], [0, 6]])
    assert (example.classes["glass"].p_return, example.classes["glass"].seg) == (0.15, (7,))
    assert example.classes["urinal"].mount == "wall"
    assert example.class_of("window_n").lidar == "glass"
    (hinge,) = example.doors
    assert (hinge.name, hinge.closed, hinge.open, hinge.rest) == ("door_m_hinge", 0.0, 1.5708, 0.0)
    assert hinge.state.prior == {"closed": 0.7, "open": 0.2, "unknown": 0.1}
    (opening,) = example.links["wall_mid"].openings
    assert (opening.along_m, opening.z_m, opening.fill, opening.kind) == ((1.0, 1.9), (0.0, 2.1), "door_m", "door")
    assert example.links["door_m"].connects == ("corridor", "restroom_m")
    # the toilet faces into the room
    np.testing.assert_allclose(example.poses()["toilet_1"][:3, [0, 3]].T, [[-1, 0, 0], [5, 4.9, 0]], atol=1e-7)


def test_a_sliding_door_moves_by_its_state_whatever_the_length_of_its_axis():
    m = model(door(kind="prismatic", axis="2 0 0", xyz="1 0 0"))
    np.testing.assert_allclose(m.poses({"d": 0.5})["d_leaf"][:3, 3], [1.5, 0, 0])


def test_a_hinge_about_a_slanted_axis_turns_round_it():
    m = model(door(axis="1 1 1"))
    pose = m.poses({"d": 2 * math.pi / 3})["d_leaf"]
    np.testing.assert_allclose(pose[:3, :3], [[0, 0, 1], [1, 0, 0], [0, 1, 0]], atol=1e-12)


def test_the_second_leaf_follows_the_first_and_rest_is_where_the_map_is_drawn():
    m = model(
        door(more='<wk:state rest="0.25"/>'),
        door("e", lower="-1.5", upper="0", more='<mimic joint="d" multiplier="-2" offset="0.1"/>'),
    )
    turn = {name: math.atan2(pose[1, 0], pose[0, 0]) for name, pose in m.poses().items()}
    assert turn["d_leaf"] == pytest.approx(0.25)
    assert turn["e_leaf"] == pytest.approx(-0.4)
    assert m.door_states("open") == {"d": 1.5}
    turned = m.poses(m.door_states("open"))["e_leaf"]
    assert math.atan2(turned[1, 0], turned[0, 0]) == pytest.approx(-2.9)


def test_joints_that_follow_each_other_have_no_state():
    m = model(door(more='<mimic joint="e"/>'), door("e", more='<mimic joint="d"/>'))
    assert math.isnan(m.joint_state("d", {}))


@pytest.mark.parametrize(("name", "why"), [("dd", "no joint 'dd'"), ("at_w", "it is fixed"), ("e", "it follows 'd'")])
def test_states_of_joints_that_take_none_are_refused(name, why):
    m = model(door(), door("e", more='<mimic joint="d"/>'), wall("w", (0, 0), (1, 0)))
    with pytest.raises(MapError, match=why) as error:
        m.poses({name: 0.1})
    assert "d" in error.value.hint


@pytest.mark.parametrize(
    ("lower", "upper", "closed", "opened"), [("0", "1.5", 0, 1.5), ("-1.5", "0", 0, -1.5), ("0.2", "1", 0.2, 1)]
)
def test_closed_is_as_drawn_and_open_the_far_end(lower, upper, closed, opened):
    joint = model(door(lower=lower, upper=upper)).joints["d"]
    assert (joint.closed, joint.open) == (closed, opened)


def test_what_hangs_on_nothing_has_no_place():
    m = model(box("lost", "1 1 1"), wall("w", (0, 0), (1, 0)))
    assert set(m.poses()) == {"map", "w"}
    assert m.roots == ("map", "lost")


def test_a_link_of_two_parents_stands_once_and_a_circle_ends():
    m = model(box("a", "1 1 1"), placed("a", "1 0 0"), placed("a", "2 0 0").replace("at_a", "k"))
    assert m.poses()["a"][0, 3] == 1
    joints = placed("a", "0 0 0", parent="b") + placed("b", "0 0 0", parent="a")
    circle = model(box("a", "1 1 1"), box("b", "1 1 1"), joints)
    assert list(circle.poses()) == ["map"]
    assert set(circle.subtree("a")) == {"a", "b"}


def test_five_thousand_links_have_five_thousand_poses():
    assert len(read_map(parse(many_walls(5000))).poses()) == 5001


# ---------------------------------------------------------------------------------------------- reading


@pytest.mark.parametrize("text", ["1", "+1.", "-.5", "1e3", "1.5E-2", " 2 "])
def test_numbers_are_what_python_reads_in_them(text):
    assert number_from_text(text) == float(text)


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("1_0", "malformed"),
        ("１", "malformed"),
        ("0x10", "malformed"),
        ("1e", "malformed"),
        ("--1", "malformed"),
        ("nan", "not-finite"),
        ("-Inf", "not-finite"),
        ("1,5", "comma"),
        ("100mm", "unit"),
        ("90°", "unit"),
        ("1000001", "too-large"),
        ("1e999", "too-large"),
        ("", "count"),
        ("1 2", "count"),
    ],
)
def test_all_else_is_no_number_and_told_why(text, what):
    assert number_from_text(text) is None
    assert trouble_in(text, 1).what == what


def test_units_and_commas_are_worked_in():
    assert trouble_in("100mm 2 3ft", 3).repaired == "0.1 2 0.9144"
    assert trouble_in("90deg", 1).repaired == "1.57079633"
    assert trouble_in("1,2, 3", 3).repaired == "1 2 3"
    assert trouble_in("1mm x", 2).repaired == ""
    assert numbers_from_text("1 2 3", 3) == (1, 2, 3)


def test_what_cannot_be_read_is_nan_and_never_a_default():
    m = model(
        '<link name="a"><collision><origin xyz="1 2"/><geometry><box size="1 x 1"/></geometry></collision></link>',
        placed("a", "0 0 0", "0 0 ninety"),
    )
    (shape,) = m.links["a"].shapes
    assert np.isnan(shape.size).all()
    assert np.isnan(shape.T_link_shape).all()
    assert np.isnan(m.poses()["a"]).any()


def test_plain_urdf_gets_its_classes_from_names_and_says_so():
    m = model('<link name="mirror_left"/>', '<link name="wall_door"><wk:object class="partition"/></link>')
    assert (m.links["mirror_left"].class_name, m.links["mirror_left"].class_is_inferred) == ("mirror", True)
    assert (m.links["wall_door"].class_name, m.links["wall_door"].class_is_inferred) == ("partition", False)
    assert m.header.element is None
    assert "toilet" in m.classes


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("wall_n", "wall"),
        ("WallNorth2", "wall"),
        ("toilet_door", "door"),
        ("cabinet3_door_left", "furniture"),
        ("wall_coloksu_wall1", "wall"),
        ("WC1", "toilet"),
        ("side_A", None),
        ("wallpaper", None),
    ],
)
def test_the_last_known_word_of_a_name_is_its_class(name, expected):
    assert class_from_name(name) == expected


def test_meshes_lie_in_the_folder_of_the_map_or_nowhere(tmp_path):
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes/a.stl").write_text("solid")
    inside = mesh_file("meshes/a.stl", tmp_path)
    assert inside.is_on_disk()
    assert not mesh_file("meshes/b.stl", tmp_path).is_on_disk()
    for name in ("package://p/a.stl", "file:///a", "https://a/b", "/etc/passwd", "../a.stl", "meshes/../../a.stl", ""):
        refused = mesh_file(name, tmp_path)
        assert refused.path is None
        assert refused.problem
        assert not refused.is_on_disk()


@pytest.mark.parametrize(
    ("text", "prior"),
    [
        ("closed:0.7 open:0.3", {"closed": 0.7, "open": 0.3}),
        ("", {}),
        ("closed=1", None),
        ("a:1 a:0", None),
        ("a:b", None),
    ],
)
def test_priors_are_names_with_probabilities(text, prior):
    assert prior_from_text(text) == prior


def test_loading_an_unsound_map_names_the_first_error_with_its_place(tmp_path):
    path = tmp_path / "a.urdf"
    path.write_bytes(robot('<link name="a"/>', '<link name="a"/>', placed("a", "0 0 0")))
    with pytest.raises(MapError, match="WK-G001") as error:
        load_map(path)
    assert error.value.where == f"{path}:4:13"
    path.write_bytes(b"<robot")
    with pytest.raises(MapError, match="WK-X001"):
        load_map(path)
    with pytest.raises(MapError, match="cannot read"):
        load_map(tmp_path / "none.urdf")
