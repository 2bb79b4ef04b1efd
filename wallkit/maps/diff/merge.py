"""A map and two that were made of it -> one map with the changes of both; what both changed differently is a conflict.

Elements are the same when they have the same name (links, parts, rooms, classes, openings) or carry the same child (joints),
wherever they stand in the file. The result is the bytes of one side, "ours", with only what the other changed edited in:
comments, order and indentation of ours survive. Attributes merge one by one; a part, an origin, an axis are one thing each,
since half of one geometry and half of another is neither.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

from wallkit.errors import MapError
from wallkit.maps.canonical import canonical_value
from wallkit.maps.diff.merge_names import Names, name_in
from wallkit.maps.document import Document, Edit, Element, apply_edits, escaped, is_xmlns

Side = Literal["ours", "theirs"]
# taken from one side as a whole
_WHOLE = ("collision", "visual", "inertial", "origin", "axis")
_SHOWN = 160
Key = tuple[str, str, int]


@dataclass(frozen=True, slots=True)
class Conflict:
    """Something both sides changed, and differently.

    Attributes:
        place: the path of the element, with the attribute. base, ours, theirs: what each has; "" where it has none.
    """

    place: str
    base: str
    ours: str
    theirs: str


@dataclass(frozen=True, slots=True)
class Merged:
    """The result: the file as far as it could be merged, conflicts left as the favoured side has them (else as ours)."""

    data: bytes
    conflicts: tuple[Conflict, ...]


def merge_maps(
    base: Document, ours: Document, theirs: Document, names: Names | None = None, *, favour: Side = "ours"
) -> Merged:
    """Ours with what theirs changed since base.

    Args:
        names: what each side renamed, so that a rename here and a change there are no conflict.
        favour: whose version of a conflict is taken; every conflict is listed all the same.

    Raises:
        MapError: a file's XML cannot be read, or one prefix stands for two namespaces.
    """
    names = names or Names()
    conflicts = [Conflict(f"link '{old}'/@name", old, mine, other) for old, mine, other in names.conflicts]
    base, ours, theirs = names.applied(base, ours, theirs, favour=favour)
    roots = [_root(document) for document in (base, ours, theirs)]
    merge = _Merge(base, favour, conflicts)
    merge.namespaces(roots[1], roots[2])
    merge.elements(*roots)
    return Merged(apply_edits(ours.data, merge.edits()), tuple(merge.conflicts))


# -------------------------------------------------------------------------------------------- details


def _root(document: Document) -> Element:
    if document.root is None:
        fault = document.faults[0]
        where = f"{document.source}:{fault.span.line}:{fault.span.column}"
        raise MapError(fault.message, where=where, hint=f"wallkit map validate {document.source}")
    return document.root


@dataclass
class _Merge:
    """Edits of ours in the making."""

    base: Document
    favour: Side
    conflicts: list[Conflict]
    made: list[Edit] = field(default_factory=list)
    # links that one side removed and the other changed: the joint they hang on stays with them
    held: frozenset[str] = frozenset()
    # by the byte of ours they go to
    inserted: dict[int, list[str]] = field(default_factory=dict)
    # of tags <like this/>: by the byte of their end
    opened: dict[int, tuple[Element, list[str]]] = field(default_factory=dict)

    def edits(self) -> Iterator[Edit]:
        """All of them, insertions at one place as one."""
        yield from self.made
        for offset, pieces in self.inserted.items():
            yield Edit(offset, 0, "".join(pieces).encode())
        for offset, (element, pieces) in self.opened.items():
            line_start = element.document.data.rfind(b"\n", 0, element.offset) + 1
            indent = element.document.data[line_start : element.offset].decode(element.document.encoding)
            indent = indent if not indent.strip() else ""
            yield Edit(offset - 2, 2, f">{''.join(pieces)}\n{indent}</{element.name}>".encode())

    def namespaces(self, ours: Element, theirs: Element) -> None:
        """Declare what theirs declares."""
        mine, other = ({name: a.value for a in root.attributes if is_xmlns(name := a.name)} for root in (ours, theirs))
        for name, uri in other.items():
            if mine.get(name, uri) != uri:
                raise MapError(
                    f"{name} is '{mine[name]}' here and '{uri}' in {theirs.document.source}",
                    where=ours.document.source,
                    hint="use one prefix for one namespace in both files",
                )
            if name not in mine:
                self.add_attribute(ours, name, uri)

    def elements(self, base: Element, ours: Element, theirs: Element) -> None:
        """Attributes and children of one element that all three have."""
        for name in dict.fromkeys([*base.attrs, *theirs.attrs]):
            self.attribute(name, base, ours, theirs)
        children = [keyed(element) for element in (base, ours, theirs)]
        if base.parent is None:
            self.held = _held(*children)
        for key in dict.fromkeys([*children[0], *children[2]]):
            found = [side.get(key) for side in children]
            if all(found) and key[0] not in _WHOLE:
                self.elements(*found)  # type: ignore[arg-type]  # all three are elements
            else:
                self.whole(key, found, (ours, theirs), children)

    def attribute(self, name: str, base: Element, ours: Element, theirs: Element) -> None:
        values = [_value(element, name) for element in (base, ours, theirs)]
        if values[2] in (values[0], values[1]):
            return
        if values[1] != values[0]:
            self.conflicts.append(Conflict(f"{ours.xpath}/@{name}", *(value or "" for value in values)))
            if self.favour == "ours":
                return
        attribute, text = ours.attribute(name), theirs.get(name)
        if attribute is not None and text is not None:
            self.made.append(attribute.replaced_by(text))
        elif attribute is not None:
            data, start = ours.document.data, attribute.span.offset
            kept = len(data[:start].rstrip())
            self.made.append(Edit(kept, attribute.span.end - kept, b""))
        elif text is not None:
            self.add_attribute(ours, _written_name(theirs, name), text)

    def whole(
        self,
        key: Key,
        found: Sequence[Element | None],
        parents: tuple[Element, Element],
        children: Sequence[Mapping[Key, Element]],
    ) -> None:
        """An element that one of the three lacks, or that is taken as a whole."""
        _, ours, theirs = found
        said = [meaning(element) for element in found]
        is_held = key[0] in ("link", "joint") and key[1] in self.held
        if said[2] == said[1] or (said[2] == said[0] and not is_held):
            return
        if said[1] != said[0] != said[2]:
            self.conflicts.append(Conflict(_place(found), *(_shown(element) for element in found)))
        if (said[1] != said[0] or is_held) and self.favour == "ours":
            return
        if ours is not None and theirs is not None:
            text = theirs.document.slice(theirs.span)
            self.made.append(Edit(ours.offset, ours.span.end - ours.offset, text.encode(ours.document.encoding)))
        elif ours is not None:
            start = len(ours.document.data[: ours.offset].rstrip())
            self.made.append(Edit(start, ours.span.end - start, b""))
        elif theirs is not None:
            self.insert(theirs, parents, children)

    def insert(
        self, theirs: Element, parents: tuple[Element, Element], children: Sequence[Mapping[Key, Element]]
    ) -> None:
        """An element of theirs, behind the sibling that it stands behind there, with the space and remarks before it."""
        keys = list(children[2])
        index = [element is theirs for element in children[2].values()].index(True)
        siblings = parents[1].children
        position = siblings.index(theirs)
        start = siblings[position - 1].span.end if position else parents[1].start_span.end
        gap = theirs.document.data[start : theirs.offset].decode(theirs.document.encoding)
        piece = _own_part(gap, self.base) + theirs.document.slice(theirs.span)
        anchors = (children[1].get(key) for key in reversed(keys[:index]))
        gone = set(children[0]) - set(children[2])
        anchor = next((a for a in anchors if a is not None and _key_in(children[1], a) not in gone), None)
        if anchor is not None:
            self.inserted.setdefault(anchor.span.end, []).append(piece)
        elif parents[0].is_empty_tag:
            self.opened.setdefault(parents[0].start_span.end, (parents[0], []))[1].append(piece)
        else:
            self.inserted.setdefault(parents[0].start_span.end, []).append(piece)

    def add_attribute(self, element: Element, name: str, value: str) -> None:
        end = element.start_span.end - (2 if element.is_empty_tag else 1)
        at = len(element.document.data[:end].rstrip())
        text = f' {name}="{escaped(value)}"'
        self.made.append(Edit(at, 0, text.encode(element.document.encoding)))


def keyed(element: Element) -> dict[Key, Element]:
    """The children by what makes them the same in another file; things without a name are counted."""
    found: dict[Key, Element] = {}
    for child in element.children:
        number = 0
        while (key := (child.tag, name_in(child), number)) in found:
            number += 1
        found[key] = child
    return found


def meaning(element: Element | None) -> object:
    """What an element says, however it is written; equal for equal ones, None for none."""
    if element is None:
        return None
    values = {name: canonical_value(element, name, value) for name, value in element.attrs.items()}
    return element.tag, values, element.text, [meaning(child) for child in element.children]


def _held(base: Mapping[Key, Element], ours: Mapping[Key, Element], theirs: Mapping[Key, Element]) -> frozenset[str]:
    """Names of links that one side removed while the other changed them, or their place."""
    found = set()
    for key in base:
        if key[0] == "link" and (key in ours) != (key in theirs):
            other = ours if key in ours else theirs
            pair = key, ("joint", key[1], 0)
            if any(meaning(other.get(k)) != meaning(base.get(k)) for k in pair):
                found.add(key[1])
    return frozenset(found)


def _place(found: Sequence[Element | None]) -> str:
    """Where an element is, by our path, else theirs; with its name, which a path leaves out where it is not needed."""
    element = next(element for element in (found[1], found[2], found[0]) if element is not None)
    name = element.get("name") or element.get("id")
    return element.xpath if name is None or name in element.xpath else f"{element.xpath} '{name}'"


def _key_in(children: Mapping[Key, Element], element: Element) -> Key | None:
    return next((key for key, child in children.items() if child is element), None)


def _value(element: Element, name: str) -> str | None:
    value = element.get(name)
    return None if value is None else canonical_value(element, name, value)


def _written_name(element: Element, name: str) -> str:
    attribute = element.attribute(name)
    return element.document.slice(attribute.span).partition("=")[0].rstrip() if attribute is not None else name


def _shown(element: Element | None) -> str:
    """The element on one line, shortened."""
    if element is None:
        return ""
    text = " ".join(element.document.slice(element.span).split())
    return text if len(text) <= _SHOWN else f"{text[: _SHOWN - 1]}…"


def _own_part(gap: str, base: Document) -> str:
    """The space and remarks before an element, without remarks that the base has already."""
    if "<!--" not in gap:
        return gap
    head, *remarks = gap.split("<!--")
    kept = [head]
    for remark in remarks:
        body, _, tail = remark.partition("-->")
        if f"<!--{body}-->".encode(base.encoding, "replace") in base.data:
            kept[-1] = kept[-1].rstrip()
            kept.append(tail)
        else:
            kept.append(f"<!--{body}-->{tail}")
    return "".join(kept)
