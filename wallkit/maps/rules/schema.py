"""S, first half: which elements and attributes stand where. Values are judged in `values`."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Literal

from wallkit.errors import closest
from wallkit.maps.document import WK_NAMESPACE, Edit, Element, wk
from wallkit.maps.grammar import FOREIGN_TAGS, TAGS
from wallkit.maps.rules.base import Context, Problem, Rule

Standing = Literal["known", "misplaced", "unknown", "unknown-wk", "foreign"]

_NAME = re.compile(r"[^\W\d][\w.\-]*")
_OTHER_VERSION = re.compile(r"urn:wallkit:map:([0-9]+)")
# attributes that give a thing its name
_NAMED = {
    "link": "name",
    "joint": "name",
    "collision": "name",
    wk("class"): "name",
    wk("room"): "id",
    wk("opening"): "id",
}


@dataclass(frozen=True, slots=True)
class Placed:
    """An element and what the grammar says about its place; what is inside an unknown one is not looked at."""

    element: Element
    standing: Standing


def placed_elements(context: Context) -> list[Placed]:
    """Every element that the grammar can judge, in document order; none when the root is not <robot>."""
    if context.root.tag != "robot":
        return []
    found, waiting = [], [Placed(context.root, "known")]
    while waiting:
        placed = waiting.pop()
        found.append(placed)
        if placed.standing == "known":
            children = [Placed(child, _standing(child, placed.element)) for child in placed.element.children]
            # shapes are counted by WK-S020 and named by WK-P003, other programs' elements are their own business
            waiting += reversed([c for c in children if c.element.tag not in FOREIGN_TAGS and not _is_shape(c)])
    return found


def known_elements(context: Context) -> list[Element]:
    """The elements that stand where the grammar has them."""
    return [placed.element for placed in context.once(placed_elements) if placed.standing == "known"]


def is_plain_urdf(context: Context) -> bool:
    """Whether nothing in the file is wallkit's."""
    return not any(element.namespace == WK_NAMESPACE for element in context.root.iter())


def s001_root_not_robot(context: Context) -> Iterator[Problem]:
    """The root element is not <robot>.

    Many readers do not mind and load an empty map.

    Bad: <?xml version="1.0"?><map name="x"><link name="a"/></map>
    Good: <robot name="x"><link name="a"/></robot>
    """
    if context.root.local != "robot":
        yield Problem(context.root, f"the root is <{context.root.name}>, not <robot>", "this is no URDF map")


def s002_namespaced_robot(context: Context) -> Iterator[Problem]:
    """A namespace hides every URDF element.

    URDF has no namespace; readers look for <link> without one, find none and load an empty map.

    Bad: <robot name="t" xmlns="urn:urdf"><link name="a"/></robot>
    Good: <robot name="t"><link name="a"/></robot>
    """
    if context.root.local == "robot" and context.root.namespace:
        declared = context.root.attribute("xmlns")
        message = f"the namespace '{context.root.namespace}' hides every element: 0 links would load"
        edits: tuple[Edit, ...] = ()
        if declared is not None:
            # with the white space before it
            edits = (Edit(declared.span.offset - 1, declared.span.end - declared.span.offset + 1, b""),)
        yield Problem(declared or context.root, message, "delete the xmlns of <robot>", edits=edits)


def s003_robot_name(context: Context) -> Iterator[Problem]:
    """The robot has no name.

    Bad: <robot><link name="a"/></robot>
    Good: <robot name="floor2"><link name="a"/></robot>
    """
    if context.root.tag == "robot" and not (context.root.get("name") or "").strip():
        yield Problem(context.root.spot("name"), "<robot> has no name", 'write <robot name="...">')


def s004_no_header(context: Context) -> Iterator[Problem]:
    """There is no <wk:map> header.

    A plain URDF loads (info): classes are guessed from link names. A file that uses other wk: elements wants the header.

    Bad: <link name="a"><wk:object class="wall"/></link>
    Good: <wk:map format="1.0" units="m rad"/><link name="a"><wk:object class="wall"/></link>
    """
    if context.root.tag != "robot" or context.root.find(wk("map")) is not None:
        return
    is_plain = context.once(is_plain_urdf)
    message = "plain URDF without <wk:map>: classes are guessed" if is_plain else "there is no <wk:map> header"
    hint = "`wallkit map adopt` writes it" if is_plain else 'add <wk:map format="1.0" units="m rad" up="z"/>'
    behind_root = context.root.start_span.end
    header = b'\n  <wk:map format="1.0" units="m rad" up="z"/>'
    edits = () if is_plain or context.root.is_empty_tag else (Edit(behind_root, 0, header),)
    yield Problem(context.root, message, hint, edits=edits, severity="info" if is_plain else None)


def s010_misplaced(context: Context) -> Iterator[Problem]:
    """A wk: element stands where it means nothing.

    Bad: <wk:state rest="0"/>
    Good: <wk:map format="1.0" units="m rad"/>
    """
    for element in _standing_as(context, "misplaced"):
        places = [parent for parent, tag in TAGS.items() if element.tag in tag.children]
        said = " or ".join(f"<{_written(parent)}>" for parent in places)
        yield Problem(
            element, f"<{element.name}> inside <{_parent_name(element)}> means nothing", f"it belongs into {said}"
        )


def s011_unknown_wk(context: Context) -> Iterator[Problem]:
    """A wk: element or attribute does not exist, or its word is none of the possible ones.

    Bad: <link name="a"><wk:object clas="wall"/></link>
    Good: <link name="a"><wk:object class="wall"/></link>
    """
    for element in _standing_as(context, "unknown-wk"):
        names = {_written(tag) for tag in TAGS if tag.startswith(f"{{{WK_NAMESPACE}}}")}
        yield Problem(element, f"there is no element <{element.name}>", closest(f"wk:{element.local}", names))
    for element in context.once(known_elements):
        tag = TAGS[element.tag]
        is_wk = element.namespace == WK_NAMESPACE
        for name in element.attrs:
            if name.startswith(f"{{{WK_NAMESPACE}}}"):
                message = f"attribute {name.rpartition('}')[2]} has the prefix of wallkit, which only elements have"
                yield Problem(element.spot(name), message, "write it without prefix, or as an element <wk:...>")
            elif is_wk and name not in tag.attributes and not name.startswith("{"):
                message = f"<{element.name}> has no attribute '{name}'"
                yield Problem(element.spot(name), message, closest(name, tag.attributes), edits=_renamed(element, name))


def s012_unknown_urdf(context: Context) -> Iterator[Problem]:
    """An element without namespace that URDF does not have here; readers skip it with everything in it.

    Bad: <link name="a"><colision><geometry><box size="1 1 1"/></geometry></colision></link>
    Good: <link name="a"><collision><geometry><box size="1 1 1"/></geometry></collision></link>
    """
    for element in _standing_as(context, "unknown"):
        valid = [name for name in TAGS[element.parent.tag].children if "}" not in name] if element.parent else []
        hidden = sum(inner.tag in ("link", "joint") for inner in element.iter()) - (element.tag in ("link", "joint"))
        lost = f"; {hidden} links and joints in it are not read" if hidden else ""
        message = f"<{element.name}> inside <{_parent_name(element)}> is skipped by every reader{lost}"
        hint = closest(element.name, valid) if valid else f"<{_parent_name(element)}> has no child elements"
        near = get_close_matches(element.name, valid, n=1, cutoff=0.8)
        yield Problem(element, message, hint, edits=_retagged(element, near[0]) if near else ())


def s013_foreign(context: Context) -> Iterator[Problem]:
    """Elements or attributes of another namespace; they are kept and ignored.

    Where the prefix is wk, the file probably means wallkit's namespace and all its meaning is lost (warning).

    Bad: <link name="a"><drake:proximity xmlns:drake="http://drake.mit.edu"/></link>
    Good: <link name="a"/>
    """
    first: dict[str, tuple[Element, str, int]] = {}
    for element in context.root.iter():
        for name in (element.tag, *element.attrs):
            uri = name[1:].partition("}")[0] if name.startswith("{") else ""
            if uri and uri != WK_NAMESPACE and not _is_spoken_for(uri):
                found = first.setdefault(uri, (element, element.name, 0))
                first[uri] = (found[0], found[1], found[2] + 1)
    for uri, (element, written, count) in first.items():
        message = f"namespace '{uri}' is not wallkit's: {count} names ignored, the first in <{written}>"
        if written.startswith("wk:"):
            yield Problem(element, message, f'write xmlns:wk="{WK_NAMESPACE}"', severity="warning")
        else:
            yield Problem(element, message)


def s014_unknown_attribute(context: Context) -> Iterator[Problem]:
    """An attribute that URDF does not have; readers skip it.

    Bad: <link name="a" class="wall"/>
    Good: <link name="a"><wk:object class="wall"/></link>
    """
    for element in context.once(known_elements):
        if element.namespace:
            continue
        valid = TAGS[element.tag].attributes
        for name in element.attrs:
            if name not in valid and not name.startswith("{"):
                message = f"<{element.name}> has no attribute '{name}'; every reader skips it"
                hint = closest(name, valid) if valid else "delete it"
                yield Problem(element.spot(name), message, hint, edits=_renamed(element, name))


def s015_name(context: Context) -> Iterator[Problem]:
    """A name is not a letter followed by letters, digits, '_', '.' or '-'.

    Such names break shell words, ROS topics and XPaths.

    Bad: <link name="wall 1"/>
    Good: <link name="wall_1"/>
    """
    for element in context.once(known_elements):
        attribute = _NAMED.get(element.tag)
        value = element.get(attribute) if attribute else None
        if attribute and value is not None and not _NAME.fullmatch(value):
            plain = re.sub(r"\W+", "_", value).strip("_")
            hint = f"for example '{plain}'" if _NAME.fullmatch(plain) else "begin with a letter"
            yield Problem(element.spot(attribute), f"'{value}' is not a plain name", hint)


def s016_unused_ignore(context: Context) -> Iterator[Problem]:
    """An inline <wk:ignore> takes no finding out.

    What it was for is repaired, or its date has passed and the finding is back: either way it can go.

    Bad: <link name="a"><wk:ignore rule="WK-S015" reason="old name"/></link>
    Good: <link name="a b"><wk:ignore rule="WK-S015" reason="old name"/></link>
    """
    for element, code in context.unused_ignores:
        yield Problem(element.spot("rule"), f"nothing of {code} is found here to ignore", "delete it")


# -------------------------------------------------------------------------------------------- details


def _standing(child: Element, parent: Element) -> Standing:
    if child.tag in TAGS[parent.tag].children:
        return "known"
    if child.namespace == WK_NAMESPACE:
        return "misplaced" if child.tag in TAGS else "unknown-wk"
    return "foreign" if child.namespace else "unknown"


def _is_shape(placed: Placed) -> bool:
    """Whether it is something un-namespaced in <geometry> that is not one of URDF's shapes."""
    parent = placed.element.parent
    return placed.standing == "unknown" and parent is not None and parent.tag == "geometry"


def _standing_as(context: Context, standing: Standing) -> Iterator[Element]:
    return (placed.element for placed in context.once(placed_elements) if placed.standing == standing)


def _is_spoken_for(uri: str) -> bool:
    """Namespaces that other rules speak about, or that nobody needs to."""
    return (
        uri.startswith("undeclared:")
        or bool(_OTHER_VERSION.fullmatch(uri))
        or uri in ("http://www.w3.org/XML/1998/namespace", "http://www.w3.org/2001/XInclude")
    )


def _parent_name(element: Element) -> str:
    return element.parent.name if element.parent else ""


def _written(tag: str) -> str:
    return f"wk:{tag.rpartition('}')[2]}" if tag.startswith("{") else tag


def _renamed(element: Element, name: str) -> tuple[Edit, ...]:
    """The attribute under the one similar name that is not taken."""
    free = [valid for valid in TAGS[element.tag].attributes if valid not in element.attrs]
    near = get_close_matches(name, free, n=1, cutoff=0.8)
    attribute = element.attribute(name)
    return (Edit(attribute.span.offset, len(name.encode()), near[0].encode()),) if near and attribute else ()


def _retagged(element: Element, name: str) -> tuple[Edit, ...]:
    length = len(element.name.encode(element.document.encoding))
    start = Edit(element.offset + 1, length, name.encode())
    return (start,) if element.is_empty_tag else (start, Edit(element.close + 2, length, name.encode()))


RULES = (
    Rule("WK-S001", "error", s001_root_not_robot),
    Rule("WK-S002", "error", s002_namespaced_robot, fix="safe"),
    Rule("WK-S003", "error", s003_robot_name, blocks=False),
    Rule("WK-S004", "warning", s004_no_header, fix="safe"),
    Rule("WK-S010", "error", s010_misplaced, blocks=False),
    Rule("WK-S011", "error", s011_unknown_wk, fix="moderate", blocks=False),
    Rule("WK-S012", "warning", s012_unknown_urdf, fix="moderate"),
    Rule("WK-S013", "info", s013_foreign),
    Rule("WK-S014", "warning", s014_unknown_attribute, fix="moderate"),
    Rule("WK-S015", "warning", s015_name),
    Rule("WK-S016", "warning", s016_unused_ignore, is_last=True),
)
