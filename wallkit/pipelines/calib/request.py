"""What the user typed -> inputs gathered, options of the solver, and what the result is made from."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path

from wallkit.calib.board.boards import Board
from wallkit.calib.extrinsics.extrinsics import Hold
from wallkit.calib.extrinsics.lidars import sigma_range as sigma_from_words
from wallkit.calib.files.from_urdf import transform_from_urdf
from wallkit.core.calibration import Provenance
from wallkit.errors import CalibrationError
from wallkit.pipelines.calib.extrinsics import Gathered, SolveOptions
from wallkit.pipelines.calib.files import PICTURES, gather_files
from wallkit.pipelines.provenance import digests, versions


def gather(
    inputs: Sequence[Path],
    scans: Path | None,
    board: Board,
    camera_file: Path | None,
    *,
    topics: tuple[str | None, str | None] = (None, None),
    done: Callable[[int], None] = lambda count: None,
) -> Gathered:
    """Pairs of pictures and scans, from files or from a log: whichever the inputs are.

    Raises:
        CalibrationError: files without --scans or --camera.
        LogError: a log that cannot be read.
    """
    if not _are_files(inputs) and scans is None:
        from wallkit.pipelines.calib.log import gather_log

        return gather_log(inputs, board, camera_file, scan_topic=topics[0], image_topic=topics[1], done=done)
    if scans is None:
        raise CalibrationError("pictures come without scans", where=inputs[0], hint="give --scans FOLDER")
    if camera_file is None:
        raise CalibrationError("pictures come without intrinsics", where=inputs[0], hint="give --camera FILE")
    return gather_files(inputs, scans, board, camera_file, done=done)


def options_from_words(
    *,
    sigma_range: str | None,
    urdf: Path | None,
    lidar: str | None,
    camera: str | None,
    hold: bool,
    prior: str,
    sides: str,
    seed: int,
) -> tuple[SolveOptions, tuple[str, ...]]:
    """Options, and what the user should know about them.

    Raises:
        CalibrationError: words that make no sense, or --hold without a URDF.
    """
    sigma_m, source = sigma_from_words(sigma_range)
    notes: list[str] = []
    if source == "assumed":
        notes.append(f"--sigma-range was not given: {sigma_m * 1e3:.0f} mm is assumed")
    guess = None
    if urdf is not None:
        if not lidar or not camera:
            raise CalibrationError(
                "--urdf needs the frames", where=urdf, hint="give --lidar LINK and --camera-frame LINK"
            )
        found = transform_from_urdf(urdf, lidar, camera)
        guess = found.T
        notes += found.warnings
    elif hold:
        raise CalibrationError("--hold needs a transform to hold to", hint="give --urdf, --lidar and --camera-frame")
    turn_deg, shift_mm = prior_from_words(prior)
    held = Hold(guess, turn_deg, shift_mm) if hold and guess is not None else None
    return SolveOptions(sigma_m, source, guess, held, sides, seed), tuple(notes)


def prior_from_words(words: str) -> tuple[float, float]:
    """(turn [deg], shift [mm]) of "1deg,10mm".

    Raises:
        CalibrationError: not that.
    """
    found = re.fullmatch(r"\s*([\d.]+)\s*deg\s*,\s*([\d.]+)\s*(mm|cm|m)\s*", words)
    if not found or not float(found[1]) > 0 or not float(found[2]) > 0:
        raise CalibrationError(f"--prior '{words}' is no turn and shift", hint="write it as 1deg,10mm")
    return float(found[1]), float(found[2]) * {"mm": 1.0, "cm": 10.0, "m": 1000.0}[found[3]]


def provenance(gathered: Gathered, command: str, *, notes: tuple[str, ...] = ()) -> Provenance:
    """The sha256 of every input by its name, and versions; nothing that differs from run to run or from place to place."""
    return Provenance(digests(gathered.files), versions(), command, notes)


def _are_files(inputs: Sequence[Path]) -> bool:
    """Whether the inputs are pictures, a folder with some, or corners."""
    first = inputs[0]
    if first.is_dir():
        return any(p.suffix.lower() in PICTURES for p in first.iterdir())
    return first.suffix.lower() in (*PICTURES, ".npz")
