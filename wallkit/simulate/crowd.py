"""People and carts with somewhere to go -> where each is at any time, keeping clear of walls, each other and the robot.

Motion is the social force model (Helbing and Molnar, Physical Review E 51, 1995; parameters of Moussaid et al., Proc. R.
Soc. B 276, 2009): a pull towards the next corner of the way, pushes away from people, the robot and walls. It is run once
for the whole log, so that a moment can be asked for in any order.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np

from wallkit.core.config import setting
from wallkit.core.types import Float64Array
from wallkit.errors import SimulationError
from wallkit.simulate.figure import PARTS, Figure, figures, postures
from wallkit.simulate.floor import Floor
from wallkit.simulate.world import Body, Solid, upright

STEP_S = 0.05
BODY_RADIUS_M = 0.22
ROBOT_RADIUS_M = 0.3
Role = Literal["walk", "stand", "queue", "block", "push"]


@dataclass(frozen=True)
class Crowd:
    """How many people do what. They are placed and sent around by chance, the same for the same seed."""

    walkers: int = setting(4, "people who walk from place to place", low=0, high=60)
    standing: int = setting(0, "people who stand in groups of two to four and talk", low=0, high=60)
    queue: int = setting(0, "people who wait in a line", low=0, high=20)
    blockers: int = setting(0, "people who stand before a wall, close to the robot's way", low=0, high=20)
    carts: int = setting(0, "of the walkers so many push a cart", low=0, high=20)
    speed_m_s: float = setting(1.1, "mean walking speed", low=0.1, high=2.5)
    pause_s: float = setting(3.0, "mean time a walker stays at a place reached", low=0)


@dataclass(frozen=True, eq=False)
class Agent:
    """One person: the figure, what it does, and where it is at every step (T, 3), having walked (T,)."""

    figure: Figure
    role: Role
    poses: Float64Array
    walked_m: Float64Array
    speeds_m_s: Float64Array


@dataclass(frozen=True, eq=False)
class People:
    """All agents over the time of a log, in steps of STEP_S from its beginning."""

    agents: tuple[Agent, ...] = ()
    solids: tuple[Solid, ...] = field(default=())
    bodies: tuple[Body, ...] = field(default=())

    def posed(self, time_s: float) -> dict[str, Float64Array]:
        """T_map_body (4, 4) of every part of every person and cart at a time."""
        if not self.agents:
            return {}
        poses, walked_m, speeds_m_s = self._at(time_s)
        parts = postures([agent.figure for agent in self.agents], poses, walked_m, speeds_m_s)
        placed = {
            f"{agent.figure.name}.{part}": T
            for agent, T_parts in zip(self.agents, parts, strict=True)
            for part, T in zip(PARTS, T_parts, strict=True)
        }
        for agent, pose in zip(self.agents, poses.tolist(), strict=True):
            if agent.role == "push":
                placed[_cart(agent.figure)] = upright(*pose) @ upright(0.62, 0.0, 0.0)
        return placed

    def _at(self, time_s: float) -> tuple[Float64Array, Float64Array, Float64Array]:
        """(P, 3) poses, (P,) distances walked and (P,) speeds."""
        tracks, walked_m, speeds_m_s = self._tracks
        at = min(max(time_s / STEP_S, 0.0), len(tracks) - 1.0)
        k, share = int(at), at - int(at)
        after = min(k + 1, len(tracks) - 1)
        change = tracks[after] - tracks[k]
        change[:, 2] = (change[:, 2] + math.pi) % (2 * math.pi) - math.pi
        walked = walked_m[k] + share * (walked_m[after] - walked_m[k])
        return tracks[k] + share * change, walked, speeds_m_s[k]

    @cached_property
    def _tracks(self) -> tuple[Float64Array, Float64Array, Float64Array]:
        """(T, P, 3) poses, (T, P) distances walked, (T, P) speeds."""
        columns = [(agent.poses, agent.walked_m, agent.speeds_m_s) for agent in self.agents]
        poses, walked, speeds = (np.stack(column, axis=1) for column in zip(*columns, strict=True))
        return poses, walked, speeds


def people_from(
    rng: np.random.Generator,
    crowd: Crowd,
    floor: Floor,
    robot: Float64Array,
    *,
    first: int = 0,
) -> People:
    """The people of a log.

    Args:
        floor: with doors left out, as people open them.
        robot: (T, 3) true poses of the robot every STEP_S; its length is the log's.

    Raises:
        SimulationError: there is no floor for them.
    """
    roles: list[Role] = ["push" if k < crowd.carts else "walk" for k in range(crowd.walkers)]
    others: tuple[tuple[Role, int], ...] = (
        ("stand", crowd.standing),
        ("queue", crowd.queue),
        ("block", crowd.blockers),
    )
    roles += [role for role, count in others for _ in range(count)]
    if not roles:
        return People()
    free = floor.free_points(BODY_RADIUS_M + 0.15)
    if not len(free):
        raise SimulationError(
            "there is no floor that a person fits on", where=floor.source, hint="ask for 0 people, or check the rooms"
        )
    people = figures(rng, first + len(roles))[first:]
    starts = _starts(rng, roles, free, floor, robot)
    goals = [_goals(rng, role, start, free) for role, start in zip(roles, starts, strict=True)]
    speeds = np.clip(rng.normal(crowd.speed_m_s, 0.2, len(roles)), 0.4, 2.0)
    moving = np.array([role in ("walk", "push") for role in roles])
    tracks, headings = _walk(rng, crowd, floor, robot, starts, goals, np.where(moving, speeds, 0.0))
    agents = []
    for k, (figure, role) in enumerate(zip(people, roles, strict=True)):
        steps = np.hypot(*np.diff(tracks[:, k], axis=0, prepend=tracks[:1, k]).T)
        poses = np.column_stack([tracks[:, k], headings[:, k]])
        agents.append(Agent(figure, role, poses, np.cumsum(steps), _smooth(steps / STEP_S)))
    solids = [solid for agent in agents for solid in agent.figure.solids]
    bodies = [body for agent in agents for body in agent.figure.bodies]
    for agent in agents:
        if agent.role == "push":
            solids += _cart_solids(agent.figure)
            bodies.append(Body(_cart(agent.figure)))
    return People(tuple(agents), tuple(solids), tuple(bodies))


# ------------------------------------------------------------------------------------------ where they begin


def _starts(
    rng: np.random.Generator, roles: Sequence[Role], free: Float64Array, floor: Floor, robot: Float64Array
) -> Float64Array:
    """(P, 2) places that are apart from each other and from the robot's start; groups and queues close together."""
    found: list[Float64Array] = []
    group: tuple[Float64Array, int] | None = None
    direction = np.zeros(2)
    for role in roles:
        if role == "stand" and group is not None and group[1] > 0:
            angle = rng.uniform(0, 2 * math.pi)
            place = group[0] + rng.uniform(0.35, 0.6) * np.array([math.cos(angle), math.sin(angle)])
            group = (group[0], group[1] - 1)
            place = place if _fits(place, floor, found) else _elsewhere(rng, free, found, robot[0, :2])
        elif role == "stand":
            place = _elsewhere(rng, free, found, robot[0, :2])
            group = (place + rng.uniform(-0.4, 0.4, 2), int(rng.integers(1, 4)))
        elif role == "queue" and found and direction.any() and _fits(found[-1] + direction, floor, found):
            place = found[-1] + direction
        elif role == "queue":
            place = _elsewhere(rng, free, found, robot[0, :2])
            angle = rng.uniform(0, 2 * math.pi)
            direction = 0.6 * np.array([math.cos(angle), math.sin(angle)])
        elif role == "block":
            place = _before_a_wall(rng, free, floor, found, robot)
        else:
            place = _elsewhere(rng, free, found, robot[0, :2])
        found.append(place)
    return np.array(found)


def _fits(place: Float64Array, floor: Floor, others: list[Float64Array]) -> bool:
    apart = all(np.hypot(*(place - other)) > 2 * BODY_RADIUS_M for other in others)
    return apart and float(floor.clearance_at(place)) > BODY_RADIUS_M


def _elsewhere(
    rng: np.random.Generator, free: Float64Array, others: list[Float64Array], robot: Float64Array
) -> Float64Array:
    """A place at least a metre from everyone, or the loneliest of many tried."""
    tried = free[rng.integers(len(free), size=40)]
    away = np.min([np.hypot(*(tried - other).T) for other in [robot, *others]], axis=0)
    far = np.flatnonzero(away > 1.0)
    return np.asarray(tried[far[0] if len(far) else int(np.argmax(away))])


def _before_a_wall(
    rng: np.random.Generator, free: Float64Array, floor: Floor, others: list[Float64Array], robot: Float64Array
) -> Float64Array:
    """A place close to a wall and 0.8 to 2 m off the robot's way."""
    clearance = floor.clearance_at(free)
    to_robot = np.min(np.hypot(*(free[:, None] - robot[None, ::20, :2]).transpose(2, 0, 1)), axis=1)
    fitting = free[(clearance < 0.55) & (to_robot > 0.8) & (to_robot < 2.0)]
    return _elsewhere(rng, fitting if len(fitting) else free, others, robot[0, :2])


def _goals(rng: np.random.Generator, role: Role, start: Float64Array, free: Float64Array) -> Callable[[], Float64Array]:
    """Where someone goes next: far enough to be worth the walk."""
    own = np.random.default_rng(rng.integers(2**32))

    def next_goal() -> Float64Array:
        tried = free[own.integers(len(free), size=12)]
        away = np.hypot(*(tried - start).T)
        return np.asarray(tried[int(np.argmax(np.minimum(away, 6.0) + 0.01 * own.random(12)))])

    return next_goal


# ------------------------------------------------------------------------------------------------- how they walk


def _walk(
    rng: np.random.Generator,
    crowd: Crowd,
    floor: Floor,
    robot: Float64Array,
    starts: Float64Array,
    goals: Sequence[Callable[[], Float64Array]],
    speeds: Float64Array,
) -> tuple[Float64Array, Float64Array]:
    """(T, P, 2) places and (T, P) headings of everyone."""
    count, steps = len(starts), len(robot)
    push = _wall_push(floor)
    places, velocities = starts.copy(), np.zeros((count, 2))
    headings = rng.uniform(-math.pi, math.pi, count)
    ways: list[list[Float64Array]] = [[] for _ in range(count)]
    waits = np.where(speeds > 0, rng.uniform(0, 1.0, count), np.inf)
    stuck = np.zeros(count)
    tracks, turns = np.empty((steps, count, 2)), np.empty((steps, count))
    for step in range(steps):
        tracks[step], turns[step] = places, headings
        wanted = np.zeros((count, 2))
        for k in np.flatnonzero(speeds > 0).tolist():
            waits[k] -= STEP_S
            if waits[k] > 0:
                continue
            if not ways[k]:
                ways[k] = _way(floor, places[k], goals[k]())
            if ways[k] and np.hypot(*(ways[k][0] - places[k])) < 0.3:
                ways[k].pop(0)
                if not ways[k]:
                    waits[k] = rng.exponential(crowd.pause_s) if crowd.pause_s > 0 else 0.0
                    continue
            if ways[k]:
                towards = ways[k][0] - places[k]
                wanted[k] = speeds[k] * towards / max(float(np.hypot(*towards)), 1e-6)
        force = (wanted - velocities) / 0.5 + _crowd_push(places, robot[step, :2]) + push(places)
        moves = (speeds > 0) & (waits <= 0)
        velocities = np.where(moves[:, None], velocities + STEP_S * force, 0.0)
        pace = np.maximum(np.hypot(*velocities.T), 1e-9)
        velocities *= np.minimum(1.0, 1.3 * np.maximum(speeds, 1e-9) / pace)[:, None]
        ahead = places + STEP_S * velocities
        ahead = np.where((floor.clearance_at(ahead) > 0.12)[:, None], ahead, places)
        # whoever gets nowhere for two seconds goes somewhere else
        slow = moves & (np.hypot(*(ahead - places).T) < 0.1 * STEP_S * speeds)
        stuck = np.where(slow, stuck + STEP_S, 0.0)
        for k in np.flatnonzero(stuck > 2.0).tolist():
            ways[k], stuck[k] = [], 0.0
        places = ahead
        is_walking = np.hypot(*velocities.T) > 0.15
        turn = (np.arctan2(velocities[:, 1], velocities[:, 0]) - headings + math.pi) % (2 * math.pi) - math.pi
        headings = headings + np.where(is_walking, np.clip(turn, -4.0 * STEP_S, 4.0 * STEP_S), 0.0)
    return tracks, turns


def _way(floor: Floor, start: Float64Array, goal: Float64Array) -> list[Float64Array]:
    try:
        return list(floor.way(start.tolist(), goal.tolist(), BODY_RADIUS_M)[1:])
    except SimulationError:
        return []


def _crowd_push(places: Float64Array, robot: Float64Array) -> Float64Array:
    """(P, 2) acceleration away from everyone near and from the robot."""
    others = np.vstack([places, robot])
    apart = places[:, None] - others[None]
    distance = np.maximum(np.hypot(apart[..., 0], apart[..., 1]), 1e-3)
    touch = np.full(len(others), 2 * BODY_RADIUS_M)
    touch[-1] = BODY_RADIUS_M + ROBOT_RADIUS_M
    strength = 3.0 * np.exp((touch - distance) / 0.3)
    strength[np.arange(len(places)), np.arange(len(places))] = 0.0
    return np.asarray(np.sum(strength[..., None] * apart / distance[..., None], axis=1))


def _wall_push(floor: Floor) -> Callable[[Float64Array], Float64Array]:
    """Acceleration (P, 2) away from what is nearest, down the slope of the clearance."""
    from scipy.ndimage import gaussian_filter

    slope = np.stack(np.gradient(gaussian_filter(floor.clearance_m, 1.0)), axis=-1)[..., ::-1]

    def push(places: Float64Array) -> Float64Array:
        row, column = np.moveaxis(floor.cells_of(places), -1, 0)
        clear = floor.clearance_m[row, column]
        away = slope[row, column]
        away = away / np.maximum(np.hypot(*away.T), 1e-6)[:, None]
        return np.asarray(2.0 * np.exp((BODY_RADIUS_M - clear) / 0.1)[:, None] * away)

    return push


def _smooth(speeds: Float64Array) -> Float64Array:
    from scipy.ndimage import uniform_filter1d

    return np.asarray(uniform_filter1d(speeds, 7, mode="nearest"))


# ------------------------------------------------------------------------------------------------------- carts


def _cart(figure: Figure) -> str:
    return f"{figure.name}.cart"


def _cart_solids(figure: Figure) -> list[Solid]:
    """A trolley: a deck on four posts, open at a LiDAR's height but for its posts and wheels."""
    name = _cart(figure)
    parts: list[tuple[tuple[float, float, float], tuple[float, float, float]]] = [
        ((0.7, 0.45, 0.04), (0.0, 0.0, 0.22)),
        ((0.7, 0.45, 0.04), (0.0, 0.0, 0.80)),
        ((0.55, 0.38, 0.35), (0.02, 0.0, 0.44)),
    ]
    parts += [((0.03, 0.03, 0.95), (0.33 * x, 0.2 * y, 0.5)) for x in (-1, 1) for y in (-1, 1)]
    return [Solid(name, "cart", "box", size, upright(x, y, 0.0, z), name, look="cart") for size, (x, y, z) in parts]
