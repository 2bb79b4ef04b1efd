"""Serialised messages of a channel -> core types, whatever encoding they are in."""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from typing import Any

from wallkit.logs import cdr
from wallkit.logs.carmen_lines import CARMEN_DECODERS
from wallkit.logs.foxglove import FOXGLOVE_DECODERS
from wallkit.logs.loss import Loss
from wallkit.logs.message import Channel, Value
from wallkit.logs.ros import ROS_DECODERS
from wallkit.logs.serialization import Deserializer, UnknownTypeError, deserializer

Decoder = Callable[[bytes], Value]


class UndecodableError(ValueError):
    """Why one message could not be decoded."""


def decoder(channel: Channel, loss: Loss) -> Decoder:
    """Bytes -> core type, for the messages of one channel. It raises UndecodableError for a message that is damaged.

    Raises:
        UnknownTypeError: wallkit has no use for the channel's type, or cannot read its encoding.
    """
    if channel.encoding == "carmen":
        return _guarded(CARMEN_DECODERS[channel.kind])
    if channel.kind not in DECODERS:
        raise UnknownTypeError(f"messages of type {channel.type_name!r} are not used")
    if channel.encoding == "cdr" and channel.kind in FAST_DECODERS:
        return _FastFirst(channel, loss)
    return _general(channel, loss)


def _general(channel: Channel, loss: Loss) -> Decoder:
    deserialize, convert = deserializer(channel, loss), DECODERS[channel.kind]
    return _guarded(lambda data: convert(deserialize(data), channel))


def _guarded(decode: Decoder) -> Decoder:
    from rosbags.serde import SerdeError

    def guarded(data: bytes) -> Value:
        try:
            return decode(data)
        except (ValueError, SerdeError, struct.error, AttributeError, TypeError, IndexError, KeyError) as error:
            # foreign JSON and protobuf may lack any field; whatever is missing, the message is what is broken
            raise UndecodableError(
                f"{error}" if isinstance(error, ValueError | SerdeError) else f"{error!r}"
            ) from error

    return guarded


class _FastFirst:
    """Reads by hand; a message that does not fit the standard layout goes through the channel's own definition."""

    def __init__(self, channel: Channel, loss: Loss) -> None:
        self._channel, self._loss = channel, loss
        self._fast = FAST_DECODERS[channel.kind]
        self._slow: Decoder | None = None

    def __call__(self, data: bytes) -> Value:
        try:
            return self._fast(data, self._channel)
        except (ValueError, struct.error) as error:
            return self._slowly(data, error)

    def _slowly(self, data: bytes, error: Exception) -> Value:
        if self._slow is None:
            try:
                self._slow = _general(self._channel, self._loss)
            except UnknownTypeError:
                raise UndecodableError(str(error)) from error
        return self._slow(data)


FAST_DECODERS: Mapping[str, Callable[[bytes, Channel], Value]] = {
    "nav_msgs/Odometry": lambda data, _: cdr.odometry_from_cdr(data),
    "sensor_msgs/LaserScan": lambda data, _: cdr.scan_from_cdr(data),
    "tf2_msgs/TFMessage": lambda data, channel: cdr.transforms_from_cdr(data, is_static=channel.is_static),
}

DECODERS: Mapping[str, Callable[[Any, Channel], Value]] = {**ROS_DECODERS, **FOXGLOVE_DECODERS}

__all__ = ["DECODERS", "FAST_DECODERS", "Decoder", "Deserializer", "UndecodableError", "UnknownTypeError", "decoder"]
