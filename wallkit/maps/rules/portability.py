"""P, other readers: what yourdfpy, urdfdom, MuJoCo and RViz trip over though the file is sound."""

from __future__ import annotations

from collections.abc import Iterator

from wallkit.maps.document import WK_NAMESPACE, Edit, Element, wk
from wallkit.maps.grammar import SHAPES, TAGS
from wallkit.maps.rules.base import Context, Problem, Rule

# what importers and `wallkit map add` write into the limits of a door
LIMIT_DEFAULTS = {"effort": "20", "velocity": "1"}
_VERSION = "1.0"
_NAMED = ("link", "joint", "collision", "visual")


def geometries(context: Context) -> list[Element]:
    """Every <geometry> of a collision or visual."""
    return [
        element
        for element in context.root.iter()
        if element.tag == "geometry" and element.parent is not None and element.parent.tag in ("collision", "visual")
    ]


def p001_extension_in_geometry(context: Context) -> Iterator[Problem]:
    """An element with a namespace stands inside <geometry>.

    yourdfpy and urdfdom read the first child of <geometry> as the shape: yourdfpy stops at it and urdfdom drops the whole
    element. Behind the shape it is skipped (warning).

    Bad: <link name="a"><collision><geometry><wk:object class="wall"/><box size="1 1 1"/></geometry></collision></link>
    Good: <link name="a"><wk:object class="wall"/><collision><geometry><box size="1 1 1"/></geometry></collision></link>
    """
    for geometry in context.once(geometries):
        for number, child in enumerate(geometry.children):
            if child.namespace:
                first = number == 0
                message = f"<{child.name}> is the first thing inside <geometry>, where readers expect the shape"
                yield Problem(
                    child,
                    message if first else f"<{child.name}> inside <geometry> is skipped by every reader",
                    "move it out of <geometry>",
                    edits=_moved_out(child, geometry),
                    severity=None if first else "warning",
                )


def p002_instruction_in_geometry(context: Context) -> Iterator[Problem]:
    """A processing instruction stands inside <geometry>; yourdfpy stops at it.

    Bad: <link name="a"><collision><geometry><?tool on?><box size="1 1 1"/></geometry></collision></link>
    Good: <link name="a"><collision><geometry><box size="1 1 1"/></geometry></collision></link>
    """
    for fault in context.document.faults:
        if fault.kind == "instruction" and fault.element is not None and fault.element.tag == "geometry":
            yield Problem(fault.span, f"<?{fault.subject} ...?> inside <geometry> stops yourdfpy", "delete it")


def p003_shape(context: Context) -> Iterator[Problem]:
    """A shape that URDF 1.0 does not have.

    yourdfpy stops at it, urdfdom drops the element (a capsule needs URDF 1.1), and so does this program.

    Bad: <link name="a"><collision><geometry><capsule radius="1" length="2"/></geometry></collision></link>
    Good: <link name="a"><collision><geometry><cylinder radius="1" length="2"/></geometry></collision></link>
    """
    for geometry in context.once(geometries):
        for child in geometry.children:
            if not child.namespace and child.tag not in SHAPES:
                yield Problem(child, f"<{child.name}> is no shape of URDF 1.0", f"one of {', '.join(SHAPES)}")


def p004_limit(context: Context) -> Iterator[Problem]:
    """A <limit> lacks effort or velocity; urdfdom rejects the whole file.

    Bad:
      <link name="a"/><joint name="j" type="revolute"><parent link="map"/><child link="a"/><axis xyz="0 0 1"/>
      <limit lower="0" upper="1.5"/></joint>
    Good:
      <link name="a"/><joint name="j" type="revolute"><parent link="map"/><child link="a"/><axis xyz="0 0 1"/>
      <limit lower="0" upper="1.5" effort="20" velocity="1"/></joint>
    """
    for joint in context.root.findall("joint"):
        for limit in joint.findall("limit"):
            missing = [name for name in LIMIT_DEFAULTS if limit.get(name) is None]
            if missing:
                more = "".join(f' {name}="{LIMIT_DEFAULTS[name]}"' for name in missing)
                message = f"<limit> of joint '{joint.get('name') or ''}' has no {' and no '.join(missing)}"
                yield Problem(limit, message, f"add{more}", edits=(_attributes_added(limit, more),))


def p005_version(context: Context) -> Iterator[Problem]:
    """The robot has another version than 1.0; releases of urdfdom reject those they do not know.

    What a map's own format is stands in <wk:map format>.

    Bad: <robot name="t" version="1.1"><link name="map"/></robot>
    Good: <robot name="t" version="1.0"><link name="map"/></robot>
    """
    version = context.root.get("version")
    if version is not None and version != _VERSION:
        message = f"version '{version}' of <robot> is not known to every reader"
        yield Problem(context.root.spot("version"), message, f'version="{_VERSION}", or none')


def p006_shape_names(context: Context) -> Iterator[Problem]:
    """Two collisions, or two visuals, have the same name.

    Names of shapes are global in MuJoCo, which renames the second; write them as link.part.

    Bad:
      <link name="a"><collision name="body"><geometry><box size="1 1 1"/></geometry></collision></link>
      <link name="b"><collision name="body"><geometry><box size="1 1 1"/></geometry></collision></link>
    Good:
      <link name="a"><collision name="a.body"><geometry><box size="1 1 1"/></geometry></collision></link>
      <link name="b"><collision name="b.body"><geometry><box size="1 1 1"/></geometry></collision></link>
    """
    for tag in ("collision", "visual"):
        named = [e for link in context.root.findall("link") for e in link.findall(tag) if e.get("name")]
        taken = {element.get("name") or "" for element in named}
        first: dict[str, Element] = {}
        for element in named:
            name = element.get("name") or ""
            if first.setdefault(name, element) is element:
                continue
            number = next(n for n in range(2, len(named) + 2) if f"{name}_{n}" not in taken)
            taken.add(f"{name}_{number}")
            attribute = element.attribute("name")
            yield Problem(
                element.spot("name"),
                f"there are two <{tag}> named '{name}'",
                "link.part is a name that no other link has",
                related=(("first used here", first[name].spot("name")),),
                edits=(attribute.replaced_by(f"{name}_{number}"),) if attribute else (),
            )


def p007_no_visual(context: Context) -> Iterator[Problem]:
    """Nothing in the map has a <visual>: RViz and yourdfpy show an empty scene.

    Geometry has one truth here, the <collision>; an export adds the visuals for those who want to look.

    Bad: <link name="a"><collision><geometry><box size="1 1 1"/></geometry></collision></link>
    Good:
      <link name="a"><visual><geometry><box size="1 1 1"/></geometry></visual>
      <collision><geometry><box size="1 1 1"/></geometry></collision></link>
    """
    links = context.root.findall("link")
    solid = sum(len(link.findall("collision")) for link in links)
    if solid and not any(link.find("visual") for link in links):
        message = f"none of the {solid} shapes is a <visual>: RViz shows nothing"
        source = context.document.source
        visible = source.removesuffix(".urdf").removesuffix(".wkmap") + "_visual.urdf"
        yield Problem(context.root, message, f"wallkit map export {source} -o {visible}")


def p008_many(context: Context) -> Iterator[Problem]:
    """So many shapes make other tools slow: yourdfpy takes seconds for a thousand, minutes for five thousand.

    Bad: a map with 1001 <collision> elements
    Good: a map with 1000 <collision> elements
    """
    count = len(context.once(geometries))
    if count > context.tolerances.geometries:
        message = (
            f"the map has {count:,} shapes; yourdfpy and RViz become slow beyond {context.tolerances.geometries:,}"
        )
        yield Problem(context.root, message, "one file per level; one box per straight piece of wall")


def p009_not_ascii(context: Context) -> Iterator[Problem]:
    """A name has letters outside of ASCII; ROS names, file names made of them, and some shells do not take those.

    Bad: <link name="Tür_1"/>
    Good: <link name="tuer_1"/>
    """
    for element in context.root.iter():
        name = element.get("name")
        if element.tag in _NAMED and name is not None and not name.isascii():
            yield Problem(element.spot("name"), f"the name '{name}' is not ASCII", "wallkit map rename")


# -------------------------------------------------------------------------------------------- details


def _moved_out(child: Element, geometry: Element) -> tuple[Edit, ...]:
    """The element cut out, and put where the grammar has it, else behind <geometry>; none where its place is taken."""
    span = child.span
    text = child.document.data[span.offset : span.end]
    behind = geometry.span.end
    owner = next((a for a in geometry.ancestors() if child.tag in TAGS.get(a.tag, TAGS["geometry"]).children), None)
    if owner is not None and owner.tag == "link":
        if child.tag == wk("object") and owner.find(child.tag) is not None:
            return ()
        behind = owner.start_span.end
    elif child.namespace == WK_NAMESPACE and owner is None:
        return ()
    return Edit(span.offset, span.end - span.offset, b""), Edit(behind, 0, text)


def _attributes_added(element: Element, text: str) -> Edit:
    end = element.start_span.end - (2 if element.is_empty_tag else 1)
    return Edit(end, 0, text.encode(element.document.encoding))


RULES = (
    Rule("WK-P001", "error", p001_extension_in_geometry, fix="safe"),
    Rule("WK-P002", "error", p002_instruction_in_geometry),
    Rule("WK-P003", "error", p003_shape),
    Rule("WK-P004", "error", p004_limit, fix="safe"),
    Rule("WK-P005", "error", p005_version),
    Rule("WK-P006", "warning", p006_shape_names, fix="safe"),
    Rule("WK-P007", "info", p007_no_visual),
    Rule("WK-P008", "info", p008_many),
    Rule("WK-P009", "info", p009_not_ascii),
)
