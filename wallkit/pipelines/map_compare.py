"""Map files -> the same files in canonical form, what is different between two, and three merged into one."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from wallkit.maps.canonical import canonical
from wallkit.maps.changes import Change
from wallkit.maps.compare import compare_maps
from wallkit.maps.model import SemanticMap
from wallkit.maps.read import load_map
from wallkit.maps.xml import parse
from wallkit.pipelines.map import read_bytes, unified_diff


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


def _maps(*paths: Path) -> list[SemanticMap]:
    return [load_map(path) for path in paths]
