"""A map as a tree of links and joints, and where everything is at given joint states."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, TypeVar

import numpy as np

from wallkit.core.types import Float64Array
from wallkit.errors import MapError, closest
from wallkit.maps.classes import ClassInfo
from wallkit.maps.document import Document
from wallkit.maps.nouns import Header, Joint, Link, Room

DoorPosition = Literal["rest", "open", "closed"]
MAP_LINK = "map"

Noun = TypeVar("Noun")


@dataclass(frozen=True, eq=False, repr=False)
class SemanticMap:
    """Links hanging on joints, the rooms between them, and the classes they are of; all in document order.

    Attributes:
        name: of the <robot>.
        classes: the class table: the taxonomy's classes, replaced and added to by the header's.
        all_classes: the header's <wk:class> rows. all_rooms, all_links, all_joints: as in the file, duplicates included;
            the dicts `rooms`, `links` and `joints` keep the first of a name.
    """

    document: Document
    name: str
    header: Header
    classes: Mapping[str, ClassInfo]
    all_classes: tuple[ClassInfo, ...]
    all_rooms: tuple[Room, ...]
    all_links: tuple[Link, ...]
    all_joints: tuple[Joint, ...]

    @property
    def source(self) -> str:
        """The file, for messages."""
        return self.document.source

    @cached_property
    def rooms(self) -> dict[str, Room]:
        """Rooms by id."""
        return _first_by(self.all_rooms, lambda room: room.id)

    @cached_property
    def links(self) -> dict[str, Link]:
        """Links by name."""
        return _first_by(self.all_links, lambda link: link.name)

    @cached_property
    def joints(self) -> dict[str, Joint]:
        """Joints by name."""
        return _first_by(self.all_joints, lambda joint: joint.name)

    @cached_property
    def roots(self) -> tuple[str, ...]:
        """Links that are nobody's child: one in a sound map."""
        children = {joint.child for joint in self.all_joints}
        return tuple(name for name in self.links if name not in children)

    @cached_property
    def root(self) -> str | None:
        """The link everything hangs on: "map" where it is a root, else the first root; None without any."""
        return MAP_LINK if MAP_LINK in self.roots else next(iter(self.roots), None)

    def children_of(self, link: str) -> tuple[Joint, ...]:
        """The joints whose parent is a link."""
        return tuple(self._joints_by_parent.get(link, ()))

    def parent_joint(self, link: str) -> Joint | None:
        """The joint a link hangs on (the first, where the file gives two), or None."""
        return self._joint_by_child.get(link)

    def subtree(self, link: str) -> tuple[str, ...]:
        """A link and everything that hangs on it, each once."""
        found, waiting = dict.fromkeys([link]), [link]
        while waiting:
            for joint in self.children_of(waiting.pop()):
                if joint.child not in found and joint.child in self.links:
                    found[joint.child] = None
                    waiting.append(joint.child)
        return tuple(found)

    def class_of(self, link: str) -> ClassInfo | None:
        """The class table's row for a link, or None when it has no class or an unknown one."""
        return self.classes.get(self.links[link].class_name)

    @cached_property
    def doors(self) -> tuple[Joint, ...]:
        """Movable joints that carry a door: a child of class "door", or one that fills an opening."""
        fills = {opening.fill for link in self.links.values() for opening in link.openings}
        return tuple(
            joint
            for joint in self.joints.values()
            if joint.is_movable
            and joint.child in self.links
            and (self.links[joint.child].class_name == "door" or joint.child in fills)
        )

    def door_states(self, doors: DoorPosition) -> dict[str, float]:
        """Joint states with every door at rest, open (`Joint.open`) or closed; leaves that follow another are left out."""
        leading = [joint for joint in self.doors if joint.mimic is None]
        return {joint.name: float(getattr(joint, doors)) for joint in leading}

    def joint_state(self, name: str, given: Mapping[str, float]) -> float:
        """The state of a joint: given, at rest, or as its mimic target says; NaN for mimics that follow themselves."""
        factor, offset, seen = 1.0, 0.0, {name}
        joint = self.joints[name]
        while joint.mimic is not None and joint.mimic.joint in self.joints:
            offset += factor * joint.mimic.offset
            factor *= joint.mimic.multiplier
            joint = self.joints[joint.mimic.joint]
            if joint.name in seen:
                return math.nan
            seen.add(joint.name)
        return factor * given.get(joint.name, joint.rest) + offset

    def poses(self, joint_states: Mapping[str, float] | None = None) -> dict[str, Float64Array]:
        """T_map_link (4, 4) of every link that hangs on the root, parents before children.

        Args:
            joint_states: by joint name, radians or metres; joints not named are at rest.

        Raises:
            MapError: a state for a joint that does not exist, cannot move or follows another.
        """
        given = joint_states or {}
        self._check_states(given)
        if self.root is None:
            return {}
        placed = {self.root: np.eye(4)}
        waiting = [self.root]
        while waiting:
            parent = waiting.pop()
            for joint in self._joints_by_parent.get(parent, ()):
                if joint.child in placed or joint.child not in self.links:
                    continue
                T_map_child = placed[parent] @ joint.T_parent_child
                if joint.is_movable:
                    T_map_child = T_map_child @ joint.motion(self.joint_state(joint.name, given))
                placed[joint.child] = T_map_child
                waiting.append(joint.child)
        return placed

    def _check_states(self, given: Mapping[str, float]) -> None:
        for name in given:
            joint = self.joints.get(name)
            if joint is not None and joint.is_movable and joint.mimic is None:
                continue
            if joint is None:
                message = f"there is no joint '{name}'"
            elif joint.mimic is not None:
                message = f"joint '{name}' takes no state: it follows '{joint.mimic.joint}'"
            else:
                message = f"joint '{name}' takes no state: it is {joint.kind}"
            free = [other.name for other in self.joints.values() if other.is_movable and other.mimic is None]
            raise MapError(
                message, where=self.source, hint=closest(name, free) if free else "nothing in this map moves"
            )

    @cached_property
    def _joints_by_parent(self) -> dict[str, list[Joint]]:
        by_parent: dict[str, list[Joint]] = {}
        for joint in self.all_joints:
            by_parent.setdefault(joint.parent, []).append(joint)
        return by_parent

    @cached_property
    def _joint_by_child(self) -> dict[str, Joint]:
        return _first_by(self.all_joints, lambda joint: joint.child)


def _first_by(nouns: Iterable[Noun], key: Callable[[Noun], str]) -> dict[str, Noun]:
    found: dict[str, Noun] = {}
    for noun in nouns:
        found.setdefault(key(noun), noun)
    return found
