"""The runs of a batch -> what each configuration is worth over its logs, and which differences are real."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from wallkit.core.results import Distribution
from wallkit.core.types import Float64Array
from wallkit.errors import WallkitError
from wallkit.evaluate.best import find_best
from wallkit.evaluate.over_logs import compare_pairs, corrected, distribution
from wallkit.pipelines.batch.runs import FAILED, MISSING, Runs, index_of, levels_of
from wallkit.pipelines.batch.sweep import effects_of, quantiles_of, settings_of, trades_of
from wallkit.report.batch import BatchData, Candidate, Contest, Difference, Factor, Level, OneRun, Summary

# what is told of every configuration, where its runs have it
SHOWN = (
    "error_mean_m",
    "ate_rmse_m",
    "heading_error_mean_deg",
    "converged",
    "updates_to_converge",
    "was_lost",
    "lost_share",
    "was_false_healthy",
    "false_healthy",
    "kept_share",
    "update_mean_ms",
    "cpu_percent",
    "peak_memory_mb",
)
MAIN, WELL = "error_mean_m", "ended_well"
_WORST = 20
Differences = Mapping[str, tuple[Difference, ...]]


@dataclass(frozen=True)
class Question:
    """What is asked of a batch.

    Attributes:
        baseline: a configuration; "" is the first. metrics: tested; empty is the mean error. by: facts, a table for each.
    """

    baseline: str = ""
    metrics: tuple[str, ...] = ()
    by: tuple[str, ...] = ()
    seed: int = 0


def compare_batch(runs: Runs, question: Question, *, title: str) -> BatchData:
    """Everything that is asked.

    Raises:
        WallkitError: no run has ended or has a number, or a configuration, metric or fact does not exist.
    """
    if not runs.is_done.any():
        raise WallkitError(
            f"none of {len(runs)} runs has ended: {_count(runs, FAILED)} failed, {_count(runs, MISSING)} are missing",
            where=title,
            hint="start the batch again",
        )
    metrics = question.metrics or tuple(key for key in (MAIN, WELL, *runs.columns) if key in runs.columns)[:1]
    if not metrics:
        said = f"none of the {len(runs)} runs has a number to compare"
        raise WallkitError(said, where=title, hint="is there truth? `wallkit localize LOG --truth FILE`")
    labels = {key: runs.column(key).label for key in metrics}
    base = index_of(runs, question.baseline) if question.baseline else 0
    rng = np.random.default_rng(np.random.SeedSequence(question.seed))
    # of jobs that do not localize, everything
    usual = SHOWN if MAIN in runs.columns else tuple(runs.columns)
    shown = (*metrics, *(key for key in usual if key in runs.columns and key not in metrics))
    main = metrics[0]
    summaries = _summaries(rng, runs, shown)
    factors = tuple(Factor(key, _levels(rng, runs, key, base, metrics, shown)) for key in question.by)
    return BatchData(
        title=title,
        key=main,
        unit=labels[main].unit,
        baseline=runs.configurations[base],
        logs=len(runs.logs),
        summaries=summaries,
        differences=_differences(rng, runs, base, metrics),
        contest=_contest(rng, runs, main) if labels[main].better else None,
        factors=factors,
        worst=_worst(runs, main),
        failed=tuple(_one(runs, i, None) for i in np.flatnonzero(runs.status == FAILED).tolist()),
        missing=tuple(_one(runs, i, None) for i in np.flatnonzero(runs.status == MISSING).tolist()),
        labels={key: (runs.column(key).label.unit, runs.column(key).label.definition) for key in shown},
        settings=settings_of(runs),
        trades=trades_of(summaries, main),
        effects=effects_of(rng, runs, main),
        quantiles=quantiles_of(runs, main),
    )


def _summaries(rng: np.random.Generator, runs: Runs, keys: Sequence[str]) -> tuple[Summary, ...]:
    found = []
    for number, name in enumerate(runs.configurations):
        own = runs.chosen(runs.configuration == number)
        done = own.chosen(own.is_done)
        numbers: dict[str, Distribution] = {}
        for key in keys:
            column = done.column(key)
            if (one := distribution(rng, column.label, column.values, done.log)) is not None:
                numbers[key] = one
        found.append(Summary(name, len(done), _count(own, FAILED), _count(own, MISSING), numbers))
    return tuple(found)


def _differences(rng: np.random.Generator, runs: Runs, base: int, keys: Sequence[str]) -> Differences:
    """Every other configuration against the baseline, corrected for their number."""
    return {key: tuple(_corrected(runs, key, _against(rng, runs, base, key))) for key in keys}


def _against(rng: np.random.Generator, runs: Runs, base: int, key: str) -> list[Difference]:
    column, log_of = runs.column(key), np.zeros(int(runs.pair.max(initial=0)) + 1, dtype=np.int64)
    log_of[runs.pair] = runs.log
    sides = [(runs.pair[own], column.values[own]) for own in (runs.configuration == i for i in _numbers(runs))]
    return [
        Difference(name, compare_pairs(rng, column.label, sides[base], sides[i], log_of))
        for i, name in enumerate(runs.configurations)
        if i != base
    ]


def _corrected(runs: Runs, key: str, found: Sequence[Difference]) -> list[Difference]:
    known = [d.found for d in found if d.found is not None]
    fresh = iter(corrected(known, runs.column(key).label.better))
    return [Difference(d.name, next(fresh) if d.found is not None else None) for d in found]


def _levels(
    rng: np.random.Generator, runs: Runs, key: str, base: int, metrics: Sequence[str], shown: Sequence[str]
) -> tuple[Level, ...]:
    """The same for each value of a fact; each is a question of its own, so p is corrected within it."""
    parts = [(name, runs.chosen(rows)) for name, rows in levels_of(runs, key)]
    return tuple(
        Level(
            name,
            len(np.unique(part.log)),
            _summaries(rng, part, shown),
            _differences(rng, part, base, metrics),
        )
        for name, part in parts
    )


def _contest(rng: np.random.Generator, runs: Runs, key: str) -> Contest | None:
    """None where fewer than two configurations or logs can be compared."""
    column, sign = runs.column(key), -1.0 if runs.column(key).label.better == "higher" else 1.0
    known = np.isfinite(column.values)
    entered = [i for i in _numbers(runs) if known[runs.configuration == i].any()]
    absent = tuple(name for i, name in enumerate(runs.configurations) if i not in entered)
    # only pairs that all have: a run that is missing in one is left out of all
    pairs, counts = np.unique(runs.pair[known], return_counts=True)
    common = pairs[counts == len(entered)]
    if len(entered) < 2 or not len(common):
        return None
    table = np.column_stack([_of_logs(runs, column.values, i, common) for i in entered])
    if len(table) < 2:
        return None
    best, means = find_best(rng, sign * table), table.mean(axis=0)
    order = np.lexsort((np.arange(len(entered)), sign * means)).tolist()
    candidates = tuple(
        Candidate(runs.configurations[entered[j]], float(means[j]), float(best.p_values[j]), float(best.chances[j]))
        for j in order
    )
    return Contest(key, column.label.unit, candidates, len(table), len(runs.logs), absent)


def _of_logs(runs: Runs, values: Float64Array, configuration: int, pairs: Float64Array) -> Float64Array:
    """(L,) mean of one configuration over the given pairs of each log, the logs in order."""
    rows = np.flatnonzero((runs.configuration == configuration) & np.isfinite(values) & np.isin(runs.pair, pairs))
    _, index, counts = np.unique(runs.log[rows], return_inverse=True, return_counts=True)
    return np.asarray(np.bincount(index, values[rows]) / counts)


def _worst(runs: Runs, key: str) -> tuple[OneRun, ...]:
    """The worst by a metric, the very worst first."""
    column = runs.column(key)
    known = np.flatnonzero(np.isfinite(column.values))
    sign = -1.0 if column.label.better == "higher" else 1.0
    order = known[np.argsort(-sign * column.values[known], kind="stable")][:_WORST]
    return tuple(_one(runs, i, float(column.values[i])) for i in order.tolist())


def _one(runs: Runs, row: int, value: float | None) -> OneRun:
    return OneRun(
        runs.configurations[runs.configuration[row]],
        runs.logs[runs.log[row]],
        int(runs.seeds[row]),
        value,
        runs.messages[row],
        runs.folders[row],
    )


def _count(runs: Runs, status: int) -> int:
    return int(np.sum(runs.status == status))


def _numbers(runs: Runs) -> range:
    return range(len(runs.configurations))
