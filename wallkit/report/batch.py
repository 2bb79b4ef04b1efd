"""What is said of a batch: every configuration over all of its logs, and how much the others differ from one of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from wallkit.core.results import Distribution, Interval, Paired


@dataclass(frozen=True)
class Summary:
    """One configuration over its runs.

    Attributes:
        done, failed, missing: runs that ended, that ended with an error, and that are not there.
        numbers: by metric, of the runs that ended.
    """

    name: str
    done: int
    failed: int
    missing: int
    numbers: Mapping[str, Distribution]


@dataclass(frozen=True)
class Difference:
    """A configuration against the baseline by one metric; `found` is None without a run that both have."""

    name: str
    found: Paired | None


@dataclass(frozen=True)
class Level:
    """One value of a factor: its logs, the configurations over them, and the differences by metric."""

    name: str
    logs: int
    summaries: tuple[Summary, ...]
    differences: Mapping[str, tuple[Difference, ...]]


@dataclass(frozen=True)
class Factor:
    """What the runs are told apart by, e.g. how many people there are."""

    key: str
    levels: tuple[Level, ...]


@dataclass(frozen=True)
class Candidate:
    """A configuration that was looked at as the best.

    Attributes:
        p_value: below 0.05: it is not the best. chance: how often it was the best with the logs drawn again.
    """

    name: str
    mean: float
    p_value: float
    chance: float

    @property
    def may_be(self) -> bool:
        """It cannot be told from the best."""
        return self.p_value >= 0.05


@dataclass(frozen=True)
class Contest:
    """Which configurations may be the best by one metric, over the logs that all of them have.

    Attributes:
        candidates: from the best mean on. logs, of_logs: used, and in the batch.
        absent: configurations without a run to compare.
    """

    key: str
    unit: str
    candidates: tuple[Candidate, ...]
    logs: int
    of_logs: int
    absent: tuple[str, ...] = ()


@dataclass(frozen=True)
class Trade:
    """What a configuration costs and what it gives; on the front no other is better in both."""

    name: str
    cost: float
    loss: float
    is_front: bool


@dataclass(frozen=True)
class Effect:
    """What one swept setting does, over all values of the others.

    Attributes:
        levels: (value or range of values, configurations with it, mean over the logs).
        span_percent: from the best level to the worst, of the mean of all.
    """

    key: str
    levels: tuple[tuple[str, int, Interval], ...]
    span_percent: float


@dataclass(frozen=True)
class OneRun:
    """A run worth looking at: where it is, how bad it is (None: it failed or is missing), and what it said."""

    configuration: str
    log: str
    seed: int
    value: float | None
    message: str = ""
    folder: str = ""


@dataclass(frozen=True)
class BatchData:
    """A batch, ready to be told.

    Attributes:
        key: the metric the verdict is about; unit: its unit.
        baseline: what the others are compared with.
        differences: by metric.
        worst: runs, the worst first. failed, missing: runs, in order of the batch.
        labels: unit and definition of every metric.
        settings: of each configuration those that not all of them have, by key.
        trades: error against time; effects: of swept settings, the strongest first.
        quantiles: of the metric over the runs of each configuration, in rising order.
    """

    title: str
    key: str
    unit: str
    baseline: str
    logs: int
    summaries: tuple[Summary, ...]
    differences: Mapping[str, tuple[Difference, ...]]
    contest: Contest | None
    factors: tuple[Factor, ...]
    worst: tuple[OneRun, ...]
    failed: tuple[OneRun, ...]
    missing: tuple[OneRun, ...]
    labels: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    settings: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    trades: tuple[Trade, ...] = ()
    effects: tuple[Effect, ...] = ()
    quantiles: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
