"""The sample inside the package: a restroom off a corridor, people about, made by `python -m wallkit.pipelines.sample`."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from wallkit.core.geometry import interpolate_poses, matrix_from_pose
from wallkit.core.types import Float64Array, Int64Array, OccupancyGrid, Odometry, StampedPose, Trajectory, Transform
from wallkit.evaluate.tum import write_tum
from wallkit.logs.writer import McapWriter
from wallkit.simulate.drive import OdometryNoise, follow, odometry_from
from wallkit.simulate.lidar import Lidar, sweep
from wallkit.simulate.people import legs, walk
from wallkit.simulate.plan import Plan, occupancy, plan_from_polylines

SEED = 20
START_NS = 1_700_000_000_000_000_000
ODOMETRY_HZ = 20.0

# metres; the corridor runs along x, the restroom lies above it behind two doorways
WALLS: tuple[list[tuple[float, float]], ...] = (
    [(0, 0), (14, 0), (14, 2.4), (9.4, 2.4)],
    [(8.4, 2.4), (3.6, 2.4)],
    [(2.6, 2.4), (0, 2.4), (0, 0)],
    [(2.0, 2.4), (2.0, 8.0), (10.5, 8.0), (10.5, 2.4)],
    [(6.2, 2.4), (6.2, 4.6)],
    # cubicles along the upper wall
    [(3.6, 8.0), (3.6, 6.5)],
    [(5.0, 8.0), (5.0, 6.5)],
    [(6.4, 8.0), (6.4, 6.5)],
    [(7.8, 8.0), (7.8, 6.5)],
    # basins on the right, a column in the corridor
    [(10.5, 4.0), (10.0, 4.0), (10.0, 6.2), (10.5, 6.2)],
    [(11.6, 1.9), (12.0, 1.9), (12.0, 2.4)],
    [(11.6, 1.9), (11.6, 2.4)],
)
ROUTE = [(1.2, 1.2), (3.1, 1.2), (3.1, 4.8), (7.4, 5.6), (9.0, 4.9), (8.9, 1.3), (12.8, 1.0)]
PEOPLE = (
    ([(1.5, 0.6), (13.0, 0.7), (13.0, 1.6), (1.5, 1.7)], 1.1, 0.0),
    ([(12.5, 1.4), (4.0, 1.3), (3.2, 2.0), (12.0, 0.8)], 0.9, 6.0),
    ([(2.7, 5.8), (9.4, 5.8), (9.4, 3.2), (7.0, 3.3), (7.0, 5.0)], 0.7, 3.0),
    ([(4.3, 7.2), (4.3, 5.6), (9.0, 5.2), (5.6, 5.4)], 0.6, 1.0),
    ([(9.2, 3.0), (9.0, 5.8), (2.8, 5.6), (2.8, 3.2)], 0.8, 9.0),
    ([(5.8, 6.2), (3.0, 6.1), (3.0, 4.0), (5.4, 4.2)], 0.5, 2.0),
)


def write_sample(folder: Path) -> None:
    """map.yaml, map.pgm, log.mcap and truth.tum."""
    folder.mkdir(parents=True, exist_ok=True)
    plan = plan_from_polylines(*WALLS)
    _write_map(folder, occupancy(plan, 0.05, inside=np.array(ROUTE[0])))
    rng = np.random.default_rng(np.random.SeedSequence(SEED))
    poses = follow(ROUTE, ODOMETRY_HZ)
    stamps_ns = START_NS + np.arange(len(poses), dtype=np.int64) * round(1e9 / ODOMETRY_HZ)
    odometry = odometry_from(rng, poses, OdometryNoise())
    write_tum(folder / "truth.tum", Trajectory(stamps_ns, poses))
    _write_log(rng, folder / "log.mcap", plan, stamps_ns, poses, odometry)


def _write_log(
    rng: np.random.Generator,
    path: Path,
    plan: Plan,
    stamps_ns: Int64Array,
    poses: Float64Array,
    odometry: Float64Array,
) -> None:
    lidar = Lidar()
    times_s = (stamps_ns - START_NS) / 1e9
    walkers = [walk(way, speed, times_s, start) for way, speed, start in PEOPLE]
    speeds = np.array([speed for _, speed, _ in PEOPLE])

    def discs_at(at_ns: int) -> Float64Array:
        now = np.stack([interpolate_poses(stamps_ns, walker, [at_ns])[0] for walker in walkers])
        return legs(now, speeds * (at_ns - START_NS) / 1e9)

    with McapWriter(path) as file:
        mount = Transform(
            START_NS, "base_link", lidar.frame_id, matrix_from_pose(np.array(lidar.mount)), is_static=True
        )
        file.write("/tf_static", (mount,), START_NS, is_latched=True)
        every = round(ODOMETRY_HZ / lidar.rate_hz)
        for i, stamp_ns in enumerate(stamps_ns.tolist()):
            file.write("/odom", Odometry(stamp_ns, odometry[i]), stamp_ns)
            file.write("/ground_truth/pose", StampedPose(stamp_ns, "map", poses[i]), stamp_ns)
            if i % every == 0 and i + every < len(stamps_ns):
                file.write("/scan", sweep(rng, lidar, plan, stamps_ns, poses, stamp_ns, discs_at), stamp_ns)


def _write_map(folder: Path, grid: OccupancyGrid) -> None:
    import cv2

    shades = np.where(grid.cells < 0, 205, np.where(grid.cells > 50, 0, 254)).astype(np.uint8)
    cv2.imwrite(str(folder / "map.pgm"), shades[::-1])
    x, y, yaw = grid.origin
    (folder / "map.yaml").write_text(
        "image: map.pgm\nmode: trinary\n"
        f"resolution: {grid.resolution_m:g}\norigin: [{x:.3f}, {y:.3f}, {yaw:g}]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n",
        encoding="utf-8",
    )


if __name__ == "__main__":
    write_sample(Path(sys.argv[1]))
