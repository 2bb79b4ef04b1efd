"""Two trajectories -> poses at the same moments, and what could not be compared."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from wallkit.core.geometry import interpolate_poses
from wallkit.core.types import BoolArray, Float64Array, Int64Array, Trajectory
from wallkit.errors import WallkitError
from wallkit.evaluate.tum import seconds_from_ns


@dataclass(frozen=True, slots=True)
class Pairs:
    """An estimate and the truth at the same moments.

    Attributes:
        stamps_ns: (E,) int64, stamps of the estimate, ascending.
        rows: (E,) int64, which rows of the estimate they are.
        estimate, truth: (E, 3) float64 poses [m, m, rad] in frame map.
        dropped: why poses of the estimate were left out, and how many.
    """

    stamps_ns: Int64Array
    rows: Int64Array
    estimate: Float64Array
    truth: Float64Array
    dropped: Mapping[str, int]

    def __len__(self) -> int:
        return len(self.stamps_ns)


class Associate(Protocol):
    """Pairs an estimate with truth; `offset_ns` is added to the truth's stamps first.

    Raises:
        WallkitError: fewer than two poses of the estimate have a truth.
    """

    def __call__(self, estimate: Trajectory, truth: Trajectory, *, tolerance_ns: int, offset_ns: int = 0) -> Pairs: ...


def interpolate_truth(estimate: Trajectory, truth: Trajectory, *, tolerance_ns: int, offset_ns: int = 0) -> Pairs:
    """The truth interpolated at every stamp of the estimate that lies within its time.

    An error counts at every scan's stamp, whatever the truth's rate. Between two truth poses one of them must be within
    the tolerance: nothing is interpolated in the middle of a longer gap.
    """
    at, stamps_ns = estimate.stamps_ns, truth.stamps_ns + offset_ns
    late = np.searchsorted(stamps_ns, at, side="left").clip(0, len(stamps_ns) - 1)
    early = np.maximum(late - 1, 0)
    before, after = at < stamps_ns[0], at > stamps_ns[-1]
    distance_ns = np.minimum(np.abs(stamps_ns[late] - at), np.abs(at - stamps_ns[early]))
    in_gap = ~before & ~after & (distance_ns > tolerance_ns)
    dropped = {"before the truth starts": before, "after the truth ends": after, "in a gap of the truth": in_gap}
    rows = np.flatnonzero(~(before | after | in_gap))
    _refuse_too_few(len(rows), estimate, truth, tolerance_ns, offset_ns)
    there = interpolate_poses(stamps_ns, truth.poses, at[rows])
    return Pairs(at[rows], rows, estimate.poses[rows], there, _count(dropped))


def match_nearest(estimate: Trajectory, truth: Trajectory, *, tolerance_ns: int, offset_ns: int = 0) -> Pairs:
    """Each pose of the shorter trajectory with the nearest of the longer one, if that is within the tolerance.

    A tie takes the earlier. Gives evo's pairs, but uses each pose once: where evo pairs two with one, the nearer stays.
    """
    at, stamps_ns = estimate.stamps_ns, truth.stamps_ns + offset_ns
    if len(truth) >= len(estimate):
        rows, truth_rows = _nearest(at, stamps_ns, tolerance_ns)
    else:
        truth_rows, rows = _nearest(stamps_ns, at, tolerance_ns)
    _refuse_too_few(len(rows), estimate, truth, tolerance_ns, offset_ns)
    unmatched = len(estimate) - len(rows)
    dropped = {"without a truth pose in time": unmatched} if unmatched else {}
    return Pairs(at[rows], rows, estimate.poses[rows], truth.poses[truth_rows], dropped)


def _nearest(short_ns: Int64Array, long_ns: Int64Array, tolerance_ns: int) -> tuple[Int64Array, Int64Array]:
    """Rows of both, paired one to one."""
    late = np.searchsorted(long_ns, short_ns, side="left").clip(0, len(long_ns) - 1)
    early = np.maximum(late - 1, 0)
    to_late, to_early = np.abs(long_ns[late] - short_ns), np.abs(short_ns - long_ns[early])
    partner = np.where(to_early <= to_late, early, late)
    distance_ns = np.minimum(to_early, to_late)
    # by partner, then by distance: the first of each partner keeps it
    order = np.lexsort((distance_ns, partner))
    _, first = np.unique(partner[order], return_index=True)
    kept = np.sort(order[first])
    kept = kept[distance_ns[kept] <= tolerance_ns]
    return kept, partner[kept]


def _refuse_too_few(count: int, estimate: Trajectory, truth: Trajectory, tolerance_ns: int, offset_ns: int) -> None:
    """evo answers `1 poses, 0.000 m` to two unrelated files; a clear no is worth more."""
    if count >= 2:
        return
    apart_ns = int(estimate.stamps_ns[0] - truth.stamps_ns[0])
    message = (
        f"{count} of {len(estimate)} poses of the estimate have a truth within {tolerance_ns / 1e9:g} s"
        f" (estimate {_span(estimate)}, truth {_span(truth)}, offset {seconds_from_ns(offset_ns)} s)"
    )
    shift = seconds_from_ns(apart_ns)
    raise WallkitError(message, hint=f"if the clocks differ, --t-offset {shift} lets the truth start with the estimate")


def _span(trajectory: Trajectory) -> str:
    first, last = (seconds_from_ns(int(stamp)) for stamp in trajectory.stamps_ns[[0, -1]])
    return f"{first} to {last} s"


def _count(dropped: Mapping[str, BoolArray]) -> dict[str, int]:
    return {why: int(mask.sum()) for why, mask in dropped.items() if mask.any()}


ASSOCIATIONS: Mapping[str, Associate] = {"interpolate": interpolate_truth, "nearest": match_nearest}
