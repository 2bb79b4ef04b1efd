"""Several runs: spread, worst, and a verdict that neither sees ghosts nor misses a plain difference."""

import itertools

import numpy as np
import pytest

from wallkit.core.results import Errors, Value
from wallkit.errors import WallkitError
from wallkit.evaluate.statistics import compare_errors, compare_seeds, summarise


def values(numbers, key="ate_rmse_m", better="lower"):
    return [Value(key, number, "m", "", better) for number in numbers]


def correlated_errors(rng, shift_m=0.0, updates=900):
    """Errors that wander slowly, as those of a filter do: neighbours are alike (AR(1), 0.95)."""
    noise = rng.normal(0, 0.02, updates)
    wander = np.array(list(itertools.accumulate(noise, lambda state, n: 0.95 * state + n)))
    rows = np.arange(updates)
    return Errors(rows * 10**9, rows, np.abs(wander) + shift_m, np.zeros(updates))


def test_spread_over_seeds():
    runs = [
        {"ate_rmse_m": a, "availability": b}
        for a, b in zip(values([1, 2, 4]), values([0.9, 1, 0.8], "availability", "higher"), strict=True)
    ]
    ate, available = summarise(runs).values()
    assert (ate.mean, ate.worst, ate.runs, ate.missing) == (pytest.approx(7 / 3), 4, 3, 0)
    assert ate.sd == pytest.approx(np.sqrt(7 / 3))
    assert available.worst == 0.8


def test_a_run_without_the_number_is_counted_and_spoils_the_worst():
    (spread,) = summarise([{"t": value} for value in values([3, None, 5], "t")]).values()
    assert (spread.mean, spread.worst, spread.runs, spread.missing) == (4, None, 3, 1)
    (absent,) = summarise([{}, {"t": values([3], "t")[0]}]).values()
    assert (absent.missing, absent.worst, absent.sd) == (1, None, None)
    (nothing,) = summarise([{"t": values([None], "t")[0]}]).values()
    assert (nothing.mean, nothing.worst) == (None, None)


def test_ten_seeds_that_agree_are_the_exact_sign_pattern():
    rng = np.random.default_rng(0)
    a = rng.normal(0.06, 0.01, 10)
    found = compare_seeds(rng, values(a), values(a - np.linspace(0.01, 0.02, 10)))
    assert found.p_value == pytest.approx(2 / 2**10)
    assert found.better == "b"
    assert found.difference == pytest.approx(-0.015)
    assert -0.02 < found.low < found.difference < found.high < -0.01


def test_the_better_side_follows_the_metric():
    rng = np.random.default_rng(0)
    low, high = np.linspace(0.5, 0.6, 10), np.linspace(0.8, 0.95, 10)
    assert compare_seeds(rng, values(low), values(high)).better == "a"
    assert compare_seeds(rng, values(low, better="higher"), values(high, better="higher")).better == "b"


def test_no_difference_and_too_few_seeds_are_said():
    rng = np.random.default_rng(0)
    same = compare_seeds(rng, values([1, 2, 3]), values([1, 2, 3]))
    assert (same.p_value, same.difference, same.better) == (1.0, 0.0, "neither")
    assert "cannot fall below 0.25" in same.method
    assert compare_seeds(rng, values([1, 2, 3, 4, 5]), values([2, 3, 4, 5, 6])).better == "neither"


@pytest.mark.parametrize("seeds", [6, 10])
def test_the_interval_over_seeds_holds_about_as_often_as_it_says(seeds, monkeypatch):
    """Uncorrected percentiles hold 83 of 100 times at six seeds, and 89 at ten."""
    # trying all sign patterns takes a minute, and the interval does not depend on it
    monkeypatch.setattr("wallkit.evaluate.statistics.signed_rank_p", lambda differences: 1.0)
    rng, trials, held = np.random.default_rng(5), 600, 0
    for _ in range(trials):
        base = rng.normal(10, 1, seeds)
        found = compare_seeds(rng, values(base), values(base + rng.normal(1, 1, seeds)), resamples=2000)
        held += found.low <= 1 <= found.high
    # 3 sigma of 600 trials at 0.93 is 0.031
    assert 0.90 <= held / trials <= 0.97


def test_fewer_than_six_pairs_have_no_interval():
    rng = np.random.default_rng(0)
    found = compare_seeds(rng, values([1, 2, 3, 4, 5]), values([2, 3, 4, 5, 7]))
    assert (found.low, found.high, found.pairs) == (None, None, 5)
    assert compare_seeds(rng, values(range(6)), values(range(1, 7))).low == 1


def test_a_verdict_needs_the_test_and_the_interval():
    """Thirteen are a little better, and one is much worse: the ranks and the mean point to different sides."""
    a = np.full(14, 1.0)
    b = a - np.append(np.linspace(0.01, 0.02, 13), -0.3)
    found = compare_seeds(np.random.default_rng(0), values(a), values(b))
    assert found.p_value < 0.05
    assert found.low < 0 < found.high
    assert found.better == "neither"


def test_tied_and_zero_differences_are_exact():
    rng = np.random.default_rng(0)
    found = compare_seeds(rng, values([5] * 8), values([4, 4, 4, 4, 4, 4, 4, 5]))
    assert found.p_value == pytest.approx(2 / 2**7)


@pytest.mark.parametrize(("a", "b"), [([1], [2]), ([1, 2], [1, 2, 3]), ([1, None], [1, 2]), ([], [])])
def test_what_cannot_be_paired_is_refused(a, b):
    with pytest.raises(WallkitError, match="cannot be compared"):
        compare_seeds(np.random.default_rng(0), values(a), values(b))


def test_block_bootstrap_false_alarms_stay_near_five_percent():
    rng = np.random.default_rng(3)
    alarms = sum(
        compare_errors(rng, correlated_errors(rng), correlated_errors(rng), resamples=400).better != "neither"
        for _ in range(100)
    )
    # taking neighbours for independent cries wolf in about half of these; a block bootstrap is slightly liberal
    assert alarms <= 15


def test_block_bootstrap_sees_a_plain_difference():
    rng = np.random.default_rng(4)
    found = compare_errors(rng, correlated_errors(rng), correlated_errors(rng, shift_m=0.1))
    assert found.better == "a"
    assert found.low < found.difference < found.high
    assert found.p_value == pytest.approx(1e-3)


def test_runs_over_different_logs_are_refused():
    errors = correlated_errors(np.random.default_rng(0))
    later = Errors(errors.stamps_ns + 1, errors.rows, errors.position_m, errors.heading_deg)
    with pytest.raises(WallkitError, match="0 update stamps in common"):
        compare_errors(np.random.default_rng(0), errors, later)
