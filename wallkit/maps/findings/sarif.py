"""Findings -> SARIF 2.1.0 (OASIS 2020): what editors and code hosts show beside the line, repairs included."""

from __future__ import annotations

import itertools
import urllib.parse
from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import wallkit
from wallkit.errors import Severity
from wallkit.maps.document import Document, Edit
from wallkit.maps.findings.judged import Judged
from wallkit.maps.rules import RULES
from wallkit.maps.rules.base import MapFinding
from wallkit.maps.rules.docs import doc_of, text_from_doc

SCHEMA = "https://docs.oasis-open.org/sarif/sarif/v2.1.0/errata01/os/schemas/sarif-schema-2.1.0.json"
LEVELS: dict[Severity, str] = {"error": "error", "warning": "warning", "info": "note"}
Table = dict[str, Any]


def sarif_from(judged: Sequence[Judged]) -> Table:
    """The SARIF log: one run over all files. Findings ignored in the file or by a baseline are in it as suppressed."""
    said = [finding for file in judged for finding in (*file.report.findings, *file.report.ignored, *file.accepted)]
    codes = sorted({code for file in judged for code in file.report.checked} | {finding.code for finding in said})
    places = [_Places(file.document) for file in judged]
    run = {
        "tool": {
            "driver": {"name": "wallkit", "semanticVersion": wallkit.__version__, "rules": [*map(_rule, codes)]},
        },
        "columnKind": "unicodeCodePoints",
        "invocations": [
            {
                "executionSuccessful": True,
                "toolExecutionNotifications": [note for file in judged for note in _notes(file)],
            }
        ],
        "results": [
            {**_result(finding, place, codes.index(finding.code)), "suppressions": suppressions}
            for file, place in zip(judged, places, strict=True)
            for finding, suppressions in _with_suppressions(file)
        ],
    }
    return {"$schema": SCHEMA, "version": "2.1.0", "runs": [run]}


def text_of_edit(edit: Edit, document: Document) -> str:
    """What an edit puts in, as text: UTF-8, else in the file's own encoding."""
    try:
        return edit.text.decode()
    except UnicodeDecodeError:
        return edit.text.decode(document.encoding)


# -------------------------------------------------------------------------------------------- details


class _Places:
    """Bytes of a file as SARIF's regions: lines and columns, and characters from the start."""

    def __init__(self, document: Document) -> None:
        self.document = document
        path = Path(document.source)
        uri = path.as_uri() if path.is_absolute() else urllib.parse.quote(path.as_posix())
        self.file: Table = {"uri": uri}

    @cached_property
    def _characters_before_line(self) -> list[int]:
        data, starts = self.document.data, self.document.line_starts
        counts = [0]
        for start, end in itertools.pairwise(starts):
            counts.append(counts[-1] + len(data[start:end].decode(self.document.encoding, "replace")))
        return counts

    def region(self, offset: int, length: int) -> Table:
        """The region of a byte range."""
        (line, column), (end_line, end_column) = (self.document.place(at) for at in (offset, offset + length))
        before = self._characters_before_line
        first = before[line - 1] + column - 1
        return {
            "startLine": line,
            "startColumn": column,
            "endLine": end_line,
            "endColumn": end_column,
            "charOffset": first,
            "charLength": before[end_line - 1] + end_column - 1 - first,
        }

    def location(self, offset: int, length: int, xpath: str) -> Table:
        """A place in the file and, where it is an element's, in the tree."""
        found: Table = {"physicalLocation": {"artifactLocation": self.file, "region": self.region(offset, length)}}
        if xpath:
            found["logicalLocations"] = [{"fullyQualifiedName": xpath, "kind": "element"}]
        return found


def _rule(code: str) -> Table:
    rule = RULES[code]
    doc = doc_of(rule)
    return {
        "id": code,
        "shortDescription": {"text": doc.title},
        "fullDescription": {"text": doc.why or doc.title},
        "help": {"text": text_from_doc(rule)},
        "defaultConfiguration": {"level": LEVELS[rule.severity]},
    }


def _with_suppressions(file: Judged) -> Iterator[tuple[MapFinding, list[Table]]]:
    for finding in file.report.findings:
        yield finding, []
    for finding in file.report.ignored:
        yield finding, [{"kind": "inSource"}]
    for finding in file.accepted:
        yield finding, [{"kind": "external", "justification": "listed in the baseline"}]


def _result(finding: MapFinding, places: _Places, rule_index: int) -> Table:
    text = f"{finding.message}\nhint: {finding.hint}" if finding.hint else finding.message
    found: Table = {
        "ruleId": finding.code,
        "ruleIndex": rule_index,
        "level": LEVELS[finding.severity],
        "message": {"text": text},
        "locations": [places.location(finding.offset, finding.length, finding.xpath)],
        "partialFingerprints": {"wallkit/v1": finding.fingerprint},
    }
    if finding.related:
        found["relatedLocations"] = [
            {"id": number, "message": {"text": r.message}, **places.location(r.offset, r.length, r.xpath)}
            for number, r in enumerate(finding.related)
        ]
    if finding.fix is not None:
        found["fixes"] = [_fix(finding.fix.kind, finding.hint, finding.fix.edits, places)]
    if finding.xyz or finding.detail:
        found["properties"] = {"xyz": finding.xyz, **finding.detail}
    return found


def _fix(kind: str, hint: str, edits: Iterable[Edit], places: _Places) -> Table:
    replacements = [
        {
            "deletedRegion": places.region(edit.offset, edit.length),
            "insertedContent": {"text": text_of_edit(edit, places.document)},
        }
        for edit in sorted(edits)
    ]
    return {
        "description": {"text": f"{kind}: {hint}" if hint else kind},
        "artifactChanges": [{"artifactLocation": places.file, "replacements": replacements}],
    }


def _notes(file: Judged) -> Iterator[Table]:
    """Rules that could not run: nothing is known about what they would have said."""
    for skip in file.report.skipped:
        yield {
            "level": "warning",
            "message": {"text": f"{file.report.source}: {skip.code} could not run because of {skip.reason}"},
            "associatedRule": {"id": skip.code},
        }
