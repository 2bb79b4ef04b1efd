"""What an editing verb returns: byte edits and the change in words; and how elements and numbers are put into a file.

Everything follows what is there: indentation, line ends, the prefix of wallkit's namespace, the number of decimals. A number
that stays the same keeps its digits.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from wallkit.core.types import Float64Array
from wallkit.errors import MapError
from wallkit.maps.document import WK_NAMESPACE, Attribute, Document, Edit, Element, apply_edits, escaped
from wallkit.maps.draft.xml import ANGLE_DECIMALS
from wallkit.maps.draft.xml import DECIMALS as LENGTH_DECIMALS
from wallkit.maps.numbers import number_from_text
from wallkit.maps.rules.base import Context

_INDENT = "  "
_WORD = re.compile(r"\S+")
_PLAIN = re.compile(r"[+-]?[0-9]*\.?([0-9]*)")


@dataclass(frozen=True, slots=True)
class Changes:
    """Byte edits, and what they change: a line each, with the numbers before and after."""

    edits: tuple[Edit, ...] = ()
    said: tuple[str, ...] = ()

    def __add__(self, other: Changes) -> Changes:
        return Changes(self.edits + other.edits, self.said + other.said)


# one step of a verb: the next step sees the file as this one leaves it
Step = Callable[[Context], Changes]


# ------------------------------------------------------------------------------------------------ elements


def inserted_behind(element: Element, lines: Sequence[str]) -> tuple[Edit, ...]:
    """Lines of XML (written with the prefix wk) as the next siblings of an element, indented as it is."""
    text = _indented(element.document, lines, indent_of(element))
    return (_insert(element.document, element.span.end, text), *declared(element.document, lines))


def appended(parent: Element, lines: Sequence[str]) -> tuple[Edit, ...]:
    """Lines of XML as the last children of an element."""
    if parent.children:
        return inserted_behind(parent.children[-1], lines)
    return inserted_first(parent, lines)


def inserted_first(parent: Element, lines: Sequence[str]) -> tuple[Edit, ...]:
    """Lines of XML as the first children of an element; an empty tag is opened for them."""
    document, indent = parent.document, indent_of(parent)
    inner = indent_of(parent.children[0]) if parent.children else indent + _INDENT
    text = _indented(document, lines, inner)
    if not parent.is_empty_tag:
        return (_insert(document, parent.start_span.end, text), *declared(document, lines))
    closing = f">{text}{newline_of(document)}{indent}</{parent.name}>"
    slash = parent.start_span.end - 2
    while document.data[slash - 1 : slash].isspace():
        slash -= 1
    edit = Edit(slash, parent.start_span.end - slash, closing.encode(document.encoding))
    return (edit, *declared(document, lines))


def removed(element: Element) -> Edit:
    """The edit that takes an element out, with the line it stands on where it stands alone there."""
    span, data = element.span, element.document.data
    start = span.offset
    if starts_line(element):
        start = data.rfind(b"\n", 0, start)
        start -= data[start - 1 : start] == b"\r"
    return Edit(start, span.end - start, b"")


def sliced(element: Element, edits: Iterable[Edit]) -> bytes:
    """The bytes of an element with edits inside it made: what a copy of it begins with."""
    span = element.span
    own = [Edit(edit.offset - span.offset, edit.length, edit.text) for edit in edits]
    return apply_edits(element.document.data[span.offset : span.end], own)


def declared(document: Document, lines: Sequence[str] = ("<wk:",)) -> tuple[Edit, ...]:
    """The edit that declares wallkit's namespace, where lines need it and the root does not."""
    root = document.root
    if root is None or prefix_of(document) is not None or not any("<wk:" in line for line in lines):
        return ()
    behind_name = root.offset + 1 + len(root.name.encode(document.encoding))
    return (Edit(behind_name, 0, f' xmlns:{_written_prefix(document)}="{WK_NAMESPACE}"'.encode()),)


def prefix_of(document: Document) -> str | None:
    """The prefix that the root declares for wallkit's namespace."""
    declarations = document.root.attributes if document.root is not None else ()
    found = (a.name[len("xmlns:") :] for a in declarations if a.name.startswith("xmlns:") and a.value == WK_NAMESPACE)
    return next(found, None)


def starts_line(element: Element) -> bool:
    """Whether nothing but blanks stands before an element on its line."""
    data = element.document.data
    start = data.rfind(b"\n", 0, element.offset)
    return start >= 0 and not data[start : element.offset].strip()


def indent_of(element: Element) -> str:
    """The blanks before an element; where something else stands before it, a step more than its parent's."""
    if starts_line(element):
        data = element.document.data
        return data[data.rfind(b"\n", 0, element.offset) + 1 : element.offset].decode(element.document.encoding)
    return "" if element.parent is None else indent_of(element.parent) + _INDENT


def newline_of(document: Document) -> str:
    """How the file ends its lines."""
    return "\r\n" if b"\r\n" in document.data else "\n"


# ---------------------------------------------------------------------------------------------- attributes


def with_attribute(element: Element, name: str, value: str) -> Edit:
    """The edit that gives an attribute a value, whether the element has it or not."""
    found = element.attribute(name)
    if found is not None:
        return found.replaced_by(value)
    document, written = element.document, element.attributes
    behind_name = element.offset + 1 + len(element.name.encode(document.encoding))
    at = written[-1].span.end if written else behind_name
    return Edit(at, 0, f' {name}="{escaped(value)}"'.encode(document.encoding))


def without_attribute(element: Element, name: str) -> tuple[Edit, ...]:
    """The edit that takes an attribute out, with the blanks before it."""
    found = element.attribute(name)
    if found is None:
        return ()
    start, data = found.span.offset, element.document.data
    while data[start - 1 : start].isspace():
        start -= 1
    return (Edit(start, found.span.end - start, b""),)


def renumbered(
    attribute: Attribute, values: Sequence[float] | Float64Array, *, decimals: int = LENGTH_DECIMALS
) -> tuple[Edit, ...]:
    """Edits of those numbers of an attribute that change; blanks between them, and the other numbers, stay."""
    document, span = attribute.element.document, attribute.value_span
    _check_finite(attribute.element, values)
    text = document.data[span.offset : span.end].decode("latin-1")
    words = list(_WORD.finditer(text))
    new = [float(value) for value in values]
    if len(words) != len(new):
        return (attribute.replaced_by(numbers_text_of(new, decimals=decimals)),)
    edits = []
    for match, value in zip(words, new, strict=True):
        word = number_like(match[0], value, decimals=decimals, keeps_zeros=document.keeps_zeros)
        if word != match[0]:
            edits.append(Edit(span.offset + match.start(), len(match[0]), word.encode()))
    return tuple(edits)


def numbers_text_of(values: Sequence[float], *, decimals: int = LENGTH_DECIMALS) -> str:
    """New numbers with single blanks."""
    return " ".join(number_like("", value, decimals=decimals) for value in values)


def number_like(word: str, value: float, *, decimals: int = LENGTH_DECIMALS, keeps_zeros: bool = True) -> str:
    """A number with no more than `decimals`, in a file that keeps zeros no fewer than the word it replaces; zero is "0".

    The word itself, where it is the number to half of the last decimal.
    """
    old = number_from_text(word) if word else None
    if old is not None and abs(old - value) < 0.5 * 10.0**-decimals:
        return word
    plain = _PLAIN.fullmatch(word)
    kept = min(len(plain[1]), decimals) if plain and keeps_zeros else 0
    head, _, tail = f"{value:.{decimals}f}".partition(".")
    if not (head + tail).strip("-0"):
        return "0"
    tail = tail.rstrip("0").ljust(kept, "0")
    return f"{head}.{tail}" if tail else head


def set_origin(element: Element, xyz: Float64Array | None = None, rpy: Float64Array | None = None) -> tuple[Edit, ...]:
    """Edits that give the <origin> of a joint, collision or visual other numbers; None leaves them."""
    _check_finite(element, *(values for values in (xyz, rpy) if values is not None))
    origin = element.find("origin")
    given = [("xyz", xyz, LENGTH_DECIMALS), ("rpy", rpy, ANGLE_DECIMALS)]
    if origin is None:
        words = [
            f'{name}="{numbers_text_of(v.tolist(), decimals=d)}"' for name, v, d in given if v is not None and v.any()
        ]
        behind = [child for child in element.children if child.tag in ("parent", "child")]
        at = behind[-1].span.end if behind else element.start_span.end
        return (Edit(at, 0, f"<origin {' '.join(words)}/>".encode()),) if words else ()
    edits: tuple[Edit, ...] = ()
    for name, values, decimals in given:
        attribute = origin.attribute(name)
        if values is None or (attribute is None and not values.any()):
            continue
        if attribute is not None:
            edits += renumbered(attribute, values, decimals=decimals)
        else:
            edits += (with_attribute(origin, name, numbers_text_of(values.tolist(), decimals=decimals)),)
    return edits


# ------------------------------------------------------------------------------------------------- details


def _check_finite(element: Element, *groups: Sequence[float] | Float64Array) -> None:
    """Refuse to write what could not be read.

    Raises:
        MapError: a number is not one.
    """
    if all(math.isfinite(value) for values in groups for value in values):
        return
    line, column = element.document.place(element.offset)
    source = element.document.source
    message = f"numbers of <{element.name}>, or of what it hangs on, cannot be read"
    raise MapError(message, where=f"{source}:{line}:{column}", hint=f"wallkit map validate {source} --select S")


def _insert(document: Document, at: int, text: str) -> Edit:
    return Edit(at, 0, text.encode(document.encoding))


def _written_prefix(document: Document) -> str:
    """The prefix for wallkit's elements: the file's, else wk where that is free."""
    root = document.root
    is_taken = root is not None and any(a.name == "xmlns:wk" for a in root.attributes)
    return prefix_of(document) or ("wkmap" if is_taken else "wk")


def _indented(document: Document, lines: Sequence[str], indent: str) -> str:
    """The lines, each behind a line end, moved to an indentation; the first one tells theirs."""
    own = len(lines[0]) - len(lines[0].lstrip(" ")) if lines else 0
    prefix = _written_prefix(document)
    moved = [indent + (line[own:] if not line[:own].strip() else line.lstrip(" ")) for line in lines]
    text = "".join(f"{newline_of(document)}{line}" for line in moved)
    return text.replace("<wk:", f"<{prefix}:").replace("</wk:", f"</{prefix}:")
