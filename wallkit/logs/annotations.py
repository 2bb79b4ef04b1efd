"""Polygons and points on an image -> foxglove_msgs/ImageAnnotations, which Foxglove lays over the image itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from wallkit.core.types import Float64Array
from wallkit.logs.cdr_write import CdrBuilder

TYPE = "foxglove_msgs/msg/ImageAnnotations"
Colour = tuple[float, float, float, float]
_KINDS = {"points": 1, "loop": 2}
_COLOUR = "float64 r\nfloat64 g\nfloat64 b\nfloat64 a"
_POINT = "float64 x\nfloat64 y"
_CIRCLE = (
    "builtin_interfaces/Time timestamp\nfoxglove_msgs/Point2 position\nfloat64 diameter\nfloat64 thickness\n"
    "foxglove_msgs/Color fill_color\nfoxglove_msgs/Color outline_color"
)
_POINTS = (
    "uint8 UNKNOWN=0\nuint8 POINTS=1\nuint8 LINE_LOOP=2\nuint8 LINE_STRIP=3\nuint8 LINE_LIST=4\n"
    "builtin_interfaces/Time timestamp\nuint8 type\nfoxglove_msgs/Point2[] points\nfoxglove_msgs/Color outline_color\n"
    "foxglove_msgs/Color[] outline_colors\nfoxglove_msgs/Color fill_color\nfloat64 thickness"
)
_TEXT = (
    "builtin_interfaces/Time timestamp\nfoxglove_msgs/Point2 position\nstring text\nfloat64 font_size\n"
    "foxglove_msgs/Color text_color\nfoxglove_msgs/Color background_color"
)
_ALL = (
    "foxglove_msgs/CircleAnnotation[] circles\nfoxglove_msgs/PointsAnnotation[] points\n"
    "foxglove_msgs/TextAnnotation[] texts"
)
_PARTS = {
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec",
    "foxglove_msgs/Color": _COLOUR,
    "foxglove_msgs/Point2": _POINT,
    "foxglove_msgs/CircleAnnotation": _CIRCLE,
    "foxglove_msgs/PointsAnnotation": _POINTS,
    "foxglove_msgs/TextAnnotation": _TEXT,
}
_LINE = "=" * 80
# (encoding, definition) for the writer: no standard ROS type
SCHEMA = ("ros2msg", "\n".join([_ALL, *(f"{_LINE}\nMSG: {name}\n{text}" for name, text in _PARTS.items())]).encode())


@dataclass(frozen=True, eq=False)
class Drawn:
    """One thing to draw: pixels (P, 2) as points or as a closed loop, colours r, g, b, a in [0, 1]."""

    kind: Literal["points", "loop"]
    pixels: Float64Array
    colour: Colour
    fill: Colour = (0.0, 0.0, 0.0, 0.0)
    thickness: float = 2.0


def annotations_message(stamp_ns: int, things: Sequence[Drawn]) -> bytes:
    """The message. Foxglove counts from the corner of the first pixel, wallkit from its centre."""
    message = CdrBuilder().values("I", 0).values("I", len(things))
    for thing in things:
        message.time(stamp_ns).values("B", _KINDS[thing.kind])
        message.sequence(np.asarray(thing.pixels, dtype="<f8") + 0.5, 8, count=len(thing.pixels))
        message.values("d", *thing.colour).values("I", 0).values("d", *thing.fill, thing.thickness)
    return message.values("I", 0).done()
