"""Which configurations may be the best: the true best is kept, plain losers go, equals stay together."""

import numpy as np
import pytest

from wallkit.evaluate.best import find_best, find_front


def test_a_plain_winner_stands_alone():
    rng = np.random.default_rng(0)
    losses = rng.gamma(4, 0.01, (40, 1)) * np.array([1.0, 0.7, 1.3, 1.1]) * rng.normal(1, 0.05, (40, 4))
    found = find_best(rng, losses)
    assert found.may_be.tolist() == [False, True, False, False]
    assert found.chances[1] == pytest.approx(1.0)


def test_the_same_numbers_cannot_be_told_apart():
    rng = np.random.default_rng(1)
    one = rng.gamma(4, 0.01, (20, 1))
    found = find_best(rng, np.hstack([one, one, one + 0.02]))
    assert found.may_be.tolist() == [True, True, False]
    assert found.chances == pytest.approx([0.5, 0.5, 0.0])


def test_the_best_of_equals_is_rarely_lost():
    """All alike: a set that drops any of them is wrong, and may be so in 5 of 100 cases (here 10 of 100 are allowed)."""
    rng = np.random.default_rng(2)
    wrong = sum(not find_best(rng, rng.normal(1, 0.2, (30, 6)), resamples=400).may_be.all() for _ in range(100))
    assert wrong <= 10


def test_few_logs_exclude_nothing():
    found = find_best(np.random.default_rng(0), np.tile([1.0, 2.0, 3.0], (5, 1)))
    assert found.may_be.all()
    assert found.chances.tolist() == [1, 0, 0]


def test_the_front_is_what_no_other_beats():
    costs = np.array([1.0, 2.0, 2.0, 3.0, 4.0, np.nan])
    losses = np.array([9.0, 5.0, 4.0, 4.0, 1.0, 0.0])
    assert find_front(costs, losses).tolist() == [0, 2, 4]
