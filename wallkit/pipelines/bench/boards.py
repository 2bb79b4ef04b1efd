"""Seeds -> simulated captures of a board, calibrated as a user would, and how often the truth lies in what is reported.

`calib.coverage` draws views with errors of its own making; here everything is in play: the renderer, the lens, corner
detection, the search for the board in scans, and the solver.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from wallkit.calib.board.boards import Board
from wallkit.calib.board.detect import find_corners
from wallkit.calib.board.pose import AMBIGUOUS, pose_of_board
from wallkit.calib.extrinsics.covariance import quantiles
from wallkit.calib.extrinsics.scan_board import returns_of
from wallkit.calib.extrinsics.solver import difference
from wallkit.core.config import build, source_from_words
from wallkit.core.types import Float64Array, PointCloud
from wallkit.pipelines.calib.extrinsics import ExtrinsicsRun, Gathered, LeftOut, Pair, SolveOptions, run_extrinsics
from wallkit.pipelines.simulate.boards import BoardRequest, Held, captures
from wallkit.pipelines.simulate.units import unit_of
from wallkit.simulate.board_room import BoardPoses
from wallkit.simulate.camera import Unit
from wallkit.simulate.robot import DEFAULT_ROBOT, robot_from_urdf
from wallkit.simulate.scanner import Rings
from wallkit.simulate.scenario import CameraSetup, Scenario

LEVEL = 0.95
_SIGMA_M = 0.01


@dataclass(frozen=True, eq=False)
class Recovery:
    """One capture and what calibration made of it.

    Attributes:
        used, held: poses that decided, and that were shown. kind: as of `Extrinsics`.
        off: (6,) signed error of roll, pitch, yaw [rad], forward, left, height [m]. sigma, half_width: (6,) as reported.
        rms_px, bias_px: of the corners about where the truth projects them: sqrt(mean(du^2 + dv^2)), and the longer of
            the mean's two components.
    """

    seed: int
    held: int
    used: int
    kind: str
    off: Float64Array
    sigma: Float64Array
    half_width: Float64Array
    rms_px: float
    bias_px: float

    @property
    def covered(self) -> np.ndarray:
        """(6,) whether each unknown lies in its interval."""
        return np.abs(self.off) <= self.half_width


def recoveries(
    board: Board,
    seeds: Sequence[int],
    *,
    poses: int = 20,
    rings: Rings | None = None,
    robot_path: Path = DEFAULT_ROBOT,
    words: Sequence[str] = (),
) -> Iterator[Recovery]:
    """One after another, with the true intrinsics.

    Args:
        rings: of a 3-D LiDAR; None: a planar one. words: of the scenario, as `--set` takes them.

    Raises:
        SimulationError: no OpenGL works, or no pose fits. CalibrationError: a capture has no answer.
    """
    scenario = build(Scenario, [source_from_words(words)])[0]
    setup = (scenario.cameras or (CameraSetup(),))[0]
    robot = robot_from_urdf(robot_path)
    unit, lidar = unit_of(robot, setup), robot.lidar_frame(scenario.lidar.frame)
    T = np.linalg.inv(unit.T_base_true) @ robot.frames[lidar]
    for seed in seeds:
        request = BoardRequest(board, scenario, BoardPoses(poses), rings, robot_path, seed)
        shown = list(captures(request, robot, unit, each=1))
        run, off_px = _calibrated(board, unit, lidar, shown)
        yield _recovery(seed, run, T, len(shown), off_px)


def _calibrated(board: Board, unit: Unit, lidar: str, shown: Sequence[Held]) -> tuple[ExtrinsicsRun, Float64Array]:
    """The answer, and (n, 2) how far the corners of all pictures are from where the truth projects them [px]."""
    import cv2

    pairs, left_out, off = [], [], []
    for number, held in enumerate(shown):
        name = f"pose{number:03d}"
        found = find_corners(np.asarray(cv2.cvtColor(held.image, cv2.COLOR_RGB2GRAY), dtype=np.uint8), board)
        if found is None:
            left_out.append(LeftOut(name, "no board in the picture"))
            continue
        points, truth = board.object_points[found.ids], held.T_camera_board
        off.append(found.pixels - unit.true.project(points @ truth[:3, :3].T + truth[:3, 3]))
        pose = pose_of_board(unit.true, points, found.pixels, name=name)
        if pose.ambiguity < AMBIGUOUS:
            left_out.append(LeftOut(name, "the board may be tilted either way"))
        elif isinstance(held.scan, PointCloud):
            pairs.append(Pair(name, pose, None, held.scan.points_m.astype(np.float64), held.scan.rings))
        else:
            pairs.append(Pair(name, pose, returns_of(held.scan), np.zeros((0, 3))))
    gathered = Gathered(unit.true, None, board, tuple(pairs), len(shown), tuple(left_out), (), lidar)
    run = run_extrinsics(gathered, SolveOptions(_SIGMA_M, "of the simulated LiDAR"))
    return run, np.concatenate(off)


def _recovery(seed: int, run: ExtrinsicsRun, T: Float64Array, held: int, off_px: Float64Array) -> Recovery:
    result = run.result
    nan = np.full(6, np.nan)
    width = nan
    if result.spread is not None and result.kind == "full":
        width = result.sigmas * quantiles(result.spread.degrees, LEVEL)
    return Recovery(
        seed=seed,
        held=held,
        used=sum(result.used),
        kind=result.kind,
        off=difference(T, result.T),
        sigma=result.sigmas,
        half_width=width,
        rms_px=float(np.sqrt((off_px**2).sum(axis=1).mean())),
        bias_px=float(np.abs(off_px.mean(axis=0)).max()),
    )


def joined(found: Sequence[Recovery]) -> Recovery:
    """All captures in one row: sums of poses, RMS of errors and sigmas; its half widths say nothing."""
    rms = {
        name: np.sqrt(np.mean([getattr(r, name) ** 2 for r in found], axis=0)) for name in ("off", "sigma", "rms_px")
    }
    return replace(
        found[0],
        held=sum(r.held for r in found),
        used=sum(r.used for r in found),
        half_width=np.full(6, np.nan),
        bias_px=float(np.mean([r.bias_px for r in found])),
        **rms,
    )
