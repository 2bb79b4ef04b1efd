"""What the rules say of map files -> text, JSON, SARIF, JUnit or GitHub annotations."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any
from xml.etree import ElementTree

from wallkit.errors import Severity
from wallkit.maps.document import Document
from wallkit.maps.findings.judged import Judged
from wallkit.maps.findings.sarif import sarif_from, text_of_edit
from wallkit.maps.findings.text import printable, text_from
from wallkit.maps.rules.base import MapFinding

Table = dict[str, Any]
_ANNOTATIONS: dict[Severity, str] = {"error": "error", "warning": "warning", "info": "notice"}


def json_from(judged: Sequence[Judged]) -> Table:
    """One document: what was checked in every file, and every finding.

    Columns count characters and offsets bytes; xyz is in metres in the map. A rule that could not
    run stands under `skipped` with what kept it.
    """
    return {
        "files": [
            {
                "file": file.report.source,
                "good": file.is_good,
                "errors": file.report.count("error"),
                "warnings": file.report.count("warning"),
                "infos": file.report.count("info"),
                "ignored": len(file.report.ignored),
                "baseline": len(file.accepted),
                "checked": file.report.checked,
                "skipped": [{"rule": skip.code, "reason": skip.reason} for skip in file.report.skipped],
            }
            for file in judged
        ],
        "findings": [_json_finding(finding, file.document) for file in judged for finding in file.report.findings],
    }


def junit_from(judged: Sequence[Judged]) -> str:
    """A test suite for every file and a test case for every rule; findings that do not fail are its output."""
    suites = ElementTree.Element("testsuites", name="wallkit map validate")
    for file in judged:
        by_code: dict[str, list[MapFinding]] = {code: [] for code in file.report.checked}
        for finding in file.report.findings:
            by_code.setdefault(finding.code, []).append(finding)
        failing = sum(any(map(file.fails, findings)) for findings in by_code.values())
        suite = ElementTree.SubElement(
            suites,
            "testsuite",
            name=printable(file.report.source),
            tests=str(len(by_code) + len(file.report.skipped)),
            failures=str(failing),
            errors="0",
            skipped=str(len(file.report.skipped)),
        )
        for code, findings in sorted(by_code.items()):
            _junit_case(ElementTree.SubElement(suite, "testcase", _case_names(file, code)), file, findings)
        for skip in file.report.skipped:
            case = ElementTree.SubElement(suite, "testcase", _case_names(file, skip.code))
            ElementTree.SubElement(case, "skipped", message=f"because of {skip.reason}")
    ElementTree.indent(suites)
    return ElementTree.tostring(suites, encoding="unicode", xml_declaration=True) + "\n"


def github_from(judged: Sequence[Judged]) -> str:
    """GitHub's workflow commands, one line per finding, shown beside the changed lines of a pull request."""
    lines = []
    for file in judged:
        for finding in file.report.grouped:
            place = f"file={_property(finding.file)},line={finding.line},col={finding.column}"
            place += f",endLine={finding.line},endColumn={finding.end_column},title={finding.code}"
            text = f"{finding.message}\nhint: {finding.hint}" if finding.hint else finding.message
            lines.append(f"::{_ANNOTATIONS[finding.severity]} {place}::{_data(text)}\n")
        for reason, count in file.skipped_by_reason.items():
            text = f"{count} rules could not run because of {reason}"
            lines.append(f"::warning file={_property(file.report.source)},title=rules skipped::{_data(text)}\n")
    return "".join(lines)


# -------------------------------------------------------------------------------------------- details


def _json_finding(finding: MapFinding, document: Document) -> Table:
    fix = finding.fix
    edits = [
        {"offset": edit.offset, "length": edit.length, "text": text_of_edit(edit, document)}
        for edit in (fix.edits if fix else ())
    ]
    return {
        "rule": finding.code,
        "severity": finding.severity,
        "message": finding.message,
        "hint": finding.hint,
        "file": finding.file,
        "line": finding.line,
        "column": finding.column,
        "endColumn": finding.end_column,
        "byteOffset": finding.offset,
        "byteLength": finding.length,
        "xpath": finding.xpath,
        "xyz": finding.xyz or None,
        "related": [
            {"message": r.message, "line": r.line, "column": r.column, "byteOffset": r.offset, "xpath": r.xpath}
            for r in finding.related
        ],
        "fix": {"class": fix.kind, "edits": edits} if fix else None,
        "fingerprint": finding.fingerprint,
        "detail": finding.detail,
    }


def _case_names(file: Judged, code: str) -> dict[str, str]:
    return {"classname": printable(file.report.source), "name": code}


def _junit_case(case: ElementTree.Element, file: Judged, findings: list[MapFinding]) -> None:
    failing = [finding for finding in findings if file.fails(finding)]
    if failing:
        failure = ElementTree.SubElement(
            case, "failure", type=failing[0].severity, message=printable(failing[0].message)
        )
        failure.text = "\n".join(_one_line_each(failing))
    if told := [finding for finding in findings if not file.fails(finding)]:
        ElementTree.SubElement(case, "system-out").text = "\n".join(_one_line_each(told))


def _one_line_each(findings: Sequence[MapFinding]) -> Iterator[str]:
    for finding in findings:
        hint = f" (hint: {finding.hint})" if finding.hint else ""
        yield printable(f"{finding.file}:{finding.line}:{finding.column}: {finding.message}{hint}")


def _data(text: str) -> str:
    """Text as GitHub's workflow commands want it (actions/toolkit, packages/core/src/command.ts)."""
    return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _property(text: str) -> str:
    return _data(text).replace(":", "%3A").replace(",", "%2C")


TEXTS: dict[str, Callable[[Sequence[Judged]], str]] = {"text": text_from, "junit": junit_from, "github": github_from}

# tables that become one JSON document each
DOCUMENTS: dict[str, Callable[[Sequence[Judged]], Table]] = {"json": json_from, "sarif": sarif_from}
