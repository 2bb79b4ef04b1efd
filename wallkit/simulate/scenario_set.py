"""A folder with set.toml -> its takes: every scene at every crowd level with every seed, each a scenario of its own."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path

from wallkit.core.config import build, read_toml, section, setting, tables
from wallkit.errors import SimulationError, closest
from wallkit.simulate.crowd import Crowd
from wallkit.simulate.scenario import Scenario, scenario_from


@dataclass(frozen=True)
class SetScene:
    """A place and what the robot does in it; file names are relative to the set's folder."""

    name: str = setting("", "of the scene, the first part of its logs' names")
    map: str = setting("", "the semantic map")
    scenario: str = setting("", "the scenario, on top of the sensors")


@dataclass(frozen=True)
class SetLevel:
    """How many people are about, the second part of the logs' names."""

    crowd: Crowd = section(Crowd, "who they are")

    @property
    def people(self) -> int:
        crowd = self.crowd
        return crowd.walkers + crowd.standing + crowd.queue + crowd.blockers


@dataclass(frozen=True)
class ScenarioSet:
    """set.toml: what `wallkit simulate set` records."""

    title: str = setting("", "one line for people")
    robot: str = setting("", "URDF of the robot in all scenes; else the built-in one")
    sensors: str = setting("", "a scenario with what all scenes share: sensors, their faults and cameras")
    seeds: tuple[int, ...] = setting((0,), "of the logs, the last part of their names")
    scenes: tuple[SetScene, ...] = tables(SetScene, "the places")
    levels: tuple[SetLevel, ...] = tables(SetLevel, "the crowds")


@dataclass(frozen=True)
class Take:
    """One log of a set, before it is recorded."""

    name: str
    scene: str
    map_path: Path
    robot_path: Path | None
    scenario: Scenario
    seed: int


def takes_of(folder: Path, only: tuple[str, ...] = ()) -> tuple[Take, ...]:
    """The takes of a set whose names SCENE-PEOPLE-SEED fit one of the patterns; without patterns all of them.

    Raises:
        ConfigError: set.toml or a scenario has an unknown setting or an impossible value.
        SimulationError: no scenes or levels, two of one name, or a pattern that no take fits.
    """
    path = folder / "set.toml"
    story = build(ScenarioSet, [read_toml(path)])[0]
    levels = story.levels or (SetLevel(),)
    robot = folder / story.robot if story.robot else None
    found: dict[str, Take] = {}
    for scene in story.scenes:
        files = [name for name in (story.sensors, scene.scenario) if name]
        scenario = scenario_from([read_toml(folder / name) for name in files])
        for level in levels:
            for seed in story.seeds:
                name = f"{scene.name}-{level.people}-{seed}"
                if name in found or not scene.name:
                    why = f"makes the log '{name}' twice" if scene.name else "has a scene without a name"
                    raise SimulationError(why, where=path, hint="names, numbers of people and seeds differ")
                crowded = replace(scenario, crowd=level.crowd)
                found[name] = Take(name, scene.name, folder / scene.map, robot, crowded, seed)
    if not found:
        raise SimulationError("has no [[scenes]] or no seeds", where=path, hint="see evaluation/set.toml of wallkit")
    for pattern in only:
        if not any(fnmatchcase(name, pattern) for name in found):
            raise SimulationError(f"no log is called '{pattern}'", where=path, hint=closest(pattern, found))
    return tuple(
        take for name, take in found.items() if not only or any(fnmatchcase(name, pattern) for pattern in only)
    )
