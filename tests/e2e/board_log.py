"""A log drawn pixel by pixel and beam by beam: a board before a robot with a known mounting and clocks that differ."""

from __future__ import annotations

import cv2
import numpy as np

from wallkit.calib.board.boards import Board
from wallkit.calib.extrinsics.worlds import UPRIGHT, board_at
from wallkit.core.types import CameraImage, CameraInfo, Scan
from wallkit.logs.writer import McapWriter

BOARD = Board("chessboard", 8, 6, 0.07, plate_m=(0.8, 0.6))
K = np.array([[520.0, 0, 320], [0, 520, 240], [0, 0, 1]])
T = np.eye(4)
T[:3, :3], T[:3, 3] = UPRIGHT, (0.03, 0.06, -0.05)
STILL_S, MOVE_S = 1.6, 1.4
TAU_S = 0.030
START_NS = 1_700_000_000_000_000_000


def middle_first(pose):
    """T_camera_board of a board whose middle is at the pose's origin."""
    shift = np.eye(4)
    shift[:2, 3] = -BOARD.plate_corners[:, :2].mean(axis=0)
    return pose @ shift


def stations(count=14, seed=3):
    """Places and tilts of the board, in the camera's frame."""
    rng = np.random.default_rng(seed)
    return [
        (rng.uniform(-0.25, 0.25), 0.08, rng.uniform(1.1, 1.8), *rng.uniform(-32, 32, 2), rng.uniform(-25, 25))
        for _ in range(count)
    ]


def pose_at(places, seconds):
    """The board stands at each station, and glides to the next."""
    period = STILL_S + MOVE_S
    i = min(int(seconds / period), len(places) - 1)
    share = np.clip((seconds - i * period - STILL_S) / MOVE_S, 0, 1)
    following = places[min(i + 1, len(places) - 1)]
    smooth = share * share * (3 - 2 * share)
    x, y, z, pitch, yaw, roll = (1 - smooth) * np.array(places[i]) + smooth * np.array(following)
    return middle_first(board_at(x, y, z, pitch_deg=pitch, yaw_deg=yaw, roll_deg=roll))


def picture(pose, rng):
    """The board as a pinhole sees it, with a little blur and noise."""
    side = 40
    cells = (np.indices((BOARD.rows + 1, BOARD.columns + 1)).sum(axis=0) % 2) * 255
    pattern = np.kron(cells, np.ones((side, side))).astype(np.uint8)
    px = side / BOARD.square_m
    corners = np.round((BOARD.plate_corners[[0, 2], :2] + BOARD.square_m) * px).astype(int)
    border = (-corners[0, 1], corners[1, 1] - pattern.shape[0], -corners[0, 0], corners[1, 0] - pattern.shape[1])
    sheet = cv2.copyMakeBorder(pattern, *(int(b) for b in border), cv2.BORDER_CONSTANT, value=255)
    to_metres = np.array(
        [
            [1 / px, 0, (corners[0, 0] + 0.5) / px - BOARD.square_m],
            [0, 1 / px, (corners[0, 1] + 0.5) / px - BOARD.square_m],
            [0, 0, 1],
        ]
    )
    H = K @ pose[:3, [0, 1, 3]] @ to_metres
    big = cv2.warpPerspective(
        sheet,
        np.diag([2, 2, 1]) @ H,
        (1280, 960),
        flags=cv2.INTER_AREA,
        borderValue=110,
        borderMode=cv2.BORDER_CONSTANT,
    )
    grey = cv2.resize(cv2.GaussianBlur(big, (0, 0), 1.2), (640, 480), interpolation=cv2.INTER_AREA)
    return np.clip(grey + rng.normal(0, 2, grey.shape), 0, 255).astype(np.uint8)


def scan_of(pose, stamp_ns, rng):
    """A planar scan of a room with the board in it."""
    azimuth = np.linspace(-np.pi, np.pi, 720, endpoint=False)
    c, s = np.cos(azimuth), np.sin(azimuth)
    ranges = np.minimum(np.where(c > 0, 4.0, 2.0) / np.maximum(np.abs(c), 1e-9), 2.5 / np.maximum(np.abs(s), 1e-9))
    L = np.linalg.inv(T) @ pose
    beams = np.column_stack([c, s, np.zeros_like(c)])
    along = (L[:3, 2] @ L[:3, 3]) / (beams @ L[:3, 2])
    on = (beams * along[:, None] - L[:3, 3]) @ L[:3, :2]
    low, high = BOARD.plate_corners[0, :2], BOARD.plate_corners[2, :2]
    met = (along > 0.1) & (on > low).all(axis=1) & (on < high).all(axis=1)
    ranges = np.where(met, np.minimum(along, ranges), ranges) + rng.normal(0, 0.008, 720)
    return Scan(stamp_ns, "laser", ranges.astype(np.float32), azimuth.astype(np.float32), 0.0, 0.1, 12.0)


def write_log(path, places, *, coding=(".png", [cv2.IMWRITE_PNG_COMPRESSION, 1])):
    """An MCAP with images and scans at 10 Hz, the camera's clock ahead by TAU_S."""
    rng = np.random.default_rng(0)
    seconds = len(places) * (STILL_S + MOVE_S) - MOVE_S
    with McapWriter(path) as writer:
        info = CameraInfo(
            START_NS, "cam_optical", 640, 480, "plumb_bob", np.zeros(5), K, np.eye(3), np.hstack([K, np.zeros((3, 1))])
        )
        writer.write("/cam/camera_info", info, START_NS)
        for t in np.arange(0, seconds, 0.1):
            true_ns = START_NS + round(t * 1e9)
            pose = pose_at(places, t)
            data = cv2.imencode(coding[0], picture(pose, rng), coding[1])[1].tobytes()
            image = CameraImage(true_ns + round(TAU_S * 1e9), "cam_optical", coding[0][1:], data)
            writer.write("/cam/image/compressed", image, true_ns)
            writer.write("/scan", scan_of(pose, true_ns, rng), true_ns)
