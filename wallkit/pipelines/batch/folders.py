"""Folders of result folders, one for each configuration -> the runs in them, as a batch would list them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from wallkit.core.results import Value
from wallkit.pipelines.batch.gather import Row, gather
from wallkit.pipelines.batch.labels import labels_of_runs
from wallkit.pipelines.batch.runs import DONE, FAILED, Runs
from wallkit.pipelines.run_folder import read_json, results_in, seed_folders
from wallkit.report.data import flatten


def is_folder_of_runs(folder: Path) -> bool:
    """Whether a folder holds result folders, and is none itself."""
    return not (folder / "run.json").is_file() and bool(results_in(folder))


def configurations_in(folder: Path) -> tuple[Path, ...]:
    """The folders of result folders inside a folder that is neither: one for each configuration, by name."""
    if not folder.is_dir() or (folder / "run.json").is_file() or is_folder_of_runs(folder):
        return ()
    return tuple(sorted(path for path in folder.iterdir() if path.is_dir() and is_folder_of_runs(path)))


def read_folders(folders: Sequence[Path], names: Sequence[str]) -> Runs:
    """The runs of every configuration; a log is the result folder's name, which is the same in each of them.

    Raises:
        WallkitError: a result cannot be read.
    """
    labels = labels_of_runs()
    rows = (row for folder, name in zip(folders, names, strict=True) for row in _rows(folder, name, labels))
    return gather(rows, labels)


def _rows(folder: Path, name: str, labels: dict[str, Value]) -> Iterator[Row]:
    results = results_in(folder)
    for log in sorted(path for path in folder.iterdir() if path.is_dir()):
        if log not in results and (log / "run.json").is_file():
            continue
        # one that was stopped has seeds without numbers, or nothing at all
        for run in seed_folders(log) or [log]:
            if (run / "metrics.json").is_file():
                answer, config = read_json(run / "metrics.json"), read_json(run / "run.json")["config"]
                metrics = {key: answer[key] for key in labels if key in answer}
                seed, status, message = int(answer["seed"]), DONE, ""
            else:
                metrics, config = {}, {}
                seed, status, message = _number(run) if run != log else 0, FAILED, "stopped before it ended"
            row = Row(str(run), name, log.name, (log.name,), seed, status, message, str(run))
            yield replace(row, settings=flatten(config), metrics=metrics)


def _number(folder: Path) -> int:
    """N of seed-N."""
    text = folder.name.removeprefix("seed-")
    return int(text) if text.isdigit() else 0
