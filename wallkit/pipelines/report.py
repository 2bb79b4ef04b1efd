"""Runs and what they are worth -> pages and the sentences at the top of them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from wallkit.core.results import Comparison, Spread, Value
from wallkit.core.types import Health
from wallkit.errors import WallkitError
from wallkit.evaluate.statistics import compare_errors, compare_seeds, summarise
from wallkit.pipelines.evaluate import EvaluateSettings, Evaluation
from wallkit.pipelines.pairing import Seeds, check_one_log, pair_seeds
from wallkit.pipelines.run_folder import RunRecord, ceiling_of
from wallkit.report.compare import CompareData, Contender
from wallkit.report.data import ReportData, Tone
from wallkit.report.html import write_comparison, write_report

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
        WallkitError: fewer than two, or of different logs.
    """
    if len(runs) < 2:
        raise WallkitError("one run cannot be compared", hint="name two or more result folders")
    check_one_log(runs, names)
    contenders = []
    for name, seeds in zip(names, runs, strict=True):
        record, evaluation = seeds[0]
        spreads = summarise([{**e.metrics, **r.resources} for r, e in seeds]) if len(seeds) > 1 else {}
        metrics = {**evaluation.metrics, **record.resources}
        contenders.append(Contender(name, metrics, spreads, report_data(record, evaluation, settings)))
    rng = np.random.default_rng(np.random.SeedSequence(seed))
    differences, notes = [], []
    for name, seeds in zip(names[1:], runs[1:], strict=True):
        found, said = _differences(rng, runs[0], seeds, (names[0], name), keys)
        differences += [(names[0], name, comparison) for comparison in found]
        notes += said
    best = _best_of(contenders)
    return CompareData(" against ".join(names), best, tuple(contenders), tuple(differences), tuple(notes))


def write_compare_report(path: Path, data: CompareData) -> None:
    """The page of several runs."""
    write_comparison(path, data)


def _differences(
    rng: np.random.Generator, a: Seeds, b: Seeds, names: tuple[str, str], keys: Sequence[str]
) -> tuple[list[Comparison], list[str]]:
    """Metric by metric over the seeds both have, or scan by scan for a single pair; and in words what was not tested."""
    left, right, alone = pair_seeds(a, b, names)
    found, notes = [], list(alone)
    if len(left) > 1:
        for key in keys:
            values_a, values_b = _values(key, left), _values(key, right)
            known = len(values_a) + len(values_b)
            if known == len(left) + len(right):
                found.append(compare_seeds(rng, values_a, values_b))
            elif known:
                # to test only the seeds that have it would leave out the bad ones
                without = f"{len(left) + len(right) - known} of {len(left) + len(right)} runs have none"
                notes.append(f"{key} of {names[0]} and {names[1]} is not tested: {without}")
    elif left:
        errors_a, errors_b = left[0][1].errors, right[0][1].errors
        if errors_a is not None and errors_b is not None:
            found.append(compare_errors(rng, errors_a, errors_b))
    return found, notes


def _values(key: str, seeds: Seeds) -> list[Value]:
    """One metric of every seed that has it."""
    metrics = (e.metrics.get(key) for _, e in seeds)
    return [v for v in metrics if v is not None and v.value is not None]


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
