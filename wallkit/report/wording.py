"""Numbers, health and episodes -> the words and rows of a page."""

from __future__ import annotations

import json
import shlex
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from wallkit.core.results import FEWEST_PAIRS, Comparison, Episode, Spread, Value
from wallkit.core.steps import Steps, health_runs
from wallkit.core.types import Health
from wallkit.report.canvas import time_text
from wallkit.report.data import ReportData, flatten

_DOUBTS_MAX = 30
# unit -> digits after the point, and the words that follow the number
_FORMATS: Mapping[str, tuple[int, str]] = {
    "m": (3, " m"),
    "deg": (2, "°"),
    "s": (1, " s"),
    "ms": (2, " ms"),
    "%": (0, " %"),
    "MB": (0, " MB"),
    "updates": (0, ""),
    "scans": (0, ""),
    "episodes": (0, ""),
}
_NEVER = ("updates_to_converge", "seconds_to_converge")


@dataclass(frozen=True, slots=True)
class Doubt:
    """A stretch in which the filter did not call itself LOCALIZED, in words."""

    start: str
    length: str
    said: str
    reason: str


@dataclass(frozen=True, slots=True)
class EpisodeRow:
    """A stretch in which the estimate was wrong, in words; times are counted from its start."""

    start: str
    length: str
    worst: str
    doubted: str
    said_lost: str
    healthy_again: str
    false_healthy: int


def value_text(value: Value) -> str:
    """A number with its unit; a number that does not exist says so."""
    if value.value is None:
        return "never" if value.key in _NEVER else "none"
    return number_text(value.value, value.unit)


def interval_text(found: Comparison, text: Callable[[float, str], str]) -> str:
    """Between what the difference lies, its numbers as `text` writes them; or why that is not known."""
    if found.low is None or found.high is None:
        return f"no 95 % interval of fewer than {FEWEST_PAIRS} pairs"
    return f"95 % between {text(found.low, found.unit)} and {text(found.high, found.unit)}"


def number_text(number: float, unit: str) -> str:
    """A number as people read it: 0.057 m, 98.4 %, 1.31°."""
    if unit == "share":
        return f"{100 * number:.1f} %"
    digits, words = _FORMATS.get(unit, (3, f" {unit}"))
    return f"{number:.{digits}f}{words}"


def spread_text(spread: Spread) -> str:
    """Mean, spread and worst of several runs in one cell."""
    if spread.mean is None:
        return "never" if spread.key in _NEVER else "none"
    text = number_text(spread.mean, spread.unit)
    if spread.sd is not None:
        text += f" ± {number_text(spread.sd, spread.unit)}"
    if spread.worst is not None and spread.runs > 1:
        text += f", worst {number_text(spread.worst, spread.unit)}"
    return text + (f", {spread.missing} of {spread.runs} without" if spread.missing else "")


def doubts(steps: Steps) -> tuple[list[Doubt], int]:
    """The longest stretches of doubt in order of time, and how many shorter ones are left out."""
    spans = list(_doubt_spans(steps))
    longest = sorted(spans, key=lambda span: steps.stamps_ns[span[0]] - steps.stamps_ns[span[1]])[:_DOUBTS_MAX]
    return [_doubt(steps, span) for span in sorted(longest)], len(spans) - len(longest)


def _doubt_spans(steps: Steps) -> Iterator[tuple[int, int]]:
    """Rows [first, last] of each stretch that is not LOCALIZED; last is the row that ends it, if there is one."""
    start = None
    for first, _, state in health_runs(steps.health):
        if state == Health.LOCALIZED and start is not None:
            yield start, first
            start = None
        elif state != Health.LOCALIZED and start is None:
            start = first
    if start is not None:
        yield start, len(steps) - 1


def _doubt(steps: Steps, span: tuple[int, int]) -> Doubt:
    first, last = span
    inside = slice(first, max(last, first + 1))
    worst = Health(int(steps.health[inside].min()))
    row = first + int((steps.health[inside] == worst).argmax())
    seconds = float(steps.stamps_ns[last] - steps.stamps_ns[first]) / 1e9
    start = time_text(steps, int(steps.stamps_ns[first]))
    return Doubt(start, f"{seconds:.1f} s", worst.name, steps.reasons[row])


def episode_rows(data: ReportData) -> list[EpisodeRow]:
    """The wrong stretches in words."""
    return [_episode_row(data.steps, episode) for episode in data.episodes]


def _episode_row(steps: Steps, episode: Episode) -> EpisodeRow:
    def after(stamp_ns: int | None) -> str:
        if stamp_ns is None:
            return "never"
        seconds = (stamp_ns - episode.start_ns) / 1e9
        return "at once" if seconds == 0 else f"{seconds:.1f} s later" if seconds > 0 else f"{-seconds:.1f} s before"

    said = after(episode.said_lost_ns)
    if episode.updates_to_lost is not None and episode.updates_to_lost > 0:
        said += f" ({episode.updates_to_lost} updates)"
    return EpisodeRow(
        start=time_text(steps, episode.start_ns),
        length="to the end"
        if episode.recovered_ns is None
        else f"{(episode.recovered_ns - episode.start_ns) / 1e9:.1f} s",
        worst=f"{episode.worst_m:.2f} m, {episode.worst_deg:.0f}°",
        doubted=after(episode.unhealthy_ns),
        said_lost=said,
        healthy_again=after(episode.healthy_again_ns),
        false_healthy=episode.false_healthy,
    )


def run_rows(run: Mapping[str, Any]) -> list[tuple[str, str]]:
    """run.json as rows; the settings have a table of their own."""
    rows = flatten({key: value for key, value in run.items() if key != "config"})
    return [(key, _plain(key, value)) for key, value in rows.items()]


def plain(value: Any) -> str:
    """A setting or an entry of run.json in one line."""
    return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False, default=str)


def _plain(key: str, value: Any) -> str:
    is_command = key == "argv" and isinstance(value, list | tuple)
    return shlex.join(str(word) for word in value) if is_command else plain(value)
