"""Views of the ceiling that are not trusted yet -> particles where the present view looks right, for motion to decide.

Sensor resetting (Lenser & Veloso 2000): a few particles over a whole floor are too thin for a sharp sensor, but trying many
poses with one view is cheap. The LiDAR's `relocalise` is the same idea with an exact search.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from wallkit.core.config import setting
from wallkit.core.geometry import relative
from wallkit.core.types import FieldSet, Float64Array
from wallkit.localize.initial import over_free_space
from wallkit.localize.particles import Particles, normalised
from wallkit.localize.recovery import (
    RECOVERIES,
    BoundRecovery,
    Memory,
    Outcome,
    Recovery,
    Situation,
    TellApart,
    View,
    replaced,
)
from wallkit.localize.search import Place


@dataclass(frozen=True)
class Seek:
    """While an estimate is not trusted, try many poses with the present view and move some particles to likely ones."""

    poses: int = setting(5000, "tried with one view", low=1)
    every_m: float = setting(0.5, "driven between two searches", low=0)
    share: float = setting(0.2, "share of the particles moved while views do not fit", low=0, high=1)
    share_of_doubt: float = setting(0.05, "the same while they fit", low=0, high=1)
    sd_m: float = setting(0.05, "spread of the particles about a pose", low=0)
    sd_deg: float = setting(3.0, "spread of their heading", low=0)

    def on(self, fields: FieldSet, *, tell_apart: TellApart | None = None) -> BoundRecovery:
        """See Recovery."""
        return _Seeker(self, fields)


@dataclass(frozen=True)
class _Seeker:
    seeks_rivals: ClassVar[bool] = True
    settings: Seek
    fields: FieldSet

    def recover(self, rng: np.random.Generator, particles: Particles, memory: Memory, now: Situation) -> Outcome:
        """See BoundRecovery."""
        s = self.settings
        count = round((s.share_of_doubt if now.is_fitting else s.share) * len(particles))
        if now.is_confirmed or now.likelihood is None or count == 0:
            return Outcome(particles, memory)
        if memory.views and np.hypot(*relative(memory.views[-1].odometry, now.odometry)[:2]) < s.every_m:
            return Outcome(particles, memory)
        memory = replace(memory, views=(View(now.odometry, np.zeros((0, 2))),))
        tried = over_free_space(rng, self.fields, s.poses)
        poses = tried[rng.choice(len(tried), count, p=normalised(now.likelihood(tried)))]
        poses += rng.standard_normal(poses.shape) * (s.sd_m, s.sd_m, np.deg2rad(s.sd_deg))
        return Outcome(replaced(rng, particles, poses), memory, False, count)

    def candidates(self, memory: Memory, odometry: Float64Array) -> Sequence[Place]:
        """See BoundRecovery."""
        return ()


CEILING_RECOVERIES: dict[str, type[Recovery]] = {
    "seek": Seek,
    "augmented": RECOVERIES["augmented"],
    "none": RECOVERIES["none"],
}
