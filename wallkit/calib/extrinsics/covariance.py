"""How far a solution may be off, judged by how much the views disagree, with honest intervals from few views.

Points of one board share its errors, so (J'J)^-1 over points is several times too small. The cluster sandwich takes each
view as one draw; with few views it is too small still, because the solution has bent towards every one of them. The
correction is CR2 (Bell and McCaffrey 2002; Pustejovsky and Tipton 2018): each view's residual is scaled up by
(I - leverage)^-1/2, and intervals use Student's t with the degrees of freedom that CR2 has left (Satterthwaite).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wallkit.core.types import Float64Array

_FULL_LEVERAGE = 1e-8


@dataclass(frozen=True, eq=False)
class Spread:
    """Uncertainty of an estimate of p unknowns.

    Attributes:
        covariance: (p, p), clustered by view.
        predicted: (p, p) H^-1: what the declared noise and geometry alone promise; it does not look at the residuals.
        degrees: (p,) degrees of freedom of each unknown's variance; inf where it is predicted and not estimated.
        views: how many clusters there are.
    """

    covariance: Float64Array
    predicted: Float64Array
    degrees: Float64Array
    views: int

    @property
    def sigmas(self) -> Float64Array:
        """(p,) standard deviations."""
        return np.sqrt(np.diag(self.covariance))

    def half_widths(self, level: float = 0.95) -> Float64Array:
        """(p,) half the interval that holds each unknown with this probability."""
        return self.sigmas * quantiles(self.degrees, level)

    def along(self, direction: Float64Array) -> float:
        """Standard deviation of direction'x."""
        return float(np.sqrt(direction @ self.covariance @ direction))


def quantiles(degrees: Float64Array, level: float = 0.95) -> Float64Array:
    """(p,) two-sided Student quantiles; the normal one where the degrees of freedom are infinite."""
    from scipy.special import stdtrit

    tail = np.full(np.shape(degrees), 0.5 + level / 2)
    return np.asarray(stdtrit(np.minimum(np.maximum(degrees, 1.0), 1e9), tail))


def spread_of(rows: Float64Array, residuals: Float64Array, held: Float64Array | None = None) -> Spread:
    """Uncertainty of a weighted least-squares solution.

    Args:
        rows: (G, K, p) whitened (and robustly weighted) Jacobian of each view.
        residuals: (G, K) whitened residuals there.
        held: (p, p) information of a prior, or None.

    Returns:
        With no more views than p + 1 unknowns the views cannot judge themselves: the predicted covariance, scaled up where
        the residuals are larger than it allows. No degree of freedom then: the quantiles of what few are left.

    Raises:
        np.linalg.LinAlgError: the views (and the prior) leave a direction entirely open.
    """
    count, _, unknowns = rows.shape
    information = np.einsum("gkp,gkq->pq", rows, rows)
    inverse = _symmetric_inverse(information + (0 if held is None else held))
    if count <= unknowns + 1:
        said = float((np.abs(rows).max(axis=2) > 0).sum()) - np.linalg.matrix_rank(information)
        excess = float((residuals**2).sum()) / said if said > 0 else 1.0
        degrees = np.full(unknowns, max(said, 1.0) if excess > 1 else np.inf)
        scaled = information / max(excess, 1.0) + (0 if held is None else held)
        return Spread(_symmetric_inverse(scaled), inverse, degrees, count)
    adjusted = _adjusted(rows, inverse)
    scores = np.einsum("gkp,gk->gp", adjusted, residuals)
    middle = scores.T @ scores + (0 if held is None else held)
    degrees = _degrees_of_freedom(rows, adjusted, inverse)
    return Spread(inverse @ middle @ inverse, inverse, degrees, count)


def _adjusted(rows: Float64Array, inverse: Float64Array) -> Float64Array:
    """(G, K, p) of A_g J_g with A_g = (I - J_g H^-1 J_g')^-1/2, a generalised inverse where a view has full leverage."""
    leverage = rows @ inverse @ rows.transpose(0, 2, 1)
    values, vectors = np.linalg.eigh(np.eye(rows.shape[1]) - leverage)
    scale = np.where(values > _FULL_LEVERAGE, 1 / np.sqrt(np.maximum(values, _FULL_LEVERAGE)), 0.0)
    return np.asarray((vectors * scale[:, None, :]) @ vectors.transpose(0, 2, 1) @ rows)


def _degrees_of_freedom(rows: Float64Array, adjusted: Float64Array, inverse: Float64Array) -> Float64Array:
    """(p,) Satterthwaite degrees of freedom of each variance, when the whitened residuals are as independent as promised.

    The variance of unknown c is sum_g (b_g'e)^2 with b_g = (I - J H^-1 J')' [A_g J_g H^-1 c]; with Omega_gh = b_g'b_h the
    degrees are trace(Omega)^2 / trace(Omega^2).
    """
    pulls = adjusted @ inverse  # (G, K, p): A_g J_g H^-1 for every unknown
    own = (pulls**2).sum(axis=1)  # (G, p)
    seen = np.einsum("gkq,gkp->gqp", rows, pulls)  # J_g' a_g
    degrees = np.empty(inverse.shape[0])
    for c in range(len(degrees)):
        omega = np.diag(own[:, c]) - seen[:, :, c] @ inverse @ seen[:, :, c].T
        degrees[c] = np.trace(omega) ** 2 / (omega**2).sum()
    return degrees


def _symmetric_inverse(information: Float64Array) -> Float64Array:
    """Inverse of a positive definite matrix whose rows may have very different units."""
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    if values[0] < 1e-13:
        raise np.linalg.LinAlgError("a direction is entirely open")
    return np.asarray((vectors / values) @ vectors.T / np.outer(scale, scale))
