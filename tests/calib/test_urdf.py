"""URDF in and out: the transform with its direction, the mistakes of such files, and an edit of twelve numbers only."""

from __future__ import annotations

import numpy as np
import pytest

from wallkit.calib.extrinsics.rigid import matrix_from_rpy
from wallkit.calib.files.from_urdf import place_words, transform_from_urdf
from wallkit.calib.files.urdf_origin import joints_of, with_calibration
from wallkit.errors import CalibrationError

ROBOT = """<?xml version="1.0"?>
<!-- a comment with <joint name="laser_joint"> in it -->
<robot name="r">
  <link name="base_link"/><link name="mast"/><link name="laser"/>
  <link name="camera_link"/><link name="camera_optical"/>
  <joint name="mast_joint" type="fixed">
    <parent link="base_link"/><child link="mast"/>
    <origin rpy='0 0 0.1'  xyz='0.10 0 0.20'/>
  </joint>
  <joint name='laser_joint' type="fixed">
    <parent link="mast"/>
    <child link="laser"/>
  </joint>
  <joint name="camera_joint" type="fixed">
    <origin xyz="0.12 0.02 0.30"
            rpy="0 0.05 0"/>
    <parent link="base_link"/><child link="camera_link"/>
  </joint>
  <joint name="optical_joint" type="fixed">
    <origin xyz="0 0 0" rpy="-1.5707963267949 0 -1.5707963267949"/>
    <parent link="camera_link"/><child link="camera_optical"/>
  </joint>
</robot>
"""


@pytest.fixture
def robot(tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_text(ROBOT)
    return path


def test_direction_by_hand(robot):
    """A LiDAR point one metre ahead of the mast, followed through the joints by hand."""
    found = transform_from_urdf(robot, "laser", "camera_optical")
    base = matrix_from_rpy((0.10, 0, 0.20), (0, 0, 0.1)) @ [1.0, 0.2, 0.0, 1.0]
    camera = matrix_from_rpy((0.12, 0.02, 0.30), (0, 0.05, 0)) @ matrix_from_rpy((0, 0, 0), (-np.pi / 2, 0, -np.pi / 2))
    np.testing.assert_allclose(found.T @ [1.0, 0.2, 0.0, 1.0], np.linalg.inv(camera) @ base, atol=1e-9)
    assert found.chain == ("optical_joint", "camera_joint", "mast_joint", "laser_joint")
    assert found.warnings == ()
    assert "its x axis points forward and its z axis points up" in place_words(found.T)


def test_a_body_frame_is_no_optical_frame(robot):
    with pytest.raises(CalibrationError, match="no optical frame") as error:
        transform_from_urdf(robot, "laser", "camera_link")
    assert "camera_optical" in error.value.hint
    assert transform_from_urdf(robot, "laser", "camera_link", any_axis=True).warnings


def test_unknown_links_and_broken_files(robot, tmp_path):
    with pytest.raises(CalibrationError, match="no link 'lazer'") as error:
        transform_from_urdf(robot, "lazer", "camera_optical")
    assert "laser" in error.value.hint
    broken = tmp_path / "broken.urdf"
    broken.write_text("<robot><link>")
    with pytest.raises(CalibrationError, match="not a URDF"):
        transform_from_urdf(broken, "laser", "camera_optical")


@pytest.mark.data
def test_xacro_left_in_a_real_robot_is_reported(data):
    robots = data / "maps" / "urdf_robots"
    with pytest.raises(CalibrationError, match="no link 'base_scan'") as error:
        transform_from_urdf(robots / "turtlebot3_burger.urdf", "base_scan", "base_link")
    assert "never expanded" in error.value.hint
    assert "--arg namespace=" in error.value.hint
    found = transform_from_urdf(
        robots / "turtlebot3_waffle_pi.urdf", "base_scan", "camera_rgb_optical_frame", arguments={"namespace": ""}
    )
    np.testing.assert_allclose(found.T[:3, :3] @ [1, 0, 0], [0, 0, 1], atol=2e-3)


@pytest.mark.parametrize("joint", ["", "laser_joint", "mast_joint"])
def test_written_back_and_read_again(robot, tmp_path, joint):
    T = transform_from_urdf(robot, "laser", "camera_optical").T @ matrix_from_rpy(
        (0.01, -0.02, 0.03), (0.02, -0.01, 0.3)
    )
    edited, before = with_calibration(robot.read_bytes(), T, "laser", "camera_optical", joint=joint)
    out = tmp_path / "edited.urdf"
    out.write_bytes(edited)
    np.testing.assert_allclose(transform_from_urdf(out, "laser", "camera_optical").T, T, atol=3e-6)
    assert before.name == (joint or "laser_joint")


def test_no_other_byte_changes(robot):
    data = robot.read_bytes().replace(b"\n", b"\r\n")
    T = transform_from_urdf(robot, "laser", "camera_optical").T
    edited, before = with_calibration(data, T, "laser", "camera_optical", joint="mast_joint")
    begin, end = before.origin
    assert edited[:begin] == data[:begin]
    assert edited[len(edited) - (len(data) - end) :] == data[end:]
    assert edited[begin:].startswith(b"<origin rpy='0.000000 0.000000 0.100000'  xyz='0.100000 0.000000 0.200000'/>")
    inserted, before = with_calibration(data, T, "laser", "camera_optical", joint="laser_joint")
    at = before.tag[1]
    added = len(inserted) - len(data)
    assert inserted[:at] == data[:at]
    assert inserted[at + added :] == data[at:]
    assert inserted[at : at + added].startswith(b"\r\n    <origin ")


def test_a_joint_that_moves_the_camera_is_refused(robot):
    with pytest.raises(CalibrationError, match="does not move the LiDAR alone") as error:
        with_calibration(robot.read_bytes(), np.eye(4), "laser", "camera_optical", joint="camera_joint")
    assert "laser_joint, mast_joint" in error.value.hint


def test_joints_are_read_with_their_bytes(robot):
    joints = {j.name: j for j in joints_of(robot.read_bytes())}
    assert joints["laser_joint"].origin is None
    assert joints["camera_joint"].rpy == (0.0, 0.05, 0.0)
    assert robot.read_bytes()[slice(*joints["laser_joint"].tag)] == b"""<joint name='laser_joint' type="fixed">"""
