"""A channel's encoding and schema -> a function that turns its bytes into an object with the message's fields."""

from __future__ import annotations

import json
from base64 import b64decode
from collections.abc import Callable
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

from wallkit.logs.loss import Loss
from wallkit.logs.message import Channel

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

Deserializer = Callable[[bytes], Any]


class UnknownTypeError(ValueError):
    """Why the messages of a channel cannot be turned into objects."""


def deserializer(channel: Channel, loss: Loss) -> Deserializer:
    """Bytes -> object with the message's fields as attributes.

    Raises:
        UnknownTypeError: no such encoding, or a definition is missing or cannot be parsed.
    """
    key = (channel.encoding, channel.schema_encoding)
    make = SERIALIZATIONS.get(key) or SERIALIZATIONS.get((channel.encoding, "*"))
    if make is None:
        raise UnknownTypeError(f"encoding {channel.encoding!r} with schema {channel.schema_encoding!r} is not known")
    return make(channel, loss)


def typestore_of(channel: Channel, loss: Loss) -> tuple[Typestore, str]:
    """A rosbags typestore that knows the channel's type, and the type's name in it.

    The definition comes from the channel itself; when it carries none, or one that does not parse, from the definitions
    of a ROS release, and the loss report says so.

    Raises:
        UnknownTypeError: neither knows the type.
    """
    from rosbags.typesys import Stores, TypesysError, get_typestore
    from rosbags.typesys.msg import normalize_msgtype

    # foreign writers spell types in many ways; "Type" alone has no package and no definition elsewhere
    name = normalize_msgtype(channel.type_name) if "/" in channel.type_name else channel.type_name
    problem = "no message definition in the file"
    if channel.schema.strip():
        try:
            return _store_from_schema(channel, name), name
        except (TypesysError, AssertionError, ValueError, KeyError) as error:
            problem = f"its message definition is unusable ({error!r})"
    release, stored = ("Noetic", Stores.ROS1_NOETIC) if channel.encoding == "ros1" else ("Humble", Stores.ROS2_HUMBLE)
    store = get_typestore(stored)
    if name not in store.fielddefs:
        raise UnknownTypeError(f"{problem}, and {channel.type_name!r} is no standard type")
    loss.note(f"{channel.topic}: {problem}; read as {channel.type_name} of ROS {release}")
    return store, name


def _store_from_schema(channel: Channel, name: str) -> Typestore:
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    text = channel.schema.decode()
    store = get_typestore(Stores.EMPTY)
    store.register(_types_from_idl(text) if channel.schema_encoding == "ros2idl" else get_types_from_msg(text, name))
    store.get_msgdef(name)  # fails here, not at the first message, when a part of the definition is missing
    return store


def _cdr(channel: Channel, loss: Loss) -> Deserializer:
    store, name = typestore_of(channel, loss)
    return lambda data: store.deserialize_cdr(data, name)


def _ros1(channel: Channel, loss: Loss) -> Deserializer:
    store, name = typestore_of(channel, loss)
    return lambda data: store.deserialize_ros1(data, name)


def _types_from_idl(text: str) -> dict[str, Any]:
    """Types of a rosbag2 IDL schema: one file, or several behind "====\\nIDL: name" lines."""
    from rosbags.typesys import get_types_from_idl

    separator = "=" * 80 + "\n"
    if not text.startswith(f"{separator}IDL: "):
        return dict(get_types_from_idl(text))
    types: dict[str, Any] = {}
    for part in text.split(separator)[1:]:
        types.update(get_types_from_idl(part.partition("\n")[2]))
    return types


def _protobuf(channel: Channel, loss: Loss) -> Deserializer:
    from google.protobuf.message import DecodeError
    from mcap.exceptions import McapError
    from mcap.records import Schema
    from mcap_protobuf.decoder import DecoderFactory

    schema = Schema(id=1, data=channel.schema, encoding="protobuf", name=channel.type_name)
    try:
        decode = DecoderFactory().decoder_for("protobuf", schema)
    except (McapError, DecodeError, TypeError, KeyError) as error:
        raise UnknownTypeError(f"its protobuf definition cannot be parsed ({error})") from error
    assert decode is not None

    def parse(data: bytes) -> Any:
        try:
            return decode(data)
        except DecodeError as error:
            raise ValueError(str(error)) from error

    return parse


def _json(channel: Channel, loss: Loss) -> Deserializer:
    """Objects as namespaces; the Foxglove schemas store bytes as base64 in a field named `data`."""

    def parse(data: bytes) -> Any:
        message = json.loads(data, object_hook=lambda fields: SimpleNamespace(**fields))
        if isinstance(getattr(message, "data", None), str) and channel.kind.startswith("foxglove."):
            message.data = b64decode(message.data)
        return message

    return parse


SERIALIZATIONS: dict[tuple[str, str], Callable[[Channel, Loss], Deserializer]] = {
    ("cdr", "ros2msg"): _cdr,
    ("cdr", "ros2idl"): _cdr,
    ("cdr", ""): _cdr,
    ("ros1", "ros1msg"): _ros1,
    ("ros1", ""): _ros1,
    ("protobuf", "protobuf"): _protobuf,
    ("json", "*"): _json,
}
