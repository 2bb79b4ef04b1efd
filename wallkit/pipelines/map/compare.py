"""Map files -> the same files in canonical form, what is different between two, and three merged into one."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from wallkit.errors import OutputError
from wallkit.maps.canonical import canonical
from wallkit.maps.diff.changes import Change
from wallkit.maps.diff.compare import TOLERANCE, compare_maps
from wallkit.maps.diff.links import Side, renamed_links
from wallkit.maps.diff.merge import Conflict, merge_maps
from wallkit.maps.diff.merge_names import Names
from wallkit.maps.model import SemanticMap
from wallkit.maps.read import load_map
from wallkit.maps.rules import validate
from wallkit.maps.xml import parse
from wallkit.pipelines.map.verdicts import read_bytes, unified_diff

_SOUND = ("X", "S", "G")


@dataclass(frozen=True)
class FormattedFile:
    """A file before and after; equal when it is in canonical form."""

    path: Path
    before: bytes
    after: bytes

    @property
    def is_canonical(self) -> bool:
        """Whether nothing changes."""
        return self.before == self.after

    @property
    def patch(self) -> str:
        """The unified diff, with the file named from here."""
        return unified_diff(self.before, self.after, Path(os.path.relpath(self.path)).as_posix())


def format_files(files: Sequence[Path]) -> list[FormattedFile]:
    """Every file in canonical form, in memory.

    Raises:
        MapError: a file cannot be read, or is not XML; none is written then.
    """
    contents = [(path, read_bytes(path)) for path in files]
    return [FormattedFile(path, data, canonical(parse(data, str(path)))) for path, data in contents]


def compare_files(a: Path, b: Path, *, tolerance: float) -> tuple[Change, ...]:
    """What is different in b.

    Raises:
        MapError: a file cannot be read, or is not sound as URDF.
    """
    return compare_maps(*_maps(a, b), tolerance=tolerance)


@dataclass(frozen=True)
class MergedFile:
    """What a merge made.

    Attributes:
        taken: what the result has otherwise than ours. broken: errors (code and message) that neither side has by itself,
            as when one removed what the other hung something on.
    """

    data: bytes
    conflicts: tuple[Conflict, ...]
    taken: tuple[Change, ...]
    broken: tuple[str, ...]


def merge_files(base: Path, ours: Path, theirs: Path, *, favour: Literal["ours", "theirs"] = "ours") -> MergedFile:
    """Ours with what theirs changed since base, in memory.

    Raises:
        MapError: a file cannot be read or is not sound as URDF, or the files use one prefix for two namespaces.
    """
    before, mine, other = _maps(base, ours, theirs)
    sides = [Side.of(semantic_map) for semantic_map in (before, mine, other)]
    names = Names(renamed_links(sides[0], sides[1], TOLERANCE), renamed_links(sides[0], sides[2], TOLERANCE))
    merged = merge_maps(before.document, mine.document, other.document, names, favour=favour)
    report = validate(merged.data, select=_SOUND, source=str(ours))
    # both sides were loaded, so every such error is new
    broken = tuple(f"{f.code} {f.message}" for f in report.findings if f.severity == "error")
    taken = () if broken or report.map is None else compare_maps(mine, report.map)
    return MergedFile(merged.data, merged.conflicts, taken, broken)


def check_target(out: Path, *, overwrite: bool) -> None:
    """Refuse to replace a file that is not to be replaced.

    Raises:
        OutputError: it exists.
    """
    if out.exists() and not overwrite:
        raise OutputError("is already there", where=out, hint="choose another name, or pass --overwrite to replace it")


def _maps(*paths: Path) -> list[SemanticMap]:
    return [load_map(path) for path in paths]
