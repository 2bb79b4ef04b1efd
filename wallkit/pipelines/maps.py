"""A map named by the user, the settings or the log -> the fields the filter needs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from wallkit.core.types import FieldSet, OccupancyGrid
from wallkit.errors import Finding, MapError
from wallkit.logs.reader import Log
from wallkit.maps.fields import MapsSettings, fields_from_grid
from wallkit.maps.raster import read_raster


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
    if path is not None:
        grid, findings = read_raster(path)
        return LoadedMap(grid, fields_from_grid(grid, wall_depth_m=settings.wall_depth_m), tuple(findings), (path,))
    maps = dict(log.static.maps) if log else {}
    if not maps:
        raise MapError(
            "no map was given and the log carries none",
            where=log.name if log else "",
            hint='--map floor.yaml, or map = "floor.yaml" in wallkit.toml',
        )
    if len(maps) > 1:
        raise MapError(f"the log carries several maps: {', '.join(sorted(maps))}", hint="name one file with --map")
    (grid,) = maps.values()
    return LoadedMap(grid, fields_from_grid(grid, wall_depth_m=settings.wall_depth_m), (), ())
