"""What happens in a simulated log: a TOML file -> settings of the route, people, doors, sensors, and how the map lies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from wallkit.core.config import build, read_toml, section, setting, source_from_words, tables
from wallkit.simulate.crowd import Crowd
from wallkit.simulate.odometry import WheelOdometry
from wallkit.simulate.route import Route
from wallkit.simulate.scanner import Scanner


@dataclass(frozen=True)
class Timing:
    """When a sensor measures, and when its message is stamped and recorded."""

    phase_s: float = setting(0.0, "of its first measurement after the log's beginning", low=0)
    jitter_s: float = setting(0.0, "sigma of the time between measurements", low=0)
    latency_s: float = setting(0.0, "from the measurement to its record", low=0)
    offset_s: float = setting(0.0, "of its clock: what is added to every stamp")
    drift_ppm: float = setting(0.0, "how fast its clock gains", low=-10000, high=10000)
    drops: float = setting(0.0, "share of messages that are lost", low=0, high=1)


@dataclass(frozen=True)
class LidarSetup:
    """The LiDAR: where it is, what it does wrong, and when."""

    frame: str = setting("", "its link in the robot's URDF; else the only one that is called like a LiDAR")
    roll_rad: float = setting(0.0, "it truly leans so far to its left from where the URDF says", low=-0.5, high=0.5)
    pitch_rad: float = setting(0.0, "it truly looks so far down", low=-0.5, high=0.5)
    scanner: Scanner = section(Scanner, "beams, range and faults")
    timing: Timing = section(Timing, "when it measures; its rate is scanner.rate_hz")


@dataclass(frozen=True)
class OdometrySetup:
    """Wheel odometry: how it errs, and when."""

    rate_hz: float = setting(20.0, "messages per second", low=1, high=500)
    wheels: WheelOdometry = section(WheelOdometry, "noise, wheel sizes, slip")
    timing: Timing = section(Timing, "when it measures")


@dataclass(frozen=True)
class DoorPlan:
    """How a door moves: states in between are on the line from one to the next."""

    joint: str = setting("", "its joint, or its link, in the map")
    times_s: tuple[float, ...] = setting((0.0,), "after the log's beginning, ascending")
    states: tuple[float, ...] = setting((0.0,), "rad or m at these times")


@dataclass(frozen=True)
class Moved:
    """The map lies: a thing stands elsewhere in the world."""

    link: str = setting("", "in the map")
    by: tuple[float, float, float] = setting((0.0, 0.0, 0.0), "m, m in the map's axes, and rad about its own origin")


@dataclass(frozen=True)
class Missing:
    """The map lies: a thing is not in the world."""

    link: str = setting("", "in the map")


@dataclass(frozen=True)
class Extra:
    """The map lies: a box in the world that the map does not know."""

    name: str = setting("extra", "of the thing, for labels")
    class_name: str = setting("furniture", "its class")
    size: tuple[float, float, float] = setting((0.5, 0.5, 1.0), "of the box [m]", low=0.001)
    at: tuple[float, float, float] = setting((0.0, 0.0, 0.0), "x, y, yaw in the map")
    bottom_m: float = setting(0.0, "its underside above the floor")


@dataclass(frozen=True)
class Scenario:
    """One log's story. Everything random in it follows from the seed."""

    title: str = setting("", "one line for people")
    duration_s: float = setting(0.0, "the log ends then, or when the route does; 0: with the route", low=0)
    route: Route = section(Route, "where the robot goes")
    crowd: Crowd = section(Crowd, "who else is there")
    lidar: LidarSetup = section(LidarSetup, "the LiDAR")
    odometry: OdometrySetup = section(OdometrySetup, "wheel odometry")
    doors: tuple[DoorPlan, ...] = tables(DoorPlan, "doors that move, or stand otherwise than the map says")
    moved: tuple[Moved, ...] = tables(Moved, "things that stand elsewhere than the map says")
    missing: tuple[Missing, ...] = tables(Missing, "things that are only in the map")
    extra: tuple[Extra, ...] = tables(Extra, "things that are not in the map")


def read_scenario(path: Path | None, words: Sequence[str] = ()) -> Scenario:
    """The scenario of a file, with --set words on top; without a file the defaults.

    Raises:
        ConfigError: an unknown setting or an impossible value, with file, line and the closest name.
    """
    sources = [read_toml(path)] if path is not None else []
    return build(Scenario, [*sources, source_from_words(words)])[0]
