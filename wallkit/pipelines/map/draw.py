"""A map file -> its plan as an SVG or PNG file, or as text; with the findings of the rules where they are asked for."""

from __future__ import annotations

from pathlib import Path

from wallkit.errors import MapError, OutputError
from wallkit.maps.draw.plan import PlanSettings, draw_plan
from wallkit.maps.model import SemanticMap
from wallkit.maps.read import load_map
from wallkit.maps.rules.base import MapFinding
from wallkit.pipelines.map.verdicts import Selection, judge
from wallkit.pipelines.outputs import write_whole

SUFFIXES = (".svg", ".png")
# the colours of a floor plan are few; 64 keep the edges of letters smooth
_PNG_COLOURS = 64


def map_with_findings(path: Path, selection: Selection | None) -> tuple[SemanticMap, tuple[MapFinding, ...]]:
    """The map; with a selection also the errors and warnings of the rules, and then the map as far as it can be read.

    What is only said for information would bury them: `wallkit map validate` lists it.

    Raises:
        MapError: the file cannot be read, is not XML, or (without a selection) is not sound as URDF.
    """
    if selection is None:
        return load_map(path), ()
    report = judge([path], selection)[0].report
    if report.map is None:
        first = report.findings[0]
        raise MapError(f"{first.code} {first.message}", where=f"{path}:{first.line}:{first.column}", hint=first.hint)
    return report.map, tuple(finding for finding in report.findings if finding.severity != "info")


def plane_of(semantic_map: SemanticMap, plane: float | str | None) -> float | None:
    """The height [m] meant by a number, or by "lidar": the map's scan plane. None stays None.

    Raises:
        MapError: the map does not say its scan plane.
    """
    if plane == "lidar":
        plane_m = semantic_map.header.scan_plane_m
        if plane_m is None:
            hint = "name a height: --z 0.3, or write scan_plane into <wk:map>"
            raise MapError("the map does not say the LiDAR's height", where=semantic_map.source, hint=hint)
        return plane_m
    return None if plane is None else float(plane)


def check_target(out: Path, *, overwrite: bool) -> None:
    """Refuse a file that cannot be drawn into, before any work is done.

    Raises:
        OutputError: it is neither SVG nor PNG, or exists and is not to be replaced.
    """
    if out.suffix.lower() not in SUFFIXES:
        raise OutputError(f"'{out.suffix}' is no kind of picture", where=out, hint="end it in .svg or .png")
    if out.exists() and not overwrite:
        raise OutputError("is already there", where=out, hint="choose another name, or pass --overwrite to replace it")


def write_plan(
    out: Path, semantic_map: SemanticMap, settings: PlanSettings, findings: tuple[MapFinding, ...] = ()
) -> int:
    """Draw the plan into a file by its suffix; how many bytes it has.

    Raises:
        MapError: there is nothing to draw. OutputError: it cannot be written.
    """
    from wallkit.maps.draw.png import png_from_drawing
    from wallkit.maps.draw.svg import svg_from_drawing

    drawing = draw_plan(semantic_map, settings, findings)
    is_svg = out.suffix.lower() == ".svg"
    data = svg_from_drawing(drawing) if is_svg else png_from_drawing(drawing, colours=_PNG_COLOURS)
    write_whole(out, data)
    return len(data)
