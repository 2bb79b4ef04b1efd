"""A difference of six unknowns and how sure each side of it is -> how often chance makes one at least as unlikely.

Hotelling's T^2 needs the whole 6 x 6 covariance, and CR2 from 12 views has about five degrees of freedom for it: taken as
known it holds the truth 40 to 80 % of the time instead of 95, with G - 6 degrees 84 to 93, and with the honest number (HTZ:
Pustejovsky and Tipton 2018) it can say nothing below 20 views. What the views know well is one direction at a time. So the
difference is taken apart along six directions that err independently when everything errs as declared; each gets
Student's t with its own degrees of freedom, as the intervals do, is turned into a normal score of the same probability, and
the sum of the squared scores is a chi-square of six. `wallkit bench covariance` counts how often that is right.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from wallkit.calib.extrinsics.solver import Placement
from wallkit.core.types import Float64Array


@dataclass(frozen=True, eq=False)
class Known:
    """One side of a difference, in its axes (roll, pitch, yaw, forward, left, height).

    Attributes:
        covariance: (6, 6), as estimated. predicted: (6, 6) what was promised before anything was measured; the same where
            nobody knows better.
        degrees: (6, m) directions -> (m,) degrees of freedom of the variance of each; inf of what was stated.
    """

    covariance: Float64Array
    predicted: Float64Array
    degrees: Callable[[Float64Array], Float64Array]


def stated(covariance: Float64Array, degrees: float = np.inf) -> Known:
    """Of a covariance that comes from a file or a data sheet, with one number of degrees of freedom for all directions."""
    return Known(covariance, covariance, lambda directions: np.full(directions.shape[1], degrees))


def solved(placement: Placement) -> Known:
    """Of a solution with all six directions free, in its LiDAR axes."""
    basis, spread = placement.basis, placement.spread()
    return Known(
        basis @ spread.covariance @ basis.T,
        basis @ spread.predicted @ basis.T,
        lambda directions: placement.spread_along(directions).degrees,
    )


def chance_of(difference: Float64Array, sides: Sequence[Known]) -> float:
    """Probability of a difference (6,) at least as unlikely as this when both sides are right; small is disagreement."""
    from scipy.special import chdtrc, ndtri, stdtr

    directions = _independent(sum(side.predicted for side in sides[1:]) + sides[0].predicted)
    variances = np.array([np.einsum("ik,ij,jk->k", directions, side.covariance, directions) for side in sides])
    degrees = np.array([side.degrees(directions) for side in sides])
    # Welch (1947): degrees of freedom of a sum of variances
    total = variances.sum(axis=0)
    joint = total**2 / np.maximum((variances**2 / degrees).sum(axis=0), 1e-300)
    t = np.abs(directions.T @ difference) / np.sqrt(total)
    tails = np.maximum(stdtr(joint.clip(1.0, 1e9), -t), 1e-300)
    return float(chdtrc(6, float((ndtri(tails) ** 2).sum())))


def _independent(covariance: Float64Array) -> Float64Array:
    """(6, 6) columns b with b_i'C b_j = 0: eigenvectors of the correlations, so that units do not matter."""
    units = np.sqrt(np.diag(covariance))
    _, vectors = np.linalg.eigh(covariance / np.outer(units, units))
    return np.asarray(vectors / units[:, None])
