"""The words models use for their classes -> what they count as here: wall, door, person, ..."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

from wallkit.core.config import setting
from wallkit.core.segmentation import BACKGROUND

OTHER = "other"


@dataclass(frozen=True)
class Roles:
    """Which class names count as what; capitals, `_`, `-` and spaces make no difference. All else is "other".

    The words are those of wallkit's own maps and nets, COCO and COCO-Stuff, ADE20K, NYUv2 and Cityscapes.
    """

    wall: tuple[str, ...] = setting(
        (
            *("wall", "walls", "wall brick", "wall concrete", "wall other", "wall panel", "wall stone", "wall tile"),
            *("wall wood", "wall other merged", "column", "pillar", "column, pillar"),
        ),
        "what the map's walls look like to the model",
    )
    partition: tuple[str, ...] = setting(("partition", "stall", "cubicle", "divider"), "stalls and thin walls")
    door: tuple[str, ...] = setting(
        ("door", "doors", "door stuff", "door leaf", "double door", "screen door", "screen door, screen"), "doors"
    )
    glass: tuple[str, ...] = setting(
        ("glass", "window", "windows", "windowpane", "windowpane, window", "window other"), "panes"
    )
    mirror: tuple[str, ...] = setting(("mirror", "mirror stuff"), "mirrors")
    toilet: tuple[str, ...] = setting(("toilet", "toilets", "wc", "toilet, can, commode"), "toilets")
    urinal: tuple[str, ...] = setting(("urinal", "urinals"), "urinals")
    sink: tuple[str, ...] = setting(("sink", "sinks", "basin", "washbasin"), "wash basins")
    floor: tuple[str, ...] = setting(
        (
            *("floor", "floors", "flooring", "floor, flooring", "floor wood", "floor tile", "floor marble"),
            *("floor stone", "floor other", "floor other merged", "floor mat", "rug", "rug, carpet", "carpet"),
        ),
        "what the robot drives on",
    )
    ceiling: tuple[str, ...] = setting(
        ("ceiling", "ceilings", "ceiling tile", "ceiling other", "ceiling merged"), "what is above"
    )
    person: tuple[str, ...] = setting(
        ("person", "persons", "people", "pedestrian", "human", "rider", "person, individual"), "people"
    )
    movable: tuple[str, ...] = setting(
        (
            *("chair", "couch", "sofa", "bench", "stool", "bed", "dining table", "table", "desk", "furniture"),
            *("potted plant", "backpack", "handbag", "suitcase", "umbrella", "box", "cart", "trash", "bag"),
            *("bicycle", "cat", "dog", "laptop", "tv", "book", "bottle", "sports ball", "skateboard"),
        ),
        "what need not stand where the map was made",
    )

    def of(self, names: Sequence[str]) -> tuple[str, ...]:
        """What each class counts as: the first role that lists its name, else "other"."""
        listed: dict[str, str] = {}
        for role in self.names():
            for word in getattr(self, role):
                listed.setdefault(_plain(word), role)
        return tuple(BACKGROUND if n == BACKGROUND else listed.get(_plain(n), OTHER) for n in names)

    @staticmethod
    def names() -> tuple[str, ...]:
        """Of all roles that a table can list."""
        return tuple(f.name for f in fields(Roles))


def _plain(name: str) -> str:
    return " ".join(name.lower().replace("_", " ").replace("-", " ").split())
