"""A drawing -> a PNG file, pixel for pixel what the SVG shows; matplotlib is imported inside, and without pyplot."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

import numpy as np

from wallkit.core.types import Float64Array
from wallkit.maps.draw.marks import Area, Drawing, Line, Mark, Style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_DPI = 100
_POINTS_PER_PX = 72 / _DPI


def png_from_drawing(drawing: Drawing, *, pixels_per_px: float = 1.0, colours: int | None = None) -> bytes:
    """The file.

    Args:
        pixels_per_px: 2 for twice as many pixels each way.
        colours: at most so many, for small files; None: all.
    """
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    width, height = drawing.size_px
    with matplotlib.rc_context({"font.family": ["DejaVu Sans"], "text.parse_math": False}):
        figure = Figure(figsize=(width / _DPI, height / _DPI), dpi=_DPI * pixels_per_px, facecolor="white")
        FigureCanvasAgg(figure)
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0), frameon=False)
        axes.set_xlim(0, width)
        axes.set_ylim(height, 0)
        axes.set_axis_off()
        order = 0
        for groups, is_plan in ((drawing.plan, True), (drawing.page, False)):
            for mark in (mark for group in groups for mark in group.marks):
                order += 1
                _draw(axes, drawing, mark, is_plan, order)
        buffer = io.BytesIO()
        figure.savefig(buffer, format="png", dpi="figure", metadata={"Software": None})
    return _fewer_colours(buffer.getvalue(), colours)


# -------------------------------------------------------------------------------------------- details


def _draw(axes: Axes, drawing: Drawing, mark: Mark, is_plan: bool, order: int) -> None:
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    if isinstance(mark, Area):
        rings = [drawing.to_page(ring) if is_plan else ring for ring in mark.rings]
        path = Path.make_compound_path(*(Path(np.vstack([ring, ring[:1]]), closed=True) for ring in rings))
        axes.add_patch(PathPatch(path, zorder=order, **_look(drawing.styles[mark.style])))
    elif isinstance(mark, Line):
        points: Float64Array = drawing.to_page(mark.points) if is_plan else mark.points
        look = {**_look(drawing.styles[mark.style]), "facecolor": "none"}
        axes.add_patch(PathPatch(Path(points), zorder=order, capstyle="round", **look))
    else:
        anchor = {"start": "left", "middle": "center", "end": "right"}[mark.anchor]
        axes.text(
            *mark.at,
            mark.words,
            fontsize=mark.size_px * _POINTS_PER_PX,
            color=mark.colour,
            ha=anchor,
            va="center_baseline" if mark.turn_deg == 0 else "center",
            rotation=mark.turn_deg,
            rotation_mode="anchor",
            weight="bold" if mark.is_bold else "normal",
            zorder=order,
        )


def _look(style: Style) -> dict[str, object]:
    width = style.width_px * _POINTS_PER_PX
    look: dict[str, object] = {"facecolor": style.fill, "edgecolor": style.stroke, "linewidth": width}
    if style.stroke == "none":
        look["linewidth"] = 0.0
    if style.dash_px:
        # matplotlib counts dashes in line widths
        look["linestyle"] = (0, tuple(dash / style.width_px for dash in style.dash_px))
    if style.opacity != 1.0:
        look["alpha"] = style.opacity
    return look


def _fewer_colours(png: bytes, colours: int | None) -> bytes:
    from PIL import Image

    if colours is None:
        return png
    image = Image.open(io.BytesIO(png)).convert("RGB").quantize(colours, dither=Image.Dither.NONE)
    buffer = io.BytesIO()
    image.save(buffer, format="png", optimize=True)
    return buffer.getvalue()
