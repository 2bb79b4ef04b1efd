"""Runs of many logs -> distributions and differences whose intervals are over logs.

Runs of one log share its people, its places and its noise; ten seeds of one log are not ten logs. So every bootstrap draws
logs again, with all of their runs (the cluster bootstrap: Davison & Hinkley 1997, section 3.8), and tests see one number per
log.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from wallkit.core.results import Distribution, Interval, Paired, Value
from wallkit.core.types import Float64Array, Int64Array
from wallkit.evaluate.statistics import RESAMPLES_OF_PAIRS, better_of, percentiles, signed_rank_p

# numbers drawn for one interval, and the resamples that are made of them at least and at most
_DRAWN = 3_000_000
_LEAST, RESAMPLES = 500, 2000
# numbers in one block of resamples x runs
_BLOCK = 1_000_000
_TAIL = 0.95


def distribution(
    rng: np.random.Generator, label: Value, values: Float64Array, logs: Int64Array, *, resamples: int = RESAMPLES
) -> Distribution | None:
    """Mean, median, tail and worst of one metric; None if no run has it.

    Args:
        label: key, unit and which way is better; its value is not read.
        values, logs: (N,) the metric of each run that ended (NaN: it has none), and which log it is of.
    """
    known = np.flatnonzero(np.isfinite(values))
    if not len(known):
        return None
    sign = -1.0 if label.better == "higher" else 1.0
    order = known[np.argsort(sign * values[known], kind="stable")]
    _, of_log, runs = np.unique(logs[order], return_inverse=True, return_counts=True)
    weights = 1.0 / runs[of_log]
    numbers = values[order]
    at = _statistics(numbers, weights[None, :])[:, 0]
    drawn = _resampled(rng, numbers, weights, of_log, resamples) if len(runs) > 1 else None
    mean, median, tail = (
        Interval(float(at[i]), *(percentiles(drawn[i], len(runs)) if drawn is not None else (None, None)))
        for i in range(3)
    )
    return Distribution(
        label.key, label.unit, mean, median, tail, float(numbers[-1]), int(order[-1]),
        float(np.std(numbers, ddof=1)) if len(numbers) > 1 else None, _sd_within(numbers, of_log, runs),
        len(numbers), len(runs), len(values) - len(numbers),
    )  # fmt: skip


def compare_pairs(
    rng: np.random.Generator,
    label: Value,
    a: tuple[Int64Array, Float64Array],
    b: tuple[Int64Array, Float64Array],
    log_of: Int64Array,
    *,
    resamples: int = RESAMPLES_OF_PAIRS,
) -> Paired | None:
    """How b differs from a, by the runs both have; None if there is no such run.

    Wilcoxon's signed-rank test (1945) on the mean difference of each log, and a percentile bootstrap over logs for the
    intervals. One log alone is compared over its seeds, which says nothing about other logs.

    Args:
        a, b: pair numbers (N,) and values (N,), NaN where a run has none. A pair number stands for a log, a map and a
            seed: runs with the same one differ in nothing but the configuration.
        log_of: (P,) the log of each pair number.
    """
    (pairs_a, left), (pairs_b, right) = (_known(*side) for side in (a, b))
    common, at_a, at_b = np.intersect1d(pairs_a, pairs_b, assume_unique=True, return_indices=True)
    if not len(common):
        return None
    logs = log_of[common]
    over: Literal["logs", "seeds of one log"] = "logs"
    if len(np.unique(logs)) == 1 and len(common) > 1:
        logs, over = common, "seeds of one log"
    unit_a, unit_b = _means(left[at_a], logs), _means(right[at_b], logs)
    difference, percent, middle = _differences(rng, label, unit_a, unit_b, resamples)
    p_value = signed_rank_p(unit_b - unit_a) if len(unit_a) > 1 else None
    gain = (unit_b - unit_a) * (-1 if label.better == "higher" else 1)
    return Paired(
        label.key, label.unit, float(unit_a.mean()), float(unit_b.mean()), difference, percent, middle, p_value, p_value,
        len(unit_a), over, len(common), len(pairs_a) - len(common), len(pairs_b) - len(common),
        int(np.sum(gain < 0)), int(np.sum(gain > 0)), int(np.sum((unit_b - unit_a) * difference.value > 0)),
        better_of(label, difference, p_value),
    )  # fmt: skip


def corrected(found: Sequence[Paired], better: str) -> list[Paired]:
    """The comparisons with p corrected for their number (Holm 1979), and what is still better after that."""
    known = [i for i, c in enumerate(found) if c.p_value is not None]
    p_holm = dict(zip(known, holm([float(found[i].p_value or 0.0) for i in known]), strict=True))
    label = Value("", None, "", "", "higher" if better == "higher" else "lower" if better else "")
    return [
        replace(c, tests=len(known), p_holm=p_holm.get(i), better=better_of(label, c.difference, p_holm.get(i)))
        for i, c in enumerate(found)
    ]


def holm(p_values: Sequence[float]) -> list[float]:
    """p-values corrected for being one of several, in the order given: Holm (1979), step down."""
    p = np.asarray(p_values, dtype=np.float64)
    order = np.argsort(p, kind="stable")
    stepped = np.maximum.accumulate(p[order] * np.arange(len(p), 0, -1))
    found = np.empty(len(p))
    found[order] = np.minimum(stepped, 1.0)
    return [float(value) for value in found]


# -------------------------------------------------------------------------------------------- details


def _statistics(numbers: Float64Array, weights: Float64Array) -> Float64Array:
    """(3, R) mean, median and tail of numbers (N,), sorted from good to bad, under weights (R, N)."""
    total = np.cumsum(weights, axis=1)
    ends = total[:, -1]
    return np.array([weights @ numbers / ends, _quantile(numbers, total, 0.5), _quantile(numbers, total, _TAIL)])


def _quantile(numbers: Float64Array, total: Float64Array, share: float) -> Float64Array:
    """(R,) the number that a share of the weight is not beyond; halfway between two where it falls between them."""
    wanted = share * total[:, -1:]
    slack = 1e-9 * total[:, -1:]
    last = len(numbers) - 1
    low = np.minimum(np.sum(total < wanted - slack, axis=1), last)
    high = np.minimum(np.sum(total <= wanted + slack, axis=1), last)
    # a run that was not drawn has no weight: the next that was, is meant
    return np.asarray(0.5 * (numbers[low] + numbers[high]))


def _resampled(
    rng: np.random.Generator, numbers: Float64Array, weights: Float64Array, of_log: Int64Array, resamples: int
) -> Float64Array:
    """(3, resamples) the statistics with the logs drawn again."""
    count = int(of_log.max()) + 1
    found, sizes = [], _blocks(resamples, len(numbers))
    for size in sizes:
        drawn = rng.multinomial(count, np.full(count, 1 / count), size=size)
        found.append(_statistics(numbers, drawn[:, of_log] * weights))
    return np.concatenate(found, axis=1)


def _sd_within(numbers: Float64Array, of_log: Int64Array, runs: Int64Array) -> float | None:
    """Pooled over the logs that have two runs or more."""
    spare = int(np.sum(runs - 1))
    if not spare:
        return None
    means = np.bincount(of_log, numbers) / runs
    return float(np.sqrt(np.sum((numbers - means[of_log]) ** 2) / spare))


def _known(pairs: Int64Array, values: Float64Array) -> tuple[Int64Array, Float64Array]:
    is_known = np.isfinite(values)
    return pairs[is_known], values[is_known]


def _means(values: Float64Array, groups: Int64Array) -> Float64Array:
    _, index, counts = np.unique(groups, return_inverse=True, return_counts=True)
    return np.asarray(np.bincount(index, values) / counts)


def _differences(
    rng: np.random.Generator, label: Value, a: Float64Array, b: Float64Array, resamples: int
) -> tuple[Interval, Interval | None, Interval | None]:
    """Mean of b - a; the same in per cent of the mean of a; median of the per cent of each unit: the units drawn again."""
    count, difference = len(a), float((b - a).mean())
    has_middle = bool(np.all(a > 0))
    changes = 100 * (b - a) / a if has_middle else np.zeros(count)
    found = []
    for size in _blocks(resamples, count):
        drawn = rng.integers(0, count, (size, count))
        middles = np.median(changes[drawn], axis=1) if has_middle else np.zeros(size)
        found.append(np.array([a[drawn].mean(axis=1), (b - a)[drawn].mean(axis=1), middles]))
    means, differences, middles = np.concatenate(found, axis=1)
    interval = _interval(difference, differences, count)
    if label.unit in ("share", "%") or not np.all(means > 0):
        return interval, None, None
    percent = _interval(100 * difference / float(a.mean()), 100 * differences / means, count)
    return interval, percent, _interval(float(np.median(changes)), middles, count) if has_middle else None


def _blocks(resamples: int, numbers: int) -> list[int]:
    """Sizes of the blocks in which resamples of so many numbers are drawn; many numbers are drawn less often."""
    wanted = max(min(resamples, _LEAST), min(resamples, _DRAWN // numbers))
    size = max(1, _BLOCK // numbers)
    return [min(size, wanted - start) for start in range(0, wanted, size)]


def _interval(value: float, drawn: Float64Array, count: int) -> Interval:
    return Interval(value, *percentiles(drawn, count)) if count > 1 else Interval(value)
