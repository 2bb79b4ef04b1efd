"""A plan, a store and an engine -> every run done once, and a table as CSV; see `run_batch`."""

from __future__ import annotations

import csv
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO

import wallkit
from wallkit.batch.rows import Outcome
from wallkit.batch.store import LOCK, Store, is_batch, read_measures, read_rows
from wallkit.pipelines.batch.engines import Engine
from wallkit.pipelines.batch.jobs import measures_of
from wallkit.pipelines.batch.manifest import Read
from wallkit.pipelines.batch.plan import Plan
from wallkit.pipelines.batch.work import found_done
from wallkit.pipelines.outputs import check_out, whole_file

CSV = "batch.csv"
Observe = Callable[[int, int, int], None]


@dataclass(frozen=True)
class Ended:
    """How many runs there are, how many were done before, and how many failed."""

    runs: int
    before: int
    failed: int


def run_batch(
    read: Read, plan: Plan, store: Store, engine: Engine, *, retry: bool, observe: Observe = lambda *_: None
) -> Ended:
    """Do what is not done yet.

    Args:
        retry: also what failed.
        observe: told of (runs that have ended, all, failed among them).

    Raises:
        WallkitError: the engine cannot go on; what is done stays.
    """
    about = {
        "wallkit": wallkit.__version__,
        "manifest": read.text,
        "swept": read.swept,
        "configurations": [c.name for c in read.configurations],
    }
    store.plan(plan.asked(), about)
    store.add_measures(measures_of(read.manifest.job))
    if retry:
        store.forget_failures()
    _sweep_up(store.folder)
    _adopt(plan, store)
    counts = store.counts()
    ended, bad = counts["done"] + counts["failed"], counts["failed"]
    before = ended
    observe(ended, len(plan), bad)
    try:
        for outcomes in engine(plan.pieces(store.is_waiting)):
            store.add_all([(came, _folder(store.name_of(came.key), came)) for came in outcomes])
            ended, bad = ended + len(outcomes), bad + sum(came.status == "failed" for came in outcomes)
            observe(ended, len(plan), bad)
    finally:
        with whole_file(store.folder / CSV) as path, path.open("w", encoding="utf-8", newline="") as file:
            write_csv(store.folder, file)
    return Ended(len(plan), before, bad)


def write_csv(folder: Path, file: TextIO) -> None:
    """The table by run, a line at a time; columns that differ from machine to machine are last and begin with `timing.`."""
    measures = read_measures(folder)
    settings: dict[str, None] = {}
    metrics: dict[str, None] = {}
    for row in read_rows(folder):
        settings.update(dict.fromkeys(row.asked.settings))
        metrics.update(dict.fromkeys(row.outcome.metrics))
    timings = [key for key in sorted(metrics) if key in measures and measures[key].is_timing]
    numbers = [key for key in sorted(metrics) if key not in timings]
    asked = ("name", "job", "log", "map", "calibration", "configuration", "seed", "version", "key")
    came, when = ("status", "verdict", "exit_code", "message"), ("worker", "started", "seconds", "cpu_s")
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(
        [*asked, *came, "folder", *(f"set.{key}" for key in sorted(settings)), *(f"metrics.{key}" for key in numbers)]
        + [f"timing.{key}" for key in (*when, *timings)]
    )
    for row in read_rows(folder):
        a, o = row.asked, row.outcome
        cells: list[Any] = [getattr(a, key) for key in asked] + [getattr(o, key) for key in came] + [row.folder]
        cells += [_cell(a.settings.get(key)) for key in sorted(settings)]
        cells += [_cell(o.metrics.get(key)) for key in numbers]
        cells += [getattr(o, key) for key in when] + [_cell(o.metrics.get(key)) for key in timings]
        writer.writerow(cells)


def failures(folder: Path) -> Iterator[tuple[str, str, str]]:
    """(run, log, message) of every run that failed."""
    for row in read_rows(folder):
        if row.outcome.status == "failed":
            yield row.asked.name, row.asked.log, row.outcome.message


def _adopt(plan: Plan, store: Store) -> None:
    """Note the runs that are done but not in the table: the driver died before it heard of them."""
    for task in plan.tasks():
        if store.is_waiting(task.key) and (outcome := found_done(task)) is not None:
            store.add(outcome, _folder(task.name, outcome))


def _folder(name: str, outcome: Outcome) -> str:
    return f"runs/{name}" if outcome.status == "done" else ""


def _sweep_up(folder: Path) -> None:
    """Delete what processes that died have left half done."""
    for path in (folder / "runs").glob("**/.*.partial-*"):
        shutil.rmtree(path, ignore_errors=True)


def _cell(value: Any) -> Any:
    if isinstance(value, list | tuple):
        return "+".join(str(part) for part in value)
    return "" if value is None else value


def check_folder(out: Path) -> None:
    """Refuse a place that holds something else than a batch.

    Raises:
        OutputError: it is a file, or a folder with other things in it.
    """
    if not is_batch(out) and not (out / LOCK).is_file():
        check_out(out, overwrite=False)
