"""What a batch knows of each of its runs: what was asked, and what came of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

Status = Literal["waiting", "done", "failed"]


@dataclass(frozen=True)
class Asked:
    """One run as the manifest asks for it.

    Attributes:
        name: readable and unique in the batch, parts with '/' between: LOG/CONFIGURATION/seed-N.
        key: hash of its name, the content of its inputs, its settings, its seed and the version of wallkit: the same key,
            the same result.
        job: "localize", "calib verify", "map audit" or "simulate".
        log, map, calibration: the files, as named from where the manifest lies; "" where the job has none.
        tags: what the manifest says of the log: {"people": "4"}.
        configuration: its name. settings: what it sets, flat: {"localize.particles": 500}; all else is default.
    """

    name: str
    key: str
    job: str
    log: str
    map: str
    calibration: str
    configuration: str
    seed: int
    version: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    tags: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Outcome:
    """What came of a run.

    Attributes:
        key: of the run. status: "failed" is a run that could not be done; a bad verdict is "done".
        verdict: in the job's own word: LOCALIZED, LOST, ..., PASS, FAIL, CANNOT TELL; "" where it has none.
        exit_code: what the command by itself would have ended with.
        message: why it failed, or what is odd about it; "" without.
        metrics: key -> value, None where the number does not exist for this run.
        worker: which process did it. started: when, seconds since 1970. seconds, cpu_s: how long it took.
    """

    key: str
    status: Status
    verdict: str = ""
    exit_code: int = 0
    message: str = ""
    metrics: Mapping[str, float | None] = field(default_factory=dict)
    worker: str = ""
    started: float = 0.0
    seconds: float = 0.0
    cpu_s: float = 0.0


@dataclass(frozen=True)
class Row:
    """A run and what came of it so far.

    Attributes:
        folder: its results, named from the batch's folder; "" while there are none. Of a localization: a result folder as
            `wallkit localize` writes it, by default without result.mcap, snapshots and report.
    """

    asked: Asked
    outcome: Outcome
    folder: str


@dataclass(frozen=True)
class Measure:
    """What a metric is.

    Attributes:
        better: "lower", "higher" or "". is_timing: differs from machine to machine, so no part of what is compared byte
            for byte.
    """

    name: str
    unit: str
    definition: str = ""
    better: str = ""
    is_timing: bool = False
