"""Message objects of the foxglove.* schemas (protobuf, JSON or foxglove_msgs of ROS 2) -> core types.

https://docs.foxglove.dev/docs/sdk/schemas. Field names are the same in all encodings.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from wallkit.core.types import CameraImage, CameraInfo, Float64Array, Odometry, PointCloud, Scan, StampedPose, Transform
from wallkit.logs.cdr import beam_angles, frame_name
from wallkit.logs.clouds import Rows, cloud_from_rows, transformed
from wallkit.logs.message import Channel, Value
from wallkit.logs.ros import compressed_encoding, matrix_from_parts, pose_from_parts, stamp_ns

# PackedElementField.NumericType: UINT8, INT8, UINT16, INT16, UINT32, INT32, FLOAT32, FLOAT64
_NUMERIC = {1: "<u1", 2: "<i1", 3: "<u2", 4: "<i2", 5: "<u4", 6: "<i4", 7: "<f4", 8: "<f8"}


def _scan(m: Any, _: Channel) -> Scan:
    """Bearings run evenly from start_angle to end_angle; the schema knows no range limits."""
    ranges = np.asarray(m.ranges, dtype=np.float32)
    increment = (m.end_angle - m.start_angle) / (len(ranges) - 1) if len(ranges) > 1 else 0.0
    angles = beam_angles(float(m.start_angle), float(increment), len(ranges))
    scan = Scan(stamp_ns(m.timestamp), frame_name(m.frame_id), ranges, angles, 0.0, 0.0, float("inf"))
    origin = _matrix(m.pose)
    return scan if np.allclose(origin, np.eye(4)) else _moved(scan, origin)


def _moved(scan: Scan, origin: Float64Array) -> Scan:
    """The scan seen from its frame when its own origin stands elsewhere in it: T_frame_scan applied to each return."""
    ranges = np.where(np.isfinite(scan.ranges_m), scan.ranges_m, 1.0).astype(np.float64)
    bearing = np.stack([np.cos(scan.angles_rad), np.sin(scan.angles_rad), np.zeros(len(ranges))], axis=-1)
    rotated = bearing @ origin[:3, :3].T
    hits = rotated * ranges[:, None] + origin[:3, 3]
    seen = np.where(np.isfinite(scan.ranges_m)[:, None], hits, rotated)
    return replace(
        scan,
        ranges_m=np.where(np.isfinite(scan.ranges_m), np.hypot(hits[:, 0], hits[:, 1]), scan.ranges_m).astype(
            np.float32
        ),
        angles_rad=np.arctan2(seen[:, 1], seen[:, 0]).astype(np.float32),
        heights_m=seen[:, 2].astype(np.float32),
    )


def _cloud(m: Any, _: Channel) -> PointCloud:
    fields = {f.name: (int(f.offset), _NUMERIC[int(f.type)]) for f in m.fields}
    data, stride = bytes(m.data), int(m.point_stride)
    if stride <= 0 or len(data) % stride:
        raise ValueError(f"{len(data)} bytes are no whole number of points of {stride} bytes")
    rows = Rows(data, 1, len(data) // stride, stride, 0)
    cloud = cloud_from_rows(stamp_ns(m.timestamp), frame_name(m.frame_id), rows, fields)
    return replace(cloud, points_m=transformed(cloud.points_m, _matrix(m.pose)))


def _raw_image(m: Any, _: Channel) -> CameraImage:
    size = int(m.height), int(m.width), int(m.step)
    return CameraImage(stamp_ns(m.timestamp), frame_name(m.frame_id), m.encoding, bytes(m.data), *size)


def _compressed_image(m: Any, _: Channel) -> CameraImage:
    encoding = compressed_encoding(m.format)
    return CameraImage(stamp_ns(m.timestamp), frame_name(m.frame_id), encoding, bytes(m.data))


def _calibration(m: Any, _: Channel) -> CameraInfo:
    def numbers(name: str) -> Float64Array:
        return np.array(getattr(m, name) if hasattr(m, name) else getattr(m, name.lower()), dtype=np.float64)

    k = numbers("K").reshape(3, 3)
    # a camera without rectification may leave R and P empty
    r, p = numbers("R"), numbers("P")
    return CameraInfo(
        stamp_ns(m.timestamp),
        frame_name(m.frame_id),
        int(m.width),
        int(m.height),
        str(m.distortion_model),
        numbers("D"),
        k,
        r.reshape(3, 3) if r.size else np.eye(3),
        p.reshape(3, 4) if p.size else np.hstack([k, np.zeros((3, 1))]),
    )


def _transform(m: Any, channel: Channel) -> Transform:
    matrix = matrix_from_parts(m.translation, m.rotation)
    parent, child = frame_name(m.parent_frame_id), frame_name(m.child_frame_id)
    return Transform(stamp_ns(m.timestamp), parent, child, matrix, channel.is_static)


def _odometry(m: Any, _: Channel) -> Odometry:
    pose = pose_from_parts(m.pose.position, m.pose.orientation)
    return Odometry(stamp_ns(m.timestamp), pose, frame_name(m.frame_id), frame_name(m.body_frame_id))


def _pose(m: Any, _: Channel) -> StampedPose:
    pose = pose_from_parts(m.pose.position, m.pose.orientation)
    return StampedPose(stamp_ns(m.timestamp), frame_name(m.frame_id), pose)


def _matrix(pose: Any) -> Float64Array:
    """(4, 4) of a pose message; protobuf leaves an unset pose all zero, which means the identity."""
    p, q = pose.position, pose.orientation
    if (p.x, p.y, p.z, q.x, q.y, q.z, q.w) == (0,) * 7:
        return np.eye(4)
    return matrix_from_parts(p, q)


FOXGLOVE_DECODERS: Mapping[str, Callable[[Any, Channel], Value]] = {
    "foxglove.LaserScan": _scan,
    "foxglove.PointCloud": _cloud,
    "foxglove.RawImage": _raw_image,
    "foxglove.CompressedImage": _compressed_image,
    "foxglove.CompressedVideo": _compressed_image,
    "foxglove.CameraCalibration": _calibration,
    "foxglove.FrameTransform": lambda m, channel: (_transform(m, channel),),
    "foxglove.FrameTransforms": lambda m, channel: tuple(_transform(t, channel) for t in m.transforms),
    "foxglove.PoseInFrame": _pose,
    "foxglove.Odometry": _odometry,
}
