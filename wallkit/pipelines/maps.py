"""A map named by the user, the settings or the log -> the fields the filter needs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from wallkit.core.types import FieldSet, OccupancyGrid
from wallkit.errors import Finding, MapError
from wallkit.logs.reader import Log
from wallkit.maps.grids.fields import MapsSettings, fields_from_grid
from wallkit.maps.grids.raster import read_raster
from wallkit.maps.grids.semantic_fields import fields_from_map
from wallkit.maps.model import SemanticMap
from wallkit.maps.read import load_map as load_semantic_map

_BYTE_ORDER_MARKS = (b"\xef\xbb\xbf", b"\xff\xfe", b"\xfe\xff")


@dataclass(frozen=True)
class LoadedMap:
    """A map ready for localization: as grid to draw, as fields to score, and what is odd about it."""

    grid: OccupancyGrid
    fields: FieldSet
    findings: tuple[Finding, ...]
    files: tuple[Path, ...]


def load_map(path: Path | None, log: Log | None, settings: MapsSettings) -> LoadedMap:
    """The map at a path, or the one the log carries.

    Raises:
        MapError: there is none, several, or it cannot be used.
    """
    if path is not None and is_semantic(path):
        return _from_semantic_map(path, settings)
    if path is not None:
        grid, findings = read_raster(path)
        return LoadedMap(grid, fields_from_grid(grid, wall_depth_m=settings.wall_depth_m), tuple(findings), (path,))
    maps = dict(log.static.maps) if log else {}
    if not maps:
        raise MapError(
            "no map was given and the log carries none",
            where=log.name if log else "",
            hint='--map floor.yaml or floor.wkmap.urdf, or map = "floor.yaml" in wallkit.toml',
        )
    if len(maps) > 1:
        raise MapError(f"the log carries several maps: {', '.join(sorted(maps))}", hint="name one file with --map")
    (grid,) = maps.values()
    return LoadedMap(grid, fields_from_grid(grid, wall_depth_m=settings.wall_depth_m), (), ())


def is_semantic(path: Path) -> bool:
    """Whether a file is a semantic map: it begins as XML does, or calls itself a URDF."""
    if path.suffix == ".urdf":
        return True
    try:
        with path.open("rb") as file:
            head = file.read(1024)
    except OSError:
        # the raster's reader says why
        return False
    for mark in _BYTE_ORDER_MARKS:
        head = head.removeprefix(mark)
    return head.replace(b"\0", b"").lstrip().startswith(b"<")


def _from_semantic_map(path: Path, settings: MapsSettings) -> LoadedMap:
    try:
        semantic_map = load_semantic_map(path)
    except MapError as error:
        listing = f"`wallkit map validate {path}` lists everything that is wrong"
        hint = listing if "wallkit map validate" in error.hint or not error.hint else f"{error.hint}; {listing}"
        raise MapError(error.message, where=error.where, hint=hint) from error
    drawn = fields_from_map(semantic_map, cell_m=settings.cell_m, scan_plane_m=settings.scan_plane_m)
    return LoadedMap(drawn.grid, drawn.fields, tuple(_left_out(semantic_map)), (path,))


def _left_out(semantic_map: SemanticMap) -> Iterator[Finding]:
    """What the map holds and the fields do not."""
    shapes = [shape for link in semantic_map.links.values() for shape in link.shapes]
    meshes = [shape for shape in shapes if shape.kind == "mesh"]
    bodiless = [shape for shape in shapes if shape.kind != "mesh" and not (shape.size > 0).all()]
    for code, left_out, what, hint in (
        ("fields.meshes", meshes, "meshes", "give what the LiDAR can see a <box> in its <collision>"),
        ("fields.sizes", bodiless, "shapes without a size", "every length of a shape is above 0"),
    ):
        if left_out:
            line, column = semantic_map.document.place(left_out[0].element.offset)
            yield Finding(
                code,
                "warning",
                semantic_map.source,
                f"{what} that are not drawn: {len(left_out)}; this is the first",
                line=line,
                column=column,
                hint=hint,
                detail={"count": len(left_out)},
            )
