"""The bytes of a map_server YAML -> its values with their places, and its image; what fails is kept as one trouble."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from wallkit.maps.document import Document, Span

_PNG = b"\x89PNG\r\n\x1a\n"
# colour types of a PNG's header (RFC 2083, 4.1.1)
_PALETTE, _WITH_ALPHA = 3, (4, 6)
_PLAIN_VALUE = re.compile(r"""\[[^\]\n]*\]?|"[^"\n]*"?|'[^'\n]*'?|[^#\n]*?(?=\s*(?:#|$))""")


@dataclass(frozen=True, slots=True)
class Trouble:
    """What keeps a sheet from being read."""

    span: Span
    message: str
    hint: str


@dataclass(frozen=True)
class Sheet:
    """A map_server YAML with its image.

    Attributes:
        values: as YAML reads them. spans: of each value. whole: of the first line, for what has no place.
        pixels: (H, W[, channels]) as OpenCV decodes them, row 0 at the top; None when the image cannot be read.
        is_palette, has_alpha: how a PNG keeps them. bits: per channel.
        trouble: the first thing that keeps it from being read.
    """

    values: Mapping[str, Any]
    spans: Mapping[str, Span]
    whole: Span
    pixels: np.ndarray | None = None
    is_palette: bool = False
    has_alpha: bool = False
    bits: int = 8
    trouble: Trouble | None = None
    keys: tuple[str, ...] = field(default=())

    def spot(self, key: str) -> Span:
        """The place of a value, or of the first line when it is not there."""
        return self.spans.get(key, self.whole)


def read_sheet(document: Document) -> Sheet:
    """The YAML in a document and the image it names; never raises, see `Sheet.trouble`."""
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    whole = document.span(document.line_starts[0], document.line_starts[0] + len(document.line(1).encode()))
    try:
        text = document.data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        spot = document.span(error.start, error.start + 1)
        return Sheet({}, {}, whole, trouble=Trouble(spot, "the file is not UTF-8", "name a map_server YAML"))
    try:
        table: Any = YAML(typ="rt", pure=True).load(text)
    except (YAMLError, ValueError) as error:
        mark = getattr(error, "problem_mark", None)
        spot = _place(document, mark.line, mark.column) if mark else whole
        message = f"not valid YAML: {getattr(error, 'problem', None) or error}"
        return Sheet({}, {}, whole, trouble=Trouble(spot, message, "name a map_server YAML"))
    if not isinstance(table, dict) or not all(isinstance(key, str) for key in table):
        hint = "it needs image, resolution and origin"
        return Sheet({}, {}, whole, trouble=Trouble(whole, "not a map_server YAML: it has no keys", hint))
    spans = {key: _place(document, *table.lc.value(key)) for key in table}  # type: ignore[attr-defined]  # ruamel's
    sheet = Sheet(dict(table), spans, whole, keys=tuple(table))
    return _with_image(sheet, Path(document.source).parent)


# -------------------------------------------------------------------------------------------- details


def _with_image(sheet: Sheet, folder: Path) -> Sheet:
    import cv2

    name, spot = sheet.values.get("image"), sheet.spot("image")

    def failed(message: str, hint: str) -> Sheet:
        return Sheet(sheet.values, sheet.spans, sheet.whole, trouble=Trouble(spot, message, hint), keys=sheet.keys)

    if not isinstance(name, str) or not name.strip() or "\0" in name:
        return failed("the YAML names no image" if name is None else f"image is {name!r}", "image: floor.pgm")
    path = folder / name
    try:
        data = path.read_bytes() if path.is_file() else None
    except OSError as error:
        return failed(f"the image '{name}' cannot be read: {error.strerror}", "PGM or PNG, 8 bit")
    if data is None:
        return failed(f"the image '{name}' is not there", f"expected {path}")
    pixels = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_UNCHANGED) if data else None
    if pixels is None:
        return failed(f"the image '{name}' cannot be decoded", "PGM or PNG, 8 bit")
    if pixels.dtype not in (np.uint8, np.uint16):
        return failed(f"the image '{name}' has {pixels.dtype} pixels", "save it with 8 bits per pixel")
    bits = 8 * pixels.dtype.itemsize
    pixels = (pixels // 256).astype(np.uint8) if bits == 16 else pixels
    kind = data[25] if data.startswith(_PNG) and len(data) > 25 else 0
    has_alpha = kind in _WITH_ALPHA or (pixels.ndim == 3 and pixels.shape[2] in (2, 4))
    return Sheet(
        sheet.values,
        sheet.spans,
        sheet.whole,
        pixels,
        is_palette=kind == _PALETTE,
        has_alpha=has_alpha,
        bits=bits,
        keys=sheet.keys,
    )


def _place(document: Document, line: int, column: int) -> Span:
    """The span of the value that stands at a line and column, both from 0 and in characters."""
    number = min(line, len(document.line_starts) - 1)
    text = document.line(number + 1)
    start = document.line_starts[number] + len(text[:column].encode())
    match = _PLAIN_VALUE.match(text, column)
    return document.span(start, start + len(match[0].encode()) if match else start)
