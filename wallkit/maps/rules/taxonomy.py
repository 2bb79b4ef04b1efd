"""C, classes: every element has one that the table knows, and the table says what a LiDAR sees of it."""

from __future__ import annotations

from collections.abc import Iterator
from difflib import get_close_matches

from wallkit.errors import closest
from wallkit.maps.classes import ClassInfo, class_from_name
from wallkit.maps.document import WK_NAMESPACE, Attribute, Edit, Element
from wallkit.maps.model import MAP_LINK
from wallkit.maps.nouns import Link
from wallkit.maps.rules.base import Context, Problem, Rule
from wallkit.maps.rules.schema import is_plain_urdf

# classes whose name says that a LiDAR does not simply see them
_SEEN_THROUGH = ("glass", "window", "mirror")


def used_classes(context: Context) -> dict[str, Link]:
    """Every class that elements say they are of, with the first of them; unknown classes and guessed ones are not among."""
    found: dict[str, Link] = {}
    for link in context.map.links.values():
        if link.class_name in context.map.classes and not link.class_is_inferred:
            found.setdefault(link.class_name, link)
    return found


def class_spot(link: Link) -> Attribute | Element:
    """Where a link says its class."""
    return link.element if link.semantics is None else link.semantics.spot("class")


def c001_unknown(context: Context) -> Iterator[Problem]:
    """An element is of a class that neither the map nor its taxonomy has.

    Where the prefix wk is not declared (WK-X002), what it means is a guess: its classes wait for the repair.

    Bad: <link name="a"><wk:object class="urinals"/></link>
    Good: <link name="a"><wk:object class="urinal"/></link>
    """
    classes = context.map.classes
    if any(fault.kind == "undeclared-prefix" and fault.subject == "wk" for fault in context.document.faults):
        return
    for link in context.map.all_links:
        if link.semantics is None or link.class_is_inferred or link.class_name in classes:
            continue
        spot = class_spot(link)
        near = get_close_matches(link.class_name, classes, n=1)
        edits = (spot.replaced_by(near[0]),) if near and isinstance(spot, Attribute) else ()
        hint = f'{closest(link.class_name, classes)}; your own: <wk:class name="{link.class_name}"/> in <wk:map>'
        yield Problem(spot, f"there is no class '{link.class_name}', of which '{link.name}' is", hint, edits=edits)


def c002_none(context: Context) -> Iterator[Problem]:
    """An element has geometry but does not say its class; it is guessed from the name.

    In a plain URDF no element can (info); WK-S004 says so.

    Bad: <link name="sink_1"><collision><geometry><box size="0.5 0.4 0.2"/></geometry></collision></link>
    Good:
      <link name="sink_1"><wk:object class="sink"/>
      <collision><geometry><box size="0.5 0.4 0.2"/></geometry></collision></link>
    """
    prefix, is_plain = _prefix(context), context.once(is_plain_urdf)
    for link in context.map.all_links:
        if not link.class_is_inferred or link.name == MAP_LINK or not (link.shapes or link.openings):
            continue
        guess = class_from_name(link.name) or ("wall" if link.openings else "")
        edits: tuple[Edit, ...] = ()
        if guess and prefix and link.semantics is None and not link.element.is_empty_tag:
            edits = (Edit(link.element.start_span.end, 0, f'<{prefix}:object class="{guess}"/>'.encode()),)
        message = f"'{link.name}' does not say its class" + (f"; it is taken for {guess}" if guess else "")
        hint = f'<wk:object class="{guess}"/>' if guess else f"one of {', '.join(sorted(context.map.classes))}"
        hint = hint if prefix else f"wallkit map adopt {context.document.source}"
        yield Problem(link.element, message, hint, edits=edits, severity="info" if is_plain else None)


def c003_twice(context: Context) -> Iterator[Problem]:
    """A class is in the table twice, or two classes share an id of the segmentation model without saying merge="true".

    Bad: <wk:map format="1.0" units="m rad"><wk:class name="glass" seg="7"/><wk:class name="window" seg="7"/></wk:map>
    Good:
      <wk:map format="1.0" units="m rad"><wk:class name="glass" seg="7" merge="true"/>
      <wk:class name="window" seg="7" merge="true"/></wk:map>
    """
    first: dict[str, ClassInfo] = {}
    by_id: dict[int, ClassInfo] = {}
    for row in context.map.all_classes:
        element = row.element
        if element is None or not row.name:
            continue
        known = first.setdefault(row.name, row)
        if known is not row and known.element is not None:
            related = (("first defined here", known.element.spot("name")),)
            yield Problem(element.spot("name"), f"class '{row.name}' is defined twice", "delete one", related=related)
            continue
        for number in row.seg:
            other = by_id.setdefault(number, row)
            if other is not row and not (other.merge and row.merge) and other.element is not None:
                message = f"classes '{other.name}' and '{row.name}' share segmentation id {number}"
                hint = 'if one label means both: merge="true" in both'
                related = ((f"class '{other.name}'", other.element.spot("seg")),)
                yield Problem(element.spot("seg"), message, hint, related=related)


def c005_seen_through(context: Context) -> Iterator[Problem]:
    """A class of glass does not say how many beams come back from it, or one called glass or mirror counts as opaque.

    Bad:
      <wk:map format="1.0" units="m rad"><wk:class name="glass" lidar="glass"/></wk:map>
    Good:
      <wk:map format="1.0" units="m rad"><wk:class name="glass" lidar="glass" p_return="0.15"/></wk:map>
    """
    for row in context.map.all_classes:
        if row.element is None:
            continue
        if row.lidar in ("glass", "perforated") and row.p_return is None:
            message = f"class '{row.name}' is {row.lidar}, but does not say how many beams come back from it"
            yield Problem(row.element, message, 'p_return="0.15", or what your LiDAR sees of it')
        elif row.name in _SEEN_THROUGH and row.element.get("lidar") is None and row.p_return is None:
            handling = "mirror" if row.name == "mirror" else "glass"
            message = f"class '{row.name}' does not say what a LiDAR sees of it: it counts as opaque"
            yield Problem(row.element, message, f'lidar="{handling}"')


def c007_movable(context: Context) -> Iterator[Problem]:
    """What should move is fixed, or what cannot move hangs on a joint that moves.

    A movable class that is built in (a door) wants a joint with its travel; what stands about (bins, chairs) is fixed where
    it was last seen.

    Bad:
      <link name="door_a"><wk:object class="door"/></link>
      <joint name="d" type="fixed"><parent link="map"/><child link="door_a"/></joint>
    Good:
      <link name="door_a"><wk:object class="door"/></link>
      <joint name="d" type="revolute"><parent link="map"/><child link="door_a"/><axis xyz="0 0 1"/>
      <limit lower="0" upper="1.5" effort="20" velocity="1"/></joint>
    """
    for link in context.map.links.values():
        info, joint = context.map.class_of(link.name), context.map.parent_joint(link.name)
        if info is None or joint is None or link.class_is_inferred:
            continue
        spot = joint.element.spot("type")
        if info.movable and info.mount == "structure" and not _moves(context, link.name):
            message = f"'{link.name}' is a {info.name}, which moves, but its joint '{joint.name}' is {joint.kind}"
            yield Problem(spot, message, "revolute or prismatic, with the travel in <limit>; or another class")
        elif joint.is_movable and not info.movable and info.name != "unknown":
            message = f"'{link.name}' is a {info.name}, which stays, but its joint '{joint.name}' is {joint.kind}"
            hint = 'type="fixed"; or a class with movable="true"'
            yield Problem(spot, message, hint, related=(("its class", class_spot(link)),))


# -------------------------------------------------------------------------------------------- details


def _prefix(context: Context) -> str:
    """The prefix that stands for wallkit's namespace at the root, or ""."""
    for attribute in context.root.attributes:
        if attribute.name.startswith("xmlns:") and attribute.value == WK_NAMESPACE:
            return attribute.name.removeprefix("xmlns:")
    return ""


def _moves(context: Context, link: str) -> bool:
    """Whether any joint between a link and the root moves."""
    seen = set()
    joint = context.map.parent_joint(link)
    while joint is not None and joint.name not in seen:
        if joint.is_movable:
            return True
        seen.add(joint.name)
        joint = context.map.parent_joint(joint.parent)
    return False


RULES = (
    Rule("WK-C001", "error", c001_unknown, fix="moderate"),
    Rule("WK-C002", "warning", c002_none, fix="moderate"),
    Rule("WK-C003", "error", c003_twice, blocks=False),
    Rule("WK-C005", "warning", c005_seen_through),
    Rule("WK-C007", "warning", c007_movable),
)
