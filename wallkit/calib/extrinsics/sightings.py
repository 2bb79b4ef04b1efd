"""What one board pose tells about the transform: LiDAR points that lie on faces of a board the camera has measured.

Everything the solvers need has one form, whatever the LiDAR: a point p of the LiDAR lies on a plane a'x = b known in the
camera frame, a'(R p + t) = b (Zhang and Pless, IROS 2004, eq. 4). The plane of the board itself, the sides of its plate, and
a corner (three planes) are all faces.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from wallkit.core.types import BoolArray, Float64Array

_TINY = 1e-9


@dataclass(frozen=True, eq=False)
class BoardPose:
    """Where a camera saw a board.

    Attributes:
        T_camera_board: (4, 4); the board's z axis is its normal, its origin the middle of the pattern.
        covariance: (6, 6) in (w_x w_y w_z t_x t_y t_z) [rad, m]: R <- Exp(w) R, t <- t + dt, camera frame.
        rms_px: reprojection error of the corners, sqrt(mean(du^2 + dv^2)).
        ambiguity: reprojection error of the second solution over the first; below 1.5 nobody can tell which is right.
    """

    T_camera_board: Float64Array
    covariance: Float64Array
    rms_px: float = 0.0
    ambiguity: float = np.inf

    @property
    def normal(self) -> Float64Array:
        """(3,) unit normal in the camera frame, away from the camera."""
        n = self.T_camera_board[:3, 2]
        return n if n @ self.T_camera_board[:3, 3] >= 0 else -n

    @property
    def distance_m(self) -> float:
        """From the camera to the board's plane; not negative."""
        return float(self.normal @ self.T_camera_board[:3, 3])

    def scaled(self, kappa: float) -> BoardPose:
        """The same picture of a board whose squares are kappa times as large."""
        T = self.T_camera_board.copy()
        T[:3, 3] *= kappa
        return replace(self, T_camera_board=T)


@dataclass(frozen=True, eq=False)
class Face:
    """LiDAR points on one plane that is fixed to the board.

    Attributes:
        normal: (3,) unit, and offset_m: the plane normal'x = offset in the board frame; (0, 0, 1), 0 is the board itself.
        points_m: (K, 3) in the LiDAR frame. sigma_m: of a point along the normal, before the incidence is counted.
        directions: how many independent directions the points span on the face: 2 for an area, 1 for a line.
    """

    normal: Float64Array
    offset_m: float
    points_m: Float64Array
    sigma_m: float
    directions: int

    @cached_property
    def moments(self) -> Float64Array:
        """(1 + directions, 4) rows (p, w): the points as few weighted points that say the same about the transform.

        The sum over the points of (a'(R p + t) - b)^2 / sigma^2 equals that over these rows with a'(R p + w t) - w b, but
        for the part that is the noise of the points off their own best plane or line, which no transform can change.
        """
        count = len(self.points_m)
        middle = self.points_m.mean(axis=0)
        _, spread, axes = np.linalg.svd(self.points_m - middle, full_matrices=False)
        rows = np.zeros((1 + self.directions, 4))
        rows[0] = np.sqrt(count) * np.append(middle, 1.0)
        kept = min(self.directions, len(spread))
        rows[1 : 1 + kept, :3] = spread[:kept, None] * axes[:kept]
        return rows / self.sigma_m

    @property
    def thickness_m(self) -> float:
        """RMS distance of the points from their own best plane (an area) or line in the plane they span (a line)."""
        _, spread, _ = np.linalg.svd(self.points_m - self.points_m.mean(axis=0), full_matrices=False)
        return float(spread[self.directions] / np.sqrt(len(self.points_m))) if len(spread) > self.directions else 0.0


@dataclass(frozen=True, eq=False)
class Sighting:
    """One board pose, seen by both.

    Attributes:
        name: of the picture, for people. stamp_ns: of the scan.
        faces: the board's plane first.
    """

    name: str
    board: BoardPose
    faces: tuple[Face, ...]
    stamp_ns: int = 0

    @property
    def points_m(self) -> Float64Array:
        """(K, 3) LiDAR points on the board's plane."""
        return self.faces[0].points_m


def plane_sighting(
    name: str,
    board: BoardPose,
    points_m: Float64Array,
    *,
    sigma_m: float,
    planar_scan: bool,
    stamp_ns: int = 0,
    sides: Sequence[Face] = (),
) -> Sighting:
    """A sighting of the board's plane, a line of a planar scan or an area of a cloud, and of sides of the plate."""
    face = Face(np.array([0.0, 0.0, 1.0]), 0.0, np.asarray(points_m, float), sigma_m, 1 if planar_scan else 2)
    return Sighting(name, board, (face, *sides), stamp_ns)


@dataclass(frozen=True, eq=False)
class Problem:
    """The views as arrays, G views of K rows (rows that a view lacks are zero and say nothing).

    Attributes:
        points (G, K, 3), weights (G, K): rows of `Face.moments` [1/m before the points' metres].
        normals (G, K, 3), offsets (G, K): planes in the camera frame.
        origins (G, 3), covariances (G, 6, 6): of the board poses.
    """

    points: Float64Array
    weights: Float64Array
    normals: Float64Array
    offsets: Float64Array
    origins: Float64Array
    covariances: Float64Array

    def __len__(self) -> int:
        return len(self.points)

    @property
    def row_counts(self) -> Float64Array:
        """(G,) rows of each view that say something."""
        return np.asarray((np.abs(self.normals).max(axis=2) > 0).sum(axis=1), dtype=np.float64)

    def of(self, which: BoolArray | Sequence[int]) -> Problem:
        """The views of these indices, or of this mask."""
        return Problem(*(getattr(self, name)[which] for name in self.__dataclass_fields__))


def problem_from_sightings(views: Sequence[Sighting]) -> Problem:
    """The views as arrays."""
    rows = max(sum(1 + face.directions for face in view.faces) for view in views)
    count = len(views)
    points, normals = np.zeros((count, rows, 3)), np.zeros((count, rows, 3))
    weights, offsets = np.zeros((count, rows)), np.zeros((count, rows))
    for g, view in enumerate(views):
        T = view.board.T_camera_board
        at = 0
        for face in view.faces:
            moments = face.moments
            here = slice(at, at + len(moments))
            a = T[:3, :3] @ face.normal
            points[g, here], weights[g, here] = moments[:, :3], moments[:, 3]
            normals[g, here], offsets[g, here] = a, a @ T[:3, 3] + face.offset_m
            at += len(moments)
    origins = np.array([view.board.T_camera_board[:3, 3] for view in views])
    return Problem(points, weights, normals, offsets, origins, np.array([view.board.covariance for view in views]))


def residuals(problem: Problem, T: Float64Array) -> Float64Array:
    """(G, K) a'(R p + w t) - w b, in sigmas of the LiDAR."""
    moved = problem.points @ T[:3, :3].T + problem.weights[..., None] * T[:3, 3]
    return np.asarray(np.einsum("gkc,gkc->gk", problem.normals, moved) - problem.weights * problem.offsets)


def jacobian(problem: Problem, T: Float64Array) -> Float64Array:
    """(G, K, 6) d residuals / d (w, dt) for R <- Exp(w) R, t <- t + dt."""
    turned = problem.points @ T[:3, :3].T
    by_turn = np.cross(turned, problem.normals)
    return np.asarray(np.concatenate([by_turn, problem.weights[..., None] * problem.normals], axis=2))


def whiteners(problem: Problem, T: Float64Array) -> Float64Array:
    """(G, K, K) that make the rows of a view independent with unit variance.

    The range error counts with the cosine of its incidence. A board that moves by (w, dt) about its origin c moves the
    residual of a point q on it by -((q - c) x a)'w - a'dt: all points of a view share that error.
    """
    turned = problem.points @ T[:3, :3].T
    away = turned + problem.weights[..., None] * (T[:3, 3] - problem.origins[:, None, :])
    shared = np.concatenate([np.cross(away, problem.normals), problem.weights[..., None] * problem.normals], axis=2)
    middle = turned[:, 0] / np.maximum(np.linalg.norm(turned[:, 0], axis=1, keepdims=True), _TINY)
    incidence = np.abs(np.einsum("gkc,gc->gk", problem.normals, middle)).clip(0.2, 1.0)
    incidence[np.abs(problem.normals).max(axis=2) == 0] = 1.0
    S = shared @ problem.covariances @ shared.transpose(0, 2, 1)
    S = S + np.eye(S.shape[1]) * (incidence**2)[:, :, None]
    return np.linalg.inv(np.linalg.cholesky(S))


def plane_distances(view: Sighting, T: Float64Array) -> Float64Array:
    """(K,) signed distance [m] of the LiDAR points from the board's plane; positive is beyond the board."""
    moved = view.points_m @ T[:3, :3].T + T[:3, 3]
    return moved @ view.board.normal - view.board.distance_m
