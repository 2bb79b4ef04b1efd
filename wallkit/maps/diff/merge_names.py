"""What two sides renamed -> the same names everywhere, so that a rename here and a change there can be merged."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Literal

from wallkit.maps.document import Document, Edit, Element, apply_edits
from wallkit.maps.names import edits_of_names, edits_of_words
from wallkit.maps.xml import parse


@dataclass(frozen=True, slots=True)
class Names:
    """Links that were renamed since the base, {old: new}, by each side."""

    ours: Mapping[str, str] = field(default_factory=dict)
    theirs: Mapping[str, str] = field(default_factory=dict)

    @property
    def conflicts(self) -> list[tuple[str, str, str]]:
        """(old, our name, their name) of links that both renamed, and differently."""
        both = self.ours.keys() & self.theirs.keys()
        return sorted((old, self.ours[old], self.theirs[old]) for old in both if self.ours[old] != self.theirs[old])

    def applied(
        self, base: Document, ours: Document, theirs: Document, *, favour: Literal["ours", "theirs"]
    ) -> tuple[Document, Document, Document]:
        """The three files with every rename made in all of them."""
        final = {**self.theirs, **self.ours} if favour == "ours" else {**self.ours, **self.theirs}
        in_ours = {self.ours.get(old, old): new for old, new in final.items()}
        in_theirs = {self.theirs.get(old, old): new for old, new in final.items()}
        return _renamed(base, final), _renamed(ours, in_ours), _renamed(theirs, in_theirs)


def renamed(document: Document, names: Mapping[str, str]) -> bytes:
    """The file with links renamed wherever they are named: {old: new}. Parts called LINK.PART follow."""
    return apply_edits(document.data, _edits(document, names))


def name_in(element: Element) -> str:
    """What makes an element the same in another version of the file; "" for what has no name."""
    if element.tag == "joint":
        child = element.find("child")
        return (child.get("link") if child is not None else None) or element.get("name") or ""
    name = element.get("name") or element.get("id") or element.get("rule") or ""
    if element.tag in ("collision", "visual") and element.parent is not None:
        return name.removeprefix(f"{element.parent.get('name')}.")
    return name


# -------------------------------------------------------------------------------------------- details


def _renamed(document: Document, names: Mapping[str, str]) -> Document:
    names = {old: new for old, new in names.items() if old != new}
    return parse(renamed(document, names), document.source) if names else document


def _edits(document: Document, names: Mapping[str, str]) -> Iterator[Edit]:
    if document.root is None:
        return
    yield from (edit for _, edit in edits_of_names(document.root, {"link": names}))
    for link in document.root.findall("link"):
        old = link.get("name") or ""
        for part in link.children if old in names else ():
            name = part.get("name") or ""
            if part.tag in ("collision", "visual") and name.startswith(f"{old}."):
                yield from edits_of_words(part, "name", {name: names[old] + name[len(old) :]})
