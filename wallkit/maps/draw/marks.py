"""What a plan is drawn with: areas, lines and texts in named styles, in groups, on a page that knows its scale."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from wallkit.core.types import Float64Array

INK, MUTED, PAPER = "#1f2933", "#66727e", "#ffffff"
_HEX = re.compile(r"#[0-9a-fA-F]{6}")


@dataclass(frozen=True, slots=True)
class Style:
    """How a mark looks; widths and dashes in pixels of the page."""

    fill: str = "none"
    stroke: str = "none"
    width_px: float = 1.0
    dash_px: tuple[float, ...] = ()
    opacity: float = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Area:
    """A filled shape: rings (N, 2), the outer one first, holes after it; not closed."""

    rings: tuple[Float64Array, ...]
    style: str


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """An open line through points (N, 2)."""

    points: Float64Array
    style: str


@dataclass(frozen=True, slots=True)
class Text:
    """Words at a place on the page [px]; `at` is the middle of the line's height. turn_deg: anticlockwise."""

    at: tuple[float, float]
    words: str
    size_px: float = 12.0
    anchor: Literal["start", "middle", "end"] = "start"
    colour: str = INK
    is_bold: bool = False
    turn_deg: float = 0.0


Mark = Area | Line | Text


@dataclass(frozen=True, slots=True, eq=False)
class Group:
    """Marks that belong together: one link, one room, the scale bar.

    Attributes:
        id: unique in the drawing. kind: class of the link, or what it is. title: what a browser shows under the pointer.
    """

    id: str
    kind: str
    marks: tuple[Mark, ...]
    title: str = ""


@dataclass(frozen=True, eq=False)
class Drawing:
    """A page.

    Attributes:
        size_px: (width, height). scale: pixels per metre. origin_px: where the map's origin lies on the page.
        plan: groups in metres of the map frame, y up. page: groups in pixels, y down, drawn over the plan.
    """

    size_px: tuple[float, float]
    scale: float
    origin_px: tuple[float, float]
    styles: Mapping[str, Style]
    plan: tuple[Group, ...]
    page: tuple[Group, ...] = field(default=())
    title: str = ""

    def to_page(self, points_m: Float64Array) -> Float64Array:
        """Points (N, 2) of the map frame on the page [px]."""
        return np.asarray(np.asarray(points_m) * [self.scale, -self.scale] + self.origin_px)


def colour_or(colour: str, default: str) -> str:
    """A colour of a map, if it is one that every program knows (#rrggbb)."""
    return colour if _HEX.fullmatch(colour) else default


def mixed(colour: str, other: str, share: float) -> str:
    """The colour with a share of another."""
    a, b = ([int(text[i : i + 2], 16) for i in (1, 3, 5)] for text in (colour, other))
    return "#" + "".join(f"{round(x + (y - x) * share):02x}" for x, y in zip(a, b, strict=True))


def text_width_px(words: str, size_px: float) -> float:
    """About how wide words are in a sans serif."""
    return 0.56 * size_px * len(words)
