"""A map and the evidence of a log -> the floor plan with what was seen, what was seen through, and what stands elsewhere."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from wallkit.core.types import BoolArray, Float64Array
from wallkit.maps.audit.nouns import Cluster, Evidence
from wallkit.maps.audit.support import SUPPORT_MIN, VIEWS_MIN
from wallkit.maps.draw.marks import Area, Drawing, Group, Line, Mark, Style, Text, text_width_px
from wallkit.maps.draw.plan import PlanSettings, draw_plan
from wallkit.maps.model import SemanticMap

if TYPE_CHECKING:
    from wallkit.maps.rules.base import MapFinding

# told apart with every common colour blindness (Okabe & Ito 2008), and by width and dash without colour
STYLES = {
    "seen": Style(stroke="#009e73", width_px=4.0),
    "gone": Style(stroke="#d55e00", width_px=5.0, dash_px=(7, 3)),
    "unseen": Style(stroke="#8a949e", width_px=2.5, dash_px=(2, 4)),
    "path": Style(stroke="#56b4e9", width_px=1.2),
    "box": Style(fill="#d55e00", stroke="#d55e00", width_px=2.0, opacity=0.55),
    "arrow": Style(stroke="#cc2f7b", width_px=2.6),
}
_WORDS = (
    ("seen", "returns from it"),
    ("gone", "seen through: not there"),
    ("unseen", "not looked at"),
    ("box", "not in the map"),
    ("arrow", "stands there instead (10 times as far)"),
    ("path", "the robot's way"),
)
_TIMES = 10.0
_HEAD_M = 0.12
_LEGEND_PX, _SIZE_PX = 17.0, 10.5


def draw_audit(semantic_map: SemanticMap, evidence: Evidence, findings: Sequence[MapFinding], z_m: float) -> Drawing:
    """The plan at the LiDAR's height, with the evidence over it and the findings by number.

    Raises:
        MapError: nothing in the map can be drawn.
    """
    # what was never seen is drawn; a list of it would be all there is to read
    told = [finding for finding in findings if finding.code != "WK-A006"]
    plan = draw_plan(semantic_map, PlanSettings(z_m=z_m), told)
    groups = (
        Group("audit:path", "path", (Line(evidence.poses[:, :2], "path"),), "where the log looked from"),
        *_outline(evidence),
        *(_cluster_group(number, cluster) for number, cluster in enumerate(evidence.clusters, start=1)),
        *_arrows(evidence, findings),
    )
    legend, bottom = _legend(plan.size_px)
    return replace(
        plan,
        size_px=(plan.size_px[0], round(bottom)),
        styles={**plan.styles, **STYLES},
        plan=(*plan.plan, *groups),
        page=(*plan.page, legend),
    )


def _outline(evidence: Evidence) -> list[Group]:
    pieces = evidence.pieces
    looks = pieces.hits + pieces.through
    is_seen = pieces.is_exposed & (looks >= VIEWS_MIN)
    is_gone = is_seen & (pieces.hits < SUPPORT_MIN * looks)
    chosen: tuple[tuple[str, BoolArray], ...] = (
        ("unseen", pieces.is_exposed & ~is_seen),
        ("seen", is_seen & ~is_gone),
        ("gone", is_gone),
    )
    return [
        Group(f"audit:{style}", style, tuple(Line(piece.reshape(2, 2), style) for piece in pieces.segments[mask]))
        for style, mask in chosen
        if mask.any()
    ]


def _cluster_group(number: int, cluster: Cluster) -> Group:
    (x, y, yaw), size = cluster.pose, np.maximum(cluster.size_m, 0.06)
    c, s = np.cos(yaw), np.sin(yaw)
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) / 2 * size
    ring = corners @ np.array([[c, s], [-s, c]]) + (x, y)
    title = f"{cluster.class_name}? {cluster.returns} returns in {cluster.views} views"
    return Group(f"audit:cluster:{number}", "box", (Area((ring,), "box"),), title)


def _arrows(evidence: Evidence, findings: Sequence[MapFinding]) -> list[Group]:
    """An arrow for every element that stands elsewhere, ten times as long as the offset."""
    found = []
    for finding in findings:
        if finding.code != "WK-A003":
            continue
        marks: list[Mark] = []
        for shift in finding.detail["shifts"]:
            start = np.array(finding.xyz[:2])
            marks += _arrow(start, start + np.array(shift["normal"]) * shift["offset_m"] * _TIMES)
        found.append(Group(f"audit:shift:{finding.detail['link']}", "arrow", tuple(marks), finding.message))
    return found


def _arrow(start: Float64Array, end: Float64Array) -> list[Mark]:
    along = (end - start) / max(float(np.hypot(*(end - start))), 1e-9)
    across = np.array([-along[1], along[0]])
    head = [end - along * _HEAD_M + across * _HEAD_M / 2, end, end - along * _HEAD_M - across * _HEAD_M / 2]
    return [Line(np.array([start, end]), "arrow"), Line(np.array(head), "arrow")]


def _legend(size_px: tuple[float, float]) -> tuple[Group, float]:
    """What the colours of the audit mean, in rows below the page, and where they end."""
    marks: list[Mark] = []
    x, y = 28.0, size_px[1] + 2.0
    for style, words in _WORDS:
        needed = 34 + text_width_px(words, _SIZE_PX) + 14
        if x + needed > size_px[0] - 20 and x > 28.0:
            x, y = 28.0, y + _LEGEND_PX
        if style == "box":
            ring = np.array([(x, y - 5), (x + 24, y - 5), (x + 24, y + 5), (x, y + 5)])
            marks.append(Area((ring,), style))
        else:
            marks.append(Line(np.array([(x, y), (x + 24, y)]), style))
        marks.append(Text((x + 30, y), words, _SIZE_PX))
        x += needed
    return Group("audit:legend", "legend", tuple(marks)), y + 18.0
