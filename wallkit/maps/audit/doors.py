"""Beams around a door -> how it stood in every view that can tell.

A view's beams are compared with what they would measure for a row of states, from closed to open; a view can tell when one
state (with those that look alike) explains most of them and every other is much less likely.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from wallkit.core.types import BoolArray, Float64Array, Int64Array
from wallkit.maps.audit.nouns import DoorEvidence, Logged
from wallkit.maps.audit.solve import Solution
from wallkit.maps.geometry import parts, slice_parts
from wallkit.maps.model import SemanticMap
from wallkit.maps.nouns import Joint

if TYPE_CHECKING:
    from shapely import Geometry

STATES = 33
# how far states may differ and still be one, where the map does not say
TOLERANCE = {"prismatic": 0.1, "revolute": 0.2, "continuous": 0.2}
_BEAMS_MIN = 6
_EXPLAINED_MIN = 0.6
# log odds over every other state; beams of one view count as at most so many independent ones
_ODDS, _INDEPENDENT = 3.0, 8
_HIT, _OUTLIER_PER_M = 0.8, 0.02


@dataclass(frozen=True, eq=False)
class Doorway:
    """A door with its leaf at a row of states: leaves[i] (E, 4) are the edges at states[i]; swept is all they cover."""

    joint: Joint
    states: Float64Array
    leaves: tuple[Float64Array, ...]
    swept: Geometry


def doorways_at(semantic_map: SemanticMap, z_m: float) -> list[Doorway]:
    """Every door that reaches the height, leaves that follow another with it."""
    import shapely

    found = []
    for joint in semantic_map.doors:
        if joint.mimic is not None:
            continue
        leaves = set(semantic_map.subtree(joint.child))
        for other in semantic_map.doors:
            if other.mimic is not None and other.mimic.joint == joint.name:
                leaves.update(semantic_map.subtree(other.child))
        states = np.linspace(joint.closed, joint.open, STATES)
        edges, covered = [], []
        for state in states.tolist():
            poses = semantic_map.poses({joint.name: state})
            solids = parts(semantic_map, poses={link: T for link, T in poses.items() if link in leaves})
            cut = slice_parts(solids, z_m)
            if cut.polygons:
                edges.append(cut.segments)
                covered.append(cut.solid)
        if len(edges) == len(states):
            hulls = [shapely.union(a, b).convex_hull for a, b in itertools.pairwise(covered)]
            found.append(Doorway(joint, states, tuple(edges), shapely.union_all(hulls)))
    return found


def door_seen(doorway: Doorway, logged: Logged, solution: Solution, *, sigma_m: float) -> DoorEvidence:
    """The states a door was seen in."""
    import shapely

    beams, joint = solution.beams, doorway.joint
    edges = shapely.get_coordinates(shapely.get_exterior_ring(shapely.get_parts(doorway.swept.buffer(0.05))))
    outline = np.hstack([edges[:-1], edges[1:]])
    near = np.flatnonzero(_reaches(doorway, beams.origins, logged.reach_m))
    enters = _first_m(outline, beams.origins[near], beams.directions[near])
    ranges = np.hypot(*(beams.endpoints[near] - beams.origins[near]).T)
    # what the map has before the door hides it; what the log has before it does so too
    asked = np.isfinite(enters) & (enters < np.where(beams.first[near] >= 0, beams.first_m[near], np.inf))
    asked &= (ranges > enters - 3 * sigma_m) & beams.is_clear[near]
    near, ranges = near[asked], ranges[asked]
    behind = np.where(beams.first[near] >= 0, beams.first_m[near], logged.reach_m)
    sigma = np.hypot(2 * sigma_m, logged.sd[logged.views[near], :2].mean(axis=1))
    expected = np.stack(
        [np.minimum(_first_m(leaf, beams.origins[near], beams.directions[near]), behind) for leaf in doorway.leaves]
    )
    off = (ranges - expected) / sigma
    is_met = np.abs(off) < 3
    # a beam through the door may meet what the map does not have there; that it went through is what counts
    passed = (expected >= behind) & (ranges > _last_m(outline, beams.origins[near], beams.directions[near]))
    density = _HIT * np.exp(-0.5 * off**2) / (sigma * np.sqrt(2 * np.pi)) + _OUTLIER_PER_M
    score = np.log(np.where(passed, np.maximum(density, _HIT / 5), density))
    return _told(doorway, joint, score, is_met | passed, logged.views[near], logged.stamps_s)


def _told(
    doorway: Doorway,
    joint: Joint,
    score: Float64Array,
    is_met: Float64Array,
    views: Int64Array,
    stamps_s: Float64Array,
) -> DoorEvidence:
    """The states of the views that can tell, of scores (states, beams)."""
    tolerance = joint.state.tolerance if joint.state is not None and joint.state.tolerance else TOLERANCE[joint.kind]
    states, stamps = [], []
    for view in np.unique(views).tolist():
        own = views == view
        if own.sum() < _BEAMS_MIN:
            continue
        total = score[:, own].sum(axis=1) * min(1.0, _INDEPENDENT / own.sum())
        best = int(np.argmax(total))
        others = np.abs(doorway.states - doorway.states[best]) > tolerance
        is_sure = not others.any() or total[best] - total[others].max() > _ODDS
        if is_sure and is_met[best, own].mean() >= _EXPLAINED_MIN:
            share = np.where(others, 0.0, np.exp(total - total[best]))
            states.append(float(share @ doorway.states / share.sum()))
            stamps.append(float(stamps_s[view]))
    return DoorEvidence(joint.name, joint.child, np.array(states), np.array(stamps), tolerance)


def _reaches(doorway: Doorway, origins: Float64Array, reach_m: float) -> BoolArray:
    low_x, low_y, high_x, high_y = doorway.swept.bounds
    x, y = origins.T
    is_near = (x > low_x - reach_m) & (x < high_x + reach_m) & (y > low_y - reach_m) & (y < high_y + reach_m)
    return np.asarray(is_near)


def _crossings(segments: Float64Array, origins: Float64Array, directions: Float64Array) -> Float64Array:
    """Distances (B, E) along rays to segments; infinite where they miss."""
    start, along = segments[None, :, :2] - origins[:, None], segments[:, 2:] - segments[:, :2]
    across = directions[:, :1] * along[None, :, 1] - directions[:, 1:] * along[None, :, 0]
    safe = np.where(np.abs(across) < 1e-12, np.inf, across)
    t = (start[..., 0] * along[None, :, 1] - start[..., 1] * along[None, :, 0]) / safe
    u = (start[..., 0] * directions[:, 1:] - start[..., 1] * directions[:, :1]) / safe
    return np.asarray(np.where(np.isfinite(safe) & (t > 0) & (u >= 0) & (u <= 1), t, np.inf))


def _first_m(segments: Float64Array, origins: Float64Array, directions: Float64Array) -> Float64Array:
    return np.asarray(_crossings(segments, origins, directions).min(axis=1, initial=np.inf))


def _last_m(segments: Float64Array, origins: Float64Array, directions: Float64Array) -> Float64Array:
    t = _crossings(segments, origins, directions)
    return np.asarray(np.where(np.isfinite(t), t, -np.inf).max(axis=1, initial=-np.inf))
