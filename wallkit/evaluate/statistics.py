"""The numbers of several runs -> mean, spread and worst, and whether two configurations really differ."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np

from wallkit.core.results import Comparison, Errors, Spread, Value
from wallkit.core.types import Float64Array
from wallkit.errors import WallkitError

SIGNIFICANT_P = 0.05


def summarise(runs: Sequence[Mapping[str, Value]]) -> dict[str, Spread]:
    """Mean, sd and worst of every metric that any of the runs has, in the order they first appear."""
    keys = dict.fromkeys(key for run in runs for key in run)
    return {key: _spread([run.get(key) for run in runs]) for key in keys}


def compare_seeds(
    rng: np.random.Generator, a: Sequence[Value], b: Sequence[Value], *, resamples: int = 2000
) -> Comparison:
    """One metric of two configurations, run by run with the same seeds.

    Wilcoxon's signed-rank test (1945), exact for small samples; the interval is a percentile bootstrap over the seeds.

    Raises:
        WallkitError: not as many runs on both sides, or fewer than two, or a run without the number.
    """
    missing = sum(v.value is None for v in (*a, *b))
    if len(a) != len(b) or len(a) < 2 or missing:
        key = a[0].key if a else "metric"
        message = f"'{key}' cannot be compared: {len(a)} and {len(b)} runs, {missing} of them without it"
        raise WallkitError(message, hint="run both configurations with the same seeds, two at least: --seeds 10")
    differences = np.array([v.value for v in b], dtype=np.float64) - np.array([v.value for v in a], dtype=np.float64)
    means = differences[rng.integers(0, len(differences), (resamples, len(differences)))].mean(axis=1)
    low, high = np.percentile(means, [2.5, 97.5]).tolist()
    p_value = signed_rank_p(differences)
    # n pairs cannot give less than 2 / 2^n: five agreeing seeds are not yet significant
    least = 2.0 ** (1 - len(differences))
    method = "Wilcoxon signed-rank over seeds" + (f"; p cannot fall below {least:.3g}" if least > SIGNIFICANT_P else "")
    return _comparison(a[0], (float(differences.mean()), low, high, p_value), len(differences), method)


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
    statistics = (float(differences.mean()), low, high, min(1.0, 2 * side))
    return _comparison(label, statistics, count, f"block bootstrap over time, {block} updates a block")


def signed_rank_p(differences: Float64Array) -> float:
    """Two-sided p of Wilcoxon's signed-rank test (1945) on differences (N,); 1 where nothing differs."""
    from scipy import stats

    if not differences.any():
        return 1.0
    # up to 13 pairs all 2^n sign patterns are tried, which stays exact when differences are tied or zero
    if len(differences) <= 13:
        return float(stats.wilcoxon(differences, method=stats.PermutationMethod(n_resamples=9999)).pvalue)
    return float(stats.wilcoxon(differences, method="auto").pvalue)


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


def _comparison(label: Value, statistics: tuple[float, float, float, float], pairs: int, method: str) -> Comparison:
    difference, low, high, p_value = statistics
    better: Literal["a", "b", "neither"] = "neither"
    if p_value < SIGNIFICANT_P and label.better:
        better = "b" if (difference < 0) == (label.better == "lower") else "a"
    return Comparison(label.key, label.unit, difference, low, high, p_value, pairs, method, better)
