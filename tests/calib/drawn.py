"""Views of a board as a known camera sees them: corners with known noise, and pictures drawn pixel by pixel."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np

from wallkit.calib.board.boards import Board
from wallkit.calib.board.sheet import FOOT_MM, sheet_of
from wallkit.calib.board.views import Capture, View
from wallkit.calib.camera.bundle import rotations
from wallkit.core.camera import Camera

K = np.array([[600.0, 0, 321.0], [0, 602.0, 238.0], [0, 0, 1]])
DISTORTIONS = {
    "plumb_bob": [-0.25, 0.08, 0.001, -0.0008, -0.01],
    "rational_polynomial": [0.4, -0.1, 0.001, -0.0008, 0.01, 0.7, -0.05, 0.02],
    "equidistant": [-0.04, 0.012, -0.008, 0.002],
}
_PER_MM = 8
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
    page, origin = _page(board)
    rays = _rays(cam.model, cam.width, cam.height, tuple(cam.parameters.tolist()))
    normal, offset = pose[:3, 2], pose[:3, 2] @ pose[:3, 3]
    with np.errstate(all="ignore"):
        on_plane = rays * (offset / (rays @ normal))[..., None]
    on_board = (on_plane - pose[:3, 3]) @ pose[:3, :3]
    where = ((on_board[..., :2] * 1e3 + origin) * _PER_MM - 0.5).astype(np.float32)
    where = np.nan_to_num(where, nan=-1e6)
    image = cv2.remap(
        page, where[..., 0], where[..., 1], cv2.INTER_AREA, borderMode=cv2.BORDER_CONSTANT, borderValue=120
    )
    return cv2.GaussianBlur(image, (0, 0), blur_px)


@cache
def _page(board: Board) -> tuple[np.ndarray, np.ndarray]:
    """The printed sheet, _PER_MM pixels a millimetre, and where the board's origin lies on it [mm]."""
    sheet = sheet_of(board)
    page = np.full((round(sheet.height_mm * _PER_MM), round(sheet.width_mm * _PER_MM)), 235, np.uint8)
    for x, y, w, h in np.round(sheet.rectangles * _PER_MM).astype(int):
        page[y : y + h, x : x + w] = 20
    size, (low, _) = board.pattern_size_m * 1e3, board.pattern_box
    corner = np.array([sheet.width_mm - size[0], sheet.height_mm - FOOT_MM - size[1]]) / 2
    # remap looks up single pixels: the page is as blurred as a camera pixel is wide
    return cv2.GaussianBlur(page, (0, 0), 3.0), corner - low * 1e3


@cache
def _rays(model: str, width: int, height: int, parameters: tuple[float, ...]) -> np.ndarray:
    """(H, W, 3) rays of every pixel."""
    fx, fy, cx, cy, *D = parameters
    cam = Camera(model, width, height, np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]]), np.array(D))
    return cam.unproject(np.stack(np.meshgrid(np.arange(width), np.arange(height)), -1))


def sweep_poses(rng: np.random.Generator, count: int, board: Board = BOARD, *, cam: Camera | None = None) -> np.ndarray:
    """(count, 4, 4) T_camera_board as a careful person shows a board: to the middle, edges and corners of the image in turn,
    near and far, upright and tilted by up to 40 deg.

    A chessboard is as near to the image's edge as its outer squares let it be; a board with markers may be half outside.
    """
    cam = cam or camera()
    low, high = board.pattern_box
    around = np.array([(low[0], low[1], 0), (high[0], low[1], 0), (high[0], high[1], 0), (low[0], high[1], 0)])
    middle = around.mean(axis=0)
    if board.kind == "charuco":
        around = middle + (around - middle) * 0.5
    aims = [(u, v) for v in (-1, 0, 1) for u in (-1, 0, 1)]
    poses: list[np.ndarray] = []
    while len(poses) < count:
        aim = np.array(aims[len(poses) % 9])
        pose = np.eye(4)
        pose[:3, :3] = rotations(rng.uniform([-0.7, -0.7, -0.3], [0.7, 0.7, 0.3])[None])[0]
        width = float(high[0] - low[0]) * cam.K[0, 0] / cam.width
        distance = width / rng.uniform(0.3, 0.6)
        # from the middle outwards until it would leave the image
        for share in np.linspace(0, 1.2, 61):
            there = np.append(aim * share * 0.5 * (cam.width, cam.height) / cam.K[[0, 1], [0, 1]], 1) * distance
            tried = pose.copy()
            tried[:3, 3] = there - pose[:3, :3] @ middle
            pixels = cam.project(around @ tried[:3, :3].T + tried[:3, 3])
            if not (cam.is_inside(pixels) & cam.is_inside(pixels + 3) & cam.is_inside(pixels - 3)).all():
                break
            best = tried
        else:
            best = tried
        if share > 0:
            poses.append(best)
    return np.stack(poses)
