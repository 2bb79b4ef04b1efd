"""A run and a truth -> how wrong it was, how fast it converged, and whether it knew."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wallkit.core.config import setting
from wallkit.core.results import Episode, Errors, Limits, Value
from wallkit.core.steps import Steps
from wallkit.core.types import Health, Trajectory
from wallkit.evaluate.associate import Pairs, interpolate_truth
from wallkit.evaluate.convergence import find_episodes, judge
from wallkit.evaluate.metrics import errors_from_pairs, measure
from wallkit.evaluate.resources import update_times


@dataclass(frozen=True)
class EvaluateSettings:
    """The [evaluate] table of wallkit.toml."""

    # seconds are counted as int64 nanoseconds, which end at 9e9 s and hold today's stamps of 1.8e9 s as well
    truth_gap_s: float = setting(
        0.5, "truth is interpolated to a scan if a true pose is this near in time", low=0, high=4e9
    )
    truth_offset_s: float = setting(0.0, "added to the stamps of the truth", low=-4e9, high=4e9)
    converged_m: float = setting(0.5, "error under which an estimate counts as converged", low=0)
    converged_deg: float = setting(10.0, "the same for the heading", low=0)
    lost_m: float = setting(1.0, "error over which an estimate is wrong", low=0)
    lost_deg: float = setting(30.0, "the same for the heading", low=0)
    available_m: float = setting(0.3, "error under which an estimate is good", low=0)
    available_deg: float = setting(5.0, "the same for the heading", low=0)

    @property
    def limits(self) -> Limits:
        """The limits alone."""
        return Limits(
            self.converged_m, self.converged_deg, self.lost_m, self.lost_deg, self.available_m, self.available_deg
        )


@dataclass(frozen=True)
class Evaluation:
    """What a run is worth.

    Attributes:
        metrics: by key; those about the truth only with one.
        errors: at every scan that has a truth; None without a truth.
        episodes: stretches of wrong estimates.
        pairs: estimate and truth at the same moments, and the scans that have no truth.
    """

    metrics: dict[str, Value]
    errors: Errors | None = None
    episodes: tuple[Episode, ...] = ()
    pairs: Pairs | None = None


def evaluate_steps(steps: Steps, truth: Trajectory | None, settings: EvaluateSettings) -> Evaluation:
    """Every number that follows from the rows of a run and, if there is one, the truth.

    Raises:
        WallkitError: the truth covers fewer than two scans.
    """
    metrics = {**_own_account(steps), **update_times(steps.update_ms[np.isfinite(steps.update_ms)])}
    if truth is None:
        return Evaluation(metrics)
    pairs = interpolate_truth(
        steps.trajectory,
        truth,
        tolerance_ns=round(settings.truth_gap_s * 1e9),
        offset_ns=round(settings.truth_offset_s * 1e9),
    )
    errors = errors_from_pairs(pairs)
    metrics = {**measure(pairs), **judge(errors, steps, settings.limits), **metrics}
    return Evaluation(metrics, errors, find_episodes(errors, steps, settings.limits), pairs)


def _own_account(steps: Steps) -> dict[str, Value]:
    """What the filter says of itself."""
    localized = float(np.mean(steps.health == Health.LOCALIZED))
    values = (
        Value("scans", float(len(steps)), "scans", "scans the estimate was given for", ""),
        Value("updates", float(np.isfinite(steps.update_ms).sum()), "updates", "scans that changed the belief", ""),
        Value("localized_share", localized, "share", "share of the scans called LOCALIZED", "higher"),
        Value(
            "spread_median_m", float(np.median(steps.sd[:, :2].max(axis=1))), "m", "median standard deviation of x or y"
        ),
    )
    return {value.key: value for value in values}
