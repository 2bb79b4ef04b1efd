"""The words models use for their classes -> what they count as here: wall, door, person, ..."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

from wallkit.core.config import setting
from wallkit.core.segmentation import BACKGROUND
from wallkit.errors import ConfigError

OTHER = "other"

# the words of wallkit's own maps and nets, COCO and COCO-Stuff, ADE20K, NYUv2 and Cityscapes, as `_plain` writes them
COMMON: Mapping[str, tuple[str, ...]] = {
    "wall": (
        *("wall", "walls", "wall brick", "wall concrete", "wall other", "wall panel", "wall stone", "wall tile"),
        *("wall wood", "wall other merged", "column", "pillar", "column, pillar"),
    ),
    "partition": ("partition", "stall", "cubicle", "divider"),
    "door": ("door", "doors", "door stuff", "door leaf", "double door", "screen door", "screen door, screen"),
    "glass": ("glass", "window", "windows", "windowpane", "windowpane, window", "window other"),
    "mirror": ("mirror", "mirror stuff"),
    "toilet": ("toilet", "toilets", "wc", "toilet, can, commode"),
    "urinal": ("urinal", "urinals"),
    "sink": ("sink", "sinks", "basin", "washbasin"),
    "floor": (
        *("floor", "floors", "flooring", "floor, flooring", "floor wood", "floor tile", "floor marble"),
        *("floor stone", "floor other", "floor other merged", "floor mat", "rug", "rug, carpet", "carpet"),
    ),
    "ceiling": ("ceiling", "ceilings", "ceiling tile", "ceiling other", "ceiling merged"),
    "person": ("person", "persons", "people", "pedestrian", "human", "rider", "person, individual"),
    "movable": (
        *("chair", "couch", "sofa", "bench", "stool", "bed", "dining table", "table", "desk", "furniture"),
        *("potted plant", "backpack", "handbag", "suitcase", "umbrella", "box", "cart", "trash", "bag"),
        *("bicycle", "cat", "dog", "laptop", "tv", "book", "bottle", "sports ball", "skateboard"),
    ),
}
_COMMON_ROLES = {word: role for role, words in COMMON.items() for word in words}


def _role(name: str, doc: str) -> Any:
    """A list of the user's own words; its documentation names the common ones."""
    return setting((), f"{doc}; besides {', '.join(f'`{word}`' for word in COMMON[name])}")


@dataclass(frozen=True)
class Roles:
    """Which class names the user has count as what, beside the common words and before them.

    Capitals, `_`, `-` and spaces make no difference.

    Raises:
        ConfigError: one word is listed for two roles.
    """

    wall: tuple[str, ...] = _role("wall", "what the map's walls look like to the model")
    partition: tuple[str, ...] = _role("partition", "stalls and thin walls")
    door: tuple[str, ...] = _role("door", "doors")
    glass: tuple[str, ...] = _role("glass", "panes")
    mirror: tuple[str, ...] = _role("mirror", "mirrors")
    toilet: tuple[str, ...] = _role("toilet", "toilets")
    urinal: tuple[str, ...] = _role("urinal", "urinals")
    sink: tuple[str, ...] = _role("sink", "wash basins")
    floor: tuple[str, ...] = _role("floor", "what the robot drives on")
    ceiling: tuple[str, ...] = _role("ceiling", "what is above")
    person: tuple[str, ...] = _role("person", "people")
    movable: tuple[str, ...] = _role("movable", "what need not stand where the map was made")
    other: tuple[str, ...] = setting((), "what counts as none of these, though its word is among the common ones")

    def __post_init__(self) -> None:
        self._own()

    def of(self, names: Sequence[str]) -> tuple[str, ...]:
        """What each class counts as: the role that the user lists its name for, else its common one, else "other"."""
        listed = {**_COMMON_ROLES, **self._own()}
        return tuple(BACKGROUND if n == BACKGROUND else listed.get(_plain(n), OTHER) for n in names)

    def unused(self, names: Sequence[str]) -> tuple[tuple[str, str], ...]:
        """(role, word) of the words listed here that none of the classes is called, as they are written."""
        called = {_plain(name) for name in names}
        return tuple(
            (role, word) for role in self.names() for word in getattr(self, role) if _plain(word) not in called
        )

    @staticmethod
    def names() -> tuple[str, ...]:
        """Of all roles that a table can list."""
        return tuple(f.name for f in fields(Roles))

    def _own(self) -> dict[str, str]:
        """The user's words with their roles."""
        found: dict[str, str] = {}
        for role in self.names():
            for word in getattr(self, role):
                before = found.setdefault(_plain(word), role)
                if before != role:
                    said = f"'{word}' is listed for two roles: segment.roles.{before} and segment.roles.{role}"
                    raise ConfigError(said, hint="leave it in the one that it counts as")
        return found


def _plain(name: str) -> str:
    return " ".join(name.lower().replace("_", " ").replace("-", " ").split())
