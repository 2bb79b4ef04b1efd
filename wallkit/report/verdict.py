"""The verdict on a calibration -> one self-contained page: answers, residuals, uncertainty, points on pictures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from wallkit.core.types import Float64Array
from wallkit.report import canvas
from wallkit.report.canvas import Key
from wallkit.report.data import Photo, Picture, Tone
from wallkit.report.html import jpeg_uri, rendered

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_LEFT, _WIDTH = 0.85, canvas.WIDTH_IN - 1.0
_DASHED = (0, (5, 3))
TONES: dict[str, Tone] = {"PASS": "good", "FAIL": "bad", "CANNOT TELL": "unsure"}


@dataclass(frozen=True, slots=True)
class Answer:
    """One gate, in words: its verdict, what was asked, found and wanted, and why it is no PASS."""

    verdict: str
    asked: str
    found: str
    wanted: str
    refused: str
    reason: str
    basis: str


@dataclass(frozen=True)
class VerdictData:
    """What the page shows.

    Attributes:
        means, next_step: a sentence each. facts: (name, value) about the inputs. definitions: a sentence each.
        view_names, distances_m, means_mm, rms_mm: (V,) of each view; is_out: (V,) it was left out.
        plane_limits_mm: PASS and FAIL.
        pixel_error: (R, 2) range [m] and error [px], or None. pixel_limit: PASS at reference_m.
    """

    title: str
    verdict: str
    meaning: str
    means: str
    next_step: str
    reasons: tuple[str, ...]
    answers: tuple[Answer, ...]
    skipped: tuple[Answer, ...]
    facts: tuple[tuple[str, str], ...]
    definitions: tuple[str, ...]
    view_names: tuple[str, ...]
    distances_m: Float64Array
    means_mm: Float64Array
    rms_mm: Float64Array
    is_out: tuple[bool, ...]
    plane_limits_mm: tuple[float, float]
    pixel_error: Float64Array | None
    pixel_limit: float
    reference_m: float
    photos: tuple[Photo, ...]


def verdict_html(data: VerdictData) -> str:
    """The page."""
    with canvas.style():
        pictures = [p for p in (residual_figure(data), pixel_figure(data)) if p is not None]
    return rendered(
        "verdict.html",
        data=data,
        tone=TONES[data.verdict],
        pictures=pictures,
        photos=[(photo.caption, jpeg_uri(photo)) for photo in data.photos],
    )


def residual_figure(data: VerdictData) -> Picture | None:
    """Mean and RMS distance from the board of each view, over its distance."""
    if not len(data.view_names):
        return None
    figure = canvas.new_figure(3.6)
    axes = canvas.add_axes(figure, (_LEFT, 0.6, _WIDTH, 2.5))
    good, bad = data.plane_limits_mm
    reach = 1.15 * max(good, float(np.abs(data.means_mm).max() + data.rms_mm.max()) / 1.6, float(data.rms_mm.max()))
    near, far = float(data.distances_m.min()), float(data.distances_m.max())
    pad = max(0.05 * (far - near), 0.05)
    axes.set_xlim(near - pad, far + pad)
    axes.set_ylim(-reach, reach)
    axes.axhspan(-good, good, color="#e8f3ee", zorder=0)
    axes.axhline(0, color=canvas.INK, linewidth=0.8)
    if bad < reach:
        for value in (-bad, bad):
            axes.axhline(value, color=canvas.VERMILION, linewidth=1.2, linestyle=_DASHED)
    for out, colour, marker in ((False, canvas.BLUE, "o"), (True, canvas.VERMILION, "X")):
        _bars(axes, data, np.array(data.is_out) == out, colour, marker)
    keys = [
        Key("mean of a view", {"color": canvas.BLUE, "marker": "o", "linestyle": "none"}),
        Key("its RMS, up and down", {"color": canvas.BLUE, "linewidth": 1.2}),
        Key("may PASS", {"facecolor": "#e8f3ee", "edgecolor": "#bcd9cb", "hatch": ""}),
    ]
    if any(data.is_out):
        keys.append(Key("left out", {"color": canvas.VERMILION, "marker": "X", "linestyle": "none"}))
    canvas.legend_above(axes, keys)
    canvas.draw_ticks(axes, "x", canvas.linear_ticks(near - pad, far + pad), "distance of the board from the LiDAR [m]")
    canvas.draw_ticks(axes, "y", canvas.linear_ticks(-reach, reach, count=6), "off the board [mm]")
    worst = data.view_names[int(data.rms_mm.argmax())]
    return Picture(
        "residuals",
        "How far the points lie off the boards",
        "A cloud around zero, the same at all distances, is good. A slope means a wrong scale or range; one view far out"
        " means that a board or the robot moved. Positive is beyond the board. Every view is judged by a calibration"
        " that did not use it.",
        f"{len(data.view_names)} views; the worst is {worst} with {data.rms_mm.max():.0f} mm RMS.",
        canvas.svg_from_figure(figure),
    )


def pixel_figure(data: VerdictData) -> Picture | None:
    """The 95 % pixel error over the range."""
    if data.pixel_error is None:
        return None
    ranges, errors = data.pixel_error.T
    figure = canvas.new_figure(3.3)
    axes = canvas.add_axes(figure, (_LEFT, 0.6, _WIDTH, 2.3))
    at = float(np.interp(1 / data.reference_m, 1 / ranges[::-1], errors[::-1]))
    high = 1.2 * max(data.pixel_limit, min(float(errors.max()), 4 * at))
    x = 1 / np.linspace(1 / ranges[0], 1 / ranges[-1], 200)
    axes.plot(x, np.interp(1 / x[::-1], 1 / ranges[::-1], errors[::-1])[::-1], color=canvas.BLUE, linewidth=1.8)
    axes.axhline(data.pixel_limit, color=canvas.INK, linewidth=1.0, linestyle=_DASHED)
    axes.plot([data.reference_m], [at], "o", color=canvas.BLUE)
    axes.annotate(f"{at:.1f} px at {data.reference_m:g} m", (data.reference_m, at), (8, 8), textcoords="offset points")
    axes.set_xlim(0, float(ranges[-1]))
    axes.set_ylim(0, high)
    canvas.draw_ticks(axes, "x", canvas.linear_ticks(0, float(ranges[-1])), "range from the LiDAR [m]")
    canvas.draw_ticks(axes, "y", canvas.linear_ticks(0, high, count=5), "95 % error [px]")
    keys = [
        Key("95 % of the points land within", {"color": canvas.BLUE, "linewidth": 1.8}),
        Key(f"PASS at {data.reference_m:g} m", {"color": canvas.INK, "linewidth": 1.0, "linestyle": _DASHED}),
    ]
    canvas.legend_above(axes, keys)
    return Picture(
        "pixels",
        "How far a point may land from where it belongs in the picture",
        "At the worst place of the image, from the uncertainty of transform and lens. Near the robot a shift counts most,"
        " far away a turn.",
        f"95 % error of {at:.1f} px at {data.reference_m:g} m.",
        canvas.svg_from_figure(figure),
    )


def _bars(axes: Axes, data: VerdictData, which: Float64Array, colour: str, marker: str) -> None:
    x, mean, rms = data.distances_m[which], data.means_mm[which], data.rms_mm[which]
    axes.vlines(x, mean - rms, mean + rms, color=colour, linewidth=1.0, alpha=0.55)
    axes.plot(x, mean, marker, color=colour, markersize=5)
