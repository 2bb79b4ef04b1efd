"""Several runs -> a table with the best marked, their differences in words, and their errors in one figure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from wallkit.core.results import Comparison, Spread, Value
from wallkit.core.types import Float64Array
from wallkit.report import canvas
from wallkit.report.canvas import Key
from wallkit.report.data import Picture, ReportData
from wallkit.report.wording import interval_text, number_text, spread_text, value_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# colour and dashes: six runs can be told apart without colour as well
_LOOKS = (
    (canvas.BLUE, "-"),
    (canvas.VERMILION, (0, (6, 2))),
    (canvas.GREEN, (0, (2, 1.2))),
    (canvas.PURPLE, (0, (6, 1.5, 1.5, 1.5))),
    (canvas.ORANGE, (0, (10, 3))),
    (canvas.INK, (0, (1, 1))),
)
_POINTS = 150
_LEFT, _WIDTH = 0.85, canvas.WIDTH_IN - 1.0


@dataclass(frozen=True, slots=True)
class Contender:
    """One column of the comparison.

    Attributes:
        name: as the user calls it.
        metrics: of the run, or of its first seed.
        spreads: over several seeds; empty for a single run.
        data: the run for the figures; None leaves it out of them.
    """

    name: str
    metrics: Mapping[str, Value]
    spreads: Mapping[str, Spread]
    data: ReportData | None = None


@dataclass(frozen=True)
class CompareData:
    """Several runs, ready to be set side by side.

    Attributes:
        verdict: the answer in one sentence.
        differences: (name of a, name of b, comparison) for each pair that was tested.
        notes: what was left out of the tests, a sentence each.
    """

    title: str
    verdict: str
    contenders: tuple[Contender, ...]
    differences: tuple[tuple[str, str, Comparison], ...] = ()
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Cell:
    """One number in words, and whether it is the best of its row."""

    text: str
    is_best: bool


@dataclass(frozen=True, slots=True)
class Row:
    """One metric over all contenders."""

    key: str
    definition: str
    cells: tuple[Cell, ...]


def compare_rows(data: CompareData) -> list[Row]:
    """Every metric any of them has, in the order they first appear."""
    labels: dict[str, Value] = {}
    for contender in data.contenders:
        for key, value in contender.metrics.items():
            labels.setdefault(key, value)
    return [_row(data, label) for label in labels.values()]


def difference_rows(data: CompareData) -> list[tuple[str, str, str]]:
    """(metric, what differs, how sure) for each comparison."""
    rows = []
    for a, b, found in data.differences:
        size = number_text(abs(found.difference), found.unit)
        which = "more" if found.difference > 0 else "less"
        p_value = "p < 0.001" if found.p_value < 0.001 else f"p = {found.p_value:.3f}"
        verdict = {"a": f"{a} is better", "b": f"{b} is better", "neither": "no difference can be told"}[found.better]
        interval = interval_text(found, number_text)
        what = f"{verdict}: {b} has {size} {which} than {a} ({interval})"
        rows.append((found.key, what, f"{p_value}, {found.pairs} pairs, {found.method}"))
    return rows


def compare_figures(data: CompareData) -> tuple[Picture, ...]:
    """The errors of all runs that have a truth, over time and as shares; nothing without one."""
    drawn = [(c.name, c.data) for c in data.contenders if c.data is not None and c.data.errors is not None]
    if not drawn:
        return ()
    looks = [
        (name, run, {"color": _LOOKS[i % len(_LOOKS)][0], "linestyle": _LOOKS[i % len(_LOOKS)][1], "linewidth": 1.6})
        for i, (name, run) in enumerate(drawn)
    ]
    with canvas.style():
        return _shares_figure(looks), _time_figure(looks)


_Looks = list[tuple[str, ReportData, dict[str, Any]]]


def _row(data: CompareData, label: Value) -> Row:
    numbers, texts = [], []
    for contender in data.contenders:
        spread, value = contender.spreads.get(label.key), contender.metrics.get(label.key)
        numbers.append(spread.mean if spread else value.value if value else None)
        texts.append(spread_text(spread) if spread else value_text(value) if value else "not measured")
    known = [number for number in numbers if number is not None]
    best = (max if label.better == "higher" else min)(known) if label.better and known else None
    # a number shared by all distinguishes none
    is_contest = len(data.contenders) > 1 and len(set(numbers)) > 1
    cells = tuple(
        Cell(text, is_contest and number == best and best is not None)
        for text, number in zip(texts, numbers, strict=True)
    )
    return Row(label.key, label.definition, cells)


def _shares_figure(looks: _Looks) -> Picture:
    """Share of the scans whose error stays under a bound, over the bound."""
    figure, axes = _chart(looks)
    highest = max(float(_errors(run).max()) for _, run, _ in looks)
    span = (0.01, max(3.0, 1.5 * highest))
    axes.set_xscale("log")
    axes.set_xlim(*span)
    axes.set_ylim(0, 103)
    for _, run, look in looks:
        errors = np.sort(_errors(run))
        shares = 100 * np.arange(1, len(errors) + 1) / len(errors)
        axes.plot(np.clip(np.append(errors, span[1]), *span), np.append(shares, 100), drawstyle="steps-post", **look)
    inside = {place: text for place, text in canvas.METRES.items() if span[0] <= place <= span[1]}
    canvas.draw_ticks(axes, "x", inside, "position error")
    canvas.draw_ticks(axes, "y", {share: f"{share} %" for share in (0, 25, 50, 75, 100)}, "share of the scans")
    return Picture(
        "shares",
        "How often it was how good",
        "The share of the scans with an error below the value on the axis: the line further to the left and higher is"
        " better.",
        "Cumulative shares of the position error of " + ", ".join(name for name, _, _ in looks) + ".",
        canvas.svg_from_figure(figure),
    )


def _time_figure(looks: _Looks) -> Picture:
    """The errors laid over one another, each from its own first scan; thinned to what the eye can follow."""
    longest = max((run for _, run, _ in looks), key=lambda run: int(run.steps.stamps_ns[-1] - run.steps.stamps_ns[0]))
    figure, axes = _chart(looks)
    highest = max(float(_errors(run).max()) for _, run, _ in looks)
    canvas.log_axis(axes, (0.01, max(3.0, 1.5 * highest)), canvas.METRES, "position error")
    canvas.time_axis(axes, longest.steps)
    for _, run, look in looks:
        _time_line(axes, run, canvas.time_scale(longest.steps.stamps_ns)[1], look)
    return Picture(
        "errors",
        "Errors over time",
        f"The largest error of neighbouring scans, in at most {_POINTS} groups a run. Where the lines part, the runs"
        " differ; where all rise together, the place itself is hard.",
        "Position error over time of " + ", ".join(name for name, _, _ in looks) + ".",
        canvas.svg_from_figure(figure),
    )


def _chart(looks: _Looks) -> tuple[Figure, Axes]:
    """Empty axes under a legend of three names a row."""
    keys = [Key(_short(name), look) for name, _, look in looks]
    rows = [keys[at : at + 3] for at in range(0, len(keys), 3)]
    figure = canvas.new_figure(3.4 + 0.22 * len(rows))
    axes = canvas.add_axes(figure, (_LEFT, 0.55, _WIDTH, 2.6))
    for number, row in enumerate(reversed(rows)):
        canvas.legend_above(axes, row, row=number)
    return figure, axes


def _short(name: str) -> str:
    """At most 30 letters: paths differ at their ends, so the end is kept."""
    text = canvas.printable(name)
    return text if len(text) <= 30 else f"…{text[-29:]}"


def _time_line(axes: Axes, run: ReportData, unit_ns: float, look: dict[str, Any]) -> None:
    assert run.errors is not None  # only runs with errors are drawn
    starts = np.arange(0, len(run.errors), -(-len(run.errors) // _POINTS))
    x = (run.errors.stamps_ns[starts] - run.steps.stamps_ns[0]) / unit_ns
    # the largest of each group: a short moment of being lost must not vanish
    axes.plot(x, np.maximum(np.maximum.reduceat(run.errors.position_m, starts), 0.01), **look)


def _errors(run: ReportData) -> Float64Array:
    assert run.errors is not None  # only runs with errors are drawn
    return run.errors.position_m
