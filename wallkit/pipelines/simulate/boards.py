"""A board, a robot and a seed -> a capture to calibrate with: a log, a folder of pictures and scans, and the truth.

The board is held still in front of camera and LiDAR, pose after pose, two seconds each; everything random follows from the
seed. Read `simulate_boards` from top to bottom.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

import wallkit
from wallkit.calib.board.boards import Board
from wallkit.calib.board.sheet import black_rectangles
from wallkit.calib.files.store import toml_from_calibration
from wallkit.core.calibration import Calibration, Provenance
from wallkit.core.config import table_from
from wallkit.core.types import CameraImage, Float64Array, PointCloud, Scan, Transform, UInt8Array
from wallkit.logs.writer import McapWriter
from wallkit.pipelines.outputs import result_folder
from wallkit.pipelines.run_folder import write_json
from wallkit.pipelines.simulate.camera import camera_info
from wallkit.pipelines.simulate.play import START_NS
from wallkit.pipelines.simulate.sensors import leaning
from wallkit.pipelines.simulate.units import unit_of
from wallkit.simulate.board_room import (
    BEHIND_IN_CLOUDS_M,
    BEHIND_M,
    BOARD,
    STAND,
    BoardPoses,
    board_room,
    held_boards,
    stand_under,
)
from wallkit.simulate.camera import Unit, photograph
from wallkit.simulate.gl import backend
from wallkit.simulate.looks import Surface, Wardrobe
from wallkit.simulate.robot import DEFAULT_ROBOT, Robot, robot_from_urdf
from wallkit.simulate.scanner import Rings, cloud, sweep
from wallkit.simulate.scenario import CameraSetup, LidarSetup, Scenario
from wallkit.simulate.scene import Scene
from wallkit.simulate.studio import Studio
from wallkit.simulate.textures import Texture
from wallkit.simulate.world import upright

_HELD_NS, _EVERY_NS = 2_000_000_000, 500_000_000
# pixels of the renderer in one of the camera, each way
_FINE = 2
# a square's side on the picture of the board, a power of two
_PX_PER_SQUARE, _MOST_PX = 128, 4096
_PAPER, _INK = 235, 18


@dataclass(frozen=True)
class BoardRequest:
    """What to show to whom: the first camera and the LiDAR of a scenario, which is a 3-D one if it has rings."""

    board: Board
    scenario: Scenario = field(default_factory=Scenario)
    poses: BoardPoses = field(default_factory=BoardPoses)
    rings: Rings | None = None
    robot_path: Path = DEFAULT_ROBOT
    seed: int = 0


@dataclass(frozen=True, eq=False)
class Held:
    """One pose of the board: its picture without JPEG, its scan or cloud, and where it truly is, T_camera_board (4, 4)."""

    stamp_ns: int
    image: UInt8Array
    scan: Scan | PointCloud
    T_camera_board: Float64Array


def simulate_boards(
    request: BoardRequest, out: Path, *, overwrite: bool = False, progress: Callable[[int], None] = lambda _: None
) -> list[Held]:
    """A folder with log.mcap, images/, scans/, board.toml, camera.toml (true intrinsics) and truth.toml (extrinsics too).

    Raises:
        SimulationError: no OpenGL works, no such frames, or no pose fits. OutputError: `out` cannot be written.
    """
    robot = robot_from_urdf(request.robot_path)
    unit = unit_of(robot, (request.scenario.cameras or (CameraSetup(),))[0])
    lidar = robot.lidar_frame(request.scenario.lidar.frame)
    backend()
    kept: list[Held] = []
    with result_folder(out, overwrite=overwrite) as folder:
        for name in ("images", "scans"):
            (folder / name).mkdir()
        with McapWriter(folder / "log.mcap") as file:
            file.write("/tf_static", _mounts(robot), START_NS, is_latched=True)
            for number, held in enumerate(captures(request, robot, unit)):
                _record(file, unit, held)
                if number % (_HELD_NS // _EVERY_NS) == 0:
                    _keep(folder, len(kept), held)
                    kept.append(held)
                    progress(len(kept))
        (folder / "board.toml").write_text(request.board.toml(), encoding="utf-8")
        for name, calibration in _truths(request, unit, robot.frames[lidar], lidar).items():
            (folder / name).write_text(toml_from_calibration(calibration), encoding="utf-8")
        write_json(folder / "manifest.json", _manifest(request, kept))
        write_json(folder / "run.json", {"schema": 1, "command": "simulate boards", "seed": request.seed})
    return kept


def captures(request: BoardRequest, robot: Robot, unit: Unit, *, each: int = _HELD_NS // _EVERY_NS) -> Iterator[Held]:
    """Every picture with its scan: so many of each pose, half a second apart.

    Raises:
        SimulationError: no pose fits, or no OpenGL works.
    """
    board, setup = request.board, request.scenario.lidar
    rngs = {name: np.random.default_rng([request.seed, k]) for k, name in enumerate(("poses", "lidar", "camera"))}
    plate = board.plate_corners
    size = np.ptp(plate, axis=0)[:2]
    look = "the board"
    world = board_room((float(size[0]), float(size[1])), look)
    printed = Surface(board_picture(board), shine=0.0)
    wardrobe = Wardrobe(world, request.scenario.looks, request.seed, own={look: printed})
    T_map_base = upright(-1.5, 0.0, 0.0)
    T_lidar = T_map_base @ robot.frames[robot.lidar_frame(setup.frame)] @ _leaning(setup)
    T_base_lidar = np.linalg.inv(T_map_base) @ T_lidar
    held = held_boards(rngs["poses"], request.poses, plate, unit, T_map_base, T_base_lidar, rings=request.rings)
    T_map_optical = T_map_base @ unit.T_base_true
    T_board_body = np.eye(4)
    T_board_body[:3, 3] = plate.mean(axis=0)
    behind_m = BEHIND_M if request.rings is None else BEHIND_IN_CLOUDS_M
    scene = Scene(world)
    with contextlib.closing(Studio(wardrobe, fine=_FINE)) as studio:
        for number, T_map_board in enumerate(held):
            bodies = {BOARD: T_map_board @ T_board_body, STAND: stand_under(T_map_board, plate, behind_m)}
            scene.place(bodies)
            studio.place(bodies)
            for k in range(each):
                stamp_ns = START_NS + number * _HELD_NS + k * _EVERY_NS
                scan = _scan(rngs["lidar"], request, scene, stamp_ns, T_lidar, robot.lidar_frame(setup.frame))
                image = photograph(rngs["camera"], studio, unit, [T_map_optical])
                yield Held(stamp_ns, image, scan, np.linalg.inv(T_map_optical) @ T_map_board)


def _scan(
    rng: np.random.Generator, request: BoardRequest, scene: Scene, stamp_ns: int, T: Float64Array, frame: str
) -> Scan | PointCloud:
    scanner = request.scenario.lidar.scanner
    if request.rings is not None:
        return cloud(rng, scanner, request.rings, scene, stamp_ns, T, frame_id=frame)
    return sweep(rng, scanner, scene, stamp_ns, lambda _: T, frame_id=frame).scan


def board_picture(board: Board) -> Texture:
    """The plate's front, upright: ink where the board is black.

    Squares are a power of two pixels wide and begin where pixels do, in every size that a renderer shrinks the picture to:
    an edge within a pixel would be drawn up to a tenth of one beside its place, which at arm's length is half a
    millimetre of a board's distance.
    """
    low, high = board.plate_corners[0, :2], board.plate_corners[2, :2]
    unit = board.square_m + board.gap_m
    begin = -np.ceil(-low / unit - 1e-9)
    squares = np.ceil(high / unit - 1e-9) - begin
    side = _PX_PER_SQUARE
    while side > 8 and squares.max() * side > _MOST_PX:
        side //= 2
    width, height = (squares * side).astype(int)
    ink = np.zeros((height, width), dtype=np.float32)
    for x, y, w, h in black_rectangles(board).tolist():
        columns = _covered(width, (x / unit - begin[0]) * side, ((x + w) / unit - begin[0]) * side)
        rows = _covered(height, (y / unit - begin[1]) * side, ((y + h) / unit - begin[1]) * side)
        a, b = np.flatnonzero(rows)[[0, -1]], np.flatnonzero(columns)[[0, -1]]
        ink[a[0] : a[1] + 1, b[0] : b[1] + 1] += np.outer(rows[a[0] : a[1] + 1], columns[b[0] : b[1] + 1])
    grey = np.round(_PAPER + np.minimum(ink, 1) * (_INK - _PAPER)).astype(np.uint8)
    size = squares * unit
    left, below = low - begin * unit, (begin + squares) * unit - high
    return Texture(
        np.repeat(grey[..., None], 3, axis=2), (float(size[0]), float(size[1])), (float(left[0]), float(below[1]))
    )


def _covered(count: int, first: float, last: float) -> np.ndarray:
    """(count,) share of each pixel between two places."""
    edges = np.arange(count + 1, dtype=np.float64)
    return np.asarray(np.clip(np.minimum(edges[1:], last) - np.maximum(edges[:-1], first), 0, 1), dtype=np.float32)


# -------------------------------------------------------------------------------------------- files


def _leaning(setup: LidarSetup) -> Float64Array:
    return leaning(setup.roll_rad, setup.pitch_rad)


def _mounts(robot: Robot) -> tuple[Transform, ...]:
    return tuple(
        Transform(START_NS, robot.base, name, T, is_static=True)
        for name, T in robot.frames.items()
        if name != robot.base
    )


def _record(file: McapWriter, unit: Unit, held: Held) -> None:
    topic, stamp_ns = f"/camera/{unit.name}", held.stamp_ns
    image = CameraImage(stamp_ns, unit.frame, "png", _png(held.image))
    file.write(f"{topic}/image/compressed", image, stamp_ns)
    file.write(f"{topic}/camera_info", camera_info(unit.published, stamp_ns), stamp_ns)
    file.write("/points" if isinstance(held.scan, PointCloud) else "/scan", held.scan, stamp_ns)


def _keep(folder: Path, number: int, held: Held) -> None:
    (folder / "images" / f"pose{number:03d}.png").write_bytes(_png(held.image))
    scan, path = held.scan, folder / "scans" / f"pose{number:03d}"
    if isinstance(scan, PointCloud):
        path.with_suffix(".pcd").write_bytes(pcd_from_cloud(scan))
    else:
        np.savez(path.with_suffix(".npz"), ranges=scan.ranges_m, angles=scan.angles_rad)


def pcd_from_cloud(scan: PointCloud) -> bytes:
    """A binary PCD 0.7 of x, y, z [m] and ring."""
    count = len(scan.points_m)
    table = np.zeros(count, dtype=[("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("ring", "<u2")])
    for axis, name in enumerate("xyz"):
        table[name] = scan.points_m[:, axis]
    table["ring"] = scan.rings
    head = (
        "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z ring\nSIZE 4 4 4 2\nTYPE F F F U\nCOUNT 1 1 1 1\n"
        f"WIDTH {count}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {count}\nDATA binary\n"
    )
    return head.encode("ascii") + table.tobytes()


def _png(image: UInt8Array) -> bytes:
    import cv2

    _, data = cv2.imencode(".png", image[..., ::-1])
    return bytes(data)


def _truths(request: BoardRequest, unit: Unit, T_base_lidar: Float64Array, lidar: str) -> dict[str, Calibration]:
    note = f"exact: made by wallkit {wallkit.__version__} simulate boards, seed {request.seed}"
    T = np.linalg.inv(unit.T_base_true) @ T_base_lidar @ _leaning(request.scenario.lidar)
    origin = Provenance(command="wallkit simulate boards", notes=(note,))
    return {
        "camera.toml": Calibration(unit.true, provenance=origin),
        "truth.toml": Calibration(unit.true, T, lidar, provenance=origin),
    }


def _manifest(request: BoardRequest, kept: list[Held]) -> dict[str, object]:
    return {
        "schema": 1,
        "wallkit": wallkit.__version__,
        "seed": request.seed,
        "board": request.board.words,
        "poses": table_from(request.poses),
        "rings": table_from(request.rings) if request.rings is not None else None,
        "scenario": table_from(request.scenario),
        "T_camera_board": [held.T_camera_board.tolist() for held in kept],
    }
