"""What a run costs -> CPU load, peak memory, time per update and per phase."""

from __future__ import annotations

import re
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from wallkit.core.results import Value
from wallkit.core.types import Float64Array

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Mark:
    """A moment of this process: wall clock and CPU time of all its threads."""

    wall_ns: int
    cpu_ns: int


@dataclass
class Timers:
    """Wall time by phase; a phase entered again adds up.

    Attributes:
        seconds: phase -> seconds, in the order of first use.
    """

    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Adds the time of the `with` block to the phase."""
        start_ns = time.perf_counter_ns()
        try:
            yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + (time.perf_counter_ns() - start_ns) / 1e9

    def each(self, name: str, items: Iterable[T]) -> Iterator[T]:
        """The same items, with the time that making each one takes added to the phase."""
        iterator = iter(items)
        while True:
            with self.phase(name):
                item = next(iterator, _END)
            if item is _END:
                return
            yield item  # type: ignore[misc]  # everything but the mark is a T


_END = object()


def mark_now() -> Mark:
    """The moment to measure from."""
    return Mark(time.perf_counter_ns(), time.process_time_ns())


def begin() -> Mark:
    """The moment a run begins: the peak of memory is counted anew, where the system allows it (Linux)."""
    with suppress(OSError):
        # proc(5): 5 resets VmHWM to what is resident now
        Path("/proc/self/clear_refs").write_text("5")
    return mark_now()


def usage_since(mark: Mark) -> dict[str, Value]:
    """wall_s and cpu_percent of this process since the mark, and its peak_memory_mb since `begin`."""
    wall_s = (time.perf_counter_ns() - mark.wall_ns) / 1e9
    cpu_s = (time.process_time_ns() - mark.cpu_ns) / 1e9
    values = (
        Value("wall_s", wall_s, "s", "time the run took"),
        Value("cpu_percent", 100 * cpu_s / wall_s, "%", "CPU time over wall time; 100 is one core fully used"),
        Value(
            "peak_memory_mb",
            peak_memory_mb(),
            "MB",
            "largest resident memory of the process during the run, 1 MB is 10⁶ bytes",
        ),
    )
    return {value.key: value for value in values}


def update_times(update_ms: Float64Array) -> dict[str, Value]:
    """Mean, median and 95th percentile of the time per update (T,) [ms], NaN left out; None without an update."""
    update_ms = update_ms[np.isfinite(update_ms)]
    definitions: dict[str, tuple[str, Callable[[Float64Array], Any]]] = {
        "update_mean_ms": ("mean time per update", np.mean),
        "update_median_ms": ("median time per update", np.median),
        "update_p95_ms": ("95 % of the updates take less than this", lambda times: np.percentile(times, 95)),
    }
    return {
        key: Value(key, float(statistic(update_ms)) if len(update_ms) else None, "ms", definition)
        for key, (definition, statistic) in definitions.items()
    }


def peak_memory_mb() -> float | None:
    """Largest resident memory of this process since `begin` [10^6 bytes]; None where the system does not tell (Windows).

    Linux is asked for VmHWM: getrusage's ru_maxrss survives exec, so a small process started by a large one would
    report the large one's peak. macOS has only ru_maxrss, in bytes where Linux counts KiB (getrusage(2)).
    """
    status = Path("/proc/self/status")
    if status.exists() and (match := re.search(r"^VmHWM:\s+(\d+) kB", status.read_text(), re.MULTILINE)):
        return int(match[1]) * 1024 / 1e6
    try:
        import resource
    except ImportError:
        return None
    unit_bytes = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit_bytes / 1e6
