"""How unlikely a difference is: closed forms, units, and what few views may and may not say."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from wallkit.calib.extrinsics.agreement import chance_of, solved, stated
from wallkit.calib.extrinsics.sightings import problem_from_sightings
from wallkit.calib.extrinsics.solver import fit
from wallkit.calib.extrinsics.worlds import World, draw_sightings, mounting


def drawn(seed=0):
    rng = np.random.default_rng(seed)
    half = rng.normal(size=(6, 6))
    return half @ half.T, rng.normal(size=6) * 2


@pytest.mark.parametrize("seed", range(5))
def test_known_covariances_give_the_chi_square(seed):
    """With endless degrees of freedom the six directions are the Mahalanobis distance, whatever their choice."""
    (A, d), (B, _) = drawn(seed), drawn(seed + 100)
    expected = stats.chi2.sf(d @ np.linalg.solve(A + B, d), 6)
    assert chance_of(d, [stated(A), stated(B)]) == pytest.approx(expected, rel=1e-6)


def test_one_axis_alone_is_students_t():
    """Five axes without a difference leave one t; its normal score squared is the whole chi-square."""
    d = np.array([0, 0, 2.5, 0, 0, 0.0])
    tail = stats.t.sf(2.5, 4.0)
    expected = stats.chi2.sf(stats.norm.isf(tail) ** 2, 6)
    assert chance_of(d, [stated(np.eye(6), 4.0)]) == pytest.approx(expected, rel=1e-6)


def test_degrees_of_freedom_add_as_welch_says():
    """Two equal sides of 5 count as one of 10; a side that is certain adds nothing."""
    d = np.full(6, 1.5)
    two = chance_of(d, [stated(np.eye(6) / 2, 5.0), stated(np.eye(6) / 2, 5.0)])
    assert two == pytest.approx(chance_of(d, [stated(np.eye(6), 10.0)]), rel=1e-9)
    certain = chance_of(d, [stated(np.eye(6), 5.0), stated(np.eye(6) * 1e-12)])
    assert certain == pytest.approx(chance_of(d, [stated(np.eye(6), 5.0)]), rel=1e-6)


def test_units_do_not_matter():
    C, d = drawn(3)
    units = np.array([1e3, 1, 1e-3, 5, 1, 1e-2])
    there = chance_of(d * units, [stated(C * np.outer(units, units), 7.0)])
    assert there == pytest.approx(chance_of(d, [stated(C, 7.0)]), rel=1e-6)


def test_twelve_views_notice_what_is_plainly_wrong_and_nothing_less():
    """Ten sigmas of one axis are noticed, one is not: a Hotelling test with CR2's own degrees would see neither."""
    rng = np.random.default_rng(4)
    T = mounting(rng)
    found = fit(problem_from_sightings(draw_sightings(rng, World(), T, 12)), T)
    known = solved(found)
    for axis in range(6):
        e = np.zeros(6)
        e[axis] = np.sqrt(known.covariance[axis, axis])
        assert chance_of(10 * e, [known]) < 1e-3
        assert chance_of(0.8 * e, [known]) > 0.05
