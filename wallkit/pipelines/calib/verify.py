"""A calibration, a log or files, a board, perhaps a URDF -> evidence, the answers of the gates, and what to do next."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from wallkit.calib.board.boards import Board
from wallkit.calib.camera.sanity import differs, faults_of_info
from wallkit.calib.extrinsics.extrinsics import Hold
from wallkit.calib.extrinsics.lidars import sigma_range
from wallkit.calib.files.from_urdf import transform_from_urdf
from wallkit.calib.files.store import read_calibration
from wallkit.calib.verify.evidence import Evidence, evidence_of, with_pixel_error, with_sightings
from wallkit.calib.verify.gates import Gate, not_asked
from wallkit.calib.verify.limits import VerifyLimits
from wallkit.calib.verify.verify import Judgement, verify
from wallkit.core.calibration import Calibration
from wallkit.errors import CalibrationError
from wallkit.pipelines.calib.clock import with_clock
from wallkit.pipelines.calib.extrinsics import (
    ExtrinsicsRun,
    Gathered,
    SolveOptions,
    elevations_of,
    run_extrinsics,
)
from wallkit.pipelines.calib.files import PICTURES
from wallkit.pipelines.calib.request import gather, prior_from_words
from wallkit.pipelines.calib.verify_camera import boards_of_camera
from wallkit.pipelines.calib.verify_free import free_gates
from wallkit.pipelines.run_folder import sha256

_NO_BOARD = "no board was shown (--board), and the room alone does not show all axes"


@dataclass(frozen=True)
class VerifyRequest:
    """What to verify with what.

    Attributes:
        inputs: a log, pictures, folders of them or an .npz of corners. scans: folder of scans that belong to pictures.
        board: None: only what needs no board is asked.
        urdf, lidar_link, camera_link, prior: the robot, its frames (else those of the calibration), and "1deg,10mm".
        sigma_range: "15mm" or the name of a LiDAR; None: assumed.
        scan_topic, image_topic: of a log that has several.
        room: ask the room itself, too, beside the boards.
        lidar_height_m: of a planar LiDAR above the floor, for the floor line; None: not asked.
    """

    inputs: tuple[Path, ...]
    calibration: Path
    board: Board | None = None
    scans: Path | None = None
    urdf: Path | None = None
    lidar_link: str = ""
    camera_link: str = ""
    prior: str = "1deg,10mm"
    sigma_range: str | None = None
    scan_topic: str | None = None
    image_topic: str | None = None
    lidar_height_m: float | None = None
    room: bool = False
    seed: int = 0


@dataclass(frozen=True, eq=False)
class Verification:
    """The whole result.

    Attributes:
        calibration: as it was read. notes: what a user must know, a sentence each.
        run: the fresh solve; None without boards that both saw. left_out: (name, why) of pictures that were not used.
        looked_at: pictures or moments.
    """

    request: VerifyRequest
    calibration: Calibration
    evidence: Evidence
    judgement: Judgement
    limits: VerifyLimits
    notes: tuple[str, ...]
    run: ExtrinsicsRun | None
    left_out: tuple[tuple[str, str], ...]
    looked_at: int

    @property
    def is_camera_alone(self) -> bool:
        """Whether only pictures of a board were shown."""
        return self.request.board is not None and _is_camera_alone(self.request)

    def stored(self) -> Calibration:
        """The calibration with its verdict and pixel errors, as `--write` stores it."""
        made = self.calibration.provenance
        said = [note for note in made.notes if not note.startswith("verify: ")]
        said += [
            f"verify: {gate.verdict}: {gate.name}: {gate.reason}"
            for _, gate in self.judgement.gates
            if gate.verdict in ("FAIL", "CANNOT TELL")
        ]
        table = self.evidence.pixel_error if self.calibration.T_camera_lidar is not None else None
        return replace(
            self.calibration,
            verdict=self.judgement.verdict,
            pixel_error_95=table if table is not None else self.calibration.pixel_error_95,
            provenance=replace(made, notes=tuple(said)),
        )


def verify_calibration(
    request: VerifyRequest,
    *,
    limits: VerifyLimits | None = None,
    progress: Callable[[int], None] = lambda done: None,
) -> Verification:
    """Find the boards, solve without the calibration's help, and ask every gate.

    Raises:
        CalibrationError, LogError: an input that cannot be read, or nothing in it that could tell anything.
    """
    limits = limits or VerifyLimits()
    calibration = read_calibration(request.calibration)
    sigma_m, source = sigma_range(request.sigma_range)
    urdf, said = _urdf(request, calibration)
    evidence = evidence_of(calibration, sigma_range_m=sigma_m, sigma_source=source, urdf=urdf)
    notes = list(said)
    if source == "assumed" and request.board is not None and not _is_camera_alone(request):
        notes.insert(0, f"--lidar-sigma was not given: {sigma_m * 1e3:.0f} mm is assumed")
    run: ExtrinsicsRun | None = None
    left_out: list[tuple[str, str]] = []
    looked_at = 0
    if request.board is None:
        gates, looked_at, is_planar = free_gates(request, calibration, progress)
        evidence = replace(evidence, target_free=gates, why_no_fresh=_NO_BOARD)
        if evidence.elevations is None and is_planar:
            evidence = with_pixel_error(replace(evidence, elevations=np.zeros(2)))
    elif _is_camera_alone(request):
        evidence, left_out, looked_at = boards_of_camera(
            evidence, request.inputs, request.board, request.image_topic, progress
        )
    else:
        topics = (request.scan_topic, request.image_topic)
        gathered = gather(
            request.inputs, request.scans, request.board, request.calibration, topics=topics, done=progress
        )
        evidence, run, left_out = _with_boards(evidence, gathered, request)
        looked_at = gathered.looked_at
        notes += gathered.notes
        if request.room:
            evidence = replace(evidence, target_free=_told(free_gates(request, calibration, progress)[0]))
    evidence, said = _with_sanity(evidence, request)
    notes += said
    judgement = verify(evidence, limits)
    return Verification(
        request, calibration, evidence, judgement, limits, tuple(notes), run, tuple(left_out), looked_at
    )


def is_files(inputs: Sequence[Path]) -> bool:
    """Whether the inputs are pictures, folders of them, or corners, rather than a log."""
    first = inputs[0]
    if first.is_dir():
        return any(p.suffix.lower() in PICTURES for p in first.iterdir())
    return first.suffix.lower() in (*PICTURES, ".npz")


# ------------------------------------------------------------------------------------------------ details


def _told(gates: Sequence[Gate]) -> tuple[Gate, ...]:
    """What the room contradicts or supports; where it shows nothing, boards are asked anyhow."""
    return tuple(not_asked(g.name, g.reason) if g.verdict == "CANNOT TELL" else g for g in gates)


def _is_camera_alone(request: VerifyRequest) -> bool:
    return request.scans is None and is_files(request.inputs)


def _with_boards(
    evidence: Evidence, gathered: Gathered, request: VerifyRequest
) -> tuple[Evidence, ExtrinsicsRun | None, list[tuple[str, str]]]:
    boards = tuple((pair.name, pair.pose) for pair in gathered.pairs)
    evidence = replace(evidence, boards=boards)
    if evidence.elevations is None and gathered.pairs:
        evidence = replace(evidence, elevations=elevations_of(gathered.pairs))
    left_out = [(item.name, item.why) for item in gathered.left_out]
    guess = evidence.place if evidence.place is not None else evidence.urdf.T if evidence.urdf else None
    options = SolveOptions(evidence.sigma_range_m, evidence.sigma_source, guess, None, "auto", request.seed)
    try:
        run, clock_found = with_clock(run_extrinsics(gathered, options))
    except CalibrationError as error:
        return replace(evidence, why_no_fresh=error.message), None, left_out
    clock = None
    if clock_found is not None and clock_found.verdict == "known":
        clock = (clock_found.tau_s - evidence.calibration.time_offset_ns * 1e-9, clock_found.sigma_s)
    board = gathered.board
    is_own, is_whole = _is_own(evidence.calibration, gathered, request.calibration)
    evidence = with_sightings(
        replace(evidence, square_m=board.square_m, clock=clock, clock_words=clock_found.words if clock_found else ""),
        run.sightings,
        run.result,
        is_own=is_own,
        is_whole=is_whole,
        scale=run.scale,
        plate_corners=board.plate_corners if board.plate_m is not None else None,
    )
    left_out += [(item.name, item.why) for item in run.left_out if (item.name, item.why) not in left_out]
    return evidence, run, left_out


def _is_own(calibration: Calibration, gathered: Gathered, calibration_file: Path) -> tuple[bool, bool]:
    """Whether one of the files is among those that the calibration says it was made from, and whether nearly all are."""
    known = set(calibration.provenance.inputs.values())
    files = [path for path in gathered.files if path != calibration_file and path.is_file()]
    shared = {digest for path in files if (digest := sha256(path)) in known}
    return bool(shared), len(shared) > 0.9 * (len(known) - 1)


def _urdf(request: VerifyRequest, calibration: Calibration) -> tuple[Hold | None, list[str]]:
    if request.urdf is None:
        return None, []
    lidar, camera = request.lidar_link or calibration.lidar_frame, request.camera_link or calibration.camera_frame
    if not lidar or not camera:
        hint = "give --lidar LINK and --camera-frame LINK"
        raise CalibrationError("the calibration does not name its frames", where=request.calibration, hint=hint)
    found = transform_from_urdf(request.urdf, lidar, camera)
    turn, shift = prior_from_words(request.prior)
    return Hold(found.T, turn, shift), list(found.warnings)


def _with_sanity(evidence: Evidence, request: VerifyRequest) -> tuple[Evidence, list[str]]:
    """Faults of the log's camera_info; of files there is none but the calibration, which was checked when it was read."""
    from wallkit.logs.reader import open_log

    if is_files(request.inputs):
        return replace(evidence, faults=()), []
    infos = open_log(list(request.inputs)).static.camera_infos
    camera = evidence.calibration.camera
    near = {t: i for t, i in infos.items() if request.image_topic is None or _stem(t) == _stem(request.image_topic)}
    if not near:
        return evidence, []
    faults: list[str] = []
    notes: list[str] = []
    for info in list(near.values())[:1]:
        faults += faults_of_info(info, camera.width, camera.height)
        said = differs(info, camera)
        notes += [said] if said else []
    return replace(evidence, faults=tuple(faults)), notes


def _stem(topic: str) -> str:
    return topic.rsplit("/", 1)[0]


def next_step(found: Verification) -> str:
    """What to do now, by the worst answer."""
    worst = found.judgement.worst
    key = next((name for name, gate in found.judgement.gates if gate is worst), "")
    if worst is None:
        return "use it: wallkit calib verify --write stores the verdict with the calibration"
    advice = found.run.advice if found.run is not None else None
    count = len(found.evidence.kept)
    if key in ("views", "observability", "sigma", "pixel-error", "urdf") and worst.verdict == "CANNOT TELL" and advice:
        more = f" ({found.limits.views - count} more views at least)" if count < found.limits.views else ""
        return f"{advice.words}{more}, record, and run wallkit calib extrinsics again"
    return _NEXT.get(key, "record the board in 12 or more poses and verify with --board")


_NEXT = {
    "sanity": "correct the camera_info, or publish the one of `wallkit calib convert`",
    "intrinsics": "run wallkit calib intrinsics on pictures of this camera in this mode, then extrinsics",
    "plane": "run wallkit calib extrinsics on this log and verify its result on another",
    "worst-view": "look at the overlay of that view: did the board or the robot move?",
    "inliers": "look at the views named: hold the board still, flat, and alone before the LiDAR",
    "reprojection": "run wallkit calib extrinsics on this log and verify its result on another",
    "mean": "measure a wall with a tape: do the LiDAR's ranges read long or short?",
    "trend": "measure a row of squares, and a wall with a tape, before anything else",
    "refit": "run wallkit calib intrinsics on these pictures",
    "halves": "look whether the LiDAR or the camera is loose, fasten it, and record again",
    "boards": "run wallkit calib extrinsics on this log: something moved since",
    "square-size": "measure a row of squares with a ruler and correct --board",
    "time-offset": "store the offset with the calibration, or synchronise the clocks",
    "urdf": "look at the axis named on the robot; wallkit calib from-urdf writes the calibration into the URDF",
    "views": "show the board in 12 or more poses, tilted to all sides",
    "hull": "move the board over the whole image",
    "focal": "tilt the board more, and bring it closer",
}


def verdict_meaning(found: Verification) -> str:
    """The verdict in a sentence."""
    verdict = found.judgement.verdict
    if verdict == "PASS":
        return "the data supports the calibration"
    if verdict == "FAIL":
        return "the data contradicts the calibration"
    return "nothing contradicts the calibration, but the data does not show that it is good"


def pixel_words(found: Verification, px: float) -> str:
    """What the pixel error means for a wall point."""
    if not np.isfinite(px):
        return f"how far a wall point at {found.limits.reference_m:g} m may be off in the picture is not known"
    return f"a wall point at {found.limits.reference_m:g} m may be {px:.1f} px off in the picture (95 %)"
