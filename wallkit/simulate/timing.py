"""A sensor's rate and its faults -> when it measures, what it stamps, when its message is recorded, and what is lost."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wallkit.core.types import Int64Array
from wallkit.simulate.scenario import Timing


@dataclass(frozen=True, eq=False)
class Schedule:
    """Measurements in order: true times, header stamps and record times (M,) [ns after the log's beginning].

    `dropped` counts those that were measured but never recorded; they are not in the arrays.
    """

    times_ns: Int64Array
    stamps_ns: Int64Array
    logs_ns: Int64Array
    dropped: int


_NONE = np.zeros(0, dtype=np.int64)
NEVER = Schedule(_NONE, _NONE, _NONE, 0)


def schedule(rng: np.random.Generator, timing: Timing, rate_hz: float, duration_s: float) -> Schedule:
    """All measurements of one sensor in a log. Jitter never swaps two of them."""
    times = np.arange(timing.phase_s, duration_s, 1 / rate_hz)
    limit = 0.45 / rate_hz
    times = times + np.clip(rng.standard_normal(len(times)) * timing.jitter_s, -limit, limit)
    times = times[(times >= 0) & (times < duration_s)]
    keeps = rng.random(len(times)) >= timing.drops
    kept = times[keeps]
    stamps = kept + timing.offset_s + kept * timing.drift_ppm * 1e-6
    return Schedule(_ns(kept), _ns(stamps), _ns(kept + timing.latency_s), int((~keeps).sum()))


def _ns(seconds: np.ndarray) -> Int64Array:
    return np.round(seconds * 1e9).astype(np.int64)
