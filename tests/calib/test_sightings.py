"""The rows that every solver is built on: exact compression, Jacobians, and whitening against brute force."""

from __future__ import annotations

import numpy as np
import pytest

from wallkit.calib.extrinsics.rigid import rotation_from_vector
from wallkit.calib.extrinsics.sightings import (
    BoardPose,
    jacobian,
    plane_distances,
    plane_sighting,
    problem_from_sightings,
    residuals,
    whiteners,
)
from wallkit.calib.extrinsics.worlds import World, draw_sightings, mounting


def scene(*, planar=True, seed=0, count=6):
    rng = np.random.default_rng(seed)
    T = mounting(rng)
    return T, draw_sightings(rng, World(is_planar=planar), T, count)


def moved(T, step):
    out = T.copy()
    out[:3, :3] = rotation_from_vector(step[:3]) @ T[:3, :3]
    out[:3, 3] += step[3:]
    return out


@pytest.mark.parametrize("planar", [True, False])
def test_few_rows_say_the_same_as_all_points(planar):
    """What is left out is exactly the spread of the points off their own plane or line, seen along the board's normal."""
    T, sightings = scene(planar=planar)
    problem = problem_from_sightings(sightings)
    assert problem.points.shape[1] == (2 if planar else 3)
    for sighting, rows in zip(sightings, residuals(problem, T), strict=True):
        face, points = sighting.faces[0], sighting.points_m
        _, spread, axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
        off = (spread * (axes @ T[:3, :3].T @ sighting.board.normal))[face.directions :]
        whole = (plane_distances(sighting, T) ** 2).sum()
        assert (rows**2).sum() * face.sigma_m**2 + (off**2).sum() == pytest.approx(whole, rel=1e-9)


@pytest.mark.parametrize("planar", [True, False])
def test_jacobian_is_the_derivative(planar):
    T, sightings = scene(planar=planar)
    problem = problem_from_sightings(sightings)
    analytic = jacobian(problem, T)
    for axis, step in enumerate(1e-6 * np.eye(6)):
        numeric = (residuals(problem, moved(T, step)) - residuals(problem, moved(T, -step))) / 2e-6
        np.testing.assert_allclose(analytic[..., axis], numeric, rtol=1e-5, atol=1e-3)


def test_whitened_rows_are_independent_with_unit_variance():
    """Monte Carlo over range noise and board-pose errors of one view."""
    rng = np.random.default_rng(1)
    T = mounting(rng)
    world = World(is_planar=False, sigma_px=1.0)
    clean = draw_sightings(rng, world, T, 1)[0]
    true_pose = clean.board.T_camera_board
    directions = clean.points_m / np.linalg.norm(clean.points_m, axis=1, keepdims=True)
    # put the points exactly on the measured plane, then disturb both
    normal, distance = clean.board.normal, clean.board.distance_m
    ranges = (distance - normal @ T[:3, 3]) / (directions @ T[:3, :3].T @ normal)
    root = np.linalg.cholesky(clean.board.covariance)
    drawn = []
    for _ in range(1500):
        noisy = directions * (ranges + rng.normal(0, world.sigma_range_m, len(ranges)))[:, None]
        error = root @ rng.normal(size=6)
        board = BoardPose(moved(true_pose, error), clean.board.covariance)
        problem = problem_from_sightings(
            [plane_sighting("", board, noisy, sigma_m=world.sigma_range_m, planar_scan=False)]
        )
        drawn.append(np.einsum("gkj,gj->gk", whiteners(problem, T), residuals(problem, T))[0])
    covariance = np.cov(np.array(drawn).T)
    # the axes of the points swap and flip between draws, so only the total is compared exactly
    assert np.trace(covariance) == pytest.approx(3.0, rel=0.1)
    assert np.abs(np.array(drawn).mean(axis=0)).max() < 0.15


def test_a_scaled_board_is_seen_at_the_same_pixels():
    _, sightings = scene()
    board = sightings[0].board
    assert board.scaled(1.1).distance_m == pytest.approx(1.1 * board.distance_m)
    np.testing.assert_allclose(board.scaled(1.1).normal, board.normal)
