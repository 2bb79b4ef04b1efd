"""Map, robot, scenario and seed -> a recorded log with exact truth. Read `simulate_log` from top to bottom."""

from __future__ import annotations

import contextlib
import hashlib
import heapq
import json
import zlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import wallkit
from wallkit.core.config import table_from
from wallkit.core.types import CameraImage, Trajectory, Transform
from wallkit.errors import SimulationError
from wallkit.evaluate.tum import write_tum
from wallkit.logs.encode import encode
from wallkit.logs.writer import McapWriter
from wallkit.maps.read import load_map
from wallkit.pipelines.outputs import result_folder
from wallkit.pipelines.run_folder import sha256, write_json
from wallkit.pipelines.simulate.ceiling import write_true_ceiling
from wallkit.pipelines.simulate.jobs import Task, messages_of
from wallkit.pipelines.simulate.play import START_NS, Message, Play, Sensor, Serialized
from wallkit.pipelines.simulate.sensors import LidarSensor, sensors_of
from wallkit.pipelines.simulate.truth import truth_csv, unmapped_share
from wallkit.pipelines.simulate.world import world_from_map
from wallkit.simulate.camera import Unit
from wallkit.simulate.crowd import STEP_S, people_from
from wallkit.simulate.floor import floor_of
from wallkit.simulate.gl import backend
from wallkit.simulate.robot import DEFAULT_ROBOT, robot_from_urdf
from wallkit.simulate.route import drive
from wallkit.simulate.scenario import Scenario
from wallkit.simulate.scene import Scene
from wallkit.simulate.stage import door_states, populated, staged

_TRUTH_HZ = 100.0
Progress = Callable[[int], None]


@dataclass(frozen=True)
class LogRequest:
    """What to simulate: one log of one scenario in one map."""

    map_path: Path
    scenario: Scenario
    robot_path: Path = DEFAULT_ROBOT
    seed: int = 0


@dataclass(frozen=True)
class Simulated:
    """What was written: messages by topic, those that timing faults lost by sensor, and the share of all returns that come
    from what is not in the map."""

    duration_s: float
    messages: dict[str, int]
    dropped: dict[str, int]
    path_m: float
    people: int
    unmapped_share: float


def prepare(request: LogRequest) -> Play:
    """The world, the people and the robot's way.

    Raises:
        MapError, SimulationError: see world_from_map, staged, door_states, drive, people_from, robot_from_urdf.
    """
    scenario = request.scenario
    rngs = _generators(request.seed)
    robot = robot_from_urdf(request.robot_path)
    mapped = world_from_map(load_map(request.map_path))
    world = staged(mapped, scenario)
    states_at = door_states(world, scenario)
    floor = floor_of(world, states_at(0.0))
    poses = drive(rngs["route"], scenario.route, floor, _TRUTH_HZ, duration_s=scenario.duration_s)
    stamps_ns = START_NS + np.round(np.arange(len(poses)) * 1e9 / _TRUTH_HZ).astype(np.int64)
    paces = poses[:: round(STEP_S * _TRUTH_HZ)]
    people = people_from(rngs["people"], scenario.crowd, floor_of(world, with_doors=False), paces)
    world = populated(world, people)
    stands = {solid.instance for solid in mapped.solids} - {moved.link for moved in scenario.moved}
    return Play(
        scenario, robot, world, Scene(world), people, states_at, stamps_ns, poses, rngs, request.seed, frozenset(stands)
    )


def simulate_log(
    request: LogRequest, out: Path, *, overwrite: bool = False, jobs: int = 1, progress: Progress = lambda _: None
) -> Simulated:
    """A folder with log.mcap, truth.tum, truth.csv, manifest.json, the map the robot is given, and with cameras the ceiling.

    Args:
        jobs: processes that make pictures.
        progress: told how many hundredths of the log are done.

    Raises:
        OutputError: `out` cannot be written.
        SimulationError: pictures are asked for and no OpenGL works. Else as `prepare`.
    """
    check_pictures(request.scenario)
    with result_folder(out, overwrite=overwrite) as folder, contextlib.closing(prepare(request)) as play:
        sensors = sensors_of(play)
        measured = messages_of(_tasks(sensors), sensors, partial(prepare, request), jobs)
        with McapWriter(folder / "log.mcap") as file:
            _write_static(file, play)
            counts, hashes = _write(file, _recorded(measured, play, progress))
        write_tum(folder / "truth.tum", Trajectory(play.stamps_ns[::5], play.poses[::5]))
        (folder / "map.wkmap.urdf").write_bytes(request.map_path.read_bytes())
        if any(camera.pictures for camera in request.scenario.cameras):
            write_true_ceiling(folder, play)
        steps = np.hypot(*np.diff(play.poses[:, :2], axis=0).T)
        dropped = {name: sensor.schedule.dropped for name, sensor in sensors.items()}
        lidar = sensors["lidar"]
        assert isinstance(lidar, LidarSensor)
        (folder / "truth.csv").write_text(truth_csv(play, lidar.seen), encoding="utf-8")
        hard = unmapped_share(lidar.seen)
        done = Simulated(play.duration_s, counts, dropped, float(steps.sum()), len(play.people.agents), hard)
        write_json(folder / "manifest.json", _manifest(request, play, done, hashes))
        # the mark by which --overwrite knows a folder of ours
        write_json(folder / "run.json", {"schema": 1, "command": "simulate log", "seed": request.seed})
    return done


# -------------------------------------------------------------------------------------------- the log


def check_pictures(scenario: Scenario) -> None:
    """Whether the scenario's pictures can be made.

    Raises:
        SimulationError: no OpenGL works; it says what to install.
    """
    if any(camera.pictures or camera.masks == "raster" for camera in scenario.cameras):
        backend()


def _tasks(sensors: dict[str, Sensor]) -> list[Task]:
    """Every measurement in order of time; of the same moment in the sensors' order."""
    order = {name: number for number, name in enumerate(sensors)}
    tasks = [
        Task(name, START_NS + int(time_ns), START_NS + int(stamp_ns), START_NS + int(log_ns))
        for name, sensor in sensors.items()
        for time_ns, stamp_ns, log_ns in zip(
            sensor.schedule.times_ns, sensor.schedule.stamps_ns, sensor.schedule.logs_ns, strict=True
        )
    ]
    return sorted(tasks, key=lambda task: (task.at_ns, order[task.sensor]))


def _recorded(
    measured: Iterable[tuple[Task, list[Message]]], play: Play, progress: Progress
) -> Iterator[tuple[int, Message]]:
    """Every message with its record time, in the order in which they are recorded."""
    waiting: list[tuple[int, int, Message]] = []
    sequence = 0
    for task, messages in measured:
        # nothing that is still to be measured can be recorded before now
        while waiting and waiting[0][0] <= task.at_ns:
            due_ns, _, message = heapq.heappop(waiting)
            yield due_ns, message
        for message in messages:
            heapq.heappush(waiting, (task.log_ns, sequence, message))
            sequence += 1
        progress(int(100 * (task.at_ns - START_NS) / 1e9 / max(play.duration_s, 1e-9)))
    while waiting:
        due_ns, _, message = heapq.heappop(waiting)
        yield due_ns, message


def _write(file: McapWriter, messages: Iterable[tuple[int, Message]]) -> tuple[dict[str, int], dict[str, str]]:
    """Messages by topic, and by topic the sha256 of their bytes; not of pictures, which OpenGL has a part in."""
    counts: dict[str, int] = {}
    hashes: dict[str, Any] = {}
    for log_ns, message in messages:
        value = message.value
        type_name, data = (value.type_name, value.data) if isinstance(value, Serialized) else encode(value)
        file.write_cdr(message.topic, type_name, log_ns, data)
        counts[message.topic] = counts.get(message.topic, 0) + 1
        if not isinstance(value, CameraImage):
            hashes.setdefault(message.topic, hashlib.sha256()).update(data)
    return counts, {topic: sha.hexdigest() for topic, sha in hashes.items()}


def _write_static(file: McapWriter, play: Play) -> None:
    """What holds for the whole log: where the sensors are said to be, and what the oracle's numbers mean."""
    robot = play.robot
    transforms = tuple(
        Transform(START_NS, robot.base, name, T, is_static=True)
        for name, T in robot.frames.items()
        if name != robot.base
    )
    file.write("/tf_static", transforms, START_NS, is_latched=True)
    names = {"classes": list(play.world.class_names), "instances": list(play.scene.instance_names)}
    file.write("/oracle/names", json.dumps(names), START_NS, is_latched=True)


def recipe(request: LogRequest) -> dict[str, Any]:
    """Everything that decides what is in a log, as manifest.json has it."""
    import mujoco

    return {
        "schema": 1,
        "wallkit": wallkit.__version__,
        "mujoco": mujoco.__version__,
        "numpy": np.__version__,
        "seed": request.seed,
        "map": {"file": request.map_path.name, "sha256": sha256(request.map_path)},
        "robot": {"file": request.robot_path.name, "sha256": sha256(request.robot_path)},
        "scenario": table_from(replace(request.scenario, meshes=())),
        # where they lie decides nothing
        "meshes": [
            {**table_from(mesh), "file": Path(mesh.file).name, "sha256": sha256(Path(mesh.file))}
            for mesh in request.scenario.meshes
        ],
    }


def _manifest(request: LogRequest, play: Play, done: Simulated, hashes: dict[str, str]) -> dict[str, Any]:
    """manifest.json: from what the log was made, so that anyone makes it again and sees that it is the same."""
    return {
        **recipe(request),
        "duration_s": done.duration_s,
        "path_m": done.path_m,
        "people": done.people,
        "unmapped_share": round(done.unmapped_share, 4),
        "messages": done.messages,
        "sha256": hashes,
        "dropped": done.dropped,
        "classes": list(play.world.class_names),
        "cameras": {name: _unit_truth(unit) for name, unit in play.units.items()},
    }


def _unit_truth(unit: Unit) -> dict[str, Any]:
    """What a camera is, beside what it says it is."""
    return {
        "frame": unit.frame,
        "model": unit.true.model,
        "size": [unit.true.width, unit.true.height],
        "K": unit.true.K.tolist(),
        "D": unit.true.D.tolist(),
        "T_base_optical": unit.T_base_true.tolist(),
        "published": {
            "K": unit.published.K.tolist(),
            "D": unit.published.D.tolist(),
            "T_base_optical": unit.T_base_published.tolist(),
        },
    }


def _generators(seed: int) -> dict[str, np.random.Generator]:
    """One generator for everything that draws, made of its name: another sensor leaves what the others draw alone.

    Raises:
        SimulationError: the seed is negative.
    """
    if seed < 0:
        raise SimulationError(f"seed {seed} is negative", hint="use 0 or more")
    names = ("route", "people", "lidar", "odometry", "truth")
    return {name: np.random.default_rng([seed, zlib.crc32(name.encode())]) for name in names}
