"""The nouns of an audit: the scans of a log with their poses, and what they say about every element of a map."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from wallkit.core.types import BoolArray, Float64Array, Int64Array


@dataclass(frozen=True, eq=False)
class Logged:
    """The part of a log that an audit looks at: views (scans at places) and their beams, in the order of the views.

    Attributes:
        stamps_s: (V,) time of each view. poses: (V, 3) T_map_base. sd: (V, 3) how well x, y [m] and yaw [rad] are known.
        views: (B,) which view a beam belongs to. bearings_rad: (B,) from the LiDAR, in frame base.
        ranges_m: (B,) infinite where nothing came back within the reach.
        origin_m: (2,) the LiDAR in frame base. reach_m: no return can be farther.
        is_absolute: the poses do not come from the map itself, so that its origin and yaw can be judged.
    """

    stamps_s: Float64Array
    poses: Float64Array
    sd: Float64Array
    views: Int64Array
    bearings_rad: Float64Array
    ranges_m: Float64Array
    origin_m: Float64Array
    reach_m: float
    is_absolute: bool

    def __len__(self) -> int:
        return len(self.poses)


@dataclass(frozen=True, slots=True)
class Drift:
    """How the map as a whole differs from the log: real = map + (x, y) + yaw x map + scale * map.

    Attributes:
        values, sd: (4,) x [m], y [m], yaw [rad], scale [1].
        is_significant: it is larger than chance and larger than is tolerated; then single elements are judged without it.
    """

    values: Float64Array
    sd: Float64Array
    is_significant: bool


@dataclass(frozen=True, slots=True)
class Shift:
    """How far one direction of an element is off: `offset_m` along `normal` (2,), a unit vector of frame map.

    Attributes:
        sd_m: its standard deviation, pose errors included. places: from how many separate places it was seen.
        thicker_m: how much thicker it is than drawn; NaN unless both of its faces were seen.
    """

    normal: tuple[float, float]
    offset_m: float
    sd_m: float
    places: int
    thicker_m: float
    thicker_sd_m: float


@dataclass(frozen=True, slots=True)
class ElementEvidence:
    """What the log says about one link.

    Attributes:
        length_m: of its outline that the LiDAR could see from the floor. observed_m: that it looked at.
        unsupported_m: of the observed, where beams went through. views, places: that looked at it.
        at: (2,) its middle; of the unsupported part, where there is one.
        shifts: one for each direction it has a straight face in.
    """

    link: str
    length_m: float
    observed_m: float
    unsupported_m: float
    views: int
    places: int
    through: int
    at: tuple[float, float]
    shifts: tuple[Shift, ...]


@dataclass(frozen=True, slots=True)
class Cluster:
    """Returns that nothing in the map explains, at one place, as often as it was looked at.

    Attributes:
        pose: (x, y, yaw) of the middle of the rectangle around them. size_m: (along yaw, across).
        views, returns: how many. seen_over_s: time between the first and the last.
        sides: from how many of the four sides of the rectangle it was seen.
        wall: nearest wall closer than it is deep, "" for none. wall_gap_m: how far.
        class_name: a guess.
    """

    pose: tuple[float, float, float]
    size_m: tuple[float, float]
    views: int
    returns: int
    seen_over_s: float
    sides: int
    wall: str
    room_kind: str
    class_name: str


@dataclass(frozen=True, slots=True)
class DoorEvidence:
    """How a door stood.

    Attributes:
        joint, link: of its (leading) leaf. states: (n,) joint state in each view that could tell. stamps_s: (n,) of these.
        tolerance: how far two states may differ and still be one.
    """

    joint: str
    link: str
    states: Float64Array
    stamps_s: Float64Array
    tolerance: float


@dataclass(frozen=True, eq=False)
class Pieces:
    """The outline of the map in short pieces, for a picture.

    Attributes:
        segments: (P, 4) x0, y0, x1, y1 [m]. links: (P,) whose. is_exposed: (P,) it can be seen from the floor.
        hits, through: (P,) views that saw it, and that saw through it.
    """

    segments: Float64Array
    links: tuple[str, ...]
    is_exposed: BoolArray
    hits: Int64Array
    through: Int64Array


@dataclass(frozen=True, eq=False)
class Evidence:
    """Everything a log says about a map.

    Attributes:
        poses: (V, 3) of the views, as the audit corrected them.
        drift: of the map as a whole. elements: by link. clusters: largest first. doors: by joint.
        explained: share of the returns that the map explains. places: separate places the log was looked at from.
    """

    source: str
    poses: Float64Array
    places: int
    drift: Drift
    elements: Mapping[str, ElementEvidence]
    clusters: tuple[Cluster, ...]
    doors: Mapping[str, DoorEvidence]
    pieces: Pieces
    explained: float
    notes: tuple[str, ...] = field(default=())

    @property
    def coverage(self) -> float:
        """Share of the outline that the log looked at."""
        total = sum(element.length_m for element in self.elements.values())
        return sum(element.observed_m for element in self.elements.values()) / total if total else 0.0
