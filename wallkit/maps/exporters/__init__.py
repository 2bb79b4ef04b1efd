"""Semantic maps -> files of other programs, with a note for everything that those cannot say."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

from wallkit.errors import MapError, closest
from wallkit.maps.exporters.class_fields import export_fields
from wallkit.maps.exporters.exported import Exported, Exporter, ExportOptions
from wallkit.maps.exporters.geojson import export_geojson
from wallkit.maps.exporters.pgm import export_pgm
from wallkit.maps.exporters.rmf import export_rmf
from wallkit.maps.exporters.sdf import export_sdf
from wallkit.maps.exporters.svg import export_svg
from wallkit.maps.exporters.urdf import export_urdf
from wallkit.maps.model import SemanticMap

__all__ = ["EXPORTERS", "ExportOptions", "Exported", "Exporter", "export_map", "format_of"]


def export_map(
    semantic_map: SemanticMap, out: Path, options: ExportOptions, *, format_name: str | None = None
) -> Exported:
    """The files that say a sound map in another format, by the named exporter or the one that the suffix of `out` means.

    Raises:
        MapError: the format is unknown, does not heed an option that was given, or the exporter's own reasons.
    """
    name = format_name or format_of(out)
    if name not in EXPORTERS:
        raise MapError(f"there is no exporter '{name}'", where=out, hint=closest(name, EXPORTERS))
    exporter = EXPORTERS[name]
    for field in fields(ExportOptions):
        if getattr(options, field.name) != field.default and field.name not in exporter.options:
            takers = ", ".join(other for other, taker in EXPORTERS.items() if field.name in taker.options)
            raise MapError(f"format {name} has no use for {OPTION_FLAGS[field.name]}", where=out, hint=f"{takers} do")
    return exporter.write(semantic_map, out, options)


def format_of(out: Path) -> str:
    """The exporter (a key of EXPORTERS) that a path's suffix means; of several the longest suffix.

    Raises:
        MapError: it means none.
    """
    found = [(suffix, name) for name, e in EXPORTERS.items() for suffix in e.suffixes if out.name.endswith(suffix)]
    if not found:
        raise MapError(
            "its suffix does not tell the format", where=out, hint=f"name it: --format {'|'.join(EXPORTERS)}"
        )
    return max(found, key=lambda pair: len(pair[0]))[1]


OPTION_FLAGS: dict[str, str] = {
    "z_m": "--z",
    "cell_m": "--resolution",
    "doors": "--doors",
    "is_solid": "--solid",
    "crs": "--crs",
}

EXPORTERS: dict[str, Exporter] = {
    "pgm": Exporter(export_pgm, (".yaml", ".pgm"), frozenset({"z_m", "cell_m", "doors", "is_solid"})),
    "fields": Exporter(export_fields, (), frozenset({"z_m", "cell_m"}), is_folder=True),
    "urdf": Exporter(export_urdf, (".urdf",)),
    "svg": Exporter(export_svg, (".svg",), frozenset({"z_m"})),
    "geojson": Exporter(export_geojson, (".geojson",), frozenset({"z_m", "doors", "crs"})),
    "sdf": Exporter(export_sdf, (".sdf",), frozenset({"doors"})),
    "rmf": Exporter(export_rmf, (".building.yaml",)),
}
