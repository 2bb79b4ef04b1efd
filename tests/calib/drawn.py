"""Views of a board as a known camera sees them: corners with known noise, and pictures drawn pixel by pixel."""

from __future__ import annotations

import cv2
import numpy as np

from wallkit.calib.boards import Board
from wallkit.calib.bundle import rotations
from wallkit.calib.sheet import sheet_of
from wallkit.calib.views import Capture, View
from wallkit.core.camera import Camera

K = np.array([[600.0, 0, 321.0], [0, 602.0, 238.0], [0, 0, 1]])
DISTORTIONS = {
    "plumb_bob": [-0.25, 0.08, 0.001, -0.0008, -0.01],
    "rational_polynomial": [0.4, -0.1, 0.001, -0.0008, 0.01, 0.7, -0.05, 0.02],
    "equidistant": [-0.04, 0.012, -0.008, 0.002],
}
BOARD = Board("chessboard", 9, 6, 0.03)


def camera(model: str = "plumb_bob") -> Camera:
    return Camera(model, 640, 480, K, np.array(DISTORTIONS[model]))


def board_poses(
    rng: np.random.Generator,
    count: int,
    board: Board = BOARD,
    *,
    cam: Camera | None = None,
    spread: float = 0.55,
) -> np.ndarray:
    """(count, 4, 4) T_camera_board, tilted up to 40 deg, the board with a square around it in the image."""
    cam = cam or camera()
    middle = board.object_points.mean(axis=0)
    poses: list[np.ndarray] = []
    while len(poses) < count:
        pose = np.eye(4)
        pose[:3, :3] = rotations(rng.uniform([-0.7, -0.7, -0.4], [0.7, 0.7, 0.4])[None])[0]
        distance = rng.uniform(0.35, 0.9)
        pose[:3, 3] = (
            rng.uniform([-spread, -0.8 * spread, 1], [spread, 0.8 * spread, 1]) * distance - pose[:3, :3] @ middle
        )
        around = board.plate_corners @ pose[:3, :3].T + pose[:3, 3]
        if cam.is_inside(cam.project(around)).all():
            poses.append(pose)
    return np.stack(poses)


def capture_of(
    poses: np.ndarray, noise_px: float, rng: np.random.Generator, *, cam: Camera | None = None, board: Board = BOARD
) -> Capture:
    cam = cam or camera()
    views = []
    for number, pose in enumerate(poses):
        pixels = cam.project(board.object_points @ pose[:3, :3].T + pose[:3, 3])
        noisy = pixels + rng.normal(scale=noise_px, size=pixels.shape)
        views.append(View(f"{number:03d}", np.arange(len(pixels)), noisy))
    return Capture(board, cam.width, cam.height, tuple(views), len(views))


def picture(pose: np.ndarray, *, cam: Camera | None = None, board: Board = BOARD, blur_px: float = 0.8) -> np.ndarray:
    """(H, W) uint8: every pixel's ray cut with the board's plane and looked up on the sheet, over a grey wall."""
    cam = cam or camera()
    per_mm = 8
    sheet = sheet_of(board)
    page = np.full((round(sheet.height_mm * per_mm), round(sheet.width_mm * per_mm)), 235, np.uint8)
    for x, y, w, h in np.round(sheet.rectangles * per_mm).astype(int):
        page[y : y + h, x : x + w] = 20
    # remap looks up single pixels: the page is as blurred as a camera pixel is wide
    page = cv2.GaussianBlur(page, (0, 0), 3.0)
    # where the board's origin lies on the page
    first = sheet.rectangles[0, :2] if board.kind == "chessboard" else None
    assert first is not None
    origin = first + board.square_m * 1e3
    rays = cam.unproject(np.stack(np.meshgrid(np.arange(cam.width), np.arange(cam.height)), -1))
    normal, offset = pose[:3, 2], pose[:3, 2] @ pose[:3, 3]
    with np.errstate(all="ignore"):
        on_plane = rays * (offset / (rays @ normal))[..., None]
    on_board = (on_plane - pose[:3, 3]) @ pose[:3, :3]
    where = ((on_board[..., :2] * 1e3 + origin) * per_mm - 0.5).astype(np.float32)
    where = np.nan_to_num(where, nan=-1e6)
    image = cv2.remap(
        page, where[..., 0], where[..., 1], cv2.INTER_AREA, borderMode=cv2.BORDER_CONSTANT, borderValue=120
    )
    return cv2.GaussianBlur(image, (0, 0), blur_px)
