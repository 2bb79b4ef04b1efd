"""A batch -> tables of words: a row for each configuration, the same on the terminal and on the page."""

from __future__ import annotations

from collections.abc import Sequence

from wallkit.core.results import FEWEST_PAIRS, Distribution
from wallkit.report.batch import BatchData, Factor, Level, Summary
from wallkit.report.batch_words import count_text, mean_text, word_of
from wallkit.report.paper import MISSING, paper_text

Table = tuple[list[str], list[list[str]]]


def error_table(data: BatchData) -> Table:
    """A row for each configuration: its runs, and how the metric in question is spread over them."""
    word = word_of(data.key)
    headers = [
        "configuration",
        "done",
        "failed",
        "missing",
        f"mean {word}",
        "95 %",
        "median",
        "p95",
        "worst",
        "sd of seeds",
    ]
    rows = []
    for s in data.summaries:
        found = s.numbers.get(data.key)
        cells = [MISSING] * 6 if found is None else _spread_cells(found)
        rows.append([s.name, str(s.done), str(s.failed), str(s.missing), *cells])
    return headers, rows


def other_table(data: BatchData) -> Table:
    """A row for each configuration: how often it held, and what it cost. Columns that no run has are left out."""
    known = dict.fromkeys(k for s in data.summaries for k in s.numbers if k != data.key)
    keys = [k for k in _OTHERS if k in known or k == data.key] if "error_mean_m" in data.labels else list(known)
    rows = [[s.name, *(_mean_cell(s.numbers.get(key)) for key in keys)] for s in data.summaries]
    return ["configuration", *(_OTHERS.get(key, key) for key in keys)], rows


def paper_table(summaries: Sequence[Summary]) -> Table:
    """The columns papers on localization print; updates to converge are of the runs that did."""
    headers = ["configuration", "runs", "converged", *_IN_PAPERS.values(), "sd over runs"]
    rows = []
    for s in summaries:
        cells = [_mean_cell(s.numbers.get(key)) for key in _IN_PAPERS]
        error = s.numbers.get("error_mean_m")
        sd = paper_text(error.sd, error.unit) if error is not None and error.sd is not None else MISSING
        rows.append([s.name, str(s.done), _mean_cell(s.numbers.get("converged")), *cells, sd])
    return headers, rows


def factor_table(factor: Factor, key: str) -> Table:
    """The mean of a metric by configuration and level; what differs from the baseline, and `*` where that is certain."""
    cells = {(s.name, level.name): _level_cell(level, s, key) for level in factor.levels for s in level.summaries}
    names = [s.name for s in factor.levels[0].summaries] if factor.levels else []
    levels = [(level.name, f"{level.name} ({count_text(level.logs, 'log')})") for level in factor.levels]
    # the longer of the two goes down the page
    if len(levels) > max(len(names), 8):
        return [factor.key, *names], [[text, *(cells[n, level] for n in names)] for level, text in levels]
    head = f"{factor.key} ="
    return [head, *(text for _, text in levels)], [[n, *(cells[n, level] for level, _ in levels)] for n in names]


def candidate_table(data: BatchData) -> Table | None:
    """Those that may be the best with their settings; None where none can be told from another."""
    contest = data.contest
    if contest is None or contest.logs < FEWEST_PAIRS or all(c.may_be for c in contest.candidates):
        return None
    able = [c for c in contest.candidates if c.may_be]
    keys = list(dict.fromkeys(key for c in able for key in data.settings.get(c.name, {})))
    rows = [
        [c.name, mean_text(c.mean, contest.unit), f"{c.chance:.0%}", *(data.settings[c.name].get(k, "") for k in keys)]
        for c in able
    ]
    return ["configuration", f"mean {word_of(data.key)}", "first in draws", *keys], rows


# -------------------------------------------------------------------------------------------- details

_OTHERS = {
    "converged": "converged",
    "was_lost": "ever lost",
    "lost_share": "scans lost",
    "was_false_healthy": "false healthy runs",
    "updates_to_converge": "updates to converge",
    "kept_share": "returns kept",
    "update_mean_ms": "time per update",
    "cpu_percent": "CPU",
    "peak_memory_mb": "memory",
}


_IN_PAPERS = {
    "update_mean_ms": "time per update",
    "cpu_percent": "CPU",
    "error_mean_m": "mean error",
    "updates_to_converge": "updates to converge",
    "peak_memory_mb": "memory",
    "false_healthy": "false healthy",
}


def _spread_cells(found: Distribution) -> list[str]:
    def text(number: float | None) -> str:
        return MISSING if number is None else mean_text(number, found.unit)

    mean = text(found.mean.value) + (f" ({found.without} without)" if found.without else "")
    low, high = text(found.mean.low), text(found.mean.high)
    bounds = MISSING if found.mean.low is None else f"{low} to {high}"
    return [mean, bounds, *(text(n) for n in (found.median.value, found.tail.value, found.worst, found.sd_seeds))]


def _mean_cell(found: Distribution | None) -> str:
    return MISSING if found is None else mean_text(found.mean.value, found.unit)


def _level_cell(level: Level, summary: Summary, key: str) -> str:
    text = _mean_cell(summary.numbers.get(key))
    for difference in level.differences.get(key, ()):
        found = difference.found
        if difference.name == summary.name and found is not None:
            certain = "" if found.better == "neither" else "*"
            change = f"{found.percent.value:+.0f} %" if found.percent else mean_text(found.difference.value, found.unit)
            text += f" {change}{certain}"
    if lost := summary.failed + summary.missing:
        text += f" ({summary.done} of {summary.done + lost} runs)"
    return text
