"""The sweeps of a simulated log -> truth.csv: where the robot was at each, who was near, what the map cannot explain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wallkit.pipelines.simulate.play import START_NS, Play
from wallkit.simulate.crowd import STEP_S
from wallkit.simulate.scanner import Sweep
from wallkit.simulate.scene import NOTHING

HEADER = "stamp_ns,x_m,y_m,yaw_rad,room,returns,unmapped,people_within_3m,nearest_person_m"
_NEAR_M = 3.0


@dataclass(frozen=True)
class Met:
    """What one sweep met: its returns, and those of them that come from things which are not in the map, or not there."""

    at_ns: int
    stamp_ns: int
    returns: int
    unmapped: int


def met(play: Play, done: Sweep, at_ns: int) -> Met:
    """The counts of a sweep that truly began at a moment; a spot between two surfaces is on none and counts as neither."""
    solids = done.solids[done.solids != NOTHING]
    unmapped = sum(play.world.solids[k].instance not in play.mapped for k in solids.tolist())
    return Met(at_ns, done.scan.stamp_ns, int(np.isfinite(done.scan.ranges_m).sum()), unmapped)


def unmapped_share(sweeps: Sequence[Met]) -> float:
    """Of all returns of a log: how hard it is."""
    return sum(m.unmapped for m in sweeps) / max(sum(m.returns for m in sweeps), 1)


def truth_csv(play: Play, sweeps: Sequence[Met]) -> str:
    """A row for every sweep."""
    poses = np.array([play.pose_at(m.at_ns) for m in sweeps]).reshape(-1, 3)
    rooms = _rooms(play, poses)
    rows = [HEADER]
    for m, (x, y, yaw), room in zip(sweeps, poses.tolist(), rooms, strict=True):
        away = _distances(play, m.at_ns, x, y)
        nearest = f"{min(away):.3f}" if away else ""
        near = sum(distance < _NEAR_M for distance in away)
        rows.append(f"{m.stamp_ns},{x:.6f},{y:.6f},{yaw:.6f},{room},{m.returns},{m.unmapped},{near},{nearest}")
    return "\n".join(rows) + "\n"


def _rooms(play: Play, poses: np.ndarray) -> list[str]:
    """The room each pose is in; empty between rooms."""
    import shapely

    found = np.full(len(poses), "", dtype=object)
    for room in play.world.rooms:
        found[shapely.contains_xy(shapely.Polygon(room.floor), poses[:, 0], poses[:, 1])] = room.id
    return [str(name) for name in found]


def _distances(play: Play, at_ns: int, x: float, y: float) -> list[float]:
    step = round((at_ns - START_NS) / 1e9 / STEP_S)
    places = [agent.poses[min(step, len(agent.poses) - 1), :2] for agent in play.people.agents]
    return [float(np.hypot(*(place - (x, y)))) for place in places]
