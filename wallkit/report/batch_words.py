"""A batch -> tables and sentences: the same on the terminal and on the page."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from wallkit.core.results import Distribution, Interval, Paired
from wallkit.report.batch import BatchData, Candidate, Contest, Difference, Factor, Level, OneRun, Summary
from wallkit.report.paper import MISSING, paper_text

WORDS = {
    "error_mean_m": "error",
    "ate_rmse_m": "rms error",
    "heading_error_mean_deg": "heading error",
    "update_mean_ms": "time per update",
    "cpu_percent": "CPU load",
    "peak_memory_mb": "peak memory",
    "updates_to_converge": "updates to converge",
    "lost_share": "share of scans lost",
    "was_lost": "share of runs ever lost",
    "converged": "share of runs converged",
    "was_false_healthy": "share of runs false healthy",
    "false_healthy": "false healthy scans",
}
Table = tuple[list[str], list[list[str]]]
# in a sentence: more of it and less of it
_SIDES = dict.fromkeys(("updates_to_converge", "false_healthy"), ("more", "fewer"))
_SIGNIFICANT_P, _FEWEST_LOGS = 0.05, 6
_SHOWN_RUNS = 5


def word_of(key: str) -> str:
    """What a metric is called in a sentence."""
    return WORDS.get(key, key)


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
    keys = [k for k in _OTHERS if any(k in s.numbers for s in data.summaries)]
    rows = [[s.name, *(_mean_cell(s.numbers.get(key)) for key in keys)] for s in data.summaries]
    return ["configuration", *(_OTHERS[key] for key in keys)], rows


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


def star_line(data: BatchData) -> str:
    """What `*` means in the tables by a factor, and where there are too few logs for one."""
    text = (
        f"* differs from {data.baseline}: p below {_SIGNIFICANT_P:g}, corrected for the comparisons of its level (Holm)"
    )
    few = [
        level.name
        for factor in data.factors
        for level in factor.levels
        if 2.0 ** (1 - level.logs) * (len(level.summaries) - 1) >= _SIGNIFICANT_P
    ]
    return f"{text}; too few logs for any: {', '.join(few)}" if few else text


def tested_line(key: str, baseline: str, count: int) -> str:
    """What the sentences below it say."""
    several = f"; p corrected for {count} comparisons (Holm)" if count > 1 else ""
    return f"{word_of(key)} against {baseline}, over the logs and seeds both have{several}:"


def difference_line(difference: Difference, key: str, baseline: str) -> str:
    """One comparison in a sentence: how much, how sure, over what; where the test and the mean disagree, both."""
    found, name, word = difference.found, difference.name, word_of(key)
    if found is None:
        return f"{name}: cannot be compared with {baseline}: no log and seed has a run of both"
    more, less = _SIDES.get(key, ("higher", "lower"))
    number = found.percent or found.difference
    side = less if number.value < 0 else more
    size = f"the same {word}" if number.value == 0 else f"{_size(found, number)} {side} {word}"
    if found.better != "neither":
        sure = f"{_interval(found, number)}, {_how_sure(found)}"
        return f"{name}: {size} than {baseline}, {sure}{_left_out(found, name, baseline)}"
    if is_undecided(found):
        rows = f"{word} {_most(found)} than with {baseline} ({_middle(found)}{_p_text(found)})"
        but = f"the mean, {_size(found, number)} {side} with a {_interval(found, number)}, is decided by a few"
        return f"{name}: {rows}; {but}{_left_out(found, name, baseline)}"
    least = 2.0 ** (1 - found.units)
    few = f" (too few: p cannot be below {least:.2g})" if least >= _SIGNIFICANT_P and found.units > 1 else ""
    how_sure = f"{_interval(found, number)}, {_how_sure(found)}{few}{_left_out(found, name, baseline)}"
    return f"{name}: no difference from {baseline} can be told: {size}, {how_sure}"


def is_undecided(found: Paired) -> bool:
    """The test and the interval of the mean do not agree: a few logs weigh as much as all the others."""
    low, high = found.difference.low, found.difference.high
    if found.p_holm is None or low is None or high is None or found.better != "neither":
        return False
    if found.p_holm < _SIGNIFICANT_P:
        return True
    # the mean is certain of a side that no more than half of the logs are on
    return (low > 0 or high < 0) and 2 * found.with_mean <= found.units


def contest_lines(contest: Contest | None, key: str) -> list[str]:
    """Which configurations may be the best."""
    if contest is None:
        return ["The best cannot be named: no two logs have a run of every configuration."]
    if contest.logs < _FEWEST_LOGS:
        return [f"The best cannot be named: {count_text(contest.logs, 'log')} that all have are too few."]
    able = [c for c in contest.candidates if c.may_be]
    of = f"over {contest.logs} of {contest.of_logs} logs (those that every configuration has)"
    if len(able) == 1:
        first = f"Best by {word_of(key)}: {_candidate(able[0], contest.unit)}; no other can be taken for it, {of}."
    elif len(able) == len(contest.candidates):
        first = f"Best by {word_of(key)}: any of the {len(able)} may be; they cannot be told apart {of}."
    else:
        names = "; ".join(_candidate(c, contest.unit) for c in able)
        first = f"Best by {word_of(key)}: one of these {len(able)} of {len(contest.candidates)}, {of}: {names}."
    return [first, *([f"No run to compare: {', '.join(contest.absent)}."] if contest.absent else [])]


def run_lines(runs: Sequence[OneRun], what: str) -> Iterator[str]:
    """How many there are, and the first of them."""
    if not runs:
        return
    yield f"{count_text(len(runs), 'run')} {what}:"
    for run in runs[:_SHOWN_RUNS]:
        message = run.message.strip().splitlines()[0] if run.message.strip() else ""
        yield f"  {run_name(run)}{f': {message}' if message else ''}"
    if len(runs) > _SHOWN_RUNS:
        yield f"  ... and {len(runs) - _SHOWN_RUNS} more (--json lists all)"


def run_name(run: OneRun) -> str:
    """Configuration, log and seed."""
    return f"{run.configuration}, {run.log}, seed {run.seed}"


def mean_text(number: float, unit: str) -> str:
    """A mean as papers print it; that of counts is no count."""
    return f"{number:.2f}" if unit in ("scans", "episodes") else paper_text(number, unit)


def count_text(number: int, what: str) -> str:
    """`1 log`, `2 logs`."""
    return f"{number} {what}{'' if number == 1 else 's'}"


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


def _size(found: Paired, number: Interval) -> str:
    """`12 %`: how large, without its sign."""
    value = abs(number.value)
    if found.percent:
        return f"{_digits(value)} %"
    return f"{_digits(100 * value)} points" if found.unit == "share" else mean_text(value, found.unit)


def _interval(found: Paired, number: Interval) -> str:
    """`95 % interval 3 to 20 %`, counted in the direction that is said."""
    if number.low is None or number.high is None:
        return "no interval"
    sign = -1.0 if number.value < 0 else 1.0
    low, high = sorted((sign * number.low, sign * number.high))
    if found.percent:
        return f"95 % interval {_digits(low)} to {_digits(high)} %"
    if found.unit == "share":
        return f"95 % interval {_digits(100 * low)} to {_digits(100 * high)} points"
    return f"95 % interval {mean_text(low, found.unit)} to {mean_text(high, found.unit)}"


def _digits(number: float) -> str:
    """Two digits that count, no more: 0.34, 3.4, 34."""
    rounded = f"{number:.0f}" if abs(number) >= 10 else f"{number:.1f}" if abs(number) >= 1 else f"{number:.2g}"
    return "0" if not float(rounded) else rounded


def _how_sure(found: Paired) -> str:
    units = count_text(found.units, "log") if found.over == "logs" else f"{found.units} seeds of one log"
    return f"{_p_text(found)}, {units}, better on {found.b_better}"


def _p_text(found: Paired) -> str:
    p = found.p_holm if found.p_holm is not None else found.p_value
    return "no test of a single one" if p is None else "p < 0.001" if p < 0.001 else f"p = {p:.2g}"


def _most(found: Paired) -> str:
    """`is better on 42 of 54 logs`, the side that has more of them."""
    is_better = found.b_better >= found.a_better
    count = found.b_better if is_better else found.a_better
    things = "logs" if found.over == "logs" else "seeds"
    return f"is {'better' if is_better else 'worse'} on {count} of {found.units} {things}"


def _middle(found: Paired) -> str:
    if found.middle is None:
        return ""
    return f"{found.middle.value:+.1f} % on the middle one, "


def _left_out(found: Paired, name: str, baseline: str) -> str:
    sides = ((found.alone_a, baseline), (found.alone_b, name))
    parts = [f"{count_text(count, 'run')} of {who}" for count, who in sides if count]
    return f"; left out for want of a partner: {', '.join(parts)}" if parts else ""


def _candidate(candidate: Candidate, unit: str) -> str:
    return f"{candidate.name} ({paper_text(candidate.mean, unit)}, first in {candidate.chance:.0%} of the draws)"
