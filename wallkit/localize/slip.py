"""A scan that does not fit where odometry led: is there a place near by where it does?

Wheels slip, and some drivers stamp odometry late, so that one step is a metre short and the next a metre long. The
particles never get there by the motion model's noise. As in expansion resetting (Ueda, Arai, Sakamoto, Kikuchi & Kamiya
2004) they are spread out once, and an annealed search (Deutscher, Blake & Reid 2000) draws them together again.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wallkit.core.config import setting
from wallkit.core.geometry import wrap_angle
from wallkit.core.types import Float64Array, LabelledScan
from wallkit.localize.particles import Particles, normalised
from wallkit.localize.resample import systematic
from wallkit.localize.sensor import Likelihood


@dataclass(frozen=True)
class SlipSettings:
    """How far odometry may be wrong in one step without the robot being lost."""

    reach_m: float = setting(1.2, "farthest place looked at; 0 switches the look off", low=0)
    reach_deg: float = setting(85.0, "largest error of heading looked at", low=0, high=180)
    poses: int = setting(8000, "poses tried in the first round", low=10)
    hits_of_usual: float = setting(0.9, "share of the usual hits below which it is worth a look", low=0, high=1)
    fit_of_usual: float = setting(0.95, "share of the usual fit that a place must reach to be taken", low=0, high=1)
    log_odds: float = setting(12.0, "how much likelier the scan must be there [nat]", low=0)
    noticed_m: float = setting(0.5, "an estimate this far from where odometry led is a slip", low=0)
    noticed_deg: float = setting(20.0, "the same for the heading", low=0, high=180)

    def is_slip(self, off: Float64Array) -> bool:
        """Whether the estimate is off (3,) what odometry says by more than its noise."""
        return bool(np.hypot(off[0], off[1]) > self.noticed_m or abs(off[2]) > np.deg2rad(self.noticed_deg))

    def is_jump(self, off: Float64Array) -> bool:
        """Whether it is farther off than wheels slip: another hypothesis than before."""
        reach_m, reach_deg = max(self.reach_m, self.noticed_m), max(self.reach_deg, self.noticed_deg)
        return bool(np.hypot(off[0], off[1]) > reach_m or abs(off[2]) > np.deg2rad(reach_deg))


# every round has a quarter of the spread of the one before, and counts the scan for more
_ROUNDS = ((1.0, 0.1), (0.25, 0.3), (0.0625, 1.0))


def look_around(
    s: SlipSettings, rng: np.random.Generator, particles: Particles, likelihood: Likelihood, scan: LabelledScan
) -> Particles:
    """As many particles as given, where the scan fits best within reach of them; weighted by the last round alone."""
    count = len(particles)
    reach = np.array([s.reach_m, s.reach_m, np.deg2rad(s.reach_deg)])
    found = particles
    for spread, exponent in _ROUNDS:
        drawn = s.poses if spread == 1.0 else count
        poses = found.poses[systematic(rng, normalised(found.log_weights), drawn)]
        poses = poses + spread * reach * rng.uniform(-1.0, 1.0, poses.shape)
        poses[:, 2] = wrap_angle(poses[:, 2])
        found = Particles(poses, exponent * likelihood.log_likelihood(poses, scan))
    return found


def describe_slip(off: Float64Array) -> str:
    """How far odometry was wrong, in words; off (3,) is the estimate seen from where odometry led."""
    return f"odometry is {np.hypot(off[0], off[1]):.2f} m, {abs(np.rad2deg(off[2])):.0f} deg off in this step"
