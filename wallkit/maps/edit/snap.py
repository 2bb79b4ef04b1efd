"""Snap: walls that are nearly at right angles exactly so, and wall ends that stop short of a wall extended to it."""

from __future__ import annotations

import difflib
import itertools
import math
from dataclasses import replace

import numpy as np

from wallkit.core.types import Float64Array
from wallkit.maps.document import Edit
from wallkit.maps.edit.changes import Changes, Step
from wallkit.maps.edit.place import rotate
from wallkit.maps.findings.repair import repair
from wallkit.maps.rules.base import Context

# directions that are nearer to a right angle than this are exact; numbers are written with so many digits
_EXACT_RAD = 1e-6
# the rules whose repairs close gaps
CLOSING = ("WK-E020", "WK-E022")


def straighten(context: Context, *, within_rad: float | None = None) -> Changes:
    """Walls turned about their start so that they stand square to the longest walls; by less than a degree each.

    The direction all are squared to is the one most of the walls' length has (mean of the fourfold angles, weighted by
    length and by how near they are).

    Args:
        within_rad: what is farther off stands at an angle on purpose; by default the rules' `near_right_rad`.
    """
    limit_rad = context.tolerances.near_right_rad if within_rad is None else within_rad
    runs = [run for run in context.runs if run.length_m > 0]
    if len(runs) < 2:
        return Changes()
    angles = np.array([math.atan2(run.direction[1], run.direction[0]) for run in runs])
    lengths = np.array([run.length_m for run in runs])
    square_rad = _main_direction(angles, lengths, limit_rad)
    changes, seen = Changes(), set()
    for run, angle in zip(runs, angles.tolist(), strict=True):
        off_rad = math.remainder(angle - square_rad, math.pi / 2)
        joint = context.map.parent_joint(run.link)
        # what hangs on a wall that is turned goes with it, and a polyline wall has no direction of its own
        is_alone = sum(other.link == run.link for other in runs) == 1
        if not _EXACT_RAD < abs(off_rad) <= limit_rad or joint is None or run.link in seen or not is_alone:
            continue
        if any(parent in seen for parent in _above(context, run.link)):
            continue
        seen.add(run.link)
        changes += rotate(context, run.link, -off_rad)
    return changes


def close_gaps(context: Context, *, gap_m: float | None = None) -> Changes:
    """Walls extended to what they stop at most `gap_m` short of: the repairs of WK-E020 and WK-E022."""
    data, limits = context.document.data, context.tolerances
    limits = limits if gap_m is None else replace(limits, gap_max_m=gap_m)
    done = repair(data, "moderate", limits, select=CLOSING, source=context.document.source)
    if not done.fixed:
        return Changes()
    said = tuple(f"{finding.message.partition(';')[0]}: {finding.hint}" for finding in done.fixed)
    return Changes(_difference(data, done.data), said)


def snap_steps(
    *, within_rad: float | None = None, gap_m: float | None = None, right_angles: bool = True, gaps: bool = True
) -> tuple[Step, ...]:
    """What `snap` does, in order: a wall is extended to its corner once the angles are exact."""
    steps: list[Step] = []
    if right_angles:
        steps.append(lambda context: straighten(context, within_rad=within_rad))
    if gaps:
        steps.append(lambda context: close_gaps(context, gap_m=gap_m))
    return tuple(steps)


# ------------------------------------------------------------------------------------------------- details


def _main_direction(angles: Float64Array, lengths: Float64Array, near_rad: float) -> float:
    """The direction, modulo a quarter turn, of most length: that of the wall with the most length near it, averaged."""
    off = np.array([[math.remainder(a - b, math.pi / 2) for a in angles] for b in angles])
    near = np.abs(off) <= near_rad
    best = int(np.argmax((near * lengths).sum(axis=1)))
    exact = (np.abs(off) <= _EXACT_RAD) & near[best]
    # of those near it the direction that the most length has exactly; nothing is turned that need not be
    chosen = max(np.flatnonzero(near[best]), key=lambda i: float((exact[i] * lengths).sum()))
    return float(angles[chosen])


def _above(context: Context, link: str) -> list[str]:
    found, joint = [], context.map.parent_joint(link)
    while joint is not None and joint.parent not in found:
        found.append(joint.parent)
        joint = context.map.parent_joint(joint.parent)
    return found


def _difference(before: bytes, after: bytes) -> tuple[Edit, ...]:
    """Edits of the lines in which two files differ."""
    old, new = before.splitlines(keepends=True), after.splitlines(keepends=True)
    starts = [0, *itertools.accumulate(len(line) for line in old)]
    blocks = difflib.SequenceMatcher(None, old, new, autojunk=False).get_opcodes()
    return tuple(
        Edit(starts[i0], starts[i1] - starts[i0], b"".join(new[j0:j1]))
        for tag, i0, i1, j0, j1 in blocks
        if tag != "equal"
    )
