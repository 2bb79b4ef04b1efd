"""G, first half: one tree of links and joints. How joints move is judged in `joints`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from difflib import get_close_matches

from wallkit.errors import closest
from wallkit.maps.document import Attribute, Edit, Element, escaped
from wallkit.maps.model import SemanticMap
from wallkit.maps.nouns import Joint, Link
from wallkit.maps.rules.base import Context, Problem, Rule


def g001_duplicate_link(context: Context) -> Iterator[Problem]:
    """Two links have the same name.

    Readers keep one of them, and not all of them the same one.

    Bad: <link name="a"/><link name="a"/>
    Good: <link name="a"/><link name="b"/>
    """
    yield from _duplicates(context.map.all_links, "link")


def g002_duplicate_joint(context: Context) -> Iterator[Problem]:
    """Two joints have the same name.

    Bad:
      <link name="a"/><joint name="j" type="fixed"><parent link="map"/><child link="a"/></joint>
      <link name="b"/><joint name="j" type="fixed"><parent link="map"/><child link="b"/></joint>
    Good:
      <link name="a"/><joint name="j" type="fixed"><parent link="map"/><child link="a"/></joint>
      <link name="b"/><joint name="k" type="fixed"><parent link="map"/><child link="b"/></joint>
    """
    yield from _duplicates(context.map.all_joints, "joint")


def g003_shared_name(context: Context) -> Iterator[Problem]:
    """A link and a joint share a name; tools that draw or address both by name mix them up.

    Bad: <link name="a"/><joint name="a" type="fixed"><parent link="map"/><child link="a"/></joint>
    Good: <link name="a"/><joint name="at_a" type="fixed"><parent link="map"/><child link="a"/></joint>
    """
    for joint in context.map.joints.values():
        if joint.name in context.map.links:
            link = context.map.links[joint.name].element
            related = (("the link", link.spot("name")),)
            message = f"joint '{joint.name}' has the name of a link"
            yield Problem(joint.element.spot("name"), message, f"for example 'at_{joint.name}'", related=related)


def g004_undefined_link(context: Context) -> Iterator[Problem]:
    """A joint's parent or child does not exist.

    Bad: <link name="wall"/><joint name="j" type="fixed"><parent link="map"/><child link="wal"/></joint>
    Good: <link name="wall"/><joint name="j" type="fixed"><parent link="map"/><child link="wall"/></joint>
    """
    links = context.map.links
    for joint in context.map.all_joints:
        for end, name in (("parent", joint.parent), ("child", joint.child)):
            element = joint.element.find(end)
            if name not in links and element is not None:
                spot = element.spot("link")
                near = get_close_matches(name, links, n=1, cutoff=0.8)
                hint = closest(name, links) if len(links) <= 20 or not near else f"did you mean '{near[0]}'?"
                edits = (spot.replaced_by(near[0]),) if near and isinstance(spot, Attribute) else ()
                yield Problem(spot, f"{end} '{name}' of joint '{joint.name}' does not exist", hint, edits=edits)


def g005_two_parents(context: Context) -> Iterator[Problem]:
    """A link is the child of two joints.

    Bad:
      <link name="a"/><joint name="j" type="fixed"><parent link="map"/><child link="a"/></joint>
      <joint name="k" type="fixed"><parent link="map"/><child link="a"/></joint>
    Good: <link name="a"/><joint name="j" type="fixed"><parent link="map"/><child link="a"/></joint>
    """
    first: dict[str, Joint] = {}
    for joint in context.map.all_joints:
        if not joint.child or joint.child not in context.map.links:
            continue
        if joint.child in first:
            other = first[joint.child]
            message = f"link '{joint.child}' hangs on joint '{other.name}' and on joint '{joint.name}'"
            related = ((f"joint '{other.name}'", other.element),)
            yield Problem(_child_spot(joint), message, "delete one of them", related=related)
        first.setdefault(joint.child, joint)


def g006_orphans(context: Context) -> Iterator[Problem]:
    """A link hangs on nothing.

    Everything hangs on one root, the link `map`; readers put other roots at the origin or leave them out.

    Bad: <link name="a"/>
    Good: <link name="a"/><joint name="at_a" type="fixed"><parent link="map"/><child link="a"/></joint>
    """
    for name in context.map.roots:
        tree = context.map.subtree(name)
        # a root that carries a child of two parents is only there because of the second parent
        if name == context.map.root or any(_parents(context.map)[link] > 1 for link in tree):
            continue
        link = context.map.links[name]
        more = f", and with it {len(tree) - 1} more" if len(tree) > 1 else ""
        message = f"link '{name}' hangs on nothing{more}; the root is '{context.map.root}'"
        child, root = escaped(name), escaped(context.map.root or "")
        joint = f'<joint name="at_{child}" type="fixed"><parent link="{root}"/><child link="{child}"/></joint>'
        edits = (Edit(link.element.span.end, 0, f"\n  {joint}".encode(context.document.encoding)),)
        yield Problem(link.element.spot("name"), message, f"add {joint}", edits=edits)


def g007_cycle(context: Context) -> Iterator[Problem]:
    """Links hang on each other in a circle.

    Bad:
      <link name="a"/><joint name="j" type="fixed"><parent link="b"/><child link="a"/></joint>
      <link name="b"/><joint name="k" type="fixed"><parent link="a"/><child link="b"/></joint>
    Good:
      <link name="a"/><joint name="j" type="fixed"><parent link="map"/><child link="a"/></joint>
      <link name="b"/><joint name="k" type="fixed"><parent link="a"/><child link="b"/></joint>
    """
    settled: set[str] = set()
    for start in context.map.links:
        path: dict[str, None] = {}
        link: str | None = start
        while link is not None and link not in settled and link not in path:
            path[link] = None
            joint = context.map.parent_joint(link)
            link = joint.parent if joint is not None and joint.parent in context.map.links else None
        if link is not None and link in path:
            loop = list(path)[list(path).index(link) :]
            joints = [joint for name in loop if (joint := context.map.parent_joint(name)) is not None]
            first = min(joints, key=lambda joint: joint.element.offset)
            said = " -> ".join([*reversed(loop), loop[-1]])
            yield Problem(first.element, f"the links hang on each other: {said}", "hang one of them on 'map'")
        settled.update(path)


def g008_no_links(context: Context) -> Iterator[Problem]:
    """The file has no links at all, so nothing stands in the map.

    Bad: <robot name="t"></robot>
    Good: <robot name="t"><link name="map"/></robot>
    """
    if not context.map.all_links:
        yield Problem(context.root, "there is no <link>", 'begin with <link name="map"/>')


def g009_deep_chain(context: Context) -> Iterator[Problem]:
    """Things hang on each other through many joints; a small angle in the first one moves the last one far.

    Bad: a chair on a carpet on a floor on a room on a storey on a building on a site on a city on a country on the map.
    Good: a chair on the map.
    """
    depth: dict[str, int] = {}
    for name in context.poses:
        joint = context.map.parent_joint(name)
        depth[name] = depth[joint.parent] + 1 if joint is not None and joint.parent in depth else 0
    deepest = max(depth, key=lambda name: depth[name], default=None)
    if deepest is not None and depth[deepest] > context.tolerances.depth:
        message = f"link '{deepest}' hangs on a chain of {depth[deepest]} joints (more than {context.tolerances.depth})"
        yield Problem(context.map.links[deepest].element.spot("name"), message, "hang it on its wall or on 'map'")


def g010_empty_link(context: Context) -> Iterator[Problem]:
    """A link is empty and nothing hangs on it.

    Bad: <link name="a"/><joint name="j" type="fixed"><parent link="map"/><child link="a"/></joint>
    Good: <link name="map"/>
    """
    for link in context.map.links.values():
        if not link.element.children and not context.map.children_of(link.name) and link.name != context.map.root:
            yield Problem(
                link.element, f"link '{link.name}' is empty and carries nothing", "delete it, or give it a shape"
            )


# -------------------------------------------------------------------------------------------- details


def _duplicates(nouns: Iterable[Link] | Iterable[Joint], what: str) -> Iterator[Problem]:
    first: dict[str, Element] = {}
    taken = {noun.name for noun in nouns}
    for noun in nouns:
        if noun.name in first:
            new = next(name for k in range(2, len(taken) + 3) if (name := f"{noun.name}_{k}") not in taken)
            taken.add(new)
            spot = noun.element.spot("name")
            edits = (spot.replaced_by(new),) if isinstance(spot, Attribute) else ()
            related = (("first defined here", first[noun.name].spot("name")),)
            yield Problem(
                spot, f"there are two {what}s '{noun.name}'", f"rename this one, '{new}'", related=related, edits=edits
            )
        first.setdefault(noun.name, noun.element)


def _parents(semantic_map: SemanticMap) -> Counter[str]:
    return Counter(joint.child for joint in semantic_map.all_joints)


def _child_spot(joint: Joint) -> Attribute | Element:
    child = joint.element.find("child")
    return child.spot("link") if child is not None else joint.element


RULES = (
    Rule("WK-G001", "error", g001_duplicate_link, fix="moderate"),
    Rule("WK-G002", "error", g002_duplicate_joint, fix="moderate"),
    Rule("WK-G003", "warning", g003_shared_name),
    Rule("WK-G004", "error", g004_undefined_link, fix="moderate"),
    Rule("WK-G005", "error", g005_two_parents),
    Rule("WK-G006", "error", g006_orphans, fix="moderate"),
    Rule("WK-G007", "error", g007_cycle),
    Rule("WK-G008", "error", g008_no_links),
    Rule("WK-G009", "warning", g009_deep_chain),
    Rule("WK-G010", "info", g010_empty_link),
)
