"""Ceilings drawn for tests, and photographs of them: every pixel's ray followed to the ceiling, the other way round than
`CeilingEye` goes."""

from __future__ import annotations

import numpy as np

from wallkit.core.camera import Camera
from wallkit.core.ceiling import CeilingMap
from wallkit.core.ceiling_eye import CeilingEye
from wallkit.core.geometry import matrix_from_pose

HEIGHT_M = 2.7
K = np.array([[104.0, 0, 79.5], [0, 104.0, 59.5], [0, 0, 1]])
CAMERA = Camera("plumb_bob", 160, 120, K, np.zeros(5), frame="camera_up")
# the optical frame of a camera that looks up: x to the robot's right, y forward, z up, as in the simulator's robot
UP = np.array([[0.0, 1, 0, 0.1], [-1, 0, 0, -0.05], [0, 0, 1, 1.0], [0, 0, 0, 1]])


def painted(seed: int = 0, size_m: tuple[float, float] = (8.0, 6.0), *, origin=(-1.0, 2.0, 0.0)) -> CeilingMap:
    """Smooth colours with discs, no two places alike."""
    import cv2

    rng = np.random.default_rng(seed)
    width, height = (round(side / 0.02) for side in size_m)
    coarse = rng.uniform(70, 230, (height // 40 + 2, width // 40 + 2, 3)).astype(np.float32)
    pixels = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC).clip(0, 255).astype(np.uint8)
    for _ in range(60):
        at, colour = rng.integers(0, (width, height)).tolist(), rng.integers(0, 255, 3).tolist()
        cv2.circle(pixels, at, int(rng.integers(4, 14)), colour, -1)
    return CeilingMap(pixels, np.ones((height, width), bool), 0.02, np.array(origin), HEIGHT_M, "painted")


def photograph(
    ceiling: CeilingMap, pose, *, camera: Camera = CAMERA, T_base_optical=UP, gain: float = 1.0
) -> np.ndarray:
    """(H, W, 3) RGB of a camera on a robot at a pose (3,); what lies beyond the ceiling's picture is black."""
    v, u = np.mgrid[: camera.height, : camera.width]
    rays = camera.unproject(np.stack([u, v], axis=-1).reshape(-1, 2))
    T = matrix_from_pose(pose) @ T_base_optical
    across = rays @ T[:3, :3].T
    points = T[:3, 3] + across * ((HEIGHT_M - T[2, 3]) / across[:, 2])[:, None]
    cells, seen = ceiling.cells_at(points[:, :2])
    colours = ceiling.pixels[cells[:, 0], cells[:, 1]] * seen[:, None] * gain
    return colours.reshape(camera.height, camera.width, 3).clip(0, 255).astype(np.uint8)


def eye(**settings) -> CeilingEye:
    return CeilingEye(CAMERA, UP, HEIGHT_M, **settings)


def drive(n: int, *, start=(1.5, 4.0, 0.3), step_m: float = 0.1, radius_m: float = 1.2) -> np.ndarray:
    """(n, 3) poses along a circle."""
    yaw = start[2] + np.arange(n) * step_m / radius_m
    x = start[0] + radius_m * (np.sin(yaw) - np.sin(start[2]))
    y = start[1] - radius_m * (np.cos(yaw) - np.cos(start[2]))
    return np.column_stack([x, y, (yaw + np.pi) % (2 * np.pi) - np.pi])
