"""One grey image -> the board's corners in it, refined to a hundredth of a pixel, or nothing."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from wallkit.calib.board.boards import Board, opencv_board
from wallkit.core.types import Float64Array, Int64Array, UInt8Array

# cornerSubPix sees a square window around a corner. Wider averages more noise, but near the next corner it is pulled away:
# on OpenCV's left*.jpg and right*.jpg 0.3 of the spacing gives the smallest residuals (0.181, 0.187 px), 0.4 is worse on
# the right (0.249) and a fixed 11 doubles them (0.41, 0.46).
WINDOW_PER_SPACING = 0.3
_SMALLEST, _LARGEST = 2, 11
# OpenCV refines a ChArUco board's corners in a window that ends 2 px before the next marker, down to a single pixel. In
# rendered pictures (640x480, boards of 39 and 100 mm, markers 3/4 of that) 0.15 of the spacing but at least 2 px errs by
# 0.120 and 0.087 px per axis instead of 0.184 and 0.124; 0.2 by 0.131 and 0.113, as the markers then look in.
_CHARUCO_PER_SPACING, _BEFORE_MARKER_PX = 0.15, 2
_STOP = (3, 50, 1e-3)
_FEWEST_CORNERS = 6
# grey values around a corner spread at least by this share of what is usual on the board; plain wall has 0.05
_PATCH_PER_SPACING, _LEAST_SPREAD = 0.3, 0.15
# a corner that was lost is looked for where so many others put it
_NEIGHBOURS = 8
_QUICK_WIDTH = 320


@dataclass(frozen=True, slots=True)
class Corners:
    """The corners of one board in one image.

    Attributes:
        ids: (n,) int64 rows of `Board.object_points`, ascending. pixels: (n, 2) float64.
        spacing_px: smallest distance between two of them.
        sharpness: variance of the Laplacian over the board's box, divided by the grey variance there; larger is sharper.
    """

    ids: Int64Array
    pixels: Float64Array
    spacing_px: float
    sharpness: float


def find_corners(grey: UInt8Array, board: Board, *, half_window: int | None = None) -> Corners | None:
    """The board's corners in a grey image (H, W) uint8; None when the board is not there.

    Args:
        half_window: of the sub-pixel refinement [px]; None: 0.3 of the smallest corner spacing, 2 to 11 (a ChArUco
            board's detector has a rule of its own, which is widened where it is narrow; an AprilGrid's fits lines to edges).

    A chessboard is found whole or not at all: first by OpenCV's classic search, which is fast and on its own samples the
    more exact after refinement, then by the slower sector-based one (Duda & Frese, BMVC 2018), which sees through blur.
    """
    found = _FINDERS[board.kind](grey, board)
    if found is None or len(found[0]) < _FEWEST_CORNERS:
        return None
    ids, pixels = found
    if board.kind == "chessboard":
        spacing = _spacing(pixels)
        pixels = _refined_together(grey, pixels, board, half_window or _half_window(spacing))
        if half_window is None and not _all_cross(grey, pixels, spacing):
            return None
    elif wanted := half_window or _wider_half_window(board, pixels):
        pixels = _refined(grey, pixels, wanted)
    return Corners(ids, pixels, _spacing(pixels), sharpness(grey, pixels))


def find_roughly(grey: UInt8Array, board: Board, *, width: int = 400) -> Float64Array | None:
    """(n, 2) corners to about a pixel, found in a copy of the image shrunk to about a width; None without a board.

    For choosing among the frames of a log; ten times faster than `find_corners`.
    """
    import cv2

    step = max(1, round(grey.shape[1] / width))
    small: Any = cv2.resize(grey, None, fx=1 / step, fy=1 / step, interpolation=cv2.INTER_AREA) if step > 1 else grey
    found = _FINDERS[board.kind](small, board) if board.kind != "chessboard" else _classic(small, board)
    if found is None or len(found[0]) < _FEWEST_CORNERS:
        return None
    return np.asarray((found[1] + 0.5) * step - 0.5)


def find_quickly(grey: UInt8Array, board: Board, *, is_thorough: bool) -> Corners | None:
    """`find_corners` for the frames of a log, of which many show no board: a chessboard is found in a copy of about 320 px
    width, and refined in the image.

    Args:
        is_thorough: search the image itself too when the copy shows no board: for boards that are far away; three times as
            slow. Blurred boards, for which `find_corners` looks longest, are never found.
    """
    if board.kind != "chessboard":
        return find_corners(grey, board)
    rough = find_roughly(grey, board, width=_QUICK_WIDTH)
    if rough is None and is_thorough:
        found = _classic(grey, board)
        rough = None if found is None else found[1]
    if rough is None:
        return None
    pixels = _refined_together(grey, rough, board, _half_window(_spacing(rough)))
    if not _all_cross(grey, pixels, _spacing(rough)):
        return None
    return Corners(np.arange(len(pixels)), pixels, _spacing(pixels), sharpness(grey, pixels))


def sharpness(grey: UInt8Array, pixels: Float64Array) -> float:
    """Variance of the Laplacian over the box of some pixels, relative to the grey variance there; 0 when it is empty."""
    import cv2

    height, width = grey.shape
    low = np.clip(np.floor(pixels.min(axis=0)).astype(int), 0, (width - 1, height - 1))
    high = np.clip(np.ceil(pixels.max(axis=0)).astype(int) + 1, 1, (width, height))
    box = grey[low[1] : high[1], low[0] : high[0]]
    spread = float(box.var()) if box.size else 0.0
    return float(cv2.Laplacian(box, cv2.CV_64F).var()) / spread if spread > 0 else 0.0


def _all_cross(grey: UInt8Array, pixels: Float64Array, spacing_px: float) -> bool:
    """Whether there is something at every corner: of a board that is cut off, OpenCV makes the missing ones up."""
    reach = max(2, round(_PATCH_PER_SPACING * spacing_px))
    height, width = grey.shape
    columns, rows = (np.round(pixels[:, i]).astype(int) for i in (0, 1))
    spreads = np.array(
        [
            np.ptp(grey[max(0, v - reach) : min(height, v + reach + 1), max(0, u - reach) : min(width, u + reach + 1)])
            if -reach <= u < width + reach and -reach <= v < height + reach
            else 0.0
            for u, v in zip(columns, rows, strict=True)
        ],
        dtype=np.float64,
    )
    return bool((spreads > _LEAST_SPREAD * np.median(spreads)).all())


def _half_window(spacing_px: float) -> int:
    return int(np.clip(np.floor(WINDOW_PER_SPACING * spacing_px), _SMALLEST, _LARGEST))


def _wider_half_window(board: Board, pixels: Float64Array) -> int:
    """Of a ChArUco board's corners that OpenCV refined in a narrower one; 0 where its own is wide enough."""
    if board.kind != "charuco":
        return 0
    spacing = _spacing(pixels)
    to_marker = (1 - board.marker_m / board.square_m) * spacing / math.sqrt(2)
    wanted = max(_SMALLEST, min(_LARGEST, int(_CHARUCO_PER_SPACING * spacing)))
    return wanted if to_marker - _BEFORE_MARKER_PX < wanted else 0


def _spacing(pixels: Float64Array) -> float:
    """Smallest distance between two pixels (n, 2)."""
    from scipy.spatial import cKDTree

    distances, _ = cKDTree(pixels).query(pixels, k=2)
    return float(distances[:, 1].min())


def _refined_together(grey: UInt8Array, pixels: Float64Array, board: Board, half_window: int) -> Float64Array:
    """Corners of a whole chessboard, refined; one whose start was outside its window starts again between the others.

    OpenCV leaves such a corner where it was, pixels beside its place, and does not say so.
    """
    import cv2

    refined = _refined(grey, pixels, half_window)
    starts = pixels.copy()
    cells = board.object_points[:, :2] / board.square_m
    stuck = np.flatnonzero((refined == pixels.astype(np.float32)).all(axis=1))
    for corner in stuck:
        near = np.argsort(((cells - cells[corner]) ** 2).sum(axis=1), kind="stable")[1 : 1 + _NEIGHBOURS]
        H, _ = cv2.findHomography(cells[near] - cells[corner], refined[near], cv2.LMEDS)
        if H is not None:
            starts[corner] = H[:2, 2] / H[2, 2]
    if len(stuck):
        refined[stuck] = _refined(grey, starts[stuck], half_window)
    return refined


def _refined(grey: UInt8Array, pixels: Float64Array, half_window: int) -> Float64Array:
    import cv2

    start = np.ascontiguousarray(pixels.reshape(-1, 1, 2), dtype=np.float32)
    found = cv2.cornerSubPix(grey, start, (half_window, half_window), (-1, -1), _STOP)
    return np.asarray(found.reshape(-1, 2), dtype=np.float64)


Found = tuple[Int64Array, Float64Array] | None


def _chessboard(grey: UInt8Array, board: Board) -> Found:
    return _classic(grey, board) or _sectors(grey, board)


def _classic(grey: UInt8Array, board: Board) -> Found:
    import cv2

    # the fast check of OpenCV rejects most tilted boards of a shrunken frame
    flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE
    is_found, pixels = cv2.findChessboardCorners(grey, board.grid, flags=flags)
    return _in_order(grey, pixels, board) if is_found else None


def _sectors(grey: UInt8Array, board: Board) -> Found:
    import cv2

    flags = cv2.CALIB_CB_ACCURACY | cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_NORMALIZE_IMAGE
    is_found, pixels = cv2.findChessboardCornersSB(grey, board.grid, flags=flags)
    return _in_order(grey, pixels, board) if is_found else None


def _in_order(grey: UInt8Array, pixels: Any, board: Board) -> Found:
    """The corners from the board's first one: seen from the front, with the black outer square first where there is one.

    Both searches may start at either end. A board whose two ends look alike starts at the end nearer to the image's first
    pixel, so that at least neighbouring frames agree.
    """
    columns, rows = board.grid
    grid = np.asarray(pixels, dtype=np.float64).reshape(rows, columns, 2)
    across, down = grid[0, -1] - grid[0, 0], grid[-1, 0] - grid[0, 0]
    if across[0] * down[1] - across[1] * down[0] < 0:
        grid = grid[:, ::-1]
    if (columns + rows) % 2:
        is_first_dark = _outer_grey(grey, grid) < _outer_grey(grey, grid[::-1, ::-1])
    else:
        is_first_dark = bool(grid[0, 0].sum() <= grid[-1, -1].sum())
    grid = grid if is_first_dark else grid[::-1, ::-1]
    return np.arange(columns * rows), np.ascontiguousarray(grid.reshape(-1, 2))


def _outer_grey(grey: UInt8Array, grid: Float64Array) -> float:
    """Grey in the middle of the square outside the first corner."""
    u, v = grid[0, 0] - (grid[1, 1] - grid[0, 0]) / 2
    row, column = np.clip([round(float(v)), round(float(u))], 0, np.array(grey.shape) - 1)
    return float(grey[max(0, row - 1) : row + 2, max(0, column - 1) : column + 2].mean())


def _charuco(grey: UInt8Array, board: Board) -> Found:
    from cv2 import aruco

    detector = aruco.CharucoDetector(opencv_board(board))
    pixels, ids, _, _ = detector.detectBoard(grey)
    if ids is None or len(ids) == 0:
        return None
    return _ascending(np.asarray(ids).ravel().astype(np.int64), np.asarray(pixels, dtype=np.float64).reshape(-1, 2))


def _aprilgrid(grey: UInt8Array, board: Board) -> Found:
    from cv2 import aruco

    parameters = aruco.DetectorParameters()
    parameters.cornerRefinementMethod = aruco.CORNER_REFINE_APRILTAG
    grid = opencv_board(board)
    corners, tags, _ = aruco.ArucoDetector(grid.getDictionary(), parameters).detectMarkers(grey)
    if tags is None or len(tags) == 0:
        return None
    numbers = np.asarray(tags).ravel().astype(np.int64)
    known = numbers < board.columns * board.rows
    ids = (numbers[known, None] * 4 + np.arange(4)).ravel()
    pixels = np.asarray(corners, dtype=np.float64).reshape(-1, 4, 2)[known].reshape(-1, 2)
    return _ascending(ids, pixels)


def _ascending(ids: Int64Array, pixels: Float64Array) -> Found:
    order = np.argsort(ids, kind="stable")
    return ids[order], np.ascontiguousarray(pixels[order])


_FINDERS: dict[str, Callable[[UInt8Array, Board], Found]] = {
    "chessboard": _chessboard,
    "charuco": _charuco,
    "aprilgrid": _aprilgrid,
}
