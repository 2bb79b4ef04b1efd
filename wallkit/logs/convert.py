"""Any readable log -> one MCAP of ROS 2 messages, header stamps and record times as they were.

ROS 2 messages keep their bytes and definitions; ROS 1 messages are rewritten by rosbags, field by field, into the ROS 2
type of the same name; everything else (CARMEN, Foxglove protobuf and JSON) goes through the core types. What none of the
three can carry over is listed.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from wallkit.logs.decode import UndecodableError, UnknownTypeError, decoder
from wallkit.logs.encode import encode
from wallkit.logs.loss import Loss
from wallkit.logs.message import Channel
from wallkit.logs.reader import Log
from wallkit.logs.serialization import typestore_of
from wallkit.logs.writer import McapWriter

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

Converter = Callable[[bytes], "Converted"]
_LATCHED_TOPICS = ("tf_static", "robot_description", "map")
_RENAMED = {"tf/msg/tfMessage": "tf2_msgs/msg/TFMessage"}


@dataclass(frozen=True, slots=True)
class Converted:
    """One ROS 2 message, with the (encoding, definition) of its type where the ROS 2 standard does not know it."""

    type_name: str
    data: bytes
    schema: tuple[str, bytes] | None = None


@dataclass
class ConvertReport:
    """Messages written by topic, and why the rest was not."""

    written: Counter[str] = field(default_factory=Counter)
    skipped: dict[str, str] = field(default_factory=dict)


def convert_log(
    log: Log,
    path: Path,
    *,
    topics: Collection[str] | None = None,
    start_ns: int | None = None,
    end_ns: int | None = None,
) -> ConvertReport:
    """Write a log as one MCAP file.

    Args:
        topics: only these; None for all.
        start_ns, end_ns: only record times in [start, end), since not every type has a stamp; latched topics stay whole.

    Raises:
        OutputError: the file cannot be written.
    """
    report = ConvertReport()
    converters: dict[Channel, Converter | None] = {}
    low, high = start_ns or 0, 2**63 if end_ns is None else end_ns
    undecodable: Counter[str] = Counter()
    with McapWriter(path) as file:
        for log_ns, _, channel, data in log.raw(topics):
            is_latched = channel.topic.rstrip("/").rpartition("/")[2] in _LATCHED_TOPICS
            if not is_latched and not low <= log_ns < high:
                continue
            if channel not in converters:
                converters[channel] = _converter_or_none(channel, log.loss, report)
            convert = converters[channel]
            if convert is None:
                continue
            try:
                message = convert(data)
            except UndecodableError as error:
                undecodable[channel.topic] += 1
                log.loss.count_undecodable(channel.topic, undecodable[channel.topic], str(error))
                continue
            schema = message.schema
            file.write_cdr(channel.topic, message.type_name, log_ns, message.data, schema=schema, is_latched=is_latched)
            report.written[channel.topic] += 1
    return report


def _converter_or_none(channel: Channel, loss: Loss, report: ConvertReport) -> Converter | None:
    make = CONVERTERS.get(channel.encoding, _through_core_types)
    try:
        return make(channel, loss)
    except UnknownTypeError as error:
        report.skipped[channel.topic] = str(error)
        return None


def _kept(channel: Channel, loss: Loss) -> Converter:
    """ROS 2 bytes as they are."""
    if channel.schema.strip():
        schema = channel.schema_encoding, channel.schema
        return lambda data: Converted(channel.type_name, data, schema)
    _, name = typestore_of(channel, loss)
    return lambda data: Converted(name, data)


def _from_ros1(channel: Channel, loss: Loss) -> Converter:
    """ROS 1 bytes rewritten; a type whose fields ROS 2 changed is migrated, one it does not know keeps its definition."""
    from rosbags.convert.converter import is_same_wireformat, migrate_bytes
    from rosbags.typesys import Stores, get_typestore

    source, name = typestore_of(channel, loss)
    standard = get_typestore(Stores.ROS2_HUMBLE)
    target_name = _RENAMED.get(name, name)
    if target_name not in standard.fielddefs:
        own = _with_ros2_header(source, standard)
        schema = "ros2msg", own.generate_msgdef(name, ros_version=2)[0].encode()
        return _guarded(lambda data: own.ros1_to_cdr(data, name), name, schema)
    if is_same_wireformat(source, standard, name, target_name):
        return _guarded(lambda data: standard.ros1_to_cdr(data, target_name), target_name)
    cache: dict[str, object] = {}
    return _guarded(
        lambda data: migrate_bytes(source, standard, name, target_name, cache, data, src_is2=False, dst_is2=True),
        target_name,
    )


def _through_core_types(channel: Channel, loss: Loss) -> Converter:
    decode = decoder(channel, loss)

    def convert(data: bytes) -> Converted:
        value = decode(data)
        try:
            return Converted(*encode(value))
        except ValueError as error:
            raise UndecodableError(str(error)) from error

    return convert


def _with_ros2_header(source: Typestore, standard: Typestore) -> Typestore:
    """The same types, their std_msgs/Header without ROS 1's `seq`."""
    from rosbags.typesys import Stores, get_typestore

    header = "std_msgs/msg/Header"
    store = get_typestore(Stores.EMPTY)
    store.register({**source.fielddefs, header: standard.fielddefs[header]})
    return store


def _guarded(
    convert: Callable[[bytes], bytes | memoryview], type_name: str, schema: tuple[str, bytes] | None = None
) -> Converter:
    from rosbags.serde import SerdeError

    def guarded(data: bytes) -> Converted:
        try:
            return Converted(type_name, bytes(convert(data)), schema)
        except (SerdeError, ValueError) as error:
            raise UndecodableError(str(error)) from error

    return guarded


CONVERTERS: dict[str, Callable[[Channel, Loss], Converter]] = {
    "cdr": _kept,
    "ros1": _from_ros1,
    "protobuf": _through_core_types,
    "json": _through_core_types,
    "carmen": _through_core_types,
}
