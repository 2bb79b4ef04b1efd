"""What an importer is asked and what it answers: options, drafts and notes; and the reading they all begin with."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from wallkit.errors import Finding, MapError, Severity
from wallkit.maps.draft.draft import WALL_HEIGHT_M, Draft

# far beyond any floor plan; a larger file is something else
LARGEST_BYTES = 200_000_000


@dataclass(frozen=True)
class ImportOptions:
    """What the user decides where a file does not say it.

    Attributes:
        units: of the file's lengths (see units.METRES); None: as the file declares.
        thickness_m: of walls the file draws without one; None: the format's own custom.
        height_m: of walls the file gives none.
        layers: names of the layers (DXF) that hold walls, `*` allowed; empty: those whose name means wall.
        tolerance_m: how far fitted lines may be from a raster's wall cells; None: one cell.
        scan_plane_m: the LiDAR's height above the floor, written to the header.
    """

    units: str | None = None
    thickness_m: float | None = None
    height_m: float = WALL_HEIGHT_M
    layers: tuple[str, ...] = ()
    tolerance_m: float | None = None
    scan_plane_m: float | None = None


@dataclass(frozen=True)
class Imported:
    """What was made of a file: a draft per level, and everything the user should know about the making.

    `data` is the map itself where nothing needs to be drawn anew; the one draft then only names it.

    Notes carry a rule's code where a rule tells of the same thing, else one of: import.read (what was found and how much),
    import.guessed (what the file does not say, with what was taken), import.skipped (what was left out, and why).
    """

    drafts: tuple[Draft, ...]
    notes: tuple[Finding, ...]
    data: bytes = b""


Importer = Callable[[Path, ImportOptions], Imported]


@dataclass
class Notes:
    """The notes of one import, collected."""

    path: Path
    found: list[Finding] = field(default_factory=list)

    def read(self, message: str, **detail: Any) -> None:
        self.add("import.read", "info", message, **detail)

    def guessed(self, message: str, *, hint: str = "", line: int | None = None, **detail: Any) -> None:
        self.add("import.guessed", "info", message, hint=hint, line=line, **detail)

    def skipped(self, message: str, *, hint: str = "", line: int | None = None, **detail: Any) -> None:
        self.add("import.skipped", "warning", message, hint=hint, line=line, **detail)

    def add(
        self, code: str, severity: Severity, message: str, *, hint: str = "", line: int | None = None, **detail: Any
    ) -> None:
        self.found.append(Finding(code, severity, str(self.path), message, line=line, hint=hint, detail=detail))


class Names:
    """Link names that are valid and unique: `sink`, `sink_2`, ... whatever the file calls its things."""

    def __init__(self) -> None:
        self._used: set[str] = {"map"}

    def take(self, wanted: str) -> str:
        """The wanted name made of letters, digits, `_`, `-` and `.`, with a number if it is taken."""
        stem = re.sub(r"[^A-Za-z0-9_.-]+", "_", wanted).strip("_.-") or "thing"
        stem = stem if stem[0].isalpha() else f"n{stem}"
        name, number = stem, 1
        while name in self._used:
            number += 1
            name = f"{stem}_{number}"
        self._used.add(name)
        return name


def read_text(path: Path, what: str) -> str:
    """The file as text.

    Raises:
        MapError: it cannot be read, is not UTF-8 or is far too large.
    """
    try:
        data = path.read_bytes() if path.stat().st_size <= LARGEST_BYTES else b"\0"
    except OSError as error:
        raise MapError(f"cannot read it: {error.strerror}", where=path, hint=f"name {what}") from error
    if b"\0" in data[:4096]:
        raise MapError("is not a text file, or larger than 200 MB", where=path, hint=f"name {what}")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise MapError(
            f"byte 0x{data[error.start]:02x} is not UTF-8", where=f"{path}:{line}", hint="save the file as UTF-8"
        ) from error


def tally(names: Iterable[str]) -> str:
    """`3 chair, 2 table, 1 bed`: how often each name occurs, most frequent first."""
    return ", ".join(f"{count} {name}" for name, count in sorted(Counter(names).items(), key=lambda n: (-n[1], n[0])))
