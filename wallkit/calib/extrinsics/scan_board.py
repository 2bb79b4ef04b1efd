"""A planar scan and where the camera saw the board -> the returns that are on the board."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wallkit.calib.extrinsics.planar import PLANAR
from wallkit.calib.extrinsics.rigid import rotation_from_vector
from wallkit.calib.extrinsics.sightings import BoardPose, Sighting, plane_sighting, problem_from_sightings
from wallkit.calib.extrinsics.solver import fit
from wallkit.calib.extrinsics.worlds import UPRIGHT
from wallkit.core.types import Float64Array, Int64Array, Scan

FEWEST = 8
NEAR_PLANE_M = 0.25
LINE_M = 0.02
_YAWS = 24
_ROUNDS = 4
# headings are tried on so many of the scans
_TRIED = 24


@dataclass(frozen=True, eq=False)
class Returns:
    """The returns of one scan that may be used, in the order of the beams.

    Attributes:
        points_m: (K, 3) in the LiDAR frame, z = 0. ranges_m: (K,). step_rad: between two beams.
        offsets_s: (K,) after the stamp. dropped: why returns were left out, and how many.
    """

    points_m: Float64Array
    ranges_m: Float64Array
    step_rad: float
    offsets_s: Float64Array
    dropped: dict[str, int]


@dataclass(frozen=True, eq=False)
class Trace:
    """Returns on the board, or why there are none: points_m (K, 3), length and RMS about their line [m]."""

    points_m: Float64Array
    length_m: float
    rms_m: float
    why: str = ""
    offsets_s: Float64Array | None = None


def returns_of(scan: Scan) -> Returns:
    """The returns of a scan: no NaN, no inf, within the driver's limits, and no mixed pixel."""
    ranges, angles = np.asarray(scan.ranges_m, np.float64), np.asarray(scan.angles_rad, np.float64)
    offsets = np.arange(len(ranges), dtype=np.float64) * scan.beam_interval_s
    if scan.offsets_s is not None:
        offsets = np.asarray(scan.offsets_s, dtype=np.float64)
    with np.errstate(invalid="ignore"):
        seen = np.isfinite(ranges) & (ranges > max(scan.range_min_m, 1e-3)) & (ranges <= scan.range_max_m)
    points = np.column_stack([ranges * np.cos(angles), ranges * np.sin(angles), np.zeros(len(ranges))])[seen]
    step = float(np.median(np.abs(np.diff(angles)))) if len(angles) > 1 else 0.01
    return returns_of_points(points, step_rad=step, offsets_s=offsets[seen], unseen=int((~seen).sum()))


def returns_of_points(
    points_m: Float64Array, *, step_rad: float | None = None, offsets_s: Float64Array | None = None, unseen: int = 0
) -> Returns:
    """The same of points (K, 3) of a planar scan, in the order of their bearing; points at the origin are no returns."""
    points = np.asarray(points_m, dtype=np.float64)[:, :3]
    ranges = np.linalg.norm(points, axis=1)
    kept = np.isfinite(ranges) & (ranges > 1e-3)
    offsets = np.zeros(len(points)) if offsets_s is None else offsets_s
    bearings = np.arctan2(points[:, 1], points[:, 0])
    order = np.argsort(bearings[kept], kind="stable")
    points, ranges, offsets, bearings = (a[kept][order] for a in (points, ranges, offsets, bearings))
    if step_rad is None:
        step_rad = float(np.median(np.diff(bearings))) if len(bearings) > 1 else 0.01
    mixed = np.zeros(len(ranges), dtype=bool)
    # a beam split by an edge reports a point between the two surfaces: both neighbours are far from it and each other
    before, after = ranges[:-2], ranges[2:]
    middle = ranges[1:-1]
    mixed[1:-1] = (
        (np.abs(after - before) > 0.1 * middle)
        & (np.abs(middle - before) > 0.03 * middle)
        & (np.abs(middle - after) > 0.03 * middle)
    )
    dropped = {"no return": unseen + int((~kept).sum()), "mixed pixel": int(mixed.sum())}
    return Returns(points[~mixed], ranges[~mixed], step_rad, offsets[~mixed], dropped)


def find_trace(
    returns: Returns,
    board: BoardPose,
    plate_corners: Float64Array,
    T: Float64Array,
    *,
    sigma_range_m: float,
    plate_is_known: bool = True,
    near_m: float = NEAR_PLANE_M,
    margin_rad: float = np.radians(5.0),
) -> Trace:
    """The returns on the board, near where a transform predicts them.

    Args:
        plate_corners: (4, 3) of the plate in the board frame. T: (4, 4) T_camera_lidar, roughly.
        plate_is_known: whether the corners are the plate's; else only the pattern's, and the line may be longer.
        near_m: how far a return may be from the predicted plane. margin_rad: and from its ends.
    """
    chord = _chord(np.linalg.inv(T) @ board.T_camera_board, plate_corners)
    if chord is None:
        return _none("the scan plane passes above or below the board")
    points = returns.points_m
    middle = np.arctan2(*chord.mean(axis=0)[1::-1])
    bearings = _wrapped(np.arctan2(points[:, 1], points[:, 0]) - middle)
    ends = _wrapped(np.arctan2(chord[:, 1], chord[:, 0]) - middle)
    off = (points @ T[:3, :3].T + T[:3, 3]) @ board.normal - board.distance_m
    near = (bearings > ends.min() - margin_rad) & (bearings < ends.max() + margin_rad) & (np.abs(off) < near_m)
    run = _longest_run(points, np.flatnonzero(near), returns.step_rad, sigma_range_m)
    length = float(np.linalg.norm(chord[1] - chord[0]))
    longest = 1.2 * length + 0.02 if plate_is_known else np.inf
    return _judged(returns, _on_a_line(points, run, sigma_range_m), length, longest, sigma_range_m)


def traces_without_guess(
    returns: Sequence[Returns],
    boards: Sequence[BoardPose],
    plate_corners: Float64Array,
    *,
    sigma_range_m: float,
    plate_is_known: bool = True,
) -> tuple[list[Trace], Float64Array | None]:
    """The board in every scan when nothing is known but that the scan plane is level and near the camera.

    Every heading of the LiDAR, upright and upside down, is tried: boards found with it move it to where they fit, and it is
    scored by how many are found and how well they agree.

    Returns:
        A trace a scan, and (4, 4) T_camera_lidar; None where no heading finds three boards.
    """
    few = np.unique(np.linspace(0, len(returns) - 1, min(_TRIED, len(returns))).astype(int))
    some, theirs = [returns[i] for i in few], [boards[i] for i in few]
    best: tuple[float, Float64Array | None] = (-np.inf, None)
    for flip in (0.0, np.pi):
        for yaw in np.arange(_YAWS) * 2 * np.pi / _YAWS:
            T = np.eye(4)
            T[:3, :3] = UPRIGHT @ rotation_from_vector([flip, 0.0, 0.0]) @ rotation_from_vector([0.0, 0.0, yaw])
            score, _, found = _tried(some, theirs, plate_corners, T, sigma_range_m, plate_is_known)
            if score > best[0] + 1e-9:
                best = score, found
    if best[1] is None:
        return [_none("no heading of the LiDAR finds it")] * len(returns), None
    _, traces, T_found = _tried(returns, boards, plate_corners, best[1], sigma_range_m, plate_is_known)
    return traces, T_found


# ------------------------------------------------------------------------------------------------ details


def _tried(
    returns: Sequence[Returns],
    boards: Sequence[BoardPose],
    plate: Float64Array,
    T: Float64Array,
    sigma_m: float,
    known: bool,
) -> tuple[float, list[Trace], Float64Array | None]:
    """Score, traces and transform of one heading."""
    traces: list[Trace] = []
    near, margin = 0.4, np.radians(15.0)
    for _ in range(_ROUNDS):
        traces = [
            find_trace(r, b, plate, T, sigma_range_m=sigma_m, plate_is_known=known, near_m=near, margin_rad=margin)
            for r, b in zip(returns, boards, strict=True)
        ]
        found = [
            plane_sighting("", b, t.points_m, sigma_m=sigma_m, planar_scan=True)
            for t, b in zip(traces, boards, strict=True)
            if not t.why
        ]
        if len(found) < min(3, len(returns)):
            return -np.inf, traces, None
        placement = fit(problem_from_sightings(found), T, basis=PLANAR, rounds=2)
        T, near, margin = placement.T, NEAR_PLANE_M, np.radians(5.0)
    misfit = np.minimum(placement.misfit, 20.0)
    return float(len(found) - 0.04 * misfit.sum()), traces, T


def sighting_of_trace(
    name: str, board: BoardPose, trace: Trace, *, sigma_range_m: float, stamp_ns: int = 0
) -> Sighting:
    """The pair that the solver takes."""
    return plane_sighting(name, board, trace.points_m, sigma_m=sigma_range_m, planar_scan=True, stamp_ns=stamp_ns)


def _chord(T_lidar_board: Float64Array, plate: Float64Array) -> Float64Array | None:
    """(2, 2) ends of the plate's cut with the plane z = 0 of the LiDAR; None where it does not reach it."""
    corners = plate @ T_lidar_board[:3, :3].T + T_lidar_board[:3, 3]
    ends = []
    for p, q in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        if (p[2] > 0) != (q[2] > 0):
            ends.append((p + (q - p) * p[2] / (p[2] - q[2]))[:2])
    return np.array(ends) if len(ends) == 2 else None


def _longest_run(points: Float64Array, chosen: Int64Array, step_rad: float, sigma_m: float) -> Int64Array:
    """Indices of the longest run without a gap wider than 6 cm or three beams, beyond what noise tears apart."""
    if len(chosen) < 2:
        return chosen
    gaps = np.linalg.norm(np.diff(points[chosen], axis=0), axis=1)
    # two ranges differ by sqrt(2) sigma; with a hundred beams on a board some pair does by five times that
    limit = np.maximum(0.06, 3 * np.linalg.norm(points[chosen[1:]], axis=1) * step_rad) + 5 * np.sqrt(2) * sigma_m
    runs = np.split(chosen, np.flatnonzero(gaps > limit) + 1)
    return max(runs, key=len)


def _on_a_line(points: Float64Array, run: Int64Array, sigma_m: float) -> Int64Array:
    """Of a run those on the line that most of them share, every pair being tried; refitted to all of them.

    On it is within 2 cm, or three sigmas: a narrower strip throws good returns away.
    """
    if len(run) < FEWEST:
        return run
    xy, strip = points[run, :2], max(LINE_M, 3 * sigma_m)
    i, j = np.triu_indices(len(xy), k=max(2, len(xy) // 4))
    if len(i) > 4000:
        i, j = i[:: len(i) // 4000 + 1], j[:: len(j) // 4000 + 1]
    along = xy[j] - xy[i]
    normals = np.column_stack([-along[:, 1], along[:, 0]]) / np.linalg.norm(along, axis=1, keepdims=True)
    off = np.abs(xy @ normals.T - (xy[i] * normals).sum(axis=1))
    kept = off[:, int((off < strip).sum(axis=0).argmax())] < strip
    for _ in range(3):
        middle = xy[kept].mean(axis=0)
        normal = np.linalg.svd(xy[kept] - middle, full_matrices=False)[2][1]
        kept = np.abs((xy - middle) @ normal) < strip
    return np.asarray(run[kept])


def _judged(returns: Returns, run: Int64Array, chord_m: float, longest_m: float, sigma_m: float) -> Trace:
    if len(run) < FEWEST:
        return _none(f"{len(run)} returns where the board should be; {FEWEST} is the least")
    points = returns.points_m[run]
    middle = points.mean(axis=0)
    _, _, axes = np.linalg.svd(points - middle, full_matrices=False)
    length = float(np.ptp((points - middle) @ axes[0]))
    rms = float(np.sqrt((((points - middle) @ axes[1]) ** 2).mean()))
    why = ""
    if not 0.5 * chord_m <= length <= longest_m:
        why = f"the line there is {length:.2f} m long, the board's cut {chord_m:.2f} m"
    elif rms > 3 * sigma_m:
        limit = f"three times the declared {sigma_m * 1e3:.0f} mm is the limit"
        why = f"the returns scatter {rms * 1e3:.0f} mm about their line, {limit}"
    return Trace(points, length, rms, why, returns.offsets_s[run])


def _none(why: str) -> Trace:
    return Trace(np.zeros((0, 3)), 0.0, 0.0, why)


def _wrapped(angles: Float64Array) -> Float64Array:
    return (angles + np.pi) % (2 * np.pi) - np.pi
