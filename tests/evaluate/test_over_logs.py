"""Statistics over logs: equal configurations are equal, a drawn gain is found, and seeds are not taken for logs."""

import numpy as np
import pytest
from scipy import stats

from wallkit.core.results import Value
from wallkit.evaluate.over_logs import compare_pairs, corrected, distribution, holm

ERROR = Value("error_mean_m", None, "m", "")
LOGS, SEEDS = 30, 5
LOG_OF = np.repeat(np.arange(LOGS), SEEDS)
PAIRS = np.arange(LOGS * SEEDS)


def errors(rng, gain=0.0, seed_sd=0.03):
    """Logs differ much, seeds little: what a filter shows."""
    return np.repeat(rng.gamma(4, 0.01, LOGS), SEEDS) * (1 - gain) * rng.normal(1, seed_sd, LOGS * SEEDS)


def test_the_middle_of_a_distribution_is_numpys():
    values = np.random.default_rng(0).permutation(LOGS * SEEDS).astype(float)
    found = distribution(np.random.default_rng(0), ERROR, values, LOG_OF)
    assert (found.mean.value, found.median.value) == (pytest.approx(values.mean()), pytest.approx(np.median(values)))
    assert found.tail.value == pytest.approx(np.quantile(values, 0.95, method="averaged_inverted_cdf"))
    assert (found.worst, found.worst_row, found.sd) == (149, int(values.argmax()), pytest.approx(values.std(ddof=1)))
    assert (found.runs, found.logs, found.without) == (150, 30, 0)


def test_every_log_counts_alike_and_what_is_missing_is_counted():
    values = np.array([1.0, 1.0, 1.0, 4.0, np.nan])
    found = distribution(np.random.default_rng(0), ERROR, values, np.array([0, 0, 0, 1, 1]))
    assert (found.mean.value, found.runs, found.logs, found.without) == (2.5, 4, 2, 1)
    assert distribution(np.random.default_rng(0), ERROR, np.full(3, np.nan), np.arange(3)) is None


def test_the_interval_of_the_mean_is_over_logs():
    """Ten times the seeds make it no narrower: its width is that of the means of the logs, known in closed form."""
    rng = np.random.default_rng(3)
    of_log = rng.normal(1.0, 0.2, LOGS)
    widths = []
    for seeds in (1, 10):
        found = distribution(rng, ERROR, np.repeat(of_log, seeds), np.repeat(np.arange(LOGS), seeds), resamples=4000)
        widths.append(found.mean.high - found.mean.low)
    assert widths[0] == pytest.approx(widths[1], rel=0.06)
    # Student's interval of the mean
    half = stats.t.ppf(0.975, LOGS - 1) * of_log.std(ddof=1) / np.sqrt(LOGS)
    assert widths[0] == pytest.approx(2 * half, rel=0.06)


def test_the_worst_of_what_should_be_high_is_the_lowest():
    higher = Value("availability", None, "share", "", "higher")
    found = distribution(np.random.default_rng(0), higher, np.linspace(0, 1, 101), np.arange(101))
    assert (found.worst, found.worst_row) == (0.0, 0)
    assert found.tail.value == pytest.approx(0.05)


def test_identical_configurations_are_equal():
    rng = np.random.default_rng(1)
    values = errors(rng)
    found = compare_pairs(rng, ERROR, (PAIRS, values), (PAIRS, values.copy()), LOG_OF)
    assert (found.p_value, found.better, found.percent.value) == (1.0, "neither", 0.0)
    assert found.percent.low == found.percent.high == 0.0


def test_equal_but_noisy_ones_are_told_apart_no_more_often_than_promised():
    rng = np.random.default_rng(5)
    wrong = 0
    for _ in range(60):
        shared = np.repeat(rng.gamma(4, 0.01, LOGS), SEEDS)
        a, b = shared * rng.normal(1, 0.1, len(PAIRS)), shared * rng.normal(1, 0.1, len(PAIRS))
        found = compare_pairs(rng, ERROR, (PAIRS, a), (PAIRS, b), LOG_OF, resamples=300)
        wrong += found.better != "neither"
    # 60 x 5 % are 3; the binomial leaves 9 above that to one in a thousand
    assert wrong <= 9


def test_a_gain_of_a_fifth_is_found():
    rng = np.random.default_rng(2)
    shared = np.repeat(rng.gamma(4, 0.01, LOGS), SEEDS)
    a, b = (shared * k * rng.normal(1, 0.05, len(PAIRS)) for k in (1.0, 0.8))
    found = compare_pairs(rng, ERROR, (PAIRS, a), (PAIRS, b), LOG_OF)
    assert found.better == "b"
    assert found.percent.low < -20 < found.percent.high
    assert found.percent.value == pytest.approx(-20, abs=2)
    assert found.p_value < 1e-4
    assert (found.units, found.over, found.pairs, found.b_better) == (30, "logs", 150, 30)


def test_pairs_with_a_missing_side_are_left_out_and_counted():
    rng = np.random.default_rng(4)
    values = errors(rng)
    a, b = values.copy(), values.copy()
    a[:7] = np.nan
    # an alone run with a huge error would spoil an unpaired mean
    a[149] = 1e6
    found = compare_pairs(rng, ERROR, (PAIRS, a), (PAIRS[:-1][::-1], b[:-1][::-1]), LOG_OF)
    assert (found.pairs, found.alone_a, found.alone_b) == (142, 1, 7)
    assert (found.difference.value, found.p_value) == (0.0, 1.0)
    # log 0 has lost all five runs
    assert found.units == 29
    nobody = compare_pairs(rng, ERROR, (PAIRS[:2], a[100:102]), (PAIRS[2:4], b[2:4]), LOG_OF)
    assert nobody is None


def test_one_log_is_compared_over_its_seeds_and_one_run_tells_nothing():
    rng = np.random.default_rng(6)
    a = rng.normal(0.05, 0.001, 8)
    found = compare_pairs(rng, ERROR, (np.arange(8), a), (np.arange(8), a - 0.01), np.zeros(8, dtype=np.int64))
    assert (found.over, found.units, found.better) == ("seeds of one log", 8, "b")
    single = compare_pairs(rng, ERROR, (PAIRS[:1], a[:1]), (PAIRS[:1], a[:1] - 0.01), LOG_OF)
    assert (single.p_value, single.difference.low, single.better) == (None, None, "neither")


def test_a_few_bad_logs_against_many_good_ones_is_no_verdict():
    """Ranks favour b, its mean is worse: neither may be called better."""
    rng = np.random.default_rng(7)
    a = rng.gamma(4, 0.01, LOGS)
    b = a * 0.9
    b[:3] += 2.0
    found = compare_pairs(rng, ERROR, (PAIRS[:LOGS], a), (PAIRS[:LOGS], b), np.arange(LOGS))
    assert found.p_value < 0.05
    assert found.percent.value > 0
    assert (found.b_better, found.a_better, found.better) == (27, 3, "neither")


def test_a_mean_of_zero_has_no_per_cent():
    rng = np.random.default_rng(8)
    zeros = np.zeros(len(PAIRS))
    found = compare_pairs(rng, Value("false_healthy", None, "scans", ""), (PAIRS, zeros), (PAIRS, zeros + 3), LOG_OF)
    assert (found.percent, found.difference.value, found.better) == (None, 3.0, "a")


def test_holm_by_hand_and_in_order():
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    p = np.random.default_rng(0).uniform(0, 0.2, 12)
    adjusted = np.array(holm(p.tolist()))
    assert (adjusted >= p).all()
    assert (adjusted <= np.minimum(1, 12 * p) + 1e-15).all()
    assert (np.diff(adjusted[np.argsort(p)]) >= 0).all()
    assert holm([0.03]) == [0.03]


def test_a_correction_takes_a_verdict_back():
    rng = np.random.default_rng(9)
    shared = rng.gamma(4, 0.01, LOGS)
    found = [
        compare_pairs(rng, ERROR, (PAIRS[:LOGS], shared), (PAIRS[:LOGS], shared + rng.normal(m, 0.01, LOGS)), PAIRS)
        for m in (-0.0045, 0.0, 0.0, 0.0, 0.0)
    ]
    assert 0.01 < found[0].p_value < 0.05
    assert found[0].better == "b"
    after = corrected(found, "lower")
    assert after[0].p_holm == pytest.approx(5 * found[0].p_value)
    assert after[0].better == "neither"
