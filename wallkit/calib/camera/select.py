"""Many views -> the few that tell most about the camera."""

from __future__ import annotations

import numpy as np

from wallkit.calib.board.views import Capture, observations_of
from wallkit.calib.camera.bundle import adjust, normal_equations
from wallkit.calib.camera.intrinsics import fit_cameras, free_parameters

MOST_VIEWS = 60


def most_informative(capture: Capture, *, most: int = MOST_VIEWS) -> tuple[Capture, int]:
    """The capture with at most so many views, and how many were left out.

    Greedy on the log determinant of the information about the camera (Kalibr's idea; Maye, Furgale & Siegwart, IV 2013): the
    next view is the one that shrinks the camera's uncertainty most. Camera and poses come from a plumb_bob fit to all.
    """
    if len(capture.views) <= most:
        return capture, 0
    seen, free = observations_of(capture.views, capture.board), free_parameters("plumb_bob")
    fit = adjust(fit_cameras("plumb_bob", capture, seen), seen, free=free, max_iterations=1)
    system = normal_equations(fit, seen, free)
    _, _, gain = system.reduced()
    each = system.cc_views - system.cv @ gain
    scale = np.sqrt(np.diag(each.sum(axis=0)))
    each = each / np.outer(scale, scale)
    total, chosen = 1e-6 * np.eye(len(scale)), []
    left = list(range(len(each)))
    for _ in range(most):
        gains = np.linalg.slogdet(total + each[left])[1]
        best = left.pop(int(np.argmax(gains)))
        chosen.append(best)
        total = total + each[best]
    views = tuple(capture.views[i] for i in sorted(chosen))
    reasons = (*capture.left_out, (f"less informative than the {most} used", len(capture.views) - most))
    return Capture(
        capture.board,
        capture.width,
        capture.height,
        views,
        capture.looked_at,
        reasons,
        capture.camera_name,
        capture.frame,
    ), len(left)
