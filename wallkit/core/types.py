"""The nouns that cross rooms: what a log holds, what a map becomes, what the filter says.

Frames are named as in T_ab (p_a = T_ab p_b): map, odom, base, lidar, camera. Time is int64 nanoseconds of the header
stamp. Planar poses are (x [m], y [m], yaw [rad]) arrays; transforms are (4, 4) float64.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

Float64Array = NDArray[np.float64]
Float32Array = NDArray[np.float32]
Int64Array = NDArray[np.int64]
Int8Array = NDArray[np.int8]
BoolArray = NDArray[np.bool_]
UInt8Array = NDArray[np.uint8]

# ---------------------------------------------------------------------------------------- what a log holds


@dataclass(frozen=True, slots=True)
class Scan:
    """One sweep of a planar LiDAR, as recorded, in the sensor's own frame.

    Attributes:
        stamp_ns: header stamp, the time of the first beam.
        frame_id: the LiDAR's frame.
        ranges_m: (K,) float32. NaN, inf, 0, below range_min_m or above range_max_m mean "no return".
        angles_rad: (K,) float32, bearing of each beam in the sensor frame.
        beam_interval_s: time between two beams; 0 when the driver does not say.
        range_min_m, range_max_m: the driver's limits.
        heights_m: (K,) float32 z of each return in the sensor frame, for slices of a 3-D cloud; None for a planar scan.
        offsets_s: (K,) float32 time of each return after the stamp, where it is not k * beam_interval_s; else None.
    """

    stamp_ns: int
    frame_id: str
    ranges_m: Float32Array
    angles_rad: Float32Array
    beam_interval_s: float
    range_min_m: float
    range_max_m: float
    heights_m: Float32Array | None = None
    offsets_s: Float32Array | None = None


@dataclass(frozen=True, slots=True)
class PointCloud:
    """A 3-D LiDAR cloud in the sensor's frame: points_m (P, 3) float32; ring, intensity and time offsets if present."""

    stamp_ns: int
    frame_id: str
    points_m: Float32Array
    intensities: Float32Array | None = None
    rings: Int64Array | None = None
    offsets_s: Float32Array | None = None


@dataclass(frozen=True, slots=True)
class Odometry:
    """Where the wheels say the robot is: T_odom_base as a planar pose (3,) [m, m, rad] at a stamp."""

    stamp_ns: int
    pose: Float64Array
    frame_id: str = "odom"
    child_frame_id: str = "base_link"


@dataclass(frozen=True, slots=True)
class Transform:
    """T_parent_child, (4, 4) float64, at a stamp; static ones hold at any time."""

    stamp_ns: int
    parent: str
    child: str
    matrix: Float64Array
    is_static: bool = False


@dataclass(frozen=True, slots=True)
class StampedPose:
    """A planar pose (3,) in a named frame, with its (3, 3) covariance when the message carried one."""

    stamp_ns: int
    frame_id: str
    pose: Float64Array
    covariance: Float64Array | None = None


@dataclass(frozen=True, slots=True)
class CameraImage:
    """An image as recorded; `wallkit.logs.images.pixels_from_image` decodes it.

    Attributes:
        encoding: "jpeg", "png", "webp" for compressed data, else the ROS encoding ("rgb8", "bgr8", "mono8", ...).
        data: the compressed bytes, or the raw rows (height * step bytes).
        height, width, step: of a raw image; 0 for a compressed one until it is decoded.
    """

    stamp_ns: int
    frame_id: str
    encoding: str
    data: bytes
    height: int = 0
    width: int = 0
    step: int = 0


@dataclass(frozen=True, slots=True)
class CameraInfo:
    """Intrinsics as published: model name as written, d (n,), k (3, 3), r (3, 3), p (3, 4) float64; pixels."""

    stamp_ns: int
    frame_id: str
    width: int
    height: int
    model: str
    d: Float64Array
    k: Float64Array
    r: Float64Array
    p: Float64Array


@dataclass(frozen=True, slots=True)
class OccupancyGrid:
    """A raster map. Cell (row 0, column 0) has its corner at the origin pose; rows go along the grid's +y.

    Attributes:
        cells: (H, W) int8: -1 unknown, 0 free ... 100 occupied (nav_msgs/OccupancyGrid).
        resolution_m: side of a cell.
        origin: (3,) T_map_grid as (x, y, yaw): pose of the *corner* of cell (0, 0).
        source: file or topic it came from, for messages and run.json.
    """

    cells: Int8Array
    resolution_m: float
    origin: Float64Array
    source: str = ""
    stamp_ns: int = 0
    frame_id: str = "map"


# ------------------------------------------------------------------------------- what the filter is given


@dataclass(frozen=True, slots=True)
class Points:
    """LiDAR returns of one sweep, moved to one moment and into frame `base`.

    Attributes:
        stamp_ns: the moment all points are expressed at.
        xyz_m: (K, 3) float32 in frame base.
        ranges_m: (K,) float32, distance from the LiDAR to the return.
        beams: (K,) int64, index of each return in the recorded scan.
        origin_m: (2,) float64, the LiDAR's place in frame base.
        range_max_m: no return can be farther.
        misses_rad: (M,) float32, bearings in frame base of the beams that saw nothing up to range_max_m.
        dropped: why beams were left out, and how many.
        offsets_s: (K,) float32 when each return was measured, after the stamp; None: all at the stamp, or nobody says.
    """

    stamp_ns: int
    xyz_m: Float32Array
    ranges_m: Float32Array
    beams: Int64Array
    origin_m: Float64Array
    range_max_m: float
    misses_rad: Float32Array
    dropped: Mapping[str, int] = field(default_factory=dict)
    offsets_s: Float32Array | None = None


@dataclass(frozen=True, slots=True)
class LabelledScan:
    """Points with what the point filters think of them.

    Attributes:
        weights: (K,) float32 in [0, 1]: the prior that a return comes from the map; 0 ignores it.
        labels: (K,) int64 class index into `classes`, -1 where no camera saw the point; None without a camera.
        classes: names of the classes the labels point into.
        confidences: (K,) float32 in [0, 1], how sure each label is; None where nobody says: the labels are sure.
        shares: (K, C) float32 of `BeamLabels`; None where the labels are all that is known.
    """

    points: Points
    weights: Float32Array
    labels: Int64Array | None = None
    classes: tuple[str, ...] = ()
    confidences: Float32Array | None = None
    shares: Float32Array | None = None


@dataclass(frozen=True, slots=True)
class BeamLabels:
    """What the beams of one recorded scan hit, from whoever can tell: a camera, or the simulator as an oracle.

    Attributes:
        stamp_ns: of the scan.
        labels: (B,) int64 class index into `classes` by recorded beam (see `Points.beams`), -1 for unknown.
        classes: names of the classes.
        confidences: (B,) float32 in [0, 1], or None.
        shares: (B, C) float32, how much of where the beam may have landed in the picture shows each class; rows of beams
            with a label sum to 1, those of others are 0. None: the label alone is known.
    """

    stamp_ns: int
    labels: Int64Array
    classes: tuple[str, ...]
    confidences: Float32Array | None = None
    shares: Float32Array | None = None


@dataclass(frozen=True, slots=True)
class View:
    """What a camera saw at about the moment of a scan, and where odometry says the robot was then.

    Attributes:
        topic: of the camera's images.
        moment_ns: when the image was taken, by the LiDAR's clock.
        odometry: (3,) T_odom_base at that moment.
        speed_m_s, turn_rad_s: of the robot just before it.
    """

    topic: str
    image: CameraImage
    moment_ns: int
    odometry: Float64Array
    speed_m_s: float = 0.0
    turn_rad_s: float = 0.0


@dataclass(frozen=True, slots=True)
class Frame:
    """One moment for the filter: points, where odometry says the robot was, and the images nearest in time.

    Attributes:
        stamp_ns: the scan's stamp.
        points: motion-corrected returns in frame base at stamp_ns.
        odometry: (3,) T_odom_base at stamp_ns.
        odometry_gap_s: longest time without an odometry message since the previous frame.
        views: the image of each camera that is nearest in time, where one is within the tolerance.
        labels: classes of the scan's beams, None where nobody knows them.
        cloud_m: (P, 3) float32 in frame base at stamp_ns, the whole 3-D cloud that `points` are a slice of; None without
            one, or without a camera.
    """

    stamp_ns: int
    points: Points
    odometry: Float64Array
    odometry_gap_s: float = 0.0
    views: tuple[View, ...] = ()
    labels: BeamLabels | None = None
    cloud_m: Float32Array | None = None


@dataclass(frozen=True)
class FieldSet:
    """A map as the LiDAR sees it: distance to the nearest visible surface, in all and per class.

    Attributes:
        distances_m: class name -> (H, W) float32 [m] from the cell's centre to the nearest surface; "all" is always there.
        is_free: (H, W) bool, cells a robot could stand in.
        resolution_m: side of a cell.
        origin: (3,) T_map_grid, pose of the corner of cell (0, 0).
        source: file or topic.
    """

    distances_m: Mapping[str, Float32Array]
    is_free: BoolArray
    resolution_m: float
    origin: Float64Array
    source: str = ""

    @property
    def shape(self) -> tuple[int, int]:
        """(H, W) in cells."""
        height, width = self.is_free.shape
        return int(height), int(width)


# ------------------------------------------------------------------------------------ what the filter says


class Health(IntEnum):
    """How far the estimate may be trusted."""

    LOST = 0
    UNCERTAIN = 1
    LOCALIZED = 2


@dataclass(frozen=True, slots=True)
class Mode:
    """One hypothesis: pose (3,), covariance (3, 3) in (m, m, rad), and its share of the belief."""

    pose: Float64Array
    covariance: Float64Array
    weight: float


@dataclass(frozen=True, slots=True)
class Estimate:
    """What the filter answers at one stamp: T_map_base with covariance, its health, and every hypothesis alive."""

    stamp_ns: int
    pose: Float64Array
    covariance: Float64Array
    health: Health
    modes: tuple[Mode, ...] = ()


@dataclass(frozen=True, slots=True)
class Trajectory:
    """Stamped planar poses: stamps_ns (T,) int64 ascending and unique, poses (T, 3) float64, named frame."""

    stamps_ns: Int64Array
    poses: Float64Array
    frame_id: str = "map"

    def __len__(self) -> int:
        return len(self.stamps_ns)
