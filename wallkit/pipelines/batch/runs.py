"""The rows of a batch -> columns that statistics can be taken of: which configuration, which log, what came out."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from wallkit.core.results import Value
from wallkit.core.types import BoolArray, Float64Array, Int64Array
from wallkit.errors import WallkitError

DONE, FAILED, MISSING = 0, 1, 2


@dataclass(frozen=True, slots=True)
class Column:
    """One metric of all runs: its label (key, unit, definition, better), and values (N,), NaN where a run has none."""

    label: Value
    values: Float64Array


@dataclass(frozen=True, eq=False)
class Runs:
    """N runs as columns.

    Attributes:
        configurations, logs: names, in the order of the batch.
        configuration, log: (N,) index into them.
        pair: (N,) number of (log, map, calibration, seed): equal for runs that differ in nothing but the configuration.
        status: (N,) DONE, FAILED or MISSING. A missing one was asked for, or another configuration has it.
        seeds: (N,) int64.
        columns: metrics by key. facts: (N,) texts by key: tags, log, map, seed, and settings that differ between runs.
        settings: for each configuration what it sets, by dotted key.
        keys, messages, folders: (N,) key of the run, what it failed of, and where its results are; "" for none.
    """

    configurations: tuple[str, ...]
    logs: tuple[str, ...]
    configuration: Int64Array
    log: Int64Array
    pair: Int64Array
    status: Int64Array
    seeds: Int64Array
    columns: Mapping[str, Column]
    facts: Mapping[str, tuple[str, ...]]
    settings: tuple[Mapping[str, object], ...]
    keys: tuple[str, ...]
    messages: tuple[str, ...]
    folders: tuple[str, ...] = field(default=())

    def __len__(self) -> int:
        return len(self.status)

    @property
    def is_done(self) -> BoolArray:
        """(N,)."""
        return np.asarray(self.status == DONE)

    def column(self, key: str) -> Column:
        """One metric.

        Raises:
            WallkitError: no run has it.
        """
        if key not in self.columns:
            raise WallkitError(
                f"no run of the batch has the number '{key}'", hint=f"one of: {', '.join(self.columns) or 'none'}"
            )
        return self.columns[key]

    def of(self, name: str) -> BoolArray:
        """(N,) the runs of one configuration.

        Raises:
            WallkitError: there is none of that name.
        """
        return np.asarray(self.configuration == index_of(self, name))

    def chosen(self, rows: BoolArray) -> Runs:
        """Some of the runs; configurations, logs and pair numbers stay."""
        at = np.flatnonzero(rows).tolist()

        def some(texts: Sequence[str]) -> tuple[str, ...]:
            return tuple(texts[i] for i in at)

        return replace(
            self,
            **{name: getattr(self, name)[rows] for name in ("configuration", "log", "pair", "status", "seeds")},
            columns={key: Column(c.label, c.values[rows]) for key, c in self.columns.items()},
            facts={key: some(texts) for key, texts in self.facts.items()},
            keys=some(self.keys), messages=some(self.messages), folders=some(self.folders),
        )  # fmt: skip


def index_of(runs: Runs, name: str) -> int:
    """Number of a configuration.

    Raises:
        WallkitError: there is none of that name.
    """
    if name not in runs.configurations:
        raise WallkitError(f"the batch has no configuration '{name}'", hint=f"one of: {', '.join(runs.configurations)}")
    return runs.configurations.index(name)


def with_parts_of_names(runs: Runs, pattern: str) -> Runs:
    """The runs with facts read from the name of their log: `{scene}-{people}-{take}` of `restroom-4-1`.

    Raises:
        WallkitError: the pattern names nothing, or a log's name does not fit it.
    """
    parts = re.split(r"\{(\w+)\}", pattern)
    names = parts[1::2]
    if not names or len(set(names)) < len(names):
        raise WallkitError(f"--names '{pattern}' names no part of a name, or one twice", hint="{scene}-{people}-{take}")
    regex = re.compile("".join(re.escape(p) if i % 2 == 0 else f"(?P<{p}>.+?)" for i, p in enumerate(parts)))
    found = [regex.fullmatch(log) for log in runs.logs]
    misfits = [log for log, match in zip(runs.logs, found, strict=True) if match is None]
    if misfits:
        raise WallkitError(
            f"--names '{pattern}' does not fit {len(misfits)} of {len(runs.logs)} logs, first '{misfits[0]}'",
            hint="write it as the logs are named, e.g. {scene}-{people}-{take} for restroom-4-1",
        )
    read = {
        name: tuple(str(match[name]) if (match := found[log]) else "" for log in runs.log.tolist()) for name in names
    }
    return replace(runs, facts={**runs.facts, **read})


def where(runs: Runs, words: str) -> Runs:
    """The runs with one of the values: `people=4,8,12`; logs and configurations without any are gone.

    Raises:
        WallkitError: it is written otherwise, or no run has such a fact or value.
    """
    key, equals, values = words.partition("=")
    if not equals:
        raise WallkitError(f"--where '{words}' says no values", hint=f"{words}=A or {words}=A,B")
    levels, wanted = dict(levels_of(runs, key)), [value.strip() for value in values.split(",")]
    if unknown := [value for value in wanted if value not in levels]:
        raise WallkitError(f"--where: no run has {key} = {unknown[0]}", hint=f"one of: {', '.join(levels)}")
    return _renumbered(runs.chosen(np.any([levels[value] for value in wanted], axis=0)))


def _renumbered(runs: Runs) -> Runs:
    """Without the names that no run has any more."""
    logs, log = np.unique(runs.log, return_inverse=True)
    configurations, configuration = np.unique(runs.configuration, return_inverse=True)
    return replace(
        runs,
        logs=tuple(runs.logs[i] for i in logs.tolist()),
        log=log,
        configurations=tuple(runs.configurations[i] for i in configurations.tolist()),
        settings=tuple(runs.settings[i] for i in configurations.tolist()),
        configuration=configuration,
    )


def levels_of(runs: Runs, key: str) -> list[tuple[str, BoolArray]]:
    """The values of a fact in their order (numbers as numbers), each with its runs (N,).

    Raises:
        WallkitError: no run has such a fact.
    """
    if key not in runs.facts:
        raise WallkitError(
            f"the batch cannot be told apart by '{key}'",
            hint=f"one of: {', '.join(sorted(runs.facts))}; or --names '{{scene}}-{{people}}-{{take}}' for names of logs",
        )
    texts = np.array(runs.facts[key], dtype=np.str_)
    return [(text, np.asarray(texts == text)) for text in sorted(set(texts.tolist()), key=natural)]


def setting_text(value: object) -> str:
    """A setting as a word; a list is its parts, an empty one `none`, what is not set `default`."""
    if isinstance(value, list | tuple):
        return "+".join(str(part) for part in value) or "none"
    return "default" if value is None else f"{value:.4g}" if isinstance(value, float) else str(value)


def natural(text: str) -> tuple[tuple[int, float, str], ...]:
    """Sorts 2 before 12, alone or inside of a name."""
    pieces = re.split(r"(\d+(?:\.\d+)?)", text)
    return tuple((0, float(p), "") if i % 2 else (1, 0.0, p) for i, p in enumerate(pieces) if p)


def with_shares(columns: Mapping[str, Column]) -> dict[str, Column]:
    """The metrics, and for each run whether it converged, was ever lost, and was ever wrong without knowing it."""
    known = dict(columns)
    judged = columns.get("error_mean_m")
    for key, source, definition, better in _SHARES:
        if judged is None or source not in columns:
            continue
        values = columns[source].values
        is_so = np.isfinite(values) if key == "converged" else values > 0
        shares = np.where(np.isfinite(judged.values), is_so, np.nan)
        known[key] = Column(Value(key, None, "share", definition, "higher" if better == "higher" else "lower"), shares)
    return known


_SHARES = (
    (
        "converged",
        "updates_to_converge",
        "share of the runs whose error ends under the limit and stays there",
        "higher",
    ),
    ("was_lost", "lost_episodes", "share of the runs that were lost at some scan", "lower"),
    ("was_false_healthy", "false_healthy", "share of the runs that called a lost estimate LOCALIZED", "lower"),
)
