"""The nouns of a parsed file: elements and attributes that know their exact place, and byte edits that change nothing else.

Only byte offsets are kept; lines, columns and the places of attributes are worked out from the bytes when asked for, so a
file of many thousand walls costs little.
"""

from __future__ import annotations

import bisect
import codecs
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

WK_NAMESPACE = "urn:wallkit:map:1"

_ATTRIBUTE = re.compile(rb"""\s+([^\s=/>]+)\s*=\s*(?:"([^"]*)"|'([^']*)')""")
_TRAILING_ZERO = re.compile(rb"[0-9]\.[0-9]*0[\s\"']")
_LINE_END = re.compile(rb"\r\n|\n|\r")

FaultKind = Literal[
    "too-large", "encoding", "declaration", "doctype", "not-well-formed", "undeclared-prefix", "instruction"
]


def wk(local: str) -> str:
    """The resolved name of something in wallkit's namespace: wk("object") = "{urn:wallkit:map:1}object"."""
    return f"{{{WK_NAMESPACE}}}{local}"


@dataclass(frozen=True, slots=True, order=True)
class Span:
    """Bytes [offset, end) of the file, and where they start: line from 1, column from 1 in characters."""

    offset: int
    end: int
    line: int
    column: int


@dataclass(frozen=True, slots=True)
class Fault:
    """Something wrong with the bytes or the XML.

    Attributes:
        kind: which of the X rules reports it.
        message: what is wrong, with the value.
        subject: the prefix, encoding or instruction it is about.
        element: the element an instruction stands in.
    """

    kind: FaultKind
    span: Span
    message: str
    subject: str = ""
    element: Element | None = None


@dataclass(frozen=True, slots=True)
class Attribute:
    """One attribute as written.

    Attributes:
        name: resolved as in `Element.attrs`; "xmlns" and "xmlns:p" stay as they are.
        value: as the XML parser reads it (entities replaced, line ends to spaces).
        span: from the first byte of the name to the closing quote. value_span: between the quotes.
        element: whose it is.
    """

    name: str
    value: str
    span: Span
    value_span: Span
    element: Element = field(repr=False)

    def replaced_by(self, text: str) -> Edit:
        """The edit that gives it another value, escaped as its place needs."""
        span = self.value_span
        return Edit(span.offset, span.end - span.offset, escaped(text).encode(self.element.document.encoding))


@dataclass(slots=True, eq=False, repr=False)
class Element:
    """One element; read-only once parsed.

    Attributes:
        tag: "link", or "{urn:wallkit:map:1}object" when it has a namespace.
        name: as written, "wk:object".
        attrs: resolved attribute names and values, in file order, without xmlns declarations.
        text: character data directly inside, stripped; a map has none.
        offset: byte of its '<'. close: byte of '</', or just behind '/>'.
    """

    document: Document
    tag: str
    name: str
    attrs: dict[str, str]
    parent: Element | None
    offset: int
    close: int = -1
    text: str = ""
    children: list[Element] = field(default_factory=list)

    def __repr__(self) -> str:
        line, column = self.document.place(self.offset)
        return f"<Element {self.name} at {line}:{column}>"

    @property
    def namespace(self) -> str:
        """The namespace's URI, or ""."""
        return self.tag[1:].partition("}")[0] if self.tag.startswith("{") else ""

    @property
    def local(self) -> str:
        """The name without prefix."""
        return self.tag.rpartition("}")[2]

    def get(self, name: str) -> str | None:
        """The value of an attribute, or None."""
        return self.attrs.get(name)

    def find(self, tag: str) -> Element | None:
        """The first child of that tag, or None."""
        return next((child for child in self.children if child.tag == tag), None)

    def findall(self, tag: str) -> list[Element]:
        """All children of that tag."""
        return [child for child in self.children if child.tag == tag]

    def iter(self) -> Iterator[Element]:
        """This element and everything in it, in file order."""
        waiting = [self]
        while waiting:
            element = waiting.pop()
            yield element
            waiting.extend(reversed(element.children))

    def ancestors(self) -> Iterator[Element]:
        """This element, its parent and so on up to the root."""
        element: Element | None = self
        while element is not None:
            yield element
            element = element.parent

    @property
    def attributes(self) -> list[Attribute]:
        """Every attribute with its place, xmlns declarations included."""
        document, values = self.document, iter(self.attrs.items())
        found = []
        for match in self._matches():
            written = match[1].decode(document.encoding)
            quoted = 2 if match[2] is not None else 3
            if is_xmlns(written):
                name, value = written, match[quoted].decode(document.encoding)
            else:
                name, value = next(values)
            value_span = document.span(*match.span(quoted))
            found.append(Attribute(name, value, document.span(match.start(1), match.end()), value_span, self))
        return found

    def attribute(self, name: str) -> Attribute | None:
        """One attribute with its place, or None."""
        return next((a for a in self.attributes if a.name == name), None)

    def spot(self, name: str) -> Attribute | Element:
        """Where a message about an attribute points: at the attribute, or at the element that lacks it."""
        return self.attribute(name) or self

    @property
    def start_span(self) -> Span:
        """The start tag, from '<' to '>'."""
        position = self.offset + 1 + len(self.name.encode(self.document.encoding))
        for match in self._matches():
            position = match.end()
        return self.document.span(self.offset, self.document.data.index(b">", position) + 1)

    @property
    def span(self) -> Span:
        """The whole element with everything in it."""
        end = self.close
        if self.children or self.start_span.end != self.close or not self.is_empty_tag:
            end = self.document.data.index(b">", self.close) + 1
        return self.document.span(self.offset, end)

    @property
    def is_empty_tag(self) -> bool:
        """Whether it is written <like this/>."""
        return self.document.data[self.start_span.end - 2 : self.start_span.end] == b"/>"

    @property
    def xpath(self) -> str:
        """A path to this element, by name or id where those tell it from its siblings, else by number."""
        return "".join(reversed([f"/{element.name}{_predicate(element)}" for element in self.ancestors()]))

    def _matches(self) -> Iterator[re.Match[bytes]]:
        position = self.offset + 1 + len(self.name.encode(self.document.encoding))
        while match := _ATTRIBUTE.match(self.document.data, position):
            yield match
            position = match.end()


@dataclass(eq=False)
class Document:
    """A parsed file: its bytes, its tree (None when the XML could not be read to the end) and what was wrong on the way."""

    source: str
    data: bytes
    encoding: str = "utf-8"
    root: Element | None = None
    faults: list[Fault] = field(default_factory=list)

    @cached_property
    def line_starts(self) -> list[int]:
        """Byte offset of the first character of every line."""
        first = len(codecs.BOM_UTF8) if self.has_bom else 0
        return [first, *(match.end() for match in _LINE_END.finditer(self.data, first))]

    @property
    def has_bom(self) -> bool:
        """Whether the file begins with the three bytes EF BB BF."""
        return self.data.startswith(codecs.BOM_UTF8)

    @cached_property
    def keeps_zeros(self) -> bool:
        """Whether numbers are written with zeros at their end, as 0.50."""
        return _TRAILING_ZERO.search(self.data) is not None

    def place(self, offset: int) -> tuple[int, int]:
        """Line and column (in characters) of a byte, both from 1."""
        line = max(bisect.bisect_right(self.line_starts, offset), 1)
        before = self.data[self.line_starts[line - 1] : offset]
        return line, len(before.decode(self.encoding, "replace")) + 1

    def span(self, offset: int, end: int) -> Span:
        """The span of a byte range."""
        return Span(offset, end, *self.place(offset))

    def slice(self, span: Span) -> str:
        """The text of a span."""
        return self.data[span.offset : span.end].decode(self.encoding, "replace")

    def line(self, number: int) -> str:
        """The text of a line (from 1), without its end."""
        start = self.line_starts[number - 1]
        end = self.line_starts[number] if number < len(self.line_starts) else len(self.data)
        return self.data[start:end].decode(self.encoding, "replace").rstrip("\r\n")


@dataclass(frozen=True, slots=True, order=True)
class Edit:
    """Replace `length` bytes from `offset` by `text`; length 0 inserts."""

    offset: int
    length: int
    text: bytes


def apply_edits(data: bytes, edits: Iterable[Edit]) -> bytes:
    """The bytes with every edit made; all else stays as it was. The order does not matter, an edit given twice counts once.

    Raises:
        ValueError: two edits overlap, or one reaches outside the data.
    """
    pieces, position = [], 0
    for edit in sorted(set(edits)):
        if edit.offset < position or edit.length < 0 or edit.offset + edit.length > len(data):
            raise ValueError(f"an edit of bytes {edit.offset}..{edit.offset + edit.length} overlaps another or the end")
        pieces += [data[position : edit.offset], edit.text]
        position = edit.offset + edit.length
    return b"".join([*pieces, data[position:]])


def escaped(text: str) -> str:
    """The text as it stands between either kind of quotes."""
    for character, entity in (("&", "&amp;"), ("<", "&lt;"), ('"', "&quot;"), ("'", "&apos;")):
        text = text.replace(character, entity)
    return text


def is_xmlns(key: str) -> bool:
    """Whether an attribute declares a namespace."""
    return key == "xmlns" or key.startswith("xmlns:")


# -------------------------------------------------------------------------------------------- details


def _predicate(element: Element) -> str:
    """[@name='a'], [@id='a'], [2] or nothing: what tells an element from its siblings of the same tag."""
    if element.parent is None:
        return ""
    alike = element.parent.findall(element.tag)
    if len(alike) == 1:
        return ""
    for key in ("name", "id"):
        value = element.get(key)
        if value and "'" not in value and sum(other.get(key) == value for other in alike) == 1:
            return f"[@{key}='{value}']"
    return f"[{alike.index(element) + 1}]"
