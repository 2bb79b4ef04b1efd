"""A robot with a LiDAR and a camera among people, drawn without a renderer: every pixel's class is exact."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np

from tests.localize.worlds import FLAT, INSIDE
from tests.movers import tour
from tests.plan import cast, occupancy
from wallkit.calib.files.store import toml_from_calibration
from wallkit.core.calibration import Calibration, Provenance
from wallkit.core.camera import Camera
from wallkit.core.geometry import interpolate_poses
from wallkit.core.types import CameraImage, CameraInfo, Odometry, Scan, StampedPose, Transform
from wallkit.logs.writer import McapWriter
from wallkit.segment.fixture import USUAL

START_NS = 1_700_000_000_000_000_000
WAY = [(1.5, 1.5), (7.5, 1.5), (7.5, 3.5), (3.8, 3.8)]
# they stand before the walls that the robot looks at
PEOPLE = np.array([[4.0, 0.6, 0.25], [5.5, 2.4, 0.25], [8.3, 2.2, 0.25], [6.0, 4.2, 0.25], [3.0, 2.8, 0.25]])
WIDTH, HEIGHT, FOCAL = 320, 240, 150.0
CAMERA_Z, LIDAR_Z, TALL = 0.8, 0.3, {"wall": 2.5, "person": 1.75}
CLASSES = ("wall", "person", "floor")
T_CAMERA_LIDAR = np.array([[0.0, -1, 0, 0], [0, 0, -1, CAMERA_Z - LIDAR_Z], [1, 0, 0, 0], [0, 0, 0, 1]])
K = np.array([[FOCAL, 0, WIDTH / 2 - 0.5], [0, FOCAL, HEIGHT / 2 - 0.5], [0, 0, 1]])


def calibration(**changes) -> Calibration:
    camera = Camera("plumb_bob", WIDTH, HEIGHT, K, np.zeros(5), "front", "camera_front")
    given = {"lidar_frame": "laser", "verdict": "PASS", "time_offset_sigma_ns": 1e6,
             "pixel_error_95": np.array([[1.0, 2.0], [8.0, 1.0]])}  # fmt: skip
    return Calibration(camera, T_CAMERA_LIDAR, **(given | changes))


def failed() -> Calibration:
    return calibration(verdict="FAIL", provenance=Provenance(notes=("verify: FAIL: plane: 73 mm off",)))


def write_calibration(path: Path, made: Calibration | None = None) -> Path:
    path.write_text(toml_from_calibration(made or calibration()))
    return path


def classes_seen(pose) -> np.ndarray:
    """(H, W) place in CLASSES of what a level camera sees from a planar pose; 255 above the walls."""
    across = np.arctan2((WIDTH / 2 - 0.5) - np.arange(WIDTH), FOCAL)
    slope = (HEIGHT / 2 - 0.5 - np.arange(HEIGHT))[:, None] / FOCAL
    ids = np.full((HEIGHT, WIDTH), 255, np.uint8)
    ids[np.broadcast_to(slope < 0, ids.shape)] = CLASSES.index("floor")
    nobody = np.zeros((0, 3))
    for name, discs in (("wall", nobody), ("person", PEOPLE)):
        ranges = cast(FLAT, discs, pose[:2], pose[2] + across, 30.0)
        if name == "person":
            ranges = np.where(ranges < cast(FLAT, nobody, pose[:2], pose[2] + across, 30.0), ranges, np.inf)
        z = CAMERA_Z + slope * (ranges * np.cos(across))[None]
        ids[(z > 0) & (z < TALL[name]) & np.isfinite(ranges)[None]] = CLASSES.index(name)
    return ids


def picture(ids: np.ndarray) -> bytes:
    """A PNG in the colours of the colour oracle; floor and sky in grey."""
    rgb = np.full((*ids.shape, 3), (90, 110, 100), np.uint8)
    for number, name in enumerate(CLASSES[:2]):
        rgb[ids == number] = USUAL[name]
    return png(rgb[..., ::-1])


def png(pixels: np.ndarray) -> bytes:
    return bytes(cv2.imencode(".png", pixels)[1])


def write_log(path: Path, *, seconds=12.0, oracle=True, images=True, info_size=(WIDTH, HEIGHT), image_shift_ms=0,
              only_floor=False, damaged=0) -> Path:  # fmt: skip
    """10 Hz of scans, images 30 ms later, odometry at 50 Hz, the map and the truth in one log; so many images damaged."""
    rng = np.random.default_rng(0)
    poses = tour(WAY, 100.0)
    stamps = START_NS + (np.arange(len(poses)) * 10_000_000)
    end = min(stamps[-1] - 200_000_000, START_NS + round(seconds * 1e9))
    mount = np.eye(4)
    mount[2, 3] = LIDAR_Z
    messages = []
    for k in range(0, len(poses), 2):
        messages.append((stamps[k], "/odom", Odometry(int(stamps[k]), poses[k])))
        messages.append((stamps[k], "/ground_truth/pose", StampedPose(int(stamps[k]), "map", poses[k])))
    bearings = np.linspace(-2.2, 2.2, 540)
    for at in range(START_NS, int(end), 100_000_000):
        pose = interpolate_poses(stamps, poses, [at])[0]
        ranges = cast(FLAT, PEOPLE, pose[:2], pose[2] + bearings, 15.0) + rng.normal(0, 0.01, len(bearings))
        scan = Scan(at, "laser", ranges.astype(np.float32), bearings.astype(np.float32), 0.0, 0.05, 15.0)
        messages.append((at, "/scan", scan))
        then = at + 30_000_000
        ids = classes_seen(interpolate_poses(stamps, poses, [then])[0])
        if only_floor:
            ids[:] = CLASSES.index("floor")
        stamp = then + image_shift_ms * 1_000_000
        if images:
            is_damaged = then < START_NS + damaged * 100_000_000
            image = CameraImage(stamp, "camera_front", "png", picture(ids)[: 40 if is_damaged else None])
            messages.append((then, "/camera/front/image/compressed", image))
            P = np.hstack([K, np.zeros((3, 1))])
            info = CameraInfo(stamp, "camera_front", *info_size, "plumb_bob", np.zeros(5), K, np.eye(3), P)
            messages.append((then, "/camera/front/camera_info", info))
        if oracle:
            messages.append((then, "/oracle/front/classes", CameraImage(stamp, "camera_front", "png", png(ids))))
    with McapWriter(path) as file:
        static = Transform(START_NS, "base_link", "laser", mount, is_static=True)
        file.write("/tf_static", (static,), START_NS, is_latched=True)
        file.write("/map", occupancy(FLAT, 0.05, inside=INSIDE), START_NS, is_latched=True)
        if oracle:
            file.write("/oracle/names", json.dumps({"classes": CLASSES}), START_NS, is_latched=True)
        for at, topic, value in sorted(messages, key=lambda m: m[0]):
            file.write(topic, value, int(at))
    return path
