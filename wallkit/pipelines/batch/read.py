"""The store of a batch -> its runs as columns."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from wallkit.batch import store
from wallkit.core.results import Value
from wallkit.pipelines.batch.gather import Row, gather
from wallkit.pipelines.batch.runs import DONE, FAILED, MISSING, Runs, natural

_STATUS = {"done": DONE, "failed": FAILED, "waiting": MISSING}
# what the store knows of every run beside its metrics
_OWN = {
    "ended_well": Value("ended_well", None, "share", "share of the runs whose verdict is good (exit code 0)", "higher"),
    "run_s": Value("run_s", None, "s", "time the whole run took"),
    "run_cpu_s": Value("run_cpu_s", None, "s", "CPU time the whole run took"),
}


def is_batch(folder: Path) -> bool:
    """Whether wallkit batch wrote the folder."""
    return store.is_batch(folder)


def read_runs(folder: Path) -> Runs:
    """All runs that the last manifest asks for, configurations in its order; those that wait count as missing.

    Raises:
        WallkitError: the folder holds no batch, or a damaged one.
    """
    measures = store.read_measures(folder)
    labels = {n: Value(n, None, m.unit, m.definition, _BETTER.get(m.better, "")) for n, m in measures.items()}
    logs: dict[str, set[str]] = {}
    configurations: dict[str, None] = {}
    # twice through the table, so that only names are held
    for row in store.read_rows(folder):
        logs.setdefault(_subject(row.asked), set()).add(_readable(row.asked))
        configurations[row.asked.configuration] = None
    names, order = _names_of(logs), _order_in(store.read_about(folder).get("manifest", ""))
    return gather(
        _rows(folder, names),
        {**labels, **_OWN},
        configurations=sorted(configurations, key=lambda name: (order.get(name, len(order)), natural(name))),
        logs=sorted(names.values(), key=natural),
    )


_BETTER: Mapping[str, Any] = {"lower": "lower", "higher": "higher"}


def _rows(folder: Path, names: Mapping[str, str]) -> Iterator[Row]:
    for row in store.read_rows(folder):
        asked, came = row.asked, row.outcome
        # a batch that is planned anew meanwhile may have others
        log = names.get(_subject(asked), _subject(asked))
        inputs = (log, asked.map, asked.calibration, asked.job)
        is_done = came.status == "done"
        tags = {"job": asked.job, "verdict": came.verdict, **asked.tags}
        own = {"ended_well": float(came.exit_code == 0), "run_s": came.seconds, "run_cpu_s": came.cpu_s}
        yield Row(
            asked.name, asked.configuration, log, inputs, asked.seed, _STATUS[came.status],
            "" if is_done else came.message, str(folder / row.folder) if row.folder else "",
            tags, asked.settings, {**came.metrics, **own} if is_done else {},
        )  # fmt: skip


def _subject(asked: Any) -> str:
    """What runs of one log have in common, and of one map where a job has no log."""
    return str(asked.log or asked.calibration or asked.map)


def _readable(asked: Any) -> str:
    """The log's part of a run's name LOG/CONFIGURATION/seed-N."""
    return str(asked.name.removesuffix(f"/seed-{asked.seed}").removesuffix(f"/{asked.configuration}"))


def _names_of(logs: Mapping[str, set[str]]) -> dict[str, str]:
    """A name for each log: the one its runs bear, or its path where they bear several or share theirs with another log."""
    borne = [name for names in logs.values() for name in names]
    return {
        path: next(iter(names)) if len(names) == 1 and borne.count(next(iter(names))) == 1 else path
        for path, names in logs.items()
    }


def _order_in(manifest: str) -> dict[str, int]:
    """Where every word of the manifest stands in it, so that its first configuration is the baseline."""
    try:
        document = tomllib.loads(manifest)
    except (tomllib.TOMLDecodeError, TypeError):
        return {}
    order: dict[str, int] = {}
    for word in _words(document):
        order.setdefault(word, len(order))
    return order


def _words(value: Any) -> Iterator[str]:
    if isinstance(value, dict):
        for key, inner in value.items():
            yield key
            yield from _words(inner)
    elif isinstance(value, list):
        for inner in value:
            yield from _words(inner)
    elif isinstance(value, str):
        yield value
