"""The format as a table: which element may stand where, with which attributes holding what.

URDF's part follows the ROS URDF specification (http://wiki.ros.org/urdf/XML), wallkit's part is wkmap 1.0. The schema rules
judge files by it, the editing verbs and importers write by it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from wallkit.maps.document import wk

FORMAT = "1.0"
UNITS = "m rad"

ValueKind = Literal["text", "name", "names", "numbers", "pairs", "integers", "choice", "boolean", "date", "prior"]


@dataclass(frozen=True, slots=True)
class Value:
    """What an attribute holds.

    Attributes:
        kind: "numbers" and "pairs" (an even count, at least three pairs) are read by `wallkit.maps.numbers`.
        count: how many numbers; None for any.
        unit: "m" for lengths, "rad" for angles, "" for the rest.
        choices: the valid words of a choice.
        largest: the largest magnitude a number may have; survey coordinates exceed the usual million.
    """

    kind: ValueKind
    count: int | None = None
    unit: str = ""
    choices: tuple[str, ...] = ()
    largest: float = 1e6


@dataclass(frozen=True, slots=True)
class Tag:
    """What one element may carry: attributes with their values, those it cannot do without, and child elements."""

    attributes: Mapping[str, Value] = field(default_factory=dict)
    required: tuple[str, ...] = ()
    children: tuple[str, ...] = ()


TEXT, NAME, NAMES, INTEGERS = Value("text"), Value("name"), Value("names"), Value("integers")
NUMBER, LENGTH, ANGLE = Value("numbers", 1), Value("numbers", 1, "m"), Value("numbers", 1, "rad")
POINT, VECTOR, ANGLES, INTERVAL = (
    Value("numbers", 3, "m"),
    Value("numbers", 3),
    Value("numbers", 3, "rad"),
    Value("numbers", 2, "m"),
)
BOOLEAN, DATE = Value("boolean"), Value("date")
SURVEYED = Value("numbers", 1, "m", largest=1e8)


def choice_of(*words: str) -> Value:
    """An attribute that holds one of these words."""
    return Value("choice", choices=words)


JOINT_TYPES = ("fixed", "revolute", "continuous", "prismatic", "floating", "planar")
SHAPES = ("box", "cylinder", "sphere", "mesh")
LIDAR_BEHAVIOURS = ("opaque", "glass", "mirror", "perforated", "none")
OPENING_KINDS = ("door", "window", "passage")
# what other programs keep inside a URDF; nothing of it concerns a map
FOREIGN_TAGS = ("transmission", "gazebo", "sensor", "ros2_control", "plugin")

_IGNORE = wk("ignore")

TAGS: dict[str, Tag] = {
    "robot": Tag(
        {"name": NAME, "version": TEXT},
        (),
        ("link", "joint", "material", *FOREIGN_TAGS, wk("map"), wk("check"), _IGNORE),
    ),
    "link": Tag(
        {"name": NAME, "type": TEXT},
        ("name",),
        ("inertial", "visual", "collision", *FOREIGN_TAGS, wk("object"), wk("opening"), _IGNORE),
    ),
    "collision": Tag({"name": NAME}, (), ("origin", "geometry", "verbose", _IGNORE)),
    "visual": Tag({"name": NAME}, (), ("origin", "geometry", "material", _IGNORE)),
    "verbose": Tag({"value": TEXT}),
    "origin": Tag({"xyz": POINT, "rpy": ANGLES}),
    "geometry": Tag(children=SHAPES),
    "box": Tag({"size": POINT}, ("size",)),
    "cylinder": Tag({"radius": LENGTH, "length": LENGTH}, ("radius", "length")),
    "sphere": Tag({"radius": LENGTH}, ("radius",)),
    "mesh": Tag({"filename": TEXT, "scale": VECTOR}, ("filename",)),
    "material": Tag({"name": TEXT}, (), ("color", "texture")),
    "color": Tag({"rgba": Value("numbers", 4)}),
    "texture": Tag({"filename": TEXT}),
    "inertial": Tag(children=("origin", "mass", "inertia")),
    "mass": Tag({"value": NUMBER}),
    "inertia": Tag(dict.fromkeys(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), NUMBER)),
    "joint": Tag(
        {"name": NAME, "type": choice_of(*JOINT_TYPES)},
        ("name",),
        (
            "origin",
            "parent",
            "child",
            "axis",
            "limit",
            "mimic",
            "dynamics",
            "calibration",
            "safety_controller",
            wk("state"),
            _IGNORE,
        ),
    ),
    "parent": Tag({"link": NAME}, ("link",)),
    "child": Tag({"link": NAME}, ("link",)),
    "axis": Tag({"xyz": VECTOR}, ("xyz",)),
    "limit": Tag(dict.fromkeys(("lower", "upper", "effort", "velocity"), NUMBER)),
    "mimic": Tag({"joint": NAME, "multiplier": NUMBER, "offset": NUMBER}, ("joint",)),
    "dynamics": Tag(dict.fromkeys(("damping", "friction"), NUMBER)),
    "calibration": Tag(dict.fromkeys(("rising", "falling", "reference_position"), NUMBER)),
    "safety_controller": Tag(
        dict.fromkeys(("soft_lower_limit", "soft_upper_limit", "k_position", "k_velocity"), NUMBER)
    ),
    wk("map"): Tag(
        {
            "format": TEXT,
            "units": TEXT,
            "up": choice_of("z"),
            "level": TEXT,
            "elevation": LENGTH,
            "scan_plane": LENGTH,
            "taxonomy": TEXT,
            "created": TEXT,
            "source": TEXT,
            "sigma": LENGTH,
        },
        ("format", "units"),
        (wk("origin"), wk("class"), wk("room"), wk("check"), _IGNORE),
    ),
    wk("origin"): Tag(
        {
            "kind": choice_of("none", "surveyed", "georef"),
            "epsg": INTEGERS,
            "east": SURVEYED,
            "north": SURVEYED,
            "yaw": ANGLE,
        }
    ),
    wk("class"): Tag(
        {
            "name": NAME,
            "seg": INTEGERS,
            "lidar": choice_of(*LIDAR_BEHAVIOURS),
            "p_return": NUMBER,
            "movable": BOOLEAN,
            "color": TEXT,
            "merge": BOOLEAN,
        },
        ("name",),
        (_IGNORE,),
    ),
    wk("room"): Tag({"id": NAME, "kind": TEXT, "floor": Value("pairs", unit="m")}, ("id", "floor"), (_IGNORE,)),
    wk("object"): Tag(
        {
            "class": NAME,
            "name": TEXT,
            "separates": NAMES,
            "connects": NAMES,
            "room": NAME,
            "sigma": LENGTH,
            "source": TEXT,
            "note": TEXT,
        },
        ("class",),
        (_IGNORE,),
    ),
    wk("opening"): Tag(
        {"id": NAME, "kind": choice_of(*OPENING_KINDS), "along": INTERVAL, "z": INTERVAL, "fill": NAME, "swing": TEXT},
        ("id", "kind", "along", "z"),
        (_IGNORE,),
    ),
    wk("state"): Tag({"rest": NUMBER, "prior": Value("prior"), "tolerance": NUMBER}),
    _IGNORE: Tag({"rule": NAMES, "reason": TEXT, "until": DATE}, ("rule", "reason")),
    wk("check"): Tag({"max-range": LENGTH, "robot-radius": LENGTH, "labels": TEXT}),
}
