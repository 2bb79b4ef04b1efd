"""A map file, what the rules say of it and what was agreed to overlook -> is it good?"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection
from dataclasses import dataclass, replace

from wallkit.maps.document import Document
from wallkit.maps.rules.base import MapFinding
from wallkit.maps.rules.engine import Report


@dataclass(frozen=True)
class Judged:
    """A file with its report.

    Attributes:
        document: the file, for the lines that findings stand in.
        report: what the rules say, without what is accepted.
        accepted: findings that a baseline lists.
        is_strict: warnings count as errors do.
    """

    document: Document
    report: Report
    accepted: tuple[MapFinding, ...] = ()
    is_strict: bool = False

    def fails(self, finding: MapFinding) -> bool:
        """Whether one such finding is enough for a bad verdict."""
        return finding.severity == "error" or (self.is_strict and finding.severity == "warning")

    @property
    def is_good(self) -> bool:
        """No finding fails, and no rule was kept from running by anything but what was ignored or accepted."""
        overlooked = {finding.code for finding in (*self.report.ignored, *self.accepted)}
        waited_for = {skip.reason.partition(" ")[0] for skip in self.report.skipped}
        return not any(map(self.fails, self.report.findings)) and waited_for <= overlooked

    @property
    def skipped_by_reason(self) -> dict[str, int]:
        """How many rules could not run, by what kept them: {"WK-S021 at 3:4": 31}."""
        return dict(Counter(skip.reason for skip in self.report.skipped))

    def accepting(self, fingerprints: Collection[str]) -> Judged:
        """The same with the findings of these fingerprints accepted."""
        accepted = tuple(finding for finding in self.report.findings if finding.fingerprint in fingerprints)
        kept = tuple(finding for finding in self.report.findings if finding.fingerprint not in fingerprints)
        return replace(self, report=replace(self.report, findings=kept), accepted=accepted)
