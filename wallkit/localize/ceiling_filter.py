"""Odometry and views of the ceiling -> a belief and an estimate: Monte Carlo localization by colour, with no LiDAR.

The steps are those of `filter.MonteCarloLocalizer`; what judges the answer is the share of the view whose colour is the
map's. With its first settings (`SEED`) it is the filter this project began with.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from wallkit.core.ceiling import CeilingMap, CeilingSight
from wallkit.core.geometry import relative
from wallkit.core.types import FieldSet, Float64Array, LabelledScan, Mode, Points, StampedPose
from wallkit.localize.belief import Belief, StepInfo
from wallkit.localize.ceiling_eye import CeilingEyes, ceiling_eyes
from wallkit.localize.filter import MonteCarloLocalizer
from wallkit.localize.health import count_updates, has_outlived, judge, weigh_evidence
from wallkit.localize.particles import Particles, effective_size, normalised
from wallkit.localize.recovery import BoundRecovery, NoRecovery, Situation
from wallkit.localize.settings import LocalizeSettings

_STILL = np.zeros(3)
_NO_POINTS = Points(
    0,
    np.zeros((0, 3), np.float32),
    np.zeros(0, np.float32),
    np.zeros(0, np.int64),
    np.zeros(2),
    0.0,
    np.zeros(0, np.float32),
)

# the ceiling localizer as its author built it, as words of --set
SEED = (
    "localize.ceiling.model=centre",
    "localize.ceiling.gain=none",
    "localize.ceiling.smooth_m=0",
    "localize.ceiling.recovery=none",
    "localize.ceiling.caution=1",
    "localize.resampler=wheel",
    "localize.resample_when=always",
    "localize.roughen_sd_m=0.02",
    "localize.roughen_sd_deg=1",
    "localize.update_distance_m=0",
    "localize.update_turn_deg=0",
    "localize.estimator=mean",
)


@dataclass(frozen=True)
class CeilingLocalizer:
    """The particle filter below one ceiling; made by `ceiling_localizer`.

    Attributes:
        core: start, motion, answer and resampling, which do not depend on the sensor.
        recovery: throws in random poses when views stop fitting, or nothing.
    """

    settings: LocalizeSettings
    core: MonteCarloLocalizer
    eyes: CeilingEyes
    recovery: BoundRecovery

    def start(self, rng: np.random.Generator, at: StampedPose | str) -> Belief:
        """A belief about a given pose, or spread as `global` or `everywhere` say."""
        return self.core.start(rng, at)

    def predict(self, rng: np.random.Generator, belief: Belief, odometry: Float64Array, gap_s: float = 0.0) -> Belief:
        """See MonteCarloLocalizer.predict: only the motion between two steps counts, never the whole of odometry."""
        return self.core.predict(rng, belief, odometry, gap_s)

    def look(self, belief: Belief, sight: CeilingSight) -> Belief:
        """The belief with a view from where the robot is now before its eyes, for `update`."""
        return replace(belief, sight=sight.view)

    def wants(self, belief: Belief, scan: LabelledScan) -> bool:
        """Whether `update` will use the view."""
        return belief.is_due

    def update(
        self, rng: np.random.Generator, belief: Belief, scan: LabelledScan | None = None
    ) -> tuple[Belief, StepInfo]:
        """The belief after the view it looked at, and what the update did; without enough motion the belief as it was.

        Args:
            scan: not looked at.
        """
        s, view = self.settings, belief.sight
        if not belief.is_due or view is None:
            return belief, StepInfo(False, belief.trust.reason, particles=len(belief.particles))
        assert belief.odometry is not None  # predict() comes first
        light = self.eyes.learned(belief.light, belief.particles, view)
        view = self.eyes.lit(view, light)
        exponent = 1.0 if belief.trust.is_confirmed else s.ceiling.caution
        log_p = exponent * self.eyes.likelihood.log_likelihood(belief.particles.poses, view)
        weighed = Particles(belief.particles.poses, belief.particles.log_weights + log_p)
        pose, covariance, modes = self.core.answer(weighed)
        evidence = weigh_evidence(self.eyes.agreement(pose, view), np.sqrt(np.diag(covariance)), modes)
        off = relative(belief.pose, pose) if belief.updates > 0 else _STILL
        trust = count_updates(
            s.health, belief.trust, evidence, path_m=belief.path_m, gap_s=belief.gap_s, has_jumped=s.slip.is_jump(off)
        )
        confirmed = trust.is_confirmed or has_outlived(s.health, trust, evidence, were_sought=True)
        outcome = self.recovery.recover(
            rng,
            self.core.resampled(rng, weighed, belief.updates),
            belief.memory,
            Situation(
                points=_NO_POINTS,
                odometry=belief.odometry,
                estimate=pose,
                fit=max(evidence.hit, 1e-3),
                is_confirmed=confirmed,
                was_confirmed=belief.trust.is_confirmed,
                is_ripe=False,
                is_fitting=trust.good >= 2,
                likelihood=lambda poses: self.eyes.likelihood.log_likelihood(poses, view),
            ),
        )
        trust = judge(s.health, replace(trust, is_confirmed=confirmed), evidence)
        trust = replace(trust, reason=_in_colours(trust.reason))
        info = StepInfo(
            True,
            trust.reason,
            evidence,
            effective_size(normalised(weighed.log_weights)),
            len(outcome.particles),
            outcome.injected,
        )
        after = replace(
            belief,
            particles=outcome.particles,
            pending=_STILL,
            is_due=False,
            gap_s=0.0,
            path_m=0.0,
            pose=pose,
            covariance=covariance,
            modes=modes,
            trust=trust,
            memory=outcome.memory,
            updates=belief.updates + 1,
            looked=belief.odometry,
            sight=view,
            light=light,
        )
        return after, info

    def candidates(self, belief: Belief) -> tuple[Mode, ...]:
        """Every place the robot may be: the belief's modes."""
        return belief.estimate().modes


class _Blind:
    """A LiDAR that is not there."""

    def log_likelihood(self, poses: Float64Array, scan: LabelledScan) -> Float64Array:
        """Zeros."""
        return np.zeros(len(poses))


def _in_colours(reason: str) -> str:
    """What health says of returns, said of the ceiling."""
    for lidar, ceiling in (
        ("of the returns lie behind mapped walls", "of the view has another colour than the ceiling there"),
        ("of the returns fit the map", "of the view has the ceiling's colour"),
        ("this scan does not fit the map", "this view does not fit the ceiling"),
        ("the scan does not fit the map", "the view does not fit the ceiling"),
        ("the scan fits the map", "the view fits the ceiling"),
    ):
        reason = reason.replace(lidar, ceiling)
    return reason


def ceiling_localizer(settings: LocalizeSettings, fields: FieldSet, ceiling: CeilingMap) -> CeilingLocalizer:
    """The filter for one ceiling, its look-up tables prepared.

    Args:
        fields: where the robot can be: of a map, or `fields_of_ceiling`.

    Raises:
        MapError: the ceiling is grey and the model compares colours.
    """
    eyes = ceiling_eyes(settings.ceiling, ceiling, threads=settings.threads)
    core = MonteCarloLocalizer(settings, fields, _Blind(), NoRecovery().on(fields))
    return CeilingLocalizer(settings, core, eyes, settings.ceiling.recovery.on(fields))
