"""Runs and what they are worth -> pages and the sentences at the top of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from wallkit.core.results import Comparison, Spread, Value
from wallkit.core.types import Health
from wallkit.errors import WallkitError
from wallkit.evaluate.statistics import compare_errors, compare_seeds, summarise
from wallkit.pipelines.evaluate import EvaluateSettings, Evaluation
from wallkit.pipelines.run_folder import RunRecord, ceiling_of
from wallkit.report.compare import CompareData, Contender
from wallkit.report.data import ReportData, Tone
from wallkit.report.html import write_comparison, write_report

Seeds = Sequence[tuple[RunRecord, Evaluation]]

COMPARED = ("ate_rmse_m", "heading_error_mean_deg")
COMPARED_IN_PAPERS = ("error_mean_m", "updates_to_converge")


def write_run_report(path: Path, record: RunRecord, evaluation: Evaluation, settings: EvaluateSettings) -> None:
    """The page of one run."""
    write_report(path, report_data(record, evaluation, settings))


def report_data(record: RunRecord, evaluation: Evaluation, settings: EvaluateSettings) -> ReportData:
    """One run, ready to be drawn."""
    verdict, tone = verdict_of(record, evaluation)
    no_truth = {
        f"scans without truth: {r}": n for r, n in (evaluation.pairs.dropped if evaluation.pairs else {}).items() if n
    }
    return ReportData(
        title=record.name,
        verdict=verdict,
        tone=tone,
        steps=record.steps,
        run=record.run,
        metrics={**evaluation.metrics, **record.resources},
        grid=record.grid,
        ceiling=ceiling_of(record.run),
        truth=record.truth,
        errors=evaluation.errors,
        odometry=record.odometry,
        episodes=evaluation.episodes,
        limits=settings.limits,
        snapshots=record.snapshots,
        dropped={**record.run["dropped"], **no_truth},
        settings=record.settings,
        photos=record.photos,
    )


def verdict_of(record: RunRecord, evaluation: Evaluation) -> tuple[str, Tone]:
    """The answer in one sentence, and whether it is good."""
    health, share = record.answer["health"], evaluation.metrics["localized_share"].value or 0.0
    false_healthy = evaluation.metrics.get("false_healthy")
    if false_healthy and false_healthy.value:
        count = int(false_healthy.value)
        return f"Wrong without knowing it: {count} scans were called LOCALIZED while the estimate was far off.", "bad"
    if health != Health.LOCALIZED.name:
        places = len(record.answer["modes"])
        rivals = f"; {places} places explain the last scans" if places > 1 else ""
        return f"Not localized at the end ({health}: {record.answer['reason']}){rivals}.", "unsure"
    ate = evaluation.metrics.get("ate_rmse_m")
    error = f", {100 * ate.value:.1f} cm (rmse) from the truth" if ate and ate.value is not None else ""
    return f"Localized at the end{error}; {share:.1%} of {len(record.steps)} scans are LOCALIZED.", "good"


def compare_runs(
    runs: Sequence[Seeds],
    names: Sequence[str],
    settings: EvaluateSettings,
    *,
    seed: int,
    keys: Sequence[str] = COMPARED,
) -> CompareData:
    """Several configurations side by side, each one run or several seeds of it, with tests of significance.

    Args:
        keys: what is tested, over the same seeds.

    Raises:
        WallkitError: fewer than two.
    """
    if len(runs) < 2:
        raise WallkitError("one run cannot be compared", hint="name two or more result folders")
    contenders = []
    for name, seeds in zip(names, runs, strict=True):
        record, evaluation = seeds[0]
        spreads = summarise([{**e.metrics, **r.resources} for r, e in seeds]) if len(seeds) > 1 else {}
        metrics = {**evaluation.metrics, **record.resources}
        contenders.append(Contender(name, metrics, spreads, report_data(record, evaluation, settings)))
    rng = np.random.default_rng(np.random.SeedSequence(seed))
    differences = []
    for name, seeds in zip(names[1:], runs[1:], strict=True):
        for comparison in _differences(rng, runs[0], seeds, keys):
            differences.append((names[0], name, comparison))
    best = _best_of(contenders)
    return CompareData(" against ".join(names), best, tuple(contenders), tuple(differences))


def write_compare_report(path: Path, data: CompareData) -> None:
    """The page of several runs."""
    write_comparison(path, data)


def _differences(rng: np.random.Generator, a: Seeds, b: Seeds, keys: Sequence[str]) -> Iterator[Comparison]:
    """Metric by metric over the same seeds, or scan by scan for single runs of one log."""
    errors_a, errors_b = a[0][1].errors, b[0][1].errors
    if len(a) > 1 and len(a) == len(b):
        for key in keys:
            left, right = _values(key, a), _values(key, b)
            if len(left) == len(right) == len(a):
                yield compare_seeds(rng, left, right)
    elif errors_a is not None and errors_b is not None:
        yield compare_errors(rng, errors_a, errors_b)


def _values(key: str, seeds: Seeds) -> list[Value]:
    """One metric of every seed that has it."""
    found = (e.metrics.get(key) for _, e in seeds)
    return [v for v in found if v is not None and v.value is not None]


def _best_of(contenders: Sequence[Contender]) -> str:
    def error_of(contender: Contender) -> float | None:
        value: Value | None = contender.metrics.get("ate_rmse_m")
        spread: Spread | None = contender.spreads.get("ate_rmse_m")
        return spread.mean if spread else value.value if value else None

    known = [(e, c.name) for c in contenders if (e := error_of(c)) is not None]
    if len(known) < len(contenders):
        return "Without a truth for every run only what the filters say of themselves can be compared."
    error, name = min(known)
    return f"{name} is nearest to the truth: {100 * error:.1f} cm (rmse)."
