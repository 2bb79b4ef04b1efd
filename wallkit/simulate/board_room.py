"""A board, a seed and two sensors -> where it is held, so that the camera sees all of it and the LiDAR cuts it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wallkit.core.config import setting
from wallkit.core.types import Float64Array
from wallkit.errors import SimulationError
from wallkit.simulate.camera import Unit
from wallkit.simulate.scanner import Rings
from wallkit.simulate.world import MAP, Body, Solid, World, upright

BOARD, STAND = "board", "stand"
_THICK_M = 0.008
_TRIES = 1500
_FEWEST_RINGS = 4
# how far behind the plate its post is: hidden by it from a planar LiDAR, as good as always; apart from it in a cloud
BEHIND_M, BEHIND_IN_CLOUDS_M = 0.08, 0.35
_ROOM_M, _HEIGHT_M = 8.0, 2.8


@dataclass(frozen=True)
class BoardPoses:
    """How the board is shown."""

    count: int = setting(20, "poses", low=3, high=500)
    near_m: float = setting(0.7, "nearest to the camera", low=0.1)
    far_m: float = setting(2.2, "farthest from it", low=0.2)
    tilt_deg: float = setting(45.0, "most that it is tilted away from facing the camera", low=5, high=75)
    margin_px: float = setting(12.0, "its plate stays so far inside the picture", low=0)
    cut: float = setting(
        0.35, "share of the plate's longer side that the LiDAR's plane must cross at least", low=0, high=1
    )
    anywhere: bool = setting(False, "for the camera alone: the LiDAR need not see the plate")


def board_room(size_m: tuple[float, float], look: str) -> World:
    """An empty room with a plate on a stand: both are bodies that can be put anywhere.

    The plate's front (+x of its solid) is what shows; its body frame is the middle of the front with x right, y down and
    z into the plate.
    """
    width, height = size_m
    T = np.eye(4)
    # the solid's x out of the front, its y to the right as the viewer sees it, its z up
    T[:3, :3] = np.array([[0, 1, 0], [0, 0, -1], [-1, 0, 0]], dtype=np.float64)
    T[:3, 3] = (0.0, 0.0, _THICK_M / 2)
    half = _ROOM_M / 2
    walls = [
        Solid(f"wall_{k}", "wall", "box", (_ROOM_M + 0.2, 0.1, _HEIGHT_M), upright(x, y, yaw, _HEIGHT_M / 2))
        for k, (x, y, yaw) in enumerate(
            [(0, -half - 0.05, 0), (0, half + 0.05, 0), (-half - 0.05, 0, np.pi / 2), (half + 0.05, 0, np.pi / 2)]
        )
    ]
    slab = (_ROOM_M + 0.2, _ROOM_M + 0.2, 0.1)
    solids = (
        *walls,
        Solid("floor", "floor", "box", slab, upright(0, 0, 0, -0.05), MAP),
        Solid("ceiling", "ceiling", "box", slab, upright(0, 0, 0, _HEIGHT_M + 0.05), MAP),
        Solid("board", "board", "box", (_THICK_M, width, height), T, BOARD, look=look),
        Solid("stand", "stand", "cylinder", (0.02, 1.6), upright(0, 0, 0, -0.8), STAND),
        Solid("stand", "stand", "cylinder", (0.18, 0.02), upright(0, 0, 0, -1.6), STAND),
    )
    return World("boards", solids, (Body(BOARD), Body(STAND)), (), _HEIGHT_M, "the board room")


def held_boards(
    rng: np.random.Generator,
    poses: BoardPoses,
    plate: Float64Array,
    unit: Unit,
    T_map_base: Float64Array,
    T_base_lidar: Float64Array,
    *,
    rings: Rings | None = None,
) -> tuple[Float64Array, ...]:
    """T_map_board (4, 4) of every pose.

    Args:
        plate: (4, 3) corners in the board's frame, z = 0.
        rings: of a 3-D LiDAR, of which four must meet the plate; None: of a planar one, whose plane must cut it.

    Raises:
        SimulationError: no pose is found that the camera sees whole and the LiDAR cuts.
    """
    T_map_optical = T_map_base @ unit.T_base_true
    T_lidar_map = np.linalg.inv(T_map_base @ T_base_lidar)
    middle = plate.mean(axis=0)
    found: list[Float64Array] = []
    for _ in range(_TRIES * poses.count):
        T_optical_board = _held(rng, poses, unit, middle)
        T_lidar_board = T_lidar_map @ T_map_optical @ T_optical_board
        if _is_seen(T_optical_board, plate, unit, poses.margin_px) and (
            poses.anywhere
            or (_is_cut(T_lidar_board, plate, poses.cut) if rings is None else _is_swept(T_lidar_board, plate, rings))
        ):
            T_map_board = T_map_optical @ T_optical_board
            heights = (plate @ T_map_board[:3, :3].T + T_map_board[:3, 3])[:, 2]
            if heights.min() > 0.05 and heights.max() < _HEIGHT_M:
                found.append(T_map_board)
        if len(found) == poses.count:
            return tuple(found)
    raise SimulationError(
        f"{len(found)} of {poses.count} poses found that camera '{unit.name}' sees whole and the LiDAR cuts",
        hint="a smaller or larger board, other near_m and far_m, or --anywhere for the camera alone",
    )


def stand_under(T_map_board: Float64Array, plate: Float64Array, behind_m: float = BEHIND_M) -> Float64Array:
    """T_map_stand (4, 4): a post behind all of the plate, as high as its middle, so that it hides nothing of it."""
    corners = plate @ T_map_board[:3, :3].T + T_map_board[:3, 3]
    middle = corners.mean(axis=0)
    away = T_map_board[:2, 2] / max(float(np.hypot(*T_map_board[:2, 2])), 1e-9)
    depth = float(((corners - middle)[:, :2] @ away).max()) + behind_m
    x, y = middle[:2] + depth * away
    return upright(float(x), float(y), 0.0, float(middle[2]))


def _held(rng: np.random.Generator, poses: BoardPoses, unit: Unit, middle: Float64Array) -> Float64Array:
    """T_optical_board of a plate somewhere in the picture, tilted to any side, turned in its plane a little."""
    from scipy.spatial.transform import Rotation

    pixel = rng.uniform((0, 0), (unit.true.width, unit.true.height))
    ray = unit.true.unproject(pixel)
    distance = rng.uniform(poses.near_m, poses.far_m)
    turn = Rotation.from_euler("z", rng.normal(0, 12), degrees=True)
    about = rng.uniform(0, 2 * np.pi)
    tilt = np.deg2rad(poses.tilt_deg) * np.sqrt(rng.uniform(0.02, 1))
    R = (Rotation.from_rotvec(tilt * np.array([np.cos(about), np.sin(about), 0])) * turn).as_matrix()
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, ray * distance - R @ middle
    return T


def _is_seen(T_optical_board: Float64Array, plate: Float64Array, unit: Unit, margin_px: float) -> bool:
    """Whether the whole plate, its edges too, is well inside the picture, from the front."""
    along = np.linspace(0, 1, 9)[:, None]
    edges = np.concatenate([a + along * (b - a) for a, b in zip(plate, np.roll(plate, -1, axis=0), strict=True)])
    points = edges @ T_optical_board[:3, :3].T + T_optical_board[:3, 3]
    if not np.isfinite(points).all() or T_optical_board[:3, 2] @ points.mean(axis=0) <= 0:
        return False
    pixels = unit.true.project(points)
    size = np.array([unit.true.width, unit.true.height]) - 1
    return bool(np.isfinite(pixels).all() and (pixels > margin_px).all() and (pixels < size - margin_px).all())


def _is_cut(T_lidar_board: Float64Array, plate: Float64Array, share: float) -> bool:
    """Whether the plane z = 0 of the LiDAR crosses the plate along enough of it."""
    corners = plate @ T_lidar_board[:3, :3].T + T_lidar_board[:3, 3]
    crossings = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        if (a[2] > 0) != (b[2] > 0):
            crossings.append(a + a[2] / (a[2] - b[2]) * (b - a))
    if len(crossings) != 2:
        return False
    longest = float(np.linalg.norm(plate[0] - plate[1:], axis=1)[[0, 2]].max())
    return float(np.linalg.norm(crossings[0] - crossings[1])) >= share * longest


def _is_swept(T_lidar_board: Float64Array, plate: Float64Array, rings: Rings) -> bool:
    """Whether four rings of a 3-D LiDAR meet the plate, or look past its corners."""
    corners = plate @ T_lidar_board[:3, :3].T + T_lidar_board[:3, 3]
    elevations = np.arctan2(corners[:, 2], np.hypot(corners[:, 0], corners[:, 1]))
    inside = (rings.elevations_rad > elevations.min()) & (rings.elevations_rad < elevations.max())
    return bool(inside.sum() >= _FEWEST_RINGS)
