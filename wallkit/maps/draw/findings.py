"""Findings of the rules -> numbered marks where they are, and a list of what the numbers mean."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from wallkit.core.types import Float64Array
from wallkit.maps.draw.marks import INK, MUTED, Area, Drawing, Group, Line, Mark, Style, Text, text_width_px
from wallkit.maps.geometry import Part
from wallkit.maps.model import SemanticMap

if TYPE_CHECKING:
    from wallkit.maps.rules.base import MapFinding

FINDING_STYLES: Mapping[str, Style] = {
    "finding-error": Style(fill="#c0262d", stroke="#ffffff", width_px=1.2),
    "finding-warning": Style(fill="#b45309", stroke="#ffffff", width_px=1.2),
    "finding-info": Style(fill="#1d5f9e", stroke="#ffffff", width_px=1.2),
    "leader": Style(stroke=INK, width_px=0.8),
}
# of more findings the rest is counted: a plan covered with labels shows nothing
MOST_MARKED = 40
_SEVERITIES = ("error", "warning", "info")
_PILL_PX = 15.0
_ROW_PX = 17.0
_TEXT_PX = 10.5
_TRIES = 60


def finding_groups(
    semantic_map: SemanticMap,
    findings: Sequence[MapFinding],
    solids: Sequence[Part],
    drawing: Drawing,
    bottom_px: float,
) -> tuple[list[Group], float]:
    """A numbered label per finding that is somewhere, the list below the plan, and where the list ends; errors go first."""
    groups: list[Group] = []
    taken: list[tuple[float, float, float, float]] = []
    y = bottom_px + 12
    left_out = len(findings) - MOST_MARKED
    if left_out > 0:
        findings = sorted(findings, key=lambda finding: _SEVERITIES.index(finding.severity))[:MOST_MARKED]
    for number, finding in enumerate(findings, start=1):
        style = f"finding-{finding.severity}"
        place = _place_of(semantic_map, finding, solids)
        marks: list[Mark] = []
        if place is not None:
            at = drawing.to_page(place[None])[0]
            marks += _label(at, f"{number} {finding.code.removeprefix('WK-')}", style, taken, drawing.size_px[0])
        line = f":{finding.line}" if finding.line else ""
        words = f"{finding.severity} {finding.code}{line}  {finding.message}"
        marks += [
            Area((_pill(28.0, y, 22.0),), style),
            Text((39.0, y), str(number), 9.5, "middle", "#ffffff", is_bold=True),
            Text(
                (58.0, y),
                _fitting(words, drawing.size_px[0] - 86.0),
                _TEXT_PX,
                colour=INK if place is not None else MUTED,
            ),
        ]
        groups.append(Group(f"finding:{number}", "finding", tuple(marks), f"{finding.code} {finding.message}"))
        y += _ROW_PX
    if left_out > 0:
        more = Text((58.0, y), f"and {left_out} more, in the list of findings only", _TEXT_PX, colour=MUTED)
        groups.append(Group("finding:more", "finding", (more,), f"{left_out} more findings"))
        y += _ROW_PX
    return groups, y if findings else bottom_px


# -------------------------------------------------------------------------------------------- details


def _place_of(semantic_map: SemanticMap, finding: MapFinding, solids: Sequence[Part]) -> Float64Array | None:
    """(2,) where a finding says it is, else the middle of the link it stands in."""
    if len(finding.xyz) >= 2:
        return np.array(finding.xyz[:2])
    spans = [(link.name, link.element.span) for link in semantic_map.links.values()]
    spans += [(joint.child, joint.element.span) for joint in semantic_map.joints.values()]
    link = next((name for name, span in spans if span.offset <= finding.offset < span.end), None)
    own = [part.footprint for part in solids if part.link == link]
    if not own:
        return None
    bounds = np.array([footprint.bounds for footprint in own])
    low, high = bounds[:, :2].min(axis=0), bounds[:, 2:].max(axis=0)
    return np.asarray((low + high) / 2)


def _label(
    at: Float64Array, words: str, style: str, taken: list[tuple[float, float, float, float]], page_px: float
) -> list[Mark]:
    """A pill with the number and code beside the place, where it covers no other, and a line to it."""
    x, y = at.tolist()
    width = text_width_px(words, 10) + 12
    left = min(max(x + 9, 2.0), page_px - width - 2)
    box = (left, y - 22.0, left + width, y - 22.0 + _PILL_PX)
    for step in range(_TRIES):
        # down and up in turns, farther each time
        offset = (1 if step % 2 else -1) * ((step + 1) // 2) * (_PILL_PX + 2)
        box = (left, y - 22.0 + offset, left + width, y - 22.0 + offset + _PILL_PX)
        if box[1] >= 2.0 and not any(_overlap(box, other) for other in taken):
            break
    taken.append(box)
    middle = (box[1] + box[3]) / 2
    dot = np.column_stack([np.cos(np.linspace(0, 6.0, 16)), np.sin(np.linspace(0, 6.0, 16))]) * 3.5 + at
    return [
        Line(np.array([(x, y), (box[0], middle)]), "leader"),
        Area((dot,), style),
        Area((_pill(box[0], middle, width),), style),
        Text(((box[0] + box[2]) / 2, middle), words, 10, "middle", "#ffffff", is_bold=True),
    ]


def _overlap(a: tuple[float, float, float, float], b: tuple[float, float, float, float]) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def _pill(x: float, y: float, width: float) -> Float64Array:
    """A box with round ends from x, its middle at y."""
    radius = _PILL_PX / 2
    turn = np.linspace(-np.pi / 2, np.pi / 2, 9)
    right = np.column_stack([x + width - radius + radius * np.cos(turn), y + radius * np.sin(turn)])
    left = np.column_stack([x + radius - radius * np.cos(turn), y - radius * np.sin(turn)])
    return np.vstack([right, left])


def _fitting(words: str, width_px: float) -> str:
    """Words shortened to a width."""
    count = int(width_px / text_width_px("x", _TEXT_PX))
    return words if len(words) <= count else words[: max(count - 1, 1)].rstrip() + "…"
