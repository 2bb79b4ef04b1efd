"""Rigid transforms: group laws, matrices as oracle, time that keeps its nanoseconds."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wallkit.core.geometry import (
    compose,
    interpolate_poses,
    invert,
    invert_matrix,
    matrix_from_pose,
    matrix_from_quaternion,
    pose_from_matrix,
    relative,
    transform_points,
    wrap_angle,
    yaw_from_quaternion,
)

lengths = st.floats(-50, 50)
poses = st.tuples(lengths, lengths, st.floats(-7, 7)).map(np.array)


def assert_same_pose(a, b):
    np.testing.assert_allclose(a[..., :2], b[..., :2], atol=1e-9)
    np.testing.assert_allclose(wrap_angle(a[..., 2] - b[..., 2]), 0, atol=1e-9)


@given(poses, poses, poses)
def test_planar_poses_form_a_group(a, b, c):
    assert_same_pose(compose(compose(a, b), c), compose(a, compose(b, c)))
    assert_same_pose(compose(a, invert(a)), np.zeros(3))
    assert_same_pose(invert(invert(a)), a)
    assert_same_pose(compose(a, relative(a, b)), b)


@given(poses, poses)
def test_composing_is_what_matrices_do_for_one_pose_and_for_many(a, b):
    product = pose_from_matrix(matrix_from_pose(a) @ matrix_from_pose(b))
    assert_same_pose(compose(a, b), product)
    assert_same_pose(compose(np.stack([a, a]), b)[1], product)
    assert_same_pose(invert(np.stack([a, b]))[1], invert(b))


@given(poses, poses)
def test_points_move_as_poses_do(a, b):
    point = transform_points(a, b[None, :2])[0]
    np.testing.assert_allclose(point, compose(a, b)[:2], atol=1e-9)


@given(st.floats(-1e3, 1e3))
def test_wrapped_angles_are_the_same_direction_within_half_a_turn(angle):
    wrapped = float(wrap_angle(angle))
    assert abs(wrapped) <= np.pi + 1e-12
    assert np.isclose(np.cos(wrapped), np.cos(angle), atol=1e-9)
    assert np.isclose(np.sin(wrapped), np.sin(angle), atol=1e-9)


@given(st.floats(-3.1, 3.1), st.floats(0.1, 10))
def test_a_quaternion_of_any_length_is_its_rotation(yaw, length):
    q = length * np.array([0, 0, np.sin(yaw / 2), np.cos(yaw / 2)])
    matrix = matrix_from_quaternion([1, 2, 3], q)
    np.testing.assert_allclose(matrix[:2, :2], matrix_from_pose([0, 0, yaw])[:2, :2], atol=1e-12)
    np.testing.assert_allclose(matrix @ invert_matrix(matrix), np.eye(4), atol=1e-12)
    assert np.isclose(yaw_from_quaternion(q / length), yaw)


@pytest.mark.parametrize("bad", [[0, 0, 0, 0], [np.nan, 0, 0, 1], [np.inf, 0, 0, 1]])
def test_no_rotation_is_refused(bad):
    with pytest.raises(ValueError, match="not a rotation"):
        matrix_from_quaternion([0, 0, 0], bad)


def test_interpolation_keeps_nanoseconds_and_takes_the_shorter_turn():
    start = 1_700_000_000_000_000_001
    stamps = np.array([start, start + 1000, start + 2000])
    track = np.array([[0, 0, 3.0], [1, 0, -3.0], [3, 0, -2.0]])
    found = interpolate_poses(stamps, track, [start + 250, start + 1500, start - 5, start + 9999])
    np.testing.assert_allclose(found[:, 0], [0.25, 2.0, 0.0, 3.0], atol=1e-12)
    assert abs(found[0, 2]) > 3.0
    np.testing.assert_allclose(found[1], [2.0, 0.0, -2.5], atol=1e-12)
