"""The sample's scenario -> the calibration of its camera, from simulated boards, judged by other boards."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from wallkit.calib.board.boards import Board
from wallkit.calib.files.store import toml_from_calibration
from wallkit.errors import CalibrationError
from wallkit.pipelines.calib.captures import CaptureRequest
from wallkit.pipelines.calib.extrinsics import run_extrinsics
from wallkit.pipelines.calib.intrinsics import calibrate_camera
from wallkit.pipelines.calib.request import gather, options_from_words, provenance
from wallkit.pipelines.calib.verify import VerifyRequest, verify_calibration
from wallkit.pipelines.simulate.boards import BoardRequest, simulate_boards
from wallkit.simulate.board_room import BoardPoses
from wallkit.simulate.robot import robot_from_urdf
from wallkit.simulate.scenario import Scenario

# a chessboard on a plate of 61 x 85 cm
BOARD = Board("chessboard", 5, 7, 0.095, plate_m=(0.61, 0.85))
LENS = BoardPoses(count=80, near_m=0.5, far_m=1.4, anywhere=True)
PLACE = BoardPoses(count=300, near_m=0.9, far_m=2.0)
# the plane crosses most of the plate: near a corner the ends of its returns say little about where they are drawn
JUDGE = BoardPoses(count=60, near_m=1.0, far_m=2.0, tilt_deg=35.0, cut=0.6)


def write_calibration(out: Path, scenario: Scenario, scratch: Path) -> None:
    """camera.toml: lens and place of the scenario's first camera, as `wallkit calib` finds and judges them.

    Raises:
        SimulationError: no OpenGL works. CalibrationError: the boards do not tell where the LiDAR is.
    """
    lens, place, judge = (
        _capture(scenario, poses, scratch / name, seed)
        for seed, (name, poses) in enumerate({"lens": LENS, "place": PLACE, "judge": JUDGE}.items(), start=1)
    )
    (setup, *_), robot = scenario.cameras, robot_from_urdf()
    frame = next(frame for frame in robot.optical_frames if setup.name in frame)
    camera = scratch / "lens.toml"
    found = calibrate_camera(CaptureRequest((lens,), BOARD), name=setup.name, frame=frame)
    camera.write_text(toml_from_calibration(found.calibration), encoding="utf-8")

    sigma = f"{1e3 * scenario.lidar.scanner.sigma_m:g}mm"
    options, _ = options_from_words(
        sigma_range=sigma, urdf=None, lidar=None, camera=None, hold=False, prior="1deg,10mm", sides="auto", seed=0
    )
    gathered = gather((place,), None, BOARD, camera)
    run = run_extrinsics(gathered, options)
    made = run.calibration(provenance(gathered, "make sample"))
    if made is None:
        raise CalibrationError("the boards do not tell where the LiDAR is", where=place, hint="more poses")
    made = replace(made, lidar_frame=made.lidar_frame or robot.lidar_frame(scenario.lidar.frame))
    out.write_text(toml_from_calibration(made), encoding="utf-8")

    judged = verify_calibration(VerifyRequest((judge,), out, BOARD, sigma_range=sigma))
    out.write_text(toml_from_calibration(judged.stored()), encoding="utf-8")


def _capture(scenario: Scenario, poses: BoardPoses, out: Path, seed: int) -> Path:
    """The log of a board shown in so many poses."""
    simulate_boards(BoardRequest(BOARD, scenario, poses, seed=seed), out)
    return out / "log.mcap"
