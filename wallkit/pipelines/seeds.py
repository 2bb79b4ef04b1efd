"""One prepared run and a seed -> its folder; several seeds -> their mean, spread and worst."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from wallkit.evaluate.resources import Mark
from wallkit.evaluate.statistics import summarise
from wallkit.pipelines.config import LoadedConfig
from wallkit.pipelines.evaluate import Evaluation, evaluate_steps
from wallkit.pipelines.localize import Observer, Prepared, Run, localize
from wallkit.pipelines.overlays import REPORT_DEFAULT, write_overlays
from wallkit.pipelines.report import write_run_report
from wallkit.pipelines.run_folder import RESULT_MCAP, RunRecord, record_of, write_json, write_run
from wallkit.report.data import Photo

Records = Sequence[tuple[RunRecord, Evaluation]]


def run_seed(
    prepared: Prepared,
    loaded: LoadedConfig,
    folder: Path,
    *,
    seed: int | None = None,
    mark: Mark | None = None,
    observe: Observer | None = None,
) -> tuple[Run, RunRecord, Evaluation]:
    """Localize and write everything into a folder.

    Args:
        seed: one of several, which leaves result.mcap and the report out; None: the only one, with both.
    """
    is_alone = seed is None
    if seed is not None:
        prepared = replace(prepared, request=replace(prepared.request, seed=seed))
        folder.mkdir(parents=True)
    moments = prepared.request.cameras.overlays or (REPORT_DEFAULT if is_alone else 0)
    result_mcap = folder / RESULT_MCAP if is_alone else None
    run = localize(prepared, result_mcap=result_mcap, observe=observe, mark=mark, moments=moments)
    evaluation = evaluate_steps(run.steps, prepared.truth, prepared.config.evaluate)
    wants_files = prepared.request.cameras.overlays > 0
    photos: tuple[Photo, ...] = ()
    if is_alone or wants_files:
        with run.timers.phase("report"):
            photos = write_overlays(folder, prepared.log, run.moments, with_files=wants_files)
    if is_alone:
        with run.timers.phase("report"):
            # drawn before the numbers are written, so that they include its time and memory
            record = replace(record_of(run, evaluation, loaded), photos=photos)
            write_run_report(folder / "report.html", record, evaluation, prepared.config.evaluate)
    record = replace(record_of(run, evaluation, loaded), photos=photos)
    write_run(folder, record)
    return run, record, evaluation


def write_seeds(folder: Path, records: Records) -> None:
    """metrics.json and run.json over several seeds, beside their folders."""
    write_json(folder / "metrics.json", summary_document(records))
    first = records[0][0].run
    write_json(folder / "run.json", {**first, "seeds": [record.run["seed"] for record, _ in records]})


def summary_document(records: Records) -> dict[str, Any]:
    """Mean, sd and worst of every number over the seeds."""
    spreads = summarise([{**evaluation.metrics, **record.resources} for record, evaluation in records])
    return {
        "schema": 1,
        "seeds": [record.run["seed"] for record, _ in records],
        "health": [record.answer["health"] for record, _ in records],
        "metrics": {key: asdict(spread) for key, spread in spreads.items()},
    }
