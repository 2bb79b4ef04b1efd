"""Offsets of returns from faces -> how far every face is off, how far the map is as a whole, and better poses; all at once.

A view sees the face f with normal n at the offset

    s = d_f + n.(g_xy + g_yaw J h + g_scale h) - n.t - yaw n.J(p - x) + noise

h and p the middle of the returns, x the pose, (t, yaw) its error with the covariance that localization or the truth give it.
All unknowns are solved together, the poses' eliminated view by view (Schur complement), so that a pose error shared by all
faces of a view is not taken for a moved wall, nor a moved wall for a pose error. Most faces are where the map has them: the
d_f have a Cauchy prior (iterated weights), under which one wall moves rather than all a little.

Views from one place err together: a place counts once, however many views it has.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from wallkit.core.geometry import compose, invert, wrap_angle
from wallkit.core.types import Float64Array, Int64Array
from wallkit.maps.audit.beams import Beams, follow_beams
from wallkit.maps.audit.faces import Faces
from wallkit.maps.audit.nouns import Drift, Logged

# gates of the iterations [m]: how far a return may lie off the face it is taken for
GATES_M = (0.6, 0.3, 0.2, 0.12)
# what averaging beams of one view does not make smaller: rough surfaces, the LiDAR's bias
FLOOR_M = 0.005
FACE_PRIOR_M = 0.01
_BEAMS_MIN = 3
_FACE_MIN_M = 0.2
_DRIFT_PRIOR = np.array([0.5, 0.5, 0.1, 0.1])
# a drift below this is no matter: x, y [m], yaw [rad], scale
DRIFT_MIN = np.array([0.05, 0.05, 0.0087, 0.005])
_SURE = 4.0
_PLACE_M, _PLACE_RAD = 1.0, np.pi / 4
_REWEIGHTINGS = 6
# of a variable that does not move
_HELD = 1e-12


@dataclass(frozen=True, eq=False)
class Solution:
    """What fits best.

    Attributes:
        logged: the log in the map's own frame and scale. poses: (V, 3) corrected. beams: followed from them.
        offsets_m, sd_m: (F,) of each face along its outward normal. covariance: (F, F) of them.
        seen_from: (F,) places from which a face was measured.
    """

    logged: Logged
    poses: Float64Array
    beams: Beams
    drift: Drift
    offsets_m: Float64Array
    covariance: Float64Array
    seen_from: Int64Array


@dataclass(frozen=True, eq=False)
class _Measured:
    """Faces as views saw them, (M,) sorted by view: offset, its variance, normal (M, 2), middle (M, 2), lever arm of yaw."""

    views: Int64Array
    faces: Int64Array
    offsets_m: Float64Array
    variances: Float64Array
    normals: Float64Array
    middles: Float64Array
    levers_m: Float64Array


def fit(faces: Faces, logged: Logged, *, sigma_m: float) -> Solution:
    """Faces, map and poses fitted to the log; the map's scale only where that is significant.

    Args:
        sigma_m: noise of a single return.
    """
    found = _fit(faces, logged, sigma_m, _DRIFT_PRIOR)
    if found.drift.is_significant:
        return found
    # what all poses share (a truth's own frame, the filter's bias) is left free, so that it moves no wall
    held = _fit(faces, logged, sigma_m, np.array([*_DRIFT_PRIOR[:3], _HELD]))
    return replace(held, drift=found.drift)


def places_of(poses: Float64Array) -> Int64Array:
    """Number of the place (V,) each view is from: cells of a metre and 45 degrees."""
    bins = np.column_stack([np.floor(poses[:, :2] / _PLACE_M), np.floor(wrap_angle(poses[:, 2]) / _PLACE_RAD)])
    return np.asarray(np.unique(bins, axis=0, return_inverse=True)[1].reshape(-1).astype(np.int64))


# -------------------------------------------------------------------------------------------- details


def _fit(faces: Faces, logged: Logged, sigma_m: float, drift_prior: Float64Array) -> Solution:
    drift, offsets = np.zeros(4), np.zeros(len(faces.face_links))
    corrections = np.zeros((len(logged), 3))
    place = places_of(logged.poses)
    weights = 1.0 / np.bincount(place)[place]
    moved = logged
    for gate_m in GATES_M:
        moved = _without(logged, drift)
        poses = moved.poses + corrections
        beams = follow_beams(faces, moved, poses)
        seen = _measure(faces, moved, poses, beams, offsets, sigma_m, gate_m)
        values, covariance, corrections = _solve(seen, moved, weights, corrections, drift_prior, len(offsets))
        drift, offsets = drift + values[:4], values[4:]
    sd = np.sqrt(np.diag(covariance)[:4])
    # what all poses have in common, a truth's own origin among it, no number of views makes smaller
    sd = np.hypot(sd, [*np.median(logged.sd[:, :2], axis=0), 0.0, 0.0])
    # where the map itself gave the poses, its origin and yaw cannot be judged
    is_judged = np.array([logged.is_absolute] * 3 + [True])
    is_significant = bool((is_judged & (np.abs(drift) > np.maximum(DRIFT_MIN, _SURE * sd))).any())
    poses = moved.poses + corrections
    seen_from = np.zeros(len(offsets), dtype=np.int64)
    pairs = np.unique(np.column_stack([seen.faces, place[seen.views]]), axis=0)
    np.add.at(seen_from, pairs[:, 0], 1)
    return Solution(
        logged=moved,
        poses=poses,
        beams=follow_beams(faces, moved, poses),
        drift=Drift(drift, np.where(is_judged, sd, np.nan), is_significant),
        offsets_m=offsets,
        covariance=covariance[4:, 4:],
        seen_from=seen_from,
    )


def _without(logged: Logged, drift: Float64Array) -> Logged:
    """The log as it would be if the map were right as a whole: in the map's frame and scale."""
    x, y, yaw, scale = drift
    size = 1.0 + scale
    poses = compose(invert(np.array([x, y, yaw])), logged.poses)
    poses[:, :2] /= size
    return replace(
        logged,
        poses=poses,
        ranges_m=logged.ranges_m / size,
        origin_m=logged.origin_m / size,
        reach_m=logged.reach_m / size,
    )


def _measure(
    faces: Faces,
    logged: Logged,
    poses: Float64Array,
    beams: Beams,
    offsets: Float64Array,
    sigma_m: float,
    gate_m: float,
) -> _Measured:
    """The median offset of each face in each view, of returns that lie within a gate of where the face is thought."""
    face = np.where(beams.segment >= 0, faces.faces[beams.segment], 0)
    usable = np.isfinite(logged.ranges_m) & (beams.segment >= 0) & beams.is_steady & beams.is_clear
    usable &= faces.face_lengths[face] >= _FACE_MIN_M
    usable &= np.abs(beams.offset_m - offsets[face]) < gate_m
    chosen = np.flatnonzero(usable)
    key = logged.views[chosen] * len(offsets) + face[chosen]
    order = np.lexsort((beams.offset_m[chosen], key))
    chosen, key = chosen[order], key[order]
    _, start, count = np.unique(key, return_index=True, return_counts=True)
    enough = count >= _BEAMS_MIN
    start, count = start[enough], count[enough]
    middle = chosen[start + count // 2]
    sums = np.vstack([np.zeros(2), np.cumsum(beams.endpoints[chosen], axis=0)])
    means = (sums[start + count] - sums[start]) / np.maximum(count, 1)[:, None]
    views, of_face = logged.views[middle], face[middle]
    normals = faces.face_normals[of_face]
    arm = means - poses[views, :2]
    return _Measured(
        views=views,
        faces=of_face,
        offsets_m=beams.offset_m[middle],
        # the median's variance: pi / 2 of the mean's
        variances=np.pi / 2 * sigma_m**2 / np.maximum(count, 1) + FLOOR_M**2,
        normals=normals,
        middles=means,
        levers_m=normals[:, 1] * arm[:, 0] - normals[:, 0] * arm[:, 1],
    )


def _solve(
    seen: _Measured,
    logged: Logged,
    weights: Float64Array,
    corrections: Float64Array,
    drift_prior: Float64Array,
    count: int,
) -> tuple[Float64Array, Float64Array, Float64Array]:
    """Drift and faces (4 + F,), their covariance, and the poses' corrections (V, 3)."""
    turned = seen.normals[:, 1] * seen.middles[:, 0] - seen.normals[:, 0] * seen.middles[:, 1]
    scaled = np.sum(seen.normals * seen.middles, axis=1)
    of_map = np.column_stack([seen.normals, turned, scaled])
    of_pose = -np.column_stack([seen.normals, seen.levers_m])
    # measured at corrected poses: told as seen from those that the log gives
    offsets = seen.offsets_m + np.sum(of_pose * corrections[seen.views], axis=1)
    # a face that no view measured stays where it is drawn
    measured, column = np.unique(seen.faces, return_inverse=True)
    information, right = np.zeros((4 + len(measured), 4 + len(measured))), np.zeros(4 + len(measured))
    blocks = []
    for view, rows in _by_view(seen.views):
        B = of_pose[rows]
        S = np.linalg.inv(np.diag(seen.variances[rows]) + (B * logged.sd[view] ** 2) @ B.T)
        columns = np.concatenate([np.arange(4), 4 + column[rows]])
        A = np.hstack([of_map[rows], np.eye(rows.stop - rows.start)])
        information[np.ix_(columns, columns)] += weights[view] * A.T @ S @ A
        right[columns] += weights[view] * A.T @ (S @ offsets[rows])
        blocks.append((view, rows, A, columns, S))
    values: Float64Array = np.zeros(4 + len(measured))
    for _ in range(_REWEIGHTINGS):
        prior = np.concatenate([drift_prior**-2, 2.0 / (FACE_PRIOR_M**2 + values[4:] ** 2)])
        values = np.asarray(np.linalg.solve(information + np.diag(prior), right), dtype=np.float64)
    covariance = np.asarray(np.linalg.inv(information + np.diag(prior)), dtype=np.float64)
    better, misfits = np.zeros_like(corrections), []
    for view, rows, A, columns, S in blocks:
        left = offsets[rows] - A @ values[columns]
        better[view] = logged.sd[view] ** 2 * (of_pose[rows].T @ (S @ left))
        misfits.append(left @ S @ left / len(left))
    # views that fit worse than their noise explains make everything less sure
    inflation = max(1.0, float(np.median(misfits))) if misfits else 1.0
    every = np.concatenate([np.arange(4), 4 + measured])
    all_values, all_covariance = np.zeros(4 + count), np.zeros((4 + count, 4 + count))
    all_values[every] = values
    all_covariance[np.ix_(every, every)] = covariance * inflation
    return all_values, all_covariance, better


def _by_view(views: Int64Array) -> Iterator[tuple[int, slice]]:
    """Runs of equal views as (view, rows)."""
    if len(views):
        edges = [0, *(np.flatnonzero(np.diff(views)) + 1).tolist(), len(views)]
        for start, stop in itertools.pairwise(edges):
            yield int(views[start]), slice(start, stop)
