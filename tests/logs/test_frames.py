"""Transforms compose along any path; the LiDAR's place is found where it is written, and never made up."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.logs.drawn import SECOND_NS, START_NS, drive, log_of, write
from wallkit.core.geometry import compose, invert_matrix, matrix_from_pose, matrix_from_quaternion, pose_from_matrix
from wallkit.core.types import Odometry, Transform
from wallkit.errors import LogError
from wallkit.logs.frames import FrameTree, MovingTransforms, fixed_transforms
from wallkit.logs.mount import find_mount, matrix_from_words, transforms_from_urdf
from wallkit.logs.reader import open_log
from wallkit.logs.rig import Wanted, find_rig

numbers = st.floats(-3, 3)
matrices = st.tuples(numbers, numbers, numbers).map(matrix_from_pose)


def link(parent, child, matrix, stamp_ns=START_NS, *, is_static=False):
    return Transform(stamp_ns, parent, child, matrix, is_static)


@given(st.lists(matrices, min_size=5, max_size=5))
def test_a_tree_composes_and_inverts(ms):
    tree = FrameTree(
        [link("base", "a", ms[0]), link("a", "b", ms[1]), link("base", "c", ms[2]), link("c", "lidar", ms[3])]
    )
    np.testing.assert_allclose(tree.lookup("base", "b"), ms[0] @ ms[1], atol=1e-12)
    np.testing.assert_allclose(tree.lookup("b", "lidar"), invert_matrix(ms[0] @ ms[1]) @ ms[2] @ ms[3], atol=1e-9)
    np.testing.assert_allclose(tree.lookup("lidar", "b") @ tree.lookup("b", "lidar"), np.eye(4), atol=1e-9)
    np.testing.assert_array_equal(tree.lookup("a", "a"), np.eye(4))


def test_frames_that_are_not_connected_are_said():
    tree = FrameTree([link("base", "a", np.eye(4)), link("x", "y", np.eye(4))])
    with pytest.raises(LogError, match=r"between frames 'base' and 'y'(.|\n)*known frames: a, base, x, y"):
        tree.lookup("base", "y")
    assert FrameTree([]).find("base", "lidar") is None


def test_moving_transforms_are_interpolated_and_joined():
    stamps = np.array([0, 10, 20]) * SECOND_NS
    forward = np.array([[0, 0, 0], [1, 0, 0.5], [2, 0, 1.0]])
    correction = np.array([[5, 5, np.pi / 2]] * 3)
    moving = MovingTransforms({("map", "odom"): (stamps, correction), ("odom", "base"): (stamps, forward)})
    at = np.array([5, 15]) * SECOND_NS
    expected = compose(correction[:2], np.array([[0.5, 0, 0.25], [1.5, 0, 0.75]]))
    np.testing.assert_allclose(moving.poses_at("map", "base", at), expected, atol=1e-12)
    np.testing.assert_allclose(compose(moving.poses_at("base", "map", at), expected), np.zeros((2, 3)), atol=1e-12)
    with pytest.raises(LogError, match="not recorded at all of the wanted times"):
        moving.poses_at("map", "base", np.array([25 * SECOND_NS]))
    with pytest.raises(LogError, match="known transforms: map->odom, odom->base"):
        moving.poses_at("map", "lidar", at)


DRIVE = [m for m in log_of(drive(), seconds=1) if m[1] != "/tf_static"]
MOUNT = matrix_from_words("0.1,-0.2,0.3,0.05,-0.1,1.5")
URDF = """<robot name="r"><link name="base_link"/><link name="mast"/><link name="laser"/>
<joint name="a" type="fixed"><parent link="base_link"/><child link="mast"/><origin xyz="0 0 0.3"/></joint>
<joint name="b" type="revolute"><parent link="mast"/><child link="laser"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/><origin xyz="0.1 -0.2 0" rpy="0.05 -0.1 1.5"/></joint></robot>"""


def log_with(tmp_path, *messages):
    return open_log([write(tmp_path / "log.mcap", [*messages, *DRIVE])])


def test_the_mount_from_tf_static(tmp_path):
    rig = find_rig(log_with(tmp_path, (START_NS, "/tf_static", (link("base_link", "laser", MOUNT, is_static=True),))))
    np.testing.assert_allclose(rig.mount.matrix, MOUNT, atol=1e-12)
    assert (rig.base_frame, rig.lidar_frame, rig.mount.source) == ("base_link", "laser", "/tf_static")


def test_the_mount_from_transforms_that_are_repeated_and_never_change(tmp_path):
    repeated = [(START_NS + k, "/tf", (link("base_link", "laser", MOUNT, START_NS + k),)) for k in range(3)]
    moving = [
        (START_NS + k, "/tf", (link("odom", "base_link", matrix_from_pose([k, 0, 0]), START_NS + k),)) for k in range(3)
    ]
    log = log_with(tmp_path, *repeated, *moving)
    assert [(t.parent, t.child) for t in fixed_transforms(log, ["/tf"])] == [("base_link", "laser")]
    rig = find_rig(log)
    np.testing.assert_allclose(rig.mount.matrix, MOUNT, atol=1e-12)
    assert rig.mount.source == "/tf"


def test_a_mount_that_moves_is_none(tmp_path):
    turning = [
        (START_NS + k, "/tf", (link("base_link", "laser", matrix_from_pose([0, 0, k]), START_NS + k),))
        for k in range(3)
    ]
    with pytest.raises(LogError, match="nothing tells where the LiDAR 'laser' sits on the robot 'base_link'"):
        find_rig(log_with(tmp_path, *turning))


def test_the_mount_from_a_robot_description(tmp_path):
    rig = find_rig(log_with(tmp_path, (START_NS, "/robot_description", URDF)))
    np.testing.assert_allclose(rig.mount.matrix, MOUNT, atol=1e-9)
    assert rig.mount.source == "/robot_description"

    path = tmp_path / "robot.urdf"
    path.write_text(URDF)
    rig = find_rig(log_with(tmp_path), Wanted(urdf=path))
    np.testing.assert_allclose(rig.mount.matrix, MOUNT, atol=1e-9)
    assert rig.mount.source == str(path)


def test_no_mount_is_an_error_with_the_way_out(tmp_path):
    with pytest.raises(LogError, match=r"--lidar-pose X,Y,YAW"):
        find_rig(log_with(tmp_path))
    rig = find_rig(log_with(tmp_path), Wanted(lidar_pose="0.2,0,0.5"))
    np.testing.assert_allclose(pose_from_matrix(rig.mount.matrix), [0.2, 0, 0.5])


def test_scans_in_the_base_frame_need_no_transform(tmp_path):
    log = log_with(tmp_path)
    np.testing.assert_array_equal(find_mount(log, "laser", "laser").matrix, np.eye(4))


def test_odometry_without_a_moving_frame(tmp_path):
    nameless = [(s, t, Odometry(s, v.pose, "odom", "") if t == "/odom" else v) for s, t, v in DRIVE]
    static = (START_NS, "/tf_static", (link("base", "laser", MOUNT, is_static=True),))
    log = open_log([write(tmp_path / "log.mcap", [static, *nameless])])
    with pytest.raises(LogError, match="child_frame_id is empty"):
        find_rig(log)
    np.testing.assert_allclose(find_rig(log, Wanted(base_frame="base")).mount.matrix, MOUNT, atol=1e-12)


def test_leading_slashes_are_no_part_of_a_name(tmp_path):
    slashed = [(s, t, Odometry(s, v.pose, "/odom", "/base_link") if t == "/odom" else v) for s, t, v in DRIVE]
    static = (START_NS, "/tf_static", (link("/base_link", "/laser", MOUNT, is_static=True),))
    rig = find_rig(open_log([write(tmp_path / "log.mcap", [static, *slashed])]))
    assert (rig.base_frame, rig.lidar_frame) == ("base_link", "laser")


@given(st.tuples(*[st.floats(-3, 3)] * 6))
def test_words_are_a_pose_with_angles_about_fixed_axes(numbers):
    x, y, z, roll, pitch, yaw = numbers
    found = matrix_from_words(",".join(map(repr, numbers)))

    def about(axis, angle):
        q = np.zeros(4)
        q[axis], q[3] = np.sin(angle / 2), np.cos(angle / 2)
        return matrix_from_quaternion((0, 0, 0), q)

    expected = about(2, yaw) @ about(1, pitch) @ about(0, roll)
    expected[:3, 3] = x, y, z
    np.testing.assert_allclose(found, expected, atol=1e-12)


@pytest.mark.parametrize("words", ["", "1,2", "a,b,c", "1,2,3,4", "nan,0,0", "0,0,inf"])
def test_words_that_are_no_pose(words):
    with pytest.raises(LogError, match="is no pose"):
        matrix_from_words(words)


@pytest.mark.parametrize("text", ["", "no xml", "<a/>", "<robot", "<robot name='r'><joint name='j'/></robot>"])
def test_what_is_no_urdf_is_said(text):
    with pytest.raises(LogError, match="xacro"):
        transforms_from_urdf(text, "here")
