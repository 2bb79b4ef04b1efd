"""A CARMEN log (.log, .clf) -> its lines as messages, with the LiDAR's mount worked out from the whole file.

Where the mount comes from, in this order:
1. `PARAM robot_frontlaser_offset`: metres ahead of the robot's centre.
2. the laser's and the robot's pose that every scan line carries, if they differ by the same transform throughout.
   In files whose scan poses were corrected by SLAM they do not, and then the mount stays unknown: `--lidar-pose`.

Odometry is the ODOM lines; in a file without them, the robot poses of the scan lines.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator
from pathlib import Path

import numpy as np

from wallkit.core.geometry import relative, wrap_angle
from wallkit.core.types import Float64Array
from wallkit.logs.carmen_lines import flaser_poses, line_stamp_ns, robotlaser_poses, words_of
from wallkit.logs.loss import Loss
from wallkit.logs.message import Channel, RawMessage

SCAN_LINES = {"FLASER": flaser_poses, "ROBOTLASER1": robotlaser_poses}
KNOWN_LINES = frozenset({*SCAN_LINES, "ODOM", "TRUEPOS"})
# lines that a CARMEN file may begin with, to tell it from other text
FIRST_WORDS = frozenset({*KNOWN_LINES, "PARAM", "SYNC", "RLASER", "RAWLASER1", "RAWLASER2", "ROBOTLASER2", "NMEAGGA"})
_SAME_MOUNT = np.array([0.005, 0.005, np.deg2rad(0.2)])
_MOUNT_TOPIC = "/tf_static"


def looks_like_carmen(head: bytes) -> bool:
    """Whether the first bytes of a file are those of a CARMEN log: comments, then a line that begins as its lines do."""
    for line in head.split(b"\n"):
        word = line.split(b" ", 1)[0].decode("ascii", errors="replace").strip()
        if word and not word.startswith("#"):
            return word in FIRST_WORDS
    return False


class CarmenFile:
    """One CARMEN log. Its topics are the names of its lines."""

    format = "CARMEN"

    def __init__(self, path: Path, loss: Loss) -> None:
        self._path = path
        survey = _survey(path)
        self._mount = survey.mount
        for name in sorted(survey.others):
            loss.skipped.setdefault(name, f"{survey.others[name]} lines of this kind are not used")
        channels = {name: _channel(name, name, n) for name, n in sorted(survey.counts.items()) if n}
        scans = [name for name in SCAN_LINES if survey.counts[name]]
        self._odometry_of = scans[0] if scans and not survey.counts["ODOM"] else ""
        if self._odometry_of:
            channels["odometry"] = _channel(f"{self._odometry_of}/odometry", "ScanOdometry", survey.counts[scans[0]])
        if self._mount is not None:
            channels["mount"] = _channel(_MOUNT_TOPIC, "MOUNT", 1)
        self._channels = channels
        self.channels: tuple[Channel, ...] = tuple(channels.values())

    def raw(self, topics: Collection[str] | None = None) -> Iterator[RawMessage]:
        """The lines in the order of the file; record time is the message's own time."""
        wanted = {key: c for key, c in self._channels.items() if topics is None or c.topic in topics}
        is_first = True
        for number, line in enumerate(_lines(self._path)):
            name = line.split(b" ", 1)[0].decode("ascii", errors="replace")
            if name not in KNOWN_LINES:
                continue
            stamp_ns = _stamp_or_zero(line)
            if is_first and "mount" in wanted and self._mount is not None:
                words = " ".join(repr(float(v)) for v in self._mount)
                yield stamp_ns, -1, wanted["mount"], f"MOUNT {words}".encode()
            is_first = False
            if name in wanted:
                yield stamp_ns, 2 * number, wanted[name], line
            if name == self._odometry_of and "odometry" in wanted:
                yield stamp_ns, 2 * number + 1, wanted["odometry"], line


class _Survey:
    """What one pass over the file tells: lines of each kind, and the mount."""

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self.others: Counter[str] = Counter()
        self.mount: Float64Array | None = None


def _survey(path: Path) -> _Survey:
    survey = _Survey()
    offset_m: float | None = None
    mounts: list[Float64Array] = []
    for line in _lines(path):
        name = line.split(b" ", 1)[0].decode("ascii", errors="replace")
        if name in KNOWN_LINES:
            survey.counts[name] += 1
        elif name and not name.startswith("#") and name not in ("PARAM", "SYNC"):
            survey.others[name] += 1
        if name in SCAN_LINES:
            mounts += _mounts_of(name, line)
        if line.startswith(b"PARAM robot_frontlaser_offset "):
            offset_m = _number(words_of(line)[2])
    if offset_m is not None:
        survey.mount = np.array([offset_m, 0.0, 0.0])
    elif mounts:
        survey.mount = _common(np.array(mounts))
    return survey


def _common(mounts: Float64Array) -> Float64Array | None:
    """(3,) the mount, if all (N, 3) agree; None if they do not."""
    difference = mounts - mounts[0]
    difference[:, 2] = wrap_angle(difference[:, 2])
    if not (np.abs(difference) <= _SAME_MOUNT).all():
        return None
    return np.asarray(np.round(mounts[0] + np.median(difference, axis=0), 9) + 0.0)


def _mounts_of(name: str, line: bytes) -> list[Float64Array]:
    """T_base_laser of a scan line, none of a broken one: its message is counted when it is decoded."""
    try:
        laser, robot = SCAN_LINES[name](words_of(line))
    except (ValueError, IndexError):
        return []
    return [relative(robot, laser)]


def _stamp_or_zero(line: bytes) -> int:
    # a line without a time is counted when it is decoded
    try:
        return line_stamp_ns([word.decode("ascii", errors="replace") for word in line.rsplit(None, 3)])
    except ValueError:
        return 0


def _number(word: str) -> float | None:
    try:
        return float(word)
    except ValueError:
        return None


def _lines(path: Path) -> Iterator[bytes]:
    with path.open("rb") as file:
        for line in file:
            yield line.strip()


def _channel(topic: str, kind: str, count: int) -> Channel:
    return Channel(topic, f"carmen/{kind}", "carmen", count=count)
