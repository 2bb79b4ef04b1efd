"""Lines and texts drawn with matplotlib -> SVG bytes: the look all figures share, cheap and the same every time.

matplotlib is imported inside functions and without pyplot. Ticks, legends and pictures are drawn here from plain texts,
lines and images: matplotlib's own measure every text many times, and took longer than reading and localizing the log.
"""

from __future__ import annotations

import base64
import io
import math
import re
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from wallkit.core.steps import Steps, health_runs
from wallkit.core.types import Float64Array, Health, Int64Array, UInt8Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK, MUTED, FAINT = "#1f2933", "#5f6b76", "#dde2e6"
# Okabe & Ito (2008): told apart with every common colour blindness
BLUE, SKY, ORANGE, VERMILION, GREEN, PURPLE = "#0072b2", "#56b4e9", "#e69f00", "#d55e00", "#009e73", "#cc79a7"
# face, line and hatch of the background where the filter doubts: the hatch tells them apart without the colour
BANDS: Mapping[Health, tuple[str, str, str]] = {
    Health.UNCERTAIN: ("#fbeccb", "#e3c98a", "////"),
    Health.LOST: ("#f3c9c0", "#cf8d80", "xxxx"),
}
WIDTH_IN = 10.0
# keywords of `annotate`: at a value of x and a share of the height, moved by points
BY_POINTS: Mapping[str, Any] = {"xycoords": ("data", "axes fraction"), "textcoords": "offset points"}
METRES = {0.01: "1 cm", 0.1: "10 cm", 1.0: "1 m", 10.0: "10 m", 100.0: "100 m", 1000.0: "1 km"}
DEGREES = {0.1: "0.1°", 1.0: "1°", 10.0: "10°", 100.0: "100°"}

_RC: dict[Any, Any] = {
    "svg.fonttype": "none",
    "svg.hashsalt": "wallkit",
    "font.family": ["DejaVu Sans"],
    "font.size": 10,
    "text.color": INK,
    "text.parse_math": False,
    "axes.edgecolor": MUTED,
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "hatch.linewidth": 0.6,
    "path.simplify_threshold": 0.3,
}


@dataclass(frozen=True, slots=True)
class Raster:
    """A picture behind the lines of axes: (H, W) palette indices, row 0 at the top, at (left, bottom, right, top)."""

    axes: Axes
    indices: UInt8Array
    palette: Sequence[tuple[int, int, int]]
    box: tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class Key:
    """One entry of a legend: what it is called, and how its line, marker or (with a `hatch`) patch is drawn."""

    label: str
    style: Mapping[str, Any]


def style() -> Any:
    """Context in which figures are made and saved."""
    import matplotlib

    return matplotlib.rc_context(_RC)


def new_figure(height_in: float) -> Figure:
    """An empty figure of the page's width."""
    from matplotlib.figure import Figure

    return Figure(figsize=(WIDTH_IN, height_in))


def add_axes(figure: Figure, inches: tuple[float, float, float, float]) -> Axes:
    """Axes at (left, bottom, width, height) in inches, without ticks."""
    width, height = figure.get_size_inches()
    left, bottom, across, up = inches
    axes = figure.add_axes((left / width, bottom / height, across / width, up / height))
    axes.xaxis.set_visible(False)
    axes.yaxis.set_visible(False)
    return axes


# -------------------------------------------------------------------------------------------------------- SVG


def svg_from_figure(figure: Figure, rasters: Sequence[Raster] = ()) -> bytes:
    """The figure as SVG whose text stays text; no date, so that equal data gives equal bytes."""
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    for raster in rasters:
        raster.axes.patch.set(gid="background", facecolor="none")
    figure.set_canvas(FigureCanvasSVG(figure))
    buffer = io.StringIO()
    with warnings.catch_warnings():
        # the reader's browser has the letters that matplotlib's own font lacks
        warnings.filterwarnings("ignore", message="Glyph .* missing")
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    # the axes' background is drawn before everything else
    group = '<g id="background">'
    svg = buffer.getvalue().replace(group, group + "".join(_image_tag(figure, raster) for raster in rasters), 1)
    # laid out with matplotlib's own font, shown with the reader's: both are sans serif of about the same width
    return svg.replace("'DejaVu Sans'", "system-ui, 'Segoe UI', Helvetica, Arial, 'DejaVu Sans'").encode()


def printable(text: str) -> str:
    """The text without what neither XML nor a font can hold: control characters and halves of surrogate pairs."""
    return _NOT_PRINTABLE.sub("\ufffd", text)


_NOT_PRINTABLE = re.compile(r"[\x00-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]")


def _image_tag(figure: Figure, raster: Raster) -> str:
    """An SVG image of few colours; matplotlib's own would be a true-colour PNG, larger and ten times slower."""
    left, bottom, right, top = raster.box
    corners = raster.axes.transData.transform([(left, bottom), (right, top)]) * 72 / figure.dpi
    (x0, y0), (x1, y1) = corners.tolist()
    height = figure.get_size_inches()[1] * 72
    data = base64.b64encode(_png(raster)).decode()
    place = f'x="{x0:.3f}" y="{height - y1:.3f}" width="{x1 - x0:.3f}" height="{y1 - y0:.3f}"'
    return f'<image {place} preserveAspectRatio="none" xlink:href="data:image/png;base64,{data}"/>'


def _png(raster: Raster) -> bytes:
    from PIL import Image

    image = Image.fromarray(raster.indices)
    image.putpalette([channel for colour in raster.palette for channel in colour])
    buffer = io.BytesIO()
    bits = next(bits for bits in (2, 4, 8) if len(raster.palette) <= 2**bits)
    image.save(buffer, format="png", bits=bits)
    return buffer.getvalue()


# ------------------------------------------------------------------------------------------------------- axes


def draw_ticks(axes: Axes, side: Literal["x", "y"], ticks: Mapping[float, str], title: str = "") -> None:
    """Labels and a title along the lower or the left side, with grid lines across. The limits must be set before."""
    from matplotlib.collections import LineCollection
    from matplotlib.transforms import ScaledTranslation

    inches = axes.figure.dpi_scale_trans
    if side == "x":
        edge, away = axes.get_xaxis_transform(), ScaledTranslation(0, -0.07, inches)
        lines = [[(place, 0.0), (place, 1.0)] for place in ticks]
        for place, label in ticks.items():
            axes.text(place, 0, label, transform=edge + away, ha="center", va="top")
        beyond = ScaledTranslation(0, -0.3, inches)
        axes.text(0.5, 0, title, transform=axes.transAxes + beyond, ha="center", va="top")
    else:
        edge, away = axes.get_yaxis_transform(), ScaledTranslation(-0.07, 0, inches)
        lines = [[(0.0, place), (1.0, place)] for place in ticks]
        for place, label in ticks.items():
            axes.text(0, place, label, transform=edge + away, ha="right", va="center_baseline")
        beyond = ScaledTranslation(-0.62, 0, inches)
        axes.text(0, 0.5, title, transform=axes.transAxes + beyond, ha="right", va="center", rotation=90)
    grid = LineCollection(lines, colors=FAINT, linewidths=0.6, transform=edge, zorder=0.5)
    axes.add_collection(grid, autolim=False)


def linear_ticks(low: float, high: float, *, count: int = 8) -> dict[float, str]:
    """About `count` round numbers between low and high."""
    step = round_step((high - low) / count)
    numbers = np.arange(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1) * step
    return {number: f"{number:g}" for number in np.round(numbers, 9).tolist()}


def log_axis(axes: Axes, span: tuple[float, float], ticks: Mapping[float, str], title: str = "") -> None:
    """A logarithmic y axis over the span, with those of the ticks that fall inside."""
    axes.set_yscale("log")
    axes.set_ylim(*span)
    draw_ticks(axes, "y", {place: text for place, text in ticks.items() if span[0] <= place <= span[1]}, title)


def round_step(about: float) -> float:
    """The 1, 2 or 5 times a power of ten that is nearest above."""
    power = 10.0 ** math.floor(math.log10(about))
    return next(power * factor for factor in (1, 2, 5, 10) if power * factor >= about * (1 - 1e-9))


def legend_above(axes: Axes, keys: Sequence[Key], *, row: int = 0) -> None:
    """One row of legend entries above the axes, from the left; rows count upwards."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Rectangle

    figure: Any = axes.figure
    box, (width, height) = axes.get_position(), figure.get_size_inches()
    x, y = box.x0 * width, box.y1 * height + 0.17 + 0.22 * row
    place: dict[str, Any] = {"transform": figure.dpi_scale_trans, "clip_on": False}
    for key in keys:
        if "hatch" in key.style:
            figure.add_artist(Rectangle((x, y - 0.06), 0.32, 0.12, **key.style, **place))
        else:
            ends = [x + 0.16] if key.style.get("linestyle") == "none" else [x, x + 0.32]
            figure.add_artist(Line2D(ends, [y] * len(ends), **key.style, **place))
        figure.text(x + 0.4, y, key.label, transform=figure.dpi_scale_trans, va="center_baseline", fontsize=9.5)
        x += 0.65 + _LETTER_IN * len(key.label)


# mean width of a letter of 9.5 points
_LETTER_IN = 0.075


# ------------------------------------------------------------------------------------------------------- time


def time_scale(stamps_ns: Int64Array) -> tuple[str, float]:
    """Unit of the time axis and nanoseconds in it: seconds up to ten minutes, minutes beyond."""
    return ("min", 60e9) if stamps_ns[-1] - stamps_ns[0] > 600e9 else ("s", 1e9)


def times(steps: Steps, stamps_ns: Int64Array) -> Float64Array:
    """Stamps on the run's time axis, from its first scan."""
    return np.asarray((stamps_ns - steps.stamps_ns[0]) / time_scale(steps.stamps_ns)[1])


def time_text(steps: Steps, stamp_ns: int) -> str:
    """A moment on the run's time axis, as `12.5 min`."""
    unit, unit_ns = time_scale(steps.stamps_ns)
    return f"{(stamp_ns - int(steps.stamps_ns[0])) / unit_ns:.1f} {unit}"


def time_axis(axes: Axes, steps: Steps, *, is_labelled: bool = True) -> None:
    """The run's time, from the first scan to the last."""
    # a single scan still needs an axis of some length
    end = max(float(times(steps, steps.stamps_ns[-1:])[0]), 1e-3)
    axes.set_xlim(0, end)
    if is_labelled:
        title = f"time from the first scan [{time_scale(steps.stamps_ns)[0]}]"
        draw_ticks(axes, "x", linear_ticks(0, end), title)


def health_bands(axes: Axes, steps: Steps, *, span: tuple[float, float] = (0, 1)) -> list[Key]:
    """Hatched wherever the filter called itself UNCERTAIN or LOST; a legend key for each that occurs.

    Args:
        span: lower edge and height in shares of the axes' height.
    """
    at = times(steps, steps.stamps_ns)
    # a state holds until the next scan says otherwise
    edges = np.append(at, at[-1])
    keys = []
    for health, (face, line, hatch) in BANDS.items():
        spans = [(edges[a], edges[b] - edges[a]) for a, b, state in health_runs(steps.health) if state == health]
        look: dict[str, Any] = {"facecolor": face, "edgecolor": line, "hatch": hatch, "linewidth": 0}
        if spans:
            axes.broken_barh(spans, span, transform=axes.get_xaxis_transform(), clip_on=False, zorder=0, **look)
            keys.append(Key(f"filter says {health.name}", look))
    return keys
