"""Profiles of a score over small motions of a transform -> which axes the score sees, and whether it is best where it is."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from wallkit.calib.extrinsics.observability import DEGREES_OF_FREEDOM
from wallkit.calib.extrinsics.rigid import rotation_from_vector
from wallkit.calib.verify.gates import Gate
from wallkit.core.types import Float64Array

# half widths of the profiles: turns [rad], shifts [m]
TURN_RAD, SHIFT_M = np.radians(1.0), 0.10
STEPS = 9
# a minimum farther away than this is a FAIL, nearer than the first a PASS
GOOD_DEG, GOOD_M, BAD_DEG, BAD_M = 0.5, 0.05, 0.8, 0.08
_SEEN_SIGMAS = 3.0


@dataclass(frozen=True, eq=False)
class Profile:
    """A score along one axis of the LiDAR.

    Attributes:
        axis: a name of DEGREES_OF_FREEDOM. offsets: (S,) [rad or m]. scores: (S,), lower is better.
        minimum, sigma: where the score is lowest, and how far that scatters between the frames [rad or m].
        is_seen: whether the score says anything about this axis.
    """

    axis: str
    offsets: Float64Array
    scores: Float64Array
    minimum: float
    sigma: float
    is_seen: bool


def profiles(T: Float64Array, score: Callable[[Float64Array], Float64Array], frames: int) -> tuple[Profile, ...]:
    """The profile along each of the six axes.

    Args:
        score: (4, 4) -> (F,) one score a frame, lower is better; their mean is the score of all.
    """
    found = []
    for i, axis in enumerate(DEGREES_OF_FREEDOM):
        offsets = np.linspace(-1, 1, STEPS) * (TURN_RAD if i < 3 else SHIFT_M)
        table = np.array([score(moved(T, i, offset)) for offset in offsets])
        found.append(_profile(axis, offsets, table, frames))
    return tuple(found)


def moved(T: Float64Array, axis: int, offset: float) -> Float64Array:
    """T_camera_lidar with the LiDAR turned about, or shifted along, one of its own axes."""
    motion = np.eye(4)
    step = np.zeros(3)
    step[axis % 3] = offset
    if axis < 3:
        motion[:3, :3] = rotation_from_vector(step)
    else:
        motion[:3, 3] = step
    return np.asarray(T @ motion)


def profile_gate(name: str, found: Sequence[Profile], *, basis: str) -> Gate:
    """PASS for the axes that the score sees, by name; FAIL where its minimum is clearly elsewhere; else CANNOT TELL."""
    seen = [profile for profile in found if profile.is_seen]
    wanted = f"minimum within {GOOD_DEG:g} deg, {100 * GOOD_M:g} cm"
    refused = f"beyond {BAD_DEG:g} deg, {100 * BAD_M:g} cm"
    if not seen:
        reason = "the score has no clear minimum along any axis: too little structure in view"
        return Gate(name, np.nan, "", wanted, "CANNOT TELL", reason, refused, basis)
    label = f"{name}, seen: {', '.join(p.axis for p in seen)}"
    sizes = [abs(p.minimum) / (np.radians(GOOD_DEG) if _turns(p) else GOOD_M) for p in seen]
    worst = seen[int(np.argmax(sizes))]
    value = float(np.degrees(worst.minimum)) if _turns(worst) else 100 * worst.minimum
    unit = "deg" if _turns(worst) else "cm"
    bad = [p for p in seen if abs(p.minimum) > max(np.radians(BAD_DEG) if _turns(p) else BAD_M, _SEEN_SIGMAS * p.sigma)]
    reason = f"picture and LiDAR agree best with {worst.axis} {value:+.2f} {unit} from the calibration"
    if bad:
        return Gate(label, abs(value), unit, wanted, "FAIL", reason, refused, basis)
    if max(sizes) > 1:
        return Gate(label, abs(value), unit, wanted, "CANNOT TELL", reason, refused, basis)
    return Gate(label, abs(value), unit, wanted, "PASS", "", refused, basis)


def _turns(profile: Profile) -> bool:
    return profile.axis in DEGREES_OF_FREEDOM[:3]


def _profile(axis: str, offsets: Float64Array, table: Float64Array, frames: int) -> Profile:
    """A profile of (S, F) scores; sigma by leaving out one frame after the other."""
    scores = table.mean(axis=1)
    minimum = lowest(offsets, scores)
    sigma = np.inf
    if frames >= 3:
        left = np.array([lowest(offsets, np.delete(table, k, axis=1).mean(axis=1)) for k in range(frames)])
        sigma = float(np.sqrt((frames - 1) / frames * ((left - left.mean()) ** 2).sum()))
    # a rise to the lower end that all frames but noise share
    best = int(scores.argmin())
    ends = [table[0] - table[best], table[-1] - table[best]]
    rises = [float(e.mean() / max(e.std(ddof=1) / np.sqrt(frames), 1e-12)) if frames >= 3 else 0.0 for e in ends]
    inside = 0 < best < len(offsets) - 1
    half = float(offsets[-1])
    is_seen = sigma < half / 3 and (min(rises) > _SEEN_SIGMAS if inside else max(rises) > 2 * _SEEN_SIGMAS)
    return Profile(axis, offsets, scores, minimum, sigma, is_seen)


def lowest(offsets: Float64Array, scores: Float64Array) -> float:
    """Where a parabola through the lowest sample and its neighbours is lowest; the end where an end is."""
    i = int(scores.argmin())
    if not 0 < i < len(scores) - 1:
        return float(offsets[i])
    before, here, after = scores[i - 1 : i + 2]
    bend = before - 2 * here + after
    step = offsets[1] - offsets[0]
    return float(offsets[i] + (step * (before - after) / (2 * bend) if bend > 0 else 0.0))
