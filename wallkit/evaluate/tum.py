"""TUM trajectory files -> trajectories and back, exact to the nanosecond.

A line is `seconds x y z qx qy qz qw`, separated by single spaces; lines that start with '#' are comments (Sturm et al.,
A Benchmark for the Evaluation of RGB-D SLAM Systems, 2012). Seconds never pass through a float: 976052890.4487 has no
float64 of nanosecond resolution.
"""

from __future__ import annotations

import math
from decimal import Decimal, InvalidOperation
from pathlib import Path

import numpy as np

from wallkit.core.geometry import yaw_from_quaternion
from wallkit.core.types import Trajectory
from wallkit.errors import LogError, OutputError

HEADER = "# timestamp tx ty tz qx qy qz qw"
_FORMAT = "a line is: seconds x y z qx qy qz qw, separated by spaces"


def read_tum(path: Path, *, frame_id: str = "map") -> Trajectory:
    """The trajectory of a TUM file, laid flat: x, y and heading are kept, z, roll and pitch are dropped.

    Raises:
        LogError: it cannot be read, a line is malformed, or its stamp does not come after the line before (file:line).
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise LogError(f"cannot read the trajectory: {error}", where=path, hint="name a TUM text file") from error
    return trajectory_from_tum(text, where=str(path), frame_id=frame_id)


def write_tum(path: Path, trajectory: Trajectory) -> None:
    """Writes a TUM file that evo reads.

    Raises:
        OutputError: the file cannot be written.
    """
    try:
        path.write_text(tum_from_trajectory(trajectory), encoding="utf-8", newline="\n")
    except OSError as error:
        raise OutputError(f"cannot write the trajectory: {error}", where=path, hint="choose another --out") from error


def tum_from_trajectory(trajectory: Trajectory) -> str:
    """The trajectory as TUM text: seconds to the nanosecond, metres to the nanometre, z = roll = pitch = 0."""
    half = trajectory.poses[:, 2] / 2
    columns = np.column_stack([trajectory.poses[:, :2], np.sin(half), np.cos(half)]).tolist()
    lines = [
        f"{seconds_from_ns(stamp)} {x:.9f} {y:.9f} 0 0 0 {qz:.12f} {qw:.12f}"
        for stamp, (x, y, qz, qw) in zip(trajectory.stamps_ns.tolist(), columns, strict=True)
    ]
    return "\n".join([HEADER, *lines, ""])


def trajectory_from_tum(text: str, *, where: str = "", frame_id: str = "map") -> Trajectory:
    """The trajectory of a TUM text; `where` names it in complaints.

    Raises:
        LogError: no pose, a malformed line, or a stamp that does not come after the one before.
    """
    stamps_ns: list[int] = []
    poses: list[tuple[float, float, float]] = []
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        place = f"{where}:{number}"
        stamp_ns, pose = _row(words, place)
        if stamps_ns and stamp_ns <= stamps_ns[-1]:
            kind = "is the same as" if stamp_ns == stamps_ns[-1] else "comes before"
            message = f"stamp {words[0]} {kind} the one above ({seconds_from_ns(stamps_ns[-1])})"
            raise LogError(message, where=place, hint="stamps must ascend: sort the file and drop repeated lines")
        stamps_ns.append(stamp_ns)
        poses.append(pose)
    if not poses:
        raise LogError("there is no pose in it", where=where, hint=_FORMAT)
    return Trajectory(np.array(stamps_ns, dtype=np.int64), np.array(poses, dtype=np.float64), frame_id)


def seconds_from_ns(stamp_ns: int) -> str:
    """Nanoseconds as seconds with nine decimals, in integers only: 1500000000 -> 1.500000000."""
    whole, rest = divmod(abs(stamp_ns), 1_000_000_000)
    return f"{'-' if stamp_ns < 0 else ''}{whole}.{rest:09d}"


def ns_from_seconds(text: str) -> int:
    """Nanoseconds of decimal seconds, exponents allowed, rounded half to even below a nanosecond.

    Raises:
        ValueError: not a finite decimal number within 64 bits.
    """
    try:
        value = Decimal(text)
    except InvalidOperation as error:
        raise ValueError(f"'{text}' is not a number") from error
    # the magnitude is looked at first: 1e999999 as an integer would not fit in memory
    if not value.is_finite() or value.adjusted() > 10:
        raise ValueError(f"'{text}' is not a time in seconds")
    stamp_ns = int(value.scaleb(9).to_integral_value())
    if abs(stamp_ns) >= 2**63:
        raise ValueError(f"'{text}' is not a time in seconds")
    return stamp_ns


def _row(words: list[str], place: str) -> tuple[int, tuple[float, float, float]]:
    if len(words) != 8:
        raise LogError(f"{len(words)} columns where 8 are needed: '{' '.join(words)[:80]}'", where=place, hint=_FORMAT)
    try:
        stamp_ns = ns_from_seconds(words[0])
    except ValueError as error:
        raise LogError(str(error), where=place, hint="the first column is the time in seconds") from error
    try:
        x, y, z, qx, qy, qz, qw = (float(word) for word in words[1:])
    except ValueError as error:
        raise LogError(f"not a number: '{' '.join(words[1:])[:80]}'", where=place, hint=_FORMAT) from error
    norm = math.hypot(qx, qy, qz, qw)
    if not math.isfinite(x + y + z + norm):
        raise LogError(f"a pose must be finite: '{' '.join(words[1:])[:80]}'", where=place, hint="drop the line")
    if not 0.5 < norm < 2.0:
        hint = "the last four columns are a quaternion x y z w of length 1"
        raise LogError(f"not a rotation: quaternion ({qx:g}, {qy:g}, {qz:g}, {qw:g})", where=place, hint=hint)
    return stamp_ns, (x, y, yaw_from_quaternion((qx / norm, qy / norm, qz / norm, qw / norm)))
