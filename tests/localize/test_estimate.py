"""Clusters and estimators on clouds one can draw."""

from __future__ import annotations

import numpy as np
import pytest

from wallkit.core.geometry import wrap_angle
from wallkit.localize.estimate import ESTIMATORS, find_modes, weighted_moments


def cloud(rng, centre, n, sd=(0.1, 0.1, 0.05)):
    poses = np.asarray(centre) + rng.standard_normal((n, 3)) * sd
    poses[:, 2] = wrap_angle(poses[:, 2])
    return poses


def test_two_clouds_are_two_modes_with_their_shares():
    rng = np.random.default_rng(0)
    poses = np.concatenate([cloud(rng, (0, 0, 0), 300), cloud(rng, (10, 5, 2), 700)])
    modes = find_modes(poses, np.full(1000, 1e-3))
    assert len(modes) == 2
    assert [mode.weight for mode in modes] == pytest.approx([0.7, 0.3], abs=0.01)
    np.testing.assert_allclose(modes[0].pose, [10, 5, 2], atol=0.02)
    np.testing.assert_allclose(np.sqrt(np.diag(modes[0].covariance)), [0.1, 0.1, 0.05], rtol=0.1)


def test_headings_across_the_seam_are_one_mode():
    poses = cloud(np.random.default_rng(1), (1, 1, np.pi), 500)
    (mode,) = find_modes(poses, np.full(500, 1 / 500))
    assert abs(wrap_angle(mode.pose[2] - np.pi)) < 0.02
    assert np.sqrt(mode.covariance[2, 2]) == pytest.approx(0.05, rel=0.1)


def test_same_place_other_heading_is_another_mode():
    rng = np.random.default_rng(2)
    poses = np.concatenate([cloud(rng, (0, 0, 0), 500), cloud(rng, (0, 0, np.pi), 500)])
    assert len(find_modes(poses, np.full(1000, 1e-3))) == 2


def test_a_cloud_over_a_whole_building_is_one_wide_mode():
    rng = np.random.default_rng(3)
    poses = np.column_stack([rng.uniform(0, 500, 5000), rng.uniform(0, 500, 5000), rng.uniform(-3, 3, 5000)])
    modes = find_modes(poses, np.full(5000, 1 / 5000))
    assert np.sqrt(modes[0].covariance[0, 0]) > 100


def test_weights_decide_not_numbers():
    rng = np.random.default_rng(4)
    poses = np.concatenate([cloud(rng, (0, 0, 0), 900), cloud(rng, (4, 0, 0), 100)])
    weights = np.concatenate([np.full(900, 0.1 / 900), np.full(100, 0.9 / 100)])
    assert find_modes(poses, weights)[0].pose[0] == pytest.approx(4, abs=0.05)


def test_order_of_particles_changes_nothing():
    rng = np.random.default_rng(5)
    poses = np.concatenate([cloud(rng, (0, 0, 0), 300), cloud(rng, (6, 5, 2), 700)])
    weights = rng.random(1000)
    weights /= weights.sum()
    shuffled = rng.permutation(1000)
    a, b = find_modes(poses, weights), find_modes(poses[shuffled], weights[shuffled])
    for mode, other in zip(a, b, strict=True):
        np.testing.assert_allclose(mode.pose, other.pose, atol=1e-9)


@pytest.mark.parametrize("name", ESTIMATORS)
def test_every_estimator_answers_the_centre_of_one_cloud(name):
    poses = cloud(np.random.default_rng(6), (2, 3, -3.1), 2000, sd=(0.02, 0.02, 0.01))
    weights = np.exp(-0.5 * (((poses - [2, 3, -3.1]) / 0.02) ** 2).sum(axis=1))
    weights /= weights.sum()
    pose, covariance = ESTIMATORS[name](poses, weights, find_modes(poses, weights))
    np.testing.assert_allclose(pose, [2, 3, -3.1], atol=0.03)
    assert (np.linalg.eigvalsh(covariance) > 0).all()


def test_mean_of_two_rooms_is_in_neither():
    poses = np.array([[0.0, 0, 0], [10.0, 0, 0]])
    weights = np.array([0.5, 0.5])
    pose, _ = ESTIMATORS["mean"](poses, weights, find_modes(poses, weights))
    assert pose[0] == pytest.approx(5)


def test_moments_are_those_of_numpy():
    rng = np.random.default_rng(7)
    poses, weights = rng.normal(0, 0.3, (400, 3)), rng.random(400)
    mean, covariance = weighted_moments(poses, weights)
    np.testing.assert_allclose(mean[:2], np.average(poses[:, :2], axis=0, weights=weights), atol=1e-12)
    np.testing.assert_allclose(covariance[:2, :2], np.cov(poses[:, :2].T, aweights=weights, ddof=0), atol=1e-12)
