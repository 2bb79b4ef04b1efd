"""The contract of every resampler, the bias of the wheel, and KLD's bound."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from wallkit.localize.resample import RESAMPLERS, kld_bound, kld_size, roughened

UNBIASED = [name for name in RESAMPLERS if name != "wheel"]


@pytest.mark.parametrize("name", UNBIASED)
def test_expected_offspring_equals_n_times_weight(name):
    w, n, trials = np.array([0.5, 0.3, 0.15, 0.05]), 4, 4000
    rng = np.random.default_rng(7)
    counts = sum(np.bincount(RESAMPLERS[name](rng, w, n), minlength=4) for _ in range(trials))
    np.testing.assert_allclose(counts / trials, n * w, atol=0.05)  # 3 sigma of multinomial, the worst case


@pytest.mark.parametrize("name", RESAMPLERS)
def test_every_resampler_gives_n_valid_indices_and_never_a_dead_particle(name):
    rng = np.random.default_rng(1)
    w = np.array([0.0, 0.7, 0.0, 0.3, 0.0])
    for n in (1, 3, 1000):
        chosen = RESAMPLERS[name](rng, w, n)
        assert chosen.shape == (n,)
        assert set(np.unique(chosen)) <= {1, 3}


@pytest.mark.parametrize("name", RESAMPLERS)
def test_one_certain_particle_is_always_chosen(name):
    w = np.zeros(100)
    w[42] = 1.0
    assert (RESAMPLERS[name](np.random.default_rng(3), w, 50) == 42).all()


@pytest.mark.parametrize("name", ["systematic", "stratified", "residual"])
def test_low_variance_resamplers_keep_equal_weights_as_they_are(name):
    chosen = RESAMPLERS[name](np.random.default_rng(0), np.full(64, 1 / 64), 64)
    spread = np.bincount(chosen, minlength=64)
    assert spread.max() <= (1 if name == "residual" else 2)
    assert name != "residual" or (spread == 1).all()


def wheel_shares(w):
    """Exact: the wheel's expected share of each particle, over all starts and beta uniform in [0, 2 max w)."""
    betas = (np.arange(100_000) + 0.5) / 100_000 * 2 * w.max()
    shares = np.zeros(len(w))
    for start in range(len(w)):
        edges = np.cumsum(np.tile(np.roll(w, -start), 3))
        shares += np.bincount((np.searchsorted(edges, betas) + start) % len(w), minlength=len(w))
    return shares / len(betas) / len(w)


def test_the_wheel_is_biased_by_what_lies_before_a_particle():
    w = np.array([0.4, 0.3, 0.2, 0.1])
    exact = wheel_shares(w)
    drawn = np.bincount(RESAMPLERS["wheel"](np.random.default_rng(5), w, 400_000), minlength=4) / 400_000
    np.testing.assert_allclose(drawn, exact, atol=0.004)
    np.testing.assert_allclose(exact / w - 1, [0.094, 0.042, -0.219, -0.062], atol=0.002)


def test_a_tenth_of_the_wheels_draws_go_to_the_wrong_particle():
    w = np.random.default_rng(0).exponential(size=300)
    w /= w.sum()
    assert np.abs(wheel_shares(w) - w).sum() / 2 == pytest.approx(0.1, abs=0.04)


def test_roughening_adds_the_asked_spread():
    poses = roughened(np.random.default_rng(0), np.zeros((100_000, 3)), 0.1, 0.02)
    np.testing.assert_allclose(poses.std(axis=0), [0.1, 0.1, 0.02], rtol=0.02)


def test_kld_bound_is_the_table_of_fox():
    """Fox (2003) eq. 7 with eps = 0.05, 1 - delta = 0.99: half the 99 % chi-square quantile over eps."""
    from scipy.stats import chi2

    for bins in (2, 10, 100, 500):
        assert kld_bound(bins, 0.05, 0.99) == pytest.approx(chi2.ppf(0.99, bins - 1) / (2 * 0.05), rel=0.02)


def test_kld_keeps_few_particles_in_one_bin_and_many_in_a_wide_cloud():
    s = SimpleNamespace(
        particles_min=200, particles_max=5000, kld_error=0.05, kld_quantile=0.99, kld_bin_m=0.5, kld_bin_rad=0.2
    )
    rng = np.random.default_rng(0)
    w = np.full(2000, 1 / 2000)
    tight = np.tile([0.25, 0.25, 0.1], (2000, 1))
    wide = np.column_stack([rng.uniform(0, 20, 2000), rng.uniform(0, 20, 2000), rng.uniform(-3, 3, 2000)])
    assert kld_size(rng, tight, w, s) == 200
    assert kld_size(rng, wide, w, s) == 5000
