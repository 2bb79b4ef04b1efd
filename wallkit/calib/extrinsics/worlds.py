"""Boards drawn before a known LiDAR and camera -> views with known noise: for coverage tables, advice and tests."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wallkit.calib.extrinsics.rigid import rotation_from_vector, skew
from wallkit.calib.extrinsics.sightings import BoardPose, Sighting, plane_sighting
from wallkit.core.types import Float64Array

# LiDAR x forward, y left, z up -> camera x right, y down, z forward
UPRIGHT = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])


@dataclass(frozen=True)
class World:
    """A camera, a LiDAR and a board; the defaults are a cheap robot's.

    Attributes:
        is_planar: a 2-D LiDAR of one ring; else of `rings` between -/+ `ring_span_deg` degrees.
        excess: how many times larger the board poses err than their covariance says.
        board_m: (width, height) of the plate; pattern_m: of its corners. corners: how many along each.
    """

    is_planar: bool = True
    sigma_range_m: float = 0.010
    sigma_px: float = 0.3
    focal_px: float = 600.0
    beam_deg: float = 0.5
    rings: int = 16
    ring_span_deg: float = 15.0
    board_m: tuple[float, float] = (0.8, 0.6)
    pattern_m: tuple[float, float] = (0.6, 0.42)
    corners: tuple[int, int] = (9, 6)
    tilt_deg: float = 40.0
    excess: float = 1.0

    @property
    def directions(self) -> Float64Array:
        """(B, 3) unit vectors of the beams in the LiDAR frame."""
        azimuth = np.radians(np.arange(-70.0, 70.0, self.beam_deg))
        if self.is_planar:
            elevation = np.zeros(1)
        else:
            elevation = np.radians(np.linspace(-self.ring_span_deg, self.ring_span_deg, self.rings))
        az, el = (grid.ravel() for grid in np.meshgrid(azimuth, elevation))
        return np.column_stack([np.cos(el) * np.cos(az), np.cos(el) * np.sin(az), np.sin(el)])


def mounting(rng: np.random.Generator) -> Float64Array:
    """(4, 4) T_camera_lidar of a robot put together by hand: upright within some degrees and centimetres."""
    T = np.eye(4)
    T[:3, :3] = UPRIGHT @ rotation_from_vector(rng.normal(0, np.radians(5), 3))
    T[:3, 3] = rng.normal((0.0, 0.08, -0.05), 0.03)
    return T


def draw_sightings(rng: np.random.Generator, world: World, T: Float64Array, count: int) -> tuple[Sighting, ...]:
    """Views of boards held at random where both see them: range noise on every beam, and one error of the pose per board."""
    views: list[Sighting] = []
    while len(views) < count:
        view = sighting_of(world, T, _held_board(rng, world), rng=rng, name=f"view {len(views) + 1}")
        if view is not None:
            views.append(view)
    return tuple(views)


def sighting_of(
    world: World,
    T: Float64Array,
    T_camera_board: Float64Array,
    *,
    rng: np.random.Generator | None = None,
    name: str = "",
) -> Sighting | None:
    """The view of one board, without noise when there is no generator; None when fewer than 8 beams meet the plate."""
    points = hits(world, T, T_camera_board, rng)
    if len(points) < 8 or (
        not world.is_planar and np.linalg.svd(points - points.mean(0), full_matrices=False)[1][1] < 0.1
    ):
        return None
    covariance = pose_covariance(world, T_camera_board)
    measured = T_camera_board
    if rng is not None:
        error = world.excess * np.linalg.cholesky(covariance) @ rng.normal(size=6)
        measured = T_camera_board.copy()
        measured[:3, :3] = rotation_from_vector(error[:3]) @ T_camera_board[:3, :3]
        measured[:3, 3] += error[3:]
    board = BoardPose(measured, covariance, rms_px=world.sigma_px * np.sqrt(2))
    return plane_sighting(name, board, points, sigma_m=world.sigma_range_m, planar_scan=world.is_planar)


def hits(world: World, T: Float64Array, T_camera_board: Float64Array, rng: np.random.Generator | None) -> Float64Array:
    """(K, 3) points of the beams that meet the plate, in the LiDAR frame."""
    T_lidar_board = np.linalg.inv(T) @ T_camera_board
    normal, middle = T_lidar_board[:3, 2], T_lidar_board[:3, 3]
    beams = world.directions
    along = beams @ normal
    with np.errstate(divide="ignore", invalid="ignore"):
        ranges = (normal @ middle) / along
    on_board = (beams * ranges[:, None] - middle) @ T_lidar_board[:3, :2]
    met = (ranges > 0.1) & (np.abs(on_board) <= np.array(world.board_m) / 2).all(axis=1)
    noise = 0.0 if rng is None else rng.normal(0, world.sigma_range_m, int(met.sum()))
    return beams[met] * (ranges[met] + noise)[:, None]


def pose_covariance(world: World, T_camera_board: Float64Array) -> Float64Array:
    """(6, 6) of a board pose from corners with `sigma_px` each: (J'J)^-1 sigma^2 of a pinhole."""
    x, y = (np.linspace(-side / 2, side / 2, n) for side, n in zip(world.pattern_m, world.corners, strict=True))
    grid = np.stack(np.meshgrid(x, y, [0.0]), axis=-1).reshape(-1, 3) @ T_camera_board[:3, :3].T
    seen = grid + T_camera_board[:3, 3]
    z = seen[:, 2]
    zero = np.zeros_like(z)
    by_point = np.stack([[1 / z, zero, -seen[:, 0] / z**2], [zero, 1 / z, -seen[:, 1] / z**2]]).transpose(2, 0, 1)
    by_motion = np.concatenate([-skew(grid), np.tile(np.eye(3), (len(grid), 1, 1))], axis=2)
    rows = (world.focal_px * by_point @ by_motion).reshape(-1, 6)
    return np.linalg.inv(rows.T @ rows) * world.sigma_px**2


def board_at(
    x_m: float, y_m: float, z_m: float, *, pitch_deg: float, yaw_deg: float, roll_deg: float = 0.0
) -> Float64Array:
    """(4, 4) T_camera_board of a board in front of the camera: pitched about its width, yawed about its height, rolled."""
    T = np.eye(4)
    turns = [(0, pitch_deg), (1, yaw_deg), (2, roll_deg)]
    for axis, angle in turns[::-1]:
        T[:3, :3] = rotation_from_vector(np.eye(3)[axis] * np.radians(angle)) @ T[:3, :3]
    T[:3, 3] = x_m, y_m, z_m
    return T


def _held_board(rng: np.random.Generator, world: World) -> Float64Array:
    z = rng.uniform(0.8, 3.0)
    pitch, yaw, roll = rng.uniform(-world.tilt_deg, world.tilt_deg, 3)
    x, y = rng.uniform(-0.4, 0.4) * z, rng.uniform(-0.12, 0.22)
    return board_at(x, y, z, pitch_deg=pitch, yaw_deg=yaw, roll_deg=roll)
