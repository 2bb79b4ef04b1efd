"""Classes of maps and worlds -> the classes a network learns, with their numbers and colours."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from wallkit.core.config import read_toml
from wallkit.core.types import UInt8Array
from wallkit.errors import DatasetError, closest

# what a label's pixel says that belongs to no class
UNLABELLED = 255
_COLOURS = {
    "wall": (105, 105, 115),
    "partition": (166, 118, 29),
    "door": (217, 95, 2),
    "toilet": (117, 112, 230),
    "urinal": (231, 41, 138),
    "sink": (27, 158, 119),
    "mirror": (120, 200, 255),
    "glass": (0, 110, 220),
    "floor": (200, 190, 170),
    "ceiling": (240, 240, 225),
    "person": (230, 25, 40),
    "other": (250, 210, 40),
}
_USUAL = {
    **{name: name for name in _COLOURS},
    "column": "wall",
    "window": "glass",
    **dict.fromkeys(("trash", "dispenser", "radiator", "furniture", "cart", "fitting", "unknown"), "other"),
}


@dataclass(frozen=True)
class LabelSet:
    """What a network is to tell apart.

    Attributes:
        names: in the order of their numbers, at most 255.
        of: class of a map or world -> one of the names, or "" for pixels that stay without a label.
        source: file, for messages.
    """

    names: tuple[str, ...] = tuple(_COLOURS)
    of: Mapping[str, str] = field(default_factory=lambda: _USUAL)
    source: str = ""

    def table(self, class_names: Sequence[str]) -> UInt8Array:
        """(C,) the number of each class of a world, UNLABELLED for those that stay without.

        Raises:
            DatasetError: a class has no place.
        """
        numbers = {name: number for number, name in enumerate(self.names)} | {"": UNLABELLED}
        for name in class_names:
            if name not in self.of:
                hint = f'say what it counts as in a classes file: [of] {name} = "other"   (of: {", ".join(self.names)})'
                raise DatasetError(f"the class '{name}' has no place among the labels", where=self.source, hint=hint)
        return np.array([numbers[self.of[name]] for name in class_names], dtype=np.uint8)

    @property
    def colours(self) -> UInt8Array:
        """(256, 3) RGB of every number: the palette of label PNGs; black for UNLABELLED."""
        palette = np.zeros((256, 3), dtype=np.uint8)
        for number, name in enumerate(self.names):
            palette[number] = _COLOURS.get(name) or _spread(number)
        return palette


def read_label_set(path: Path | None) -> LabelSet:
    """The label set of a TOML file: `names = [...]`, and [of] with `class = "name"` on top of the usual table.

    Raises:
        ConfigError: the file cannot be read. DatasetError: names twice or none, a class that counts as no name.
    """
    if path is None:
        return LabelSet()
    source = read_toml(path)
    table: dict[str, Any] = dict(source.table)
    names, of = table.pop("names", list(_COLOURS)), table.pop("of", {})
    if table:
        raise DatasetError(
            f"no setting is called '{next(iter(table))}'", where=path, hint="a classes file has names and [of]"
        )
    if not isinstance(names, list) or not all(isinstance(name, str) and name for name in names) or not names:
        raise DatasetError(
            f"names is {names!r}", where=source.place(["names"]), hint='names = ["wall", "door", "other"]'
        )
    if len(set(names)) < len(names) or len(names) >= UNLABELLED:
        raise DatasetError(f"{len(names)} names, {len(set(names))} different", where=source.place(["names"]))
    rest = "other" if "other" in names else ""
    usual = {name: counts if counts in names else rest for name, counts in _USUAL.items()}
    known = {*names, ""}
    for name, counts in of.items() if isinstance(of, dict) else ():
        if counts not in known:
            hint = f'{closest(str(counts), names)}; "" for no label'
            raise DatasetError(
                f"'{name}' counts as '{counts}', which is no name", where=source.place(["of", name]), hint=hint
            )
    return LabelSet(tuple(names), {**usual, **{name: name for name in names}, **dict(of)}, str(path))


def _spread(number: int) -> tuple[int, int, int]:
    """A colour of a name of the user's: hues by the golden ratio, so that neighbours differ."""
    import colorsys

    r, g, b = colorsys.hsv_to_rgb((number * 0.61803) % 1.0, 0.65, 0.9)
    return round(255 * r), round(255 * g), round(255 * b)
