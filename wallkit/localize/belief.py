"""What the filter knows between two frames, and what one update did: the nouns of the filter."""

from __future__ import annotations

from dataclasses import dataclass, replace

from wallkit.core.ceiling import CeilingView
from wallkit.core.geometry import compose
from wallkit.core.types import Estimate, Float64Array, Mode
from wallkit.localize.ceiling_eye import Light
from wallkit.localize.health import Evidence, Trust
from wallkit.localize.particles import Particles
from wallkit.localize.recovery import Memory


@dataclass(frozen=True, slots=True)
class Answer:
    """What weighted particles say: pose (3,), covariance (3, 3), every hypothesis, and how well the scan fits there."""

    particles: Particles
    pose: Float64Array
    covariance: Float64Array
    modes: tuple[Mode, ...]
    evidence: Evidence


@dataclass(frozen=True, slots=True)
class Belief:
    """Everything the filter knows between two frames.

    Attributes:
        particles: as of the last update. odometry: T_odom_base there; None before the first frame.
        pending: motion since the last update, not yet applied. is_due: enough of it for an update.
        pose, covariance, modes: the answer of the last update.
        trust, memory: of health and recovery.
        path_m: driven since the last update. gap_s: longest silence of the odometry since then.
        updates: how many there were.
        looked: T_odom_base (3,) where the last view of the ceiling counted; None before. sight: that view, lit, from there.
        light: what was learned of the light.
    """

    particles: Particles
    odometry: Float64Array | None
    pending: Float64Array
    is_due: bool
    pose: Float64Array
    covariance: Float64Array
    modes: tuple[Mode, ...]
    trust: Trust
    memory: Memory
    path_m: float = 0.0
    gap_s: float = 0.0
    updates: int = 0
    looked: Float64Array | None = None
    sight: CeilingView | None = None
    light: Light = Light()

    def estimate(self, stamp_ns: int = 0) -> Estimate:
        """Where the robot is now: the last answer carried on by odometry."""
        modes = tuple(replace(mode, pose=compose(mode.pose, self.pending)) for mode in self.modes)
        return Estimate(stamp_ns, compose(self.pose, self.pending), self.covariance, self.trust.health, modes)


@dataclass(frozen=True, slots=True)
class StepInfo:
    """What one update did.

    Attributes:
        is_update: False when the robot had not moved enough and only odometry was applied.
        reason: why the health is what it is.
        evidence: what the scan had to say; None without an update.
        effective: particles effective before resampling. particles: how many there are now. injected: by recovery.
    """

    is_update: bool
    reason: str
    evidence: Evidence | None = None
    effective: float = 1.0
    particles: int = 1
    injected: int = 0
