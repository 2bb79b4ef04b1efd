"""One example of every message type, as the fields of a message and the core type that it means; and their encoders."""

from __future__ import annotations

from typing import Any

import numpy as np
from google.protobuf.descriptor_pb2 import FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet
from google.protobuf.descriptor_pool import DescriptorPool
from google.protobuf.message_factory import GetMessageClassesForFiles

from wallkit.core.types import CameraImage, CameraInfo, Odometry, PointCloud, Scan, StampedPose, Transform

STAMP_NS = 1_700_000_000_000_000_005
HALF_TURN = np.sqrt(0.5)
YAW_90 = {"x": 0.0, "y": 0.0, "z": HALF_TURN, "w": HALF_TURN}
POSE = {"position": {"x": 1.0, "y": 2.0, "z": 0.5}, "orientation": YAW_90}
PLANAR = np.array([1.0, 2.0, np.pi / 2])
MATRIX = np.array([[0.0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]])
XYZ = np.float32([[1, 2, 3], [4, 5, 6]])
HEADER = {"stamp": {"sec": STAMP_NS // 10**9, "nanosec": 5}, "frame_id": "/frame"}
INFO = {
    "height": 480,
    "width": 640,
    "distortion_model": "plumb_bob",
    "d": [0.1, 0.2, 0.3, 0.4, 0.5],
    "k": [500.0, 0, 320, 0, 501, 240, 0, 0, 1],
    "r": np.eye(3).ravel().tolist(),
    "p": [500.0, 0, 320, 0, 0, 501, 240, 0, 0, 0, 1, 0],
}
CAMERA_INFO = CameraInfo(
    STAMP_NS,
    "frame",
    640,
    480,
    "plumb_bob",
    np.array(INFO["d"]),
    np.array(INFO["k"]).reshape(3, 3),
    np.eye(3),
    np.array(INFO["p"]).reshape(3, 4),
)
SCAN = {
    "angle_min": -0.5,
    "angle_max": 0.5,
    "angle_increment": 0.5,
    "time_increment": 0.001,
    "range_min": 0.1,
    "range_max": 9.0,
}
TRANSFORM = {
    "header": HEADER,
    "child_frame_id": "/child",
    "transform": {"translation": {"x": 1.0, "y": 2.0, "z": 3.0}, "rotation": YAW_90},
}
GRID_INFO = {"resolution": 0.05, "width": 3, "height": 2, "origin": POSE}
CLOUD = {
    "height": 1,
    "width": 2,
    "is_bigendian": False,
    "point_step": 12,
    "row_step": 24,
    "is_dense": True,
    "fields": [{"name": n, "offset": 4 * i, "datatype": 7, "count": 1} for i, n in enumerate("xyz")],
    "data": np.frombuffer(XYZ.tobytes(), np.uint8),
}
FLOATS = np.float32([1.0, 2.0, 3.0])
ANGLES = np.float32([-0.5, 0.0, 0.5])
LINK = Transform(STAMP_NS, "frame", "child", MATRIX)
COVARIANCE = np.zeros(36)
COVARIANCE[[0, 7, 35]] = 0.1, 0.2, 0.3
REST = {"x": 0.0, "y": 0.0, "z": 0.0}
SIX = np.arange(6, dtype=np.uint8)
IMAGE = CameraImage(STAMP_NS, "frame", "rgb8", bytes(range(6)), 1, 2, 6)
JPEG = CameraImage(STAMP_NS, "frame", "jpeg", b"\xff\xd8\xff")

ROS: dict[str, tuple[dict[str, Any], Any]] = {
    "sensor_msgs/LaserScan": (
        {"header": HEADER, **SCAN, "scan_time": 0.1, "ranges": FLOATS, "intensities": FLOATS},
        Scan(STAMP_NS, "frame", FLOATS, ANGLES, 0.001, 0.1, 9.0),
    ),
    "sensor_msgs/MultiEchoLaserScan": (
        {
            "header": HEADER,
            **SCAN,
            "scan_time": 0.1,
            "ranges": [{"echoes": np.float32(e)} for e in ([1, 5], [2], [])],
            "intensities": [],
        },
        Scan(STAMP_NS, "frame", np.float32([1, 2, np.inf]), ANGLES, 0.001, 0.1, 9.0),
    ),
    "sensor_msgs/PointCloud2": ({"header": HEADER, **CLOUD}, PointCloud(STAMP_NS, "frame", XYZ)),
    "sensor_msgs/Image": (
        {
            "header": HEADER,
            "height": 1,
            "width": 2,
            "encoding": "rgb8",
            "is_bigendian": 0,
            "step": 6,
            "data": np.arange(6, dtype=np.uint8),
        },
        IMAGE,
    ),
    "sensor_msgs/CompressedImage": (
        {"header": HEADER, "format": "bgr8; jpeg compressed bgr8", "data": np.uint8([255, 216, 255])},
        JPEG,
    ),
    "sensor_msgs/CameraInfo": (
        {
            "header": HEADER,
            **INFO,
            "binning_x": 0,
            "binning_y": 0,
            "roi": {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False},
        },
        CAMERA_INFO,
    ),
    "nav_msgs/Odometry": (
        {
            "header": HEADER,
            "child_frame_id": "/child",
            "pose": {"pose": POSE, "covariance": COVARIANCE},
            "twist": {
                "twist": {"linear": {"x": 0, "y": 0, "z": 0}, "angular": {"x": 0, "y": 0, "z": 0}},
                "covariance": COVARIANCE,
            },
        },
        Odometry(STAMP_NS, PLANAR, "frame", "child"),
    ),
    "nav_msgs/OccupancyGrid": (
        {
            "header": HEADER,
            "info": {"map_load_time": HEADER["stamp"], **GRID_INFO},
            "data": np.int8([-1, 0, 100, 1, 2, 3]),
        },
        None,
    ),
    "tf2_msgs/TFMessage": ({"transforms": [TRANSFORM]}, (LINK,)),
    "tf/tfMessage": ({"transforms": [TRANSFORM]}, (LINK,)),
    "geometry_msgs/TransformStamped": (TRANSFORM, (LINK,)),
    "geometry_msgs/PoseStamped": ({"header": HEADER, "pose": POSE}, StampedPose(STAMP_NS, "frame", PLANAR)),
    "geometry_msgs/PoseWithCovarianceStamped": (
        {"header": HEADER, "pose": {"pose": POSE, "covariance": COVARIANCE}},
        StampedPose(STAMP_NS, "frame", PLANAR, np.diag([0.1, 0.2, 0.3])),
    ),
    "std_msgs/String": ({"data": "<robot/>"}, "<robot/>"),
}

TIME = {"sec": STAMP_NS // 10**9, "nsec": 5}
FRAME = {"timestamp": TIME, "frame_id": "frame"}
NOWHERE = {"position": {"x": 0.0, "y": 0.0, "z": 0.0}, "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}}
FOXGLOVE_TRANSFORM = {
    "timestamp": TIME,
    "parent_frame_id": "frame",
    "child_frame_id": "child",
    "translation": {"x": 1.0, "y": 2.0, "z": 3.0},
    "rotation": YAW_90,
}
FOXGLOVE: dict[str, tuple[dict[str, Any], Any]] = {
    "foxglove.LaserScan": (
        {**FRAME, "pose": NOWHERE, "start_angle": -0.5, "end_angle": 0.5, "ranges": [1.0, 2.0, 3.0], "intensities": []},
        Scan(STAMP_NS, "frame", FLOATS, ANGLES, 0.0, 0.0, np.inf),
    ),
    "foxglove.PointCloud": (
        {
            **FRAME,
            "pose": NOWHERE,
            "point_stride": 12,
            "fields": [{"name": n, "offset": 4 * i, "type": 7} for i, n in enumerate("xyz")],
            "data": XYZ.tobytes(),
        },
        PointCloud(STAMP_NS, "frame", XYZ),
    ),
    "foxglove.RawImage": (
        {**FRAME, "width": 2, "height": 1, "encoding": "rgb8", "step": 6, "data": bytes(range(6))},
        IMAGE,
    ),
    "foxglove.CompressedImage": ({**FRAME, "data": b"\xff\xd8\xff", "format": "jpeg"}, JPEG),
    "foxglove.CompressedVideo": (
        {**FRAME, "data": b"abc", "format": "h264"},
        CameraImage(STAMP_NS, "frame", "h264", b"abc"),
    ),
    "foxglove.CameraCalibration": (
        {**FRAME, **{k.upper() if len(k) == 1 else k: v for k, v in INFO.items()}},
        CAMERA_INFO,
    ),
    "foxglove.FrameTransform": (FOXGLOVE_TRANSFORM, (LINK,)),
    "foxglove.FrameTransforms": ({"transforms": [FOXGLOVE_TRANSFORM]}, (LINK,)),
    "foxglove.PoseInFrame": ({**FRAME, "pose": POSE}, StampedPose(STAMP_NS, "frame", PLANAR)),
    "foxglove.Odometry": (
        {**FRAME, "body_frame_id": "child", "pose": POSE},
        Odometry(STAMP_NS, PLANAR, "frame", "child"),
    ),
}


def ros_message(store, name, fields):
    """A rosbags object of nested dicts, fields by either spelling."""
    values = []
    for field, (kind, inner) in store.fielddefs[name][1]:
        value = fields.get(field, fields.get(field.lower(), 0))
        if kind == 2:  # another message
            value = ros_message(store, inner, value)
        elif kind in (3, 4) and inner[0][0] == 2:  # an array of messages
            value = [ros_message(store, inner[0][1], v) for v in value]
        elif kind in (3, 4) and inner[0][1][0] != "string":
            value = np.array(value, dtype={"byte": "u1", "char": "u1"}.get(inner[0][1][0], inner[0][1][0]))
        values.append(value)
    return store.types[name](*values)


def protobuf(kind: str, fields: dict[str, Any]) -> tuple[bytes, bytes]:
    """A FileDescriptorSet for a message of these fields, and the message: types follow from the values."""
    file = FileDescriptorProto(name="drawn.proto", package="foxglove", syntax="proto3")
    names: dict[str, None] = {}
    _describe_message(file, names, kind.rpartition(".")[2], fields)
    pool = DescriptorPool()
    pool.Add(file)
    message = GetMessageClassesForFiles(["drawn.proto"], pool)[kind]()
    _fill(message, fields)
    return FileDescriptorSet(file=[file]).SerializeToString(), message.SerializeToString()


PARTS = {
    "timestamp": "Time",
    "position": "Vector3",
    "translation": "Vector3",
    "orientation": "Quaternion",
    "rotation": "Quaternion",
}
PARTS |= {"pose": "Pose", "fields": "PackedElementField", "transforms": "FrameTransform"}
WHOLE_NUMBERS = {"sec", "nsec", "seconds", "nanos", "width", "height", "step", "offset", "type", "point_stride"}
FULL_POSE = {"position": POSE["position"], "orientation": YAW_90}


def _renamed(fields: dict[str, Any]) -> dict[str, Any]:
    """google.protobuf.Timestamp spells a time in its own way."""
    return {"seconds": fields["sec"], "nanos": fields["nsec"]} if set(fields) == {"sec", "nsec"} else fields


def _describe_message(file: FileDescriptorProto, names: dict[str, None], name: str, fields: dict[str, Any]) -> None:
    if name in names:
        return
    names[name] = None
    message = file.message_type.add(name=name)
    for number, (field, value) in enumerate(_renamed(fields).items(), start=1):
        is_list = isinstance(value, list)
        one = value[0] if is_list and value else 0.0 if is_list else value
        label = FieldDescriptorProto.LABEL_REPEATED if is_list else FieldDescriptorProto.LABEL_OPTIONAL
        entry = message.field.add(name=field, number=number, label=label)
        if isinstance(one, dict):
            entry.type = FieldDescriptorProto.TYPE_MESSAGE
            entry.type_name = f".foxglove.{PARTS[field]}"
            _describe_message(file, names, PARTS[field], one or FULL_POSE)
        elif isinstance(one, bytes):
            entry.type = FieldDescriptorProto.TYPE_BYTES
        elif isinstance(one, str):
            entry.type = FieldDescriptorProto.TYPE_STRING
        elif field in WHOLE_NUMBERS:
            entry.type = FieldDescriptorProto.TYPE_INT64
        else:
            entry.type = FieldDescriptorProto.TYPE_DOUBLE


def _fill(message: Any, fields: dict[str, Any]) -> None:
    for name, value in _renamed(fields).items():
        if isinstance(value, dict):
            getattr(message, name).SetInParent()
            _fill(getattr(message, name), value)
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            for item in value:
                _fill(getattr(message, name).add(), item)
        elif isinstance(value, list):
            getattr(message, name).extend(value)
        else:
            setattr(message, name, value)
