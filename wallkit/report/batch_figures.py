"""A batch -> figures: how errors are spread, what differs, what the error costs in time, and what a factor does."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from wallkit.core.results import Interval
from wallkit.report import canvas
from wallkit.report.batch import BatchData, Effect, Factor
from wallkit.report.batch_words import word_of
from wallkit.report.canvas import Key
from wallkit.report.data import Picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_ROW_IN, _NAME_IN, _LETTERS = 0.34, 2.4, 30
_MOST_ROWS = 30
_MEAN: dict[str, Any] = {"color": canvas.VERMILION, "linewidth": 3.0}
_LOOKS = (canvas.BLUE, canvas.VERMILION, canvas.GREEN, canvas.PURPLE, canvas.ORANGE, canvas.INK)
_DASHES = ("-", (0, (6, 2)), (0, (2, 1.2)), (0, (6, 1.5, 1.5, 1.5)))


def batch_figures(data: BatchData) -> tuple[Picture, ...]:
    """Every figure that the batch has data for."""
    with canvas.style():
        pictures = [spread_figure(data), differences_figure(data), trade_figure(data), effects_figure(data)]
        pictures += [factor_figure(data, factor) for factor in data.factors]
    return tuple(picture for picture in pictures if picture is not None)


def spread_figure(data: BatchData) -> Picture | None:
    """A row for each configuration: its runs as dots, mean and interval as a bar."""
    shown = [s for s in data.summaries if data.key in s.numbers][:_MOST_ROWS]
    values = [value for s in shown for value in data.quantiles.get(s.name, ())]
    if not values:
        return None
    figure, axes = _rows([s.name for s in shown])
    is_log = min(values) > 0 and max(values) > 5 * min(values)
    _value_axis(axes, (min(values), max(values)), data.unit, word_of(data.key), is_log=is_log)
    for row, s in enumerate(shown):
        found, y = s.numbers[data.key], len(shown) - 1 - row
        dots = data.quantiles[s.name]
        # spread a little, so that equal ones do not hide each other
        heights = [y + 0.22 * ((i * 0.618) % 1 - 0.5) for i in range(len(dots))]
        axes.plot(dots, heights, "o", color=canvas.BLUE, alpha=0.35, markersize=3.5, markeredgewidth=0)
        _bar(axes, found.mean, y)
        axes.plot([found.median.value], [y], "|", color=canvas.INK, markersize=13, markeredgewidth=1.8)
    dot = {"color": canvas.BLUE, "marker": "o", "linestyle": "none", "markersize": 4}
    median = {"color": canvas.INK, "marker": "|", "linestyle": "none", "markersize": 11, "markeredgewidth": 1.8}
    canvas.legend_above(axes, [Key("runs", dot), Key("median", median), Key("mean and its 95 % interval", _MEAN)])
    left_out = len(data.summaries) - len(shown)
    more = f" {left_out} configurations are not drawn." if left_out else ""
    return Picture(
        "spread",
        f"How the {word_of(data.key)} is spread",
        "Each dot is a run (at most 100 a row, evenly picked by rank, the best and the worst among them). A bar far from the"
        f" median means that a few bad runs make the mean.{more}",
        f"{word_of(data.key)} of the runs of {', '.join(s.name for s in shown)}.",
        canvas.svg_from_figure(figure),
    )


def differences_figure(data: BatchData) -> Picture | None:
    """Change of the mean against the baseline with its interval, and that of the middle log."""
    found = [(d.name, d.found) for d in data.differences.get(data.key, ()) if d.found is not None]
    known = [(name, f, f.percent) for name, f in found if f.percent is not None and f.percent.low is not None]
    known = sorted(known, key=lambda k: k[2].value)[:_MOST_ROWS]
    if not known:
        return None
    figure, axes = _rows([name for name, _, _ in known])
    ends = [x for _, f, p in known for x in (p.low, p.high, f.middle.value if f.middle else None) if x is not None]
    low, high = min(0.0, *ends), max(0.0, *ends)
    # one that is ten times worse would press all others onto the zero line
    high, is_cut = (150.0, True) if high > 200 else (high, False)
    _value_axis(axes, (low, high), "%", f"change of the {word_of(data.key)} against {data.baseline}", is_log=False)
    axes.axvline(0, color=canvas.INK, linewidth=1.0, zorder=1)
    for row, (_, f, percent) in enumerate(known):
        y = len(known) - 1 - row
        _bar(axes, percent, y, colour=canvas.MUTED if f.better == "neither" else canvas.VERMILION)
        if f.middle is not None:
            axes.plot([f.middle.value], [y], "D", color=canvas.BLUE, markersize=6, zorder=4)
    diamond = {"color": canvas.BLUE, "marker": "D", "linestyle": "none", "markersize": 6}
    canvas.legend_above(
        axes,
        [
            Key("mean, 95 %: differs", _MEAN),
            Key("cannot be told", {**_MEAN, "color": canvas.MUTED}),
            Key("middle log", diamond),
        ],
    )
    cut = " What reaches beyond the right edge is cut." if is_cut else ""
    return Picture(
        "differences",
        f"What changes against {data.baseline}",
        f"Left of the line is less {word_of(data.key)}. Diamond and bar on different sides: most logs go one way, and a few"
        f" by more the other.{cut}",
        f"Change of the {word_of(data.key)} of {', '.join(name for name, _, _ in known)} against {data.baseline}.",
        canvas.svg_from_figure(figure),
    )


def trade_figure(data: BatchData) -> Picture | None:
    """Error against time, with the front of those that no other beats in both."""
    if len(data.trades) < 2:
        return None
    figure = canvas.new_figure(4.6)
    axes = canvas.add_axes(figure, (0.85, 0.6, canvas.WIDTH_IN - 1.2, 3.6))
    costs, losses = [t.cost for t in data.trades], [t.loss for t in data.trades]
    _span(axes, "x", costs, "ms", "mean time per update", far=1.25)
    _span(axes, "y", losses, data.unit, f"mean {word_of(data.key)}", far=1.15)
    front = sorted((t for t in data.trades if t.is_front), key=lambda t: t.cost)
    others = [t for t in data.trades if not t.is_front]
    axes.plot(
        [t.cost for t in front], [t.loss for t in front], color=canvas.VERMILION, linewidth=1.2, drawstyle="steps-post"
    )
    axes.plot([t.cost for t in others], [t.loss for t in others], "o", color=canvas.MUTED, markersize=5)
    axes.plot([t.cost for t in front], [t.loss for t in front], "o", color=canvas.VERMILION, markersize=8)
    named = [*front, *(others if len(data.trades) <= 12 else ())]
    _label(axes, [(t.name, t.cost, t.loss) for t in named])
    canvas.legend_above(
        axes,
        [
            Key("worth its time: none is both faster and better", {**_point(canvas.VERMILION), "markersize": 8}),
            Key("beaten in both", _point(canvas.MUTED)),
        ],
    )
    names = ", ".join(t.name for t in front)
    return Picture(
        "trade",
        "What the error costs in time",
        f"From the fastest to the best: {names}. Times are only comparable if the machine did the same beside every run.",
        f"Mean {word_of(data.key)} over mean time per update; on the front are {names}.",
        canvas.svg_from_figure(figure),
    )


def effects_figure(data: BatchData) -> Picture | None:
    """For every swept setting the mean at each of its values."""
    shown = data.effects[:6]
    if not shown:
        return None
    columns = min(3, len(shown))
    rows = -(-len(shown) // columns)
    width = (canvas.WIDTH_IN - 0.9 - 0.35 * (columns - 1)) / columns
    figure = canvas.new_figure(rows * 2.75 + 0.1)
    ends = [x for e in shown for _, _, m in e.levels for x in (m.value, m.low, m.high) if x is not None]
    for number, effect in enumerate(shown):
        left = 0.85 + (number % columns) * (width + 0.35)
        axes = canvas.add_axes(figure, (left, 0.55 + (rows - 1 - number // columns) * 2.75, width, 1.8))
        _effect(axes, effect, ends, data, is_first=number % columns == 0)
    more = f" {len(data.effects) - len(shown)} weaker settings are not drawn." if len(data.effects) > len(shown) else ""
    return Picture(
        "effects",
        "What each setting does",
        "The mean over all configurations with that value, whatever their other settings are, the strongest setting first."
        " Bars are 95 % intervals over logs: since the logs are the same, values can differ though their bars"
        f" overlap.{more}",
        f"Mean {word_of(data.key)} by value of {', '.join(e.key for e in shown)}.",
        canvas.svg_from_figure(figure),
    )


def factor_figure(data: BatchData, factor: Factor) -> Picture | None:
    """A line for each configuration over the levels, with intervals; six at most, the best of each level among them."""
    if len(factor.levels) < 2:
        return None
    names = _chosen(data)
    rows = [names[at : at + 4] for at in range(0, len(names), 4)]
    figure = canvas.new_figure(3.9 + 0.22 * len(rows))
    axes = canvas.add_axes(figure, (0.85, 0.6, canvas.WIDTH_IN - 1.0, 3.0))
    means = {
        name: [
            s.numbers[data.key].mean if data.key in s.numbers else None
            for lv in factor.levels
            for s in lv.summaries
            if s.name == name
        ]
        for name in names
    }
    ends = [x for own in means.values() for m in own if m for x in (m.value, m.low, m.high) if x is not None]
    if not ends:
        return None
    axes.set_xlim(-0.5, len(factor.levels) - 0.5)
    _span(axes, "y", ends, data.unit, f"mean {word_of(data.key)}", far=1.1)
    canvas.draw_ticks(axes, "x", {float(i): _short(lv.name) for i, lv in enumerate(factor.levels)}, factor.key)
    keys = {}
    for number, name in enumerate(names):
        look: dict[str, Any] = {
            "color": _LOOKS[number % len(_LOOKS)],
            "linestyle": _DASHES[number % len(_DASHES)],
            "linewidth": 1.6,
        }
        keys[name] = Key(_short(name), look)
        known = [(i + 0.05 * (number - (len(names) - 1) / 2), m) for i, m in enumerate(means[name]) if m is not None]
        axes.plot([x for x, _ in known], [m.value for _, m in known], marker="o", markersize=4, **look)
        for x, m in known:
            if m.low is not None and m.high is not None:
                axes.vlines(x, m.low, m.high, color=look["color"], linewidth=1.2, alpha=0.7)
    for number, row in enumerate(reversed(rows)):
        canvas.legend_above(axes, [keys[name] for name in row], row=number)
    left_out = len(data.summaries) - len(names)
    more = f" The {left_out} others are in the table." if left_out else ""
    return Picture(
        f"by-{factor.key}",
        f"By {factor.key}",
        f"Mean {word_of(data.key)} and its 95 % interval over the logs of each {factor.key}.{more}",
        f"Mean {word_of(data.key)} by {factor.key} of {', '.join(names)}.",
        canvas.svg_from_figure(figure),
    )


# -------------------------------------------------------------------------------------------- details


def _rows(names: Sequence[str]) -> tuple[Figure, Axes]:
    """Axes with a named row for each."""
    height = _ROW_IN * len(names) + 0.1
    figure = canvas.new_figure(height + 1.0)
    axes = canvas.add_axes(figure, (_NAME_IN, 0.55, canvas.WIDTH_IN - _NAME_IN - 0.3, height))
    axes.set_ylim(-0.6, len(names) - 0.4)
    canvas.draw_ticks(axes, "y", {float(len(names) - 1 - i): _short(name) for i, name in enumerate(names)})
    return figure, axes


def _value_axis(axes: Axes, ends: tuple[float, float], unit: str, title: str, *, is_log: bool) -> None:
    low, high = ends
    if is_log:
        axes.set_xscale("log")
        low, high = low / 1.15, high * 1.15
        ticks = {t: _tick(t, unit) for t in _log_ticks(low, high)}
    else:
        margin = 0.05 * (high - low or abs(high) or 1.0)
        low, high = low - margin, high + margin
        ticks = {t: _tick(t, unit) for t in canvas.linear_ticks(low, high)}
    axes.set_xlim(low, high)
    canvas.draw_ticks(axes, "x", ticks, title)


def _span(axes: Axes, side: str, values: Sequence[float], unit: str, title: str, *, far: float) -> None:
    """A linear axis, or a logarithmic one where the values are of different sizes."""
    low, high = min(values), max(values)
    is_log = low > 0 and high > 5 * low
    if is_log:
        low, high, ticks = low / 1.1, high * far**2, _log_ticks(low / 1.1, high * far**2)
    else:
        margin = 0.08 * (high - low or abs(high) or 1.0)
        low, high = low - margin, high + margin + (far - 1) * (high - low)
        ticks = list(canvas.linear_ticks(low, high))
    if side == "x":
        axes.set_xscale("log" if is_log else "linear")
        axes.set_xlim(low, high)
        canvas.draw_ticks(axes, "x", {t: _tick(t, unit) for t in ticks}, title)
    else:
        axes.set_yscale("log" if is_log else "linear")
        axes.set_ylim(low, high)
        canvas.draw_ticks(axes, "y", {t: _tick(t, unit) for t in ticks}, title)


def _log_ticks(low: float, high: float) -> list[float]:
    """1, 2 and 5 times the powers of ten inside."""
    powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    steps = (1, 2, 5) if high / low < 300 else (1,)
    return [step * 10.0**p for p in powers for step in steps if low <= step * 10.0**p <= high]


def _tick(number: float, unit: str) -> str:
    """As short as it can be: 5 cm, 2 m, 20 ms, 10 %."""
    if unit == "m":
        return f"{100 * number:g} cm" if abs(number) < 1 else f"{number:g} m"
    return (
        f"{100 * number:g} %"
        if unit == "share"
        else f"{number:g} {unit}"
        if unit in ("ms", "s", "%", "MB", "deg")
        else f"{number:g}"
    )


def _label(axes: Axes, points: Sequence[tuple[str, float, float]]) -> None:
    """Names beside points, moved below where they would cover one that is there already."""
    placed: list[tuple[float, float]] = []
    for name, x, y in points:
        at = axes.transData.transform((x, y)) * 72 / axes.figure.dpi
        u, v = float(at[0]) + 7, float(at[1])
        free = (6.0, -14.0, 18.0, -26.0)
        down = next((d for d in free if all(abs(u - a) > 70 or abs(v + d - b) > 11 for a, b in placed)), 6.0)
        placed.append((u, v + down))
        axes.annotate(_short(name), (x, y), (7, down), textcoords="offset points", fontsize=9)


def _bar(axes: Axes, mean: Interval, y: float, *, colour: str = canvas.VERMILION) -> None:
    if mean.low is not None and mean.high is not None:
        axes.plot([mean.low, mean.high], [y, y], **{**_MEAN, "color": colour}, solid_capstyle="butt", zorder=3)
    axes.plot([mean.value], [y], "o", color=colour, markersize=7, markeredgecolor="white", zorder=4)


def _effect(axes: Axes, effect: Effect, ends: Sequence[float], data: BatchData, *, is_first: bool) -> None:
    axes.set_xlim(-0.5, len(effect.levels) - 0.5)
    low, high = min(ends), max(ends)
    margin = 0.08 * (high - low or abs(high) or 1.0)
    axes.set_ylim(low - margin, high + margin)
    ticks = {t: _tick(t, data.unit) if is_first else "" for t in canvas.linear_ticks(low, high, count=4)}
    canvas.draw_ticks(axes, "y", ticks)
    canvas.draw_ticks(
        axes, "x", {float(i): _short(text, 16) for i, (text, _, _) in enumerate(effect.levels)}, effect.key
    )
    axes.annotate(
        f"{effect.span_percent:.0f} % between best and worst",
        (0, 1),
        (0, 8),
        xycoords="axes fraction",
        textcoords="offset points",
        fontsize=9.5,
    )
    axes.plot(
        range(len(effect.levels)), [m.value for _, _, m in effect.levels], color=canvas.FAINT, linewidth=1.2, zorder=1
    )
    for i, (_, _, mean) in enumerate(effect.levels):
        if mean.low is not None and mean.high is not None:
            axes.vlines(i, mean.low, mean.high, color=canvas.VERMILION, linewidth=3)
        axes.plot([i], [mean.value], "o", color=canvas.VERMILION, markersize=7, markeredgecolor="white")


def _chosen(data: BatchData) -> list[str]:
    """The baseline, then by mean from the best on, six in all."""
    means = {s.name: s.numbers[data.key].mean.value for s in data.summaries if data.key in s.numbers}
    order = sorted(means, key=lambda name: (name != data.baseline, means[name]))
    return order[:6]


def _point(colour: str) -> dict[str, object]:
    return {"color": colour, "marker": "o", "linestyle": "none", "markersize": 5}


def _short(name: str, letters: int = _LETTERS) -> str:
    text = canvas.printable(name)
    return text if len(text) <= letters else f"{text[: letters - 1]}…"
