"""Errors of many runs by place -> where on the map they fail, drawn on its walls."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from wallkit.core.types import Float64Array, Int64Array, OccupancyGrid, UInt8Array
from wallkit.report import canvas
from wallkit.report.canvas import Key, Raster
from wallkit.report.data import Picture
from wallkit.report.plan import ERROR_CLASSES_M
from wallkit.report.walls import WALL_COLOURS, View, draw_walls, view_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# upper bound of the share of runs that were lost in a place, and its colour: light to dark
LOST_CLASSES = ((0.0, "#d6e6ef"), (0.05, "#fdd49e"), (0.2, "#fc8d59"), (0.5, "#d7301f"), (1.0, "#7a0c2e"))
_PIXELS_PER_INCH = 110
_WALL = 2
_TALLEST_IN = 5.5


@dataclass(frozen=True, eq=False)
class Places:
    """What K places of one map saw.

    Attributes:
        name: of the map. grid: its walls; None leaves them out. cell_m: side of a place.
        cells: (K, 2) int64, a place is cells * cell_m to (cells + 1) * cell_m in frame map.
        error_m: (K,) mean position error of the runs that passed. lost: (K,) mean share of their scans there that were lost.
        passes: (K,) how many runs passed. runs, logs: that were read; unread: runs whose files could not be.
    """

    name: str
    grid: OccupancyGrid | None
    cell_m: float
    cells: Int64Array
    error_m: Float64Array
    lost: Float64Array
    passes: Int64Array
    runs: int
    logs: int
    unread: int = 0


def places_figure(places: Places) -> Picture:
    """The mean error by place, and beside or below it how often a run was lost there, if any was."""
    corners = np.vstack([places.cells, places.cells + 1]) * places.cell_m
    size = view_of(corners, margin_m=1.0).size
    view = view_of(corners, margin_m=1.0, aspect=float(np.clip(size[0] / size[1], 0.8, 4.0)))
    panels = [_error_panel(places)] + ([_lost_panel(places)] if places.lost.any() else [])
    # two wide maps go below each other
    is_column = view.size[0] / view.size[1] > 2.2 or len(panels) == 1
    columns = 1 if is_column else 2
    width = (canvas.WIDTH_IN - 0.3 - 0.4 * (columns - 1)) / columns
    height = min(width * view.size[1] / view.size[0], _TALLEST_IN)
    width = height * view.size[0] / view.size[1]
    rows = -(-len(panels) // columns)
    with canvas.style():
        figure = canvas.new_figure(rows * (height + 0.75) + 0.1)
        rasters = []
        for number, (title, classes, keys) in enumerate(panels):
            left = 0.15 + (number % columns) * (width + 0.4)
            bottom = 0.1 + (rows - 1 - number // columns) * (height + 0.75)
            rasters.append(_panel(figure, places, view, (left, bottom, width, height), title, classes, keys))
        svg = canvas.svg_from_figure(figure, rasters)
    worst = int(np.argmax(places.error_m))
    x, y = ((places.cells[worst] + 0.5) * places.cell_m).tolist()
    where = (
        f"The worst place is round ({x:.1f}, {y:.1f}) m: {places.error_m[worst]:.2f} m in {places.passes[worst]} runs."
    )
    missing = f" {places.unread} runs left no trajectory or have no truth." if places.unread else ""
    return Picture(
        f"places-{places.name}",
        f"Where it fails: {places.name}",
        f"Every square of {places.cell_m:g} m that the robot truly passed, over {places.runs} runs of {places.logs} logs,"
        f" each run counting once in a square. {where}{missing}",
        f"Map of {places.name} with the error by place. {where}",
        svg,
    )


def cell_size(corners: Float64Array) -> float:
    """Side of a place [m]: sixty or more along the map's longer side, unless they would be under 0.1 or over 2 m."""
    longest = float(np.ptp(corners, axis=0).max())
    return max((side for side in (0.2, 0.25, 0.5, 1.0, 2.0) if side <= longest / 60), default=0.1)


# -------------------------------------------------------------------------------------------- details

_Panel = tuple[str, Int64Array, tuple[tuple[str, str], ...]]


def _error_panel(places: Places) -> _Panel:
    bounds = [high for high, _, _ in ERROR_CLASSES_M[:-1]]
    texts = ["to 5 cm", "10 cm", "30 cm", "1 m", "more"]
    keys = tuple(zip(texts, (colour for _, colour, _ in ERROR_CLASSES_M), strict=True))
    return "mean error", np.searchsorted(bounds, places.error_m, side="right"), keys


def _lost_panel(places: Places) -> _Panel:
    bounds = [high for high, _ in LOST_CLASSES[:-1]]
    keys = tuple(zip(["never", "to 5 %", "20 %", "50 %", "more"], (colour for _, colour in LOST_CLASSES), strict=True))
    return "scans lost", np.searchsorted(bounds, places.lost, side="left"), keys


def _panel(
    figure: Figure,
    places: Places,
    view: View,
    inches: tuple[float, float, float, float],
    title: str,
    classes: Int64Array,
    keys: tuple[tuple[str, str], ...],
) -> Raster:
    axes = canvas.add_axes(figure, inches)
    axes.spines[:].set_visible(False)
    axes.set_xlim(view.left, view.right)
    axes.set_ylim(view.bottom, view.top)
    _scale_bar(axes, view)
    legend = [Key(text, {"color": colour, "linewidth": 7, "solid_capstyle": "butt"}) for text, colour in keys]
    canvas.legend_above(axes, legend)
    axes.annotate(title, (0, 1), (0, 24), xycoords="axes fraction", textcoords="offset points", fontweight="bold")
    palette = [*WALL_COLOURS, *(_rgb(colour) for _, colour in keys)]
    pixels = (round(inches[2] * _PIXELS_PER_INCH), round(inches[3] * _PIXELS_PER_INCH))
    box = (view.left, view.bottom, view.right, view.top)
    return Raster(axes, _painted(places, view, pixels, classes), palette, box)


def _painted(places: Places, view: View, pixels: tuple[int, int], classes: Int64Array) -> UInt8Array:
    """(H, W) the walls, and below them the class of each place."""
    width, height = pixels
    grid = places.grid
    picture = np.ones((height, width), dtype=np.uint8) if grid is None else draw_walls(grid, view, pixels=pixels)
    low = places.cells.min(axis=0)
    table = np.full(places.cells.max(axis=0) - low + 1, -1, dtype=np.int64)
    table[tuple((places.cells - low).T)] = classes
    x = view.left + (np.arange(width) + 0.5) * view.size[0] / width
    y = view.top - (np.arange(height) + 0.5) * view.size[1] / height
    columns = np.floor(x / places.cell_m).astype(np.int64) - low[0]
    rows = np.floor(y / places.cell_m).astype(np.int64) - low[1]
    inside_x, inside_y = (columns >= 0) & (columns < table.shape[0]), (rows >= 0) & (rows < table.shape[1])
    found = table[columns.clip(0, table.shape[0] - 1)[None, :], rows.clip(0, table.shape[1] - 1)[:, None]]
    is_shown = (found >= 0) & inside_x[None, :] & inside_y[:, None] & (picture != _WALL)
    return np.where(is_shown, len(WALL_COLOURS) + found, picture).astype(np.uint8)


def _scale_bar(axes: Axes, view: View) -> None:
    length = canvas.round_step(view.size[0] / 12)
    right, y = view.right - 0.02 * view.size[0], view.bottom + 0.03 * view.size[1]
    axes.plot([right - length, right], [y, y], color=canvas.INK, linewidth=3, solid_capstyle="butt", zorder=14)
    axes.annotate(f"{length:g} m", (right, y), (0, 4), textcoords="offset points", ha="right", fontsize=9.5, zorder=13)


def _rgb(colour: str) -> tuple[int, int, int]:
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)
