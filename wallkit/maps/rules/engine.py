"""Rules and a context -> a report: groups in order, what failed, what was skipped for it, what the file asked to ignore."""

from __future__ import annotations

import datetime
import hashlib
from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from wallkit.errors import ConfigError, Severity, closest
from wallkit.maps.document import Attribute, Document, Element, Span, wk
from wallkit.maps.rules.base import PREREQUISITES, Context, Fix, MapFinding, Problem, Related, Rule, Where

if TYPE_CHECKING:
    from wallkit.maps.model import SemanticMap

GROUPED_FROM = 20


@dataclass(frozen=True, slots=True)
class Skipped:
    """A rule that did not run, and why: nothing is known about what it would have said."""

    code: str
    reason: str


@dataclass(frozen=True)
class Report:
    """Everything the rules say about one file.

    Attributes:
        findings: sorted by line, column and code. ignored: those that an inline <wk:ignore> takes out.
        skipped: selected rules that could not run. checked: codes of the rules that ran.
        document: the file. map: the map as nouns; None when the file is not even XML.
    """

    document: Document
    findings: tuple[MapFinding, ...]
    ignored: tuple[MapFinding, ...]
    skipped: tuple[Skipped, ...]
    checked: tuple[str, ...]
    map: SemanticMap | None

    @property
    def source(self) -> str:
        """The file's name, for messages."""
        return self.document.source

    def count(self, severity: Severity) -> int:
        """How many findings are that severe."""
        return sum(finding.severity == severity for finding in self.findings)

    @property
    def is_clean(self) -> bool:
        """No errors; and without an error no group is skipped."""
        return self.count("error") == 0

    @property
    def grouped(self) -> tuple[MapFinding, ...]:
        """The findings, but where a rule has more than 20 only its first, which says how many more there are."""
        by_code = Counter(finding.code for finding in self.findings)
        shown, seen = [], set()
        for finding in self.findings:
            count = by_code[finding.code]
            if count <= GROUPED_FROM:
                shown.append(finding)
            elif finding.code not in seen:
                message = f"{finding.message} (and {count - 1} more of {finding.code})"
                shown.append(replace(finding, message=message, count=count))
            seen.add(finding.code)
        return tuple(shown)


@dataclass(frozen=True, slots=True)
class _Ignore:
    element: Element
    selector: str
    scope: Span


def run(
    context: Context,
    rules: Sequence[Rule],
    selected: Collection[str],
    *,
    today: datetime.date | None = None,
) -> Report:
    """Runs the rules group by group; rules that are not selected run only where others depend on their group.

    Rules that need a log are left out without one.

    Args:
        selected: codes whose findings are reported.
        today: inline ignores that ended before it no longer count; without it they never end.
    """
    needed = {group for code in selected for group in (code[3], *PREREQUISITES[code[3]])}
    found: dict[str, list[MapFinding]] = {}
    skipped: list[Skipped] = []
    blocked: dict[str, MapFinding] = {}
    for group in PREREQUISITES:
        reason = next((blocked[before] for before in PREREQUISITES[group] if before in blocked), None)
        for rule in rules:
            if rule.group != group or rule.is_last or group not in needed:
                continue
            if rule.needs_log and context.evidence is None:
                continue
            # nobody wants to know, and nothing waits for it
            if rule.code not in selected and not rule.blocks:
                continue
            if reason is not None:
                skipped.append(Skipped(rule.code, f"{reason.code} at {reason.line}:{reason.column}"))
                continue
            found[rule.code] = _findings(rule, context)
            errors = [finding for finding in found[rule.code] if finding.severity == "error"]
            if errors and rule.blocks:
                blocked.setdefault(group, errors[0])
    reported = [finding for code, findings in found.items() if code in selected for finding in findings]
    kept, ignored, unused = _apply_ignores(reported, _ignores(context.document, today), found)
    context.unused_ignores[:] = unused
    for rule in rules:
        if rule.is_last and rule.code in selected and "X" not in blocked:
            found[rule.code] = _findings(rule, context)
            kept += found[rule.code]
    return Report(
        document=context.document,
        findings=tuple(sorted(kept, key=_order)),
        ignored=tuple(sorted(ignored, key=_order)),
        skipped=tuple(skip for skip in skipped if skip.code in selected),
        checked=tuple(sorted(code for code in found if code in selected)),
        map=context.map if context.document.root is not None else None,
    )


def codes_matching(selectors: Iterable[str], codes: Collection[str]) -> set[str]:
    """The codes meant by "WK-E010", "E010", "WK-E" or "E"; prefixes count.

    Raises:
        ConfigError: a selector that no code begins with.
    """
    found: set[str] = set()
    for selector in selectors:
        matching = {code for code in codes if _matches(selector, code)}
        if not matching:
            raise ConfigError(f"no map rule begins with '{selector}'", hint=closest(selector, codes))
        found |= matching
    return found


# -------------------------------------------------------------------------------------------- details


def _matches(selector: str, code: str) -> bool:
    full = selector.upper() if selector.upper().startswith("WK-") else f"WK-{selector.upper()}"
    return len(full) > len("WK-") and code.startswith(full)


def _findings(rule: Rule, context: Context) -> list[MapFinding]:
    repeats: Counter[str] = Counter()
    found = []
    for problem in rule.check(context):
        finding = _finding(rule, problem, context.document)
        # the same rule may speak of one element twice; the number tells them apart
        repeats[finding.xpath] += 1
        key = f"{rule.code}|{finding.xpath}|{repeats[finding.xpath]}"
        found.append(replace(finding, fingerprint=hashlib.sha256(key.encode()).hexdigest()[:16]))
    return found


def _finding(rule: Rule, problem: Problem, document: Document) -> MapFinding:
    span, element = _spot(problem.at)
    end_line, end_column = document.place(span.end)
    if end_line != span.line:
        end_column = span.column + len(document.line(span.line)[span.column - 1 :])
    fix_class = problem.fix or rule.fix
    return MapFinding(
        code=rule.code,
        severity=problem.severity or rule.severity,
        file=document.source,
        message=problem.message,
        line=span.line,
        column=span.column,
        hint=problem.hint,
        detail=dict(problem.detail),
        end_column=end_column,
        offset=span.offset,
        length=span.end - span.offset,
        xpath=element.xpath if element else "",
        xyz=tuple(float(value) for value in problem.xyz),
        related=tuple(_related(message, where) for message, where in problem.related),
        fix=Fix(fix_class, problem.edits) if problem.edits and fix_class else None,
    )


def _related(message: str, where: Where) -> Related:
    span, element = _spot(where)
    return Related(
        message, span.line, span.column, span.offset, span.end - span.offset, element.xpath if element else ""
    )


def _spot(where: Where) -> tuple[Span, Element | None]:
    """The bytes to mark, and the element they belong to."""
    if isinstance(where, Element):
        return where.start_span, where
    if isinstance(where, Attribute):
        return where.value_span if where.value_span.end > where.value_span.offset else where.span, where.element
    return where, None


def _ignores(document: Document, today: datetime.date | None) -> list[_Ignore]:
    """Every rule named by an inline ignore that gives a reason and has not ended."""
    if document.root is None:
        return []
    found = []
    for element in document.root.iter():
        if element.tag != wk("ignore") or element.parent is None or not (element.get("reason") or "").strip():
            continue
        if today is not None and (until := date_from_text(element.get("until") or "")) and until < today:
            continue
        found += [_Ignore(element, word, element.parent.span) for word in (element.get("rule") or "").split()]
    return found


def date_from_text(text: str) -> datetime.date | None:
    """A date written as 2026-12-31, or None."""
    try:
        return datetime.date.fromisoformat(text)
    except ValueError:
        return None


def _apply_ignores(
    findings: list[MapFinding], ignores: list[_Ignore], ran: Collection[str]
) -> tuple[list[MapFinding], list[MapFinding], list[tuple[Element, str]]]:
    """Findings that stay, findings that an ignore of an element around them takes out, and ignores that matched nothing."""
    kept: list[MapFinding] = []
    ignored: list[MapFinding] = []
    used: defaultdict[int, bool] = defaultdict(bool)
    for finding in findings:
        hits = [
            number
            for number, ignore in enumerate(ignores)
            if _matches(ignore.selector, finding.code) and ignore.scope.offset <= finding.offset < ignore.scope.end
        ]
        used.update(dict.fromkeys(hits, True))
        (ignored if hits else kept).append(finding)
    # whether an ignore of a rule that did not run would have matched, nobody knows
    unused = [
        (ignore.element, ignore.selector)
        for number, ignore in enumerate(ignores)
        if not used[number] and any(_matches(ignore.selector, code) for code in ran)
    ]
    return kept, ignored, unused


def _order(finding: MapFinding) -> tuple[int, int, str, str]:
    return finding.line or 0, finding.column or 0, finding.code, finding.message
