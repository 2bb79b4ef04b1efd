"""Logs of a robot below a painted ceiling in a corridor that looks the same from both ends, drawn without a renderer."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tests.localize.ceilings import CAMERA, UP, painted, photograph
from tests.movers import NOISE, tour
from tests.plan import instant_scan, occupancy, plan_from_polylines
from wallkit.core.ceiling import CeilingMap
from wallkit.core.geometry import compose, interpolate_poses, matrix_from_pose
from wallkit.core.types import CameraImage, CameraInfo, Odometry, StampedPose, Trajectory, Transform
from wallkit.evaluate.tum import write_tum
from wallkit.logs.writer import McapWriter
from wallkit.maps.ceiling.files import ceiling_files
from wallkit.simulate.odometry import WheelOdometry, odometry_of

START_NS = 1_700_000_000_000_000_000
ODOMETRY_HZ, IMAGE_EVERY, SCAN_EVERY = 20.0, 4, 3
SIZE_M = (14.0, 2.4)
# of the LiDAR on the robot
MOUNT = np.array([0.2, 0.0, 0.0])
# niches at the same places seen from either end
WALLS = [(0, 0), (3, 0), (3, -0.5), (4, -0.5), (4, 0), (14, 0), (14, 2.4), (11, 2.4), (11, 2.9), (10, 2.9), (10, 2.4)]
ROUTE = [(2.0, 1.1), (6.0, 1.5), (11.0, 0.9), (12.5, 1.3), (8.0, 1.4), (3.0, 1.0)]


def corridor_ceiling() -> CeilingMap:
    """With boxes of many sizes, so that features are found in it."""
    import cv2

    ceiling, rng = painted(3, (15.0, 4.4), origin=(-0.5, -1.0, 0.0)), np.random.default_rng(4)
    for _ in range(500):
        x, y = rng.integers(0, ceiling.shape[::-1]).tolist()
        w, h = rng.integers(3, 22, 2).tolist()
        cv2.rectangle(ceiling.pixels, (x, y), (x + w, y + h), rng.integers(0, 255, 3).tolist(), -1)
    return ceiling


def write_ceiling(folder: Path, ceiling: CeilingMap, name: str = "ceiling") -> Path:
    text, png = ceiling_files(ceiling, f"{name}.png")
    (folder / f"{name}.yaml").write_bytes(text)
    (folder / f"{name}.png").write_bytes(png)
    return folder / f"{name}.yaml"


def write_log(
    folder: Path, *, with_lidar: bool = True, noise: WheelOdometry = NOISE, grey: bool = False, seed: int = 5
) -> CeilingMap:
    """log.mcap, truth.tum, ceiling.yaml and map.yaml; the ceiling that was drawn."""
    import cv2

    rng = np.random.default_rng(seed)
    ceiling = corridor_ceiling()
    write_ceiling(folder, ceiling)
    plan = plan_from_polylines([*WALLS, (0, 2.4), (0, 0)])
    poses = tour(ROUTE, ODOMETRY_HZ)
    stamps = START_NS + np.arange(len(poses), dtype=np.int64) * round(1e9 / ODOMETRY_HZ)
    odometry = odometry_of(rng, noise, poses, ODOMETRY_HZ)
    write_tum(folder / "truth.tum", Trajectory(stamps, poses))
    _write_map(folder, occupancy(plan, 0.05, inside=np.array(ROUTE[0])))
    info = CameraInfo(
        START_NS,
        CAMERA.frame,
        160,
        120,
        "plumb_bob",
        CAMERA.D,
        CAMERA.K,
        np.eye(3),
        np.hstack([CAMERA.K, np.zeros((3, 1))]),
    )
    with McapWriter(folder / "log.mcap") as file:
        mounts = [Transform(START_NS, "base_link", CAMERA.frame, UP, is_static=True)]
        if with_lidar:
            mounts.append(Transform(START_NS, "base_link", "laser", matrix_from_pose(MOUNT), is_static=True))
        file.write("/tf_static", tuple(mounts), START_NS, is_latched=True)
        file.write("/camera/up/camera_info", info, START_NS)
        for i, stamp in enumerate(stamps.tolist()):
            file.write("/odom", Odometry(stamp, odometry[i]), stamp)
            file.write("/ground_truth/pose", StampedPose(stamp, "map", poses[i]), stamp)
            if with_lidar and i % SCAN_EVERY == 0 and i + SCAN_EVERY < len(stamps):
                file.write("/scan", instant_scan(rng, plan, compose(poses[i], MOUNT), stamp), stamp)
            if i % IMAGE_EVERY == 1:
                # between two messages of the odometry
                at = stamp + 17_000_000
                picture = photograph(ceiling, interpolate_poses(stamps, poses, [at])[0])
                picture = (
                    np.repeat(picture.mean(axis=2, keepdims=True), 3, axis=2).astype(np.uint8) if grey else picture
                )
                _, jpeg = cv2.imencode(".jpg", picture[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 92])
                file.write("/camera/up/image/compressed", CameraImage(at, CAMERA.frame, "jpeg", bytes(jpeg)), stamp)
    return ceiling


def _write_map(folder: Path, grid) -> None:
    import cv2

    shades = np.where(grid.cells < 0, 205, np.where(grid.cells > 50, 0, 254)).astype(np.uint8)
    cv2.imwrite(str(folder / "map.pgm"), shades[::-1])
    x, y, yaw = grid.origin
    (folder / "map.yaml").write_text(
        f"image: map.pgm\nresolution: {grid.resolution_m:g}\norigin: [{x:.3f}, {y:.3f}, {yaw:g}]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
