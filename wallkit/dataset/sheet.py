"""Pictures with their labels -> one PNG to look at: a grid with names, the labels laid over, and a legend."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wallkit.core.types import UInt8Array
from wallkit.dataset.classes import UNLABELLED, LabelSet

_TILE_PX = 256
_GAP_PX = 8
_BAND_PX = 18
_HEAD_PX = 40
_PAPER, _INK, _ALARM = (250, 250, 250), (30, 30, 30), (200, 20, 20)
_OPACITY = 0.5


@dataclass(frozen=True, eq=False)
class Tile:
    """One picture of a sheet; `alarm` is said in red below it."""

    image: UInt8Array
    caption: str
    classes: UInt8Array | None = None
    alarm: str = ""


def contact_sheet(tiles: Sequence[Tile], labels: LabelSet, *, title: str, columns: int = 6) -> bytes:
    """A PNG of all tiles, in reading order."""
    from PIL import Image, ImageDraw

    columns = max(1, min(columns, len(tiles)))
    shapes = [tile.image.shape[:2] for tile in tiles] or [(3, 4)]
    tall = max(round(_TILE_PX * h / w) for h, w in shapes)
    cell = (_TILE_PX + _GAP_PX, tall + 2 * _BAND_PX + _GAP_PX)
    rows = -(-len(tiles) // columns)
    legend = _legend(tiles, labels)
    width = max(columns * cell[0] + _GAP_PX, 3 * cell[0])
    legend_rows = _legend_rows(legend, width)
    sheet = Image.new("RGB", (width, _HEAD_PX + len(legend_rows) * 22 + rows * cell[1] + _GAP_PX), _PAPER)
    draw = ImageDraw.Draw(sheet)
    draw.text((_GAP_PX, 10), title, fill=_INK, font=_font(16))
    for row, entries in enumerate(legend_rows):
        for x, colour, text in entries:
            y = _HEAD_PX + row * 22
            draw.rectangle((x, y, x + 14, y + 14), fill=colour, outline=_INK)
            draw.text((x + 20, y), text, fill=_INK, font=_font(12))
    for number, tile in enumerate(tiles):
        x = _GAP_PX + number % columns * cell[0]
        y = _HEAD_PX + len(legend_rows) * 22 + number // columns * cell[1]
        shown = Image.fromarray(_overlaid(tile, labels))
        draw_at = (x, y)
        sheet.paste(shown, draw_at)
        if tile.alarm:
            draw.rectangle((x - 2, y - 2, x + shown.width + 1, y + shown.height + 1), outline=_ALARM, width=3)
            draw.text((x, y + tall + _BAND_PX - 2), tile.alarm, fill=_ALARM, font=_font(12))
        draw.text((x, y + tall + 2), tile.caption, fill=_INK, font=_font(12))
    return _png(sheet)


def _overlaid(tile: Tile, labels: LabelSet) -> UInt8Array:
    """The picture, small; with labels half of it in their colours, and their borders white."""
    import cv2

    h, w = tile.image.shape[:2]
    size = (_TILE_PX, round(_TILE_PX * h / w))
    small = np.asarray(cv2.resize(tile.image, size, interpolation=cv2.INTER_AREA))
    if small.ndim == 2:
        small = np.repeat(small[..., None], 3, axis=2)
    if tile.classes is None:
        return small.astype(np.uint8)
    classes = np.asarray(cv2.resize(tile.classes, size, interpolation=cv2.INTER_NEAREST))
    colours = labels.colours[classes].astype(np.float64)
    blend = np.where((classes != UNLABELLED)[..., None], (1 - _OPACITY) * small + _OPACITY * colours, small)
    border = np.zeros(classes.shape, dtype=bool)
    border[:, 1:] |= classes[:, 1:] != classes[:, :-1]
    border[1:] |= classes[1:] != classes[:-1]
    blend[border] = 0.4 * blend[border] + 0.6 * 255
    return blend.astype(np.uint8)


def _legend(tiles: Sequence[Tile], labels: LabelSet) -> list[tuple[tuple[int, ...], str]]:
    """Colour and text of every class; nothing without labels."""
    if not any(tile.classes is not None for tile in tiles):
        return []
    return [(tuple(labels.colours[number].tolist()), name) for number, name in enumerate(labels.names)]


def _legend_rows(legend: list[tuple[tuple[int, ...], str]], width: int) -> list[list[tuple[int, Any, str]]]:
    rows: list[list[tuple[int, Any, str]]] = []
    x = width
    for colour, text in legend:
        needs = 34 + round(_font(12).getlength(text))
        if x + needs > width - _GAP_PX:
            rows.append([])
            x = _GAP_PX
        rows[-1].append((x, colour, text))
        x += needs
    return rows


def _font(size: int) -> Any:
    from PIL import ImageFont

    return ImageFont.load_default(size)


def _png(sheet: Any) -> bytes:
    import io

    packed = io.BytesIO()
    sheet.save(packed, "png")
    return packed.getvalue()
