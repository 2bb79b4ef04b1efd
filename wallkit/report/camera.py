"""A calibrated camera -> one self-contained page: verdict, where the board was seen, what is left over, how sure it is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from wallkit.core.types import Float64Array
from wallkit.report import canvas
from wallkit.report.canvas import Key, Raster
from wallkit.report.data import Picture
from wallkit.report.html import rendered
from wallkit.report.verdict import TONES, Answer

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_LEFT = 0.85
_CELLS = (16, 12)
_FEWEST = 3
# steps of the uncertainty map [px] and their colours, light to dark; grey where the model sees nothing
_STEPS = (0.1, 0.2, 0.5, 1.0, 2.0)
_PALETTE = (
    (238, 246, 251),
    (198, 224, 240),
    (140, 190, 222),
    (72, 144, 196),
    (22, 92, 150),
    (8, 42, 84),
    (221, 226, 230),
)


@dataclass(frozen=True)
class CameraData:
    """What the page shows.

    Attributes:
        verdict: PASS, FAIL or CANNOT TELL. meaning: it in a sentence. reasons: why it is no PASS. answers: the gates.
        parameters: (name, value, sigma, 95 %) of each; models: rows of the comparison, as texts.
        facts: (name, value) about the inputs.
        size: width and height of the image. pixels, residuals: (N, 2) used corners and projected minus observed.
        us, vs, sigma_px: (C,), (R,), (R, C) standard deviation of a pixel at infinity.
        view_names, view_rms_px, is_out: (V,) of each view, rejected ones included.
    """

    title: str
    verdict: str
    meaning: str
    reasons: tuple[str, ...]
    answers: tuple[Answer, ...]
    parameters: tuple[tuple[str, str, str, str], ...]
    models: tuple[tuple[str, ...], ...]
    facts: tuple[tuple[str, str], ...]
    definitions: tuple[str, ...]
    size: tuple[int, int]
    pixels: Float64Array
    residuals: Float64Array
    us: Float64Array
    vs: Float64Array
    sigma_px: Float64Array
    view_names: tuple[str, ...]
    view_rms_px: Float64Array
    is_out: tuple[bool, ...]


def camera_html(data: CameraData) -> str:
    """The page."""
    with canvas.style():
        pictures = [coverage_figure(data), sigma_figure(data), views_figure(data)]
    return rendered("camera.html", data=data, tone=TONES[data.verdict], pictures=pictures)


def coverage_figure(data: CameraData) -> Picture:
    """Where corners were seen, and beside it the mean residual of each part of the image."""
    figure, height = _figure_of(data, 0.5)
    width = (canvas.WIDTH_IN - 1.2) / 2
    seen = _image_axes(figure, data, (0.4, 0.45, width, height), "where corners were seen")
    seen.plot(*data.pixels.T, ".", color=canvas.BLUE, markersize=2.5, alpha=0.6)
    field = _image_axes(figure, data, (0.8 + width, 0.45, width, height), "mean residual of each part")
    middles, means, counts = _field(data)
    longest = float(np.linalg.norm(means, axis=1).max()) if len(means) else 0.0
    scale = 0.9 * data.size[0] / _CELLS[0] / max(longest, 1e-9)
    ends = middles + means * scale
    for (u, v), (a, b) in zip(middles.tolist(), ends.tolist(), strict=True):
        field.annotate("", (a, b), (u, v), arrowprops={"arrowstyle": "->", "color": canvas.VERMILION, "linewidth": 1.0})
    share = float(counts) / (_CELLS[0] * _CELLS[1])
    return Picture(
        "coverage",
        "What the views cover, and what is left over",
        "Left: bare parts tell nothing about the lens there. Right: arrows that point every which way are noise; a pattern"
        f" of outward, inward or parallel arrows means that the model does not fit. The longest arrow is {longest:.3f} px.",
        f"Corners in {100 * share:.0f} % of the image's parts; mean residuals of up to {longest:.3f} px.",
        canvas.svg_from_figure(figure),
    )


def sigma_figure(data: CameraData) -> Picture:
    """The standard deviation of a pixel, over the image."""
    figure, height = _figure_of(data, 0.62)
    axes = _image_axes(figure, data, (0.4, 0.45, 0.62 * (canvas.WIDTH_IN - 1.2), height), "")
    indices = np.searchsorted(_STEPS, np.nan_to_num(data.sigma_px, nan=np.inf)).astype(np.uint8)
    indices[~np.isfinite(data.sigma_px)] = len(_PALETTE) - 1
    width, high = data.size
    # drawn large, since browsers smooth small pictures
    fine = np.kron(indices, np.ones((8, 8), dtype=np.uint8)).astype(np.uint8)
    raster = Raster(axes, fine, _PALETTE, (-0.5, high - 0.5, width - 0.5, -0.5))
    low = (0.0, *_STEPS)
    labels = [f"{a:g} to {b:g} px" for a, b in zip(low, _STEPS, strict=False)] + [f"over {_STEPS[-1]:g} px", "no ray"]
    shown = sorted({int(i) for i in np.unique(indices)})
    x = 0.4 + 0.62 * (canvas.WIDTH_IN - 1.2) + 0.4
    for row, index in enumerate(shown):
        _patch(figure, x, 0.45 + height - 0.3 - 0.3 * row, labels[index], tuple(c / 255 for c in _PALETTE[index]))
    median = float(np.nanmedian(data.sigma_px))
    return Picture(
        "sigma",
        "How sure each pixel is",
        "One standard deviation of where a far point lands, a turn of the whole camera taken out. Twice as much holds 95 %."
        " It grows where the board was not shown.",
        f"Median {median:.2f} px, worst {float(np.nanmax(data.sigma_px)):.2f} px.",
        canvas.svg_from_figure(figure, (raster,)),
    )


def views_figure(data: CameraData) -> Picture:
    """The RMS of each view; rejected ones stand out."""
    figure = canvas.new_figure(2.9)
    axes = canvas.add_axes(figure, (_LEFT, 0.6, canvas.WIDTH_IN - _LEFT - 0.15, 1.8))
    count, out = len(data.view_names), np.array(data.is_out, dtype=bool)
    places = np.arange(1, count + 1)
    high = 1.1 * float(data.view_rms_px.max())
    axes.set_xlim(0, count + 1)
    axes.set_ylim(0, high)
    for which, colour in ((~out, canvas.BLUE), (out, canvas.VERMILION)):
        axes.bar(places[which], data.view_rms_px[which], width=0.7, color=colour)
    median = float(np.median(data.view_rms_px[~out]))
    axes.axhline(median, color=canvas.INK, linewidth=1.0, linestyle=(0, (5, 3)))
    canvas.draw_ticks(axes, "x", {k: v for k, v in canvas.linear_ticks(1, count).items() if k == int(k)}, "view")
    canvas.draw_ticks(axes, "y", canvas.linear_ticks(0, high, count=5), "RMS [px]")
    keys = [
        Key("used", {"facecolor": canvas.BLUE, "hatch": ""}),
        Key("their median", {"color": canvas.INK, "linewidth": 1.0, "linestyle": (0, (5, 3))}),
    ]
    if out.any():
        keys.append(Key("rejected", {"facecolor": canvas.VERMILION, "hatch": ""}))
    canvas.legend_above(axes, keys)
    worst = data.view_names[int(data.view_rms_px.argmax())]
    rejected = ", ".join(name for name, gone in zip(data.view_names, data.is_out, strict=True) if gone)
    return Picture(
        "views",
        "How well each view agrees",
        "All about the same is good. " + (f"Rejected: {rejected}." if rejected else "None was rejected."),
        f"{count} views; the worst is {worst} with {float(data.view_rms_px.max()):.3f} px.",
        canvas.svg_from_figure(figure),
    )


def _figure_of(data: CameraData, share: float) -> tuple[Figure, float]:
    """A figure as high as an image that takes a share of its width, and that height [in]."""
    height = share * (canvas.WIDTH_IN - 1.2) * data.size[1] / data.size[0]
    return canvas.new_figure(height + 0.9), height


def _image_axes(figure: Figure, data: CameraData, inches: tuple[float, float, float, float], title: str) -> Axes:
    """Axes over the whole image, v down."""
    axes = canvas.add_axes(figure, inches)
    axes.set_xlim(-0.5, data.size[0] - 0.5)
    axes.set_ylim(data.size[1] - 0.5, -0.5)
    for spine in axes.spines.values():
        spine.set_visible(True)
    if title:
        axes.text(0, 1.03, title, transform=axes.transAxes, va="bottom", fontsize=9.5)
    return axes


def _patch(figure: Figure, x: float, y: float, label: str, colour: tuple[float, ...]) -> None:
    from matplotlib.patches import Rectangle

    place = figure.dpi_scale_trans
    figure.add_artist(Rectangle((x, y - 0.08), 0.32, 0.16, facecolor=colour, edgecolor=canvas.MUTED, transform=place))
    figure.text(x + 0.42, y, label, transform=place, va="center_baseline", fontsize=9.5)


def _field(data: CameraData) -> tuple[Float64Array, Float64Array, int]:
    """Middles and mean residuals (K, 2) of the parts of the image with a few corners, and how many have any."""
    cells = np.array(_CELLS)
    where = np.clip((data.pixels + 0.5) * cells / data.size, 0, cells - 1).astype(np.int64)
    flat = where[:, 1] * cells[0] + where[:, 0]
    counts = np.bincount(flat, minlength=int(cells.prod()))
    sums = np.stack([np.bincount(flat, part, int(cells.prod())) for part in data.residuals.T], -1)
    enough = np.flatnonzero(counts >= _FEWEST)
    middles = (np.stack([enough % cells[0], enough // cells[0]], -1) + 0.5) * np.array(data.size) / cells - 0.5
    return middles, sums[enough] / counts[enough, None], int((counts > 0).sum())
