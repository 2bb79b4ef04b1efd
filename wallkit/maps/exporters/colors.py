"""A class -> the colour and opacity it is drawn with in other programs."""

from __future__ import annotations

import re

from wallkit.maps.classes import RESTROOM_V1, ClassInfo

GREY = "#999999"
SEE_THROUGH = {"glass": 0.4, "perforated": 0.7, "none": 0.2}
_HEX = re.compile(r"#([0-9a-fA-F]{2})([0-9a-fA-F]{2})([0-9a-fA-F]{2})")


def rgba_of(info: ClassInfo | None, class_name: str) -> tuple[float, float, float, float]:
    """Red, green, blue and opacity in [0, 1]: the map's own #rrggbb, else the taxonomy's, else grey."""
    builtin = RESTROOM_V1.get(class_name)
    written = [info.color if info else "", builtin.color if builtin else "", GREY]
    match = next(match for text in written if (match := _HEX.fullmatch(text.strip())))
    red, green, blue = (int(digits, 16) / 255 for digits in match.groups())
    return red, green, blue, SEE_THROUGH.get(info.lidar if info else "opaque", 1.0)
