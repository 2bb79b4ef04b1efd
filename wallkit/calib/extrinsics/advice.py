"""What to show the sensors next: the board pose that would help the weakest direction most."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from wallkit.calib.extrinsics.observability import Observability
from wallkit.calib.extrinsics.sightings import Problem, jacobian, problem_from_sightings, whiteners
from wallkit.calib.extrinsics.worlds import World, board_at, sighting_of
from wallkit.core.types import Float64Array

_DISTANCES_M = (1.0, 1.8)
_SIDES = (-0.3, 0.0, 0.3)
_TILTS_DEG = (-30.0, 0.0, 30.0)
_ENOUGH = 12


@dataclass(frozen=True)
class Advice:
    """The best next pose.

    Attributes:
        words: what to do. direction: which degrees of freedom it helps.
        before, after: sigma of that direction over the prior's.
    """

    words: str
    direction: str
    before: float
    after: float


def next_pose(problem: Problem, T: Float64Array, seen: Observability, world: World) -> Advice | None:
    """The pose of many after which the worst direction is the least bad; None where none can be seen by both."""
    units = np.repeat([np.radians(seen.prior_deg), seen.prior_mm * 1e-3], 3)
    known = _information(problem, T, units)
    # what nothing is known of gets the prior, or no candidate could be compared
    known = known + np.eye(6)
    before = np.linalg.eigvalsh(np.linalg.inv(known))[-1]
    best: tuple[float, tuple[float, ...]] | None = None
    for distance, side, pitch, yaw, roll in product(_DISTANCES_M, _SIDES, _TILTS_DEG, _TILTS_DEG, _TILTS_DEG):
        if pitch and yaw and roll:
            continue
        candidate = sighting_of(
            replace(world, beam_deg=1.0),
            T,
            board_at(side * distance, 0.0, distance, pitch_deg=pitch, yaw_deg=yaw, roll_deg=roll),
        )
        if candidate is None:
            continue
        more = _information(problem_from_sightings([candidate]), T, units)
        worst = float(np.linalg.eigvalsh(np.linalg.inv(known + more))[-1])
        # the plainest of equally good poses
        key = worst * (1 + 1e-3 * (abs(roll) + abs(pitch) + abs(yaw)) / 90)
        if best is None or key < best[0]:
            best = key, (distance, side * distance, pitch, yaw, roll, worst)
    if best is None:
        return None
    distance, side, pitch, yaw, roll, worst = best[1]
    return Advice(_words(distance, side, pitch, yaw, roll), seen.directions[-1].words, float(before**0.5), worst**0.5)


def _information(problem: Problem, T: Float64Array, units: Float64Array) -> Float64Array:
    turn = np.zeros((6, 6))
    turn[:3, :3] = turn[3:, 3:] = T[:3, :3]
    rows = (whiteners(problem, T) @ jacobian(problem, T) @ turn * units).reshape(-1, 6)
    return np.asarray(rows.T @ rows)


def _words(distance: float, side: float, pitch: float, yaw: float, roll: float) -> str:
    where = "straight ahead" if side == 0 else f"{abs(side):.1f} m to the {'right' if side > 0 else 'left'}"
    tilts = []
    if pitch:
        tilts.append(f"its top tilted {abs(pitch):.0f} deg {'away from' if pitch < 0 else 'towards'} the camera")
    if yaw:
        tilts.append(f"turned {abs(yaw):.0f} deg to face {'left' if yaw > 0 else 'right'}")
    if roll:
        tilts.append(f"rolled {abs(roll):.0f} deg {'clockwise' if roll > 0 else 'anticlockwise'}")
    return f"hold the board {distance:.1f} m away, {where}, {', '.join(tilts) or 'upright'}"
