"""A scenario's cameras and a robot -> units: true and published lenses at true and published places."""

from __future__ import annotations

import numpy as np

from wallkit.core.camera import Camera
from wallkit.core.types import Float64Array
from wallkit.errors import CalibrationError, SimulationError
from wallkit.simulate.camera import Unit
from wallkit.simulate.robot import Robot
from wallkit.simulate.scenario import CameraSetup


def units_of(robot: Robot, setups: tuple[CameraSetup, ...]) -> dict[str, Unit]:
    """The cameras of a scenario by name.

    Raises:
        SimulationError: two have one name, a frame is not the robot's, or a lens cannot be.
    """
    found: dict[str, Unit] = {}
    for setup in setups:
        if setup.name in found:
            raise SimulationError(f"two [[cameras]] are called '{setup.name}'", hint="give each a name of its own")
        found[setup.name] = unit_of(robot, setup)
    return found


def unit_of(robot: Robot, setup: CameraSetup) -> Unit:
    """A camera of a scenario on a robot.

    Raises:
        SimulationError: its frame is not the robot's, or its lens cannot be.
    """
    wanted = setup.frame
    if not wanted:
        called = [frame for frame in robot.optical_frames if setup.name.lower() in frame.lower()]
        wanted = called[0] if len(called) == 1 else ""
    frame = robot.camera_frame(wanted)
    if setup.K and len(setup.K) != 4:
        raise SimulationError(
            f"camera '{setup.name}' has K = {list(setup.K)}", hint="K = [fx, fy, cx, cy], or leave it out for hfov_deg"
        )
    fx, fy, cx, cy = setup.K or _of_view(setup)
    dx, dy = setup.centre_error_px
    grown = 1 + setup.focal_error
    try:
        published = _camera(setup, frame, fx, fy, cx, cy)
        true = _camera(setup, frame, fx * grown, fy * grown, cx + dx, cy + dy)
    except CalibrationError as error:
        raise SimulationError(error.message, where=error.where, hint=error.hint) from error
    T = np.asarray(robot.frames[frame])
    return Unit(setup.name, frame, true, published, T @ _off(setup), T, setup.photo, setup.glass)


def _of_view(setup: CameraSetup) -> tuple[float, float, float, float]:
    half = np.deg2rad(setup.hfov_deg) / 2
    is_wide = setup.model in ("equidistant", "fisheye")
    if not is_wide and setup.hfov_deg >= 170:
        raise SimulationError(
            f"camera '{setup.name}' cannot see {setup.hfov_deg:g} degrees by a {setup.model} lens",
            hint='model = "equidistant"',
        )
    focal = setup.width / 2 / (half if is_wide else np.tan(half))
    return float(focal), float(focal), (setup.width - 1) / 2, (setup.height - 1) / 2


def _camera(setup: CameraSetup, frame: str, fx: float, fy: float, cx: float, cy: float) -> Camera:
    K = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]])
    zeros = {"equidistant": 4, "fisheye": 4, "rational_polynomial": 8, "rational": 8}.get(setup.model, 5)
    D = np.array(setup.D or (0.0,) * zeros)
    return Camera(setup.model, setup.width, setup.height, K, D, setup.name, frame)


def _off(setup: CameraSetup) -> Float64Array:
    from scipy.spatial.transform import Rotation

    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec(setup.off_deg, degrees=True).as_matrix()
    T[:3, 3] = np.array(setup.off_mm) / 1000
    return T
