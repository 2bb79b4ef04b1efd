"""A stream of odometry poses -> the pose at a wanted time, holding only the stretch that may still be asked for."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections import Counter
from itertools import pairwise

import numpy as np

from wallkit.core.geometry import interpolate_poses
from wallkit.core.types import Float64Array, Int64Array


class OdometryBuffer:
    """Poses with ascending stamps; repeated and backward ones are left out and counted.

    Attributes:
        dropped: reason -> messages left out.
        begin_ns: the first stamp there was.
    """

    def __init__(self) -> None:
        self.dropped: Counter[str] = Counter()
        self._stamps: list[int] = []
        self._poses: list[Float64Array] = []
        self._longest_forgotten_ns = 0
        self.begin_ns: int | None = None

    @property
    def held_from_ns(self) -> int:
        """Oldest stamp held; there must be one."""
        return self._stamps[0]

    @property
    def last_ns(self) -> int | None:
        """Newest stamp."""
        return self._stamps[-1] if self._stamps else None

    def add(self, stamp_ns: int, pose: Float64Array) -> None:
        """Take the next message."""
        if self._stamps and stamp_ns <= self._stamps[-1]:
            self.dropped["repeated stamp" if stamp_ns == self._stamps[-1] else "stamp goes back"] += 1
            return
        if self.begin_ns is None:
            self.begin_ns = stamp_ns
        self._stamps.append(stamp_ns)
        self._poses.append(pose)

    def gap_between(self, start_ns: int, end_ns: int) -> int:
        """Longest time [ns] between neighbouring messages that have to be bridged for all times from start to end.

        Both must lie inside what is held. A time that is a message's own needs no bridge: 0.
        """
        low, high = bisect_right(self._stamps, start_ns) - 1, bisect_left(self._stamps, end_ns)
        if self._stamps[low] == start_ns == end_ns:
            return 0
        return max((b - a for a, b in pairwise(self._stamps[low : high + 1])), default=0)

    def pose_at(self, stamp_ns: int) -> Float64Array:
        """(3,) T_odom_base at one stamp, which must lie inside what is held; a message's own pose at its own stamp."""
        before = bisect_right(self._stamps, stamp_ns) - 1
        if self._stamps[before] == stamp_ns:
            return self._poses[before]
        return np.asarray(self.poses_at(np.array([stamp_ns]))[0])

    def poses_at(self, stamps_ns: Int64Array) -> Float64Array:
        """(M, 3) T_odom_base at the wanted stamps, which must lie inside what is held."""
        low = max(bisect_right(self._stamps, int(stamps_ns.min())) - 1, 0)
        high = bisect_left(self._stamps, int(stamps_ns.max())) + 1
        times = np.array(self._stamps[low:high], dtype=np.int64)
        return interpolate_poses(times, np.array(self._poses[low:high]), stamps_ns)

    def take_gap(self, stamp_ns: int) -> int:
        """Longest time [ns] between messages since the last call, up to the first at or after this stamp; then forget.

        What lies before the stamp is let go of, as by `forget_before`.
        """
        high = bisect_left(self._stamps, stamp_ns)
        longest = max(self._longest_forgotten_ns, self._longest_gap(high))
        self.forget_before(stamp_ns)
        self._longest_forgotten_ns = 0
        return longest

    def forget_before(self, stamp_ns: int) -> None:
        """Let go of what lies before a stamp, but for the message just before it, from which to interpolate."""
        keep = bisect_right(self._stamps, stamp_ns) - 1
        if keep > 0:
            self._longest_forgotten_ns = max(self._longest_forgotten_ns, self._longest_gap(keep))
            del self._stamps[:keep]
            del self._poses[:keep]

    def _longest_gap(self, last: int) -> int:
        """Longest step among the stamps 0 ... last."""
        stamps = self._stamps[: last + 1]
        return max((b - a for a, b in pairwise(stamps)), default=0)
