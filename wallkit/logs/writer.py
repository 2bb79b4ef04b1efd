"""Serialised ROS 2 messages -> one MCAP file, whole or not at all, the same bytes for the same messages."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Literal

from wallkit.errors import OutputError
from wallkit.logs.encode import encode
from wallkit.logs.message import Value

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

# what a publisher of things that hold for the whole recording offers, as rosbag2 notes it: keep the last, for late readers
LATCHED_QOS = (
    "- history: 1\n  depth: 1\n  reliability: 1\n  durability: 1\n"
    "  deadline:\n    sec: 9223372036\n    nsec: 854775807\n  lifespan:\n    sec: 9223372036\n    nsec: 854775807\n"
    "  liveliness: 1\n  liveliness_lease_duration:\n    sec: 9223372036\n    nsec: 854775807\n"
    "  avoid_ros_namespace_conventions: false"
)


class McapWriter:
    """A recording of ROS 2 messages being written; use it in a `with` block.

    The file appears under its name when the block ends well; when it ends by an exception, nothing is left behind.

    Args:
        path: the file to make. An existing one is replaced when the block ends.
        compression: "zstd" for the smaller file, "lz4" for half the time.
    """

    def __init__(self, path: Path, *, compression: Literal["zstd", "lz4"] = "zstd") -> None:
        from mcap.writer import CompressionType, Writer

        self._path = path
        self._partial = path.with_name(f".{path.name}.partial")
        try:
            self._file = self._partial.open("wb")
        except OSError as error:
            raise OutputError(
                f"cannot be written: {error.strerror}", where=path, hint="choose another place"
            ) from error
        self._writer = Writer(self._file, compression=CompressionType[compression.upper()])
        # a fixed name instead of the library's with its version: the same input gives the same bytes
        self._writer.start(profile="ros2", library="wallkit")
        self._schemas: dict[tuple[str, bytes], int] = {}
        self._channels: dict[tuple[str, str], int] = {}
        self._sequence: dict[int, int] = {}
        self._store: Typestore | None = None

    def __enter__(self) -> McapWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is not None:
            self._file.close()
            self._partial.unlink(missing_ok=True)
            return
        self._writer.finish()  # type: ignore[no-untyped-call]
        self._file.close()
        os.replace(self._partial, self._path)

    def write(self, topic: str, value: Value, log_ns: int, *, is_latched: bool = False) -> None:
        """A core type as its ROS 2 message."""
        type_name, data = encode(value)
        self.write_cdr(topic, type_name, log_ns, data, is_latched=is_latched)

    def write_cdr(
        self,
        topic: str,
        type_name: str,
        log_ns: int,
        data: bytes,
        *,
        schema: tuple[str, bytes] | None = None,
        is_latched: bool = False,
    ) -> None:
        """Serialised bytes of one message.

        Args:
            type_name: "package/msg/Type".
            log_ns: record time [ns], not negative.
            schema: (encoding, definition) where the type is not of the ROS 2 standard.
        """
        key = (topic, type_name)
        if key not in self._channels:
            self._channels[key] = self._channel(topic, type_name, schema, LATCHED_QOS if is_latched else "")
        channel = self._channels[key]
        sequence = self._sequence.get(channel, 0)
        self._sequence[channel] = sequence + 1
        self._writer.add_message(channel, log_ns, data, log_ns, sequence)

    def write_metadata(self, name: str, entries: Mapping[str, str]) -> None:
        """A named record of texts about the whole file."""
        self._writer.add_metadata(name, dict(sorted(entries.items())))

    def _channel(self, topic: str, type_name: str, schema: tuple[str, bytes] | None, qos: str) -> int:
        encoding, definition = schema or ("ros2msg", self._definition(type_name))
        key = (type_name, definition)
        if key not in self._schemas:
            self._schemas[key] = self._writer.register_schema(type_name, encoding, definition)
        return self._writer.register_channel(topic, "cdr", self._schemas[key], {"offered_qos_profiles": qos})

    def _definition(self, type_name: str) -> bytes:
        if self._store is None:
            from rosbags.typesys import Stores, get_typestore

            self._store = get_typestore(Stores.ROS2_HUMBLE)
        return self._store.generate_msgdef(type_name, ros_version=2)[0].encode()
