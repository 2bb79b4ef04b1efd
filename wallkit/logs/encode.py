"""Core types -> serialised ROS 2 messages, ready for a channel of a recording."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from wallkit.core.geometry import quaternions_from_matrices
from wallkit.core.types import (
    CameraImage,
    CameraInfo,
    Float64Array,
    OccupancyGrid,
    Odometry,
    PointCloud,
    Scan,
    StampedPose,
    Transform,
)
from wallkit.logs.cdr_write import CdrBuilder, covariance_numbers, planar_numbers
from wallkit.logs.message import Value

COMPRESSED = ("jpeg", "png", "webp")
_FLOAT32 = 7
# nothing is known of an odometry's spread, and ROS says so by zeros
_UNKNOWN_COVARIANCE = np.zeros(36)


def encode(value: Value) -> tuple[str, bytes]:
    """(ROS 2 type, CDR bytes) of a value.

    Raises:
        ValueError: no ROS message says what the value says (a scan with uneven bearings).
    """
    return ENCODERS[type(value)](value)


def _scan(scan: Scan) -> tuple[str, bytes]:
    count = len(scan.angles_rad)
    first, last = (float(scan.angles_rad[0]), float(scan.angles_rad[-1])) if count else (0.0, 0.0)
    increment = (last - first) / (count - 1) if count > 1 else 0.0
    even = first + increment * np.arange(count)
    if scan.heights_m is not None or not np.allclose(even, scan.angles_rad, atol=1e-5):
        raise ValueError("a LaserScan needs bearings that step evenly, and no heights")
    limits = scan.range_min_m, scan.range_max_m
    interval = scan.beam_interval_s
    message = CdrBuilder().header(scan.stamp_ns, scan.frame_id)
    message.values("f", first, last, increment, interval, interval * count, *limits)
    message.sequence(scan.ranges_m.astype("<f4"), 4).values("I", 0)
    return "sensor_msgs/msg/LaserScan", message.done()


def _odometry(odometry: Odometry) -> tuple[str, bytes]:
    message = CdrBuilder().header(odometry.stamp_ns, odometry.frame_id).text(odometry.child_frame_id)
    message.block(planar_numbers(odometry.pose), 8).block(_UNKNOWN_COVARIANCE, 8)
    message.block(np.zeros(6), 8).block(_UNKNOWN_COVARIANCE, 8)
    return "nav_msgs/msg/Odometry", message.done()


def _transforms(transforms: Sequence[Transform]) -> tuple[str, bytes]:
    message = CdrBuilder().values("I", len(transforms))
    for t in transforms:
        message.header(t.stamp_ns, t.parent).text(t.child)
        message.values("d", *t.matrix[:3, 3], *quaternions_from_matrices(t.matrix[None])[0])
    return "tf2_msgs/msg/TFMessage", message.done()


def _pose(pose: StampedPose) -> tuple[str, bytes]:
    message = CdrBuilder().header(pose.stamp_ns, pose.frame_id).block(planar_numbers(pose.pose), 8)
    if pose.covariance is None:
        return "geometry_msgs/msg/PoseStamped", message.done()
    message.block(covariance_numbers(pose.covariance), 8)
    return "geometry_msgs/msg/PoseWithCovarianceStamped", message.done()


def _grid(grid: OccupancyGrid) -> tuple[str, bytes]:
    height, width = grid.cells.shape
    message = CdrBuilder().header(grid.stamp_ns, grid.frame_id).time(grid.stamp_ns)
    message.values("f", grid.resolution_m).values("I", width, height).block(planar_numbers(grid.origin), 8)
    message.sequence(grid.cells.astype(np.int8), 1, count=grid.cells.size)
    return "nav_msgs/msg/OccupancyGrid", message.done()


def _image(image: CameraImage) -> tuple[str, bytes]:
    message = CdrBuilder().header(image.stamp_ns, image.frame_id)
    if not image.height:
        message.text(image.encoding).sequence(image.data, 1)
        return "sensor_msgs/msg/CompressedImage", message.done()
    message.values("I", image.height, image.width).text(image.encoding)
    message.values("B", 0).values("I", image.step).sequence(image.data, 1)
    return "sensor_msgs/msg/Image", message.done()


def _camera_info(info: CameraInfo) -> tuple[str, bytes]:
    message = CdrBuilder().header(info.stamp_ns, info.frame_id).values("I", info.height, info.width)
    message.text(info.model).sequence(info.d.astype("<f8"), 8)
    for matrix in (info.k, info.r, info.p):
        message.block(matrix.astype("<f8").ravel(), 8)
    message.values("I", 0, 0).values("I", 0, 0, 0, 0).values("B", 0)
    return "sensor_msgs/msg/CameraInfo", message.done()


def _cloud(cloud: PointCloud) -> tuple[str, bytes]:
    columns: dict[str, Float64Array | Any] = dict(zip("xyz", cloud.points_m.T, strict=True))
    if cloud.intensities is not None:
        columns["intensity"] = cloud.intensities
    if cloud.offsets_s is not None:
        columns["time"] = cloud.offsets_s
    return "sensor_msgs/msg/PointCloud2", cloud_message(cloud.stamp_ns, cloud.frame_id, columns)


def cloud_message(stamp_ns: int, frame_id: str, columns: Mapping[str, Any]) -> bytes:
    """A sensor_msgs/PointCloud2 of float32 columns (P,) by name."""
    table = np.stack([np.asarray(c, dtype="<f4") for c in columns.values()], axis=-1)
    count, step = len(table), 4 * table.shape[1]
    message = CdrBuilder().header(stamp_ns, frame_id).values("I", 1, count, len(columns))
    for i, name in enumerate(columns):
        message.text(name).values("I", 4 * i).values("B", _FLOAT32).values("I", 1)
    message.values("B", 0).values("I", step, step * count)
    message.sequence(table.tobytes(), 1).values("B", 1)
    return message.done()


def _text(text: str) -> tuple[str, bytes]:
    return "std_msgs/msg/String", CdrBuilder().text(text).done()


ENCODERS: dict[type, Callable[[Any], tuple[str, bytes]]] = {
    Scan: _scan,
    Odometry: _odometry,
    tuple: _transforms,
    StampedPose: _pose,
    OccupancyGrid: _grid,
    CameraImage: _image,
    CameraInfo: _camera_info,
    PointCloud: _cloud,
    str: _text,
}
