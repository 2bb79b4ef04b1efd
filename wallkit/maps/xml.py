"""Bytes -> a document: one expat pass that never raises; whatever is wrong becomes a `Fault` for the rules of group X."""

from __future__ import annotations

import codecs
import re
from xml.parsers import expat

from wallkit.maps.document import WK_NAMESPACE, Document, Element, Fault, FaultKind, Span, is_xmlns

MAX_BYTES = 50_000_000
MAX_ELEMENTS = 200_000
MAX_DEPTH = 32

_XML_NAMESPACE = "http://www.w3.org/XML/1998/namespace"
_CONTROL = re.compile(rb"[\x00-\x08\x0b\x0c\x0e-\x1f]")
_DECLARED = re.compile(rb"""<\?xml\s[^>]*?encoding\s*=\s*["']([A-Za-z][\w.\-]*)["']""")
# codecs in which every byte is one character, so that bytes found by expat are the file's bytes
_SINGLE_BYTE = ("iso8859", "cp125", "koi8")


def parse(data: bytes, source: str = "map") -> Document:
    """The document in these bytes; whatever they are, nothing is raised.

    DOCTYPE and with it every entity is refused; nothing is ever fetched. After an undeclared prefix reading goes on (an
    element <wk:...> counts as wallkit's); all other faults but instructions and declarations leave `root` None.
    """
    document = Document(source, data)
    if len(data) > MAX_BYTES:
        message = f"the file has {len(data):,} bytes; at most {MAX_BYTES:,} are read"
        document.faults.append(Fault("too-large", Span(0, 0, 1, 1), message))
    elif _settle_encoding(document):
        _Builder(document).run()
    return document


# -------------------------------------------------------------------------------------------- details


class _Stop(Exception):  # noqa: N818 - it stops expat, it is no error of ours
    """Leaves expat from inside a handler."""


class _Builder:
    """Expat's handlers, growing the tree."""

    def __init__(self, document: Document) -> None:
        self.document = document
        self.root: Element | None = None
        self.stack: list[Element] = []
        self.scopes: list[dict[str, str]] = [{"": "", "xml": _XML_NAMESPACE}]
        self.count = 0
        self.undeclared: set[str] = set()
        self.parser = expat.ParserCreate(document.encoding)
        self.parser.buffer_text = True
        self.parser.StartElementHandler = self.start
        self.parser.EndElementHandler = self.end
        self.parser.CharacterDataHandler = self.characters
        self.parser.ProcessingInstructionHandler = self.instruction
        self.parser.StartDoctypeDeclHandler = self.doctype

    def run(self) -> None:
        try:
            self.parser.Parse(self.document.data, True)
        except _Stop:
            return
        except expat.ExpatError as error:
            self.not_well_formed(error)
            return
        self.document.root = self.root

    def start(self, name: str, attrs: dict[str, str]) -> None:
        parent = self.stack[-1] if self.stack else None
        self.count += 1
        if len(self.stack) >= MAX_DEPTH or self.count > MAX_ELEMENTS:
            limit = f"more than {MAX_ELEMENTS:,} elements" if self.count > MAX_ELEMENTS else f"deeper than {MAX_DEPTH}"
            self.stop("too-large", f"elements nest {limit}" if limit[0] == "d" else f"the file has {limit}")
        is_plain = not any(":" in key or key == "xmlns" for key in attrs)
        scope = self.scopes[-1] if is_plain else self.scope_with(attrs)
        self.scopes.append(scope)
        tag = self.resolved(name, scope, is_element=True) if ":" in name or scope[""] else name
        if not is_plain:
            attrs = self.resolved_attributes(attrs, scope)
        element = Element(self.document, tag, name, attrs, parent, self.parser.CurrentByteIndex)
        if parent is None:
            self.root = element
        else:
            parent.children.append(element)
        self.stack.append(element)

    def end(self, _name: str) -> None:
        self.scopes.pop()
        element = self.stack.pop()
        element.close = self.parser.CurrentByteIndex

    def characters(self, text: str) -> None:
        if stripped := text.strip():
            self.stack[-1].text += stripped

    def instruction(self, target: str, _data: str) -> None:
        if self.stack:
            message = f"processing instruction <?{target} ...?> inside <{self.stack[-1].name}>"
            offset = self.parser.CurrentByteIndex
            span = self.document.span(offset, self.document.data.index(b"?>", offset) + 2)
            self.document.faults.append(Fault("instruction", span, message, target, self.stack[-1]))

    def doctype(self, name: str, _system: str | None, _public: str | None, _internal: bool) -> None:
        start = self.document.data.rfind(b"<!DOCTYPE", 0, self.parser.CurrentByteIndex + len(b"<!DOCTYPE"))
        self.stop("doctype", f"the file has a DOCTYPE '{name}'; documents with entities are not read", start)

    def scope_with(self, attrs: dict[str, str]) -> dict[str, str]:
        declared = {key[len("xmlns:") :]: uri for key, uri in attrs.items() if is_xmlns(key)}
        return {**self.scopes[-1], **declared}

    def resolved_attributes(self, attrs: dict[str, str], scope: dict[str, str]) -> dict[str, str]:
        plain = {key: value for key, value in attrs.items() if not is_xmlns(key)}
        found = {self.resolved(key, scope) if ":" in key else key: value for key, value in plain.items()}
        if len(found) < len(plain):
            self.stop("not-well-formed", "duplicate attribute: two prefixes stand for one namespace")
        return found

    def resolved(self, name: str, scope: dict[str, str], *, is_element: bool = False) -> str:
        """A name with its namespace; an element with an undeclared wk: counts as wallkit's (which has no attributes)."""
        prefix, _, local = name.rpartition(":")
        if prefix in scope:
            return f"{{{scope[prefix]}}}{local}" if scope[prefix] else local
        if prefix not in self.undeclared:
            self.undeclared.add(prefix)
            written = name.encode(self.document.encoding)
            offset = self.document.data.index(written, self.parser.CurrentByteIndex)
            span = self.document.span(offset, offset + len(written))
            message = f"prefix '{prefix}' of '{name}' is not declared"
            self.document.faults.append(Fault("undeclared-prefix", span, message, prefix))
        return f"{{{WK_NAMESPACE if is_element and prefix == 'wk' else 'undeclared:' + prefix}}}{local}"

    def stop(self, kind: FaultKind, message: str, offset: int | None = None) -> None:
        offset = self.parser.CurrentByteIndex if offset is None else offset
        self.document.faults.append(Fault(kind, self.document.span(offset, offset + 1), message))
        raise _Stop

    def not_well_formed(self, error: expat.ExpatError) -> None:
        document = self.document
        offset = min(max(self.parser.ErrorByteIndex, 0), len(document.data))
        message = expat.errors.messages[error.code]
        if not document.data.strip():
            message = "the file is empty"
        elif self.stack:
            line, column = document.place(self.stack[-1].offset)
            path = " > ".join(element.name for element in self.stack)
            message = f"{message}; open here: {path} (the last one since {line}:{column})"
        span = document.span(offset, min(offset + 1, len(document.data)))
        document.faults.append(Fault("not-well-formed", span, message))


def _settle_encoding(document: Document) -> bool:
    """Whether the bytes are text that can be parsed; sets the encoding."""
    data = document.data
    declared = _DECLARED.match(data, len(codecs.BOM_UTF8) if document.has_bom else 0)
    name = declared[1].decode() if declared else "utf-8"
    if data[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE) or b"\0" in data[:4]:
        return _refuse_encoding(document, 0, "the file is UTF-16 or UTF-32 or binary; a map is UTF-8", "utf-16")
    try:
        codec = codecs.lookup(name).name
    except LookupError:
        codec = ""
    if declared and codec not in ("utf-8", "ascii"):
        span = document.span(*declared.span(1))
        if not codec.startswith(_SINGLE_BYTE):
            return _refuse_encoding(document, span.offset, f"encoding '{name}' is not read; a map is UTF-8", name)
        document.encoding = codec
        document.faults.append(
            Fault("declaration", span, f"the file is declared as {name}; other tools expect UTF-8", name)
        )
    try:
        data.decode(document.encoding)
    except UnicodeDecodeError as error:
        said = f"byte 0x{data[error.start]:02X} is not {document.encoding.upper()} ({error.reason})"
        return _refuse_encoding(document, error.start, said, name)
    if control := _CONTROL.search(data):
        return _refuse_encoding(document, control.start(), f"control character 0x{control[0][0]:02X}", name)
    return True


def _refuse_encoding(document: Document, offset: int, message: str, subject: str) -> bool:
    document.faults.append(Fault("encoding", document.span(offset, offset + 1), message, subject))
    return False
