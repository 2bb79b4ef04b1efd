"""Rows one after another -> columns; memory is that of the numbers, not of the rows."""

from __future__ import annotations

from array import array
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from wallkit.core.results import Value
from wallkit.core.types import Float64Array, Int64Array
from wallkit.pipelines.batch.runs import MISSING, Column, Runs, setting_text, with_shares


@dataclass(frozen=True, slots=True)
class Row:
    """One run as it was kept.

    Attributes:
        inputs: names of everything but the configuration and the seed that tells runs apart: log, map, calibration.
        tags: what the manifest says of the log. settings: what the configuration sets, by dotted key.
        metrics: by key; None: this run has no such number.
    """

    key: str
    configuration: str
    log: str
    inputs: tuple[str, ...]
    seed: int
    status: int
    message: str = ""
    folder: str = ""
    tags: Mapping[str, str] = field(default_factory=dict)
    settings: Mapping[str, object] = field(default_factory=dict)
    metrics: Mapping[str, float | None] = field(default_factory=dict)


def gather(
    rows: Iterable[Row], labels: Mapping[str, Value], *, configurations: Sequence[str] = (), logs: Sequence[str] = ()
) -> Runs:
    """All rows as columns; runs that another configuration has and this one has not are added as missing.

    Args:
        labels: unit, definition and which way is better, by metric; a metric without a label has no unit.
        configurations, logs: their order; what is not among them comes after, as it comes.
    """
    table = _Table(configurations, logs)
    for row in rows:
        table.add(row)
    table.add_missing()
    return table.runs(labels)


class _Names(dict[str, int]):
    """Numbers for names, in order of first use."""

    def number(self, name: str) -> int:
        return self.setdefault(name, len(self))


class _Table:
    def __init__(self, configurations: Sequence[str], logs: Sequence[str]) -> None:
        self.configurations = _Names((name, i) for i, name in enumerate(configurations))
        self.logs = _Names((name, i) for i, name in enumerate(logs))
        self.settings: dict[int, dict[str, object]] = {}
        self.pairs: dict[tuple[tuple[str, ...], int], int] = {}
        self.of_pair: list[Row] = []
        self.numbers = {name: array("q") for name in ("configuration", "log", "pair", "status", "seed")}
        self.columns: dict[str, array[float]] = {}
        self.tags: list[dict[str, str]] = []
        self.texts: dict[str, list[str]] = {"key": [], "message": [], "folder": []}

    def add(self, row: Row) -> None:
        count = len(self.numbers["status"])
        pair = self.pairs.setdefault((row.inputs, row.seed), len(self.pairs))
        if pair == len(self.of_pair):
            self.of_pair.append(row)
        configuration = self.configurations.number(row.configuration)
        self.settings.setdefault(configuration, dict(row.settings))
        for name, number in (
            ("configuration", configuration),
            ("log", self.logs.number(row.log)),
            ("pair", pair),
            ("status", row.status),
            ("seed", row.seed),
        ):
            self.numbers[name].append(number)
        for key, value in row.metrics.items():
            column = self.columns.setdefault(key, array("d"))
            column.extend([np.nan] * (count - len(column)))
            column.append(np.nan if value is None else value)
        self.tags.append({**dict(zip(("log", "map", "calibration"), row.inputs, strict=False)), **row.tags})
        for name, text in (("key", row.key), ("message", row.message), ("folder", row.folder)):
            self.texts[name].append(text)

    def add_missing(self) -> None:
        have = set(zip(self.numbers["configuration"], self.numbers["pair"], strict=True))
        for configuration, number in list(self.configurations.items()):
            for pair, like in enumerate(self.of_pair):
                if (number, pair) not in have:
                    self.add(Row("", configuration, like.log, like.inputs, like.seed, MISSING, tags=like.tags))

    def runs(self, labels: Mapping[str, Value]) -> Runs:
        numbers = {name: np.array(column, dtype=np.int64) for name, column in self.numbers.items()}
        count = len(numbers["status"])
        columns = {
            key: Column(labels.get(key, Value(key, None, "", "", "")), _filled(column, count))
            for key, column in self.columns.items()
        }
        return Runs(
            tuple(self.configurations), tuple(self.logs), numbers["configuration"], numbers["log"], numbers["pair"],
            numbers["status"], numbers["seed"], with_shares(columns), self._facts(numbers),
            self._settings(), tuple(self.texts["key"]), tuple(self.texts["message"]), tuple(self.texts["folder"]),
        )  # fmt: skip

    def _settings(self) -> tuple[dict[str, object], ...]:
        return tuple(self.settings.get(number, {}) for number in range(len(self.configurations)))

    def _facts(self, numbers: Mapping[str, Int64Array]) -> dict[str, tuple[str, ...]]:
        """Texts by key, for the tables by a factor; a setting counts where configurations differ in it."""
        keys = dict.fromkeys(key for tags in self.tags for key in tags)
        facts = {key: tuple(tags.get(key, "") for tags in self.tags) for key in keys}
        names = tuple(self.configurations)
        facts["seed"] = tuple(str(seed) for seed in numbers["seed"].tolist())
        facts["configuration"] = tuple(names[i] for i in numbers["configuration"].tolist())
        found = self._settings()
        for key in dict.fromkeys(key for settings in found for key in settings):
            values = [setting_text(settings.get(key)) for settings in found]
            if len(set(values)) > 1:
                facts[key] = tuple(values[i] for i in numbers["configuration"].tolist())
        return facts


def _filled(column: array[float], count: int) -> Float64Array:
    values = np.full(count, np.nan)
    values[: len(column)] = column
    return values
