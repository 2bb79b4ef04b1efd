"""A map file and the steps of a verb -> the file as it would be, what changed in words, and the findings that are new."""

from __future__ import annotations

import os
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from wallkit.errors import MapError, OutputError
from wallkit.maps.document import apply_edits
from wallkit.maps.draft.write import write_draft
from wallkit.maps.edit.changes import Step, appended
from wallkit.maps.edit.templates import TemplateSizes, new_draft
from wallkit.maps.rules import RULES, validate
from wallkit.maps.rules.base import Context, MapFinding
from wallkit.maps.rules.tolerances import Tolerances
from wallkit.maps.xml import parse
from wallkit.pipelines.map.verdicts import SUFFIX, read_bytes, unified_diff
from wallkit.pipelines.outputs import write_whole

# what is wrong with a room because it is empty: ambiguous poses, one direction only
_OF_EMPTY_ROOMS = ("WK-L003", "WK-L004")
# the groups that an edit can upset at once; localizability is for `validate`
_JUDGED = ("X", "S", "G", "E", "O", "T", "C", "P")


@dataclass(frozen=True)
class EditedFile:
    """A map before and after an edit, not yet written.

    Attributes:
        said: a line for every change, with the numbers before and after.
        caused: errors and warnings that are there now and were not before; their places are those of the file as it is now.
    """

    path: Path
    before: bytes
    after: bytes
    said: tuple[str, ...]
    caused: tuple[MapFinding, ...]

    @property
    def patch(self) -> str:
        """The unified diff, with the file named from here, so that `git apply` finds it."""
        name = Path(os.path.relpath(self.path)).as_posix()
        patch = unified_diff(self.before, self.after, name)
        return patch if self.before else patch.replace(f"--- a/{name}", "--- /dev/null", 1)

    def write(self) -> None:
        """Replace the file in one step, where anything changed.

        Raises:
            OutputError: it cannot be written.
        """
        if self.after != self.before:
            write_whole(self.path, self.after)


def edit_file(path: Path, *steps: Step, tolerances: Tolerances | None = None) -> EditedFile:
    """The file with every step made, each on what the one before left.

    Raises:
        MapError: the file cannot be read or parsed, or a step refuses.
    """
    before = data = read_bytes(path)
    limits = tolerances or Tolerances()
    said: list[str] = []
    context = _context(path, data, limits)
    for step in steps:
        changes = step(context)
        said += changes.said
        data = apply_edits(data, changes.edits)
        context = _context(path, data, limits) if changes.edits else context
    return EditedFile(path, before, data, tuple(said), _caused(path, before, data, limits))


def links_of(path: Path) -> frozenset[str]:
    """The names of a file's links.

    Raises:
        MapError: the file cannot be read or parsed.
    """
    return frozenset(_context(path, read_bytes(path), Tolerances()).map.links)


def new_file(path: Path, template: str, sizes: TemplateSizes, *, name: str = "", overwrite: bool = False) -> EditedFile:
    """A template as a file to be written; `name` is by default the file's.

    Raises:
        OutputError: there is a file already. MapError: the template cannot have these sizes.
    """
    if path.exists() and not overwrite:
        raise OutputError("exists", where=path, hint="choose another name, or pass --overwrite to replace it")
    draft = new_draft(template, name or path.name.removesuffix(SUFFIX).removesuffix(".urdf"), sizes)
    rooms = ", ".join(f"{room.id}" for room in draft.rooms)
    counts = f"{len(draft.walls)} walls, {len(draft.fixtures)} fixtures, rooms {rooms}"
    said = f"{template} of {sizes.length_m:g} x {sizes.width_m:g} m: {counts}"
    data, ignored = _said_empty(path, write_draft(draft))
    return EditedFile(path, b"", data, (said, *ignored), ())


# ------------------------------------------------------------------------------------------------- details


def _said_empty(path: Path, data: bytes) -> tuple[bytes, tuple[str, ...]]:
    """A new map, with the rules of localizability that it breaks ignored in its header, and a word on that.

    An empty rectangle looks the same from both ends, and nothing is wrong with it: what will stand in it is still missing.
    Once that does, WK-S016 says that the ignore is no longer used.
    """
    codes = [code for code in _OF_EMPTY_ROOMS if code in RULES]
    findings = validate(data, select=codes, source=str(path)).findings if codes else ()
    found = sorted({finding.code for finding in findings if finding.severity != "info"})
    header = _context(path, data, Tolerances()).map.header.element
    if not found or header is None:
        return data, ()
    reason = "as yet nothing stands in it that tells one end from the other"
    line = f'    <wk:ignore rule="{" ".join(found)}" reason="{reason}"/>'
    said = f"{' and '.join(found)} ignored for now: {reason}"
    return apply_edits(data, appended(header, [line])), (said,)


def _context(path: Path, data: bytes, tolerances: Tolerances) -> Context:
    document = parse(data, str(path))
    if document.root is None:
        fault = document.faults[0]
        raise MapError(
            f"cannot be parsed: {fault.message}",
            where=f"{path}:{fault.span.line}:{fault.span.column}",
            hint=f"wallkit map validate {path}",
        )
    return Context(document, tolerances)


def _caused(path: Path, before: bytes, after: bytes, tolerances: Tolerances) -> tuple[MapFinding, ...]:
    """Errors and warnings of the file after that are not among those before, wherever they stand."""
    if before == after:
        return ()
    new = _grave(path, after, tolerances)
    # where nothing is wrong nothing can be new: half the time saved on a clean map
    old = _grave(path, before, tolerances) if new else []
    known = Counter((finding.code, finding.message) for finding in old)
    prints = {finding.fingerprint for finding in old}
    caused = []
    for finding in new:
        key = (finding.code, finding.message)
        if known[key] > 0:
            known[key] -= 1
        elif finding.fingerprint not in prints:
            caused.append(finding)
    return tuple(caused)


def _grave(path: Path, data: bytes, tolerances: Tolerances) -> list[MapFinding]:
    """Errors and warnings."""
    findings = validate(data, tolerances, select=_JUDGED, source=str(path)).findings
    return [finding for finding in findings if finding.severity != "info"]
