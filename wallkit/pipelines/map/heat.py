"""A scored or probed map -> a picture of it, SVG or PNG: walls to scale, coloured places, a legend."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from wallkit.core.types import Int64Array
from wallkit.errors import OutputError
from wallkit.maps.classes import RESTROOM_V1
from wallkit.maps.score.rivals import CONTINUUM
from wallkit.maps.score.world import World
from wallkit.pipelines.map.verdicts import write_whole
from wallkit.report import canvas

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from wallkit.pipelines.map.score import Probe, Scored

# lowest number of modes, colour, what it means; light to dark and told apart with every common colour blindness
HEAT = (
    (1, "#cfe8f3", "unique"),
    (2, "#fdd49e", "2 poses alike"),
    (3, "#fc8d59", "3 or 4"),
    (5, "#d7301f", "5 and more"),
    (CONTINUUM, "#7a0c2e", "a whole line"),
)
_SIDE_IN = 9.0


def heat_picture(scored: Scored, kind: str) -> bytes:
    """Where the map looks alike; kind: "svg" or "png"."""
    result = scored.result
    modes, places = result.plain.modes, result.poses[:, :2]
    with canvas.style():
        figure, axes = _plan(scored.world)
        shade = _shades(modes)
        size = result.cell_m * _points_per_metre(figure, axes)
        for number, (_, colour, label) in enumerate(HEAT):
            chosen = places[shade == number]
            share = f"{len(chosen) / len(places):.0%}"
            axes.scatter(
                chosen[:, 0],
                chosen[:, 1],
                s=(0.95 * size) ** 2,
                c=colour,
                marker="s",
                linewidths=0,
                zorder=2,
                clip_on=False,
            )
            axes.plot([], [], "s", color=colour, label=f"{label} ({share})", markersize=9)
        for rank, i in enumerate(result.plain.worst(result.poses).tolist(), start=1):
            axes.annotate(
                str(rank), places[i], ha="center", va="center", fontsize=9, color="white", fontweight="bold", zorder=5,
                bbox={"boxstyle": "circle,pad=0.25", "facecolor": canvas.INK, "linewidth": 0},
            )  # fmt: skip
        title = f"{result.plain.share:.0%} of the floor is ambiguous ({result.labelled.share:.0%} with classes)"
        _finish(axes, title, f"{scored.robot}; numbers: the worst places")
        return _rendered(figure, kind)


def probe_picture(probe: Probe, kind: str) -> bytes:
    """The expected scan on the map; kind: "svg" or "png"."""
    from matplotlib.collections import LineCollection

    x, y, yaw = probe.pose
    with canvas.style():
        figure, axes = _plan(probe.world)
        hit = np.isfinite(probe.ranges_m)
        headings = yaw + probe.bearings_rad[hit]
        ends = np.array([x, y]) + probe.ranges_m[hit, None] * np.column_stack([np.cos(headings), np.sin(headings)])
        rays = [((x, y), tuple(end)) for end in ends.tolist()]
        axes.add_collection(LineCollection(rays, colors=canvas.FAINT, linewidths=0.6, zorder=2))
        classes = np.array(probe.classes)[hit]
        for name, share in probe.shares().items():
            if name:
                own = ends[classes == name]
                label = f"{name} ({share:.0%})"
                axes.plot(own[:, 0], own[:, 1], "o", color=_colour(name), markersize=5, zorder=4, label=label)
        length = 0.06 * float(np.ptp(axes.get_xlim()))
        arrow = {"arrowstyle": "-|>", "color": canvas.VERMILION, "linewidth": 2}
        axes.annotate("", (x + length * np.cos(yaw), y + length * np.sin(yaw)), (x, y), arrowprops=arrow, zorder=6)
        axes.plot([x], [y], "o", color=canvas.VERMILION, markersize=8, zorder=6, label="the robot")
        _finish(
            axes, f"Expected scan at ({x:g}, {y:g}, {np.degrees(yaw):.0f} deg): share of beams by class", probe.robot
        )
        return _rendered(figure, kind)


def write_picture(path: Path, data: bytes, *, overwrite: bool) -> None:
    """Write a picture in one step.

    Raises:
        OutputError: it exists, or cannot be written.
    """
    check_picture(path, overwrite=overwrite)
    write_whole(path, data)


def check_picture(path: Path, *, overwrite: bool) -> str:
    """The kind of picture a path asks for.

    Raises:
        OutputError: it is neither .png nor .svg, or exists.
    """
    kind = path.suffix.lower().removeprefix(".")
    if kind not in ("png", "svg"):
        raise OutputError("is no picture's name", where=path, hint="end it in .png or .svg")
    if path.exists() and not overwrite:
        raise OutputError("exists", where=path, hint="choose another --out, or pass --overwrite to replace it")
    return kind


# -------------------------------------------------------------------------------------------- details


def _shades(modes: Int64Array) -> Int64Array:
    """(N,) index into HEAT."""
    lowest = [low for low, _, _ in HEAT[:-1]]
    found = np.searchsorted(lowest, modes, side="right") - 1
    return np.asarray(np.where(modes == CONTINUUM, len(HEAT) - 1, found))


def _plan(world: World) -> tuple[Figure, Axes]:
    """A figure with the surfaces round the floor, to scale."""
    from matplotlib.collections import LineCollection
    from matplotlib.figure import Figure

    floor = np.array(world.free.bounds).reshape(2, 2)
    margin = 0.05 * float(np.ptp(floor, axis=0).max()) + 0.3
    low, high = floor[0] - margin, floor[1] + margin
    width, height = (high - low).tolist()
    scale = _SIDE_IN / max(width, height)
    across, up = max(width * scale, 5.0), height * scale
    figure = Figure(figsize=(across + 0.4, up + 1.35), dpi=110)
    total_w, total_h = figure.get_size_inches()
    axes = figure.add_axes((0.2 / total_w, 0.85 / total_h, across / total_w, up / total_h))
    slack = (across / scale - width) / 2
    axes.set_xlim(low[0] - slack, high[0] + slack)
    axes.set_ylim(low[1], high[1])
    axes.axis("off")
    for name in world.class_names:
        own = world.segments[world.classes == world.class_names.index(name)].reshape(-1, 2, 2)
        style = {"linewidths": 1.4 if name == "wall" else 2.0, "zorder": 3}
        axes.add_collection(LineCollection(own.tolist(), colors=_colour(name), **style))
    return figure, axes


def _finish(axes: Axes, title: str, below: str) -> None:
    """Title, legend, scale bar and a line of small print."""
    left, right = axes.get_xlim()
    bottom, _ = axes.get_ylim()
    length = max(step for step in (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100) if step <= max((right - left) / 5, 0.1))
    axes.plot([left, left + length], [bottom, bottom], color=canvas.INK, linewidth=2.5, clip_on=False, zorder=6)
    axes.annotate(f"{length:g} m", (left + length, bottom), (5, 0), textcoords="offset points", va="center", fontsize=9)
    axes.set_title(title, fontsize=13, fontweight="bold", loc="left")
    axes.annotate(
        below, (0, 0), (0, -50), xycoords="axes fraction", textcoords="offset points", fontsize=8, color=canvas.MUTED
    )
    axes.legend(
        loc="upper left", bbox_to_anchor=(0.0, -8 / 72 / _height_in(axes)), ncols=5, frameon=False, fontsize=9,
        handletextpad=0.2, columnspacing=1.0, borderaxespad=0.3,
    )  # fmt: skip


def _height_in(axes: Axes) -> float:
    figure = axes.get_figure()
    assert figure is not None
    return float(axes.get_position().height * figure.get_size_inches()[1])  # type: ignore[union-attr]


def _points_per_metre(figure: Figure, axes: Axes) -> float:
    width_in = float(axes.get_position().width * figure.get_size_inches()[0])
    left, right = axes.get_xlim()
    return 72 * width_in / (right - left)


def _colour(class_name: str) -> str:
    info = RESTROOM_V1.get(class_name)
    return (info.color if info else "") or canvas.MUTED


def _rendered(figure: Figure, kind: str) -> bytes:
    if kind == "svg":
        return canvas.svg_from_figure(figure)
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    buffer = io.BytesIO()
    figure.set_canvas(FigureCanvasAgg(figure))
    figure.savefig(buffer, format="png", metadata={"Software": None})
    return buffer.getvalue()
