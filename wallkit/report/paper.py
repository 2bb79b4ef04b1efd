"""Several configurations -> the table that papers on localization print: a row for each, over all of its runs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from wallkit.report.compare import CompareData, Contender
from wallkit.report.wording import interval_text, number_text

MISSING = "-"


@dataclass(frozen=True, slots=True)
class Column:
    """A column: its heading, the metric, and which statistic over the runs."""

    heading: str
    key: str
    statistic: str = "mean"


COLUMNS = (
    Column("time per update", "update_mean_ms"),
    Column("CPU", "cpu_percent"),
    Column("mean error", "error_mean_m"),
    Column("updates to converge", "updates_to_converge"),
    Column("sd of error over runs", "error_mean_m", "sd"),
    Column("memory", "peak_memory_mb"),
    Column("false healthy", "false_healthy"),
)


def paper_headers(columns: Sequence[Column] = COLUMNS) -> list[str]:
    """Of `paper_rows`."""
    return ["configuration", "runs", "converged", *(column.heading for column in columns)]


def paper_rows(data: CompareData, columns: Sequence[Column] = COLUMNS) -> list[list[str]]:
    """A row for each configuration: name, runs, those that converged, and the columns; what is not known is a dash.

    Updates to converge are of the runs that did; the number of those stands beside it.
    """
    return [[c.name, *_runs(c), *(_cell(c, column) for column in columns)] for c in data.contenders]


def _runs(contender: Contender) -> tuple[str, str]:
    spread = contender.spreads.get("updates_to_converge")
    if spread is not None:
        return str(spread.runs), str(spread.runs - spread.missing)
    value = contender.metrics.get("updates_to_converge")
    return "1", MISSING if value is None else "1" if value.value is not None else "0"


def _cell(contender: Contender, column: Column) -> str:
    value, spread = contender.metrics.get(column.key), contender.spreads.get(column.key)
    unit = value.unit if value else spread.unit if spread else ""
    found = _STATISTICS[column.statistic](contender, column.key)
    return MISSING if found is None else paper_text(found, unit)


def paper_differences(data: CompareData) -> list[str]:
    """A sentence for each comparison with the first configuration, with its interval and test."""
    found = []
    for a, b, c in data.differences:
        verdict = {"a": f"{a} is better", "b": f"{b} is better", "neither": "no difference can be told"}[c.better]
        what = f"{c.key}: {verdict}: {b} - {a} = {paper_text(c.difference, c.unit)} ({interval_text(c, paper_text)})"
        found.append(f"{what} [p = {c.p_value:.2g}, {c.pairs} pairs, {c.method}]")
    return found


def paper_text(number: float, unit: str) -> str:
    """A number as papers print it: errors in hundredths of a centimetre, updates in tenths."""
    return (
        f"{100 * number:.2f} cm" if unit == "m" else f"{number:.1f}" if unit == "updates" else number_text(number, unit)
    )


def _mean(contender: Contender, key: str) -> float | None:
    spread, value = contender.spreads.get(key), contender.metrics.get(key)
    return spread.mean if spread else value.value if value else None


def _sd(contender: Contender, key: str) -> float | None:
    spread = contender.spreads.get(key)
    return spread.sd if spread else None


_STATISTICS: dict[str, Callable[[Contender, str], float | None]] = {"mean": _mean, "sd": _sd}
