"""From nothing to the truth: starts, minima, priors, and intervals that hold the truth as often as they say."""

from __future__ import annotations

import numpy as np
import pytest

from wallkit.calib.extrinsics.covariance import quantiles, spread_of
from wallkit.calib.extrinsics.coverage import coverage
from wallkit.calib.extrinsics.rigid import (
    angle_between,
    left_jacobian,
    matrix_from_rpy,
    rotation_from_vector,
    rpy_from_matrix,
)
from wallkit.calib.extrinsics.sightings import problem_from_sightings
from wallkit.calib.extrinsics.solver import basis_at, difference, fit, prior_along
from wallkit.calib.extrinsics.starts import first_guesses
from wallkit.calib.extrinsics.worlds import World, draw_sightings, mounting


@pytest.mark.parametrize("planar", [True, False])
@pytest.mark.parametrize("seed", range(4))
def test_finds_the_transform_from_nothing(planar, seed):
    rng = np.random.default_rng(seed)
    T = mounting(rng)
    # a LiDAR mounted in any orientation is no harder than an upright one
    spin = np.eye(4)
    spin[:3, :3] = rotation_from_vector(rng.normal(0, 1.5, 3))
    problem = problem_from_sightings(draw_sightings(rng, World(is_planar=planar), T, 14))
    turned = problem.__class__(
        problem.points @ spin[:3, :3], *(getattr(problem, n) for n in list(problem.__dataclass_fields__)[1:])
    )
    found = min((fit(turned, guess, rounds=4) for guess in first_guesses(turned)), key=lambda f: f.cost)
    truth = T @ spin
    assert np.degrees(angle_between(found.T, truth)) < 1.2
    assert np.linalg.norm(found.T[:3, 3] - truth[:3, 3]) < 0.02


@pytest.mark.parametrize("planar", [True, False])
def test_without_noise_the_truth_is_exact(planar):
    rng = np.random.default_rng(2)
    T = mounting(rng)
    world = World(is_planar=planar, sigma_range_m=1e-9, sigma_px=1e-7)
    problem = problem_from_sightings(draw_sightings(rng, world, T, 12))
    start = T.copy()
    start[:3, :3] = rotation_from_vector([0.1, -0.1, 0.2]) @ T[:3, :3]
    start[:3, 3] += 0.1
    found = fit(problem, start)
    assert angle_between(found.T, T) < 1e-5
    np.testing.assert_allclose(found.T, T, atol=1e-5)


def test_many_guesses_one_answer():
    rng = np.random.default_rng(3)
    T = mounting(rng)
    problem = problem_from_sightings(draw_sightings(rng, World(is_planar=False), T, 15))
    answer = fit(problem, T).T
    for _ in range(20):
        start = T.copy()
        start[:3, :3] = rotation_from_vector(rng.normal(0, 0.4, 3)) @ T[:3, :3]
        start[:3, 3] += rng.normal(0, 0.3, 3)
        found = fit(problem, start).T
        assert np.degrees(angle_between(found, answer)) < 0.001
        assert np.linalg.norm(found[:3, 3] - answer[:3, 3]) < 1e-5


def test_a_prior_pulls_only_along_its_directions():
    rng = np.random.default_rng(4)
    T = mounting(rng)
    problem = problem_from_sightings(draw_sightings(rng, World(), T, 20))
    free = fit(problem, T)
    elsewhere = T.copy()
    elsewhere[:3, 3] += T[:3, 2] * 0.5  # half a metre up along the LiDAR's z
    up = np.eye(6)[:, 5:]
    tight = fit(problem, T, prior=prior_along(elsewhere, up, turn_rad=1e-6, shift_m=1e-6))
    assert difference(elsewhere, tight.T)[5] == pytest.approx(0.0, abs=1e-4)
    loose = fit(problem, T, prior=prior_along(elsewhere, up, turn_rad=1e3, shift_m=1e3))
    np.testing.assert_allclose(loose.T, free.T, atol=1e-7)


def test_a_basis_keeps_what_it_does_not_hold():
    rng = np.random.default_rng(5)
    T = mounting(rng)
    problem = problem_from_sightings(draw_sightings(rng, World(), T, 12))
    found = fit(problem, T, basis=np.eye(6)[:, 2:5])
    off = difference(T, found.T)
    np.testing.assert_allclose(off[[0, 1, 5]], 0.0, atol=1e-12)
    assert np.abs(off[[2, 3, 4]]).max() > 1e-5


def test_basis_follows_the_motion():
    rng = np.random.default_rng(6)
    basis, x, d = rng.normal(size=(6, 3)), rng.normal(0, 0.5, 3), 1e-6 * rng.normal(size=3)

    def turn(y):
        return rotation_from_vector(basis[:3] @ y)

    extra = rotation_from_vector(basis_at(basis, x)[:3] @ d)
    np.testing.assert_allclose(turn(x + d), turn(x) @ extra, atol=1e-11)


def test_left_jacobian_and_angles():
    rng = np.random.default_rng(7)
    w, d = rng.normal(size=3), 1e-6 * rng.normal(size=3)
    np.testing.assert_allclose(
        rotation_from_vector(w + d), rotation_from_vector(left_jacobian(w) @ d) @ rotation_from_vector(w), atol=1e-11
    )
    for rpy in ([0.1, -0.4, 2.0], [3.0, 1.5, -3.0], [0.3, np.pi / 2, 0.0], [-2.0, -np.pi / 2, 0.0]):
        T = matrix_from_rpy([1, 2, 3], rpy)
        np.testing.assert_allclose(matrix_from_rpy(T[:3, 3], rpy_from_matrix(T)), T, atol=1e-9)


def test_small_sample_correction_of_a_mean():
    """One unknown seen once by each of G equal views is a mean: CR2 must give s^2 / G with G - 1 degrees of freedom."""
    rng = np.random.default_rng(8)
    values = rng.normal(size=7)
    rows, left = np.ones((7, 1, 1)), (values - values.mean())[:, None]
    spread = spread_of(rows, left)
    assert spread.sigmas[0] == pytest.approx(values.std(ddof=1) / np.sqrt(7))
    assert spread.degrees[0] == pytest.approx(6.0)
    assert quantiles(np.array([6.0, np.inf])) == pytest.approx([2.4469, 1.9600], abs=1e-4)


def test_few_views_say_what_the_noise_promises_or_more():
    rows = np.ones((2, 1, 1))
    assert spread_of(rows, np.zeros((2, 1))).sigmas[0] == pytest.approx(np.sqrt(0.5))
    assert spread_of(rows, np.full((2, 1), 5.0)).sigmas[0] > 3


@pytest.mark.long
@pytest.mark.parametrize(
    ("planar", "views", "excess"),
    [(True, 12, 1.0), (True, 20, 2.0), (True, 40, 1.0), (False, 12, 2.0), (False, 20, 1.0), (False, 40, 2.0)],
)
def test_intervals_hold_the_truth(planar, views, excess):
    """Of each axis, of all six at once and of two solves, in 60 worlds: 92 to 98 %, give or take three standard errors
    (3.5 and 1.8 %); `wallkit bench covariance` runs 500."""
    found = coverage(World(is_planar=planar, excess=excess), views, 60)
    assert found.is_honest, found
    if excess > 1:
        assert found.predicted.mean() < found.covered.mean() - 0.04
    else:
        # a chi-square of six over 60 worlds: 5 to 7, give or take two standard errors of sqrt(12 / 60)
        assert 4.1 < found.squared < 7.9, found


def test_textbook_covariance_would_fail():
    """The negative control: over points, the truth is outside far more often than the test above allows."""
    found = coverage(World(is_planar=False, excess=2.0), 12, 40)
    assert found.naive.min() < 0.75
