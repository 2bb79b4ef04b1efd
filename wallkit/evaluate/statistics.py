"""The numbers of several runs -> mean, spread and worst, and whether two configurations really differ."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np

from wallkit.core.results import FEWEST_PAIRS, Comparison, Errors, Interval, Spread, Value
from wallkit.core.types import Float64Array
from wallkit.errors import WallkitError

SIGNIFICANT_P = 0.05
# of a comparison, whose verdict may hang on the end of its interval
RESAMPLES_OF_PAIRS = 10_000


def summarise(runs: Sequence[Mapping[str, Value]]) -> dict[str, Spread]:
    """Mean, sd and worst of every metric that any of the runs has, in the order they first appear."""
    keys = dict.fromkeys(key for run in runs for key in run)
    return {key: _spread([run.get(key) for run in runs]) for key in keys}


def compare_seeds(
    rng: np.random.Generator, a: Sequence[Value], b: Sequence[Value], *, resamples: int = RESAMPLES_OF_PAIRS
) -> Comparison:
    """One metric of two configurations, run by run with the same seeds.

    Wilcoxon's signed-rank test (1945), exact for small samples; the interval is a percentile bootstrap over the seeds, from
    FEWEST_PAIRS on.

    Raises:
        WallkitError: not as many runs on both sides, or fewer than two, or a run without the number.
    """
    missing = sum(v.value is None for v in (*a, *b))
    if len(a) != len(b) or len(a) < 2 or missing:
        key = a[0].key if a else "metric"
        message = f"'{key}' cannot be compared: {len(a)} and {len(b)} runs, {missing} of them without it"
        raise WallkitError(message, hint="run both configurations with the same seeds, two at least: --seeds 10")
    differences = np.array([v.value for v in b], dtype=np.float64) - np.array([v.value for v in a], dtype=np.float64)
    count, mean = len(differences), Interval(float(differences.mean()))
    if count >= FEWEST_PAIRS:
        means = differences[rng.integers(0, count, (resamples, count))].mean(axis=1)
        mean = Interval(mean.value, *percentiles(means, count))
    # n pairs cannot give less than 2 / 2^n: five agreeing seeds are not yet significant
    least = 2.0 ** (1 - count)
    method = "Wilcoxon signed-rank over seeds" + (f"; p cannot fall below {least:.3g}" if least > SIGNIFICANT_P else "")
    return _comparison(a[0], mean, signed_rank_p(differences), count, method)


def compare_errors(rng: np.random.Generator, a: Errors, b: Errors, *, resamples: int = 2000) -> Comparison:
    """Mean position error of two runs over the same log, by the stamps both have.

    Errors of neighbouring updates are alike, so single updates would count the same mistake many times: a circular
    block bootstrap (Politis & Romano 1992) draws stretches of T^(2/3) updates.

    Raises:
        WallkitError: fewer than ten common stamps.
    """
    _, rows_a, rows_b = np.intersect1d(a.stamps_ns, b.stamps_ns, assume_unique=True, return_indices=True)
    count = len(rows_a)
    if count < 10:
        message = f"the runs have {count} update stamps in common, too few to compare"
        raise WallkitError(message, hint="compare runs over the same log")
    differences = b.position_m[rows_b] - a.position_m[rows_a]
    block = math.ceil(count ** (2 / 3))
    blocks = math.ceil(count / block)
    means = _block_means(differences, block)[rng.integers(0, count, (resamples, blocks))].mean(axis=1)
    low, high = np.percentile(means, [2.5, 97.5]).tolist()
    # how often the resampled mean falls on the other side of zero, on the worse of both sides
    side = max(min(float(np.mean(means <= 0)), float(np.mean(means >= 0))), 1 / resamples)
    label = Value("error_mean_m", None, "m", "mean distance between estimate and truth")
    mean = Interval(float(differences.mean()), low, high)
    return _comparison(label, mean, min(1.0, 2 * side), count, f"block bootstrap over time, {block} updates a block")


def signed_rank_p(differences: Float64Array) -> float:
    """Two-sided p of Wilcoxon's signed-rank test (1945) on differences (N,); 1 where nothing differs."""
    from scipy import stats

    if not differences.any():
        return 1.0
    # up to 13 pairs all 2^n sign patterns are tried, which stays exact when differences are tied or zero
    if len(differences) <= 13:
        return float(stats.wilcoxon(differences, method=stats.PermutationMethod(n_resamples=9999)).pvalue)
    return float(stats.wilcoxon(differences, method="auto").pvalue)


def percentiles(values: Float64Array, count: int) -> tuple[float, float]:
    """The 95 % interval of what was drawn again and again from `count` units (R,)."""
    from scipy import stats

    share = 100 * float(stats.norm.cdf(small_sample_z(count)))
    low, high = np.percentile(values, [share, 100 - share]).tolist()
    return low, high


def small_sample_z(count: int) -> float:
    """Where to cut a normal spread of resamples for 95 %: -1.96 for many units, further out for few.

    Resamples vary by 1 / n where 1 / (n - 1) is right, and their spread is itself uncertain (Hesterberg 2015, What teachers
    should know about the bootstrap, section 5).
    """
    from scipy import stats

    return float(stats.t.ppf(0.025, count - 1) * np.sqrt(count / (count - 1)))


def better_of(label: Value, difference: Interval, p_value: float | None) -> Literal["a", "b", "neither"]:
    """Only where the test and the interval of the mean agree: ranks may favour the one, and a few bad units the other.

    Args:
        label: which way is better; its value is not read. difference: of b - a.
    """
    low, high = difference.low, difference.high
    if p_value is None or p_value >= SIGNIFICANT_P or low is None or high is None or low <= 0 <= high:
        return "neither"
    return "neither" if not label.better else "b" if (high < 0) == (label.better == "lower") else "a"


def _block_means(values: Float64Array, block: int) -> Float64Array:
    """(T,) mean of the block that starts at each row, round the end."""
    total = np.cumsum(np.concatenate([[0.0], values, values[: block - 1]]))
    return np.asarray((total[block:] - total[:-block]) / block)


def _spread(values: Sequence[Value | None]) -> Spread:
    label = next(v for v in values if v is not None)
    numbers = [v.value for v in values if v is not None and v.value is not None]
    missing = len(values) - len(numbers)
    worst = (min if label.better == "higher" else max)(numbers) if numbers and not missing and label.better else None
    sd = float(np.std(numbers, ddof=1)) if len(numbers) > 1 else None
    return Spread(label.key, label.unit, float(np.mean(numbers)) if numbers else None, sd, worst, len(values), missing)


def _comparison(label: Value, mean: Interval, p_value: float, pairs: int, method: str) -> Comparison:
    better = better_of(label, mean, p_value)
    return Comparison(label.key, label.unit, mean.value, mean.low, mean.high, p_value, pairs, method, better)
