"""A play and its scenario -> the robot's sensors: what each of them publishes of a moment, and when."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from wallkit.core.geometry import interpolate_poses, matrix_from_pose
from wallkit.core.types import Float64Array, Odometry, StampedPose, Transform
from wallkit.logs.encode import cloud_message
from wallkit.pipelines.simulate.camera import CameraSensor
from wallkit.pipelines.simulate.play import START_NS, Message, Play, Sensor, Serialized
from wallkit.pipelines.simulate.truth import Met, met
from wallkit.simulate.odometry import odometry_of
from wallkit.simulate.scanner import Sweep, sweep
from wallkit.simulate.scenario import LidarSetup, OdometrySetup, Timing
from wallkit.simulate.scene import Scene
from wallkit.simulate.timing import Schedule, schedule

_TRUTH_MESSAGES_HZ = 50.0


def sensors_of(play: Play) -> dict[str, Sensor]:
    """The sensors of the scenario by name."""
    scenario = play.scenario
    cameras = {
        f"camera {setup.name}": CameraSensor(
            play, setup, _schedule(play, f"camera {setup.name}", setup.timing, setup.rate_hz)
        )
        for setup in scenario.cameras
    }
    return {
        "truth": TruthSensor(play, _schedule(play, "truth", Timing(), _TRUTH_MESSAGES_HZ)),
        "odometry": OdometrySensor(
            play,
            scenario.odometry,
            _schedule(play, "odometry", scenario.odometry.timing, scenario.odometry.rate_hz),
        ),
        "lidar": LidarSensor(
            play, scenario.lidar, _schedule(play, "lidar", scenario.lidar.timing, scenario.lidar.scanner.rate_hz)
        ),
        **cameras,
    }


def _schedule(play: Play, name: str, timing: Timing, rate_hz: float) -> Schedule:
    rng = play.rngs.get(name) or np.random.default_rng([play.seed, zlib.crc32(name.encode())])
    return schedule(rng, timing, rate_hz, play.duration_s)


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
    """A planar LiDAR: /scan, and on /oracle/scan_points where each return truly came from; `seen` counts them."""

    play: Play
    setup: LidarSetup
    schedule: Schedule
    seen: list[Met] = field(default_factory=list)

    @property
    def frame(self) -> str:
        return self.play.robot.lidar_frame(self.setup.frame)

    def measure(self, at_ns: int, stamp_ns: int) -> Iterator[Message]:
        done = self.sweep(at_ns, stamp_ns)
        self.seen.append(met(self.play, done, at_ns))
        yield Message("/scan", done.scan)
        yield Message("/oracle/scan_points", _oracle(self.play.scene, done))

    def sweep(self, at_ns: int, stamp_ns: int) -> Sweep:
        """One sweep that truly begins at a moment and says another."""
        T_base_lidar = self.play.robot.frames[self.frame] @ leaning(self.setup.roll_rad, self.setup.pitch_rad)

        def place_of_lidar(now_ns: int) -> Float64Array:
            return np.asarray(matrix_from_pose(self.play.pose_at(now_ns)) @ T_base_lidar)

        done = sweep(
            self.play.rngs["lidar"],
            self.setup.scanner,
            self.play.scene,
            at_ns,
            place_of_lidar,
            place_at=self.play.place,
            frame_id=self.frame,
        )
        return replace(done, scan=replace(done.scan, stamp_ns=stamp_ns))


def leaning(roll_rad: float, pitch_rad: float) -> Float64Array:
    """(4, 4) of a LiDAR that leans to its left and looks down."""
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
