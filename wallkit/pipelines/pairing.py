"""Configurations, each one run or several seeds -> which of their runs are held against each other, and in words why not."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import PurePath

from wallkit.errors import WallkitError
from wallkit.pipelines.evaluate import Evaluation
from wallkit.pipelines.run_folder import RunRecord

Seeds = Sequence[tuple[RunRecord, Evaluation]]


def check_one_log(runs: Sequence[Seeds], names: Sequence[str]) -> None:
    """Refuse runs of different logs: the harder log would pass for the worse configuration.

    Raises:
        WallkitError: two runs are of different logs.
    """
    first, first_name = runs[0][0][0], names[0]
    for name, seeds in zip(names, runs, strict=True):
        for record, _ in seeds:
            if not _is_same_log(first, record):
                what = f"{_log_text(first)}, and {_log_text(record)}"
                where = first_name if name == first_name else f"{first_name} and {name}"
                hint = (
                    "compare runs of the same log, or give each configuration a folder with the results of all of its logs,"
                    " under the same names in each: wallkit compare basic/ filtered/"
                )
                raise WallkitError(f"runs of different logs cannot be compared: {what}", where=where, hint=hint)


def pair_seeds(a: Seeds, b: Seeds, names: tuple[str, str]) -> tuple[Seeds, Seeds, tuple[str, ...]]:
    """The runs of both that have the same seed, in the same order, and in words what that leaves out.

    Two single runs make a pair whatever their seeds. Where several have no seed in common, nothing is paired: the test over
    seeds is one of pairs.
    """
    seeds_a, seeds_b = _seeds(a), _seeds(b)
    if len(a) == len(b) == 1:
        other = f"seed {seeds_a[0]} of {names[0]} is held against seed {seeds_b[0]} of {names[1]}"
        return a, b, (other,) if seeds_a != seeds_b else ()
    for name, seeds in zip(names, (seeds_a, seeds_b), strict=True):
        if twice := [seed for seed, count in Counter(seeds).items() if count > 1]:
            return (), (), (f"{name} has several runs of {_seeds_text(twice)}, so nothing is tested against them",)
    common = [seed for seed in seeds_a if seed in seeds_b]
    if not common:
        has = f"{names[0]} has {_seeds_text(seeds_a)}, {names[1]} has {_seeds_text(seeds_b)}"
        return (), (), (f"{has}, none in common, so nothing is tested: run both with the same seeds",)
    notes = [
        f"{_seeds_text(alone)} of {name} has no partner and is left out of the tests"
        if len(alone) == 1
        else f"{_seeds_text(alone)} of {name} have no partner and are left out of the tests"
        for name, seeds in zip(names, (seeds_a, seeds_b), strict=True)
        if (alone := [seed for seed in seeds if seed not in common])
    ]
    if len(common) == 1:
        notes.append(f"{names[0]} and {names[1]} have seed {common[0]} alone in common, whose scans are compared")
    return [a[seeds_a.index(seed)] for seed in common], [b[seeds_b.index(seed)] for seed in common], tuple(notes)


def _is_same_log(a: RunRecord, b: RunRecord) -> bool:
    """By what is in the files, so that a copy elsewhere is the same log; by their names where a run has no hashes."""
    hashes_a, hashes_b = _hashes(a), _hashes(b)
    return hashes_a == hashes_b if hashes_a and hashes_b else _names(a) == _names(b)


def _hashes(record: RunRecord) -> list[str]:
    """sha256 of every file of the run's logs, sorted; empty where run.json lacks one."""
    logs = [PurePath(log) for log in record.run["logs"]]
    # once each: a calibration that lies in the folder of a log is listed again by the run that used it
    inputs = {PurePath(i["path"]): i.get("sha256", "") for i in record.run.get("inputs", ())}
    # a log may be a folder, whose files the run lists one by one
    of_logs = [[digest for path, digest in inputs.items() if path.is_relative_to(log)] for log in logs]
    found = [digest for digests in of_logs for digest in digests]
    return sorted(found) if all(of_logs) and all(found) else []


def _names(record: RunRecord) -> list[str]:
    return sorted(PurePath(log).name for log in record.run["logs"])


def _log_text(record: RunRecord) -> str:
    """The logs as the run was given them, and the start of their hashes: two logs of one name are told apart."""
    hashes = "".join(digest[:8] + " " for digest in _hashes(record)[:3]).strip()
    return " + ".join(record.run["logs"]) + (f" (sha256 {hashes}...)" if hashes else "")


def _seeds(runs: Seeds) -> list[int]:
    return [int(record.run["seed"]) for record, _ in runs]


def _seeds_text(seeds: Sequence[int]) -> str:
    return f"seed{'s' if len(seeds) > 1 else ''} {', '.join(str(seed) for seed in seeds)}"
