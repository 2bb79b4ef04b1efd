"""X: bytes and XML. Everything later rests on these; nothing here ever opens another file."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator

from wallkit.maps.document import WK_NAMESPACE, Document, Edit, Fault, FaultKind, Span
from wallkit.maps.rules.base import Context, Problem, Rule

_XINCLUDE = "http://www.w3.org/2001/XInclude"
_LINE_END = re.compile(rb"\r\n|\n|\r")
_TABBED_NUMBERS = re.compile(rb"""=\s*(["'])([-+0-9.eE \t]*\t[-+0-9.eE \t]*)\1""")
_NOT_ASCII = re.compile(rb"[\x80-\xff]+")


def x001_not_well_formed(context: Context) -> Iterator[Problem]:
    """The file is not well-formed XML.

    Some readers repair such a file in silence and go on with half of it; here reading stops at the first fault.

    Bad: <link name="a"></lnk>
    Good: <link name="a"></link>
    """
    for fault in _faults(context, "not-well-formed"):
        hint = (
            "give it a <robot>" if not context.document.data.strip() else "mend the XML at this place, then check again"
        )
        yield Problem(fault.span, fault.message, hint)


def x002_undeclared_prefix(context: Context) -> Iterator[Problem]:
    """A prefix is used without being declared.

    Readers then drop every element with that prefix: all of a map's meaning for wk:.

    Bad: <robot name="t"><link name="a"><wk:object class="wall"/></link></robot>
    Good: <robot name="t" xmlns:wk="urn:wallkit:map:1"><link name="a"><wk:object class="wall"/></link></robot>
    """
    for fault in _faults(context, "undeclared-prefix"):
        uri = WK_NAMESPACE if fault.subject == "wk" else "..."
        hint = f'add xmlns:{fault.subject}="{uri}" to <robot>'
        yield Problem(fault.span, fault.message, hint, edits=_declaration(context.document, fault))


def x003_encoding(context: Context) -> Iterator[Problem]:
    """The bytes are not UTF-8 text, or hold characters that XML forbids.

    Bad: a file saved as Latin-1 without saying so, one with NUL bytes, or a UTF-16 one.
    Good: a file saved as UTF-8.
    """
    for fault in _faults(context, "encoding"):
        yield Problem(fault.span, fault.message, "save the file as UTF-8")


def x004_bom_or_declaration(context: Context) -> Iterator[Problem]:
    """The file declares another encoding than UTF-8, or begins with a byte order mark.

    A foreign encoding is read here but not by every tool. A byte order mark is only told (info): all tools skip it.

    Bad: <?xml version="1.0" encoding="ISO-8859-1"?><robot name="t"><link name="a"/></robot>
    Good: <?xml version="1.0" encoding="UTF-8"?><robot name="t"><link name="a"/></robot>
    """
    document = context.document
    if document.has_bom:
        mark = Edit(0, 3, b"")
        yield Problem(Span(0, 3, 1, 1), "the file begins with a byte order mark", edits=(mark,), severity="info")
    for fault in _faults(context, "declaration"):
        words = (_in_utf8(document, match) for match in _NOT_ASCII.finditer(document.data))
        edits = (Edit(fault.span.offset, fault.span.end - fault.span.offset, b"UTF-8"), *words)
        yield Problem(fault.span, fault.message, "save the file as UTF-8 and declare that", edits=edits)


def x005_too_large(context: Context) -> Iterator[Problem]:
    """The file is larger or nests deeper than any map: over 50 MB, 200,000 elements or 32 levels.

    Bad: a point cloud written as links.
    Good: one file per level of the building.
    """
    for fault in _faults(context, "too-large"):
        yield Problem(fault.span, fault.message, "split the map, one file per level")


def x006_line_ends_and_tabs(context: Context) -> Iterator[Problem]:
    """Line ends are mixed, or tabs stand between numbers.

    Harmless to read, but every editor that "repairs" them makes a diff of the whole file.

    Bad: a file of which one half was written on Windows, or a size whose numbers are separated by tabs.
    Good: one kind of line end, single spaces between numbers.
    """
    document = context.document
    ends = Counter(match[0] for match in _LINE_END.finditer(document.data))
    if len(ends) > 1:
        usual, _ = ends.most_common(1)[0]
        odd = [match for match in _LINE_END.finditer(document.data) if match[0] != usual]
        kinds = ", ".join(f"{count} x {_name_of(end)}" for end, count in ends.most_common())
        edits = tuple(Edit(match.start(), len(match[0]), usual) for match in odd)
        yield Problem(document.span(*odd[0].span()), f"mixed line ends: {kinds}", "use one kind", edits=edits)
    for match in _TABBED_NUMBERS.finditer(document.data):
        edit = Edit(match.start(2), len(match[2]), b" ".join(match[2].split()))
        yield Problem(document.span(*match.span(2)), "tab between numbers", "use single spaces", edits=(edit,))


def x010_doctype(context: Context) -> Iterator[Problem]:
    """The file has a DOCTYPE.

    Its entities can blow up memory (XML bomb) or pull in other files (XXE), and a number that hides in one is read by some
    tools and dropped by others. A map needs none, so none is read.

    Bad: <!DOCTYPE r [<!ENTITY w "0.12">]><robot name="t"><link name="a"/></robot>
    Good: <robot name="t"><link name="a"/></robot>
    """
    for fault in _faults(context, "doctype"):
        yield Problem(fault.span, fault.message, "delete the DOCTYPE and write the values out")


def x011_xinclude(context: Context) -> Iterator[Problem]:
    """The file includes another one by XInclude.

    Bad: <xi:include xmlns:xi="http://www.w3.org/2001/XInclude" href="walls.urdf"/>
    Good: <link name="wall_a"/>
    """
    for element in context.document.root.iter() if context.document.root else ():
        if element.namespace == _XINCLUDE:
            message = f"<{element.name}> includes '{element.get('href') or ''}'; a map is one file"
            yield Problem(element, message, "put the included elements here")


def x012_processing_instruction(context: Context) -> Iterator[Problem]:
    """A processing instruction stands inside the tree.

    Readers skip it, or stop at it when it stands in <geometry>.

    Bad: <link name="a"><?tool on?></link>
    Good: <link name="a"/>
    """
    for fault in _faults(context, "instruction"):
        yield Problem(fault.span, fault.message, "delete it, or make it a comment")


def _faults(context: Context, kind: FaultKind) -> Iterator[Fault]:
    return (fault for fault in context.document.faults if fault.kind == kind)


def _declaration(document: Document, fault: Fault) -> tuple[Edit, ...]:
    if fault.subject != "wk" or document.root is None:
        return ()
    behind_name = document.root.offset + 1 + len(document.root.name.encode(document.encoding))
    return (Edit(behind_name, 0, f' xmlns:wk="{WK_NAMESPACE}"'.encode()),)


def _in_utf8(document: Document, match: re.Match[bytes]) -> Edit:
    return Edit(match.start(), len(match[0]), match[0].decode(document.encoding).encode())


def _name_of(line_end: bytes) -> str:
    return {b"\n": "LF", b"\r\n": "CRLF", b"\r": "CR"}[line_end]


RULES = (
    Rule("WK-X001", "error", x001_not_well_formed),
    Rule("WK-X002", "error", x002_undeclared_prefix, fix="safe", blocks=False),
    Rule("WK-X003", "error", x003_encoding),
    Rule("WK-X004", "warning", x004_bom_or_declaration, fix="safe"),
    Rule("WK-X005", "error", x005_too_large),
    Rule("WK-X006", "warning", x006_line_ends_and_tabs, fix="safe"),
    Rule("WK-X010", "error", x010_doctype),
    Rule("WK-X011", "error", x011_xinclude),
    Rule("WK-X012", "warning", x012_processing_instruction),
)
