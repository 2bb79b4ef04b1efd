"""A run -> figures over time: how wrong it was and what it said, what the beams met, how it converged, what it cost."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from wallkit.core.types import Float64Array, Health
from wallkit.report import canvas
from wallkit.report.canvas import Key
from wallkit.report.data import Picture, ReportData

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_LEFT, _WIDTH = 0.85, canvas.WIDTH_IN - 1.0
_LEAST_M, _LEAST_DEG = 0.01, 0.1
_DASHED = (0, (5, 3))


def error_figure(data: ReportData) -> Picture | None:
    """Position and heading error over time on a logarithmic scale, with what the filter said in the background."""
    figure = canvas.new_figure(5.0)
    position = canvas.add_axes(figure, (_LEFT, 2.55, _WIDTH, 2.1))
    heading = canvas.add_axes(figure, (_LEFT, 0.55, _WIDTH, 1.85))
    x, metres, degrees, what = _errors_or_spread(data)
    canvas.log_axis(position, (_LEAST_M, max(3.0, 1.5 * _largest(metres))), canvas.METRES, f"position {what}")
    canvas.log_axis(heading, (_LEAST_DEG, 220.0), canvas.DEGREES, f"heading {what}")
    for axes, values in ((position, metres), (heading, degrees)):
        keys = canvas.health_bands(axes, data.steps)
        # values below the axis lie on its edge, so that none is invisible
        axes.plot(x, np.clip(values, *axes.get_ylim()), color=canvas.BLUE, linewidth=1.1, zorder=3)
    canvas.time_axis(position, data.steps, is_labelled=False)
    canvas.time_axis(heading, data.steps)
    limits = data.limits
    caption = "No truth is known: this is the standard deviation the filter claims. It cannot show a wrong answer."
    if data.errors is not None:
        _limit_lines(position, limits.converged_m, limits.lost_m, "m")
        _limit_lines(heading, limits.converged_deg, limits.lost_deg, "°")
        keys += _false_healthy_marks(position, data, x)
        caption = (
            "Below the lower dashed line the answer is right, above the upper one the robot is lost. Wherever the line"
            " is above, the background should be hatched: then the filter knew."
        )
    canvas.legend_above(position, keys)
    return Picture(
        "error",
        f"{what.capitalize()} over time",
        caption,
        f"Position and heading {what} over time, {_shares(data)}.",
        canvas.svg_from_figure(figure),
    )


def beams_figure(data: ReportData) -> Picture | None:
    """What became of the beams at each update, stacked to all of them."""
    steps = data.steps
    shares = np.stack([steps.hit_ratio, steps.short_ratio, steps.long_ratio])
    known = np.isfinite(shares).all(axis=0)
    if not known.any():
        return None
    figure = canvas.new_figure(3.2)
    axes = canvas.add_axes(figure, (_LEFT, 0.55, _WIDTH, 2.05))
    # a group of updates per two pixels: finer would be noise to the eye and a heavy page
    x = _group_means(canvas.times(steps, steps.stamps_ns[known]), groups=450)
    shares = _group_means(shares[:, known], groups=450)
    base, keys = np.zeros(len(x)), []
    for share, (name, colour, hatch) in zip(100 * shares, _BEAMS, strict=True):
        style: dict[str, Any] = {"facecolor": colour, "edgecolor": "white", "linewidth": 0, "hatch": hatch}
        axes.fill_between(x, base, base + share, **style)
        keys.append(Key(name, style))
        base = base + share
    keys += canvas.health_bands(axes, steps, span=(1.02, 0.08))
    axes.set_ylim(0, 100)
    canvas.draw_ticks(axes, "y", {share: f"{share} %" for share in (0, 25, 50, 75, 100)}, "share of the beams")
    canvas.time_axis(axes, steps)
    canvas.legend_above(axes, keys, row=1)
    return Picture(
        "beams",
        "What the beams met",
        "What the health is made of. Beams that end before a wall of the map met people or boxes and do no harm; many"
        " that pass through a wall mean that the robot is not where it believes, or that the wall is gone. White is left"
        " unexplained; the strip on top is what the filter said.",
        f"Stacked shares of the beams over time; in the median {np.nanmedian(steps.hit_ratio):.0%} end on the map.",
        canvas.svg_from_figure(figure),
    )


def convergence_figure(data: ReportData) -> Picture | None:
    """Error and spread of the first updates: how fast it found itself."""
    steps, limits = data.steps, data.limits
    right = _first_right(data)
    rows = np.flatnonzero(steps.is_update)[: int(np.clip(3 * (right or 100), 40, 300))]
    if not len(rows):
        return None
    shown = len(rows)
    spread = np.maximum(np.hypot(steps.sd[rows, 0], steps.sd[rows, 1]), _LEAST_M)
    lines = [(np.arange(1, shown + 1), spread, Key("spread the filter claims (1 sd)", _line(canvas.ORANGE, _DASHED)))]
    if data.errors is not None:
        _, at, seen = np.intersect1d(rows, data.errors.rows, assume_unique=True, return_indices=True)
        error = np.maximum(data.errors.position_m[seen], _LEAST_M)
        lines.append((at + 1, error, Key("position error", _line(canvas.BLUE, "-"))))
    figure = canvas.new_figure(3.1)
    axes = canvas.add_axes(figure, (_LEFT, 0.55, _WIDTH, 2.2))
    highest = max(_largest(y) for _, y, _ in lines)
    canvas.log_axis(axes, (_LEAST_M, max(3.0, 1.5 * highest)), canvas.METRES)
    for x, y, key in lines:
        axes.plot(x, y, **key.style)
    axes.set_xlim(1, max(shown, 2))
    canvas.draw_ticks(axes, "x", canvas.linear_ticks(1, max(shown, 2)), "update")
    reading = "No truth is known."
    if data.errors is not None:
        _limit_line(axes, limits.converged_m, f"right: under {limits.converged_m:g} m", is_above=True)
        reading = f"{_first_words(axes, right)} {_last_words(data)}"
    canvas.legend_above(axes, [key for _, _, key in lines])
    return Picture(
        "convergence",
        "Convergence from the start",
        f"{reading} The two lines should fall together; a spread far below the error is false certainty.",
        f"Position error and claimed spread over the first {shown} updates. {reading}",
        canvas.svg_from_figure(figure),
    )


def timing_figure(data: ReportData) -> Picture | None:
    """How the time per update is spread."""
    update_ms = data.steps.update_ms[np.isfinite(data.steps.update_ms)]
    if not len(update_ms):
        return None
    middle, late = np.percentile(update_ms, [50, 95]).tolist()
    high = max(1.4 * late, 2 * middle, 1e-3)
    beyond = int(np.sum(update_ms > high))
    counts, edges = np.histogram(update_ms, bins=50, range=(0, high))
    figure = canvas.new_figure(2.5)
    axes = canvas.add_axes(figure, (_LEFT, 0.55, _WIDTH, 1.65))
    axes.stairs(counts, edges, fill=True, color=canvas.SKY)
    for value, text, line, side in (
        (middle, f"median {middle:.2f} ms", "-", "right"),
        (late, f"95 % below {late:.2f} ms", _DASHED, "left"),
    ):
        axes.axvline(value, color=canvas.INK, linewidth=1.4, linestyle=line)
        axes.annotate(text, (value, 1), (3 if side == "left" else -3, 3), **canvas.BY_POINTS, va="bottom", ha=side)
    axes.set_xlim(0, high)
    axes.set_ylim(0, max(1, counts.max()) * 1.05)
    canvas.draw_ticks(axes, "x", canvas.linear_ticks(0, high), "time per update [ms]")
    canvas.draw_ticks(axes, "y", canvas.linear_ticks(0, max(1, int(counts.max())), count=4), "updates")
    tail = f" {beyond} slower updates are not shown, the slowest took {update_ms.max():.1f} ms." if beyond else ""
    return Picture(
        "timing",
        "Time per update",
        f"One narrow hill is good; a second hill or a long tail means that something else ran as well.{tail}",
        f"Histogram of the time per update: median {middle:.2f} ms, 95 % below {late:.2f} ms.{tail}",
        canvas.svg_from_figure(figure),
    )


# ------------------------------------------------------------------------------------------------------ details

_BEAMS = (
    ("on the map", canvas.SKY, ""),
    ("before it", canvas.ORANGE, "||||"),
    ("through a wall", canvas.PURPLE, "\\\\\\\\"),
)


def _line(colour: str, dashes: Any) -> dict[str, Any]:
    return {"color": colour, "linewidth": 1.9, "linestyle": dashes}


def _errors_or_spread(data: ReportData) -> tuple[Float64Array, Float64Array, Float64Array, str]:
    """Time, position [m], heading [deg] and what they are."""
    steps = data.steps
    if data.errors is None:
        spread = np.hypot(steps.sd[:, 0], steps.sd[:, 1])
        return canvas.times(steps, steps.stamps_ns), spread, np.rad2deg(steps.sd[:, 2]), "spread"
    return canvas.times(steps, data.errors.stamps_ns), data.errors.position_m, data.errors.heading_deg, "error"


def _largest(values: Float64Array) -> float:
    finite = values[np.isfinite(values)]
    return float(finite.max()) if len(finite) else 0.0


def _group_means(values: Float64Array, *, groups: int) -> Float64Array:
    """Means of neighbouring columns (..., T) so that about `groups` remain."""
    size = -(-values.shape[-1] // groups)
    starts = np.arange(0, values.shape[-1], size)
    counts = np.diff(np.append(starts, values.shape[-1]))
    return np.asarray(np.add.reduceat(values, starts, axis=-1) / counts)


def _shares(data: ReportData) -> str:
    parts = [f"{np.mean(data.steps.health == state):.1%} {state.name}" for state in reversed(Health)]
    return "the filter says " + ", ".join(parts)


def _limit_lines(axes: Axes, converged: float, lost: float, unit: str) -> None:
    unit = unit if unit == "°" else f" {unit}"
    _limit_line(axes, lost, f"lost: over {lost:g}{unit}", is_above=True)
    _limit_line(axes, converged, f"right: under {converged:g}{unit}", is_above=False)


def _limit_line(axes: Axes, value: float, text: str, *, is_above: bool) -> None:
    axes.axhline(value, color=canvas.INK, linewidth=0.9, linestyle=_DASHED, zorder=4)
    box = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.8}
    axes.text(
        *(0.995, value * (1.09 if is_above else 0.92), text),
        transform=axes.get_yaxis_transform(),
        ha="right",
        va="bottom" if is_above else "top",
        fontsize=9,
        bbox=box,
        zorder=5,
    )


def _false_healthy_marks(axes: Axes, data: ReportData, x: Float64Array) -> list[Key]:
    """Black triangles at the updates that must never happen."""
    errors, limits = data.errors, data.limits
    if errors is None:
        return []
    lost = (errors.position_m > limits.lost_m) | (errors.heading_deg > limits.lost_deg)
    wrong = lost & (data.steps.health[errors.rows] == Health.LOCALIZED)
    if not wrong.any():
        return []
    style: dict[str, Any] = {"linestyle": "none", "marker": "v", "color": "black", "markersize": 6}
    axes.plot(x[wrong], np.clip(errors.position_m[wrong], _LEAST_M, None), **style, zorder=6)
    return [Key(f"lost, yet called LOCALIZED ({int(wrong.sum())} updates)", style)]


def _first_right(data: ReportData) -> int | None:
    """Number of the first update that is right, whatever comes later."""
    if data.errors is None:
        return None
    errors, limits = data.errors, data.limits
    right = (errors.position_m < limits.converged_m) & (errors.heading_deg < limits.converged_deg)
    right &= data.steps.is_update[errors.rows]
    return int(np.sum(data.steps.is_update[: errors.rows[np.argmax(right)] + 1])) if right.any() else None


def _first_words(axes: Axes, right: int | None) -> str:
    """Marks the first right update and says it in words."""
    if right is None:
        return "It was never right."
    if right == 1:
        return "Right from the first update."
    axes.axvline(right, color=canvas.GREEN, linewidth=1.8)
    axes.annotate(f"first right: update {right}", (right, 0.97), (6, 0), **canvas.BY_POINTS, va="top")
    return f"First right at update {right}."


def _last_words(data: ReportData) -> str:
    value = data.metrics.get("updates_to_converge")
    if value is None or value.value is None:
        return "It does not end right."
    return f"It stays right from update {value.value:g} to the end."
