"""Map files named or found -> judged files, with a baseline taken out; and the same files repaired."""

from __future__ import annotations

import datetime
import difflib
import json
import os
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from wallkit.errors import MapError
from wallkit.maps.findings.judged import Judged
from wallkit.maps.findings.repair import repair
from wallkit.maps.labels import Labels
from wallkit.maps.rules import PROFILES, validate
from wallkit.maps.rules.base import FixClass, MapFinding
from wallkit.maps.rules.tolerances import Tolerances
from wallkit.pipelines.outputs import write_whole as write_whole

SUFFIX = ".wkmap.urdf"


@dataclass(frozen=True)
class Selection:
    """Which rules, how strictly, on which day (for ignores that end).

    Attributes:
        select, ignore: codes, prefixes of codes, or for `select` names of profiles.
        labels: of the segmentation model, by id; None when none are given.
    """

    tolerances: Tolerances
    today: datetime.date
    select: Sequence[str] = ()
    ignore: Sequence[str] = ()
    labels: Labels | None = None

    @property
    def codes(self) -> list[str]:
        """What is selected, profiles spelt out."""
        return [code for word in self.select for code in PROFILES.get(word.lower(), (word,))]


def map_files(named: Sequence[Path], configured: str, folder: Path = Path()) -> list[Path]:
    """The maps meant: those named, else the one of the settings, else every *.wkmap.urdf of the folder.

    Raises:
        MapError: there is none.
    """
    if named:
        return list(named)
    if configured:
        return [Path(configured)]
    found = sorted(folder.glob(f"*{SUFFIX}"))
    if not found:
        raise MapError(f"no file is named, and none here ends in {SUFFIX}", hint="wallkit map validate FILE")
    return found


def judge(files: Sequence[Path], selection: Selection, *, is_strict: bool = False) -> list[Judged]:
    """What the rules say of every file.

    Raises:
        MapError: a file cannot be read; none is judged then. ConfigError: a selector that no rule begins with.
    """
    contents = [(path, read_bytes(path)) for path in files]
    return [_judged(path, data, selection, is_strict=is_strict) for path, data in contents]


def read_bytes(path: Path) -> bytes:
    """A map file's bytes.

    Raises:
        MapError: it cannot be read.
    """
    try:
        return path.read_bytes()
    except OSError as error:
        raise MapError(f"cannot read the map: {error.strerror}", where=path, hint=f"name a {SUFFIX} file") from error


# ---------------------------------------------------------------------------------------------- baselines


def read_baseline(path: Path) -> dict[str, set[str]]:
    """The fingerprints of accepted findings, by map file (absolute).

    Raises:
        MapError: it cannot be read, or is no baseline.
    """
    hint = "write it anew: --baseline FILE --write-baseline"
    try:
        table = json.loads(path.read_text(encoding="utf-8"))
        found: defaultdict[str, set[str]] = defaultdict(set)
        for row in table["findings"]:
            found[os.path.abspath(path.parent / row["file"])].add(row["fingerprint"])
    except OSError as error:
        raise MapError(f"cannot read the baseline: {error.strerror}", where=path, hint=hint) from error
    except (ValueError, KeyError, TypeError) as error:
        raise MapError(f"is no baseline: {error}", where=path, hint=hint) from error
    return dict(found)


def accept(judged: Sequence[Judged], baseline: dict[str, set[str]]) -> tuple[list[Judged], int]:
    """The files without the findings of a baseline, and how many of its findings no longer occur in these files."""
    listed = [baseline.get(os.path.abspath(file.report.source), set()) for file in judged]
    left = [file.accepting(prints) for file, prints in zip(judged, listed, strict=True)]
    gone = sum(len(prints) - len(file.accepted) for file, prints in zip(left, listed, strict=True))
    return left, gone


def write_baseline(path: Path, judged: Sequence[Judged]) -> int:
    """Write down every finding as accepted, with files named from the baseline's folder; how many there are.

    Raises:
        OutputError: it cannot be written.
    """
    rows = [
        {
            "file": Path(os.path.relpath(finding.file, path.parent)).as_posix(),
            "rule": finding.code,
            "fingerprint": finding.fingerprint,
            "message": finding.message,
        }
        for file in judged
        for finding in file.report.findings
    ]
    write_whole(path, (json.dumps({"schema": 1, "findings": rows}, indent=2) + "\n").encode())
    return len(rows)


# ------------------------------------------------------------------------------------------------ repairs


@dataclass(frozen=True)
class RepairedFile:
    """A file before and after its repairs; `judged` is what is left."""

    path: Path
    before: bytes
    after: bytes
    fixed: tuple[MapFinding, ...]
    judged: Judged

    @property
    def patch(self) -> str:
        """The unified diff, with the file named from here, so that `git apply` finds it."""
        return unified_diff(self.before, self.after, Path(os.path.relpath(self.path)).as_posix())


def repair_files(files: Sequence[Path], selection: Selection, kind: FixClass) -> list[RepairedFile]:
    """Every file repaired, in memory; rules that were not selected only judge what came out.

    Raises:
        MapError: a file cannot be read. ConfigError: a selector that no rule begins with.
    """
    contents = [(path, read_bytes(path)) for path in files]
    everything = Selection(selection.tolerances, selection.today)
    found = []
    for path, data in contents:
        done = repair(
            data,
            kind,
            selection.tolerances,
            select=selection.codes,
            ignore=selection.ignore,
            source=str(path),
            today=selection.today,
        )
        left = _judged(path, done.data, everything)
        found.append(RepairedFile(path, data, done.data, done.fixed, left))
    return found


def unified_diff(before: bytes, after: bytes, name: str) -> str:
    """A patch as `git apply` reads it; bytes that are not UTF-8 cannot be shown and become U+FFFD."""
    old, new = (data.decode("utf-8", "replace").split("\n") for data in (before, after))
    old, new = ([f"{line}\n" for line in lines[:-1]] + lines[-1:] * bool(lines[-1]) for lines in (old, new))
    lines = difflib.unified_diff(old, new, f"a/{name}", f"b/{name}")
    return "".join(line if line.endswith("\n") else f"{line}\n\\ No newline at end of file\n" for line in lines)


# ------------------------------------------------------------------------------------------------ details


def _judged(path: Path, data: bytes, selection: Selection, *, is_strict: bool = False) -> Judged:
    report = validate(
        data,
        selection.tolerances,
        select=selection.codes,
        ignore=selection.ignore,
        source=str(path),
        labels=selection.labels,
        today=selection.today,
    )
    return Judged(report.document, report, is_strict=is_strict)
