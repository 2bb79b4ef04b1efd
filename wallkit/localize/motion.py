"""Odometry between two updates -> where the particles may have gone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from wallkit.core.config import setting
from wallkit.core.geometry import wrap_angle
from wallkit.core.types import Float64Array
from wallkit.localize.kernels import rotate_drive_rotate


class MotionModel(Protocol):
    """Draws new poses; settings are the fields of the dataclass that implements it."""

    def sample(self, rng: np.random.Generator, poses: Float64Array, odometry: Float64Array) -> Float64Array:
        """New poses (N, 3) after the relative motion `odometry` (3,) = T_before_after, noise added."""
        ...


# below this the direction of travel is noise, and a turn in place must not turn into a bogus first rotation
STANDSTILL_M = 0.01


@dataclass(frozen=True)
class DifferentialDrive:
    """Rotate, drive, rotate: sample_motion_model_odometry of Probabilistic Robotics (2005), table 5.6.

    The noise variances are those of the table; driving backwards counts the turns from the reversed heading, as the
    robot does not turn around to reverse.
    """

    alpha1: float = setting(0.1, "yaw variance from turning [rad^2 per rad^2]", low=0)
    alpha2: float = setting(0.03, "yaw variance from driving [rad^2 per m^2]", low=0)
    alpha3: float = setting(0.05, "range variance from driving [m^2 per m^2]", low=0)
    alpha4: float = setting(0.02, "range variance from turning [m^2 per rad^2]", low=0)

    def sample(self, rng: np.random.Generator, poses: Float64Array, odometry: Float64Array) -> Float64Array:
        """See MotionModel."""
        x, y, yaw = odometry
        trans = float(np.hypot(x, y))
        rot1 = float(np.arctan2(y, x)) if trans > STANDSTILL_M else 0.0
        rot2 = float(wrap_angle(yaw - rot1))
        turn1, turn2 = _turn(rot1), _turn(rot2)
        sds = np.sqrt(
            [
                self.alpha1 * turn1**2 + self.alpha2 * trans**2,
                self.alpha3 * trans**2 + self.alpha4 * (turn1**2 + turn2**2),
                self.alpha1 * turn2**2 + self.alpha2 * trans**2,
            ]
        )
        noise = rng.standard_normal((3, len(poses)), dtype=np.float32)
        moved = np.empty_like(poses)
        rotate_drive_rotate(poses, noise, np.array([rot1, trans, rot2]), sds, moved)
        return moved


@dataclass(frozen=True)
class Omnidirectional:
    """Independent noise along, across and in yaw, growing with the distance driven and turned (after Nav2's omni model)."""

    alpha1: float = setting(0.1, "yaw variance from turning [rad^2 per rad^2]", low=0)
    alpha2: float = setting(0.03, "yaw variance from driving [rad^2 per m^2]", low=0)
    alpha3: float = setting(0.05, "range variance from driving [m^2 per m^2]", low=0)
    alpha4: float = setting(0.02, "range variance from turning [m^2 per rad^2]", low=0)
    alpha5: float = setting(0.05, "sideways variance from driving [m^2 per m^2]", low=0)

    def sample(self, rng: np.random.Generator, poses: Float64Array, odometry: Float64Array) -> Float64Array:
        """See MotionModel."""
        x, y, yaw = odometry
        trans2, turn2 = float(x * x + y * y), float(wrap_angle(yaw)) ** 2
        bearing = float(np.arctan2(y, x)) if trans2 > STANDSTILL_M**2 else 0.0
        noise = rng.standard_normal((3, len(poses)), dtype=np.float32)
        along = np.sqrt(trans2) - noise[0] * np.sqrt(self.alpha3 * trans2 + self.alpha4 * turn2)
        across = noise[1] * np.sqrt(self.alpha5 * trans2 + self.alpha4 * turn2)
        turned = yaw - noise[2] * np.sqrt(self.alpha1 * turn2 + self.alpha2 * trans2)
        heading = poses[:, 2] + bearing
        c, s = np.cos(heading), np.sin(heading)
        moved = np.empty_like(poses)
        moved[:, 0] = poses[:, 0] + along * c + across * s
        moved[:, 1] = poses[:, 1] + along * s - across * c
        moved[:, 2] = wrap_angle(poses[:, 2] + turned)
        return moved


def _turn(rotation: float) -> float:
    """How far the robot really turned for a rotation of the model: driving backwards is no turn of 180 degrees."""
    size = abs(float(wrap_angle(rotation)))
    return min(size, np.pi - size)


MOTIONS: dict[str, type[MotionModel]] = {
    "differential": DifferentialDrive,
    "omnidirectional": Omnidirectional,
}
