"""One line of a CARMEN log -> core types.

The format is that of CARMEN's logger (Montemerlo, Roy & Thrun; http://carmen.sourceforge.net): words separated by
blanks, first the name of the message, last its time, the host, and the time since the logger started. The time taken
is the message's own; the logger's is used only where a file leaves the first at zero.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from wallkit.core.geometry import matrix_from_pose
from wallkit.core.types import Float64Array, Odometry, Scan, StampedPose, Transform
from wallkit.logs.cdr import beam_angles
from wallkit.logs.message import Value

ODOM, BASE, LASER = "odom", "base_link", "laser"
# SICK LMS: 81.91 m and the codes below it mean that nothing came back
SICK_RANGE_MAX_M = 81.8
# readings of a FLASER line -> (first bearing, step) [deg]; the line does not state them (CARMEN readlog.c)
_FLASER_ANGLES_DEG = {180: (-90, 1), 181: (-90, 1), 360: (-90, 0.5), 361: (-90, 0.5), 401: (-50, 0.25)}


def words_of(data: bytes) -> list[str]:
    """The words of a line."""
    return data.decode("ascii", errors="replace").split()


def line_stamp_ns(words: list[str]) -> int:
    """Time of the message: "... ipc_timestamp host logger_timestamp" at the line's end.

    Raises:
        ValueError: there is no time.
    """
    if len(words) < 4:
        raise ValueError("the line ends before its time")
    ipc, logger = _nanoseconds(words[-3]), _nanoseconds(words[-1])
    if ipc <= 0 and logger < 0:
        raise ValueError(f"the time is negative: {words[-3]}, {words[-1]}")
    return ipc if ipc > 0 else logger


def flaser_poses(words: list[str]) -> tuple[Float64Array, Float64Array]:
    """(3,) T_odom_laser and (3,) T_odom_base of a FLASER line."""
    count = int(words[1])
    return _pose(words[2 + count : 5 + count]), _pose(words[5 + count : 8 + count])


def robotlaser_poses(words: list[str]) -> tuple[Float64Array, Float64Array]:
    """(3,) T_odom_laser and (3,) T_odom_base of a ROBOTLASER1 line."""
    count = int(words[8])
    after = 9 + count
    after += 1 + int(words[after])  # remission values
    return _pose(words[after : after + 3]), _pose(words[after + 3 : after + 6])


def _flaser(data: bytes) -> Scan:
    words = words_of(data)
    count = int(words[1])
    if count not in _FLASER_ANGLES_DEG:
        known = ", ".join(str(n) for n in _FLASER_ANGLES_DEG)
        raise ValueError(f"a FLASER line has {count} readings; its field of view is only known for {known}")
    start_deg, step_deg = _FLASER_ANGLES_DEG[count]
    angles = beam_angles(float(np.deg2rad(start_deg)), float(np.deg2rad(step_deg)), count)
    return Scan(line_stamp_ns(words), LASER, _ranges(words, 2, count), angles, 0.0, 0.0, SICK_RANGE_MAX_M)


def _robotlaser(data: bytes) -> Scan:
    words = words_of(data)
    start_rad, step_rad, range_max_m = float(words[2]), float(words[4]), float(words[5])
    count = int(words[8])
    angles = beam_angles(start_rad, step_rad, count)
    return Scan(line_stamp_ns(words), LASER, _ranges(words, 9, count), angles, 0.0, 0.0, range_max_m)


def _ranges(words: list[str], first: int, count: int) -> np.ndarray:
    ranges = np.array(words[first : first + count], dtype=np.float32)
    if len(ranges) != count:
        raise ValueError(f"the line promises {count} readings and has {len(ranges)}")
    return ranges


def _odom(data: bytes) -> Odometry:
    words = words_of(data)
    return Odometry(line_stamp_ns(words), _pose(words[1:4]), ODOM, BASE)


def _scan_odometry(data: bytes) -> Odometry:
    words = words_of(data)
    poses = flaser_poses if words[0] == "FLASER" else robotlaser_poses
    return Odometry(line_stamp_ns(words), poses(words)[1], ODOM, BASE)


def _truth(data: bytes) -> StampedPose:
    """TRUEPOS: the true pose of CARMEN's simulator."""
    words = words_of(data)
    return StampedPose(line_stamp_ns(words), "map", _pose(words[1:4]))


def _mount(data: bytes) -> tuple[Transform, ...]:
    """MOUNT x y yaw: T_base_laser, a line that `carmen.py` writes after having seen the whole file."""
    return (Transform(0, BASE, LASER, matrix_from_pose(_pose(words_of(data)[1:4])), is_static=True),)


def _pose(words: list[str]) -> Float64Array:
    """(3,) x [m], y [m], yaw [rad] of three words."""
    pose = np.array(words, dtype=np.float64)
    if pose.shape != (3,) or not np.isfinite(pose).all():
        raise ValueError(f"not a pose: {' '.join(words)!r}")
    return pose


def _nanoseconds(word: str) -> int:
    # text, not float: 1.1e9 s in a double is good to 0.1 us only
    seconds, _, fraction = word.partition(".")
    if not (seconds.lstrip("-").isdigit() and (fraction.isdigit() or not fraction)):
        return round(float(word) * 1e9)
    return int(seconds) * 1_000_000_000 + int(f"{fraction[:9]:0<9}")


CARMEN_DECODERS: Mapping[str, Callable[[bytes], Value]] = {
    "carmen/FLASER": _flaser,
    "carmen/ROBOTLASER1": _robotlaser,
    "carmen/ODOM": _odom,
    "carmen/ScanOdometry": _scan_odometry,
    "carmen/TRUEPOS": _truth,
    "carmen/MOUNT": _mount,
}
