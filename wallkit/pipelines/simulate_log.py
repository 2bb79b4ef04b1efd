"""Map, robot, scenario and seed -> a recorded log with exact truth. Read `simulate_log` from top to bottom."""

from __future__ import annotations

import heapq
import json
import zlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np

import wallkit
from wallkit.core.config import table_from
from wallkit.core.geometry import interpolate_poses, matrix_from_pose
from wallkit.core.types import Float64Array, Int64Array, Odometry, StampedPose, Trajectory, Transform
from wallkit.errors import SimulationError
from wallkit.evaluate.tum import write_tum
from wallkit.logs.encode import cloud_message
from wallkit.logs.message import Value
from wallkit.logs.writer import McapWriter
from wallkit.maps.read import load_map
from wallkit.pipelines.outputs import result_folder
from wallkit.pipelines.run_folder import sha256, write_json
from wallkit.pipelines.simulate_world import world_from_map
from wallkit.simulate.crowd import STEP_S, People, people_from
from wallkit.simulate.floor import floor_of
from wallkit.simulate.odometry import odometry_of
from wallkit.simulate.robot import DEFAULT_ROBOT, Robot, robot_from_urdf
from wallkit.simulate.route import drive
from wallkit.simulate.scanner import Sweep, sweep
from wallkit.simulate.scenario import LidarSetup, OdometrySetup, Scenario, Timing
from wallkit.simulate.scene import NOTHING, Scene
from wallkit.simulate.stage import StatesAt, door_states, populated, staged
from wallkit.simulate.timing import Schedule, schedule
from wallkit.simulate.world import World

START_NS = 1_700_000_000_000_000_000
_TRUTH_HZ = 100.0
Progress = Callable[[int], None]


@dataclass(frozen=True)
class LogRequest:
    """What to simulate: one log of one scenario in one map."""

    map_path: Path
    scenario: Scenario
    robot_path: Path = DEFAULT_ROBOT
    seed: int = 0


@dataclass(frozen=True, eq=False)
class Play:
    """Everything that is decided before the first measurement.

    Attributes:
        stamps_ns, poses: (T,), (T, 3) where the robot truly is, T_map_base, at 100 Hz from START_NS on.
        rngs: a generator for each sensor, so that one more of them changes nothing in the others.
    """

    request: LogRequest
    robot: Robot
    world: World
    scene: Scene
    people: People
    states_at: StatesAt
    stamps_ns: Int64Array
    poses: Float64Array
    rngs: dict[str, np.random.Generator]

    @property
    def duration_s(self) -> float:
        return float(self.stamps_ns[-1] - self.stamps_ns[0]) / 1e9

    def place(self, at_ns: int) -> None:
        """Puts people and doors where they are at a moment."""
        time_s = (at_ns - START_NS) / 1e9
        self.scene.place({**self.world.poses(self.states_at(time_s)), **self.people.posed(time_s)})

    def pose_at(self, at_ns: int) -> Float64Array:
        """(3,) T_map_base."""
        return np.asarray(interpolate_poses(self.stamps_ns, self.poses, [at_ns])[0])


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


@dataclass(frozen=True)
class Simulated:
    """What was written: messages by topic, and those that timing faults lost by sensor."""

    duration_s: float
    messages: dict[str, int]
    dropped: dict[str, int]
    path_m: float
    people: int


def prepare(request: LogRequest) -> Play:
    """The world, the people and the robot's way.

    Raises:
        MapError, SimulationError: see world_from_map, staged, door_states, drive, people_from, robot_from_urdf.
    """
    scenario = request.scenario
    rngs = _generators(request.seed)
    robot = robot_from_urdf(request.robot_path)
    world = staged(world_from_map(load_map(request.map_path)), scenario)
    states_at = door_states(world, scenario)
    floor = floor_of(world, states_at(0.0))
    poses = drive(rngs["route"], scenario.route, floor, _TRUTH_HZ, duration_s=scenario.duration_s)
    stamps_ns = START_NS + np.round(np.arange(len(poses)) * 1e9 / _TRUTH_HZ).astype(np.int64)
    paces = poses[:: round(STEP_S * _TRUTH_HZ)]
    people = people_from(rngs["people"], scenario.crowd, floor_of(world, with_doors=False), paces)
    world = populated(world, people)
    return Play(request, robot, world, Scene(world), people, states_at, stamps_ns, poses, rngs)


def simulate_log(
    request: LogRequest, out: Path, *, overwrite: bool = False, progress: Progress = lambda _: None
) -> Simulated:
    """A folder with log.mcap, truth.tum, manifest.json and the map the robot is given.

    Args:
        progress: told how many hundredths of the log are done.

    Raises:
        OutputError: `out` cannot be written. Else as `prepare`.
    """
    with result_folder(out, overwrite=overwrite) as folder:
        play = prepare(request)
        sensors = sensors_of(play)
        with McapWriter(folder / "log.mcap") as file:
            _write_static(file, play, sensors)
            counts = _write(file, _measured(sensors, play, progress))
        write_tum(folder / "truth.tum", Trajectory(play.stamps_ns[::5], play.poses[::5]))
        (folder / "map.wkmap.urdf").write_bytes(request.map_path.read_bytes())
        steps = np.hypot(*np.diff(play.poses[:, :2], axis=0).T)
        dropped = {name: sensor.schedule.dropped for name, sensor in sensors.items()}
        done = Simulated(play.duration_s, counts, dropped, float(steps.sum()), len(play.people.agents))
        write_json(folder / "manifest.json", _manifest(play, done))
        # the mark by which --overwrite knows a folder of ours
        write_json(folder / "run.json", {"schema": 1, "command": "simulate log", "seed": request.seed})
    return done


def sensors_of(play: Play) -> dict[str, Sensor]:
    """The sensors of the scenario by name."""
    scenario = play.request.scenario
    return {
        "truth": TruthSensor(play, _schedule(play, "truth", Timing(), 50.0)),
        "odometry": OdometrySensor(
            play,
            scenario.odometry,
            _schedule(play, "odometry", scenario.odometry.timing, scenario.odometry.rate_hz),
        ),
        "lidar": LidarSensor(
            play, scenario.lidar, _schedule(play, "lidar", scenario.lidar.timing, scenario.lidar.scanner.rate_hz)
        ),
    }


def _schedule(play: Play, name: str, timing: Timing, rate_hz: float) -> Schedule:
    return schedule(play.rngs[name], timing, rate_hz, play.duration_s)


# -------------------------------------------------------------------------------------------- sensors


@dataclass(frozen=True, eq=False)
class TruthSensor:
    """The pose nobody has on a real robot: /ground_truth/pose, T_map_base."""

    play: Play
    schedule: Schedule

    def measure(self, at_ns: int, stamp_ns: int) -> Iterator[Message]:
        yield Message("/ground_truth/pose", StampedPose(stamp_ns, "map", self.play.pose_at(at_ns)))


@dataclass(frozen=True, eq=False)
class OdometrySensor:
    """Wheel odometry: /odom and the transform odom -> base on /tf."""

    play: Play
    setup: OdometrySetup
    schedule: Schedule
    _claimed: dict[int, Float64Array] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        # every tick counts, also those whose message is lost
        play, rate_hz = self.play, self.setup.rate_hz
        ticks = START_NS + np.round(np.arange(0, play.duration_s, 1 / rate_hz) * 1e9).astype(np.int64)
        claimed = odometry_of(
            play.rngs["odometry"], self.setup.wheels, interpolate_poses(play.stamps_ns, play.poses, ticks), rate_hz
        )
        at = interpolate_poses(ticks, claimed, START_NS + self.schedule.times_ns)
        self._claimed.update(zip((START_NS + self.schedule.times_ns).tolist(), at, strict=True))

    def measure(self, at_ns: int, stamp_ns: int) -> Iterator[Message]:
        pose, base = self._claimed[at_ns], self.play.robot.base
        yield Message("/odom", Odometry(stamp_ns, pose, child_frame_id=base))
        yield Message("/tf", (Transform(stamp_ns, "odom", base, matrix_from_pose(pose)),))


@dataclass(frozen=True, eq=False)
class LidarSensor:
    """A planar LiDAR: /scan, and on /oracle/scan_points where each return truly came from."""

    play: Play
    setup: LidarSetup
    schedule: Schedule

    @property
    def frame(self) -> str:
        return self.play.robot.lidar_frame(self.setup.frame)

    def measure(self, at_ns: int, stamp_ns: int) -> Iterator[Message]:
        done = self.sweep(at_ns, stamp_ns)
        yield Message("/scan", done.scan)
        yield Message("/oracle/scan_points", _oracle(self.play.scene, done))

    def sweep(self, at_ns: int, stamp_ns: int) -> Sweep:
        """One sweep that truly begins at a moment and says another."""
        T_base_lidar = self.play.robot.frames[self.frame] @ _leaning(self.setup.roll_rad, self.setup.pitch_rad)

        def T_map_lidar_at(now_ns: int) -> Float64Array:
            return np.asarray(matrix_from_pose(self.play.pose_at(now_ns)) @ T_base_lidar)

        done = sweep(
            self.play.rngs["lidar"],
            self.setup.scanner,
            self.play.scene,
            at_ns,
            T_map_lidar_at,
            place_at=self.play.place,
            frame_id=self.frame,
        )
        return replace(done, scan=replace(done.scan, stamp_ns=stamp_ns))


def _leaning(roll_rad: float, pitch_rad: float) -> Float64Array:
    from scipy.spatial.transform import Rotation

    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler("yx", [pitch_rad, -roll_rad]).as_matrix()
    return T


def _oracle(scene: Scene, done: Sweep) -> Serialized:
    """The returns as a cloud in the LiDAR's frame with the beam, class and thing of each; -1: of none."""
    scan = done.scan
    returned = np.isfinite(scan.ranges_m)
    ranges, bearings = scan.ranges_m[returned], scan.angles_rad[returned]
    solids = done.solids[returned]
    columns = {
        "x": ranges * np.cos(bearings),
        "y": ranges * np.sin(bearings),
        "z": np.zeros_like(ranges),
        "beam": np.flatnonzero(returned),
        "label": scene.labels(solids, scene.class_ids),
        "instance": scene.labels(solids, scene.instance_ids),
    }
    return Serialized("sensor_msgs/msg/PointCloud2", cloud_message(scan.stamp_ns, scan.frame_id, columns))


# -------------------------------------------------------------------------------------------- the log


def _measured(sensors: dict[str, Sensor], play: Play, progress: Progress) -> Iterator[tuple[int, Message]]:
    """Every message with its record time, in the order in which they are recorded."""
    plan = [
        (int(time_ns), number, int(stamp_ns), int(log_ns))
        for number, sensor in enumerate(sensors.values())
        for time_ns, stamp_ns, log_ns in zip(
            sensor.schedule.times_ns, sensor.schedule.stamps_ns, sensor.schedule.logs_ns, strict=True
        )
    ]
    waiting: list[tuple[int, int, Message]] = []
    by_number, sequence = list(sensors.values()), 0
    for time_ns, number, stamp_ns, log_ns in sorted(plan):
        # nothing that is still to be measured can be recorded before now
        while waiting and waiting[0][0] <= START_NS + time_ns:
            due_ns, _, message = heapq.heappop(waiting)
            yield due_ns, message
        for message in by_number[number].measure(START_NS + time_ns, START_NS + stamp_ns):
            heapq.heappush(waiting, (START_NS + log_ns, sequence, message))
            sequence += 1
        progress(int(100 * time_ns / 1e9 / max(play.duration_s, 1e-9)))
    while waiting:
        due_ns, _, message = heapq.heappop(waiting)
        yield due_ns, message


def _write(file: McapWriter, messages: Iterable[tuple[int, Message]]) -> dict[str, int]:
    counts: dict[str, int] = {}
    for log_ns, message in messages:
        if isinstance(message.value, Serialized):
            file.write_cdr(message.topic, message.value.type_name, log_ns, message.value.data)
        else:
            file.write(message.topic, message.value, log_ns)
        counts[message.topic] = counts.get(message.topic, 0) + 1
    return counts


def _write_static(file: McapWriter, play: Play, sensors: dict[str, Sensor]) -> None:
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


def _manifest(play: Play, done: Simulated) -> dict[str, Any]:
    """manifest.json: from what the log was made, so that anyone makes it again."""
    import mujoco

    request = play.request
    return {
        "schema": 1,
        "wallkit": wallkit.__version__,
        "mujoco": mujoco.__version__,
        "numpy": np.__version__,
        "seed": request.seed,
        "map": {"file": request.map_path.name, "sha256": sha256(request.map_path)},
        "robot": {"file": request.robot_path.name, "sha256": sha256(request.robot_path)},
        "scenario": table_from(request.scenario),
        "duration_s": done.duration_s,
        "path_m": done.path_m,
        "people": done.people,
        "messages": done.messages,
        "dropped": done.dropped,
        "classes": list(play.world.class_names),
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
