"""The ceiling's study -> pictures: how often each model converged, and where below a ceiling its runs knew their place."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from wallkit.core.ceiling import CeilingMap
from wallkit.core.geometry import invert, transform_points
from wallkit.core.types import Float64Array
from wallkit.pipelines.bench.ceiling import MODELS, Outcome, Row
from wallkit.report import canvas

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_WIDTH_IN = 10.0
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
        _small_print(figure, ((canvas.BLUE, "runs that converged"), ("#a9cfe6", "came near the truth, and lost it")))
        return _png(figure)


def places_picture(ceiling: CeilingMap, truth: Float64Array, done: Sequence[Outcome], name: str) -> bytes:
    """PNG: the path over the ceiling, in the colour of how many of the runs knew their place there.

    Args:
        truth: (T, 3) where the robot truly was. done: runs over it. name: of their model.
    """
    from matplotlib.collections import LineCollection
    from matplotlib.colors import LinearSegmentedColormap

    near = np.mean([one.is_near for one in done], axis=0)
    xy = transform_points(invert(ceiling.origin), truth[:, :2])
    low, high = xy.min(axis=0) - 1.0, xy.max(axis=0) + 1.0
    shades = LinearSegmentedColormap.from_list("near", [_NEVER, _SOME, _ALWAYS])
    width, height = (high - low).tolist()
    with canvas.style():
        figure, (axes,) = _panels(1, (_WIDTH_IN - 0.4) * height / width + 0.8, left_in=0.1)
        axes.imshow(ceiling.pixels, origin="lower", extent=(0, ceiling.size_m[0], 0, ceiling.size_m[1]))
        pieces = list(np.stack([xy[:-1], xy[1:]], axis=1))
        axes.add_collection(LineCollection(pieces, colors="white", linewidths=9, capstyle="round"))
        axes.add_collection(LineCollection(pieces, colors=shades(near[1:]), linewidths=6, capstyle="round"))
        axes.plot(*xy[0], "o", color=canvas.INK, markersize=9)
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), xticks=[], yticks=[])
        title = f"{name}: its {len(done)} runs know where they are {near.mean():.0%} of the time"
        axes.set_title(title, fontsize=12, fontweight="bold", loc="left")
        words = ((_NEVER, "none of the runs knows its place"), (_SOME, "half of them"), (_ALWAYS, "all"))
        _small_print(figure, (*words, (canvas.INK, "start")))
        return _png(figure)


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
