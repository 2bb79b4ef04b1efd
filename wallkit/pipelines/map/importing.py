"""A file of another program -> one .wkmap.urdf per level."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from wallkit.errors import Finding, MapError, OutputError
from wallkit.maps.draft.draft import Draft
from wallkit.maps.draft.write import write_draft
from wallkit.maps.importers import ImportOptions, import_map
from wallkit.pipelines.map.verdicts import SUFFIX
from wallkit.pipelines.outputs import write_whole


@dataclass(frozen=True)
class ImportedLevel:
    """One level as a file, not yet written."""

    draft: Draft
    path: Path
    data: bytes


def import_levels(
    path: Path, out: Path, options: ImportOptions, *, format_name: str | None = None, overwrite: bool = False
) -> tuple[list[ImportedLevel], tuple[Finding, ...]]:
    """The levels of a file as maps to be written, and the notes of the import.

    Args:
        out: a .urdf file for a single level; else a folder, where each level's file has the level's name.

    Raises:
        MapError: the file cannot be imported, or a draft cannot be written. OutputError: `out` cannot take the levels.
    """
    imported = import_map(path, options, format_name=format_name)
    if not imported.drafts:
        raise MapError("holds no level with walls", where=path, hint="say what it is: --format, --layer")
    levels = [
        ImportedLevel(draft, _place(draft, out, imported.drafts), imported.data or write_draft(draft))
        for draft in imported.drafts
    ]
    for level in levels:
        if level.path.exists() and not overwrite:
            raise OutputError(
                "exists", where=level.path, hint="choose another --out, or pass --overwrite to replace it"
            )
    return levels, imported.notes


def write_levels(levels: list[ImportedLevel]) -> None:
    """Write the levels' files.

    Raises:
        OutputError: one cannot be written.
    """
    for level in levels:
        try:
            level.path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputError(f"cannot be made: {error.strerror}", where=level.path.parent) from error
        write_whole(level.path, level.data)


def _place(draft: Draft, out: Path, drafts: tuple[Draft, ...]) -> Path:
    if out.suffix != ".urdf" or out.is_dir():
        return out / f"{draft.name}{SUFFIX}"
    if len(drafts) > 1:
        names = ", ".join(d.level for d in drafts)
        raise OutputError(f"is one file for {len(drafts)} levels ({names})", where=out, hint="name a folder with --out")
    return out
