"""Everything that is decided before the first measurement of a simulated log, and what a sensor gives back."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from wallkit.core.geometry import interpolate_poses
from wallkit.core.types import Float64Array, Int64Array
from wallkit.errors import SimulationError, closest
from wallkit.logs.message import Value
from wallkit.pipelines.simulate.units import units_of
from wallkit.simulate.camera import Unit
from wallkit.simulate.crowd import People
from wallkit.simulate.looks import Wardrobe
from wallkit.simulate.robot import Robot
from wallkit.simulate.scenario import Scenario
from wallkit.simulate.scene import Scene
from wallkit.simulate.stage import StatesAt
from wallkit.simulate.studio import Studio
from wallkit.simulate.timing import Schedule
from wallkit.simulate.world import World

START_NS = 1_700_000_000_000_000_000


@dataclass(frozen=True, eq=False)
class Play:
    """Everything that is decided before the first measurement.

    Attributes:
        stamps_ns, poses: (T,), (T, 3) where the robot truly is, T_map_base, at 100 Hz from START_NS on.
        rngs: a generator for each sensor, so that one more of them changes nothing in the others.
        seed: of the log; pictures draw from it and their own moment, in any order.
        mapped: what stands where the map says it does.
    """

    scenario: Scenario
    robot: Robot
    world: World
    scene: Scene
    people: People
    states_at: StatesAt
    stamps_ns: Int64Array
    poses: Float64Array
    rngs: dict[str, np.random.Generator]
    seed: int = 0
    mapped: frozenset[str] = frozenset()

    @property
    def duration_s(self) -> float:
        return float(self.stamps_ns[-1] - self.stamps_ns[0]) / 1e9

    def bodies_at(self, at_ns: int) -> dict[str, Float64Array]:
        """T_map_body (4, 4) of people and doors by name, at a moment."""
        time_s = (at_ns - START_NS) / 1e9
        return {**self.world.poses(self.states_at(time_s)), **self.people.posed(time_s)}

    def place(self, at_ns: int) -> None:
        """Puts people and doors where they are at a moment, for rays."""
        self.scene.place(self.bodies_at(at_ns))

    @cached_property
    def studio(self) -> Studio:
        """The same world dressed for cameras; made when the first picture is asked for."""
        looks = self.scenario.looks
        return Studio(Wardrobe(self.world, looks, self.seed if looks.seed < 0 else looks.seed))

    def place_studio(self, at_ns: int) -> None:
        """Puts people and doors where they are at a moment, for pictures."""
        self.studio.place(self.bodies_at(at_ns))

    @cached_property
    def units(self) -> dict[str, Unit]:
        """The scenario's cameras by name.

        Raises:
            SimulationError: two have one name, a frame is not the robot's, or a lens cannot be.
        """
        return units_of(self.robot, self.scenario.cameras)

    def unit(self, name: str) -> Unit:
        """One of the scenario's cameras.

        Raises:
            SimulationError: there is none of that name; else as `units`.
        """
        if name not in self.units:
            hint = closest(name, self.units) if self.units else "add a [[cameras]] table to the scenario"
            raise SimulationError(f"the scenario has no camera '{name}'", hint=hint)
        return self.units[name]

    def close(self) -> None:
        """Frees what pictures needed, if there were any."""
        if "studio" in self.__dict__:
            self.studio.close()

    def pose_at(self, at_ns: int) -> Float64Array:
        """(3,) T_map_base."""
        # only the two poses around it: the angles of a whole log are not unwrapped for each beam
        after = int(np.clip(np.searchsorted(self.stamps_ns, at_ns), 1, len(self.stamps_ns) - 1))
        around = slice(after - 1, after + 1)
        return np.asarray(interpolate_poses(self.stamps_ns[around], self.poses[around], [at_ns])[0])


class Sensor(Protocol):
    """Something on the robot that measures now and then."""

    @property
    def schedule(self) -> Schedule: ...

    def measure(self, at_ns: int, stamp_ns: int) -> Iterable[Message]:
        """What it publishes of a moment."""
        ...


@dataclass(frozen=True)
class Serialized:
    """A message that no core type stands for, as its ROS type and CDR bytes."""

    type_name: str
    data: bytes


@dataclass(frozen=True)
class Message:
    """One message of a log."""

    topic: str
    value: Value | Serialized
