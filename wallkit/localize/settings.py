"""Every setting of localization in one place: the [localize] table of wallkit.toml."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from wallkit.core.config import choice, component, section, setting
from wallkit.localize.ceiling_settings import CeilingSettings
from wallkit.localize.estimate import ESTIMATORS
from wallkit.localize.health import HealthSettings
from wallkit.localize.motion import MOTIONS, MotionModel
from wallkit.localize.recovery import RECOVERIES, Recovery
from wallkit.localize.resample import RESAMPLERS
from wallkit.localize.sensor import SENSORS, SensorModel
from wallkit.localize.slip import SlipSettings


@dataclass(frozen=True)
class EkfSettings:
    """Settings of the Kalman filter."""

    yaw_per_turn: float = setting(0.3, "odometry: standard deviation of yaw from turning [rad per rad]", low=0)
    yaw_per_m: float = setting(0.17, "of yaw from driving [rad per m]", low=0)
    range_per_m: float = setting(0.22, "of the way along and across from driving [m per m]", low=0)
    range_per_turn: float = setting(0.14, "of the way from turning [m per rad]", low=0)
    sigma_m: float = setting(0.1, "standard deviation of a return about the mapped surface", low=0.001)
    huber_m: float = setting(0.15, "distance from which a return counts less", low=0.001)
    ignore_m: float = setting(1.0, "distance from which it does not count", low=0.01)
    beams: int = setting(180, "returns used per update", low=3)
    range_max_m: float = setting(25.0, "farther returns are not used", low=0.1)
    temper: float = setting(0.2, "independent share of the beams", low=0.001, high=1)
    iterations: int = setting(10, "most Gauss-Newton steps", low=1)


@dataclass(frozen=True)
class LocalizeSettings:
    """The defaults are the ones of docs/benchmarks: one configuration for all logs."""

    tracker: Literal["particle_filter", "ekf", "ceiling"] = setting(
        "particle_filter", "the particle filter, the EKF baseline, or the particle filter by the ceiling alone"
    )
    particles: int = setting(2000, "particles at the start, and always when count is fixed", low=1)
    count: Literal["fixed", "kld"] = setting("fixed", "whether resampling may change their number")
    particles_min: int = setting(500, "fewest particles with KLD", low=1)
    particles_max: int = setting(10000, "most particles with KLD", low=1)
    kld_error: float = setting(0.05, "largest Kullback-Leibler distance to the posterior", low=1e-4, high=1)
    kld_quantile: float = setting(0.99, "probability that it is kept", low=0.5, high=0.9999)
    kld_bin_m: float = setting(0.5, "side of a bin", low=0.01)
    kld_bin_rad: float = setting(0.1745, "side of a bin in heading", low=0.01)
    update_distance_m: float = setting(0.2, "distance driven before the next update", low=0)
    update_turn_deg: float = setting(10.0, "turn before the next update", low=0)
    caution: float = setting(0.2, "exponent of the likelihood while a hypothesis is unconfirmed", low=0.001, high=1)
    resampler: str = choice(RESAMPLERS, "systematic", "how particles are drawn")
    resample_when: Literal["ess", "always", "every"] = setting("ess", "when particles are drawn")
    resample_below: float = setting(0.5, "share of effective particles below which they are drawn (ess)", low=0, high=1)
    resample_every: int = setting(1, "updates between draws (every)", low=1)
    roughen_sd_m: float = setting(0.0, "noise added to drawn particles", low=0)
    roughen_sd_deg: float = setting(0.0, "noise added to their headings", low=0)
    estimator: str = choice(ESTIMATORS, "best_cluster", "how the particles become one answer")
    threads: int = setting(1, "threads of the reweighting; the result does not depend on it", low=1, high=64)
    motion: MotionModel = component(MOTIONS, "differential", "how odometry errs")
    sensor: SensorModel = component(SENSORS, "class_conditional", "how likely a scan is at a pose")
    recovery: Recovery = component(RECOVERIES, "relocalise", "what is done when the estimate is not trusted")
    ceiling: CeilingSettings = section(CeilingSettings, "the ceiling as a map, with --ceiling")
    slip: SlipSettings = section(SlipSettings, "the look around when a scan does not fit where odometry led")
    ekf: EkfSettings = section(EkfSettings, "the Kalman filter, when it is the tracker")
    health: HealthSettings = section(HealthSettings, "when the estimate is trusted")

    def __post_init__(self) -> None:
        if self.particles_min > self.particles_max:
            raise ValueError(f"particles_min {self.particles_min} is larger than particles_max {self.particles_max}")
