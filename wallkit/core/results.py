"""The nouns that judge a run: limits, errors, episodes, numbers and their spread."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from wallkit.core.types import Float64Array, Int64Array

# of fewer pairs neither a signed-rank test reaches p = 0.05, nor does a bootstrapped interval hold as often as it says
FEWEST_PAIRS = 6


@dataclass(frozen=True, slots=True)
class Limits:
    """What right, wrong and good enough mean, for every verdict and every line in a figure."""

    converged_m: float = 0.5
    converged_deg: float = 10.0
    lost_m: float = 1.0
    lost_deg: float = 30.0
    available_m: float = 0.3
    available_deg: float = 5.0


@dataclass(frozen=True, slots=True)
class Errors:
    """How far the estimate is from the truth at each scan that has a truth.

    Attributes:
        stamps_ns: (E,) int64. rows: (E,) int64, the rows of the estimate that could be compared.
        position_m, heading_deg: (E,) float64, not negative.
    """

    stamps_ns: Int64Array
    rows: Int64Array
    position_m: Float64Array
    heading_deg: Float64Array

    def __len__(self) -> int:
        return len(self.stamps_ns)


@dataclass(frozen=True, slots=True)
class Value:
    """One number of a run: its key, value (None: does not exist for this run), unit and definition in one line."""

    key: str
    value: float | None
    unit: str
    definition: str
    better: Literal["lower", "higher", ""] = "lower"


@dataclass(frozen=True, slots=True)
class Episode:
    """A stretch of wrong estimates, and when the filter noticed. Stamps in ns; None: it did not happen.

    Attributes:
        start_ns: first scan that is lost by `Limits`.
        recovered_ns: first scan after it that is converged by `Limits`; the episode's end.
        unhealthy_ns: when the health left LOCALIZED; before start_ns when the filter doubted in time.
        said_lost_ns: when LOST was said.
        updates_to_lost: updates of the filter from start_ns, not counted, to said_lost_ns; 0 or less: in time.
        healthy_again_ns: first LOCALIZED after the recovery.
        worst_m, worst_deg: largest errors inside.
        false_healthy: scans inside that are lost by `Limits` and called LOCALIZED.
    """

    start_ns: int
    recovered_ns: int | None
    unhealthy_ns: int | None
    said_lost_ns: int | None
    updates_to_lost: int | None
    healthy_again_ns: int | None
    worst_m: float
    worst_deg: float
    false_healthy: int


@dataclass(frozen=True, slots=True)
class Spread:
    """One metric over several runs.

    Attributes:
        mean, sd: over the runs that have the number; sd divides by n - 1 and is None for a single one.
        worst: None also when a run lacks the number: a run that never converged must not make the worst look good.
        runs, missing: how many runs there are, and how many lack the number.
    """

    key: str
    unit: str
    mean: float | None
    sd: float | None
    worst: float | None
    runs: int
    missing: int


@dataclass(frozen=True, slots=True)
class Comparison:
    """How much b differs from a.

    Attributes:
        difference: mean of b - a. low, high: its 95 % interval; None of fewer than FEWEST_PAIRS.
        p_value: chance of a difference this large if there were none; two-sided.
        pairs: how many pairs it rests on. method: the test, in words.
    """

    key: str
    unit: str
    difference: float
    low: float | None
    high: float | None
    p_value: float
    pairs: int
    method: str
    better: Literal["a", "b", "neither"]


@dataclass(frozen=True, slots=True)
class Interval:
    """A number and the 95 % interval it lies in; None: too little was measured to tell."""

    value: float
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True, slots=True)
class Distribution:
    """One metric over the runs of many logs, every log counting alike.

    Attributes:
        mean, median, tail: tail is the number that 95 % of the runs are better than. Intervals are over logs.
        worst, worst_row: of the values that were given; an extreme has no interval.
        sd: over the runs. sd_seeds: within a log, over its seeds; None if no log has two runs.
        runs, logs: with the number. without: runs that ended but do not have it.
    """

    key: str
    unit: str
    mean: Interval
    median: Interval
    tail: Interval
    worst: float
    worst_row: int
    sd: float | None
    sd_seeds: float | None
    runs: int
    logs: int
    without: int


@dataclass(frozen=True, slots=True)
class Paired:
    """How much b differs from a over the logs that both have.

    Attributes:
        mean_a, mean_b: over the paired runs, every log counting alike.
        difference: b - a in the metric's unit. percent: of a's mean; None where that has no meaning (shares, a of zero).
        middle: median over the units of the change in per cent of a: what the test is about, where few logs decide the mean.
        p_value: two-sided, of this comparison alone. p_holm: corrected for all that were made at once, `tests` of them.
        units: how many independent things were compared. over: what they are.
        pairs: runs that have a partner. alone_a, alone_b: runs with the number that have none.
        b_better, a_better: on how many units. with_mean: on how many the difference has the sign of its mean.
    """

    key: str
    unit: str
    mean_a: float
    mean_b: float
    difference: Interval
    percent: Interval | None
    middle: Interval | None
    p_value: float | None
    p_holm: float | None
    units: int
    over: Literal["logs", "seeds of one log"]
    pairs: int
    alone_a: int
    alone_b: int
    b_better: int
    a_better: int
    with_mean: int
    better: Literal["a", "b", "neither"]
    tests: int = 1
