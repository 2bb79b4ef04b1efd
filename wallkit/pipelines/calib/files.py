"""A folder of pictures or an archive of corners, and a folder of scans -> pairs of both."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from wallkit.calib.board.boards import Board
from wallkit.calib.board.detect import find_corners
from wallkit.calib.board.pattern import explain_larger, explain_nothing_found
from wallkit.calib.board.pose import AMBIGUOUS, pose_of_board
from wallkit.calib.board.views import capture_from_npz
from wallkit.calib.extrinsics.scan_board import returns_of_points
from wallkit.calib.extrinsics.scan_files import paired, read_scan, scan_files
from wallkit.calib.files.store import read_calibration
from wallkit.core.camera import Camera
from wallkit.core.types import Float64Array, Int64Array, UInt8Array
from wallkit.errors import CalibrationError
from wallkit.pipelines.calib.extrinsics import Gathered, LeftOut, Pair

PICTURES = (".png", ".jpg", ".jpeg", ".bmp", ".pgm", ".ppm", ".tif", ".tiff", ".webp")


def gather_files(
    inputs: Sequence[Path],
    scans: Path,
    board: Board,
    camera_file: Path,
    *,
    tolerance_s: float = 0.1,
    done: Callable[[int], None] = lambda count: None,
) -> Gathered:
    """Boards in pictures (files or folders of them, or one .npz of corners) and the scans that belong to them.

    Raises:
        CalibrationError: a file that cannot be read or is of another camera, or no picture that belongs to a scan.
    """
    stored = read_calibration(camera_file)
    camera = stored.camera
    pictures = _pictures(inputs)
    files = scan_files(scans)
    corners = _corners_from_npz(inputs[0], board, camera) if not pictures else None
    names = [p.name for p in pictures] if corners is None else [name for name, _, _ in corners]
    pairs = paired(names, [p.name for p in files], tolerance_s=tolerance_s)
    if not pairs:
        hint = "name both by stamp in nanoseconds, or with the same number: pose7.png and pose7.pcd"
        raise CalibrationError(
            f"none of {len(names)} pictures belongs to one of {len(files)} scans", where=scans, hint=hint
        )
    left_out = [LeftOut(names[i], "no scan belongs to it") for i in range(len(names)) if i not in {i for i, _ in pairs}]
    found: list[Pair] = []
    for count, (i, j) in enumerate(pairs):
        seen = _corners_of_picture(pictures[i], board, camera) if corners is None else corners[i][1:]
        done(count + 1)
        if seen is None:
            left_out.append(LeftOut(names[i], f"the board {board.words} is not in it"))
            continue
        pair = _pair(names[i], camera, board, seen, files[j])
        if isinstance(pair, LeftOut):
            left_out.append(pair)
        else:
            found.append(pair)
    if pictures:
        _check_pattern([pictures[i] for i, _ in pairs], found, board)
    read = [camera_file, *(pictures or inputs[:1]), *(files[j] for _, j in pairs)]
    return Gathered(
        camera,
        stored.camera_covariance,
        board,
        tuple(found),
        len(names),
        tuple(left_out),
        tuple(read),
        stored.lidar_frame,
    )


def _pair(
    name: str, camera: Camera, board: Board, seen: tuple[Int64Array, Float64Array], scan_file: Path
) -> Pair | LeftOut:
    ids, pixels = seen
    pose = pose_of_board(camera, board.object_points[ids], pixels, name=name)
    if pose.ambiguity < AMBIGUOUS:
        return LeftOut(name, f"the board may be tilted either way (error ratio {pose.ambiguity:.2f})")
    scan = read_scan(scan_file)
    returns = returns_of_points(scan.points_m) if scan.is_planar else None
    return Pair(name, pose, returns, scan.points_m, scan.rings)


def _pictures(inputs: Sequence[Path]) -> list[Path]:
    """The pictures named, and those in the folders named; none when the input is an archive of corners."""
    found: list[Path] = []
    for path in inputs:
        if not path.exists():
            raise CalibrationError("no such file or folder", where=path)
        if path.is_dir():
            inside = sorted(p for p in path.iterdir() if p.suffix.lower() in PICTURES)
            if not inside:
                raise CalibrationError(f"holds no pictures ({', '.join(PICTURES)})", where=path)
            found += inside
        elif path.suffix.lower() in PICTURES:
            found.append(path)
        elif path.suffix != ".npz":
            hint = "give pictures, a folder of them, an .npz of corners, or a log"
            raise CalibrationError("is no picture", where=path, hint=hint)
    if not found and len(inputs) > 1:
        raise CalibrationError("one archive of corners is read at a time", where=inputs[1])
    return found


def _corners_from_npz(path: Path, board: Board, camera: Camera) -> list[tuple[str, Int64Array, Float64Array]]:
    capture = capture_from_npz(path, board, (camera.width, camera.height))
    return [(view.name, view.ids, view.pixels) for view in capture.views]


def _check_pattern(pictures: Sequence[Path], found: Sequence[Pair], board: Board) -> None:
    """Refuse a board that is in none of the pictures, or is a part of a larger one, and say what is there instead.

    Raises:
        CalibrationError: so it is.
    """
    seen = {pair.name for pair in found}
    chosen = [p for p in pictures if p.name in seen or not seen]
    few = [chosen[int(i)] for i in np.linspace(0, len(chosen) - 1, min(3, len(chosen)))]
    if not seen:
        raise explain_nothing_found(map(_grey_of, few), board, len(pictures))
    larger = explain_larger(map(_grey_of, few), board)
    if larger is not None:
        raise larger


def _grey_of(path: Path) -> UInt8Array:
    import cv2

    data = np.fromfile(path, np.uint8)
    grey = cv2.imdecode(data, cv2.IMREAD_GRAYSCALE) if len(data) else None
    if grey is None:
        raise CalibrationError("is no picture that can be read", where=path)
    return np.asarray(grey, dtype=np.uint8)


def _corners_of_picture(path: Path, board: Board, camera: Camera) -> tuple[Int64Array, Float64Array] | None:
    grey = _grey_of(path)
    if grey.shape != (camera.height, camera.width):
        sizes = f"{grey.shape[1]} x {grey.shape[0]} px, the calibration is for {camera.width} x {camera.height}"
        raise CalibrationError(
            f"the picture has {sizes}", where=path, hint="the intrinsics are of another camera or mode"
        )
    found = find_corners(grey, board)
    return None if found is None else (found.ids, found.pixels)
