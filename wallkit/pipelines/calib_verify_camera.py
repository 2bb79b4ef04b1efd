"""Pictures of a board without scans -> evidence about the intrinsics of a camera alone."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from wallkit.calib.board_pose import pose_of_board
from wallkit.calib.boards import Board
from wallkit.calib.evidence import Evidence
from wallkit.errors import CalibrationError
from wallkit.pipelines.calib_captures import CaptureRequest, capture_from


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
        evidence, boards=tuple(found), hull_share=share, why_no_fresh="pictures come without scans (--scans)"
    )
    return evidence, left_out, capture.looked_at


def _hull_share(pixels: np.ndarray, area: int) -> float:
    from scipy.spatial import ConvexHull

    return float(ConvexHull(pixels).volume) / area
