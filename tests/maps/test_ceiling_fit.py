from __future__ import annotations

import numpy as np
import pytest

from wallkit.maps.ceiling.fit import robust_ratio, robust_similarity


def test_a_ratio_is_exact_without_noise_and_shrugs_off_outliers():
    b = np.linspace(80, 120, 60)
    a = 0.0123 * b
    assert robust_ratio(a, b).value == pytest.approx(0.0123, rel=1e-12)
    a[::10] *= 3
    assert robust_ratio(a, b).value == pytest.approx(0.0123, rel=1e-3)


def test_the_sigma_of_a_ratio_is_how_much_it_varies():
    rng = np.random.default_rng(0)
    b = np.full(40, 100.0)
    runs = [robust_ratio(1.0 + 0.03 * rng.standard_normal(40), b) for _ in range(400)]
    values, sigmas = np.array([(r.value, r.sigma) for r in runs]).T
    assert sigmas.mean() == pytest.approx(values.std(), rel=0.15)


def test_a_similarity_is_found_with_honest_sigmas():
    rng = np.random.default_rng(1)
    q = rng.uniform(0, 500, (80, 2))
    c, s = 0.02 * np.cos(0.7), 0.02 * np.sin(0.7)
    true = q @ np.array([[c, s], [-s, c]]) + (3.0, -1.0)
    found = []
    for _ in range(300):
        p = true + rng.normal(0, 0.05, true.shape)
        p[::9] += rng.uniform(-2, 2, (len(p[::9]), 2))
        found.append(robust_similarity(p, q))
    off = np.array([(f.scale - 0.02, f.yaw - 0.7) for f in found])
    np.testing.assert_allclose(off.mean(axis=0), 0, atol=3e-4)
    np.testing.assert_allclose(
        [np.mean([f.scale_sigma for f in found]), np.mean([f.yaw_sigma for f in found])], off.std(axis=0), rtol=0.35
    )
    np.testing.assert_allclose(found[0].apply(q[:3]), true[:3], atol=0.05)


def test_a_scale_that_is_known_stays():
    q = np.random.default_rng(2).uniform(0, 10, (30, 2))
    f = robust_similarity(1.01 * q + (1.0, 2.0), q, scale=1.0)
    assert f.scale == pytest.approx(1.0)
    assert f.yaw == pytest.approx(0.0, abs=1e-9)
