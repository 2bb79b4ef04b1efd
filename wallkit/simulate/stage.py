"""A map's world and a scenario -> the world as it truly is: what was moved, is missing or was added, who is about, and how
doors stand at any time."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from wallkit.core.types import Float64Array
from wallkit.errors import SimulationError, closest
from wallkit.simulate.crowd import People
from wallkit.simulate.meshes import MeshFor, fitted
from wallkit.simulate.scenario import DoorPlan, Extra, Moved, Scenario
from wallkit.simulate.world import MAP, Body, Solid, World, upright

SLAB_M = 0.1
StatesAt = Callable[[float], dict[str, float]]


def staged(world: World, scenario: Scenario) -> World:
    """The world with everything that the map does not say, a floor below and a ceiling above.

    Raises:
        SimulationError: the scenario names a thing that is not in the map, or a mesh that cannot be used.
    """
    solids = list(world.solids)
    for missing in scenario.missing:
        _check_known(world, missing.link, "missing")
        solids = [solid for solid in solids if solid.instance != missing.link]
    for moved in scenario.moved:
        _check_known(world, moved.link, "moved")
        solids = _with_moved(world, solids, moved)
    solids += [_box(extra) for extra in scenario.extra]
    if scenario.meshes:
        solids = _with_meshes(world, solids, scenario.meshes)
    return replace(world, solids=(*solids, *_slabs(world)))


def populated(world: World, people: People) -> World:
    """The world with its people and their carts in it."""
    return replace(world, solids=(*world.solids, *people.solids), bodies=(*world.bodies, *people.bodies))


def door_states(world: World, scenario: Scenario) -> StatesAt:
    """The state of every door that the scenario speaks of, at a time [s] after the log's beginning.

    Raises:
        SimulationError: no such door, times that do not ascend or do not match the states, a state beyond the door's limits.
    """
    plans = {_joint_of(world, plan): plan for plan in scenario.doors}
    for joint, plan in plans.items():
        _check_plan(world, joint, plan)

    def states_at(time_s: float) -> dict[str, float]:
        return {joint: float(np.interp(time_s, plan.times_s, plan.states)) for joint, plan in plans.items()}

    return states_at


# -------------------------------------------------------------------------------------------- lies


def _check_known(world: World, link: str, table: str) -> None:
    known = {solid.instance for solid in world.solids}
    if link not in known:
        raise SimulationError(
            f"[[{table}]] names '{link}', which is not in the map", where=world.source, hint=closest(link, known)
        )


def _with_moved(world: World, solids: list[Solid], moved: Moved) -> list[Solid]:
    """All solids, those of one thing moved in the map's axes and turned about the middle of its first part."""
    own = next(solid for solid in solids if solid.instance == moved.link)
    if own.body != MAP:
        raise SimulationError(
            f"'{moved.link}' hangs on the joint '{own.body}'",
            where=world.source,
            hint="give its state by [[doors]] instead",
        )
    pivot = own.T_body_solid[:2, 3]
    dx, dy, turn = moved.by
    T = upright(pivot[0] + dx, pivot[1] + dy, turn) @ upright(-pivot[0], -pivot[1], 0.0)
    return [
        replace(solid, T_body_solid=T @ solid.T_body_solid) if solid.instance == moved.link else solid
        for solid in solids
    ]


def _box(extra: Extra) -> Solid:
    x, y, yaw = extra.at
    place = upright(x, y, yaw, extra.bottom_m + extra.size[2] / 2)
    return Solid(extra.name, extra.class_name, "box", extra.size, place)


def _with_meshes(world: World, solids: list[Solid], meshes: tuple[MeshFor, ...]) -> list[Solid]:
    """All solids, one mesh for all parts of each thing that a mesh is given for; one by name before one by class."""
    things: dict[str, list[Solid]] = {}
    for solid in solids:
        things.setdefault(solid.instance, []).append(solid)
    known = {name for solid in solids for name in (solid.instance, solid.class_name)}
    for mesh in meshes:
        if mesh.of not in known:
            message = f"[[meshes]] names '{mesh.of}', which is no class or thing in the map"
            raise SimulationError(message, where=world.source, hint=closest(mesh.of, known))
    given = {mesh.of: mesh for mesh in meshes}
    found = []
    for name, parts in things.items():
        own = given.get(name) or given.get(parts[0].class_name)
        found += [fitted(own, parts)] if own else parts
    return found


def _slabs(world: World) -> tuple[Solid, ...]:
    """Floor and ceiling under and over everything, unless the map has its own."""
    (x0, y0), (x1, y1) = world.extent
    size = (float(x1 - x0) + 1.0, float(y1 - y0) + 1.0, SLAB_M)
    x, y = float(x0 + x1) / 2, float(y0 + y1) / 2
    own = {solid.class_name for solid in world.solids}
    places = {"floor": -SLAB_M / 2, "ceiling": world.height_m + SLAB_M / 2}
    return tuple(Solid(name, name, "box", size, upright(x, y, 0.0, z)) for name, z in places.items() if name not in own)


# -------------------------------------------------------------------------------------------- doors


def _joint_of(world: World, plan: DoorPlan) -> str:
    jointed: Mapping[str, Body] = {body.name: body for body in world.bodies if body.motion != "free"}
    if plan.joint in jointed:
        return plan.joint
    by_link = {solid.instance: solid.body for solid in world.solids if solid.body in jointed}
    if plan.joint in by_link:
        return by_link[plan.joint]
    known = [*jointed, *by_link]
    hint = closest(plan.joint, known) if known else "nothing in this map moves"
    raise SimulationError(f"[[doors]] names '{plan.joint}', which is no door", where=world.source, hint=hint)


def _check_plan(world: World, joint: str, plan: DoorPlan) -> None:
    times: Float64Array = np.asarray(plan.times_s)
    if len(plan.times_s) != len(plan.states) or not len(times) or (np.diff(times) <= 0).any():
        raise SimulationError(
            f"door '{plan.joint}' has times {list(plan.times_s)} and states {list(plan.states)}",
            where=world.source,
            hint="as many states as times, and the times ascend",
        )
    low, high = world.body[joint].limits
    beyond = [state for state in plan.states if not low - 1e-6 <= state <= high + 1e-6]
    if beyond:
        raise SimulationError(
            f"door '{plan.joint}' cannot stand at {beyond[0]:g}: it goes from {low:g} to {high:g}", where=world.source
        )
