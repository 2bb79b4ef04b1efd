"""Rename: a link, joint, room, class or opening under another name, and every reference to it."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping

from wallkit.errors import closest
from wallkit.maps.classes import class_from_name
from wallkit.maps.document import Element
from wallkit.maps.edit.changes import Changes
from wallkit.maps.edit.lookup import check_new, link_named, opening_named, refuse
from wallkit.maps.names import KINDS, Kind, edits_of_names, edits_of_words
from wallkit.maps.rules.base import Context


def rename(context: Context, old: str, new: str, kind: Kind | None = None) -> Changes:
    """A thing under another name everywhere.

    With a link go the names that are made of its own by convention: parts `link.part`, joints `at_link`, `link_hinge` and
    `link_slide`; with an opening the parts `wall.opening_head` and `wall.opening_sill`.

    Raises:
        MapError: nothing has the name, several kinds of things have it (without `kind`), or the new name is taken.
    """
    kinds = [kind] if kind else _kinds_of(context, old)
    if len(kinds) > 1:
        raise refuse(context, f"'{old}' names a {' and a '.join(kinds)}", f"say which: --kind {kinds[0]}")
    if not kinds:
        names = {**context.map.links, **context.map.joints, **context.map.rooms}
        raise refuse(context, f"nothing is named '{old}'", closest(old, names))
    found = kinds[0]
    _check_free(context, found, old, new)
    renames: dict[Kind, Mapping[str, str]] = {found: {old: new}}
    if found == "link":
        link_named(context, old)
        renames["joint"] = _joints_of(context, old, new)
        check_new(context, new, *renames["joint"].values())
    found_edits = list(edits_of_names(context.root, renames))
    edits, count = [edit for _, edit in found_edits], sum(one == found for one, _ in found_edits)
    parts = _part_names(context, found, old, new)
    edits += [
        edit for element, name in parts for edit in edits_of_words(element, "name", {element.get("name") or "": name})
    ]
    also = [f"joint {a} -> {b}" for a, b in renames.get("joint", {}).items() if found == "link"]
    also += [f"{len(parts)} part{'s' * (len(parts) > 1)}"] if parts else []
    said = [f"{found} {old} -> {new}: {count} place{'s' * (count != 1)}" + "".join(f", {one}" for one in also)]
    said += _inferred(context, found, old, new)
    return Changes(tuple(edits), tuple(said))


# ------------------------------------------------------------------------------------------------- details


def _kinds_of(context: Context, name: str) -> list[Kind]:
    semantic_map = context.map
    openings = {opening.id for link in semantic_map.links.values() for opening in link.openings}
    classes = {info.name for info in semantic_map.all_classes} | {link.class_name for link in semantic_map.all_links}
    known: tuple[Collection[str], ...] = (
        semantic_map.links,
        semantic_map.joints,
        semantic_map.rooms,
        classes,
        openings,
    )
    return [kind for kind, names in zip(KINDS, known, strict=True) if name in names]


def _check_free(context: Context, kind: Kind, old: str, new: str) -> None:
    if kind not in _kinds_of(context, old):
        raise refuse(context, f"there is no {kind} '{old}'", f"'{old}' is a {' or a '.join(_kinds_of(context, old))}")
    if kind == "link" and old == context.map.root:
        raise refuse(context, f"'{old}' is the map's root", "its name is part of the format")
    if kind == "class" and not any(info.name == old for info in context.map.all_classes):
        message = f"class '{old}' is the taxonomy's, not the map's"
        raise refuse(context, message, f"wallkit map add class {context.document.source} {new}")
    if kind == "opening":
        opening_named(context, old)
    if kind not in ("link", "joint"):
        if kind in _kinds_of(context, new):
            raise refuse(context, f"there is a {kind} '{new}' already", "choose another name")
        if not re.fullmatch(r"[A-Za-z_][\w.-]*", new, re.ASCII):
            raise refuse(context, f"'{new}' is no name", "a letter, then letters, digits, '_', '.' or '-'")
    elif kind == "joint":
        check_new(context, new)


def _joints_of(context: Context, old: str, new: str) -> dict[str, str]:
    """Joints whose names are made of a link's, and what they become."""
    joints = [joint for joint in context.map.all_joints if joint.child == old]
    patterns = {f"at_{old}": f"at_{new}", f"{old}_hinge": f"{new}_hinge", f"{old}_slide": f"{new}_slide"}
    return {joint.name: patterns[joint.name] for joint in joints if joint.name in patterns}


def _part_names(context: Context, kind: Kind, old: str, new: str) -> list[tuple[Element, str]]:
    """Collisions and visuals whose names are made of the old one, and what they become."""
    if kind == "link":
        elements = [link.element for link in context.map.all_links if link.name == old]
        pattern, becomes = re.compile(rf"{re.escape(old)}\.(.*)"), f"{new}."
    elif kind == "opening":
        wall, _ = opening_named(context, old)
        elements = [wall.element]
        pattern, becomes = re.compile(rf"{re.escape(wall.name)}\.{re.escape(old)}_(.*)"), f"{wall.name}.{new}_"
    else:
        return []
    parts = [child for element in elements for child in element.children if child.tag in ("collision", "visual")]
    matches = [(part, pattern.fullmatch(part.get("name") or "")) for part in parts]
    return [(part, becomes + match[1]) for part, match in matches if match]


def _inferred(context: Context, kind: Kind, old: str, new: str) -> list[str]:
    """What becomes of a class that only the name told."""
    link = context.map.links.get(old) if kind == "link" else None
    if link is None or not link.class_is_inferred or not link.class_name or class_from_name(new) == link.class_name:
        return []
    return [f"{new}: its class was guessed from its name ({link.class_name}), now {class_from_name(new) or 'none'}"]
