"""A map's bytes -> its bytes with the rules' repairs made, until none is left: doing it twice changes nothing."""

from __future__ import annotations

import bisect
import datetime
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass

from wallkit.maps import rules
from wallkit.maps.document import Edit, apply_edits
from wallkit.maps.rules.base import PREREQUISITES, FixClass, MapFinding
from wallkit.maps.rules.engine import Report
from wallkit.maps.rules.tolerances import Tolerances

# the milder classes that come with each; what is risky is shown to the user, and made by hand
CLASSES: dict[FixClass, tuple[FixClass, ...]] = {
    "safe": ("safe",),
    "moderate": ("safe", "moderate"),
    "risky": ("safe", "moderate", "risky"),
}
# repairs uncover others (an error hides whole groups of rules); no sound set of rules needs as many rounds
MAX_ROUNDS = 100


@dataclass(frozen=True)
class Repaired:
    """A map after its repairs.

    Attributes:
        fixed: the findings whose repair was made, in that order; their lines are those of the file as it was then.
    """

    data: bytes
    fixed: tuple[MapFinding, ...]


def repair(
    data: bytes,
    kind: FixClass = "safe",
    tolerances: Tolerances | None = None,
    *,
    select: Sequence[str] = (),
    ignore: Sequence[str] = (),
    source: str = "map",
    today: datetime.date | None = None,
) -> Repaired:
    """Makes every repair up to a class that takes its finding away; what is ignored in the file stays as it is.

    Args:
        select, ignore: the rules whose repairs are made. Others as for `validate`.

    Raises:
        ConfigError: no rule begins with a selector.
    """
    codes = rules.selected_codes(select, ignore, with_log=False)
    # rules that repair nothing are not asked: some take seconds
    codes = {code for code in codes if rules.RULES[code].fix in CLASSES[kind]}
    if not codes:
        return Repaired(data, ())

    def judged(data: bytes) -> Report:
        return rules.validate(data, tolerances, select=sorted(codes), source=source, today=today)

    report = judged(data)
    fixed: list[MapFinding] = []
    hopeless: set[str] = set()
    # every state of the file, and how many repairs led to it
    seen: dict[bytes, int] = {data: 0}
    for _ in range(MAX_ROUNDS):
        chosen = _together(_next_in_turn(report.findings, CLASSES[kind], hopeless))
        if not chosen:
            return Repaired(data, tuple(fixed))
        repaired = apply_edits(data, [edit for finding in chosen for edit in _edits(finding)])
        after = judged(repaired)
        if not _helped(chosen, report, after):
            hopeless |= {finding.code for finding in chosen}
            continue
        if repaired in seen:
            # repairs that undo each other lead round in a circle; wherever one enters it, one end is chosen
            settled = min(list(seen)[list(seen).index(repaired) :])
            return Repaired(settled, tuple(fixed[: seen[settled]]))
        data, report = repaired, after
        fixed += chosen
        seen[data] = len(fixed)
        # what did not help before may do so now
        hopeless.clear()
    raise RuntimeError(f"repairs of {source} do not settle: the last was of {fixed[-1].code}")


# -------------------------------------------------------------------------------------------- details


def _helped(chosen: Sequence[MapFinding], before: Report, after: Report) -> bool:
    """Whether one of the findings went away, or there are fewer of their rules."""
    codes = {finding.code for finding in chosen}
    counts = [sum(finding.code in codes for finding in report.findings) for report in (before, after)]
    left = {finding.fingerprint for finding in after.findings}
    return counts[1] < counts[0] or any(finding.fingerprint not in left for finding in chosen)


def _next_in_turn(
    findings: Sequence[MapFinding], kinds: Sequence[FixClass], hopeless: Collection[str]
) -> list[MapFinding]:
    """The findings to repair now: every safe repair, and when none is left those of one rule, in the order the groups run.

    A repair that moves something was worked out for the map as it stands: a wall is only extended to its corner once the
    angles around are exact.
    """
    for kind in kinds:
        found = [f for f in findings if f.fix and f.fix.kind == kind and f.code not in hopeless]
        if found and kind == "safe":
            return found
        if found:
            first = min(found, key=lambda finding: (list(PREREQUISITES).index(finding.code[3]), finding.code))
            return [finding for finding in found if finding.code == first.code]
    return []


def _edits(finding: MapFinding) -> tuple[Edit, ...]:
    return finding.fix.edits if finding.fix else ()


def _together(findings: Iterable[MapFinding]) -> list[MapFinding]:
    """The findings whose repairs do not touch each other; of those that do, the first. The rest waits for the next round."""
    chosen: list[MapFinding] = []
    taken: set[Edit] = set()
    in_order: list[Edit] = []
    for finding in findings:
        new = set(_edits(finding)) - taken
        if not any(_touches_one(edit, in_order) for edit in new):
            chosen.append(finding)
            taken |= new
            for edit in new:
                bisect.insort(in_order, edit)
    return chosen


def _touches_one(edit: Edit, in_order: list[Edit]) -> bool:
    """Whether an edit overlaps or borders on one of those in order, of which only the two beside it can be near."""
    at = bisect.bisect(in_order, edit)
    before, behind = in_order[max(at - 1, 0) : at], in_order[at : at + 1]
    return any(edit.offset <= b.offset + b.length for b in before) or any(
        b.offset <= edit.offset + edit.length for b in behind
    )
