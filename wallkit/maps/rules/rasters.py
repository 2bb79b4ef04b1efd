"""R, rasters: a map_server YAML and its image mean what their author meant, to this program and to others."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from wallkit.errors import closest
from wallkit.maps.document import Edit, Span
from wallkit.maps.grids.raster import FREE_THRESH, MODES, OCCUPIED_THRESH, UNKNOWN_GREY
from wallkit.maps.grids.raster_sheet import Sheet, read_sheet
from wallkit.maps.rules.base import Context, Problem, Rule

# occupancy of grey 205, what map_saver writes for unknown
_UNKNOWN = (255 - UNKNOWN_GREY) / 255
_TRINARY_VALUES = 3


def sheet(context: Context) -> Sheet:
    """The YAML with its image."""
    return read_sheet(context.document)


def r001_unreadable(context: Context) -> Iterator[Problem]:
    """The YAML cannot be read, or its image is missing or no image.

    Bad:
      image: nowhere.pgm
      resolution: 0.05
      origin: [0, 0, 0]
    Good:
      image: floor.pgm
      resolution: 0.05
      origin: [0, 0, 0]
    """
    trouble = context.once(sheet).trouble
    if trouble is not None:
        yield Problem(trouble.span, trouble.message, trouble.hint)


def r002_unknown_free(context: Context) -> Iterator[Problem]:
    """Unknown cells (grey 205) count as free, because free_thresh is above 0.19608.

    map_saver writes unknown as grey 205, which reads back as an occupancy of (255 - 205) / 255. Particles and paths then
    start where nobody has been.

    Bad:
      image: floor.pgm
      resolution: 0.05
      origin: [0, 0, 0]
      occupied_thresh: 0.65
      free_thresh: 0.25
    Good:
      image: floor.pgm
      resolution: 0.05
      origin: [0, 0, 0]
      occupied_thresh: 0.65
      free_thresh: 0.196
    """
    found = context.once(sheet)
    free = _number(found.values.get("free_thresh", FREE_THRESH))
    if found.pixels is None or found.pixels.ndim != 2 or free is None or _mode(found) != "trinary" or _negate(found):
        return
    cells = int((found.pixels == UNKNOWN_GREY).sum())
    if free > _UNKNOWN and cells:
        spot = found.spot("free_thresh")
        message = f"free_thresh {free:g} turns {cells:,} unknown cells (grey {UNKNOWN_GREY}) into free space"
        edits = (_replaced(spot, f"{FREE_THRESH}"),) if "free_thresh" in found.spans else ()
        yield Problem(spot, message, f"free_thresh: {FREE_THRESH}", edits=edits, detail={"cells": cells})


def r003_image(context: Context) -> Iterator[Problem]:
    """The image is not plain grey of 8 bits, or `negate` turns it around: readers differ in what they make of that.

    Nav2 averages the channels, and alpha with them in mode trinary; in mode scale a pixel that is not opaque is unknown.

    Bad:
      image: clear.png
      resolution: 0.05
      origin: [0, 0, 0]
    Good:
      image: floor.pgm
      resolution: 0.05
      origin: [0, 0, 0]
    """
    found = context.once(sheet)
    negate = found.values.get("negate", 0)
    if negate not in (0, 1):
        message = f"negate is {negate!r}, neither 0 nor 1"
        yield Problem(found.spot("negate"), message, "negate: 0", severity="error")
    elif negate:
        yield Problem(found.spot("negate"), "negate is 1: white is occupied and black is free", severity="info")
    if found.pixels is None:
        return
    spot, pixels = found.spot("image"), found.pixels
    colours = pixels[..., :3] if pixels.ndim == 3 and pixels.shape[2] >= 3 else None
    if colours is not None and bool((np.ptp(colours, axis=2) > 0).any()):
        kind = "a palette of colours" if found.is_palette else "colours"
        yield Problem(spot, f"the image has {kind}; its channels are averaged", "save it as 8-bit grey")
    if found.has_alpha and pixels.ndim == 3 and bool((pixels[..., -1] < 255).any()):
        cells = int((pixels[..., -1] < 255).sum())
        effect = {"trinary": "alpha counts as brightness", "scale": "they are unknown", "raw": "alpha is ignored"}
        message = f"{cells:,} pixels are not opaque; in mode {_mode(found)} {effect[_mode(found)]}"
        yield Problem(spot, message, "save it without alpha", detail={"cells": cells})
    if found.bits > 8:
        yield Problem(spot, f"the image has {found.bits} bits per channel; the upper 8 are read", "save it with 8 bits")


def r004_frame(context: Context) -> Iterator[Problem]:
    """The resolution is no length above 0, or the origin is not three numbers.

    A turned origin (yaw) is honoured here and ignored by many tools (info).

    Bad:
      image: floor.pgm
      resolution: -0.05
      origin: [0, 0]
    Good:
      image: floor.pgm
      resolution: 0.05
      origin: [0, 0, 0]
    """
    found = context.once(sheet)
    if found.trouble is not None and not found.values:
        return
    resolution = _number(found.values.get("resolution"))
    if resolution is None or resolution <= 0:
        said = repr(found.values["resolution"]) if "resolution" in found.values else "missing"
        message = f"resolution is {said}, not a length above 0"
        yield Problem(found.spot("resolution"), message, "metres per pixel: resolution: 0.05")
    origin = found.values.get("origin")
    numbers = [_number(value) for value in origin] if isinstance(origin, list) else []
    if len(numbers) != 3 or None in numbers:
        said = f"is {list(origin) if isinstance(origin, list) else origin!r}" if origin is not None else "is missing"
        message = f"origin {said}, not three numbers"
        yield Problem(found.spot("origin"), message, "[x, y, yaw] of the lower left corner, metres and radians")
    elif numbers[2]:
        message = f"the origin is turned by {numbers[2]:.4g} rad: honoured here, ignored by many tools"
        yield Problem(found.spot("origin"), message, severity="info")


def r005_thresholds(context: Context) -> Iterator[Problem]:
    """A threshold is no number from 0 to 1, or occupied_thresh is not above free_thresh.

    Bad:
      image: floor.pgm
      resolution: 0.05
      origin: [0, 0, 0]
      occupied_thresh: 0.1
      free_thresh: 0.196
    Good:
      image: floor.pgm
      resolution: 0.05
      origin: [0, 0, 0]
      occupied_thresh: 0.65
      free_thresh: 0.196
    """
    found = context.once(sheet)
    values = []
    for key, default in (("occupied_thresh", OCCUPIED_THRESH), ("free_thresh", FREE_THRESH)):
        value = _number(found.values.get(key, default))
        if value is None or not 0 <= value <= 1:
            yield Problem(found.spot(key), f"{key} is {found.values[key]!r}", f"a number between 0 and 1: {default}")
        else:
            values.append(value)
    if len(values) == 2 and values[0] <= values[1]:
        key = "occupied_thresh" if "occupied_thresh" in found.spans else "free_thresh"
        message = f"occupied_thresh {values[0]:g} is not above free_thresh {values[1]:g}"
        yield Problem(found.spot(key), message, f"the usual pair is {OCCUPIED_THRESH} and {FREE_THRESH}")


def r007_mode(context: Context) -> Iterator[Problem]:
    """The mode does not exist, or is scale or raw for an image that has only the three values of trinary.

    Bad:
      image: floor.pgm
      mode: scale
      resolution: 0.05
      origin: [0, 0, 0]
    Good:
      image: floor.pgm
      mode: trinary
      resolution: 0.05
      origin: [0, 0, 0]
    """
    found = context.once(sheet)
    spot = found.spot("mode")
    said = str(found.values.get("mode", "trinary"))
    if said.lower() not in MODES:
        yield Problem(spot, f"there is no mode '{said}'", closest(said, MODES), severity="error")
        return
    if said.lower() == "trinary" or found.pixels is None:
        return
    values = np.unique(found.pixels[..., 0] if found.pixels.ndim == 3 else found.pixels)
    if len(values) <= _TRINARY_VALUES:
        message = f"mode is {said}, but the image has only the values {', '.join(map(str, values))}"
        yield Problem(spot, message, "mode: trinary", edits=(_replaced(spot, "trinary"),))


# -------------------------------------------------------------------------------------------- details


def _number(value: Any) -> float | None:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return None
    return float(value) if math.isfinite(value) else None


def _mode(found: Sheet) -> str:
    said = str(found.values.get("mode", "trinary")).lower()
    return said if said in MODES else "trinary"


def _negate(found: Sheet) -> bool:
    return found.values.get("negate", 0) not in (0, False)


def _replaced(span: Span, text: str) -> Edit:
    return Edit(span.offset, span.end - span.offset, text.encode())


RULES = (
    Rule("WK-R001", "error", r001_unreadable, blocks=False),
    Rule("WK-R002", "error", r002_unknown_free, fix="moderate", blocks=False),
    Rule("WK-R003", "warning", r003_image, blocks=False),
    Rule("WK-R004", "error", r004_frame, blocks=False),
    Rule("WK-R005", "error", r005_thresholds, blocks=False),
    Rule("WK-R007", "warning", r007_mode, fix="moderate", blocks=False),
)
