"""Small recordings drawn for the tests: a robot in a square room, written by our own writer or by the mcap library."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from mcap.writer import CompressionType, IndexType, Writer

from wallkit.core.geometry import compose, matrix_from_pose, pose_from_matrix, transform_points
from wallkit.core.types import Float64Array, Odometry, Scan, Transform
from wallkit.logs.encode import encode
from wallkit.logs.message import Value
from wallkit.logs.writer import McapWriter

SECOND_NS = 1_000_000_000
START_NS = 1_700_000_000 * SECOND_NS
# half a side of the room, whose middle is the origin [m]
ROOM_M = 3.0
Motion = Callable[[float], tuple[float, float, float]]


def pose_at(motion: Motion, stamp_ns: int) -> Float64Array:
    """(3,) T_map_base of a motion given in seconds since the start."""
    return np.array(motion((stamp_ns - START_NS) / SECOND_NS))


def sweep(
    motion: Motion,
    stamp_ns: int,
    *,
    mount: Float64Array | None = None,
    angles: Float64Array | None = None,
    interval_s: float = 0.0,
) -> Scan:
    """What a planar LiDAR at T_base_lidar (3,) measures of the room, beam after beam, while the robot moves."""
    mount = np.zeros(3) if mount is None else mount
    angles = np.deg2rad(np.arange(-180, 180, 1.0)) if angles is None else angles
    ranges = np.empty(len(angles))
    for k, angle in enumerate(angles):
        lidar = compose(pose_at(motion, stamp_ns + round(k * interval_s * SECOND_NS)), mount)
        direction = np.array([np.cos(lidar[2] + angle), np.sin(lidar[2] + angle)])
        with np.errstate(divide="ignore", over="ignore"):
            ranges[k] = np.min(np.where(direction > 0, ROOM_M - lidar[:2], ROOM_M + lidar[:2]) / np.abs(direction))
    limits = 0.05, 20.0
    return Scan(stamp_ns, "laser", ranges.astype(np.float32), angles.astype(np.float32), interval_s, *limits)


def distance_to_walls(points_map: Float64Array) -> Float64Array:
    """(K,) distance of points (K, 2) to the room's four walls, lines without end."""
    return np.abs(np.abs(points_map) - ROOM_M).min(axis=1)


def on_walls(pose: Float64Array, points_base: Float64Array) -> Float64Array:
    """(K,) distance to the walls of points seen from a pose."""
    return distance_to_walls(transform_points(pose, points_base))


def drive() -> Motion:
    """A drive that turns and moves, inside the room."""
    return lambda t: (0.8 * np.sin(0.7 * t), 0.5 * np.cos(0.4 * t), 0.6 * t)


def log_of(
    motion: Motion,
    *,
    seconds: float = 4.0,
    scan_hz: float = 5.0,
    odometry_hz: float = 50.0,
    mount: Float64Array | None = None,
    interval_s: float = 0.0,
) -> list[tuple[int, str, Value]]:
    """(stamp, topic, value) of a drive with /scan, /odom and /tf_static, by stamp."""
    mount = np.zeros(3) if mount is None else mount
    messages: list[tuple[int, str, Value]] = []
    static = Transform(START_NS, "base_link", "laser", matrix_from_pose(mount), is_static=True)
    messages.append((START_NS, "/tf_static", (static,)))
    for k in range(round(seconds * odometry_hz) + 1):
        stamp_ns = START_NS + round(k / odometry_hz * SECOND_NS)
        messages.append((stamp_ns, "/odom", Odometry(stamp_ns, pose_at(motion, stamp_ns))))
    for k in range(round(seconds * scan_hz)):
        stamp_ns = START_NS + round(k / scan_hz * SECOND_NS)
        messages.append((stamp_ns, "/scan", sweep(motion, stamp_ns, mount=mount, interval_s=interval_s)))
    return sorted(messages, key=lambda m: m[0])


def write(path: Path, messages: Iterable[tuple[int, str, Value]], *, log_offset_ns: int = 0) -> Path:
    """A recording by our own writer; record time is the stamp plus an offset."""
    with McapWriter(path) as file:
        for stamp_ns, topic, value in messages:
            file.write(topic, value, stamp_ns + log_offset_ns)
    return path


def write_bag(path: Path, messages: Iterable[tuple[int, str, Value]], *, legacy_tf: bool = False) -> Path:
    """The same as a ROS 1 bag, through rosbags; transforms as the old tf/tfMessage where wanted."""
    from rosbags.rosbag1 import Writer as BagWriter
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    ros1, ros2 = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_HUMBLE)
    for name in ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage"):
        ros1.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", name))
    path.unlink(missing_ok=True)
    with BagWriter(path) as bag:
        connections: dict[tuple[str, str], Any] = {}
        for number, (stamp_ns, topic, value) in enumerate(messages):
            name, data = encode(value)
            message = _ros1_message(ros1, ros2.deserialize_cdr(data, name), number)
            name = "tf/msg/tfMessage" if legacy_tf and name.endswith("TFMessage") else name
            if (topic, name) not in connections:
                connections[(topic, name)] = bag.add_connection(topic, name, typestore=ros1)
            bag.write(connections[(topic, name)], stamp_ns, ros1.serialize_ros1(message, name))
    return path


def _ros1_message(ros1: Any, message: Any, number: int) -> Any:
    """A ROS 2 message object as the ROS 1 object of the same type: headers get their `seq`."""
    if isinstance(message, list):
        return [_ros1_message(ros1, item, number) for item in message]
    name = getattr(message, "__msgtype__", None)
    if name is None:
        return message
    if name == "std_msgs/msg/Header":
        return ros1.types[name](seq=number, stamp=_ros1_message(ros1, message.stamp, number), frame_id=message.frame_id)
    fields = [field for field, _ in ros1.fielddefs[name][1]]
    values = [getattr(message, field if hasattr(message, field) else field.lower()) for field in fields]
    return ros1.types[name](*[_ros1_message(ros1, value, number) for value in values])


def write_rosbag2(path: Path, messages: Iterable[tuple[int, str, Value]], *, storage: str = "sqlite3") -> Path:
    """The same as a rosbag2 directory, through rosbags."""
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Bag2Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    with Bag2Writer(path, version=9, storage_plugin=StoragePlugin[storage.upper()]) as bag:
        connections: dict[str, Any] = {}
        for stamp_ns, topic, value in messages:
            name, data = encode(value)
            if topic not in connections:
                connections[topic] = bag.add_connection(topic, name, typestore=store)
            bag.write(connections[topic], stamp_ns, data)
    return path


def write_carmen(path: Path, messages: Iterable[tuple[int, str, Value]]) -> Path:
    """The scans and odometry of the same as CARMEN lines."""
    last = np.zeros(3)
    mount = np.zeros(3)
    lines = ["# message_name [message contents] ipc_timestamp ipc_hostname logger_timestamp"]
    for stamp_ns, _, value in messages:
        if isinstance(value, tuple):
            mount = pose_from_matrix(value[0].matrix)
        seconds, nanoseconds = divmod(stamp_ns, SECOND_NS)
        tail = f"{seconds}.{nanoseconds:09d} host {(stamp_ns - START_NS) / 1e9:.6f}"
        if isinstance(value, Odometry):
            last = value.pose
            lines.append(f"ODOM {words(last)} 0 0 0 {tail}")
        elif isinstance(value, Scan):
            first, step, count = value.angles_rad[0], np.diff(value.angles_rad).mean(), len(value.ranges_m)
            head = f"ROBOTLASER1 0 {first} {step * (count - 1)} {step} 20.0 0.01 0 {count}"
            poses = f"{words(compose(last, mount))} {words(last)}"
            lines.append(f"{head} {words(value.ranges_m)} 0 {poses} 0 0 0 0 0 {tail}")
    path.write_text("\n".join(lines) + "\n")
    return path


def words(numbers: Iterable[float]) -> str:
    """Numbers as text."""
    return " ".join(f"{float(n)!r}" for n in numbers)


def write_with_library(
    path: Path,
    messages: Sequence[tuple[int, str, Value]],
    *,
    chunk_size: int = 20_000,
    compression: CompressionType = CompressionType.ZSTD,
    use_chunking: bool = True,
    index_types: IndexType = IndexType.ALL,
    with_summary: bool = True,
    profile: str = "ros2",
) -> Path:
    """A recording by the mcap library with any of its options; definitions are those of rosbags."""
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    with path.open("wb") as file:
        writer = Writer(
            file,
            chunk_size=chunk_size,
            compression=compression,
            use_chunking=use_chunking,
            index_types=index_types,
            repeat_channels=with_summary,
            repeat_schemas=with_summary,
            use_statistics=with_summary,
            use_summary_offsets=with_summary,
        )
        writer.start(profile=profile, library="test")
        channels: dict[str, int] = {}
        for stamp_ns, topic, value in messages:
            name, data = encode(value)
            if topic not in channels:
                text = store.generate_msgdef(name, ros_version=2)[0].encode()
                channels[topic] = writer.register_channel(topic, "cdr", writer.register_schema(name, "ros2msg", text))
            writer.add_message(channels[topic], stamp_ns, data, stamp_ns)
        writer.finish()
    return path
