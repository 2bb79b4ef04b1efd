"""A map file -> the files of another program, every one whole."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from wallkit.errors import OutputError
from wallkit.maps.exporters import EXPORTERS, Exported, ExportOptions, export_map, format_of
from wallkit.maps.read import load_map


@dataclass(frozen=True)
class PlannedExport:
    """What would be written; stale: pictures that an earlier export left in the folder and this one has not."""

    exported: Exported
    stale: tuple[Path, ...] = ()


def plan_export(
    path: Path, out: Path, options: ExportOptions, *, format_name: str | None = None, overwrite: bool = False
) -> PlannedExport:
    """What would be written for a map, and the notes of the export.

    Raises:
        MapError: the map is not sound, the format is unknown, or the exporter's own reasons.
        OutputError: something is in the way.
    """
    name = format_name or format_of(out)
    exported = export_map(load_map(path), out, options, format_name=name)
    for file in exported.files:
        if file.exists() and file.samefile(path):
            raise OutputError("is the map itself", where=file, hint="choose another --out")
    is_folder = EXPORTERS[name].is_folder
    stale = _stale(out, exported) if is_folder and out.exists() else ()
    in_the_way = [*(file for file in exported.files if file.exists()), *stale]
    if in_the_way and not overwrite:
        where = out if is_folder else in_the_way[0]
        raise OutputError("exists", where=where, hint="choose another --out, or pass --overwrite to replace it")
    return PlannedExport(exported, stale)


def write_export(plan: PlannedExport) -> None:
    """Write the files under names of their own, then give all of them their names.

    Raises:
        OutputError: one cannot be written.
    """
    files = plan.exported.files
    working = {path: path.with_name(f".{path.name}.partial-{os.getpid()}") for path in files}
    try:
        for path, data in files.items():
            path.parent.mkdir(parents=True, exist_ok=True)
            working[path].write_bytes(data)
        for path, written in working.items():
            written.replace(path)
        for path in plan.stale:
            path.unlink()
    except OSError as error:
        raise OutputError(f"cannot be written: {error.strerror}", where=path, hint="choose another place") from error
    finally:
        for written in working.values():
            if written.exists():
                written.unlink()


def _stale(out: Path, exported: Exported) -> tuple[Path, ...]:
    """What a folder holds besides the files, if an earlier export can have left it there.

    Raises:
        OutputError: it is no folder, or holds something else.
    """
    if not out.is_dir():
        raise OutputError("is a file, and this format is a folder", where=out, hint="choose another --out")
    others = sorted(set(out.iterdir()) - set(exported.files))
    strangers = [file for file in others if file.suffix != ".png" or not (out / "fields.json").is_file()]
    if strangers:
        raise OutputError(f"holds '{strangers[0].name}', which is no field", where=out, hint="choose another --out")
    return tuple(others)
