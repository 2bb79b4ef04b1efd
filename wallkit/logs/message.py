"""What a recording is made of: channels, and messages decoded into the nouns of `core.types`."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from typing import Protocol

from wallkit.core.types import (
    CameraImage,
    CameraInfo,
    OccupancyGrid,
    Odometry,
    PointCloud,
    Scan,
    StampedPose,
    Transform,
)

Value = (
    Scan | PointCloud | Odometry | tuple[Transform, ...] | StampedPose | OccupancyGrid | CameraImage | CameraInfo | str
)


@dataclass(frozen=True, slots=True)
class Channel:
    """One topic as one publisher wrote it.

    Attributes:
        topic: its name as written.
        type_name: "package/Type", however the file spells it ("package/msg/Type" and "foxglove.Type" included).
        encoding: of the messages: "cdr", "ros1", "protobuf", "json", "carmen", or what else the file says.
        schema_encoding: "ros2msg", "ros2idl", "ros1msg", "protobuf", "jsonschema", or "" without a schema.
        schema: the definition as stored; empty when the recorder did not keep it.
        count: messages in the files; None when the index does not say.
        qos: what the recorder noted about the publisher, for a faithful copy.
    """

    topic: str
    type_name: str
    encoding: str
    schema_encoding: str = ""
    schema: bytes = field(default=b"", repr=False)
    count: int | None = field(default=None, compare=False)
    qos: str = field(default="", repr=False, compare=False)

    @property
    def kind(self) -> str:
        """The type without ROS 2's "/msg/" and whatever else differs between spellings: "sensor_msgs/LaserScan"."""
        package, _, name = self.type_name.replace("/msg/", "/").rpartition("/")
        if package == "foxglove_msgs":
            return f"foxglove.{name}"
        return f"{package}/{name}" if package else name

    @property
    def is_static(self) -> bool:
        """Whether its transforms hold at any time."""
        return self.topic.rstrip("/").rpartition("/")[2] == "tf_static"


@dataclass(frozen=True, slots=True)
class Message:
    """One decoded message.

    Attributes:
        stamp_ns: header stamp; the record time of a message that carries no stamp.
        log_ns: when the recorder wrote it down. Real logs are days apart from their stamps: only good for order.
        type_name: as in its channel.
    """

    topic: str
    stamp_ns: int
    log_ns: int
    type_name: str
    value: Value


RawMessage = tuple[int, int, Channel, bytes]
"""(log_ns, number that keeps the file's order among equals, channel, serialised message)."""


class LogFile(Protocol):
    """One file of a recording. It can be read any number of times."""

    format: str
    channels: tuple[Channel, ...]

    def raw(self, topics: Collection[str] | None = None) -> Iterator[RawMessage]:
        """Serialised messages of the topics (None: of all), by record time as far as bounded memory allows."""
        ...
