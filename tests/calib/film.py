"""A log of a board that is held before a camera at one place after another: every frame drawn pixel by pixel."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from tests.calib.drawn import BOARD, camera, picture
from wallkit.calib.board.boards import Board
from wallkit.core.camera import Camera
from wallkit.core.types import CameraImage, CameraInfo
from wallkit.logs.writer import McapWriter

START_NS = 1_700_000_000_000_000_000


def write_film(
    path: Path,
    poses: np.ndarray,
    *,
    still_s: float = 3.0,
    move_s: float = 2.0,
    rate_hz: float = 10.0,
    board: Board = BOARD,
    cam: Camera | None = None,
    is_raw: bool = False,
) -> int:
    """Writes an MCAP with images and the camera_info, and returns how many frames it has.

    Frames are as blurred as the board moves fast, and have 2 grey levels of noise; away from the board the wall is bare. The
    board leaves the image at the end of the film for a tenth of it.
    """
    rng, cam = np.random.default_rng(0), cam or camera()
    period = still_s + move_s
    count = round((len(poses) * period - move_s) * rate_hz)
    info = CameraInfo(START_NS, "cam_optical", cam.width, cam.height, cam.model, cam.D, cam.K, np.eye(3), np.eye(3, 4))
    stands: dict[int, np.ndarray] = {}
    with McapWriter(path) as writer:
        writer.write("/cam/camera_info", info, START_NS)
        for frame in range(count):
            stamp = START_NS + round(frame / rate_hz * 1e9)
            at, into = divmod(frame / rate_hz, period)
            here, share = int(at), max(0.0, into - still_s) / move_s
            if frame >= 0.9 * count:
                clean = np.full((cam.height, cam.width), 120, np.uint8)
            elif share == 0:
                if here not in stands:
                    stands = {here: picture(poses[here], cam=cam, board=board)}
                clean = stands[here]
            else:
                clean = _between(poses[here], poses[here + 1], share, 1 / rate_hz / move_s, cam, board)
            grey = np.clip(clean + rng.normal(0, 2, clean.shape), 0, 255).astype(np.uint8)
            writer.write(
                "/cam/image_raw" if is_raw else "/cam/image_raw/compressed", _image(grey, stamp, is_raw), stamp
            )
    return count


def _between(a: np.ndarray, b: np.ndarray, share: float, step: float, cam: Camera, board: Board) -> np.ndarray:
    """The board on its way, as blurred as its middle moves in a third of the time between frames."""

    def at(where: float) -> np.ndarray:
        rotation, _ = cv2.Rodrigues(a[:3, :3].T @ b[:3, :3])
        pose = np.eye(4)
        pose[:3, :3] = a[:3, :3] @ cv2.Rodrigues(rotation * where)[0]
        pose[:3, 3] = (1 - where) * a[:3, 3] + where * b[:3, 3]
        return pose

    here, then = at(share), at(min(1.0, share + step / 3))
    middle = board.object_points.mean(axis=0)
    u, v = (cam.project(pose[:3, :3] @ middle + pose[:3, 3]) for pose in (here, then))
    return picture(here, cam=cam, board=board, blur_px=0.8 + float(np.linalg.norm(u - v)) / 3)


def _image(grey: np.ndarray, stamp: int, is_raw: bool) -> CameraImage:
    if is_raw:
        return CameraImage(stamp, "cam_optical", "mono8", grey.tobytes(), grey.shape[1], grey.shape[0], grey.shape[1])
    data = cv2.imencode(".jpg", grey, [cv2.IMWRITE_JPEG_QUALITY, 90])[1].tobytes()
    return CameraImage(stamp, "cam_optical", "jpeg", data)
