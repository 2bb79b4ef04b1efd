"""A batch -> sentences: the same on the terminal and on the page."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from wallkit.core.results import FEWEST_PAIRS, Interval, Paired
from wallkit.report.batch import BatchData, Candidate, Contest, Difference, OneRun
from wallkit.report.paper import paper_text

WORDS = {
    "error_mean_m": "error",
    "ate_rmse_m": "rms error",
    "heading_error_mean_deg": "heading error",
    "update_mean_ms": "time per update",
    "cpu_percent": "CPU load",
    "peak_memory_mb": "peak memory",
    "updates_to_converge": "updates to converge",
    "lost_share": "share of scans lost",
    "ended_well": "share of runs that end well",
    "was_lost": "share of runs ever lost",
    "converged": "share of runs converged",
    "was_false_healthy": "share of runs false healthy",
    "false_healthy": "false healthy scans",
}
# in a sentence: more of it and less of it
_SIDES = dict.fromkeys(("updates_to_converge", "false_healthy"), ("more", "fewer"))
_SIGNIFICANT_P = 0.05
_SHOWN_RUNS, _MOST_SENTENCES = 5, 12


def word_of(key: str) -> str:
    """What a metric is called in a sentence."""
    return WORDS.get(key, key)


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


def difference_lines(differences: Sequence[Difference], key: str, baseline: str) -> Iterator[str]:
    """A sentence for each; of many only for those that are better, and the others by name."""
    if len(differences) <= _MOST_SENTENCES:
        yield from (difference_line(d, key, baseline) for d in differences)
        return
    known = sorted((d for d in differences if d.found is not None), key=lambda d: _change(d.found))
    yield from (difference_line(d, key, baseline) for d in known if d.found is not None and d.found.better == "b")
    groups = {
        "worse": [d.name for d in known if d.found is not None and d.found.better == "a"],
        "most logs and the mean do not agree": [d.name for d in known if d.found is not None and is_undecided(d.found)],
        "no run in common": [d.name for d in differences if d.found is None],
    }
    said = {name for names in groups.values() for name in names}
    rest = [d.name for d in known if d.name not in said and d.found is not None and d.found.better == "neither"]
    for what, names in {**groups, "no difference can be told": rest}.items():
        if names:
            yield f"{what}: {len(names)} of {len(differences)}: {', '.join(names)}"


def _change(found: Paired | None) -> float:
    return 0.0 if found is None else found.percent.value if found.percent else found.difference.value


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
    # what all logs agreeing would give
    least = min(1.0, 2.0 ** (1 - found.units) * found.tests)
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
    if contest.logs < FEWEST_PAIRS:
        return [f"The best cannot be named: {count_text(contest.logs, 'log')} that all have are too few."]
    able = [c for c in contest.candidates if c.may_be]
    of = f"over {contest.logs} of {contest.of_logs} logs (those that every configuration has)"
    if len(able) == 1:
        first = f"Best by {word_of(key)}: {_candidate(able[0], contest.unit)}; no other can be taken for it, {of}."
    elif len(able) == len(contest.candidates):
        first = f"Best by {word_of(key)}: any of the {len(able)} may be; all pairs at once cannot be told apart {of}."
    else:
        names = "; ".join(_candidate(c, contest.unit) for c in able)
        first = f"Best by {word_of(key)}: one of these {len(able)} of {len(contest.candidates)}, {of}: {names}."
    return [first, *([f"No run to compare: {', '.join(contest.absent)}."] if contest.absent else [])]


def verdict_lines(data: BatchData) -> list[str]:
    """What stands at the top: who is better, and what is not there."""
    lost = len(data.failed) + len(data.missing)
    absent = [f"{count_text(len(data.failed), 'run')} failed and {len(data.missing)} are missing."] if lost else []
    if len(data.summaries) < 2:
        found = data.summaries[0].numbers.get(data.key)
        mean = "none" if found is None else mean_text(found.mean.value, found.unit)
        return [
            f"{data.summaries[0].name}: mean {word_of(data.key)} {mean} over {count_text(data.logs, 'log')}.",
            *absent,
        ]
    differences = data.differences.get(data.key, ())
    better = [d.name for d in differences if d.found is not None and d.found.better == "b"]
    worse = [d.name for d in differences if d.found is not None and d.found.better == "a"]
    parts = [f"{side} than {data.baseline}: {', '.join(n)}" for side, n in (("Better", better), ("worse", worse)) if n]
    said = "; ".join(parts) or f"By {word_of(data.key)} no configuration can be told from {data.baseline}"
    able = [c.name for c in data.contest.candidates if c.may_be] if data.contest else []
    # all pairs at once tell less apart than the comparisons with the baseline: no line that seems to deny the first
    is_told = len(able) < len(data.summaries) and not (better and data.baseline in able)
    best = contest_lines(data.contest, data.key)[:1] if data.contest and is_told else []
    # of a sweep the first is an arbitrary point, which nobody asked about
    first = [] if best and not parts else [f"{said[0].upper()}{said[1:]}."]
    return [*first, *best, *absent]


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
    side = f"worse on {found.a_better}" if found.better == "a" else f"better on {found.b_better}"
    return f"{_p_text(found)}, {units}, {side}"


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
