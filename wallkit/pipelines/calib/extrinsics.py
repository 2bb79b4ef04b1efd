"""Boards in pictures and the scans that belong to them -> where the LiDAR is to the camera, and all a user must know."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from wallkit.calib.board.boards import Board
from wallkit.calib.extrinsics.advice import Advice, next_pose
from wallkit.calib.extrinsics.audits import Audit, range_bias, square_size
from wallkit.calib.extrinsics.cloud_board import find_patch, side_faces
from wallkit.calib.extrinsics.extrinsics import Extrinsics, Hold, plane_rms_mm, solve
from wallkit.calib.extrinsics.pixel_error import pixel_error_95
from wallkit.calib.extrinsics.scan_board import Returns, find_trace, sighting_of_trace, traces_without_guess
from wallkit.calib.extrinsics.sightings import BoardPose, Sighting, plane_sighting, problem_from_sightings
from wallkit.calib.extrinsics.worlds import World
from wallkit.core.calibration import Calibration, Provenance
from wallkit.core.camera import Camera
from wallkit.core.types import Float64Array, Int64Array
from wallkit.errors import CalibrationError

# a guess that finds fewer of the boards than this is not believed
_TRUSTED_SHARE = 0.6
# nearer returns are the robot itself
_NEAREST_M = 0.3


@dataclass(frozen=True, eq=False)
class Pair:
    """What both sensors saw of one board pose, before the board is looked for in the scan.

    Attributes:
        pose: of the board, from its corners.
        returns: of a planar scan; or None, and then points_m (N, 3) and rings of a cloud.
    """

    name: str
    pose: BoardPose
    returns: Returns | None
    points_m: Float64Array
    rings: Int64Array | None = None
    stamp_ns: int = 0


@dataclass(frozen=True)
class LeftOut:
    """A picture or scan that did not make it to the solver, and why."""

    name: str
    why: str


@dataclass(frozen=True)
class LogSource:
    """A log that was gathered from: its files, topics, and the stretches (begin, end) [ns] in which the board moved."""

    paths: tuple[Path, ...]
    scans: str
    images: str
    moving: tuple[tuple[int, int], ...]


@dataclass(frozen=True, eq=False)
class Gathered:
    """What the inputs hold.

    Attributes:
        camera, camera_covariance: intrinsics. looked_at: how many pictures or moments there were.
        files: that were read, for the provenance. log: where they are a log.
    """

    camera: Camera
    camera_covariance: Float64Array | None
    board: Board
    pairs: tuple[Pair, ...]
    looked_at: int
    left_out: tuple[LeftOut, ...]
    files: tuple[Path, ...]
    lidar_frame: str = ""
    time_offset_ns: int = 0
    time_offset_sigma_ns: float | None = None
    notes: tuple[str, ...] = ()
    log: LogSource | None = None


@dataclass(frozen=True)
class SolveOptions:
    """How to solve.

    Attributes:
        sigma_range_m: of the LiDAR; sigma_source: "declared", "assumed" or the data sheet.
        sides: of a plate in a cloud: "always", "never", or "auto": when planes alone leave a direction that is not OBSERVED.
    """

    sigma_range_m: float
    sigma_source: str
    guess: Float64Array | None = None
    hold: Hold | None = None
    sides: str = "auto"
    seed: int = 0


@dataclass(frozen=True, eq=False)
class ExtrinsicsRun:
    """The whole result.

    Attributes:
        sightings: in the order of result.views. scale, bias: audits; bias None where nobody could tell.
        advice: the best next pose, None when there is none. pixel_error: (R, 2), None without a covariance.
    """

    gathered: Gathered
    options: SolveOptions
    sightings: tuple[Sighting, ...]
    result: Extrinsics
    left_out: tuple[LeftOut, ...]
    scale: Audit
    bias: Audit | None
    advice: Advice | None
    pixel_error: Float64Array | None
    is_planar: bool

    @property
    def plane_rms_mm(self) -> float:
        """Of the points of the views that were used."""
        return plane_rms_mm(self.result.views)

    def calibration(self, provenance: Provenance) -> Calibration | None:
        """What is stored; None when six degrees of freedom are not known."""
        if self.result.covariance is None:
            return None
        return Calibration(
            camera=self.gathered.camera,
            T_camera_lidar=self.result.T,
            lidar_frame=self.gathered.lidar_frame,
            covariance=self.result.covariance,
            degrees=self.result.degrees,
            elevations=elevations_of(self.gathered.pairs),
            camera_covariance=self.gathered.camera_covariance,
            time_offset_ns=self.gathered.time_offset_ns,
            time_offset_sigma_ns=self.gathered.time_offset_sigma_ns,
            pixel_error_95=self.pixel_error,
            provenance=provenance,
        )


def run_extrinsics(gathered: Gathered, options: SolveOptions) -> ExtrinsicsRun:
    """Find the board in every scan, solve, audit, and say what to do next.

    Raises:
        CalibrationError: no board in enough of the scans.
    """
    if not gathered.pairs:
        why = f"; first: {gathered.left_out[0].name}: {gathered.left_out[0].why}" if gathered.left_out else ""
        hint = "check --board, and that pictures and scans belong together"
        raise CalibrationError(f"no picture with a board and a scan among {gathered.looked_at}{why}", hint=hint)
    is_planar = gathered.pairs[0].returns is not None
    if any((pair.returns is not None) != is_planar for pair in gathered.pairs):
        raise CalibrationError("some scans are planar and some are clouds", hint="calibrate one LiDAR at a time")
    find = _planar_sightings if is_planar else _cloud_sightings
    sightings, missed = find(gathered, options)
    if len(sightings) < 3 and missed:
        reasons = "; ".join(sorted({m.why for m in missed})[:3])
        hint = (
            "is the board in the scan plane, and is --sigma-range right?"
            if is_planar
            else "is plate_m of the board right?"
        )
        raise CalibrationError(
            f"the board was found in {len(sightings)} of {len(gathered.pairs)} scans: {reasons}", hint=hint
        )
    result = solve(sightings, guess=options.guess, hold=options.hold, seed=options.seed)
    # returns at an edge bleed outward by half a beam's spot, so the sides only help where the planes say too little
    is_weak = any(d.sight != "OBSERVED" for d in result.observability.directions)
    if not is_planar and (options.sides == "always" or (options.sides == "auto" and is_weak)):
        sightings = _with_sides(sightings, gathered, result.T, options)
        result = solve(sightings, guess=result.T, hold=options.hold, seed=options.seed)
    pixel_error = None
    if result.covariance is not None:
        pixel_error = pixel_error_95(
            gathered.camera,
            result.T,
            result.covariance,
            degrees=result.degrees,
            camera_covariance=gathered.camera_covariance,
            elevations=elevations_of(gathered.pairs),
        )
    return ExtrinsicsRun(
        gathered=gathered,
        options=options,
        sightings=tuple(sightings),
        result=result,
        left_out=(*gathered.left_out, *missed),
        scale=square_size(result, sightings, square_m=gathered.board.square_m),
        bias=range_bias(result, sightings),
        advice=_advice(gathered, options, sightings, result, is_planar=is_planar),
        pixel_error=pixel_error if pixel_error is not None and len(pixel_error) else None,
        is_planar=is_planar,
    )


# ------------------------------------------------------------------------------------------------ details


def _planar_sightings(gathered: Gathered, options: SolveOptions) -> tuple[list[Sighting], list[LeftOut]]:
    plate, known = outline_of(gathered.board)
    returns = [pair.returns for pair in gathered.pairs if pair.returns is not None]
    poses = [pair.pose for pair in gathered.pairs]
    sigma = options.sigma_range_m
    traces = []
    if options.guess is not None:
        traces = [
            find_trace(r, p, plate, options.guess, sigma_range_m=sigma, plate_is_known=known)
            for r, p in zip(returns, poses, strict=True)
        ]
    if sum(not trace.why for trace in traces) < _TRUSTED_SHARE * len(poses):
        # without a guess, or with one that must be wrong
        blind, _ = traces_without_guess(returns, poses, plate, sigma_range_m=sigma, plate_is_known=known)
        if sum(not t.why for t in blind) >= sum(not t.why for t in traces):
            traces = blind
    found = [
        sighting_of_trace(pair.name, pair.pose, trace, sigma_range_m=sigma, stamp_ns=pair.stamp_ns)
        for pair, trace in zip(gathered.pairs, traces, strict=True)
        if not trace.why
    ]
    missed = [LeftOut(p.name, t.why) for p, t in zip(gathered.pairs, traces, strict=True) if t.why]
    return found, missed


def _cloud_sightings(gathered: Gathered, options: SolveOptions) -> tuple[list[Sighting], list[LeftOut]]:
    plate, _ = outline_of(gathered.board)
    size = np.ptp(plate[:, :2], axis=0)
    found, missed = [], []
    for pair in gathered.pairs:
        guess = (pair.pose, plate, options.guess) if options.guess is not None else None
        patch = find_patch(pair.points_m, size, rings=pair.rings, guess=guess, seed=options.seed)
        if patch.why:
            missed.append(LeftOut(pair.name, patch.why))
            continue
        found.append(
            plane_sighting(
                pair.name,
                pair.pose,
                patch.points_m,
                sigma_m=options.sigma_range_m,
                planar_scan=False,
                stamp_ns=pair.stamp_ns,
            )
        )
    return found, missed


def _with_sides(
    sightings: Sequence[Sighting], gathered: Gathered, T: Float64Array, options: SolveOptions
) -> list[Sighting]:
    plate, known = outline_of(gathered.board)
    if not known:
        return list(sightings)
    size = np.ptp(plate[:, :2], axis=0)
    pairs = {pair.name: pair for pair in gathered.pairs}
    out = []
    for sighting in sightings:
        pair = pairs[sighting.name]
        guess = (pair.pose, plate, options.guess) if options.guess is not None else None
        patch = find_patch(pair.points_m, size, rings=pair.rings, guess=guess, seed=options.seed)
        out.append(replace(sighting, faces=(sighting.faces[0], *side_faces(patch, sighting.board, plate, T))))
    return out


def elevations_of(pairs: Sequence[Pair]) -> Float64Array:
    """(2,) [rad] lowest and highest return above the LiDAR's xy plane: 0 0 of a planar one, else as the clouds show it."""
    if pairs[0].returns is not None:
        return np.zeros(2)
    points = np.concatenate([pair.points_m[:, :3] for pair in pairs])
    far = np.linalg.norm(points, axis=1) > _NEAREST_M
    above = np.arctan2(points[far, 2], np.hypot(points[far, 0], points[far, 1]))
    return np.array([above.min(), above.max()]) if len(above) else np.array([-np.pi / 2, np.pi / 2])


def outline_of(board: Board) -> tuple[Float64Array, bool]:
    """(4, 3) corners of the plate in the board frame, and whether they were declared; else those of the pattern."""
    if board.plate_m is not None:
        return board.plate_corners, True
    low, high = board.pattern_box
    corners = np.array([(low[0], low[1], 0), (high[0], low[1], 0), (high[0], high[1], 0), (low[0], high[1], 0)])
    return corners.astype(np.float64), False


def _advice(
    gathered: Gathered, options: SolveOptions, sightings: Sequence[Sighting], result: Extrinsics, *, is_planar: bool
) -> Advice | None:
    size = np.ptp(outline_of(gathered.board)[0][:, :2], axis=0)
    pattern = np.ptp(gathered.board.object_points[:, :2], axis=0)
    columns, rows = gathered.board.grid
    world = World(
        is_planar=is_planar,
        sigma_range_m=options.sigma_range_m,
        sigma_px=max(0.1, float(np.median([s.board.rms_px for s in sightings])) / np.sqrt(2)),
        focal_px=float(gathered.camera.K[0, 0]),
        board_m=(float(size[0]), float(size[1])),
        pattern_m=(float(pattern[0]), float(pattern[1])),
        corners=(columns, rows),
    )
    used = [s for s, use in zip(sightings, result.used, strict=True) if use]
    return next_pose(problem_from_sightings(used), result.T, result.observability, world)
