"""Waypoints -> where a differential-drive robot truly is over time: it turns and drives as a real base would."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from wallkit.core.config import setting
from wallkit.core.geometry import wrap_angle
from wallkit.core.types import Float64Array
from wallkit.errors import SimulationError
from wallkit.simulate.floor import CELL_M, Floor

_STEP_S = 0.01
_LOOKAHEAD_M = 0.35
_TURN_IN_PLACE_RAD = 0.9
_ARRIVED_M, _STOPPED_M_S = 0.06, 0.06
_LONGEST_S = 7200.0
# x, y, yaw, speed, turn rate; and a leg's two ends with its length
_State = tuple[float, float, float, float, float]
_Leg = tuple[float, float, float, float, float]


@dataclass(frozen=True)
class Route:
    """Where the robot goes and how; the way between two waypoints goes round what stands between them."""

    waypoints: tuple[tuple[float, float], ...] = setting(
        (), "x y of the places it passes, in order [m]; none: by chance"
    )
    laps: int = setting(1, "times round; more than one: back to the first waypoint after the last", low=1, high=1000)
    direct: bool = setting(False, "straight from waypoint to waypoint, instead of round obstacles")
    speed_m_s: float = setting(0.5, "cruising speed", low=0.02, high=3)
    turn_rad_s: float = setting(0.9, "fastest turn", low=0.05, high=6)
    acceleration_m_s2: float = setting(0.5, "of the base", low=0.01, high=10)
    radius_m: float = setting(0.25, "of the robot, for its way round obstacles", low=0.01, high=2)
    pause_s: float = setting(0.0, "it stands so long at every waypoint", low=0, high=600)
    random_stops: int = setting(8, "waypoints drawn by chance when none are given", low=2, high=1000)


def drive(
    rng: np.random.Generator, route: Route, floor: Floor, rate_hz: float, *, duration_s: float = 0.0
) -> Float64Array:
    """Poses (T, 3), T_map_base, of a robot along its route at a rate, standing for half a second at both ends.

    Args:
        duration_s: it ends then at the latest; 0: with the route.

    Raises:
        SimulationError: fewer than two waypoints, one within an obstacle, no way between two, or (direct) a wall on the way.
    """
    return driven(route, _corners(rng, route, floor), rate_hz, duration_s=duration_s)


def driven(route: Route, corners: Float64Array, rate_hz: float, *, duration_s: float = 0.0) -> Float64Array:
    """Poses (T, 3) of a robot that goes straight from corner to corner (W, 2), whatever stands there; else as `drive`."""
    longest = round(min(duration_s or _LONGEST_S, _LONGEST_S) / _STEP_S)
    stand = round(0.5 / _STEP_S)
    (x0, y0), (x1, y1) = corners[:2].tolist()
    state: _State = (x0, y0, math.atan2(y1 - y0, x1 - x0), 0.0, 0.0)
    states = [state] * stand
    target, stop_at = 1, _stops(route, corners)
    legs: list[_Leg] = [(*a, *b, math.dist(a, b)) for a, b in pairwise(corners.tolist())]
    while target < len(corners) and len(states) <= longest:
        state, is_there = _step(route, state, legs[target - 1], is_stop=target in stop_at)
        states.append(state)
        if is_there:
            if target in stop_at:
                states += [state] * round(route.pause_s / _STEP_S)
            target += 1
    states += [state] * stand
    poses = np.array(states)[: longest + 1, :3]
    every = np.arange(0.0, len(poses) - 1 + 1e-9, 1 / (rate_hz * _STEP_S))
    poses[:, 2] = np.unwrap(poses[:, 2])
    sampled = np.column_stack([np.interp(every, np.arange(len(poses)), column) for column in poses.T])
    sampled[:, 2] = wrap_angle(sampled[:, 2])
    return sampled


def _corners(rng: np.random.Generator, route: Route, floor: Floor) -> Float64Array:
    """(W, 2) every corner of the way, those between waypoints included."""
    waypoints = list(route.waypoints)
    if not waypoints:
        free = floor.free_points(route.radius_m + CELL_M)
        if len(free) < 2:
            raise SimulationError(
                f"a robot of radius {route.radius_m:g} m does not fit anywhere",
                where=floor.source,
                hint="set route.radius_m",
            )
        waypoints = [tuple(p) for p in free[rng.integers(len(free), size=route.random_stops)].tolist()]
    if len(waypoints) < 2:
        raise SimulationError(
            "the route has one waypoint", where=floor.source, hint="name at least two, or none for a route by chance"
        )
    round_trip = [*waypoints, waypoints[0]] if route.laps > 1 else waypoints
    legs = list(pairwise(round_trip)) * route.laps
    corners = [np.array([legs[0][0]])]
    for start, end in legs:
        way = np.array([start, end]) if route.direct else floor.way(start, end, route.radius_m)
        if route.direct:
            _check_clear(floor, way, route)
        corners.append(way[1:])
    found = np.concatenate(corners)
    apart = np.hypot(*np.diff(found, axis=0).T) > 1e-6
    return np.vstack([found[:1], found[1:][apart]])


def _check_clear(floor: Floor, way: Float64Array, route: Route) -> None:
    line = way[0] + np.linspace(0, 1, max(2, int(np.hypot(*(way[1] - way[0])) / 0.02)))[:, None] * (way[1] - way[0])
    clear = floor.clearance_at(line)
    if clear.min() < CELL_M / 2:
        (x0, y0), (x1, y1), (x, y) = *way, line[int(np.argmin(clear))]
        raise SimulationError(
            f"the route from {x0:.2f} {y0:.2f} to {x1:.2f} {y1:.2f} goes through something at {x:.2f} {y:.2f}",
            where=floor.source,
            hint="leave out route.direct to go round, open a door, or move the waypoint",
        )


def _stops(route: Route, corners: Float64Array) -> set[int]:
    """Corners at which the robot comes to rest: waypoints when it pauses there, always the last."""
    last = len(corners) - 1
    if route.pause_s <= 0:
        return {last}
    near = [int(np.argmin(np.hypot(*(corners - point).T))) for point in map(np.array, route.waypoints)]
    return {last, *near} - {0}


def _step(route: Route, state: _State, leg: _Leg, *, is_stop: bool) -> tuple[_State, bool]:
    """A hundredth of a second later, and whether the leg's end is reached. In plain floats: a log has many of these."""
    x, y, yaw, speed, turn = state
    x0, y0, x1, y1, length = leg
    distance = math.hypot(x1 - x, y1 - y)
    # the point a short way ahead on the leg
    along = ((x - x0) * (x1 - x0) + (y - y0) * (y1 - y0)) / length
    share = min((along + _LOOKAHEAD_M) / length, 1.0)
    off = math.atan2(y0 + share * (y1 - y0) - y, x0 + share * (x1 - x0) - x) - yaw
    off = (off + math.pi) % (2 * math.pi) - math.pi
    wanted_turn = min(max(2.5 * off, -route.turn_rad_s), route.turn_rad_s)
    wanted = 0.0 if abs(off) > _TURN_IN_PLACE_RAD else route.speed_m_s * max(0.15, 1 - abs(off) / _TURN_IN_PLACE_RAD)
    if is_stop:
        wanted = min(wanted, math.sqrt(2 * route.acceleration_m_s2 * max(distance - _ARRIVED_M / 2, 0.0)) + 0.02)
    gain = route.acceleration_m_s2 * _STEP_S
    speed += min(max(wanted - speed, -2 * gain), gain)
    turn += min(max(wanted_turn - turn, -6 * _STEP_S), 6 * _STEP_S)
    middle = yaw + turn * _STEP_S / 2
    way = _STEP_S * speed
    moved = (x + way * math.cos(middle), y + way * math.sin(middle), yaw + turn * _STEP_S, speed, turn)
    return moved, distance < _ARRIVED_M and speed < _STOPPED_M_S if is_stop else distance < _LOOKAHEAD_M / 2
