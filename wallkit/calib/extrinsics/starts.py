"""Views -> first guesses of the transform from nothing, from all views at once.

The rotation does not need the translation: a direction v on a face with normal a satisfies a'R v = 0 (Vasconcelos, Barreto,
Nunes 2012). A planar scan has two such rotations, half a turn about the scan's axis apart, and with real noise three views
choose badly; so many seeded rotations are refined on all views, and the translation, which is linear then, tells them apart.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from wallkit.calib.extrinsics.rigid import rotation_from_vector
from wallkit.calib.extrinsics.sightings import Problem, residuals, whiteners
from wallkit.core.types import Float64Array

SEEDS = 64
KEPT = 8
ITERATIONS = 60
SAME_RAD = np.radians(1.0)
# of the boards' middles, this share must come to lie in front of the camera
IN_FRONT = 0.9


def first_guesses(problem: Problem, *, seed: int = 0) -> list[Float64Array]:
    """(4, 4) transforms, best first; empty when no rotation puts the boards in front of the camera."""
    rng = np.random.default_rng(seed)
    rotations = _refined(problem, np.asarray(Rotation.random(SEEDS, rng=rng).as_matrix()))
    found: list[tuple[float, Float64Array]] = []
    for R in _distinct(rotations):
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = R, _translation(problem, R)
        if _share_in_front(problem, T) >= IN_FRONT:
            whitened = np.einsum("gkj,gj->gk", whiteners(problem, T), residuals(problem, T))
            misfit = np.sqrt((whitened**2).sum(axis=1))
            found.append((float(np.median(misfit)) + float(misfit.mean()), T))
    return [T for _, T in sorted(found, key=lambda pair: pair[0])[:KEPT]]


def _refined(problem: Problem, rotations: Float64Array) -> Float64Array:
    """(S, 3, 3) minima of sum (a'R v)^2 by damped Gauss-Newton, all seeds at once."""
    lines = (problem.weights == 0) & (np.abs(problem.normals).max(axis=2) > 0)
    v, a = problem.points[lines], problem.normals[lines]
    a = a / np.maximum(np.linalg.norm(v, axis=1, keepdims=True), 1e-12)
    R, damping = rotations, np.full(len(rotations), 1e-2)
    cost, rows, slopes = _turned(R, v, a)
    for _ in range(ITERATIONS):
        H = np.einsum("snp,snq->spq", slopes, slopes)
        g = np.einsum("snp,sn->sp", slopes, rows)
        scaled = H + np.eye(3) * (damping * np.trace(H, axis1=1, axis2=2) / 3 + 1e-12)[:, None, None]
        step = -np.linalg.solve(scaled, g[..., None])[..., 0]
        trial = rotation_from_vector(step) @ R
        lower, trial_rows, trial_slopes = _turned(trial, v, a)
        better = lower < cost
        R = np.where(better[:, None, None], trial, R)
        cost = np.where(better, lower, cost)
        rows = np.where(better[:, None], trial_rows, rows)
        slopes = np.where(better[:, None, None], trial_slopes, slopes)
        damping = np.where(better, damping / 5, damping * 5).clip(1e-9, 1e6)
    return R[np.argsort(cost, kind="stable")]


def _turned(R: Float64Array, v: Float64Array, a: Float64Array) -> tuple[Float64Array, Float64Array, Float64Array]:
    turned = np.einsum("sij,nj->sni", R, v)
    rows = np.einsum("sni,ni->sn", turned, a)
    return (rows**2).sum(axis=1), rows, np.cross(turned, a[None])


def _distinct(rotations: Float64Array) -> list[Float64Array]:
    """Those further than a degree from all before them."""
    kept: list[Float64Array] = []
    for R in rotations:
        if all(np.trace(R.T @ other) < 1 + 2 * np.cos(SAME_RAD) for other in kept):
            kept.append(R)
    return kept


def _translation(problem: Problem, R: Float64Array) -> Float64Array:
    """(3,) least squares of a't = b - a'R c over the middles of the faces; the shortest where they leave it open."""
    middles = problem.weights > 0
    a = problem.normals[middles]
    c = problem.points[middles] / problem.weights[middles][:, None]
    b = problem.offsets[middles] - np.einsum("ni,ij,nj->n", a, R, c)
    return np.asarray(np.linalg.lstsq(a, b, rcond=1e-2)[0])


def _share_in_front(problem: Problem, T: Float64Array) -> float:
    middles = problem.points[:, 0] / problem.weights[:, :1]
    return float((middles @ T[2, :3] + T[2, 3] > 0).mean())
