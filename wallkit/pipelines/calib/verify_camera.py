"""Pictures of a board without scans -> evidence about the intrinsics of a camera alone."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from wallkit.calib.board.boards import Board
from wallkit.calib.board.pose import pose_of_board
from wallkit.calib.board.views import Capture, observations_of
from wallkit.calib.camera.cross_validation import held_out_errors
from wallkit.calib.camera.intrinsics import held_out_residuals
from wallkit.calib.camera.select import most_informative
from wallkit.calib.verify.evidence import Evidence
from wallkit.core.camera import Camera
from wallkit.errors import CalibrationError
from wallkit.pipelines.calib.captures import CaptureRequest, capture_from

_FEWEST_TO_REFIT = 8


def boards_of_camera(
    evidence: Evidence,
    inputs: Sequence[Path],
    board: Board,
    topic: str | None,
    progress: Callable[[int], None] = lambda done: None,
) -> tuple[Evidence, list[tuple[str, str]], int]:
    """The evidence with the boards that the camera saw; (name, why) of those it could not use; pictures looked at.

    Raises:
        CalibrationError: no board in any picture, or pictures of another size than the calibration is for.
    """
    camera = evidence.calibration.camera
    capture = capture_from(CaptureRequest(tuple(inputs), board, topic or "", (camera.width, camera.height)), progress)
    if (capture.width, capture.height) != (camera.width, camera.height):
        sizes = f"{capture.width} x {capture.height} px, the calibration is for {camera.width} x {camera.height}"
        hint = "the intrinsics are of another camera or mode"
        raise CalibrationError(f"the pictures have {sizes}", where=inputs[0], hint=hint)
    found, left_out = [], [(f"{count} pictures", why) for why, count in capture.left_out]
    for view in capture.views:
        try:
            found.append((view.name, pose_of_board(camera, board.object_points[view.ids], view.pixels, name=view.name)))
        except CalibrationError as error:
            left_out.append((view.name, error.message))
    share = _hull_share(np.concatenate([view.pixels for view in capture.views]), camera.width * camera.height)
    evidence = replace(
        evidence,
        boards=tuple(found),
        hull_share=share,
        why_no_fresh="pictures come without scans (--scans)",
        refit=_refit(camera, capture),
    )
    return evidence, left_out, capture.looked_at


def _refit(camera: Camera, capture: Capture) -> tuple[float, float] | None:
    """RMS [px] over all corners with the camera, and with one refitted to four fifths of the views in turn, on the rest."""
    chosen, _ = most_informative(capture)
    if len(chosen.views) < _FEWEST_TO_REFIT:
        return None
    seen = observations_of(chosen.views, chosen.board)
    judged, errors = held_out_residuals(camera, seen), held_out_errors(camera.model, chosen, seen, camera)
    if judged is None or errors is None:
        return None
    return float(np.sqrt((judged**2).sum(axis=1).mean())), float(np.sqrt((errors**2).mean()))


def _hull_share(pixels: np.ndarray, area: int) -> float:
    from scipy.spatial import ConvexHull

    return float(ConvexHull(pixels).volume) / area
