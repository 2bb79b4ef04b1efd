"""A 3-D cloud -> the points on the board, with and without a guess of where it is, and the sides of its plate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wallkit.calib.extrinsics.scan_board import Trace
from wallkit.calib.extrinsics.sightings import BoardPose, Face
from wallkit.core.types import BoolArray, Float64Array, Int64Array, PointCloud

FEWEST = 30
PLANE_M = 0.03
NEAR_M = 0.25
VOXEL_M = 0.02
SIDE_TOLERANCE = 0.08
# what bleeds outward at an edge is half a beam's spot: the plane carries the solution, the sides help
SIDE_SIGMA_M = 0.03
_TRIALS = 300
_CLUSTER_M = 0.16
_SMALLEST_SHARE = 0.4
# more returns of one sweep say nothing more about a clock
_MOST = 100


@dataclass(frozen=True, eq=False)
class Patch:
    """Points on the board, or why there are none.

    Attributes:
        points_m: (K, 3) in the LiDAR frame. rings: (K,) of them, or None. rms_m: about their plane.
        size_m: (2,) long and short side of the smallest rectangle around them.
    """

    points_m: Float64Array
    rings: Int64Array | None
    rms_m: float
    size_m: Float64Array
    why: str = ""


def find_patch(
    points_m: Float64Array,
    plate_size_m: Float64Array,
    *,
    rings: Int64Array | None = None,
    guess: tuple[BoardPose, Float64Array, Float64Array] | None = None,
    seed: int = 0,
) -> Patch:
    """The board in a cloud.

    Args:
        points_m: (N, 3) in the LiDAR frame; a cloud that was cut out around the board, or the whole room.
        plate_size_m: (2,) width and height of the plate.
        guess: (board pose, (4, 3) plate corners in the board frame, (4, 4) T_camera_lidar): look only near there.
    """
    points = np.asarray(points_m, dtype=np.float64)[:, :3]
    index = np.flatnonzero(np.isfinite(points).all(axis=1) & (np.linalg.norm(points, axis=1) > 1e-3))
    if guess is not None:
        index = index[_near(points[index], *guess)]
    rng = np.random.default_rng(seed)
    best = _none(rings, f"no plane of {plate_size_m[0]:.2f} x {plate_size_m[1]:.2f} m stands alone in the cloud")
    longest, closest = np.sort(np.asarray(plate_size_m))[::-1], np.inf
    for group in _groups(points, index, longest):
        kept = group[_plane(points[group], rng)]
        if len(kept) < FEWEST:
            continue
        size, rms = _extent(points[kept])
        fits = (size <= longest * (1 + SIDE_TOLERANCE) + 0.05).all() and (size >= longest * _SMALLEST_SHARE).all()
        misfit = float(np.abs(size / longest - 1).max())
        if fits and misfit < closest:
            best, closest = Patch(points[kept], None if rings is None else rings[kept], rms, size), misfit
    return best


def returns_on_plate(cloud: PointCloud, board: BoardPose, plate: Float64Array, T: Float64Array) -> Trace:
    """The returns well within the plate and near its plane, a hundred of them at most, with their times after the stamp.

    Args:
        plate: (4, 3) corners of the plate in the board frame. T: (4, 4) T_camera_lidar.
    """
    to_board = np.linalg.inv(board.T_camera_board) @ T
    with np.errstate(invalid="ignore"):
        seen = cloud.points_m.astype(np.float64) @ to_board[:3, :3].T + to_board[:3, 3]
        low, high = plate[:, :2].min(axis=0) + SIDE_SIGMA_M, plate[:, :2].max(axis=0) - SIDE_SIGMA_M
        on = ((seen[:, :2] > low) & (seen[:, :2] < high)).all(axis=1) & (np.abs(seen[:, 2]) < NEAR_M)
    index = np.flatnonzero(on)
    if len(index) >= FEWEST:
        index = index[np.abs(seen[index, 2] - np.median(seen[index, 2])) < 2 * PLANE_M]
    if len(index) < FEWEST:
        return Trace(np.zeros((0, 3)), 0.0, 0.0, "fewer than 30 returns on the plate")
    few = index[np.unique(np.linspace(0, len(index) - 1, min(_MOST, len(index))).round().astype(int))]
    offsets = np.zeros(len(few)) if cloud.offsets_s is None else cloud.offsets_s[few].astype(np.float64)
    rms = float(np.sqrt(np.mean((seen[few, 2] - seen[few, 2].mean()) ** 2)))
    return Trace(cloud.points_m[few].astype(np.float64), 0.0, rms, offsets_s=offsets)


def side_faces(patch: Patch, board: BoardPose, plate: Float64Array, T: Float64Array) -> tuple[Face, ...]:
    """The plate's sides with the outermost returns of every ring on them; those a transform shows to be near one side only.

    Args:
        plate: (4, 3) corners of the plate in the board frame. T: (4, 4) T_camera_lidar of the plane alone.
    """
    if patch.rings is None:
        return ()
    ends = _ring_ends(patch.points_m, patch.rings)
    T_board_lidar = np.linalg.inv(board.T_camera_board) @ T
    on_board = ends @ T_board_lidar[:3, :3].T + T_board_lidar[:3, 3]
    low, high = plate[:, :2].min(axis=0), plate[:, :2].max(axis=0)
    faces = []
    distances = np.stack(
        [on_board[:, 0] - low[0], high[0] - on_board[:, 0], on_board[:, 1] - low[1], high[1] - on_board[:, 1]]
    )
    nearest = np.abs(distances).argmin(axis=0)
    second = np.sort(np.abs(distances), axis=0)[1]
    for side, (axis, offset) in enumerate([(0, low[0]), (0, high[0]), (1, low[1]), (1, high[1])]):
        mine = (nearest == side) & (np.abs(distances[side]) < 0.08) & (second > 0.08)
        if mine.sum() >= 3:
            normal = np.zeros(3)
            normal[axis] = 1.0
            faces.append(Face(normal, float(offset), ends[mine], SIDE_SIGMA_M, 1))
    return tuple(faces)


# ------------------------------------------------------------------------------------------------ details


def _near(points: Float64Array, board: BoardPose, plate: Float64Array, T: Float64Array) -> BoolArray:
    T_board_lidar = np.linalg.inv(board.T_camera_board) @ T
    on_board = points @ T_board_lidar[:3, :3].T + T_board_lidar[:3, 3]
    low, high = plate[:, :2].min(axis=0) - 0.1, plate[:, :2].max(axis=0) + 0.1
    inside = (on_board[:, :2] >= low).all(axis=1) & (on_board[:, :2] <= high).all(axis=1)
    return np.asarray(inside & (np.abs(on_board[:, 2]) < NEAR_M))


def _groups(points: Float64Array, index: Int64Array, longest: Float64Array) -> list[Int64Array]:
    """Indices of things that stand apart and are no larger than a plate held by someone; the whole of a cut-out cloud."""
    if len(index) < FEWEST:
        return []
    if np.linalg.norm(np.ptp(points[index], axis=0)) < 1.6 * np.linalg.norm(longest):
        return [index]
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    cells, owner = np.unique(np.floor(points[index] / VOXEL_M).astype(np.int64), axis=0, return_inverse=True)
    tree = cKDTree((cells + 0.5) * VOXEL_M)
    pairs = tree.query_pairs(_CLUSTER_M, output_type="ndarray")
    graph = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(cells), len(cells)))
    _, label = connected_components(graph, directed=False)
    of_point = label[owner.ravel()]
    sizes = np.bincount(of_point)
    return [index[of_point == which] for which in np.flatnonzero(sizes >= FEWEST)]


def _plane(points: Float64Array, rng: np.random.Generator) -> BoolArray:
    """Mask of the points on the plane that most of them share (RANSAC 3 cm), refitted to all of them."""
    triples = points[rng.integers(0, len(points), (_TRIALS, 3))]
    normals = np.cross(triples[:, 1] - triples[:, 0], triples[:, 2] - triples[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    normals, anchors = normals[lengths > 1e-6] / lengths[lengths > 1e-6, None], triples[lengths > 1e-6, 0]
    if not len(normals):
        return np.zeros(len(points), dtype=bool)
    off = np.abs(points @ normals.T - (anchors * normals).sum(axis=1))
    kept = off[:, int((off < PLANE_M).sum(axis=0).argmax())] < PLANE_M
    for _ in range(5):
        middle = points[kept].mean(axis=0)
        normal = np.linalg.svd(points[kept] - middle, full_matrices=False)[2][2]
        kept = np.abs((points - middle) @ normal) < PLANE_M
    return np.asarray(kept)


def _extent(points: Float64Array) -> tuple[Float64Array, float]:
    """Sides, the longer first, of the smallest rectangle around points in their plane, and the RMS about it."""
    import cv2

    middle = points.mean(axis=0)
    _, spread, axes = np.linalg.svd(points - middle, full_matrices=False)
    flat = np.ascontiguousarray((points - middle) @ axes[:2].T, dtype=np.float32)
    _, size, _ = cv2.minAreaRect(flat)
    return np.sort(np.array(size, dtype=np.float64))[::-1], float(spread[2] / np.sqrt(len(points)))


def _ring_ends(points: Float64Array, rings: Int64Array) -> Float64Array:
    """(2R, 3) first and last return of every ring by bearing."""
    bearing = np.arctan2(points[:, 1], points[:, 0])
    middle = np.arctan2(np.sin(bearing).mean(), np.cos(bearing).mean())
    bearing = (bearing - middle + np.pi) % (2 * np.pi) - np.pi
    ends = []
    for ring in np.unique(rings):
        mine = np.flatnonzero(rings == ring)
        if len(mine) >= 4:
            ends += [mine[bearing[mine].argmin()], mine[bearing[mine].argmax()]]
    return np.asarray(points[ends])


def _none(rings: Int64Array | None, why: str) -> Patch:
    return Patch(np.zeros((0, 3)), None if rings is None else np.zeros(0, np.int64), 0.0, np.zeros(2), why)
