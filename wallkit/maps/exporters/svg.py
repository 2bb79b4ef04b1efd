"""A semantic map -> its floor plan as SVG, by the one renderer that `wallkit map show` uses too."""

from __future__ import annotations

from pathlib import Path

from wallkit.maps.draw.plan import PlanSettings, plan_svg
from wallkit.maps.exporters.exported import Exported, ExportOptions, Notes, things
from wallkit.maps.model import SemanticMap


def export_svg(semantic_map: SemanticMap, out: Path, options: ExportOptions) -> Exported:
    """One .svg with a group for every link, in metres of the map frame; with --z what a plane there cuts is bold.

    Raises:
        MapError: nothing in the map can be drawn.
    """
    notes = Notes(semantic_map.source, "a floor plan")
    data = plan_svg(semantic_map, PlanSettings(z_m=options.z_m))
    meshes = sum(shape.kind == "mesh" for link in things(semantic_map) for shape in link.shapes)
    notes.wrote("the floor plan in metres of the map frame, y up inside its own group")
    notes.lose("mesh", meshes, many="meshes")
    return Exported({out: data}, notes.all())
