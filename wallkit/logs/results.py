"""What a localization run says, step by step -> one MCAP with standard ROS 2 messages.

Foxglove, rerun, evo, rosbags and `ros2 bag play` open it. Record time is the header stamp throughout.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType

import numpy as np

from wallkit.core.geometry import matrix_from_pose
from wallkit.core.types import (
    Estimate,
    Float32Array,
    Float64Array,
    Health,
    OccupancyGrid,
    Odometry,
    StampedPose,
    Trajectory,
    Transform,
)
from wallkit.logs.annotations import SCHEMA, TYPE, Drawn, annotations_message
from wallkit.logs.cdr_write import CdrBuilder, planar_numbers
from wallkit.logs.encode import cloud_message
from wallkit.logs.writer import McapWriter

MAP, ODOM, BASE = "map", "odom", "base_link"
# diagnostic_msgs/DiagnosticStatus: OK, WARN, ERROR
_LEVELS = {Health.LOCALIZED: 0, Health.UNCERTAIN: 1, Health.LOST: 2}


class ResultWriter:
    """The result of one run being written; use it in a `with` block. See `writer.McapWriter` for what a failure leaves.

    Args:
        path: the file to make.
        odom, base: names of the frames in the robot's log, to be found again in the transforms.
    """

    def __init__(self, path: Path, *, odom: str = ODOM, base: str = BASE) -> None:
        # particles are most of the bytes and hardly compress: the fast one
        self._file = McapWriter(path, compression="lz4")
        self._odom, self._base = odom or ODOM, base or BASE

    def __enter__(self) -> ResultWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.__exit__(kind, error, trace)

    def pose(self, estimate: Estimate) -> None:
        """/wallkit/pose: the estimate with its covariance."""
        pose = StampedPose(estimate.stamp_ns, MAP, estimate.pose, estimate.covariance)
        self._file.write("/wallkit/pose", pose, estimate.stamp_ns)

    def odometry(self, stamp_ns: int, pose: Float64Array) -> None:
        """/wallkit/odometry: T_odom_base (3,) as it was used."""
        self._file.write("/wallkit/odometry", Odometry(stamp_ns, pose, self._odom, self._base), stamp_ns)

    def transforms(self, stamp_ns: int, map_odom: Float64Array, odom_base: Float64Array) -> None:
        """/tf: T_map_odom (3,), the localizer's correction, and T_odom_base (3,), the robot's own."""
        links = ((MAP, self._odom, map_odom), (self._odom, self._base, odom_base))
        both = tuple(Transform(stamp_ns, parent, child, matrix_from_pose(pose)) for parent, child, pose in links)
        self._file.write("/tf", both, stamp_ns)

    def path(self, stamp_ns: int, trajectory: Trajectory) -> None:
        """/wallkit/path: the way so far, or a thinned one."""
        self._file.write_cdr("/wallkit/path", "nav_msgs/msg/Path", stamp_ns, _path(stamp_ns, trajectory))

    def particles(self, stamp_ns: int, poses: Float64Array, weights: Float64Array) -> None:
        """/wallkit/particles: (N, 3) as arrows; /wallkit/particles/cloud: the same with the (N,) weights to colour by."""
        message = CdrBuilder().header(stamp_ns, MAP)
        message.sequence(planar_numbers(poses), 8, count=len(poses))
        self._file.write_cdr("/wallkit/particles", "geometry_msgs/msg/PoseArray", stamp_ns, message.done())
        x, y = poses[:, 0], poses[:, 1]
        columns = {"x": x, "y": y, "z": np.zeros(len(poses)), "weight": weights}
        cloud = cloud_message(stamp_ns, MAP, columns)
        self._file.write_cdr("/wallkit/particles/cloud", "sensor_msgs/msg/PointCloud2", stamp_ns, cloud)

    def points(self, stamp_ns: int, name: str, xyz_m: Float32Array, weights: Float32Array) -> None:
        """/wallkit/scan/NAME (kept, rejected, unknown): returns (K, 3) in frame base with their weights (K,)."""
        columns = {"x": xyz_m[:, 0], "y": xyz_m[:, 1], "z": xyz_m[:, 2], "weight": weights}
        cloud = cloud_message(stamp_ns, self._base, columns)
        self._file.write_cdr(f"/wallkit/scan/{name}", "sensor_msgs/msg/PointCloud2", stamp_ns, cloud)

    def filtered(self, stamp_ns: int, name: str, xyz_m: Float32Array, weights: Float32Array) -> None:
        """/wallkit/filter/NAME (kept, rejected): what the point filters made of the returns (K, 3), in frame base."""
        columns = {"x": xyz_m[:, 0], "y": xyz_m[:, 1], "z": xyz_m[:, 2], "weight": weights}
        cloud = cloud_message(stamp_ns, self._base, columns)
        self._file.write_cdr(f"/wallkit/filter/{name}", "sensor_msgs/msg/PointCloud2", stamp_ns, cloud)

    def annotations(self, stamp_ns: int, camera: str, things: Sequence[Drawn]) -> None:
        """/wallkit/camera/NAME/annotations: masks and returns, to be laid over the image of that stamp."""
        message = annotations_message(stamp_ns, things)
        self._file.write_cdr(f"/wallkit/camera/{camera}/annotations", TYPE, stamp_ns, message, schema=SCHEMA)

    def grid(self, stamp_ns: int, grid: OccupancyGrid) -> None:
        """/wallkit/map: the map, once, at the first stamp."""
        framed = OccupancyGrid(grid.cells, grid.resolution_m, grid.origin, grid.source, stamp_ns, MAP)
        self._file.write("/wallkit/map", framed, stamp_ns, is_latched=True)

    def health(self, stamp_ns: int, health: Health, reason: str, numbers: Mapping[str, float]) -> None:
        """/wallkit/health: state, reason and numbers for a diagnostics panel; /wallkit/health/NAME: each to plot."""
        status = CdrBuilder().header(stamp_ns, MAP).values("I", 1).values("B", _LEVELS[health])
        status.text("wallkit: localization").text(f"{health.name}: {reason}" if reason else health.name).text("wallkit")
        status.values("I", len(numbers))
        for name, number in numbers.items():
            status.text(name).text(f"{number:.6g}")
        self._file.write_cdr("/wallkit/health", "diagnostic_msgs/msg/DiagnosticArray", stamp_ns, status.done())
        for name, number in {"state": float(health), **numbers}.items():
            self._number(f"/wallkit/health/{name}", stamp_ns, number)

    def error(self, stamp_ns: int, position_m: float, heading_rad: float) -> None:
        """/wallkit/error/position_m and heading_rad: distance from the truth, to plot."""
        self._number("/wallkit/error/position_m", stamp_ns, position_m)
        self._number("/wallkit/error/heading_rad", stamp_ns, heading_rad)

    def truth(self, stamp_ns: int, pose: Float64Array) -> None:
        """/ground_truth/pose: T_map_base (3,)."""
        self._file.write("/ground_truth/pose", StampedPose(stamp_ns, MAP, pose), stamp_ns)

    def metadata(self, entries: Mapping[str, str], name: str = "wallkit") -> None:
        """A record about the run: version, settings, hashes."""
        self._file.write_metadata(name, entries)

    def _number(self, topic: str, stamp_ns: int, number: float) -> None:
        self._file.write_cdr(topic, "std_msgs/msg/Float64", stamp_ns, CdrBuilder().values("d", number).done())


def _path(stamp_ns: int, trajectory: Trajectory) -> bytes:
    """A nav_msgs/Path; every pose but the first lies on the same grid of bytes, so they are written as one table."""
    message = CdrBuilder().header(stamp_ns, MAP).values("I", len(trajectory))
    if not len(trajectory):
        return message.done()
    numbers = planar_numbers(trajectory.poses)
    message.header(int(trajectory.stamps_ns[0]), MAP).block(numbers[0], 8)
    # stamp (8 bytes), length and text of the frame (4 + 4 with its zero), seven doubles: a multiple of 8
    row = np.dtype(
        [("sec", "<i4"), ("nsec", "<u4"), ("length", "<u4"), ("frame", f"S{len(MAP) + 1}"), ("pose", "<f8", 7)]
    )
    table = np.zeros(len(trajectory) - 1, dtype=row)
    table["sec"], table["nsec"] = np.divmod(trajectory.stamps_ns[1:], 1_000_000_000)
    table["length"], table["frame"], table["pose"] = len(MAP) + 1, MAP.encode(), numbers[1:]
    return message.block(table, 8).done()
