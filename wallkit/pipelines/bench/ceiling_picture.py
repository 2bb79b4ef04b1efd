"""The ceiling's study -> pictures: how often each model converged, and where below a ceiling its runs knew their place."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from wallkit.core.ceiling import CeilingMap
from wallkit.core.geometry import invert, transform_points
from wallkit.core.types import Float64Array
from wallkit.pipelines.bench.ceiling import MODELS, Row
from wallkit.report import canvas

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_WIDTH_IN = 10.0
# sigma over which the slope of colours is taken
_GRAIN_M = 0.1
# of a path: none of the runs knows its place, half, all of them; told apart with every common colour blindness
_NEVER, _SOME, _ALWAYS = canvas.VERMILION, "#f7e9c8", canvas.BLUE


def bars_picture(rows: Sequence[Row]) -> bytes:
    """PNG: a panel for each world, in it a bar for each model started everywhere with its own resampling.

    A full bar is a run that converged; the pale rest of it one that came near and was lost. Worlds stand in the order
    of the rows, models in that of MODELS; where a world has several rows of a model, the first is drawn.
    """
    shown: dict[str, dict[str, Row]] = {}
    for row in rows:
        if (row.resampler, row.init, row.story) == ("own", "everywhere", "drive"):
            shown.setdefault(row.world, {}).setdefault(row.model, row)
    names = [name for name in MODELS if any(name in found for found in shown.values())]
    with canvas.style():
        figure, panels = _panels(len(shown), 0.36 * len(names) + 1.05)
        for axes, (world, found) in zip(panels, shown.items(), strict=True):
            for y, name in enumerate(names):
                if name not in found:
                    axes.text(2, y, "not run", va="center", fontsize=9, color=canvas.MUTED)
                    continue
                row = found[name]
                share = 100 * row.converged / row.seeds
                axes.barh(y, 100, height=0.7, color="#f0f2f4")
                axes.barh(y, 100 * row.came / row.seeds, height=0.7, color="#a9cfe6")
                axes.barh(y, share, height=0.7, color=canvas.BLUE)
                inside = share > 40
                axes.text(
                    share - 3 if inside else max(share, 0) + 3, y, f"{row.converged} of {row.seeds}", va="center",
                    ha="right" if inside else "left", fontsize=10, color="white" if inside else canvas.INK,
                    fontweight="bold",
                )  # fmt: skip
            axes.set_title(world, fontsize=12, fontweight="bold", loc="left")
            axes.set(xlim=(0, 100), ylim=(len(names) - 0.5, -0.5), xticks=[])
            axes.set_yticks(range(len(names)), names if axes is panels[0] else [""] * len(names), fontsize=11)
            axes.tick_params(length=0)
            axes.spines[["left", "bottom"]].set_visible(False)
        _small_print(figure, ((canvas.BLUE, "runs that converged"), ("#a9cfe6", "came near the truth, did not stay")))
        return _png(figure)


def places_picture(
    ceiling: CeilingMap, truth: Float64Array, seconds: Float64Array, near: Float64Array, title: str
) -> bytes:
    """PNG: share of the runs that were near over time and, above it, along the path; where colours run smoothest is grey.

    Args:
        truth: (T, 3) where the robot truly was. seconds: (T,). near: (T,) share of the runs that were near it.
    """
    from matplotlib.collections import LineCollection
    from matplotlib.colors import LinearSegmentedColormap

    xy = transform_points(invert(ceiling.origin), truth[:, :2])
    low, high = xy.min(axis=0) - 1.0, xy.max(axis=0) + 1.0
    shades = LinearSegmentedColormap.from_list("near", [_NEVER, _SOME, _ALWAYS])
    width, height = (high - low).tolist()
    slopes = slopes_along(ceiling, truth)
    smooth = slopes < np.quantile(slopes, 1 / 3)
    with canvas.style():
        up_in = (_WIDTH_IN - 0.4) * height / width
        figure, (plan, over_time) = _stack((up_in, 1.5))
        plan.imshow(ceiling.pixels, origin="lower", extent=(0, ceiling.size_m[0], 0, ceiling.size_m[1]))
        pieces = np.stack([xy[:-1], xy[1:]], axis=1)
        plan.add_collection(LineCollection(list(pieces), colors="white", linewidths=11, capstyle="round"))
        plan.add_collection(LineCollection(list(pieces[smooth[1:]]), colors=canvas.INK, linewidths=11, capstyle="butt"))
        plan.add_collection(LineCollection(list(pieces), colors=shades(near[1:]), linewidths=6, capstyle="round"))
        plan.plot(*xy[0], "o", color=canvas.INK, markersize=11)
        plan.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), xticks=[], yticks=[])
        plan.set_title(title, fontsize=12, fontweight="bold", loc="left")
        over_time.fill_between(seconds, 0, 100, where=smooth, color="#c9ced3", linewidth=0, step="mid")
        over_time.plot(seconds, 100 * near, color=canvas.BLUE, linewidth=2)
        over_time.set(xlim=(seconds[0], seconds[-1]), ylim=(0, 100), yticks=(0, 50, 100), xlabel="s")
        over_time.set_yticklabels(["0 %", "50 %", "100 %"])
        words = ((_NEVER, "no run near"), (_SOME, "half of them"), (_ALWAYS, "all of them"))
        _small_print(figure, (*words, ("#c9ced3", "the smoothest third (black edge on the plan)")))
        return _png(figure)


def slopes_along(ceiling: CeilingMap, truth: Float64Array) -> Float64Array:
    """(T,) change of colour per metre at the robot: channels from 0 to 1, root of the sum of squares, grain blurred away."""
    import cv2

    pixels = cv2.GaussianBlur(ceiling.pixels.astype(np.float32) / 255, (0, 0), _GRAIN_M / ceiling.resolution_m)
    down, across = np.gradient(pixels, ceiling.resolution_m, axis=(0, 1))
    cells, _ = ceiling.cells_at(truth[:, :2])
    rows, columns = cells.T
    return np.asarray(np.sqrt((down[rows, columns] ** 2 + across[rows, columns] ** 2).sum(axis=1)), dtype=np.float64)


def _stack(heights_in: tuple[float, float]) -> tuple[Figure, tuple[Axes, Axes]]:
    from matplotlib.figure import Figure

    first, second = heights_in
    total = first + second + 1.35
    figure = Figure(figsize=(_WIDTH_IN, total), dpi=110)
    lower = figure.add_axes((0.065, 0.8 / total, 0.915, second / total))
    upper = figure.add_axes((0.02, (0.8 + second + 0.2) / total, 0.96, first / total))
    return figure, (upper, lower)


def _panels(number: int, height_in: float, left_in: float = 0.95) -> tuple[Figure, list[Axes]]:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(_WIDTH_IN, height_in), dpi=110)
    each = (_WIDTH_IN - left_in - 0.1) / number
    boxes = [(left_in + i * each, 0.4, each - 0.2, height_in - 0.8) for i in range(number)]
    return figure, [
        figure.add_axes((x / _WIDTH_IN, y / height_in, w / _WIDTH_IN, h / height_in)) for x, y, w, h in boxes
    ]


def _small_print(figure: Figure, entries: Sequence[tuple[str, str]]) -> None:
    from matplotlib.patches import Patch

    patches = [Patch(facecolor=colour, edgecolor=canvas.MUTED, linewidth=0.5) for colour, _ in entries]
    figure.legend(
        patches, [text for _, text in entries], loc="lower center", ncols=len(entries), frameon=False, fontsize=10
    )


def _png(figure: Figure) -> bytes:
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    buffer = io.BytesIO()
    figure.set_canvas(FigureCanvasAgg(figure))
    figure.savefig(buffer, format="png", metadata={"Software": None})
    return buffer.getvalue()
