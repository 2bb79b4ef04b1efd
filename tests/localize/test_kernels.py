"""Every kernel against its formula in plain NumPy, and against geometry."""

from __future__ import annotations

import numpy as np
import pytest

from tests.localize.worlds import FLAT, NOBODY, fields_of
from tests.plan import cast
from wallkit.core.geometry import compose
from wallkit.core.grid import BORDER, bordered, cells_from_points, placed
from wallkit.core.raycast import cast_rays
from wallkit.core.types import FieldSet
from wallkit.localize.kernels import (
    in_threads,
    rotate_drive_rotate,
    sum_of_double_mixtures,
    sum_of_field,
    sum_of_mixtures,
)


@pytest.fixture(scope="module")
def scene():
    """Random field, poses (some partly off the map) and beams; origin turned and shifted."""
    rng = np.random.default_rng(5)
    distances = rng.random((40, 60)).astype(np.float32) * 3
    fields = FieldSet({"all": distances}, np.ones((40, 60), bool), 0.1, np.array([-2.0, 1.0, 0.7]))
    poses = np.column_stack([rng.uniform(-4, 4, 200), rng.uniform(-1, 7, 200), rng.uniform(-4, 4, 200)])
    points = rng.uniform(-3, 3, (33, 2))
    return fields, poses, points, rng


def looked_up(fields, field, poses, points):
    """The oracle: values (N, K) of a field at endpoints, in float64, the nearest cell's beyond the edge."""
    in_map = compose(poses[:, None, :], np.pad(points, ((0, 0), (0, 1)))[None, :, :])[..., :2]
    x0, y0, yaw = fields.origin
    dx, dy = in_map[..., 0] - x0, in_map[..., 1] - y0
    column = np.floor((np.cos(yaw) * dx + np.sin(yaw) * dy) / fields.resolution_m).astype(int)
    row = np.floor((-np.sin(yaw) * dx + np.cos(yaw) * dy) / fields.resolution_m).astype(int)
    height, width = field.shape
    return field[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)].astype(np.float64)


def agree_but_for_edges(got, wanted, tolerance):
    """float32 puts an endpoint on the other side of a cell's edge now and then: at most 1 % of the sums may differ."""
    assert np.mean(np.abs(got - wanted) > tolerance) <= 0.01


def test_sum_of_field_is_the_weighted_sum_of_looked_up_values(scene):
    fields, poses, points, rng = scene
    weights = rng.random(len(points)).astype(np.float32)
    out = np.zeros(len(poses))
    field = fields.distances_m["all"]
    sum_of_field(placed(fields, poses), cells_from_points(fields, points), weights, bordered(field), out)
    agree_but_for_edges(out, looked_up(fields, field, poses, points) @ weights, 1e-3)


def test_sum_of_mixtures_is_the_log_of_each_beams_mixture(scene):
    fields, poses, points, rng = scene
    gains = rng.random(len(points)).astype(np.float32)
    floors = (10.0 ** rng.uniform(-9, 0, len(points))).astype(np.float32)
    out = np.zeros(len(poses))
    field = fields.distances_m["all"]
    sum_of_mixtures(placed(fields, poses), cells_from_points(fields, points), gains, floors, bordered(field), out)
    wanted = np.log(gains * looked_up(fields, field, poses, points) + floors).sum(axis=1)
    agree_but_for_edges(out, wanted, 1e-3)


def test_sum_of_double_mixtures_adds_a_second_field(scene):
    fields, poses, points, rng = scene
    gains, own_gains = rng.random((2, len(points))).astype(np.float32)
    floors = (10.0 ** rng.uniform(-9, 0, len(points))).astype(np.float32)
    field = fields.distances_m["all"]
    own = rng.random(field.shape).astype(np.float32)
    out = np.zeros(len(poses))
    args = (gains, own_gains, floors, bordered(field), bordered(own))
    sum_of_double_mixtures(placed(fields, poses), cells_from_points(fields, points), *args, out)
    seen = gains * looked_up(fields, field, poses, points) + own_gains * looked_up(fields, own, poses, points)
    agree_but_for_edges(out, np.log(seen + floors).sum(axis=1), 1e-3)


@pytest.mark.parametrize("threads", [2, 3])
def test_threads_change_no_bit(scene, threads):
    fields, poses, points, _ = scene
    args = (cells_from_points(fields, points), np.ones(len(points), np.float32), bordered(fields.distances_m["all"]))
    alone, shared = np.zeros(len(poses)), np.zeros(len(poses))
    in_threads(sum_of_field, placed(fields, poses), args, alone, 1)
    in_threads(sum_of_field, placed(fields, poses), args, shared, threads)
    np.testing.assert_array_equal(alone, shared)


def test_rays_end_where_exact_geometry_says():
    fields = fields_of(FLAT, 0.02)
    pose = np.array([[3.3, 2.2, 0.4]])
    bearings = np.linspace(-3.1, 3.1, 200).astype(np.float32)
    out = np.zeros((1, 200), np.float32)
    directions = np.stack([np.cos(bearings), np.sin(bearings)])
    cast_rays(
        placed(fields, pose, border=0), directions, fields.distances_m["all"], np.float32(50), np.float32(600), out
    )
    exact = cast(FLAT, NOBODY, pose[0, :2], pose[0, 2] + bearings.astype(np.float64), 12.0)
    off = np.abs(out[0] * 0.02 - exact)
    # a wall cell is entered at most its diagonal before its centre line; grazing rays may differ by more
    assert np.median(off) < 0.03
    assert np.mean(off < 0.15) > 0.97


def test_a_ray_into_the_unknown_ends_at_its_reach():
    open_field = np.full((50, 50), 4.0, np.float32)
    fields = FieldSet({"all": open_field}, np.ones((50, 50), bool), 0.1, np.zeros(3))
    out = np.zeros((1, 1), np.float32)
    direction = np.array([[1.0], [0.0]], np.float32)
    cast_rays(
        placed(fields, np.array([[2.5, 2.5, 0.0]]), border=0),
        direction,
        open_field,
        np.float32(10),
        np.float32(77),
        out,
    )
    assert out[0, 0] == 77


def test_placed_poses_are_the_planar_transform(scene):
    fields, poses, _, _ = scene
    out = placed(fields, poses)
    x0, y0, yaw = fields.origin
    dx, dy = poses[:, 0] - x0, poses[:, 1] - y0
    np.testing.assert_allclose(out[0], np.cos(poses[:, 2] - yaw), atol=1e-6)
    np.testing.assert_allclose(out[2], (np.cos(yaw) * dx + np.sin(yaw) * dy) / 0.1 + BORDER, atol=1e-4)
    np.testing.assert_allclose(out[3], (-np.sin(yaw) * dx + np.cos(yaw) * dy) / 0.1 + BORDER, atol=1e-4)


def test_rotate_drive_rotate_without_noise_is_composition():
    poses = np.array([[1.0, 2.0, 0.5], [0.0, 0.0, -3.0]])
    out = np.zeros_like(poses)
    rotate_drive_rotate(poses, np.zeros((3, 2), np.float32), np.array([0.3, 2.0, -0.1]), np.zeros(3), out)
    step = np.array([2.0 * np.cos(0.3), 2.0 * np.sin(0.3), 0.2])
    np.testing.assert_allclose(out, compose(poses, step), atol=1e-12)
