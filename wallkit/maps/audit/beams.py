"""Beams at poses and the faces of a map -> which face each return is from, how far off it, and what it went through."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wallkit.core.geometry import compose
from wallkit.core.types import BoolArray, Float64Array, Int64Array
from wallkit.maps.audit.faces import Faces
from wallkit.maps.audit.nouns import Logged
from wallkit.maps.sight import Sight, cast_beams

# a return that fits a farther face this well is from there, although a nearer one would do with a shift
FITS_M = 0.06
# beams that meet a face at a flatter angle tell little about where it is
GRAZING_COS = 0.26
# beams within this of the end of a face may miss it, when the pose is a little off
_END_M = 0.1
_BEHIND = 4
_STEP_M = 1e-4


@dataclass(frozen=True, eq=False)
class Beams:
    """What each beam met; (B,) arrays, -1 for none.

    Attributes:
        origins, directions: (B, 2) of the beams in frame map. endpoints: (B, 2), at the reach for misses.
        first: segment the map says comes first. first_m: how far it is.
        segment: the one the return is from, or would be from if there were no gate. cosine: of the angle to its normal.
        offset_m: how far the return lies off it, along its outward normal.
        is_steady: neither at the end of a face nor grazing it; `is_inner` for `first`, likewise.
        is_clear: no glass and no mirror on the way.
    """

    origins: Float64Array
    directions: Float64Array
    endpoints: Float64Array
    first: Int64Array
    first_m: Float64Array
    segment: Int64Array
    cosine: Float64Array
    offset_m: Float64Array
    is_steady: BoolArray
    is_inner: BoolArray
    is_clear: BoolArray


def follow_beams(faces: Faces, logged: Logged, poses: Float64Array) -> Beams:
    """Every beam followed through the map from the poses (V, 3)."""
    lidar = compose(poses, np.array([*logged.origin_m, 0.0]))[logged.views]
    heading = lidar[:, 2] + logged.bearings_rad
    origins, directions = lidar[:, :2], np.column_stack([np.cos(heading), np.sin(heading)])
    ranges = np.minimum(logged.ranges_m, logged.reach_m)
    is_return = np.isfinite(logged.ranges_m)
    first_m, first = _cast(faces.solid, origins, directions, logged.reach_m)
    segment = first.copy()
    offset = _offsets(faces, segment, origins + ranges[:, None] * directions)
    # the map may put something in front that is not there: look whether the return fits what is behind it
    asked = np.flatnonzero((first >= 0) & is_return & (ranges - first_m > FITS_M))
    at, best = first_m[asked], np.abs(offset[asked])
    for _ in range(_BEHIND):
        start = origins[asked] + (at + _STEP_M)[:, None] * directions[asked]
        further, behind = _cast(faces.solid, start, directions[asked], logged.reach_m)
        at = at + _STEP_M + further
        off = np.abs(_offsets(faces, behind, origins[asked] + ranges[asked, None] * directions[asked]))
        # of the far side of a wall no beam comes back
        is_near_side = np.sum(directions[asked] * faces.normals[behind], axis=1) < 0
        fits = (behind >= 0) & is_near_side & (off < FITS_M) & (off < best)
        segment[asked[fits]], best[fits] = behind[fits], off[fits]
        is_on = np.isfinite(at)
        asked, at, best = asked[is_on], at[is_on], best[is_on]
    clear_m, _ = _cast(faces.clear, origins, directions, logged.reach_m)
    endpoints = origins + ranges[:, None] * directions
    cosine = np.where(segment >= 0, -np.sum(directions * faces.normals[segment], axis=1), 0.0)
    seen = np.where(np.isfinite(first_m), first_m, 0.0)
    return Beams(
        origins=origins,
        directions=directions,
        endpoints=endpoints,
        first=first,
        first_m=first_m,
        segment=segment,
        cosine=cosine,
        offset_m=np.where(segment >= 0, _offsets(faces, segment, endpoints), np.nan),
        is_steady=_is_inner(faces, segment, endpoints) & (cosine > GRAZING_COS),
        is_inner=_is_inner(faces, first, origins + seen[:, None] * directions)
        & (-np.sum(directions * faces.normals[first], axis=1) > GRAZING_COS),
        is_clear=clear_m > ranges + FITS_M,
    )


def pieces_of(faces: Faces, segment: Int64Array, points: Float64Array) -> Int64Array:
    """The piece (B,) of each segment that points (B, 2) are beside; for segments >= 0."""
    ends = faces.segments[segment]
    along = ends[:, 2:] - ends[:, :2]
    share = np.sum((points - ends[:, :2]) * along, axis=1) / np.maximum(np.sum(along**2, axis=1), 1e-12)
    counts = faces.piece_counts[segment]
    return np.asarray(faces.first_piece[segment] + np.clip((share * counts).astype(np.int64), 0, counts - 1))


def _cast(
    sight: Sight, origins: Float64Array, directions: Float64Array, reach_m: float
) -> tuple[Float64Array, Int64Array]:
    heading = np.arctan2(directions[:, 1], directions[:, 0])
    seen = cast_beams(sight, np.column_stack([origins, heading]), np.zeros(1), range_max_m=reach_m)
    return seen.ranges_m[:, 0], seen.segments[:, 0]


def _offsets(faces: Faces, segment: Int64Array, points: Float64Array) -> Float64Array:
    """How far points (B, 2) lie off the lines of segments, along the outward normals."""
    return np.asarray(np.sum((points - faces.segments[segment, :2]) * faces.normals[segment], axis=1))


def _is_inner(faces: Faces, segment: Int64Array, points: Float64Array) -> BoolArray:
    """Whether points (B, 2) are beside the inner part of their segment."""
    ends = faces.segments[segment]
    length = np.hypot(*(ends[:, 2:] - ends[:, :2]).T)
    margin = np.minimum(_END_M, length / 4)
    along = np.sum((points - ends[:, :2]) * (ends[:, 2:] - ends[:, :2]), axis=1) / np.maximum(length, 1e-12)
    return np.asarray((segment >= 0) & (along > margin) & (along < length - margin))
