"""Reparent and remove: what an element hangs on, and elements taken out with every reference to them."""

from __future__ import annotations

from collections.abc import Collection, Iterator

from wallkit.maps.document import Edit
from wallkit.maps.draft.xml import numbers_text
from wallkit.maps.edit.changes import Changes, removed, with_attribute, without_attribute
from wallkit.maps.edit.lookup import joint_above, link_named, refuse
from wallkit.maps.edit.place import placed_anew
from wallkit.maps.nouns import Joint
from wallkit.maps.rules.base import Context


def reparent(context: Context, name: str, parent: str) -> Changes:
    """An element hung on another one, in the same place of the map.

    Raises:
        MapError: one of them does not exist, the parent hangs on the element itself, or it fills an opening.
    """
    joint = joint_above(context, name)
    link_named(context, parent)
    if parent in context.map.subtree(name):
        raise refuse(context, f"'{parent}' hangs on '{name}' itself", "name something that does not")
    for opening in context.map.links[joint.parent].openings if joint.parent in context.map.links else ():
        if opening.fill == name and parent != joint.parent:
            message = f"'{name}' fills opening '{opening.id}' of '{joint.parent}': it cannot hang elsewhere"
            raise refuse(context, message, f"wallkit map fill {context.document.source} {opening.id}")
    element = joint.element.find("parent")
    attribute = element.attribute("link") if element is not None else None
    if attribute is None or parent == joint.parent:
        return Changes(said=(f"{name}: hangs on {parent} as it did",))
    changes = placed_anew(context, joint, context.poses[name], parent=parent)
    place = numbers_text(tuple(context.poses[name][:3, 3].tolist()))
    said = f"{name}: hangs on {joint.parent} -> {parent}, at {place} in the map as before"
    return Changes((attribute.replaced_by(parent), *changes.edits), (said,))


def remove(context: Context, name: str, *, recursive: bool = False) -> Changes:
    """An element taken out with its joint and all references to it; or a room, an opening's declaration, or a class.

    Raises:
        MapError: nothing has that name, other elements hang on it (without `recursive`), or it is still needed.
    """
    is_class = any(info.name == name for info in context.map.all_classes)
    if name in context.map.links or not (is_class or name in context.map.rooms):
        return _link_removed(context, name, recursive=recursive)
    if name in context.map.rooms:
        return _room_removed(context, name)
    used = [link.name for link in context.map.links.values() if link.class_name == name]
    if used:
        raise refuse(context, f"{len(used)} elements are of class '{name}', as {used[0]}", "give them another class")
    element = next(info.element for info in context.map.all_classes if info.name == name)
    return Changes((removed(element),) if element is not None else (), (f"class {name}: removed",))


def links_removed(context: Context, names: Collection[str]) -> Changes:
    """Links taken out with their joints, and the <mimic> of joints that followed one of those; openings are left alone."""
    joints = [joint for joint in context.map.all_joints if joint.child in names]
    edits = [removed(context.map.links[name].element) for name in names]
    edits += [removed(joint.element) for joint in joints]
    said = [f"{name}: removed ({context.map.links[name].class_name or 'no class'})" for name in names]
    for joint in _followers(context, {joint.name for joint in joints}, names):
        if joint.mimic is not None:
            edits.append(removed(joint.mimic.element))
            said.append(f"joint {joint.name}: no longer follows {joint.mimic.joint}")
    return Changes(tuple(edits), tuple(said))


# ------------------------------------------------------------------------------------------------- details


def _link_removed(context: Context, name: str, *, recursive: bool) -> Changes:
    link_named(context, name)
    if name == context.map.root:
        raise refuse(context, f"'{name}' is what everything hangs on", "remove single elements")
    gone = context.map.subtree(name)
    if len(gone) > 1 and not recursive:
        listed = ", ".join(f"'{child}'" for child in gone[1:4]) + (
            f" and {len(gone) - 4} more" if len(gone) > 4 else ""
        )
        hint = "add --recursive to remove them too, or hang them elsewhere with `wallkit map reparent`"
        raise refuse(context, f"{listed} hang{'s' * (len(gone) == 2)} on '{name}'", hint)
    changes = links_removed(context, gone)
    for wall in context.map.links.values():
        for opening in wall.openings if wall.name not in gone else ():
            if opening.fill in gone:
                said = f"opening {opening.id} of {wall.name}: no longer filled"
                changes += Changes(without_attribute(opening.element, "fill"), (said,))
    return changes


def _followers(context: Context, joints: Collection[str], gone: Collection[str]) -> Iterator[Joint]:
    for joint in context.map.all_joints:
        if joint.mimic is not None and joint.mimic.joint in joints and joint.child not in gone:
            yield joint


def _room_removed(context: Context, name: str) -> Changes:
    edits: list[Edit] = [removed(context.map.rooms[name].element)]
    said = [f"room {name}: removed"]
    for link in context.map.links.values():
        if link.semantics is None:
            continue
        for key, names in (("connects", link.connects), ("separates", link.separates), ("room", (link.room,))):
            if name not in names:
                continue
            # a door that connects one room is nothing anybody can use
            left = [word for word in names if word != name] if key == "separates" else []
            edits += (
                (with_attribute(link.semantics, key, " ".join(left)),)
                if left
                else without_attribute(link.semantics, key)
            )
            said.append(f"{link.name}: {key} {' '.join(names)} -> {' '.join(left) or 'nothing'}")
    return Changes(tuple(edits), tuple(said))
