"""Files of other programs -> drafts of maps, with a note for everything read, guessed and left out."""

from __future__ import annotations

from pathlib import Path

from wallkit.errors import MapError, closest
from wallkit.maps.importers.boxes import COLUMNS, read_boxes
from wallkit.maps.importers.dxf import read_dxf
from wallkit.maps.importers.imported import Imported, Importer, ImportOptions
from wallkit.maps.importers.lines import read_lines
from wallkit.maps.importers.raster import read_map_raster
from wallkit.maps.importers.rmf import read_rmf
from wallkit.maps.importers.urdf import read_urdf

__all__ = ["IMPORTERS", "ImportOptions", "Imported", "import_map", "recognise"]

# so much of a file tells what it is
HEAD_BYTES = 65536


def import_map(path: Path, options: ImportOptions, *, format_name: str | None = None) -> Imported:
    """The drafts of a file, by the named importer or the one its content calls for.

    Raises:
        MapError: the format is unknown, or the importer's own reasons.
    """
    name = format_name or recognise(path)
    if name not in IMPORTERS:
        raise MapError(f"there is no importer '{name}'", where=path, hint=closest(name, IMPORTERS))
    return IMPORTERS[name](path, options)


def recognise(path: Path) -> str:
    """The importer (a key of IMPORTERS) for a file, by its content, then by its suffix.

    Raises:
        MapError: it cannot be read, or nothing tells.
    """
    try:
        with path.open("rb") as file:
            head = file.read(HEAD_BYTES)
    except OSError as error:
        raise MapError(f"cannot read it: {error.strerror}", where=path, hint="name the file to import") from error
    text = head.decode("utf-8", errors="replace")
    lines = [line.strip() for line in text.splitlines()]
    keys = {line.split(":")[0] for line in text.splitlines() if ":" in line and line[:1].isalpha()}
    if head.startswith(b"AutoCAD Binary DXF") or lines[1:2] == ["SECTION"]:
        return "dxf"
    if {"image", "resolution"} <= keys:
        return "pgm"
    if "features" in keys:
        return "lines"
    if "levels" in keys or path.name.endswith(".building.yaml"):
        return "rmf"
    if b"<robot" in head:
        return "urdf"
    header = next((line for line in lines if line and not line.startswith("#")), "")
    if len({word.strip().lower() for word in header.split(",")} & set(COLUMNS)) > len(COLUMNS) // 2:
        return "csv"
    if path.suffix.lower() in SUFFIXES:
        return SUFFIXES[path.suffix.lower()]
    raise MapError("nothing in it tells its format", where=path, hint=f"name it: --format {'|'.join(IMPORTERS)}")


SUFFIXES: dict[str, str] = {".dxf": "dxf", ".csv": "csv", ".urdf": "urdf"}

IMPORTERS: dict[str, Importer] = {
    "rmf": read_rmf,
    "pgm": read_map_raster,
    "lines": read_lines,
    "dxf": read_dxf,
    "csv": read_boxes,
    "urdf": read_urdf,
}
