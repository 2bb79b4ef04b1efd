"""What the rules find in a file -> what yourdfpy, urdfdom and MuJoCo make of it, without installing them.

The consequences were seen by running yourdfpy 0.0.60, check_urdf of urdfdom 6.0.0 and MuJoCo 4.0 on files with one fault
each; of MuJoCo only little is known.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from wallkit.maps.document import Document
from wallkit.maps.rules.base import MapFinding

Outcome = Literal["loads", "differs", "refuses"]
Verdict = tuple[Outcome, str]
# what one tool makes of a finding: always the same, or as the finding is
Consequence = Verdict | Callable[[MapFinding, Document], Verdict]

_WORST: tuple[Outcome, ...] = ("refuses", "differs", "loads")


@dataclass(frozen=True, slots=True)
class Trap:
    """One finding as one tool takes it."""

    finding: MapFinding
    outcome: Outcome
    effect: str


@dataclass(frozen=True, slots=True)
class ToolView:
    """What one tool makes of a file: the outcome is the worst of its traps; "differs" is loaded otherwise than meant."""

    tool: str
    outcome: Outcome
    traps: tuple[Trap, ...]


def views_of(findings: Sequence[MapFinding], document: Document) -> list[ToolView]:
    """What every tool makes of a file, its traps in the file's order."""
    views = []
    for tool, consequences in TOOLS.items():
        traps = []
        for finding in findings:
            known = consequences.get(finding.code)
            if known is not None:
                outcome, effect = known(finding, document) if callable(known) else known
                traps += [Trap(finding, outcome, effect)] if outcome != "loads" else []
        worst: Outcome = next(
            (outcome for outcome in _WORST if any(trap.outcome == outcome for trap in traps)), "loads"
        )
        views.append(ToolView(tool, worst, tuple(traps)))
    return views


# -------------------------------------------------------------------------------------------- details


def _value(finding: MapFinding, document: Document) -> str:
    return document.data[finding.offset : finding.offset + finding.length].decode(document.encoding, "replace")


def _attribute(finding: MapFinding, document: Document) -> str:
    """The name of the attribute whose value a finding marks."""
    before = document.data[max(finding.offset - 80, 0) : finding.offset].decode(document.encoding, "replace")
    return before.rpartition("=")[0].rpartition(" ")[2].strip()


def _broken_xml(finding: MapFinding, document: Document) -> Verdict:
    if not document.data.strip():
        return "refuses", "stops: the file is empty"
    return "differs", "recovers what it can, says that it is valid, and lacks the rest"


def _entities(finding: MapFinding, document: Document) -> Verdict:
    if document.data.count(b"<!ENTITY") and document.data.count(b"&") > 8:
        return "refuses", "stops at its limit for entities"
    return "differs", "expands entities without a word, or leaves out what holds them"


def _shapes(finding: MapFinding, document: Document) -> Verdict:
    if finding.detail.get("shapes", 0) > 1:
        return "differs", "takes the first shape"
    return "refuses", "stops: there is no shape"


def _numbers(finding: MapFinding, document: Document) -> Verdict:
    words = _value(finding, document).split()
    try:
        count = len([float(word) for word in words])
    except ValueError:
        return "refuses", "stops: no numbers"
    wanted = 3 if _attribute(finding, document) in ("xyz", "rpy", "size", "scale") else 1
    if count < wanted:
        return "refuses", f"stops: {count} numbers instead of {wanted}"
    return "differs", "takes the first numbers, as Python's float reads them"


def _commas(finding: MapFinding, document: Document) -> Verdict:
    if _attribute(finding, document) in ("size", "scale"):
        return "loads", ""
    return "refuses", "stops: no numbers"


def _undefined_link(finding: MapFinding, document: Document) -> Verdict:
    if "/child" in finding.xpath:
        return "refuses", "stops: the child link is not there"
    return "differs", "loads a link that hangs on nothing"


def _lacking(finding: MapFinding, document: Document) -> Verdict:
    if ":" in finding.xpath.rpartition("/")[2].partition("[")[0]:
        return "loads", ""
    return "refuses", "stops: the attribute is not there"


def _in_geometry(finding: MapFinding, document: Document) -> Verdict:
    if finding.severity == "error":
        return "refuses", "stops: takes it for the shape"
    return "loads", ""


def _misread(finding: MapFinding, document: Document) -> Verdict:
    """urdfdom's reading of numbers that are none."""
    if _attribute(finding, document) in ("xyz", "rpy"):
        return "refuses", "rejects the file"
    return "differs", "leaves the whole collision out"


_DROPS: Verdict = ("differs", "leaves the whole collision out")
_REJECTS: Verdict = ("refuses", "rejects the file")
_INVALID: Verdict = ("differs", "loads, but its validate() says no")

TOOLS: dict[str, Mapping[str, Consequence]] = {
    "yourdfpy 0.0.60": {
        "WK-X001": _broken_xml,
        "WK-X002": ("differs", "reads the file a second time without the elements of that prefix"),
        "WK-X003": ("differs", "replaces the bytes it cannot read"),
        "WK-X010": _entities,
        "WK-S001": ("differs", "loads it all the same"),
        "WK-S002": ("differs", "loads 0 links and says that is valid"),
        "WK-S003": ("refuses", "stops: no name"),
        "WK-S012": ("differs", "skips it with everything in it"),
        "WK-S020": _shapes,
        "WK-S021": _numbers,
        "WK-S022": ("differs", "loads it; the link vanishes from the extent"),
        "WK-S023": _commas,
        "WK-S024": ("refuses", "stops: no numbers"),
        "WK-S030": _INVALID,
        "WK-S031": ("refuses", "stops: no parent or child"),
        "WK-S032": _lacking,
        "WK-G001": ("differs", "keeps the last of them"),
        "WK-G002": ("differs", "keeps the last of them"),
        "WK-G004": _undefined_link,
        "WK-G005": ("refuses", "stops: a link is removed twice"),
        "WK-G006": ("differs", "hangs them on the first root"),
        "WK-G007": ("differs", "loads, without what goes in a circle"),
        "WK-G020": _INVALID,
        "WK-G021": ("differs", "loads, with an empty travel"),
        "WK-G022": ("differs", "turns to NaN when the joint moves"),
        "WK-G023": ("differs", "scales a sliding door's travel by the length of its axis"),
        "WK-P001": _in_geometry,
        "WK-P002": ("refuses", "stops at it"),
        "WK-P003": ("refuses", "stops at it"),
        "WK-P004": _INVALID,
        "WK-P010": ("differs", "loads without these meshes"),
        "WK-P012": ("differs", "takes the expression for letters of a name"),
    },
    "urdfdom 6.0.0": {
        "WK-X001": _REJECTS,
        "WK-X010": ("differs", "expands no entity: leaves out what holds one"),
        "WK-S001": _REJECTS,
        "WK-S003": _REJECTS,
        "WK-S012": ("differs", "skips it with everything in it"),
        "WK-S020": lambda finding, _: (
            _DROPS if not finding.detail.get("shapes") else ("differs", "takes the first shape")
        ),
        "WK-S021": _misread,
        "WK-S022": _misread,
        "WK-S023": _REJECTS,
        "WK-S024": _misread,
        "WK-S030": _REJECTS,
        "WK-S031": _REJECTS,
        "WK-G001": _REJECTS,
        "WK-G002": _REJECTS,
        "WK-G004": _REJECTS,
        "WK-G005": _REJECTS,
        "WK-G006": _REJECTS,
        "WK-G007": ("differs", "loads, without what goes in a circle"),
        "WK-G020": _REJECTS,
        "WK-P001": _DROPS,
        "WK-P003": ("differs", "leaves it out (a capsule wants version 1.1)"),
        "WK-P004": _REJECTS,
        "WK-P012": ("differs", "takes the expression for letters of a name"),
    },
    "MuJoCo 4.0": {
        "WK-P006": ("differs", "renames the second, with a warning"),
        "WK-P010": ("refuses", "stops at a collision mesh that is not there"),
    },
}
