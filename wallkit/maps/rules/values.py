"""S, second half: what stands in the attributes. Numbers, words, required ones, joint types, units and versions."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

from wallkit.errors import Severity, closest
from wallkit.maps.document import Edit, Element, wk
from wallkit.maps.grammar import FORMAT, JOINT_TYPES, SHAPES, TAGS, UNITS, Value
from wallkit.maps.numbers import Complaint, Trouble, numbers_from_text, trouble_in
from wallkit.maps.read import integers_from_text
from wallkit.maps.rules.base import Context, Problem, Rule
from wallkit.maps.rules.engine import date_from_text
from wallkit.maps.rules.schema import known_elements

_FINE = re.compile(r"\.[0-9]{7,}")
_VERSION = re.compile(r"([0-9]+)\.([0-9]+)")
_NEWER_NAMESPACE = re.compile(r"urn:wallkit:map:([0-9]+)")
_UNIT_NAMES = {"m": "metres", "rad": "radians", "": "numbers"}


@dataclass(frozen=True, slots=True)
class Malformed:
    """An attribute that should hold numbers, and why it does not."""

    element: Element
    name: str
    text: str
    value: Value
    trouble: Trouble


def malformed_numbers(context: Context) -> list[Malformed]:
    """Every attribute whose numbers cannot be read."""
    found = []
    for element, name, text, value in _numeric_attributes(context):
        numbers = numbers_from_text(text, value.count, largest=value.largest)
        if numbers is not None and (value.kind == "numbers" or (len(numbers) % 2 == 0 and len(numbers) >= 6)):
            continue
        trouble = trouble_in(text, value.count, largest=value.largest) or Trouble("count", "", len(text.split()))
        found.append(Malformed(element, name, text, value, trouble))
    return found


def s017_word(context: Context) -> Iterator[Problem]:
    """The word of a wk: attribute is none of those it can be.

    Bad: <wk:map format="1.0" units="m rad"><wk:class name="pane" lidar="glas"/></wk:map>
    Good: <wk:map format="1.0" units="m rad"><wk:class name="pane" lidar="glass"/></wk:map>
    """
    for element in context.once(known_elements):
        for name, value in TAGS[element.tag].attributes.items():
            text = element.get(name)
            if text is None or element.tag == "joint":
                continue
            wrong = wrong_word(value, text)
            if wrong:
                yield Problem(element.spot(name), f'{name}="{text}" of <{element.name}> is {wrong[0]}', wrong[1])


def s020_one_shape(context: Context) -> Iterator[Problem]:
    """A collision or visual does not have exactly one shape.

    Readers take the first of several, and stop at none.

    Bad: <link name="a"><collision><geometry/></collision></link>
    Good: <link name="a"><collision><geometry><box size="1 1 1"/></geometry></collision></link>
    """
    for element in context.once(known_elements):
        if element.tag not in ("collision", "visual"):
            continue
        geometries = element.findall("geometry")
        if len(geometries) != 1:
            message = f"<{element.name}> has {len(geometries)} <geometry>, it needs one"
            yield Problem(element, message, detail={"shapes": len(geometries)})
            continue
        shapes = [child for child in geometries[0].children if not child.namespace]
        if len(shapes) != 1:
            named = ": " + ", ".join(f"<{shape.name}>" for shape in shapes) if shapes else ""
            message = f"<geometry> has {len(shapes)} shapes{named}; readers take one"
            hint = "one <collision> for each shape" if shapes else f"put one of {', '.join(SHAPES)} into it"
            yield Problem(geometries[0], message, hint, detail={"shapes": len(shapes)})


def s021_number(context: Context) -> Iterator[Problem]:
    """Something else than the right count of plain numbers.

    Numbers are written [+-]digits[.digits][e[+-]digits] in ASCII, up to a million, separated by spaces.

    Bad: <link name="a"><collision><geometry><box size="1 2"/></geometry></collision></link>
    Good: <link name="a"><collision><geometry><box size="1 2 3"/></geometry></collision></link>
    """
    for bad in _troubled(context, "count", "malformed", "too-large"):
        wanted = f"{bad.value.count or 'pairs of'} {_UNIT_NAMES[bad.value.unit]}"
        if bad.trouble.what == "count":
            least = ", at least three pairs" if bad.value.kind == "pairs" else ""
            yield _problem(
                bad, f"has {bad.trouble.found} numbers, it needs {wanted}{least}", "write them with spaces between"
            )
        elif bad.trouble.what == "too-large":
            yield _problem(bad, f"is beyond a million: '{bad.trouble.word}'", "a map is in metres near its own origin")
        else:
            yield _problem(bad, f"is not {wanted}: '{bad.trouble.word}'", "digits 0-9, '.' and 'e' only")


def s022_not_finite(context: Context) -> Iterator[Problem]:
    """NaN or infinity where a number belongs.

    Bad: <link name="a"><collision><geometry><box size="nan 1 1"/></geometry></collision></link>
    Good: <link name="a"><collision><geometry><box size="1 1 1"/></geometry></collision></link>
    """
    for bad in _troubled(context, "not-finite"):
        yield _problem(bad, f"is not finite: '{bad.trouble.word}'", "write the value, or delete the element")


def s023_comma(context: Context) -> Iterator[Problem]:
    """Commas between numbers; some readers take them, some reject the file, none reads a decimal comma.

    Bad: <link name="a"><collision><geometry><box size="1,2,3"/></geometry></collision></link>
    Good: <link name="a"><collision><geometry><box size="1 2 3"/></geometry></collision></link>
    """
    for bad in _troubled(context, "comma"):
        yield _problem(bad, f"has a comma: '{bad.text}'", "separate numbers by spaces, decimals by a point")


def s024_unit_suffix(context: Context) -> Iterator[Problem]:
    """A number with a unit behind it; the format has metres and radians only.

    Bad: <link name="a"><collision><geometry><box size="100mm 1 1"/></geometry></collision></link>
    Good: <link name="a"><collision><geometry><box size="0.1 1 1"/></geometry></collision></link>
    """
    for bad in _troubled(context, "unit"):
        yield _problem(bad, f"has a unit: '{bad.trouble.word}'", f'{bad.name}="{bad.trouble.repaired}"')


def s025_decimals(context: Context) -> Iterator[Problem]:
    """A length has more than six decimals: less than a micrometre, the rest of a computation.

    Bad: <link name="a"><collision><geometry><box size="0.30000000000000004 1 1"/></geometry></collision></link>
    Good: <link name="a"><collision><geometry><box size="0.3 1 1"/></geometry></collision></link>
    """
    for element, name, text, value in _numeric_attributes(context):
        if value.unit == "m" and _FINE.search(text):
            yield Problem(element.spot(name), f'{name}="{text}" has more than six decimals', "`wallkit map fmt` rounds")


def s030_joint_type(context: Context) -> Iterator[Problem]:
    """A joint has no type, or one that URDF does not know.

    Bad: <link name="a"/><joint name="j" type="hinge"><parent link="map"/><child link="a"/></joint>
    Good: <link name="a"/><joint name="j" type="fixed"><parent link="map"/><child link="a"/></joint>
    """
    for element in context.once(known_elements):
        if element.tag == "joint" and element.get("type") not in JOINT_TYPES:
            kind = element.get("type")
            message = f"joint '{element.get('name') or ''}' has {f'the unknown type {kind!r}' if kind else 'no type'}"
            hint = (
                "a hinge is a revolute joint, a sliding door a prismatic one"
                if kind
                else f"one of {', '.join(JOINT_TYPES)}"
            )
            yield Problem(element.spot("type"), message, hint)


def s031_joint_ends(context: Context) -> Iterator[Problem]:
    """A joint lacks its parent or its child.

    Bad: <link name="a"/><joint name="j" type="fixed"><child link="a"/></joint>
    Good: <link name="a"/><joint name="j" type="fixed"><parent link="map"/><child link="a"/></joint>
    """
    for element in context.once(known_elements):
        if element.tag == "joint":
            for end in ("parent", "child"):
                count = len(element.findall(end))
                if count != 1:
                    message = f"joint '{element.get('name') or ''}' has {count or 'no'} <{end}>"
                    yield Problem(element, message, f'it needs one <{end} link="..."/>')


def s032_required(context: Context) -> Iterator[Problem]:
    """An attribute is missing that its element cannot do without.

    Bad: <link name="a"><collision><geometry><cylinder radius="1"/></geometry></collision></link>
    Good: <link name="a"><collision><geometry><cylinder radius="1" length="2"/></geometry></collision></link>
    """
    for element in context.once(known_elements):
        for name in TAGS[element.tag].required:
            if not (element.get(name) or "").strip():
                # a header without units is read as metres and radians, the only ones there are
                severity: Severity | None = "warning" if element.tag == wk("map") else None
                said = {"format": FORMAT, "units": UNITS}.get(name, "...")
                yield Problem(element, f"<{element.name}> has no {name}", f'add {name}="{said}"', severity=severity)


def s040_units(context: Context) -> Iterator[Problem]:
    """The header declares other units than metres and radians.

    URDF has no others: whatever the header says, every reader takes the numbers as metres and radians.

    Bad: <wk:map format="1.0" units="ft deg"/>
    Good: <wk:map format="1.0" units="m rad"/>
    """
    header = context.root.find(wk("map"))
    units = header.get("units") if header else None
    if header and units and units.split() != UNITS.split():
        attribute = header.attribute("units")
        edits = (attribute.replaced_by(UNITS),) if attribute else ()
        hint = 'if the numbers are metres and radians write units="m rad"; else convert them (`wallkit map scale`)'
        yield Problem(header.spot("units"), f"units=\"{units}\", but a map is in '{UNITS}'", hint, edits=edits)


def s041_version(context: Context) -> Iterator[Problem]:
    """The file is written in a newer format than this program knows.

    Bad: <wk:map format="2.0" units="m rad"/>
    Good: <wk:map format="1.0" units="m rad"/>
    """
    header = context.root.find(wk("map"))
    text = header.get("format") if header else None
    if header and text:
        version = _VERSION.fullmatch(text)
        known = tuple(int(number) for number in FORMAT.split("."))
        if version is None:
            yield Problem(header.spot("format"), f"format '{text}' is not a version", f'format="{FORMAT}"')
        elif tuple(int(number) for number in version.groups()) > known:
            message = f"the map has format {text}, this program reads {FORMAT}"
            yield Problem(header.spot("format"), message, "use a newer wallkit")
    for element in context.root.iter():
        newer = _NEWER_NAMESPACE.fullmatch(element.namespace)
        if newer and element.namespace != wk("")[1:-1]:
            yield Problem(
                element, f"namespace '{element.namespace}' is of another format", f"this program reads {FORMAT}"
            )
            return


def s042_level(context: Context) -> Iterator[Problem]:
    """One level of several does not say which, or how high it lies.

    Bad: in a set of maps, <wk:map format="1.0" units="m rad"/>
    Good: in a set of maps, <wk:map format="1.0" units="m rad" level="2" elevation="4.2"/>
    """
    header = context.root.find(wk("map"))
    if context.in_set and context.root.tag == "robot":
        for name in ("level", "elevation"):
            if header is None or not header.get(name):
                yield Problem(
                    header or context.root, f"the map is one of a set but has no {name}", f'<wk:map {name}="...">'
                )


# -------------------------------------------------------------------------------------------- details


def _numeric_attributes(context: Context) -> Iterator[tuple[Element, str, str, Value]]:
    for element in context.once(known_elements):
        known = TAGS[element.tag].attributes
        for name, text in element.attrs.items():
            value = known.get(name)
            # an empty required attribute is missing (WK-S032)
            if (
                value is not None
                and value.kind in ("numbers", "pairs")
                and (text.strip() or name not in TAGS[element.tag].required)
            ):
                yield element, name, text, value


def _troubled(context: Context, *whats: Complaint) -> Iterator[Malformed]:
    return (bad for bad in context.once(malformed_numbers) if bad.trouble.what in whats)


def _problem(bad: Malformed, message: str, hint: str) -> Problem:
    attribute = bad.element.attribute(bad.name)
    edits: tuple[Edit, ...] = ()
    if attribute and bad.trouble.repaired and numbers_from_text(bad.trouble.repaired, bad.value.count):
        edits = (attribute.replaced_by(bad.trouble.repaired),)
    return Problem(attribute or bad.element, f"{bad.name} of <{bad.element.name}> {message}", hint, edits=edits)


def wrong_word(value: Value, text: str) -> tuple[str, str] | None:
    """What is wrong with a word and what to write, or None."""
    if value.kind == "choice" and text not in value.choices:
        return "not a word it knows", closest(text, value.choices)
    if value.kind == "boolean" and text not in ("true", "false"):
        return "neither true nor false", 'write "true" or "false"'
    if value.kind == "integers" and not integers_from_text(text):
        return "no list of whole numbers", 'for example "3" or "3 4"'
    if value.kind == "date" and date_from_text(text) is None:
        return "no date", "write it as 2026-12-31"
    return None


RULES = (
    Rule("WK-S017", "error", s017_word, blocks=False),
    Rule("WK-S020", "error", s020_one_shape),
    Rule("WK-S021", "error", s021_number),
    Rule("WK-S022", "error", s022_not_finite),
    Rule("WK-S023", "error", s023_comma, fix="safe"),
    Rule("WK-S024", "error", s024_unit_suffix, fix="moderate"),
    Rule("WK-S025", "info", s025_decimals),
    Rule("WK-S030", "error", s030_joint_type),
    Rule("WK-S031", "error", s031_joint_ends),
    Rule("WK-S032", "error", s032_required),
    Rule("WK-S040", "error", s040_units, fix="moderate"),
    Rule("WK-S041", "error", s041_version),
    Rule("WK-S042", "warning", s042_level),
)
