"""A run -> all its figures, in the order of the page."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from wallkit.report import canvas
from wallkit.report.curves import beams_figure, convergence_figure, error_figure, timing_figure
from wallkit.report.data import Picture, ReportData
from wallkit.report.plan import map_figure, particles_figure


def draw_figures(data: ReportData) -> tuple[Picture, ...]:
    """Every figure that the run has data for."""
    with canvas.style():
        pictures = [draw(data) for draw in FIGURES.values()]
    return tuple(picture for picture in pictures if picture is not None)


FIGURES: Mapping[str, Callable[[ReportData], Picture | None]] = {
    "map": map_figure,
    "error": error_figure,
    "beams": beams_figure,
    "convergence": convergence_figure,
    "particles": particles_figure,
    "timing": timing_figure,
}
