"""Numbers, texts and arrays -> little-endian CDR, the wire format of ROS 2, arrays copied as one block."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wallkit.core.types import Float64Array

HEADER = b"\x00\x01\x00\x00"


class CdrBuilder:
    """The bytes of one message, grown field by field; each value is aligned to its own size behind the header."""

    def __init__(self) -> None:
        self._data = bytearray(HEADER)

    def values(self, code: str, *values: float) -> CdrBuilder:
        """Values of one struct code ("d", "f", "I", "i", "B", ...), one after the other."""
        self.align(struct.calcsize(f"<{code}"))
        self._data += struct.pack(f"<{len(values)}{code}", *values)
        return self

    def text(self, text: str) -> CdrBuilder:
        """A string."""
        encoded = text.encode() + b"\x00"
        self.values("I", len(encoded))
        self._data += encoded
        return self

    def header(self, stamp_ns: int, frame_id: str) -> CdrBuilder:
        """A std_msgs/Header, or anything that begins with a time and a text."""
        return self.time(stamp_ns).text(frame_id)

    def time(self, stamp_ns: int) -> CdrBuilder:
        """A builtin_interfaces/Time."""
        seconds, nanoseconds = divmod(int(stamp_ns), 1_000_000_000)
        self.align(4)
        self._data += struct.pack("<iI", seconds, nanoseconds)
        return self

    def block(self, array: NDArray[Any] | bytes, item_bytes: int) -> CdrBuilder:
        """An array's bytes as they are, aligned to the size of its items, without a length in front."""
        if len(array):
            self.align(item_bytes)
            self._data += array if isinstance(array, bytes) else np.ascontiguousarray(array).tobytes()
        return self

    def sequence(self, array: NDArray[Any] | bytes, item_bytes: int, *, count: int | None = None) -> CdrBuilder:
        """Length, then the array's bytes. `count` where the array has several numbers an item."""
        return self.values("I", len(array) if count is None else count).block(array, item_bytes)

    def align(self, size: int) -> CdrBuilder:
        """Zeros up to the next multiple of size."""
        self._data += bytes((len(HEADER) - len(self._data)) % size)
        return self

    def done(self) -> bytes:
        """The message."""
        return bytes(self._data)


def planar_numbers(poses: Float64Array | Sequence[float]) -> Float64Array:
    """(N, 7) position and quaternion x y z qx qy qz qw of planar poses (N, 3) or (3,)."""
    poses = np.atleast_2d(np.asarray(poses, dtype=np.float64))
    numbers = np.zeros((len(poses), 7))
    numbers[:, :2] = poses[:, :2]
    numbers[:, 5], numbers[:, 6] = np.sin(poses[:, 2] / 2), np.cos(poses[:, 2] / 2)
    return numbers


def covariance_numbers(covariance: Float64Array | None) -> Float64Array:
    """(36,) of a (3, 3) covariance of x, y, yaw, rows of x y z roll pitch yaw; None: zeros."""
    full = np.zeros((6, 6))
    if covariance is not None:
        full[np.ix_((0, 1, 5), (0, 1, 5))] = covariance
    return full.ravel()
