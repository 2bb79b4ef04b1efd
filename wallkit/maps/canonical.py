"""A document -> the same document in canonical form: one way to indent, to order attributes, to write numbers.

* UTF-8, LF, two spaces a level; a collision or a joint stands on one line where it fits, a link never does.
* Attributes in the order of the grammar, then namespaces, then what the grammar does not know, as written.
* Numbers as short as they can be without changing their value (0.30 -> 0.3, 1e-3 -> 0.001), pairs apart by two spaces.
* Comments and processing instructions stay where they are: on their own line, or behind what they stood behind. Of several
  blank lines one stays. Elements that hold text are other programs', and stay as they are to the byte.

No value, name or order of elements changes, so nothing that reads the file can tell the difference.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from decimal import Decimal

from wallkit.errors import MapError
from wallkit.maps.document import Document, Element, is_xmlns, wk
from wallkit.maps.grammar import TAGS, ValueKind
from wallkit.maps.numbers import numbers_from_text
from wallkit.maps.read import prior_from_text

WIDTH = 120
INDENT = "  "
DECLARATION = '<?xml version="1.0" encoding="UTF-8"?>'
# always one child a line
_BLOCKS = ("robot", "link", wk("map"))
# shorter than these powers of ten a number is written with an exponent
_PLAIN_EXPONENTS = range(-9, 13)
_REMARK = re.compile(r"<!--.*?-->|<\?.*?\?>", re.DOTALL)
_DECLARED = re.compile(r"\s*<\?xml\s.*?\?>", re.DOTALL)
_CDATA = b"<![CDATA["


@dataclass(frozen=True, slots=True)
class _Remark:
    """A comment or processing instruction, as written."""

    text: str


@dataclass(frozen=True, slots=True)
class _Item:
    """Something inside an element, with the white space that was before it."""

    what: Element | _Remark
    is_on_new_line: bool
    is_after_blank: bool


def canonical(document: Document) -> bytes:
    """The file in canonical form; a file that is in it already comes back as it is.

    Raises:
        MapError: the XML could not be read.
    """
    root = document.root
    if root is None:
        fault = document.faults[0]
        where = f"{document.source}:{fault.span.line}:{fault.span.column}"
        raise MapError(fault.message, where=where, hint=f"wallkit map validate {document.source}")
    text = document.data.decode(document.encoding).removeprefix("\ufeff")
    start, end = (len(document.data[:at].decode(document.encoding).removeprefix("\ufeff")) for at in _ends(root))
    declared = _DECLARED.match(text)
    before = _items_in(text[declared.end() if declared else 0 : start])
    items = [*before, _Item(root, True, _has_blank(text[:start])), *_items_in(text[end:])]
    lines: list[str] = [DECLARATION]
    _append(lines, items, 0)
    return ("\n".join(lines) + "\n").encode()


def canonical_value(element: Element, name: str, value: str) -> str:
    """The value of an attribute as canonical form writes it; one that the grammar does not know, or that is wrong, as is."""
    tag = TAGS.get(element.tag)
    known = tag.attributes.get(name) if tag is not None else None
    return _value(value, known.kind, known.largest) if known is not None else value


# -------------------------------------------------------------------------------------------- details


def _ends(root: Element) -> tuple[int, int]:
    span = root.span
    return span.offset, span.end


def _append(lines: list[str], items: list[_Item], depth: int) -> None:
    """Write items below what is there; a remark that stood behind something stands behind it again."""
    first = len(lines)
    for item in items:
        if item.is_after_blank and len(lines) > first:
            lines.append("")
        indent = INDENT * depth
        if isinstance(item.what, _Remark):
            if not item.is_on_new_line and "\n" not in item.what.text:
                lines[-1] += f" {item.what.text}"
            else:
                lines.append(indent + item.what.text)
        else:
            _append_element(lines, item.what, depth)


def _append_element(lines: list[str], element: Element, depth: int) -> None:
    indent = INDENT * depth
    if _holds_text(element):
        lines.append(indent + _unix(element.document.slice(element.span)))
        return
    flat = _flat(element) if element.tag not in _BLOCKS else None
    if flat is not None and (len(indent) + len(flat) <= WIDTH or not element.children):
        lines.append(indent + flat)
        return
    items = _content(element)
    if not items:
        lines.append(f"{indent}{_start(element)}/>")
        return
    lines.append(f"{indent}{_start(element)}>")
    _append(lines, items, depth + 1)
    lines.append(f"{indent}</{element.name}>")


def _flat(element: Element) -> str | None:
    """The element on one line, or None where remarks or text keep it from that."""
    if _holds_text(element):
        return None
    items = _content(element)
    if not items:
        return f"{_start(element)}/>"
    inner = [_flat(item.what) if isinstance(item.what, Element) else None for item in items]
    if any(piece is None for piece in inner):
        return None
    return f"{_start(element)}>{''.join(piece for piece in inner if piece)}</{element.name}>"


def _holds_text(element: Element) -> bool:
    """Whether characters that count stand directly inside."""
    if element.text:
        return True
    data = element.document.data
    return any(_CDATA in data[a:b] for a, b in _gaps(element))


def _gaps(element: Element) -> Iterator[tuple[int, int]]:
    """Byte ranges between the start tag, the children and the end tag."""
    position = element.start_span.end
    for child in element.children:
        yield position, child.offset
        position = child.span.end
    yield position, max(element.close, position)


def _content(element: Element) -> list[_Item]:
    """Children and remarks, in order."""
    document, items = element.document, []
    for (start, end), child in zip(_gaps(element), [*element.children, None], strict=True):
        gap = document.data[start:end].decode(document.encoding)
        items += _items_in(gap)
        if child is not None:
            tail = gap[gap.rfind(">") + 1 :]
            items.append(_Item(child, "\n" in _unix(tail), _has_blank(gap)))
    return items


def _items_in(gap: str) -> list[_Item]:
    """The remarks in a gap between elements."""
    items, position = [], 0
    for match in _REMARK.finditer(gap):
        space = _unix(gap[position : match.start()])
        items.append(_Item(_Remark(_unix(match[0])), "\n" in space, space.count("\n") > 1))
        position = match.end()
    return items


def _has_blank(gap: str) -> bool:
    """Whether an empty line stands right before what follows a gap."""
    return _unix(gap[gap.rfind(">") + 1 :]).count("\n") > 1


def _start(element: Element) -> str:
    """The start tag without its end: attributes in order, values in canonical form."""
    tag = TAGS.get(element.tag)
    order = {name: index for index, name in enumerate(tag.attributes)} if tag is not None else {}
    written = []
    for attribute in element.attributes:
        name = element.document.slice(attribute.span).partition("=")[0].rstrip()
        rank = order.get(attribute.name, len(order) + (0 if is_xmlns(name) else 1))
        value = attribute.value if is_xmlns(name) else canonical_value(element, attribute.name, attribute.value)
        written.append((rank, f' {name}="{_escaped(value)}"'))
    return f"<{element.name}" + "".join(text for _, text in sorted(written, key=lambda pair: pair[0]))


def _value(value: str, kind: ValueKind, largest: float) -> str:
    words = value.split()
    if kind in ("numbers", "pairs"):
        if numbers_from_text(value, largest=largest) is None:
            return value
        numbers = [_number(word) for word in words]
        if kind == "numbers" or len(numbers) % 2:
            return " ".join(numbers)
        return "  ".join(f"{x} {y}" for x, y in zip(numbers[::2], numbers[1::2], strict=True))
    if kind in ("names", "integers"):
        return " ".join(words)
    if kind == "prior" and prior_from_text(value):
        pairs = [word.rpartition(":") for word in words]
        return " ".join(f"{name}:{_number(number)}" for name, _, number in pairs)
    return value


def _number(word: str) -> str:
    """The same number in the fewest characters."""
    number = Decimal(word).normalize()
    if not number:
        return "0"
    return f"{number:f}" if number.adjusted() in _PLAIN_EXPONENTS else f"{number:e}".replace("e+", "e")


def _escaped(value: str) -> str:
    for character, entity in (
        *(("&", "&amp;"), ("<", "&lt;"), ('"', "&quot;")),
        *(("\n", "&#10;"), ("\r", "&#13;"), ("\t", "&#9;")),
    ):
        value = value.replace(character, entity)
    return value


def _unix(text: str) -> str:
    return text.replace("\r\n", "\n").replace("\r", "\n")
