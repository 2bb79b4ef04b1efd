"""A run -> figures on the map: where the robot went and how wrong it was there, and where the particles were."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from wallkit.core.geometry import compose, interpolate_poses, relative
from wallkit.core.types import BoolArray, Float64Array, Health, Int64Array, Trajectory, UInt8Array
from wallkit.report import canvas
from wallkit.report.canvas import Key, Raster
from wallkit.report.data import Picture, ReportData, Snapshot
from wallkit.report.overhead import draw_ceiling
from wallkit.report.walls import WALL_COLOURS, View, draw_walls, view_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# upper bound, colour, width in points: the worse, the warmer and the wider
ERROR_CLASSES_M = (
    (0.05, canvas.SKY, 1.6),
    (0.1, canvas.BLUE, 1.9),
    (0.3, canvas.ORANGE, 2.8),
    (1.0, canvas.VERMILION, 3.8),
    (np.inf, "#7a0c2e", 5.0),
)
_MAP_PIXELS_PER_INCH = 110
# steps across the width of the map in which a path is drawn
_PATH_STEPS = 800
_PANELS = 6
_PANEL_PIXELS = 320
# height of a panel with its title, in widths
_PANEL_HEIGHT = 1.09
# four arms that leave the middle, where the cloud should be, open
_CROSS = np.array(
    [
        [-0.09, -0.03, np.nan, 0.03, 0.09, np.nan, 0, 0, np.nan, 0, 0],
        [0, 0, np.nan, 0, 0, np.nan, -0.09, -0.03, np.nan, 0.03, 0.09],
    ]
)
_WHITE = np.full((_PANEL_PIXELS, _PANEL_PIXELS), 1, dtype=np.uint8)
# a particle is a plus of five pixels; many on one pixel darken it in four steps
_DOT = ((0, 0), (0, 1), (1, 0), (-1, 0), (0, -1))
_INKS = (0.45, 0.65, 0.85, 1.0)
_PARTICLE = np.array([0xD5, 0x5E, 0x00])
_INKED = [
    tuple(np.rint(np.array(wall) * (1 - ink) + _PARTICLE * ink).astype(int)) for ink in _INKS for wall in WALL_COLOURS
]


def map_figure(data: ReportData) -> Picture | None:
    """The estimate on the walls, coloured by its error (by its spread without a truth)."""
    view = _view_of_run(data)
    width_in = canvas.WIDTH_IN - 0.95
    height_in = width_in * view.size[1] / view.size[0]
    figure = canvas.new_figure(height_in + 1.15)
    axes = canvas.add_axes(figure, (0.85, 0.5, width_in, height_in))
    what = "error" if data.errors else "spread"
    things = _ends(axes, data) + _truth(axes, data) + _odometry(axes, data) + _lost_marks(axes, data)
    canvas.legend_above(axes, things, row=1)
    canvas.legend_above(axes, _coloured_path(axes, data, what, view.size[0] / _PATH_STEPS))
    _scale_bar(axes, view)
    axes.set_xlim(view.left, view.right)
    axes.set_ylim(view.bottom, view.top)
    per_tick_m = max(view.size) / 8
    x_ticks = canvas.linear_ticks(view.left, view.right, count=max(2, round(view.size[0] / per_tick_m)))
    y_ticks = canvas.linear_ticks(view.bottom, view.top, count=max(2, round(view.size[1] / per_tick_m)))
    canvas.draw_ticks(axes, "x", x_ticks, "x in the map [m]")
    canvas.draw_ticks(axes, "y", y_ticks, "y in the map [m]")
    overhead = "" if data.ceiling is None else " Behind it, faded, is the ceiling."
    reading = f"The wider and warmer the line, the larger the {what}.{overhead} {_worst(data)}"
    return Picture(
        "map",
        "Where the robot was",
        reading if data.errors else f"{reading}No truth is known: the spread is what the filter claims, not its error.",
        f"Map with the estimated path from start to end, its {what} shown by colour and width.{overhead} {_worst(data)}",
        canvas.svg_from_figure(figure, _ground(axes, data, view, (width_in, height_in))),
    )


def particles_figure(data: ReportData) -> Picture | None:
    """The particles at the chosen updates, each on its own piece of the map."""
    if not data.snapshots:
        return None
    # the first, the last, and evenly between
    chosen = np.unique(np.linspace(0, len(data.snapshots) - 1, _PANELS).round().astype(int))
    shots = [data.snapshots[index] for index in chosen]
    columns, rows = min(len(shots), 3), -(-len(shots) // 3)
    side_in = (canvas.WIDTH_IN - 0.1) / 3
    height_in = rows * _PANEL_HEIGHT * side_in
    figure = canvas.new_figure(height_in)
    axes = canvas.add_axes(figure, (0.05, 0, columns * side_in, height_in))
    axes.spines[:].set_visible(False)
    axes.set_xlim(0, columns)
    axes.set_ylim(0, rows * _PANEL_HEIGHT)
    corners = [(index % 3, _PANEL_HEIGHT * (rows - 1 - index // 3)) for index in range(len(shots))]
    rasters = [_panel(axes, data, shot, corner) for shot, corner in zip(shots, corners, strict=True)]
    cross = "the truth" if data.truth else "the estimate (no truth is known)"
    return Picture(
        "particles",
        "What the filter believed",
        f"Every dot is a hypothesis of where the robot is; the cross is {cross}. One tight cloud on the cross is good,"
        " several clouds are honest doubt, one tight cloud beside the cross is confidently wrong. Each piece has its"
        " own scale.",
        "Particles on the map: " + ", ".join(shot.label for shot in shots) + ".",
        canvas.svg_from_figure(figure, rasters),
    )


# ------------------------------------------------------------------------------------------------------ the map


def _view_of_run(data: ReportData) -> View:
    """All of the estimate and the truth, and enough of the map round them to recognise the place."""
    places = data.steps.poses[:, :2]
    if data.truth is not None:
        places = np.vstack([places, data.truth.poses[:, :2]])
    margin_m = max(2.0, 0.05 * float(np.ptp(places, axis=0).max()))
    width, height = view_of(places, margin_m=margin_m).size
    # neither a thread nor a tower: both would be unreadable on a page
    return view_of(places, margin_m=margin_m, aspect=float(np.clip(width / height, 1.3, 3.5)))


def _ground(axes: Axes, data: ReportData, view: View, inches: tuple[float, float]) -> list[Raster]:
    """The walls, and the ceiling above them if the run saw it."""
    pixels = (round(inches[0] * _MAP_PIXELS_PER_INCH), round(inches[1] * _MAP_PIXELS_PER_INCH))
    box = (view.left, view.bottom, view.right, view.top)
    if data.ceiling is not None:
        return [Raster(axes, *draw_ceiling(data.ceiling, data.grid, view, pixels=pixels), box)]
    if data.grid is None:
        return []
    return [Raster(axes, draw_walls(data.grid, view, pixels=pixels), WALL_COLOURS, box)]


def _coloured_path(axes: Axes, data: ReportData, what: str, step_m: float) -> list[Key]:
    """The estimate cut into stretches of equal class, a point per step at most; worse ones are drawn on top."""
    from matplotlib.collections import LineCollection

    rows = _thinned(data.steps.poses[:, :2], step_m)
    places = data.steps.poses[rows, :2]
    classes = _classes(np.fmax.reduceat(_badness(data), rows))
    keys, low_m = [], 0.0
    for number, (high_m, colour, width) in enumerate(ERROR_CLASSES_M):
        lines = [places[a : b + 1] for a, b in _stretches(classes == number)]
        axes.add_collection(LineCollection(lines, colors=colour, linewidths=width, capstyle="round", zorder=3 + number))
        label = f"over {_length(low_m)}" if np.isinf(high_m) else f"{_length(low_m)} to {_length(high_m)}"
        keys.append(Key(label if number else f"{what} {label}", {"color": colour, "linewidth": width}))
        low_m = high_m
    return keys + _unknown_path(axes, places, classes < 0)


def _unknown_path(axes: Axes, places: Float64Array, is_unknown: BoolArray) -> list[Key]:
    """The pieces for which the log has no truth."""
    from matplotlib.collections import LineCollection

    lines = [places[a : b + 1] for a, b in _stretches(is_unknown)]
    if not lines:
        return []
    axes.add_collection(LineCollection(lines, colors=canvas.MUTED, linewidths=1.2, zorder=3))
    return [Key("no truth here", {"color": canvas.MUTED, "linewidth": 1.2})]


def _thinned(places: Float64Array, step_m: float) -> Int64Array:
    """First row of each step travelled: a slow robot at 40 Hz would fill the page with points nobody can tell apart."""
    travelled = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(places, axis=0).T))])
    return np.flatnonzero(np.diff(np.floor(travelled / step_m), prepend=-1.0))


def _badness(data: ReportData) -> Float64Array:
    """(T,) position error [m] of each update, else its spread; NaN where the truth is silent."""
    if data.errors is None:
        return np.hypot(data.steps.sd[:, 0], data.steps.sd[:, 1])
    badness = np.full(len(data.steps), np.nan)
    badness[data.errors.rows] = data.errors.position_m
    return badness


def _classes(badness_m: Float64Array) -> Int64Array:
    """(T - 1,) class of each piece of path, the worse of its two ends; -1 where unknown."""
    pieces = np.fmax(badness_m[1:], badness_m[:-1])
    classes = np.searchsorted([high for high, _, _ in ERROR_CLASSES_M[:-1]], pieces, side="right")
    return np.where(np.isnan(pieces), -1, classes)


def _stretches(mask: BoolArray) -> list[tuple[int, int]]:
    """[start, end) of every run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def _truth(axes: Axes, data: ReportData) -> list[Key]:
    """Below the estimate: it shows where the two part."""
    if data.truth is None:
        return []
    style: dict[str, Any] = {"color": canvas.INK, "linewidth": 1.2, "linestyle": (0, (3, 1.5))}
    axes.plot(*data.truth.poses[:, :2].T, **style, zorder=2.5)
    return [Key("truth", style)]


def _odometry(axes: Axes, data: ReportData) -> list[Key]:
    """What the wheels alone would have said, from the first estimate on; it may leave the picture."""
    if data.odometry is None:
        return []
    style: dict[str, Any] = {"color": "#8a949e", "linewidth": 1.0, "linestyle": (0, (1, 1.5))}
    axes.plot(*_from_first_estimate(data.odometry, data)[:, :2].T, **style, zorder=2)
    return [Key("odometry alone", style)]


def _from_first_estimate(odometry: Trajectory, data: ReportData) -> Float64Array:
    start = interpolate_poses(odometry.stamps_ns, odometry.poses, data.steps.stamps_ns[:1])[0]
    later = odometry.poses[odometry.stamps_ns >= data.steps.stamps_ns[0]]
    return compose(data.steps.poses[0], relative(start, later))


def _ends(axes: Axes, data: ReportData) -> list[Key]:
    keys = []
    for place, name, marker, colour in (
        (data.steps.poses[0], "start", "o", canvas.GREEN),
        (data.steps.poses[-1], "end", "s", canvas.PURPLE),
    ):
        style = _marker(marker, colour, 10)
        axes.plot(*place[:2].tolist(), **style, zorder=12)
        keys.append(Key(name, style))
    return keys


def _lost_marks(axes: Axes, data: ReportData) -> list[Key]:
    lost = data.steps.poses[data.steps.health == Health.LOST, :2]
    if not len(lost):
        return []
    every = -(-len(lost) // 150)
    style = _marker("X", canvas.INK, 8)
    axes.plot(*lost[::every].T, **style, zorder=11)
    return [Key("filter says LOST", style)]


def _marker(marker: str, colour: str, size: float) -> dict[str, Any]:
    look = {"marker": marker, "color": colour, "markersize": size}
    return {**look, "linestyle": "none", "markeredgecolor": "white", "markeredgewidth": 1.0}


def _scale_bar(axes: Axes, view: View) -> None:
    length = canvas.round_step(view.size[0] / 12)
    right, y = view.right - 0.02 * view.size[0], view.bottom + 0.03 * view.size[1]
    _bar(axes, (right - length, right, y), f"{length:g} m")


def _bar(axes: Axes, place: tuple[float, float, float], text: str) -> None:
    """A scale bar from x to x at y with its length above."""
    left, right, y = place
    box = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1}
    axes.annotate(text, (right, y), (0, 4), textcoords="offset points", ha="right", bbox=box, fontsize=9.5, zorder=13)
    axes.plot([left, right], [y, y], color=canvas.INK, linewidth=3, solid_capstyle="butt", zorder=14)


def _worst(data: ReportData) -> str:
    if data.errors is None or not len(data.errors):
        return ""
    row = int(np.argmax(data.errors.position_m))
    at = canvas.time_text(data.steps, int(data.errors.stamps_ns[row]))
    return f"The largest error, {data.errors.position_m[row]:.2f} m, is at {at}."


def _length(metres: float) -> str:
    return "0" if metres == 0 else f"{metres * 100:g} cm" if metres < 1 else f"{metres:g} m"


# ---------------------------------------------------------------------------------------------------- particles


def _panel(axes: Axes, data: ReportData, shot: Snapshot, corner: tuple[float, float]) -> Raster:
    """One snapshot in a unit square, in axes whose own scale is panels."""
    robot = _robot(data, shot)
    view = view_of(np.vstack([shot.poses[:, :2], robot]), margin_m=1.5, aspect=1.0)
    pixels = (_PANEL_PIXELS, _PANEL_PIXELS)
    walls = _WHITE if data.grid is None else draw_walls(data.grid, view, pixels=pixels)
    left, bottom, side = corner[0] + 0.02, corner[1] + 0.02, 0.96
    u, v = (robot - [view.left, view.bottom]) / view.size[0] * side + [left, bottom]
    x, y = (_CROSS + np.array([[u], [v]])).tolist()
    axes.plot(x, y, color="white", linewidth=4.5)
    axes.plot(x, y, color=canvas.BLUE, linewidth=2.0)
    right, top = left + side, bottom + side
    axes.plot([left, right, right, left, left], [bottom, bottom, top, top, bottom], color=canvas.FAINT, linewidth=1)
    label = f"{canvas.printable(shot.label)}, {canvas.time_text(data.steps, shot.stamp_ns)}"
    axes.text(left, top + 0.02, label, va="bottom")
    bar = canvas.round_step(view.size[0] / 6)
    _bar(axes, (right - 0.03 - bar / view.size[0] * side, right - 0.03, bottom + 0.04), f"{bar:g} m")
    return Raster(axes, _dotted(walls, shot, view), [*WALL_COLOURS, *_INKED], (left, bottom, right, top))


def _robot(data: ReportData, shot: Snapshot) -> Float64Array:
    """(2,) where the robot was, or was estimated to be without a truth."""
    path = data.truth or data.steps.trajectory
    return interpolate_poses(path.stamps_ns, path.poses, [shot.stamp_ns])[0, :2]


def _dotted(walls: UInt8Array, shot: Snapshot, view: View) -> UInt8Array:
    """The picture with the particles painted in: thousands of dots weigh nothing as pixels, a megabyte as shapes."""
    height, width = walls.shape
    columns = ((shot.poses[:, 0] - view.left) / view.size[0] * width).astype(np.int64)
    rows = ((view.top - shot.poses[:, 1]) / view.size[1] * height).astype(np.int64)
    # the margin of the view keeps every dot inside
    flat = np.concatenate([(rows + down) * width + columns + right for down, right in _DOT])
    weights = np.tile(shot.weights * len(shot.weights), len(_DOT))
    density = np.bincount(flat, weights, minlength=walls.size).reshape(walls.shape)
    # one particle of average weight is the lightest ink, ten on a pixel the fullest
    ink = np.searchsorted([1.5, 4.0, 10.0], density)
    return np.where(density > 0, len(WALL_COLOURS) * (1 + ink) + walls, walls).astype(np.uint8)
