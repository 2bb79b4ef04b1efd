"""What happens in a simulated log: a TOML file -> settings of the route, people, doors, sensors, and how the map lies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from wallkit.core.config import Source, build, read_toml, section, setting, source_from_words, tables
from wallkit.errors import ConfigError, SimulationError
from wallkit.simulate.crowd import Crowd
from wallkit.simulate.looks import Looks
from wallkit.simulate.meshes import MeshFor, axes_of, bounds_of
from wallkit.simulate.odometry import WheelOdometry
from wallkit.simulate.photo import Photo
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
class CameraSetup:
    """A camera: where it is, its lens, what it does wrong, and when. Its K and D are those it publishes."""

    name: str = setting("front", "of the camera, in its topics /camera/NAME/...")
    frame: str = setting("", "its optical frame in the robot's URDF; else the one with its name in it, or the only one")
    width: int = setting(640, "of the picture [px]", low=8, high=8192)
    height: int = setting(480, "of the picture [px]", low=8, high=8192)
    hfov_deg: float = setting(75.0, "what it sees across, before distortion, when no K is given", low=1, high=200)
    K: tuple[float, ...] = setting((), "fx, fy, cx, cy [px]; none: of hfov_deg, in the middle of the picture")
    model: str = setting("plumb_bob", "of its lens: plumb_bob, rational_polynomial or equidistant")
    D: tuple[float, ...] = setting((), "distortion as the model has it; none: zeros")
    rate_hz: float = setting(10.0, "pictures per second", low=0.01, high=200)
    masks: Literal["none", "raster", "exact"] = setting(
        "none", "what each pixel shows, on /oracle/NAME/...: by the renderer, or exactly by rays (and without OpenGL)"
    )
    glass: Literal["surface", "through"] = setting(
        "surface", "a pixel on a pane is labelled as glass, or as what is behind"
    )
    pictures: bool = setting(True, "false: masks only, which needs no OpenGL")
    off_mm: tuple[float, float, float] = setting(
        (0.0, 0.0, 0.0), "it truly is so far from where the URDF says, along its own axes: right, down, forward"
    )
    off_deg: tuple[float, float, float] = setting((0.0, 0.0, 0.0), "and turned about these axes, as a rotation vector")
    focal_error: float = setting(0.0, "its true focal lengths are larger than published, relative", low=-0.5, high=0.5)
    centre_error_px: tuple[float, float] = setting((0.0, 0.0), "its true principal point is off the published one")
    photo: Photo = section(Photo, "exposure, colour, blur, noise")
    timing: Timing = section(Timing, "when it takes pictures")


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
    looks: Looks = section(Looks, "how the world looks to cameras")
    cameras: tuple[CameraSetup, ...] = tables(CameraSetup, "the cameras; none: a log without pictures")
    doors: tuple[DoorPlan, ...] = tables(DoorPlan, "doors that move, or stand otherwise than the map says")
    moved: tuple[Moved, ...] = tables(Moved, "things that stand elsewhere than the map says")
    missing: tuple[Missing, ...] = tables(Missing, "things that are only in the map")
    extra: tuple[Extra, ...] = tables(Extra, "things that are not in the map")
    meshes: tuple[MeshFor, ...] = tables(MeshFor, "true shapes of what the map has as boxes, from files of your own")


def read_scenario(path: Path | None, words: Sequence[str] = ()) -> Scenario:
    """The scenario of a file, with --set words on top; without a file the defaults.

    Raises:
        ConfigError: see scenario_from.
    """
    sources = [read_toml(path)] if path is not None else []
    return scenario_from([*sources, source_from_words(words)])


def scenario_from(sources: Sequence[Source]) -> Scenario:
    """The scenario that sources make together, the later ones winning; its meshes are found from the file that names them.

    Raises:
        ConfigError: an unknown setting or an impossible value, with file, line and the closest name; or a mesh that is not
            there or cannot be used.
    """
    scenario = build(Scenario, sources)[0]
    named = [source for source in sources if "meshes" in source.table]
    return replace(scenario, meshes=tuple(_found(mesh, named[-1]) for mesh in scenario.meshes))


def _found(mesh: MeshFor, source: Source) -> MeshFor:
    """The same, its path from here on."""
    found = replace(mesh, file=str(Path(source.label).parent / mesh.file))
    try:
        axes_of(found), bounds_of(Path(found.file))
    except SimulationError as error:
        # of several tables the one that names this file
        lines = (number for number, line in enumerate(source.text.splitlines(), start=1) if mesh.file in line)
        where = f"{source.label}:{next(lines, 1)}" if mesh.file and source.text else source.label
        message = f"[[meshes]] of '{mesh.of}' has file = '{mesh.file}': {error.message}"
        raise ConfigError(message, where=where, hint=error.hint) from error
    return found
