"""A drawing -> an SVG file to read: the plan in metres of the map frame, a group per link, the looks in one style sheet."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from xml.sax.saxutils import escape, quoteattr

from wallkit.core.types import Float64Array
from wallkit.maps.draw.marks import Area, Drawing, Group, Line, Mark, Style

_FONT = "system-ui, 'Segoe UI', Helvetica, Arial, 'DejaVu Sans', sans-serif"


def svg_from_drawing(drawing: Drawing) -> bytes:
    """The file; the same bytes for the same drawing.

    Coordinates in the plan are those of the map, to a tenth of a millimetre.
    """
    width, height = (f"{value:g}" for value in drawing.size_px)
    box = f"0 0 {width} {height}"
    s, (x, y) = drawing.scale, drawing.origin_px
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<svg xmlns="http://www.w3.org/2000/svg" role="img" width="{width}" height="{height}" viewBox="{box}">',
        f"  <title>{escape(drawing.title)}</title>",
        "  <style>",
        *(f"    .plan .{name} {{ {_css(style, s)} }}" for name, style in sorted(drawing.styles.items())),
        *(f"    .page .{name} {{ {_css(style, 1.0)} }}" for name, style in sorted(drawing.styles.items())),
        f"    text {{ font-family: {_FONT}; dominant-baseline: central; }}",
        "  </style>",
        f'  <rect width="{width}" height="{height}" fill="#ffffff"/>',
        # metres, y up -> pixels, y down
        f'  <g class="plan" transform="matrix({s:.6g} 0 0 {-s:.6g} {x:.6g} {y:.6g})">',
    ]
    for group in drawing.plan:
        lines += _group(group, digits=4)
    lines.append("  </g>")
    lines.append('  <g class="page">')
    for group in drawing.page:
        lines += _group(group, digits=1)
    lines += ["  </g>", "</svg>"]
    return ("\n".join(lines) + "\n").encode()


# -------------------------------------------------------------------------------------------- details


def _css(style: Style, scale: float) -> str:
    """A style whose widths are in units of so many pixels: metres in the plan, pixels on the page."""
    rules = [f"fill: {style.fill}", f"stroke: {style.stroke}"]
    if style.stroke != "none":
        rules.append(f"stroke-width: {style.width_px / scale:.5g}")
    if style.dash_px:
        rules.append("stroke-dasharray: " + " ".join(f"{dash / scale:.4g}" for dash in style.dash_px))
    if style.opacity != 1.0:
        rules.append(f"opacity: {style.opacity:g}")
    return "; ".join(rules) + ";"


def _group(group: Group, *, digits: int) -> Iterator[str]:
    yield f"    <g id={quoteattr(group.id)} class={quoteattr(group.kind)}>"
    if group.title:
        yield f"      <title>{escape(group.title)}</title>"
    for mark in group.marks:
        yield f"      {_mark(mark, digits)}"
    yield "    </g>"


def _mark(mark: Mark, digits: int) -> str:
    if isinstance(mark, Area):
        path = " ".join(f"M{_points(ring, digits)} Z" for ring in mark.rings)
        return f'<path class="{mark.style}" fill-rule="evenodd" d="{path}"/>'
    if isinstance(mark, Line):
        return f'<path class="{mark.style}" d="M{_points(mark.points, digits)}"/>'
    x, y = (_number(value, digits) for value in mark.at)
    look = f' font-size="{mark.size_px:g}" text-anchor="{mark.anchor}" fill="{mark.colour}"'
    look += ' font-weight="600"' if mark.is_bold else ""
    look += f' transform="rotate({-mark.turn_deg:g} {x} {y})"' if mark.turn_deg else ""
    return f'<text x="{x}" y="{y}"{look}>{escape(mark.words)}</text>'


def _points(points: Float64Array, digits: int) -> str:
    return " L".join(f"{_number(x, digits)} {_number(y, digits)}" for x, y in _pairs(points))


def _pairs(points: Float64Array) -> Iterable[tuple[float, float]]:
    return ((float(x), float(y)) for x, y in points)


def _number(value: float, digits: int) -> str:
    text = f"{value:.{digits}f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text
