"""The three degrees of freedom that a planar LiDAR sees of upright boards: yaw and the two shifts in the scan plane."""

from __future__ import annotations

import numpy as np

from wallkit.calib.extrinsics.rigid import rotation_from_vector
from wallkit.calib.extrinsics.sightings import Problem
from wallkit.calib.extrinsics.solver import Placement, fit
from wallkit.calib.extrinsics.worlds import UPRIGHT
from wallkit.core.types import Float64Array

# yaw, forward, left among roll, pitch, yaw, forward, left, height in LiDAR axes
PLANAR = np.eye(6)[:, 2:5]
_STARTS = 12


def planar_placement(problem: Problem, base: Float64Array | None = None) -> Placement:
    """The best yaw and shifts in the scan plane, roll, pitch and height kept as in base.

    Args:
        base: (4, 4) T_camera_lidar; None: the scan plane is level, at the camera's height, x along the optical axis.
    """
    starts = []
    for yaw in np.arange(_STARTS) * 2 * np.pi / _STARTS:
        T = np.eye(4)
        T[:3, :3] = UPRIGHT
        T = T if base is None else base.copy()
        T[:3, :3] = T[:3, :3] @ rotation_from_vector([0.0, 0.0, yaw])
        found = fit(problem, T, basis=PLANAR, rounds=4)
        middles = problem.points[:, 0] / problem.weights[:, :1]
        if (middles @ found.T[2, :3] + found.T[2, 3] > 0).mean() > 0.9:
            starts.append(found)
    best = min(starts, key=lambda f: f.cost)
    return fit(problem, best.T, basis=PLANAR)


def planar_answer(placement: Placement) -> tuple[float, float, float]:
    """(yaw [rad], x [m], z [m]): turn about the camera's y axis from a LiDAR that looks where the camera looks, and the
    LiDAR's place right of and before the camera."""
    R = placement.T[:3, :3] @ UPRIGHT.T
    yaw = float(np.arctan2(R[0, 2], R[2, 2]))
    return yaw, float(placement.T[0, 3]), float(placement.T[2, 3])
