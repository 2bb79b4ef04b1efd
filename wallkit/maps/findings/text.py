"""Findings -> text for people: the message, its line with the place marked, where it is in the map, and what to do."""

from __future__ import annotations

import unicodedata
from collections.abc import Callable, Iterator, Sequence

from wallkit.errors import Severity
from wallkit.maps.document import Document
from wallkit.maps.findings.judged import Judged
from wallkit.maps.rules.base import MapFinding

# paint(text, as) -> the text in the colour of a severity
Paint = Callable[[str, Severity], str]

# of longer lines the part around the mark is shown
WIDTH = 110
BEFORE_MARK = 30
RELATED_SHOWN = 3


def text_from(judged: Sequence[Judged], *, paint: Paint = lambda text, _: text) -> str:
    """Every finding of every file, then the files' skipped rules, then one line of sums."""
    lines: list[str] = []
    explained: set[str] = set()
    for file in judged:
        for finding in file.report.grouped:
            lines += _finding_lines(finding, file.document, paint, is_first=finding.code not in explained)
            explained.add(finding.code)
    for file in judged:
        for reason, count in file.skipped_by_reason.items():
            lines.append(f"{printable(file.report.source)}: {counted(count, 'rule')} could not run because of {reason}")
    return "\n".join([*lines, _sums(judged)]) + "\n"


def marked_line(document: Document, line: int, column: int, end_column: int) -> tuple[str, str]:
    """A line of the file as it can be printed, and the marks to print below it; both cut to WIDTH around the marks.

    Args:
        column, end_column: of what is marked, from 1, the end exclusive; nothing at all is marked by one caret.
    """
    text = document.line(line)
    start, end = column - 1, max(end_column - 1, column)
    first = 0 if end <= WIDTH else max(start - BEFORE_MARK, 0)
    # a line may be the whole file: only what is shown is looked at
    last = first + WIDTH
    shown, before, marked = (printable(text[i:j]) for i, j in ((first, last), (first, start), (start, min(end, last))))
    marks = " " * _columns(before) + "^" * max(_columns(marked), 1)
    if first:
        shown, marks = f"…{shown}", f" {marks}"
    return shown + ("…" if last < len(text) else ""), marks


def printable(text: str) -> str:
    """The text with one visible character for each that could move a terminal's cursor or turn its writing around."""
    return "".join(c if c.isprintable() else " " if c in "\t\n\r" else "\N{REPLACEMENT CHARACTER}" for c in text)


def counted(count: int, noun: str) -> str:
    """`1 error`, `2 errors`."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


# -------------------------------------------------------------------------------------------- details


def _finding_lines(finding: MapFinding, document: Document, paint: Paint, *, is_first: bool) -> Iterator[str]:
    line, column = finding.line or 1, finding.column or 1
    place = f"{printable(finding.file)}:{line}:{column}:"
    yield f"{place} {paint(f'{finding.severity} {finding.code}', finding.severity)}: {printable(finding.message)}"
    text, marks = marked_line(document, line, column, finding.end_column)
    yield f"{line:>4} | {text}".rstrip()
    yield f"     | {paint(marks, finding.severity)}"
    if where := "   ".join(_places(finding)):
        yield f"  {where}"
    if finding.fix is not None:
        command = f"wallkit map fix --fix {finding.fix.kind}"
        yield f"  hint:  {printable(finding.hint) or command}   [fix: {finding.fix.kind}]"
    elif finding.hint:
        yield f"  hint:  {printable(finding.hint)}"
    # once is enough to know how to ask
    if is_first:
        yield f"  why:   wallkit map explain {finding.code}"


def _places(finding: MapFinding) -> Iterator[str]:
    if finding.xyz:
        coordinates = (f"{axis}={value:.2f}" for axis, value in zip("xyz", finding.xyz, strict=False))
        yield f"where: {' '.join(coordinates)} (map)"
    if finding.related:
        others = [f"{r.line}:{r.column} {printable(r.message)}" for r in finding.related[:RELATED_SHOWN]]
        more = len(finding.related) - len(others)
        yield "see also: " + ", ".join([*others, *([f"and {more} more"] if more else [])])


def _sums(judged: Sequence[Judged]) -> str:
    def total(severity: Severity) -> int:
        return sum(file.report.count(severity) for file in judged)

    counts = [counted(total(severity), severity) for severity in ("error", "warning", "info")]
    rules = len({code for file in judged for code in file.report.checked})
    files = f" in {len(judged)} files" if len(judged) > 1 else ""
    text = f"{', '.join(counts)}{files}; {counted(rules, 'rule')} checked"
    if ignored := sum(len(file.report.ignored) for file in judged):
        text += f"; {ignored} ignored in place"
    if accepted := sum(len(file.accepted) for file in judged):
        text += f"; {accepted} in the baseline"
    # what a log showed (group A) is mended by the command in its hint: `map fix` sees no log
    found = [finding for file in judged for finding in file.report.findings if not finding.code.startswith("WK-A")]
    fixes = [finding.fix.kind for finding in found if finding.fix is not None]
    said = ", ".join(f"{fixes.count(kind)} {kind}" for kind in ("safe", "moderate", "risky") if kind in fixes)
    return f"{text}; with a fix: {said} (wallkit map fix)" if said else text


def _columns(text: str) -> int:
    """Columns of a terminal: wide characters take two, accents that join the one before none."""
    return sum(0 if unicodedata.combining(c) else 2 if unicodedata.east_asian_width(c) in "WF" else 1 for c in text)
