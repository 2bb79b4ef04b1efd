"""What kinds of things stand in a building, and what a LiDAR sees of them: the built-in taxonomy, and classes from names."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from wallkit.maps.document import Element

Lidar = Literal["opaque", "glass", "mirror", "perforated", "none"]
Mount = Literal["structure", "wall", "floor", "any"]


@dataclass(frozen=True, slots=True)
class ClassInfo:
    """One class of the class table.

    Attributes:
        name: what `<wk:object class>` says.
        seg: ids of the segmentation model's classes that mean this one; empty when none is known.
        lidar: opaque (returns), glass (returns with p_return), mirror (returns from what it shows), perforated (as glass),
            none (never returns).
        p_return: probability that a beam on it comes back from it; None where the map does not say.
        movable: it changes place while the map holds (doors, bins, chairs).
        mount: what it needs beside it: structure (it is wall itself), wall (hangs on one), floor, or any.
        color: as the map says, for drawings.
        merge: it shares its segmentation ids with another class on purpose.
        element: where the map defines it; None for a built-in class.
    """

    name: str
    seg: tuple[int, ...] = ()
    lidar: Lidar = "opaque"
    p_return: float | None = None
    movable: bool = False
    mount: Mount = "any"
    color: str = ""
    merge: bool = False
    element: Element | None = None


def _table(*classes: ClassInfo) -> dict[str, ClassInfo]:
    return {info.name: info for info in classes}


# p_return of glass: 0.15 of beams at perpendicular incidence, a round figure between the few per cent of clean float glass
# at steep angles and the 20-30 % of dusty or coated panes; a map should say its own
RESTROOM_V1 = _table(
    ClassInfo("wall", p_return=1.0, mount="structure", color="#4d4d4d"),
    ClassInfo("door", p_return=1.0, movable=True, mount="structure", color="#b5651d"),
    ClassInfo("window", lidar="glass", p_return=0.15, mount="structure", color="#9ecae1"),
    ClassInfo("glass", lidar="glass", p_return=0.15, mount="structure", color="#9ecae1"),
    ClassInfo("mirror", lidar="mirror", p_return=0.0, mount="wall", color="#c6dbef"),
    ClassInfo("toilet", p_return=1.0, mount="wall", color="#8da0cb"),
    ClassInfo("urinal", p_return=1.0, mount="wall", color="#8da0cb"),
    ClassInfo("sink", p_return=1.0, mount="wall", color="#66c2a5"),
    ClassInfo("partition", p_return=1.0, mount="wall", color="#a6761d"),
    ClassInfo("column", p_return=1.0, mount="structure", color="#666666"),
    ClassInfo("floor", mount="structure", color="#f0f0f0"),
    ClassInfo("ceiling", mount="structure", color="#f7f7f7"),
    ClassInfo("trash", p_return=1.0, movable=True, mount="floor", color="#fc8d62"),
    ClassInfo("dispenser", p_return=1.0, mount="wall", color="#e78ac3"),
    ClassInfo("radiator", p_return=1.0, mount="wall", color="#e5c494"),
    ClassInfo("furniture", p_return=1.0, movable=True, mount="floor", color="#ffd92f"),
    ClassInfo("unknown"),
)

TAXONOMIES: Mapping[str, Mapping[str, ClassInfo]] = {"restroom-v1": RESTROOM_V1}
DEFAULT_TAXONOMY = "restroom-v1"

# words people put into link names, by the class they mean
_WORDS: dict[str, tuple[str, ...]] = {
    "wall": ("wall", "walls"),
    "door": ("door", "doors", "leaf", "gate"),
    "window": ("window", "windows"),
    "glass": ("glass", "glazing", "pane"),
    "mirror": ("mirror", "mirrors"),
    "toilet": ("toilet", "toilets", "wc"),
    "urinal": ("urinal", "urinals"),
    "sink": ("sink", "sinks", "basin", "washbasin", "lavabo"),
    "partition": ("partition", "partitions", "stall", "cubicle", "divider"),
    "column": ("column", "columns", "pillar", "pillars", "post"),
    "floor": ("floor", "ground"),
    "ceiling": ("ceiling", "roof"),
    "trash": ("trash", "bin", "garbage"),
    "dispenser": ("dispenser", "dryer", "towel"),
    "radiator": ("radiator", "heater"),
    "furniture": (
        *(
            "cabinet",
            "cupboard",
            "wardrobe",
            "drawer",
            "shelf",
            "shelves",
            "dresser",
            "bookcase",
            "locker",
            "sideboard",
        ),
        *("table", "desk", "counter", "island", "countertop", "worktop", "bench", "bed", "nightstand"),
        *("chair", "stool", "sofa", "couch", "armchair", "seat"),
        *("fridge", "refrigerator", "oven", "stove", "hob", "hotplate", "microwave", "dishwasher", "washer", "tv"),
    ),
}
_CLASS_OF_WORD = {word: name for name, words in _WORDS.items() for word in words}
_WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])")


def class_from_name(link_name: str) -> str | None:
    """The class a link's name tells of: "wall_n" is a wall, "toilet_door" a door, "cabinet3_door_left" furniture.

    The last word that means a class decides, as in English compounds; but a part of furniture is furniture.
    Returns None when no word is known.
    """
    words = [match.lower() for match in _WORD.findall(link_name)]
    found = [_CLASS_OF_WORD[word] for word in words if word in _CLASS_OF_WORD]
    if not found:
        return None
    return "furniture" if "furniture" in found else found[-1]
