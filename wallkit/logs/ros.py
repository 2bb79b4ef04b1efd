"""Message objects of ROS 1 and ROS 2 -> core types.

The objects come from rosbags (attributes named as in the .msg files) or from JSON; fields that ROS 1 and ROS 2 spell
differently (CameraInfo's D, K, R, P) are taken by either name.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from wallkit.core.geometry import matrix_from_quaternion
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
from wallkit.logs.cdr import beam_angles, frame_name, planar_pose
from wallkit.logs.clouds import Rows, cloud_from_rows
from wallkit.logs.message import Channel, Value

# sensor_msgs/PointField: INT8, UINT8, INT16, UINT16, INT32, UINT32, FLOAT32, FLOAT64
_POINT_FIELDS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
# rows and columns of x, y, yaw in the 6 x 6 covariance of (x, y, z, roll, pitch, yaw)
_PLANAR = np.ix_((0, 1, 5), (0, 1, 5))


def stamp_ns(time: Any) -> int:
    """Nanoseconds of a time message; JSON of Foxglove says `nsec`, protobuf `seconds` and `nanos`."""
    if hasattr(time, "seconds"):
        return int(time.seconds) * 1_000_000_000 + int(time.nanos)
    nanoseconds = time.nanosec if hasattr(time, "nanosec") else time.nsec if hasattr(time, "nsec") else time.nsecs
    return int(time.sec if hasattr(time, "sec") else time.secs) * 1_000_000_000 + int(nanoseconds)


def pose_from_parts(position: Any, orientation: Any) -> Float64Array:
    """(3,) planar pose of a position and an orientation message."""
    q = orientation
    return planar_pose(position.x, position.y, q.x, q.y, q.z, q.w)


def matrix_from_parts(translation: Any, rotation: Any) -> Float64Array:
    """(4, 4) transform of a translation and a rotation message."""
    t, q = translation, rotation
    matrix = matrix_from_quaternion((t.x, t.y, t.z), (q.x, q.y, q.z, q.w))
    if not np.isfinite(matrix).all():
        raise ValueError(f"not a transform: translation {[t.x, t.y, t.z]}")
    return matrix


def _scan(m: Any, _: Channel) -> Scan:
    ranges = np.asarray(m.ranges, dtype=np.float32)
    angles = beam_angles(float(m.angle_min), float(m.angle_increment), len(ranges))
    limits = float(m.time_increment), float(m.range_min), float(m.range_max)
    return Scan(stamp_ns(m.header.stamp), frame_name(m.header.frame_id), ranges, angles, *limits)


def _multi_echo_scan(m: Any, _: Channel) -> Scan:
    """The first echo of each beam: what a planar LiDAR without echoes would have seen."""
    ranges = np.array([beam.echoes[0] if len(beam.echoes) else np.inf for beam in m.ranges], dtype=np.float32)
    angles = beam_angles(float(m.angle_min), float(m.angle_increment), len(ranges))
    limits = float(m.time_increment), float(m.range_min), float(m.range_max)
    return Scan(stamp_ns(m.header.stamp), frame_name(m.header.frame_id), ranges, angles, *limits)


def _cloud(m: Any, _: Channel) -> PointCloud:
    order = ">" if m.is_bigendian else "<"
    fields = {f.name: (int(f.offset), order + _POINT_FIELDS[int(f.datatype)]) for f in m.fields}
    rows = Rows(bytes(m.data), int(m.height), int(m.width), int(m.point_step), int(m.row_step))
    return cloud_from_rows(stamp_ns(m.header.stamp), frame_name(m.header.frame_id), rows, fields)


def _odometry(m: Any, _: Channel) -> Odometry:
    pose = pose_from_parts(m.pose.pose.position, m.pose.pose.orientation)
    return Odometry(stamp_ns(m.header.stamp), pose, frame_name(m.header.frame_id), frame_name(m.child_frame_id))


def transform_from_stamped(m: Any, channel: Channel) -> Transform:
    """A geometry_msgs/TransformStamped."""
    matrix = matrix_from_parts(m.transform.translation, m.transform.rotation)
    parent, child = frame_name(m.header.frame_id), frame_name(m.child_frame_id)
    return Transform(stamp_ns(m.header.stamp), parent, child, matrix, channel.is_static)


def _pose_stamped(m: Any, _: Channel) -> StampedPose:
    pose = pose_from_parts(m.pose.position, m.pose.orientation)
    return StampedPose(stamp_ns(m.header.stamp), frame_name(m.header.frame_id), pose)


def _pose_with_covariance(m: Any, _: Channel) -> StampedPose:
    pose = pose_from_parts(m.pose.pose.position, m.pose.pose.orientation)
    covariance = np.array(m.pose.covariance, dtype=np.float64).reshape(6, 6)[_PLANAR]
    return StampedPose(stamp_ns(m.header.stamp), frame_name(m.header.frame_id), pose, covariance)


def _grid(m: Any, channel: Channel) -> OccupancyGrid:
    height, width, resolution = int(m.info.height), int(m.info.width), float(m.info.resolution)
    cells = np.array(m.data, dtype=np.int8)
    if cells.size != height * width or not resolution > 0:
        raise ValueError(f"{cells.size} cells of {resolution} m do not make a grid of {height} x {width}")
    origin = pose_from_parts(m.info.origin.position, m.info.origin.orientation)
    when, frame_id = stamp_ns(m.header.stamp), frame_name(m.header.frame_id)
    return OccupancyGrid(cells.reshape(height, width), resolution, origin, channel.topic, when, frame_id)


def _image(m: Any, _: Channel) -> CameraImage:
    size = int(m.height), int(m.width), int(m.step)
    data = little_endian(bytes(m.data), m.encoding) if m.is_bigendian else bytes(m.data)
    return CameraImage(stamp_ns(m.header.stamp), frame_name(m.header.frame_id), m.encoding, data, *size)


def little_endian(data: bytes, encoding: str) -> bytes:
    """The same pixels with their bytes swapped, where the encoding has more than one byte a channel."""
    for word, code in (("16", "u2"), ("32", "u4"), ("64", "u8")):
        if word in encoding:
            return np.frombuffer(data, f">{code}").astype(f"<{code}").tobytes()
    return data


def _compressed_image(m: Any, _: Channel) -> CameraImage:
    encoding = compressed_encoding(m.format)
    return CameraImage(stamp_ns(m.header.stamp), frame_name(m.header.frame_id), encoding, bytes(m.data))


def compressed_encoding(words: str) -> str:
    """ "jpeg", "png", "webp" from what drivers write into `format` ("bgr8; jpeg compressed bgr8", "jpg", "PNG")."""
    lower = words.lower()
    for word, name in (("jpeg", "jpeg"), ("jpg", "jpeg"), ("png", "png"), ("webp", "webp")):
        if word in lower:
            return name
    return lower


def _camera_info(m: Any, _: Channel) -> CameraInfo:
    def numbers(name: str) -> Float64Array:
        values = getattr(m, name) if hasattr(m, name) else getattr(m, name.upper())
        return np.array(values, dtype=np.float64)

    return CameraInfo(
        stamp_ns(m.header.stamp),
        frame_name(m.header.frame_id),
        int(m.width),
        int(m.height),
        str(m.distortion_model),
        numbers("d"),
        numbers("k").reshape(3, 3),
        numbers("r").reshape(3, 3),
        numbers("p").reshape(3, 4),
    )


ROS_DECODERS: Mapping[str, Callable[[Any, Channel], Value]] = {
    "sensor_msgs/LaserScan": _scan,
    "sensor_msgs/MultiEchoLaserScan": _multi_echo_scan,
    "sensor_msgs/PointCloud2": _cloud,
    "sensor_msgs/Image": _image,
    "sensor_msgs/CompressedImage": _compressed_image,
    "sensor_msgs/CameraInfo": _camera_info,
    "nav_msgs/Odometry": _odometry,
    "nav_msgs/OccupancyGrid": _grid,
    "tf2_msgs/TFMessage": lambda m, channel: tuple(transform_from_stamped(t, channel) for t in m.transforms),
    "tf/tfMessage": lambda m, channel: tuple(transform_from_stamped(t, channel) for t in m.transforms),
    "geometry_msgs/TransformStamped": lambda m, channel: (transform_from_stamped(m, channel),),
    "geometry_msgs/PoseStamped": _pose_stamped,
    "geometry_msgs/PoseWithCovarianceStamped": _pose_with_covariance,
    "std_msgs/String": lambda m, _: str(m.data),
}
