"""Motion models: exact without noise, the table's variances with it."""

from __future__ import annotations

import numpy as np
import pytest

from wallkit.core.geometry import compose, relative, wrap_angle
from wallkit.localize.motion import MOTIONS, DifferentialDrive, Omnidirectional

QUIET = {"alpha1": 0.0, "alpha2": 0.0, "alpha3": 0.0, "alpha4": 0.0}
STEPS = [(1.0, 0.2, 0.4), (-0.5, 0.05, 0.1), (0.0, 0.0, 1.2), (0.3, 0.0, 0.0), (0.0, 0.0, 0.0)]


@pytest.mark.parametrize("name", MOTIONS)
@pytest.mark.parametrize("step", STEPS)
def test_without_noise_every_model_composes_the_odometry(name, step):
    quiet = dict(QUIET, alpha5=0.0) if name == "omnidirectional" else QUIET
    rng = np.random.default_rng(0)
    poses = np.array([[0.0, 0.0, 0.0], [2.0, -1.0, 2.5]])
    moved = MOTIONS[name](**quiet).sample(rng, poses, np.array(step))
    # below a centimetre the differential model takes the way for noise and drives along the heading
    np.testing.assert_allclose(moved, compose(poses, np.array(step)), atol=1e-9)


@pytest.mark.parametrize("name", MOTIONS)
def test_inputs_stay_as_they_were_and_samples_follow_the_seed(name):
    poses = np.zeros((50, 3))
    step = np.array([0.5, 0.0, 0.3])
    model = MOTIONS[name]()
    a = model.sample(np.random.default_rng(1), poses, step)
    b = model.sample(np.random.default_rng(1), poses, step)
    np.testing.assert_array_equal(a, b)
    assert not poses.any()
    assert np.all(np.abs(a[:, 2]) <= np.pi)


def test_differential_variances_are_those_of_table_5_6():
    model = DifferentialDrive(alpha1=0.04, alpha2=0.01, alpha3=0.02, alpha4=0.005)
    step = np.array([1.0, 0.0, 0.5])  # drives straight, then turns: rot1 = 0, trans = 1, rot2 = 0.5
    moved = model.sample(np.random.default_rng(2), np.zeros((200_000, 3)), step)
    off = relative(step, moved)
    rot1 = np.arctan2(moved[:, 1], moved[:, 0])
    trans = np.hypot(moved[:, 0], moved[:, 1])
    rot2 = wrap_angle(moved[:, 2] - rot1)
    assert np.var(rot1) == pytest.approx(0.01 * 1**2, rel=0.02)
    assert np.var(trans) == pytest.approx(0.02 * 1**2 + 0.005 * 0.5**2, rel=0.02)
    assert np.var(rot2) == pytest.approx(0.04 * 0.5**2 + 0.01 * 1**2, rel=0.02)
    assert np.abs(off.mean(axis=0)).max() < 0.02


def test_driving_backwards_is_not_a_turn_of_half_a_circle():
    model = DifferentialDrive(alpha1=1.0, alpha2=0.0, alpha3=0.0, alpha4=0.0)
    moved = model.sample(np.random.default_rng(3), np.zeros((1000, 3)), np.array([-1.0, 0.0, 0.0]))
    np.testing.assert_allclose(moved, np.tile([-1.0, 0.0, 0.0], (1000, 1)), atol=1e-9)


def test_omnidirectional_strafes_with_noise_across_from_alpha5():
    model = Omnidirectional(alpha1=0, alpha2=0, alpha3=0.01, alpha4=0, alpha5=0.04)
    moved = model.sample(np.random.default_rng(4), np.zeros((100_000, 3)), np.array([0.0, 1.0, 0.0]))
    assert np.var(moved[:, 1]) == pytest.approx(0.01, rel=0.03)
    assert np.var(moved[:, 0]) == pytest.approx(0.04, rel=0.03)
