"""Many configurations over the same logs -> which of them may be the best, and which are worth their time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wallkit.core.results import FEWEST_PAIRS
from wallkit.core.types import BoolArray, Float64Array, Int64Array
from wallkit.evaluate.statistics import SIGNIFICANT_P, small_sample_z

_NO_NOISE = 1e-24
_Z = 1.959964


@dataclass(frozen=True, slots=True)
class Best:
    """What can be said of the best of M configurations.

    Attributes:
        p_values: (M,) below 0.05: this one is not the best. 1 for the last that remained.
        chances: (M,) how often it was the best of all when the logs were drawn again; they sum to 1.
    """

    p_values: Float64Array
    chances: Float64Array

    @property
    def may_be(self) -> BoolArray:
        """(M,) those that cannot be told from the best; the best is among them in 95 of 100 cases."""
        return self.p_values >= SIGNIFICANT_P


def find_best(rng: np.random.Generator, losses: Float64Array, *, resamples: int = 2000) -> Best:
    """The model confidence set of Hansen, Lunde & Nason (2011), with the statistic T_R and logs drawn again.

    Testing all against the winner would forget that the winner was chosen by its luck on these logs. Here the worst is
    thrown out while the remaining ones differ, so nothing is compared with a winner.

    Fewer than six logs exclude none: resampled, they would look surer than any test of so few could be.

    Args:
        losses: (L, M) one number per log and configuration, the lower the better, none missing.
    """
    logs, count = losses.shape
    drawn = rng.multinomial(logs, np.full(logs, 1 / logs), size=resamples) @ losses / logs
    means, centred = losses.mean(axis=0), drawn - losses.mean(axis=0)
    p_values, alive, so_far = np.ones(count), np.arange(count), 0.0
    covariance = np.atleast_2d(np.cov(centred, rowvar=False))
    own = np.diag(covariance)
    # configurations that give the very same numbers have neither difference nor noise
    sd = np.sqrt(np.maximum(own[:, None] + own[None, :] - 2 * covariance, _NO_NOISE))
    # drawn again, few logs vary less than logs do
    scale = -small_sample_z(max(logs, FEWEST_PAIRS)) / _Z
    while len(alive) > 1 and logs >= FEWEST_PAIRS:
        excess = (means[alive, None] - means[None, alive]) / sd[np.ix_(alive, alive)]
        worst = int(np.argmax(excess.max(axis=1)))
        noise = _largest(centred[:, alive], sd[np.ix_(alive, alive)])
        so_far = max(so_far, float(np.mean(scale * noise >= excess.max() - 1e-9)))
        p_values[alive[worst]] = so_far
        alive = np.delete(alive, worst)
    is_lowest = np.isclose(drawn, drawn.min(axis=1, keepdims=True), rtol=1e-12, atol=0)
    return Best(p_values, np.asarray((is_lowest / is_lowest.sum(axis=1, keepdims=True)).mean(axis=0)))


def _largest(centred: Float64Array, sd: Float64Array) -> Float64Array:
    """(R,) the largest difference of any two configurations (R, M), in their own standard deviations (M, M)."""
    found = np.zeros(len(centred))
    for i in range(1, centred.shape[1]):
        np.maximum(found, np.abs((centred[:, :i] - centred[:, i : i + 1]) / sd[i, :i]).max(axis=1), out=found)
    return found


def find_front(costs: Float64Array, losses: Float64Array) -> Int64Array:
    """Rows that no other beats in both, by rising cost (Pareto's front); rows with a NaN are not on it."""
    order = [i for i in np.lexsort((losses, costs)).tolist() if np.isfinite(costs[i]) and np.isfinite(losses[i])]
    front: list[int] = []
    for i in order:
        if not front or losses[i] < losses[front[-1]]:
            front.append(i)
    return np.array(front, dtype=np.int64)
