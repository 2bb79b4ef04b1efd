"""Single faults of a map file, each with the rule that must notice it.

A fault takes a generator and a parsed clean map and gives the edits that break it, or None where the map has nothing of
the kind to break. `python -m tests.maps.faults` prints how many of each are noticed.
"""

from __future__ import annotations

import difflib
import itertools
import math
import sys
import zlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from tests.maps.drawn import LOCALISABILITY
from tests.maps.faults_of_use import FAULTS_OF_USE
from tests.maps.random_maps import clean_map
from wallkit.maps.document import Document, Edit, Element, apply_edits, wk
from wallkit.maps.rules import validate
from wallkit.maps.xml import parse

Edits = list[Edit] | None
Breaker = Callable[[np.random.Generator, Document], Edits]

# -------------------------------------------------------------------------------------------- finding things


def _all(document: Document, tag: str) -> list[Element]:
    assert document.root is not None
    return [element for element in document.root.iter() if element.tag == tag]


def _one(rng: np.random.Generator, elements: Sequence[Element]) -> Element | None:
    return elements[int(rng.integers(len(elements)))] if elements else None


def _links(document: Document, *classes: str) -> list[Element]:
    def class_of(link: Element) -> str | None:
        said = link.find(wk("object"))
        return said.get("class") if said else None

    return [link for link in _all(document, "link") if class_of(link) in classes]


def _joint_of(document: Document, link: Element) -> Element:
    name = link.get("name")
    return next(j for j in _all(document, "joint") if (child := j.find("child")) and child.get("link") == name)


def _boxes(link: Element) -> list[Element]:
    return [box for box in link.iter() if box.tag == "box"]


def _numbers(element: Element, attribute: str) -> list[float]:
    return [float(word) for word in (element.get(attribute) or "").split()]


def _set(element: Element, attribute: str, value: str | Sequence[float]) -> Edit:
    found = element.attribute(attribute)
    assert found is not None, (element, attribute)
    return found.replaced_by(value if isinstance(value, str) else " ".join(f"{v:.6f}" for v in value))


def _insert(offset: int, text: str) -> Edit:
    return Edit(offset, 0, text.encode())


def _drop(element: Element) -> Edit:
    return Edit(element.span.offset, element.span.end - element.span.offset, b"")


def _sign(rng: np.random.Generator) -> float:
    return float(rng.choice([-1.0, 1.0]))


# ------------------------------------------------------------------------------------------- makers of faults


def word(rule_tag: str, attribute: str, value: str, *, classes: tuple[str, ...] = ()) -> Breaker:
    """An attribute of some element gets another word."""

    def breaker(rng: np.random.Generator, document: Document) -> Edits:
        inside = [e for link in _links(document, *classes) for e in link.iter()] if classes else None
        found = [e for e in (inside or _all(document, rule_tag)) if e.tag == rule_tag and e.get(attribute)]
        element = _one(rng, found)
        return [_set(element, attribute, value)] if element else None

    return breaker


def respelled(tag: str, attribute: str, change: Callable[[str, np.random.Generator], str]) -> Breaker:
    """An attribute's text is written in another way."""

    def breaker(rng: np.random.Generator, document: Document) -> Edits:
        element = _one(rng, [e for e in _all(document, tag) if e.get(attribute)])
        if element is None:
            return None
        found = element.attribute(attribute)
        assert found is not None
        # as bytes, so that a change can also bring quotes and tags
        span = found.value_span
        return [Edit(span.offset, span.end - span.offset, change(found.value, rng).encode())]

    return breaker


def lacking(tag: str, attribute: str) -> Breaker:
    """An attribute is gone."""

    def breaker(rng: np.random.Generator, document: Document) -> Edits:
        element = _one(rng, [e for e in _all(document, tag) if e.get(attribute)])
        if element is None:
            return None
        span = element.attribute(attribute).span
        return [Edit(span.offset, span.end - span.offset, b"")]

    return breaker


def without(tag: str, parents: tuple[str, ...] = ()) -> Breaker:
    """An element is gone."""

    def breaker(rng: np.random.Generator, document: Document) -> Edits:
        found = [e for e in _all(document, tag) if not parents or (e.parent and e.parent.tag in parents)]
        element = _one(rng, found)
        return [_drop(element)] if element else None

    return breaker


def within(tag: str, text: str) -> Breaker:
    """Text is put right behind an element's start tag."""

    def breaker(rng: np.random.Generator, document: Document) -> Edits:
        element = _one(rng, [e for e in _all(document, tag) if not e.is_empty_tag])
        return [_insert(element.start_span.end, text)] if element else None

    return breaker


def before(tag: str, text: str | bytes) -> Breaker:
    """Bytes are put before an element."""

    def breaker(rng: np.random.Generator, document: Document) -> Edits:
        element = _one(rng, _all(document, tag))
        data = text.encode() if isinstance(text, str) else text
        return [Edit(element.offset, 0, data)] if element else None

    return breaker


def sized(axis: int, change: Callable[[float, np.random.Generator], float], *classes: str) -> Breaker:
    """One side of a box gets another length."""

    def breaker(rng: np.random.Generator, document: Document) -> Edits:
        box = _one(rng, [box for link in _links(document, *classes) for box in _boxes(link)])
        if box is None:
            return None
        size = _numbers(box, "size")
        size[axis] = change(size[axis], rng)
        return [_set(box, "size", size)]

    return breaker


def door(tag: str, attribute: str, change: Callable[[list[float], np.random.Generator], list[float]]) -> Breaker:
    """A number of a hinged door's joint, or of its leaf, changes."""

    def breaker(rng: np.random.Generator, document: Document) -> Edits:
        hinges = [joint for joint in _all(document, "joint") if joint.get("type") == "revolute"]
        joint = _one(rng, hinges)
        if joint is None:
            return None
        link = next(e for e in _links(document, "door") if e.get("name") == joint.find("child").get("link"))
        where = joint.find(tag) or next(e for e in link.iter() if e.tag == tag)
        return [_set(where, attribute, change(_numbers(where, attribute), rng))]

    return breaker


def moved(classes: tuple[str, ...], by: Callable[[np.random.Generator], Sequence[float]]) -> Breaker:
    """What hangs on a wall is moved in its own frame: +x is into the room."""

    def breaker(rng: np.random.Generator, document: Document) -> Edits:
        link = _one(rng, _links(document, *classes))
        if link is None:
            return None
        origin = _joint_of(document, link).find("origin")
        assert origin is not None
        yaw = _numbers(origin, "rpy")[2] if origin.get("rpy") else 0.0
        x, y, z = by(rng)
        c, s = math.cos(yaw), math.sin(yaw)
        at = np.array(_numbers(origin, "xyz")) + (c * x - s * y, s * x + c * y, z)
        return [_set(origin, "xyz", at.tolist())]

    return breaker


# ------------------------------------------------------------------------------------------- single ones


def unclosed(rng: np.random.Generator, document: Document) -> Edits:
    element = _one(rng, [e for e in _all(document, "link") if not e.is_empty_tag])
    assert element is not None
    return [Edit(element.close, element.span.end - element.close, b"")]


def second_parent(rng: np.random.Generator, document: Document) -> Edits:
    link = _one(rng, _links(document, "wall", "furniture"))
    assert link is not None
    text = f'<joint name="again" type="fixed"><parent link="map"/><child link="{link.get("name")}"/></joint>'
    return [_insert(link.span.end, text)]


def same_name(tag: str) -> Breaker:
    def breaker(rng: np.random.Generator, document: Document) -> Edits:
        found = _all(document, tag)
        a, b = (found[int(k)] for k in rng.choice(len(found), 2, replace=False))
        return [_set(a, "name", b.get("name") or "")]

    return breaker


def circle(rng: np.random.Generator, document: Document) -> Edits:
    """A wall hangs on what hangs on it."""
    joints = [j for j in _all(document, "joint") if j.find("parent").get("link") not in ("map", None)]
    joint = _one(rng, joints)
    if joint is None:
        return None
    wall, child = joint.find("parent").get("link"), joint.find("child").get("link")
    above = next(j for j in _all(document, "joint") if j.find("child").get("link") == wall)
    return [_set(above.find("parent"), "link", child or "")]


def orphan(rng: np.random.Generator, document: Document) -> Edits:
    joint = _one(rng, [j for j in _all(document, "joint") if j.get("type") == "fixed"])
    assert joint is not None
    return [_drop(joint)]


def corner_gap(rng: np.random.Generator, document: Document) -> Edits:
    """An outer wall without openings becomes 14 to 28 cm shorter."""
    walls = [w for w in _links(document, "wall") if len(_boxes(w)) == 1 and _boxes(w)[0].get("size")]
    walls = [w for w in walls if w.get("name") in ("west", "east")]
    wall = _one(rng, walls)
    assert wall is not None
    box = _boxes(wall)[0]
    # its end may lie as deep in the other wall as that is thick
    size, short = _numbers(box, "size"), float(rng.uniform(0.14, 0.28))
    centre = next(e for e in wall.iter() if e.tag == "origin")
    at = _numbers(centre, "xyz")
    return [_set(box, "size", [size[0] - short, *size[1:]]), _set(centre, "xyz", [at[0] - short / 2, *at[1:]])]


def thick_wall(rng: np.random.Generator, document: Document) -> Edits:
    """Not the piece above a door, which would rather be a beam across it."""
    box = _one(rng, [b for wall in _links(document, "wall") for b in _boxes(wall) if _numbers(b, "size")[0] > 2.0])
    assert box is not None
    x, _, z = _numbers(box, "size")
    return [_set(box, "size", [x, float(rng.uniform(0.9, 1.4)), z])]


def raised(rng: np.random.Generator, document: Document) -> Edits:
    wall = _one(rng, _links(document, "wall"))
    assert wall is not None
    origin = _joint_of(document, wall).find("origin")
    assert origin is not None
    x, y, _ = _numbers(origin, "xyz")
    return [_set(origin, "xyz", [x, y, float(rng.uniform(0.05, 0.5))])]


def wall_in_mm(rng: np.random.Generator, document: Document) -> Edits:
    wall = _one(rng, [w for w in _links(document, "wall") if len(_boxes(w)) == 1])
    if wall is None:
        return None
    box = _boxes(wall)[0]
    centre = next(e for e in wall.iter() if e.tag == "origin")
    return [_set(e, key, [1000 * v for v in _numbers(e, key)]) for e, key in ((box, "size"), (centre, "xyz"))]


def map_in_mm(rng: np.random.Generator, document: Document) -> Edits:
    factor = float(rng.choice([1000.0, 100.0, 39.37]))
    lengths = [(e, "size") for e in _all(document, "box")] + [(e, "xyz") for e in _all(document, "origin")]
    return [_set(e, key, [factor * v for v in _numbers(e, key)]) for e, key in lengths]


def pasted_twice(rng: np.random.Generator, document: Document) -> Edits:
    link = _one(rng, _links(document, "furniture", "toilet", "sink", "radiator", "urinal"))
    if link is None:
        return None
    name, joint = link.get("name") or "", _joint_of(document, link)
    copy = document.slice(link.span) + document.slice(joint.span)
    return [_insert(joint.span.end, copy.replace(name, name + "_copy"))]


def opening_longer(rng: np.random.Generator, document: Document) -> Edits:
    """A declared window reaches into the wall beside it."""
    opening = _one(rng, [o for o in _all(document, wk("opening")) if o.get("kind") == "window"])
    if opening is None:
        return None
    x0, x1 = _numbers(opening, "along")
    return [_set(opening, "along", [x0, x1 + float(rng.uniform(0.05, 0.3))])]


def opening_outside(rng: np.random.Generator, document: Document) -> Edits:
    opening = _one(rng, _all(document, wk("opening")))
    assert opening is not None
    x0, x1 = _numbers(opening, "along")
    return [_set(opening, "along", [x0 + 50, x1 + 50])]


def opening_twice(rng: np.random.Generator, document: Document) -> Edits:
    opening = _one(rng, _all(document, wk("opening")))
    assert opening is not None
    x0, x1 = _numbers(opening, "along")
    z0, z1 = _numbers(opening, "z")
    shift = _sign(rng) * float(rng.uniform(0.1, 0.5))
    text = f'<wk:opening id="twice" kind="window" along="{x0 + shift:.3f} {x1 + shift:.3f}" z="{z0:.3f} {z1:.3f}"/>'
    return [_insert(opening.span.end, text)]


def filled_twice(rng: np.random.Generator, document: Document) -> Edits:
    walls = [w for w in _links(document, "wall") if len([o for o in w.findall(wk("opening")) if o.get("fill")]) > 1]
    wall = _one(rng, walls)
    if wall is None:
        return None
    a, b = wall.findall(wk("opening"))[:2]
    return [_set(b, "fill", a.get("fill") or "")]


def hinge_inside(rng: np.random.Generator, document: Document) -> Edits:
    """Hinge and leaf lie in the middle of the wall, so that the leaf cuts into the jamb."""
    joint = _one(rng, [j for j in _all(document, "joint") if j.get("type") == "revolute"])
    if joint is None:
        return None
    name = joint.find("child").get("link")
    leaf = next(link for link in _links(document, "door") if link.get("name") == name)
    edits = []
    for origin in (joint.find("origin"), next(e for e in leaf.iter() if e.tag == "origin")):
        assert origin is not None
        x, _, z = _numbers(origin, "xyz")
        edits.append(_set(origin, "xyz", [x, 0.0, z]))
    return edits


def walled_up(rng: np.random.Generator, document: Document) -> Edits:
    """A door becomes wall: its opening, leaf and joint go, a box takes their place."""
    opening = _one(rng, [o for o in _all(document, wk("opening")) if o.get("kind") == "door"])
    if opening is None:
        return None
    leaf = next(e for e in _links(document, "door") if e.get("name") == opening.get("fill"))
    (x0, x1), (_, z1) = _numbers(opening, "along"), _numbers(opening, "z")
    box = (
        f'<collision name="filled"><origin xyz="{(x0 + x1) / 2:.6f} 0 {z1 / 2:.6f}"/>'
        f'<geometry><box size="{x1 - x0:.6f} 0.12 {z1:.6f}"/></geometry></collision>'
    )
    assert opening.parent is not None
    return [_drop(opening), _drop(leaf), _drop(_joint_of(document, leaf)), _insert(opening.parent.close, box)]


def bow_tie(rng: np.random.Generator, document: Document) -> Edits:
    room = _one(rng, _all(document, wk("room")))
    assert room is not None
    p = _numbers(room, "floor")
    return [_set(room, "floor", [*p[0:2], *p[4:6], *p[2:4], *p[6:8]])]


def room_too_large(rng: np.random.Generator, document: Document) -> Edits:
    """A room's floor, grown by half about its middle, reaches into its neighbours."""
    room = _one(rng, _all(document, wk("room")))
    assert room is not None
    corners = np.array(_numbers(room, "floor")).reshape(-1, 2)
    grown = corners.mean(axis=0) + 1.5 * (corners - corners.mean(axis=0))
    return [_set(room, "floor", grown.ravel().tolist())]


def same_room(rng: np.random.Generator, document: Document) -> Edits:
    leaf = _one(rng, _links(document, "door"))
    assert leaf is not None
    said = leaf.find(wk("object"))
    room = (said.get("connects") or "").split()[1]
    return [_set(said, "connects", f"{room} {room}")]


def other_room(rng: np.random.Generator, document: Document) -> Edits:
    """A door says that it leads into a room that it does not lead into."""
    leaf = _one(rng, _links(document, "door"))
    assert leaf is not None
    said = leaf.find(wk("object"))
    rooms = [room.get("id") or "" for room in _all(document, wk("room"))]
    right = (said.get("connects") or "").split()
    wrong = str(rng.choice([room for room in rooms if room not in right]))
    return [_set(said, "connects", f"{right[0]} {wrong}")]


def _typo(text: str, rng: np.random.Generator) -> str:
    """Two letters swapped, or one left out."""
    k = int(rng.integers(len(text) - 1))
    swapped = text[:k] + text[k + 1] + text[k] + text[k + 2 :]
    return swapped if swapped != text and rng.random() < 0.5 else text[:k] + text[k + 1 :]


def _one_number(change: Callable[[str, np.random.Generator], str]) -> Callable[[str, np.random.Generator], str]:
    def changed(text: str, rng: np.random.Generator) -> str:
        words = text.split()
        k = int(rng.integers(len(words)))
        words[k] = change(words[k], rng)
        return " ".join(word for word in words if word)

    return changed


STRUCTURE = ("wall",)
ON_WALL = ("toilet", "urinal", "sink", "radiator")
ANY = ("wall", "door", "furniture", *ON_WALL)
XYZ, SIZE = ("origin", "xyz"), ("box", "size")

# name of the fault -> (rule, how it is made)
FAULTS: dict[str, tuple[str, Breaker]] = {
    "tag not closed": ("WK-X001", unclosed),
    "prefix not declared": ("WK-X002", within("link", '<wq:object class="wall"/>')),
    "latin-1 byte": ("WK-X003", before("link", b"<!-- caf\xe9 -->")),
    "doctype": ("WK-X010", lambda rng, d: [_insert(d.root.offset, '<!DOCTYPE robot [<!ENTITY a "1">]>')]),
    "instruction in the tree": ("WK-X012", within("link", "<?php echo 1 ?>")),
    "wk element misplaced": ("WK-S010", within("joint", '<wk:room id="r" floor="0 0 1 0 1 1"/>')),
    "wk element misspelled": ("WK-S011", within("link", '<wk:objekt class="wall"/>')),
    "tag misspelled": ("WK-S012", within("link", '<colision><geometry><box size="1 1 1"/></geometry></colision>')),
    "unknown attribute": ("WK-S014", respelled("child", "link", lambda t, rng: f'{t}" colour="red')),
    "two shapes": ("WK-S020", within("geometry", '<sphere radius="1"/>')),
    "a number too few": ("WK-S021", respelled(*XYZ, _one_number(lambda t, rng: ""))),
    "a letter in a number": ("WK-S021", respelled(*SIZE, _one_number(lambda t, rng: f"{t[0]}O{t[1:]}"))),
    "not a number": ("WK-S022", respelled(*SIZE, _one_number(lambda t, rng: str(rng.choice(["nan", "inf", "-inf"]))))),
    "commas": ("WK-S023", respelled(*XYZ, lambda t, rng: ", ".join(t.split()))),
    "unit behind a number": ("WK-S024", respelled(*SIZE, _one_number(lambda t, rng: t + str(rng.choice(["mm", "m"]))))),
    "joint type": ("WK-S030", word("joint", "type", "hinge")),
    "joint without child": ("WK-S031", without("child")),
    "box without size": ("WK-S032", lacking(*SIZE)),
    "units": ("WK-S040", word(wk("map"), "units", "ft rad")),
    "link name twice": ("WK-G001", same_name("link")),
    "joint name twice": ("WK-G002", same_name("joint")),
    "parent misspelled": ("WK-G004", respelled("parent", "link", _typo)),
    "two parents": ("WK-G005", second_parent),
    "orphan": ("WK-G006", orphan),
    "circle": ("WK-G007", circle),
    "no limits": ("WK-G020", without("limit")),
    "limits swapped": ("WK-G021", door("limit", "lower", lambda v, rng: [2.0 + float(rng.random())])),
    "axis zero": ("WK-G022", door("axis", "xyz", lambda v, rng: [0, 0, 0])),
    "axis not unit": ("WK-G023", door("axis", "xyz", lambda v, rng: [a * float(rng.uniform(1.1, 3)) for a in v])),
    "negative size": ("WK-E001", sized(0, lambda v, rng: -v, *ANY)),
    "zero thickness": ("WK-E002", sized(1, lambda v, rng: 0.0, *ANY)),
    "thin wall": ("WK-E003", sized(1, lambda v, rng: float(rng.uniform(0.0005, 0.004)), *STRUCTURE)),
    "thick wall": ("WK-E004", thick_wall),
    "tall wall": ("WK-E005", sized(2, lambda v, rng: float(rng.uniform(6.5, 12)), *STRUCTURE)),
    "fixture in the wall": ("WK-E010", moved(ON_WALL, lambda rng: (-rng.uniform(0.01, 0.1), 0, 0))),
    "fixture off its wall": ("WK-E012", moved(ON_WALL, lambda rng: (rng.uniform(0.03, 0.3), 0, 0))),
    "pasted twice": ("WK-E014", pasted_twice),
    "gap at a corner": ("WK-E020", corner_gap),
    "wall above the floor": ("WK-E021", raised),
    "wall in millimetres": ("WK-E040", wall_in_mm),
    "map in another unit": ("WK-E041", map_in_mm),
    "hole not cut": ("WK-O001", opening_longer),
    "opening outside its wall": ("WK-O002", opening_outside),
    "leaf too wide": ("WK-O003", door("box", "size", lambda v, rng: [v[0] + float(rng.uniform(0.04, 0.3)), *v[1:]])),
    "leaf too tall": ("WK-O004", door("box", "size", lambda v, rng: [*v[:2], v[2] + float(rng.uniform(0.05, 0.3))])),
    "openings overlap": ("WK-O005", opening_twice),
    "hole not declared": ("WK-O006", without(wk("opening"))),
    "fill misspelled": ("WK-O007", respelled(wk("opening"), "fill", _typo)),
    "filled twice": ("WK-O009", filled_twice),
    "hinge in the wall": ("WK-O010", hinge_inside),
    "limit in degrees": ("WK-O012", door("limit", "upper", lambda v, rng: [float(rng.choice([90, 95, 110, 120]))])),
    "hinge lies flat": ("WK-O013", door("axis", "xyz", lambda v, rng: [1, 0, 0])),
    "rest outside the limits": (
        "WK-O014",
        door(wk("state"), "rest", lambda v, rng: [_sign(rng) * rng.uniform(1.7, 3)]),
    ),
    "prior is no distribution": ("WK-O015", word(wk("state"), "prior", "closed:0.9 open:0.4")),
    "room walled up": ("WK-T001", walled_up),
    "bow-tie room": ("WK-T002", bow_tie),
    "room too large": ("WK-T003", room_too_large),
    "room misspelled": ("WK-T004", respelled(wk("object"), "connects", _typo)),
    "door within one room": ("WK-T005", same_room),
    "door into another room": ("WK-T006", other_room),
    "class misspelled": ("WK-C001", respelled(wk("object"), "class", _typo)),
    "no class": ("WK-C002", without(wk("object"))),
    "capsule": ("WK-P003", respelled("box", "size", lambda t, rng: f'{t}"/><capsule radius="0.1" length="1')),
    "limit without effort": ("WK-P004", lacking("limit", "effort")),
    "mesh not found": (
        "WK-P010",
        within("link", '<visual><geometry><mesh filename="no/such.stl"/></geometry></visual>'),
    ),
    "xacro left over": ("WK-P012", respelled("child", "link", lambda t, rng: "${prefix}" + t)),
}


# ------------------------------------------------------------------------------------------------- what is noticed


@dataclass(frozen=True)
class Mutant:
    """A broken map, what broke it, and the lines that differ from the clean one."""

    fault: str
    rule: str
    data: bytes
    changed_lines: frozenset[int]


def mutants(name: str, count: int, *, seed: int = 0) -> Iterator[Mutant]:
    """`count` random clean maps, each broken in the same way at a random place."""
    rule, breaker = FAULTS[name]
    made = 0
    for trial in itertools.count():
        rng = np.random.default_rng([seed, trial, zlib.crc32(name.encode())])
        clean = clean_map(rng)
        edits = breaker(rng, parse(clean, "clean"))
        if edits is not None:
            data = apply_edits(clean, edits)
            yield Mutant(name, rule, data, _changed_lines(clean, data))
            made += 1
        if made == count:
            return


def _changed_lines(before: bytes, after: bytes) -> frozenset[int]:
    a, b = before.split(b"\n"), after.split(b"\n")
    changed: set[int] = set()
    for kind, _, _, start, end in difflib.SequenceMatcher(None, a, b, autojunk=False).get_opcodes():
        if kind != "equal":
            changed.update(range(start + 1, max(end, start + 1) + 1))
    return frozenset(changed)


def main(count: int) -> None:
    """Prints, per fault: how many of `count` mutants its rule noticed, and how often it pointed at a changed line."""
    print(f"{'fault':30} {'rule':8} {'noticed':>9} {'at its line':>12}")
    noticed = total = 0
    for name in FAULTS:
        hits = there = 0
        for mutant in mutants(name, count):
            lines = {f.line for f in validate(mutant.data, ignore=LOCALISABILITY).findings if f.code == mutant.rule}
            hits += bool(lines)
            there += bool(lines & mutant.changed_lines)
        print(f"{name:30} {FAULTS[name][0]:8} {hits:>4}/{count:<4} {there:>7}/{count:<4}")
        noticed, total = noticed + hits, total + count
    for name, (rule, make) in FAULTS_OF_USE.items():
        reports = [validate(make(np.random.default_rng([7, seed]))) for seed in range(count)]
        hits = sum(any(f.code == rule for f in report.findings) for report in reports)
        print(f"{name:30} {rule:8} {hits:>4}/{count:<4}")
        noticed, total = noticed + hits, total + count
    alarms = [
        f"map {seed}: {f.code} {f.message}"
        for seed in range(count)
        for f in validate(clean_map(np.random.default_rng([1, seed])), ignore=LOCALISABILITY).findings
        if f.severity != "info"
    ]
    rules = {rule for rule, _ in (*FAULTS.values(), *FAULTS_OF_USE.values())}
    print(f"\nnoticed {noticed} of {total} ({100 * noticed / total:.1f} %) by {len(rules)} rules")
    print("\n".join([f"false alarms on {count} clean maps: {len(alarms)}", *alarms]))


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 20)
