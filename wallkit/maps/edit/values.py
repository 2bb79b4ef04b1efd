"""Set: attributes of an element, room, class, opening or of the map itself, checked as the format wants them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from wallkit.errors import closest
from wallkit.maps.document import Edit, Element, wk
from wallkit.maps.draft.xml import attributes
from wallkit.maps.edit.changes import Changes, inserted_behind, inserted_first, with_attribute, without_attribute
from wallkit.maps.edit.lookup import class_named, refuse, room_named
from wallkit.maps.grammar import TAGS, Value
from wallkit.maps.model import MAP_LINK
from wallkit.maps.nouns import Link
from wallkit.maps.numbers import trouble_in
from wallkit.maps.read import prior_from_text
from wallkit.maps.rules.base import Context
from wallkit.maps.rules.doors import STATES
from wallkit.maps.rules.rooms import OUTSIDE
from wallkit.maps.rules.values import wrong_word

# what other verbs set, because more than one attribute changes then
_ELSEWHERE: Mapping[tuple[str, str], str] = {
    (wk("opening"), "along"): "wallkit map move",
    (wk("opening"), "z"): "wallkit map fill, then cut",
    (wk("opening"), "id"): "wallkit map rename",
    (wk("room"), "id"): "wallkit map rename",
    (wk("class"), "name"): "wallkit map rename",
    (wk("map"), "units"): "wallkit map scale",
    (wk("map"), "format"): "wallkit map fmt",
}


def set_values(context: Context, name: str, values: Mapping[str, str]) -> Changes:
    """Attributes of what has a name: an element (and its joint), a room, class or opening, or `map` for the header.

    An empty value takes the attribute out.

    Raises:
        MapError: nothing has the name, there is no such attribute, or a value is not what the format wants.
    """
    changes = Changes()
    merged: dict[int, Edit] = {}
    for key, value in values.items():
        element, target = _target(context, name, key)
        text = " ".join(value.split())
        _check(context, target, key, text, name)
        before = element.get(key) if element is not None else None
        if before == text or (before is None and not text):
            changes += Changes(said=(f"{name}: {key} is {before or 'not set'} already",))
            continue
        changes += Changes(said=(f"{name}: {key} {before or 'nothing'} -> {text or 'nothing'}",))
        if element is None:
            changes += Changes(_new_element(context, name, target, key, text))
            continue
        for edit in (with_attribute(element, key, text),) if text else without_attribute(element, key):
            # two new attributes of one element go to the same place
            one = merged.get(edit.offset) if edit.length == 0 else None
            merged[edit.offset] = Edit(edit.offset, edit.length, (one.text if one else b"") + edit.text)
    return changes + Changes(tuple(merged.values()))


# ------------------------------------------------------------------------------------------------- details


def _target(context: Context, name: str, key: str) -> tuple[Element | None, str]:
    """The element that holds an attribute, None where it is still to be made, and its tag."""
    candidates = list(_candidates(context, name))
    if not candidates:
        openings = [o.id for link in context.map.links.values() for o in link.openings]
        known = [*context.map.links, *context.map.rooms, *openings, *(row.name for row in context.map.all_classes)]
        raise refuse(context, f"nothing is named '{name}'", closest(name, known))
    for element, tag in candidates:
        if key in TAGS[tag].attributes:
            if verb := _ELSEWHERE.get((tag, key)):
                raise refuse(context, f"{key} of '{name}' is not set alone", verb)
            return element, tag
    keys = sorted({key for _, tag in candidates for key in TAGS[tag].attributes})
    raise refuse(context, f"'{name}' has no attribute '{key}'", closest(key, keys))


def _candidates(context: Context, name: str) -> Iterator[tuple[Element | None, str]]:
    semantic_map = context.map
    link = semantic_map.links.get(name)
    if name == MAP_LINK:
        header = semantic_map.header.element
        yield header, wk("map")
        check = next(
            (place.find(wk("check")) for place in (context.root, header) if place and place.find(wk("check"))), None
        )
        yield check, wk("check")
    elif link is not None:
        yield link.semantics, wk("object")
        joint = semantic_map.parent_joint(name)
        if joint is not None and joint.is_movable:
            yield joint.element.find("limit"), "limit"
            yield joint.element.find(wk("state")), wk("state")
    if name in semantic_map.rooms:
        yield semantic_map.rooms[name].element, wk("room")
    yield from ((row.element, wk("class")) for row in semantic_map.all_classes if row.name == name)
    for wall in semantic_map.links.values():
        yield from ((opening.element, wk("opening")) for opening in wall.openings if opening.id == name)


def _check(context: Context, tag: str, key: str, text: str, name: str) -> None:
    """Refuse a value that the format does not have, or that names what is not there."""
    if not text:
        if key in TAGS[tag].required:
            raise refuse(context, f"'{name}' cannot do without {key}", f"give it a value: {key}=...")
        return
    value = TAGS[tag].attributes[key]
    wrong = _wrong_numbers(value, text) if value.kind in ("numbers", "pairs") else wrong_word(value, text)
    if wrong:
        raise refuse(context, f"{key}={text}: it is {wrong[0]}", wrong[1])
    if tag == wk("object"):
        if key == "class":
            class_named(context, text)
        for room in text.split() if key in ("room", "connects", "separates") else ():
            if room != OUTSIDE or key == "room":
                room_named(context, room)
    if key == "prior":
        prior = prior_from_text(text) or {}
        if set(prior) - set(STATES) or abs(sum(prior.values()) - 1) > context.tolerances.prior_sum:
            message = f"prior={text} is no distribution over {', '.join(STATES)}"
            raise refuse(context, message, "for example prior='closed:0.7 open:0.2 unknown:0.1'")
    if key == "p_return" and not 0 <= float(text) <= 1:
        raise refuse(context, f"p_return={text}", "a probability, from 0 to 1")
    if key == "sigma" and float(text) < 0:
        raise refuse(context, f"sigma={text}", "a standard deviation is not negative")


def _wrong_numbers(value: Value, text: str) -> tuple[str, str] | None:
    """What is wrong with numbers and what to write, or None."""
    trouble = trouble_in(text, value.count, largest=value.largest)
    found = len(text.split())
    if trouble is None and value.kind == "pairs" and (found % 2 or found < 6):
        return f"{found} numbers", "at least three pairs: X Y  X Y  X Y"
    if trouble is None:
        return None
    wanted = f"{value.count or 'pairs of'} number{'s' * (value.count != 1)}"
    if trouble.what == "count":
        return f"{trouble.found} numbers", f"it wants {wanted}"
    return (
        f"not {wanted}: '{trouble.word}'",
        f"for example {trouble.repaired}" if trouble.repaired else "metres, radians",
    )


def _new_element(context: Context, name: str, tag: str, key: str, text: str) -> tuple[Edit, ...]:
    """Edits that make the element that an attribute is missing for."""
    link: Link | None = context.map.links.get(name)
    if tag == wk("object") and link is not None:
        class_name = text if key == "class" else link.class_name
        if not class_name:
            raise refuse(context, f"'{name}' has no class yet", "set that first: class=...")
        words = {"class": class_name} | ({} if key == "class" else {key: text})
        return inserted_first(link.element, [f"<wk:object{attributes(**words)}/>"])
    joint = context.map.parent_joint(name)
    if tag == wk("state") and joint is not None:
        return inserted_behind(joint.element.children[-1], [f"<wk:state{attributes(**{key: text})}/>"])
    if tag == wk("check") and context.map.header.element is not None:
        return inserted_first(context.map.header.element, [f"<wk:check{attributes(**{key: text})}/>"])
    hint = f"wallkit map adopt {context.document.source}" if name == MAP_LINK else "write it by hand"
    raise refuse(context, f"'{name}' has no <{tag.rpartition('}')[2]}> to hold {key}", hint)
