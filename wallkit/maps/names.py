"""Where a file names links, joints, rooms, classes and openings -> the byte edits that name them otherwise everywhere."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Literal, get_args

from wallkit.maps.document import Edit, Element, wk

Kind = Literal["link", "joint", "room", "class", "opening"]
KINDS: tuple[Kind, ...] = get_args(Kind)

# (tag, attribute) that hold a name of each kind, or several with spaces between
REFERENCES: Mapping[Kind, tuple[tuple[str, str], ...]] = {
    "link": (
        ("link", "name"),
        ("parent", "link"),
        ("child", "link"),
        (wk("opening"), "fill"),
        ("gazebo", "reference"),
    ),
    "joint": (("joint", "name"), ("mimic", "joint"), ("gazebo", "reference")),
    "room": (
        (wk("room"), "id"),
        (wk("object"), "connects"),
        (wk("object"), "separates"),
        (wk("object"), "room"),
    ),
    "class": ((wk("class"), "name"), (wk("object"), "class")),
    "opening": ((wk("opening"), "id"),),
}


def edits_of_names(root: Element, renames: Mapping[Kind, Mapping[str, str]]) -> Iterator[tuple[Kind, Edit]]:
    """Edits of every attribute below the root that holds an old name: {kind: {old: new}}."""
    by_tag: dict[str, list[tuple[Kind, str]]] = {}
    for kind in renames:
        for tag, key in REFERENCES[kind]:
            by_tag.setdefault(tag, []).append((kind, key))
    for element in root.iter():
        # a <joint> inside <transmission> names one too, a <link> anywhere else is no link
        if element.tag == "link" and element.parent is not root:
            continue
        for kind, key in by_tag.get(element.tag, ()):
            for edit in edits_of_words(element, key, renames[kind]):
                yield kind, edit


def edits_of_words(element: Element, key: str, names: Mapping[str, str]) -> Iterator[Edit]:
    """One edit for each time an old name stands in an attribute, alone or in a list: {old: new}."""
    if names.keys().isdisjoint((element.get(key) or "").split()):
        return
    attribute = element.attribute(key)
    if attribute is None:
        return
    encoding, span = element.document.encoding, attribute.value_span
    text = element.document.slice(span)
    for match in re.finditer(r"\S+", text):
        if match[0] in names:
            at = span.offset + len(text[: match.start()].encode(encoding))
            yield Edit(at, len(match[0].encode(encoding)), names[match[0]].encode(encoding))
