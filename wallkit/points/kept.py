"""Weighted returns -> whether enough is left to hold on to: how many, and whether they hold both directions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

from wallkit.core.config import setting
from wallkit.core.types import LabelledScan

# returns so near to each other are taken for one surface
_REACH_M = 0.5


@dataclass(frozen=True)
class KeptSettings:
    """When the returns that filters leave are too few or look one way only."""

    weight: float = setting(0.5, "a return of at least this weight counts as kept", low=0, high=1)
    least: int = setting(40, "fewer kept returns are too few", low=1)
    least_share_across: float = setting(
        0.03, "one-sided: a smaller share of the surfaces' directions is across the main one", low=0, high=0.5
    )


@dataclass(frozen=True, slots=True)
class Kept:
    """What filters left of one scan.

    Attributes:
        returns: there were. kept: of weight enough.
        share_across: how much of the kept surfaces' normals is across their main direction, in [0, 0.5]: 0 along one
            straight wall, 0.5 in a corner; NaN where no two are near each other, so that nobody can tell.
    """

    returns: int
    kept: int
    share_across: float
    is_few: bool
    is_one_sided: bool


def kept_of(scan: LabelledScan, settings: KeptSettings) -> Kept:
    """What is left of a scan, and whether it is too little."""
    kept = np.flatnonzero(scan.weights >= settings.weight)
    beams = scan.points.beams[kept]
    # a planar scan is in order already
    order = kept if (beams[1:] >= beams[:-1]).all() else kept[np.argsort(beams, kind="stable")]
    across = float(_share_across(scan.points.xyz_m, order))
    is_few = len(kept) < settings.least
    return Kept(len(scan.weights), len(kept), across, is_few, not is_few and across < settings.least_share_across)


@njit(cache=True, nogil=True)
def _share_across(xyz: Any, order: Any) -> Any:
    """Smaller eigenvalue over the sum of both, of the scatter of normals between returns on one surface; NaN without any.

    A surface's direction is that from the farthest return within half a metre before, and counts by its length squared:
    noise turns short ones.

    order: places of the returns in xyz, as they lie beside each other.
    """
    xx, xy, yy = 0.0, 0.0, 0.0
    before = 0
    for n in range(1, len(order)):
        while before < n:
            dx, dy = xyz[order[n], 0] - xyz[order[before], 0], xyz[order[n], 1] - xyz[order[before], 1]
            if dx * dx + dy * dy < _REACH_M * _REACH_M:
                xx += dx * dx
                xy += dx * dy
                yy += dy * dy
                break
            before += 1
    total = xx + yy
    if total == 0:
        return np.nan
    return 0.5 - 0.5 * np.sqrt((xx - yy) ** 2 + 4 * xy * xy) / total
