"""Odometry and labelled scans -> a belief and an estimate: Monte Carlo localization on one screen.

`predict` and `update` are apart because point filters look at the predicted pose before they weigh the scan.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from wallkit.core.ceiling import CeilingMap, CeilingSight, CeilingView
from wallkit.core.geometry import compose, relative
from wallkit.core.raycast import classify_rays
from wallkit.core.types import FieldSet, Float64Array, Health, Int8Array, LabelledScan, Mode, StampedPose
from wallkit.localize.belief import Answer, Belief, StepInfo
from wallkit.localize.ceiling_eye import CeilingEyes, ceiling_eyes
from wallkit.localize.estimate import ESTIMATORS, find_modes, near_pose
from wallkit.localize.health import (
    Trust,
    count_updates,
    has_outlived,
    is_ripe,
    judge,
    raises_doubt,
    speaks_against,
    speaks_for,
    weigh_evidence,
)
from wallkit.localize.initial import SPREADS, START_SD, around_pose
from wallkit.localize.particles import Particles, effective_size, equally_weighted, normalised
from wallkit.localize.recovery import BoundRecovery, Memory, Situation, has_twin, moved_memory
from wallkit.localize.resample import RESAMPLERS, kld_size, roughened
from wallkit.localize.sensor import Likelihood
from wallkit.localize.settings import LocalizeSettings
from wallkit.localize.slip import describe_slip, look_around

_STILL = np.zeros(3)
# a spread below this is finer than the map: half a cell and a tenth of a degree
_SD_FLOOR = (0.01, 0.01, np.deg2rad(0.1))
# share of returns nearer than the map says from which people may be the reason that a scan fits less
_CROWDED = 0.35


@dataclass(frozen=True)
class MonteCarloLocalizer:
    """The particle filter on one map; made by `monte_carlo_localizer`."""

    settings: LocalizeSettings
    fields: FieldSet
    likelihood: Likelihood
    recovery: BoundRecovery
    eyes: CeilingEyes | None = None

    def start(self, rng: np.random.Generator, at: StampedPose | str) -> Belief:
        """A belief about a given pose, or spread as `global` or `everywhere` say."""
        n = self.settings.particles
        poses = around_pose(rng, at, n) if isinstance(at, StampedPose) else SPREADS[at](rng, self.fields, n)
        particles = equally_weighted(poses)
        pose, covariance, modes = self.answer(particles)
        trust = (
            Trust(Health.UNCERTAIN, "a start pose was given", is_confirmed=True)
            if isinstance(at, StampedPose)
            else Trust()
        )
        return Belief(particles, None, _STILL, True, pose, covariance, modes, trust, Memory())

    def predict(self, rng: np.random.Generator, belief: Belief, odometry: Float64Array, gap_s: float = 0.0) -> Belief:
        """The belief after odometry (3,) = T_odom_base: particles move once there is enough motion for an update."""
        gap = max(belief.gap_s, gap_s)
        if belief.odometry is None:
            return replace(belief, odometry=odometry, gap_s=gap)
        moved = relative(belief.odometry, odometry)
        belief = replace(belief, pending=moved, is_due=belief.updates == 0, gap_s=gap)
        s = self.settings
        if np.hypot(moved[0], moved[1]) < s.update_distance_m and abs(moved[2]) < np.deg2rad(s.update_turn_deg):
            return belief
        return self._moved(rng, belief)

    def wants(self, belief: Belief, scan: LabelledScan) -> bool:
        """Whether `update` will use the scan: enough motion, or a scan that the belief does not explain."""
        return belief.is_due or self._contradicts(belief, scan)

    def look(self, belief: Belief, sight: CeilingSight) -> Belief:
        """The belief with a view of the ceiling counted in, at any time between two updates; see CeilingEyes.

        Particles stay where they were at the last update: the view is seen from there, as far as odometry says.
        """
        if self.eyes is None or belief.odometry is None or not self.eyes.is_new(belief.looked, sight.odometry):
            return belief
        view = sight.view.seen_from(relative(belief.odometry, sight.odometry))
        light = self.eyes.learned(belief.light, belief.particles, view)
        view = self.eyes.lit(view, light)
        exponent = 1.0 if belief.trust.is_confirmed else self.settings.caution
        log_p = self.eyes.likelihood.log_likelihood(belief.particles.poses, view)
        particles = Particles(belief.particles.poses, belief.particles.log_weights + exponent * log_p)
        lit = self.eyes.lit(sight.view, light)
        return replace(belief, particles=particles, looked=sight.odometry, sight=lit, light=light)

    def update(self, rng: np.random.Generator, belief: Belief, scan: LabelledScan) -> tuple[Belief, StepInfo]:
        """The belief after a scan, and what the update did; without enough motion the belief as it was."""
        s, is_forced = self.settings, not belief.is_due
        if is_forced:
            if not self._contradicts(belief, scan):
                return belief, StepInfo(False, belief.trust.reason, particles=len(belief.particles))
            # odometry says the robot stood still, the scan says it did not: it was carried, turned, or hit
            belief = self._moved(rng, belief)
        answer = self._judged(self._weighed(belief, scan), scan)
        if self._is_worth_a_look(belief, answer):
            near_by = self._judged(look_around(s.slip, rng, belief.particles, self.likelihood, scan), scan)
            answer = near_by if self._is_slip(belief, answer, near_by, scan) else answer
        evidence, off = answer.evidence, relative(belief.pose, answer.pose) if belief.updates > 0 else _STILL
        trust = count_updates(
            s.health,
            belief.trust,
            evidence,
            path_m=belief.path_m,
            gap_s=belief.gap_s,
            has_jumped=s.slip.is_jump(off),
            is_forced=is_forced,
        )
        assert belief.odometry is not None  # predict() comes first
        outcome = self.recovery.recover(
            rng,
            self.resampled(rng, answer.particles, belief.updates),
            belief.memory,
            Situation(
                points=scan.points,
                odometry=belief.odometry,
                estimate=answer.pose,
                fit=evidence.hit,
                is_confirmed=trust.is_confirmed,
                was_confirmed=belief.trust.is_confirmed,
                is_ripe=is_ripe(s.health, trust, evidence),
                is_fitting=trust.good >= 2,
                ceiling=self._sight_from_here(belief),
            ),
        )
        seeks = self.recovery.seeks_rivals
        outlived = has_outlived(s.health, trust, evidence, were_sought=seeks)
        if seeks and has_twin(outcome.memory, answer.pose):
            outlived = False
        confirmed = trust.is_confirmed or outcome.confirms or outlived
        slip = describe_slip(off) if s.slip.is_slip(off) else ""
        trust = judge(s.health, replace(trust, is_confirmed=confirmed), evidence, slip=slip)
        effective = effective_size(normalised(answer.particles.log_weights))
        info = StepInfo(True, trust.reason, evidence, effective, len(outcome.particles), outcome.injected)
        after = Belief(
            particles=outcome.particles,
            odometry=belief.odometry,
            pending=_STILL,
            is_due=False,
            pose=answer.pose,
            covariance=answer.covariance,
            modes=answer.modes,
            trust=trust,
            memory=outcome.memory,
            updates=belief.updates + 1,
            looked=belief.looked,
            sight=belief.sight,
            light=belief.light,
        )
        return after, info

    def candidates(self, belief: Belief) -> tuple[Mode, ...]:
        """Every place the robot may be: the belief's modes, and unless LOCALIZED whatever else explains the last views."""
        here = belief.estimate().modes
        if belief.trust.health is Health.LOCALIZED or belief.odometry is None:
            return here
        places = self.recovery.candidates(belief.memory, compose(belief.odometry, belief.pending))
        covariance = np.diag(np.square(START_SD))
        known = np.array([mode.pose for mode in here])
        others = [place for place in places if not near_pose(known, place.pose).any()]
        return (*here, *(Mode(place.pose, covariance, 0.0) for place in others))

    def _sight_from_here(self, belief: Belief) -> CeilingView | None:
        """The last view of the ceiling, as seen from where the robot is now."""
        if belief.sight is None or belief.looked is None or belief.odometry is None:
            return None
        return belief.sight.seen_from(relative(belief.odometry, belief.looked))

    def _weighed(self, belief: Belief, scan: LabelledScan) -> Particles:
        """The particles with the scan counted in."""
        # a map that is a little wrong in one place must not kill the right one of several hypotheses
        exponent = 1.0 if belief.trust.is_confirmed else self.settings.caution
        log_p = self.likelihood.log_likelihood(belief.particles.poses, scan)
        return Particles(belief.particles.poses, belief.particles.log_weights + exponent * log_p)

    def _moved(self, rng: np.random.Generator, belief: Belief) -> Belief:
        """The belief with its pending motion applied to the particles, due for an update."""
        assert belief.odometry is not None  # predict() comes first
        moved = belief.pending
        return replace(
            belief,
            particles=Particles(
                self.settings.motion.sample(rng, belief.particles.poses, moved), belief.particles.log_weights
            ),
            odometry=compose(belief.odometry, moved),
            pending=_STILL,
            is_due=True,
            path_m=float(np.hypot(moved[0], moved[1])),
            pose=compose(belief.pose, moved),
            modes=tuple(replace(mode, pose=compose(mode.pose, moved)) for mode in belief.modes),
            memory=moved_memory(belief.memory, moved),
        )

    def _contradicts(self, belief: Belief, scan: LabelledScan) -> bool:
        """Whether a scan taken between two updates does not fit the estimate carried on by odometry."""
        rays = self._rays_at(scan, compose(belief.pose, belief.pending))
        evidence = weigh_evidence(rays, np.sqrt(np.diag(belief.covariance)), belief.modes)
        health, trust = self.settings.health, belief.trust
        return speaks_against(health, trust, evidence) or (
            (trust.is_confirmed or trust.good >= 2) and raises_doubt(health, trust, evidence)
        )

    def _rays_at(self, scan: LabelledScan, pose: Float64Array) -> Int8Array:
        h = self.settings.health
        return classify_rays(
            self.fields, scan.points, pose, tolerance_m=h.hit_tolerance_m, tolerance_per_m=h.hit_tolerance_per_m
        )

    def answer(self, particles: Particles) -> tuple[Float64Array, Float64Array, tuple[Mode, ...]]:
        """Pose (3,), covariance (3, 3) and every hypothesis of weighted particles."""
        weights = normalised(particles.log_weights)
        modes = find_modes(particles.poses, weights)
        pose, covariance = ESTIMATORS[self.settings.estimator](particles.poses, weights, modes)
        return pose, covariance + np.diag(np.square(_SD_FLOOR)), modes

    def _judged(self, particles: Particles, scan: LabelledScan) -> Answer:
        """What the particles answer, and what the scan says about it."""
        pose, covariance, modes = self.answer(particles)
        evidence = weigh_evidence(self._rays_at(scan, pose), np.sqrt(np.diag(covariance)), modes)
        return Answer(particles, pose, covariance, modes, evidence)

    def _is_worth_a_look(self, belief: Belief, answer: Answer) -> bool:
        """Whether a trusted estimate suddenly fits worse than is usual here: the odometry may have slipped."""
        trust, evidence = belief.trust, answer.evidence
        if not trust.is_confirmed or belief.updates == 0 or self.settings.slip.reach_m == 0:
            return False
        fits_less = evidence.hit < self.settings.slip.hits_of_usual * trust.usual_hits
        return fits_less or not speaks_for(self.settings.health, trust, evidence)

    def _is_slip(self, belief: Belief, here: Answer, near_by: Answer, scan: LabelledScan) -> bool:
        """Whether the scan fits near by as well as is usual and so much better than here that odometry must be wrong.

        A wrong place can turn people into walls, but then other returns lie behind walls there. And people who stand close
        by look like a wall somewhere: where many returns are nearer than the map says and none lie behind its walls, nothing
        says that here is wrong.
        """
        doubtful = raises_doubt(self.settings.health, belief.trust, here.evidence)
        if here.evidence.short > _CROWDED and not doubtful:
            return False
        slip, trust = self.settings.slip, belief.trust
        at_here, at_near = self.likelihood.log_likelihood(np.stack([here.pose, near_by.pose]), scan)
        return bool(
            not slip.is_jump(relative(belief.pose, near_by.pose))
            and at_near - at_here >= slip.log_odds
            and near_by.evidence.explained >= slip.fit_of_usual * max(trust.usual, here.evidence.explained)
            and near_by.evidence.hit >= slip.fit_of_usual * trust.usual_hits
        )

    def resampled(self, rng: np.random.Generator, particles: Particles, updates: int) -> Particles:
        """The particles drawn anew, if it is time."""
        s, weights = self.settings, normalised(particles.log_weights)
        needed = {
            "ess": effective_size(weights) < s.resample_below * len(particles),
            "always": True,
            "every": (updates + 1) % s.resample_every == 0,
        }[s.resample_when]
        if not needed:
            return particles
        n = kld_size(rng, particles.poses, weights, s) if s.count == "kld" else s.particles
        poses = particles.poses[RESAMPLERS[s.resampler](rng, weights, n)]
        if s.roughen_sd_m > 0 or s.roughen_sd_deg > 0:
            poses = roughened(rng, poses, s.roughen_sd_m, np.deg2rad(s.roughen_sd_deg))
        return equally_weighted(poses)


def monte_carlo_localizer(
    settings: LocalizeSettings, fields: FieldSet, ceiling: CeilingMap | None = None
) -> MonteCarloLocalizer:
    """The filter for one map, and the ceiling over it if there is one, its look-up tables prepared.

    Raises:
        MapError: see ceiling_eyes.
    """
    eyes = None if ceiling is None else ceiling_eyes(settings.ceiling, ceiling, threads=settings.threads)
    return MonteCarloLocalizer(
        settings,
        fields,
        settings.sensor.on(fields, threads=settings.threads),
        settings.recovery.on(fields, tell_apart=None if eyes is None else eyes.tell_apart),
        eyes,
    )
