"""What cameras say about the returns of a scan -> weights: the paper's wall mask, its opposite, and a soft one.

They look at `LabelledScan.shares`: how much of where a return may have landed in the picture shows which class. A return
that no camera sees, or of a picture that says nothing there, keeps `unseen_weight`: what other filters say of it counts.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np
from numba import njit

from wallkit.core.config import setting
from wallkit.core.types import Estimate, FieldSet, Float32Array, LabelledScan
from wallkit.errors import closest

if TYPE_CHECKING:
    from wallkit.points.filters import BoundFilter

# shares are sums of float32
_WHOLE = np.float32(1 - 1e-4)


@dataclass(frozen=True)
class WallMask:
    """Only returns on a wall count (Shavarskyi & Kryvenchuk 2025): the whole circle of a pixel's error must show one.

    A mask is eroded by the error that way, point by point, as the error grows with nearness.
    """

    keep: tuple[str, ...] = setting(
        ("wall", "partition"), "classes that count as wall; door, glass, toilet, urinal, sink, other may join"
    )
    unseen_weight: float = setting(1.0, "weight of a return that no camera sees", low=0, high=1)

    def __post_init__(self) -> None:
        _check_known(self.keep, "keep")

    def on(self, fields: FieldSet) -> BoundFilter:
        """See PointFilter."""
        return self

    def weigh(self, scan: LabelledScan, estimate: Estimate) -> Float32Array:
        """See BoundFilter."""
        return _between(scan, self.keep, _WHOLE, np.float32(np.inf), self.unseen_weight)


@dataclass(frozen=True)
class RejectDynamic:
    """Returns on people, and on what need not stand where the map was made, do not count; all others do.

    For a model that knows people and chairs but no walls, as those trained on COCO. A return goes if any of the circle of
    its pixel's error shows one: the mask is dilated by it.
    """

    reject: tuple[str, ...] = setting(("person", "movable"), "classes that are rejected")
    unseen_weight: float = setting(1.0, "weight of a return that no camera sees", low=0, high=1)

    def __post_init__(self) -> None:
        _check_known(self.reject, "reject")

    def on(self, fields: FieldSet) -> BoundFilter:
        """See PointFilter."""
        return self

    def weigh(self, scan: LabelledScan, estimate: Estimate) -> Float32Array:
        """See BoundFilter."""
        return _between(scan, self.reject, np.float32(-np.inf), 1 - _WHOLE, self.unseen_weight)


@dataclass(frozen=True)
class SoftMask:
    """How likely a return comes from the map, by the class it lands on and how sure that is: no verdict, a prior.

    w = c sum_j s_j p_j + (1 - c) p_background: s_j the share of class j in the circle of the pixel's error, c the model's
    confidence, p_j one of the settings below. The class-conditional sensor model takes w as its prior (times known_prior);
    the likelihood field as an exponent.
    """

    wall: float = setting(1.0, "how likely a return that lands on a wall comes from the map", low=0, high=1)
    partition: float = setting(1.0, "on a partition", low=0, high=1)
    door: float = setting(0.8, "on a door, which may stand otherwise", low=0, high=1)
    glass: float = setting(0.3, "on glass, which most beams pass", low=0, high=1)
    mirror: float = setting(0.1, "on a mirror, which shows another place", low=0, high=1)
    toilet: float = setting(1.0, "on a toilet", low=0, high=1)
    urinal: float = setting(1.0, "on a urinal", low=0, high=1)
    sink: float = setting(1.0, "on a wash basin", low=0, high=1)
    floor: float = setting(0.5, "on the floor: the pixel missed what the beam met", low=0, high=1)
    ceiling: float = setting(0.5, "on the ceiling", low=0, high=1)
    person: float = setting(0.0, "on a person", low=0, high=1)
    movable: float = setting(0.2, "on what need not stand where the map was made", low=0, high=1)
    other: float = setting(0.6, "on something else that has a name", low=0, high=1)
    background: float = setting(0.5, "on what has none, and as far as the model is not sure", low=0, high=1)
    unseen_weight: float = setting(1.0, "weight of a return that no camera sees", low=0, high=1)

    def on(self, fields: FieldSet) -> BoundFilter:
        """See PointFilter."""
        return self

    def weigh(self, scan: LabelledScan, estimate: Estimate) -> Float32Array:
        """See BoundFilter."""
        priors = np.array([getattr(self, name, self.other) for name in scan.classes], dtype=np.float32)
        sure = np.float32(1.0) if scan.confidences is None else scan.confidences
        doubt = np.float32(self.background)
        return _judged(scan, self.unseen_weight, lambda shares: sure * (shares @ priors) + (1 - sure) * doubt)

    @staticmethod
    def classes() -> tuple[str, ...]:
        """That have a prior of their own."""
        return tuple(f.name for f in fields(SoftMask) if f.name != "unseen_weight")


def _check_known(names: tuple[str, ...], setting_name: str) -> None:
    """Refuse a word that no class of any model counts as."""
    for name in names:
        if name not in SoftMask.classes():
            raise ValueError(f"{setting_name}: '{name}' is no class; {closest(name, SoftMask.classes())}")


def _between(
    scan: LabelledScan, names: tuple[str, ...], least: np.float32, most: np.float32, unseen_weight: float
) -> Float32Array:
    """(K,) weights: 1 where the share of some classes is in [least, most], 0 where it is not."""
    chosen = _chosen(scan.classes, names)
    if scan.labels is None or scan.shares is None or not scan.classes:
        return _judged(scan, unseen_weight, lambda shares: (shares @ chosen >= least) & (shares @ chosen <= most))
    weights = np.empty(len(scan.weights), dtype=np.float32)
    _judge(scan.labels, scan.shares, chosen, least, most, np.float32(unseen_weight), weights)
    return weights


@njit(cache=True, nogil=True)
def _judge(labels: Any, shares: Any, chosen: Any, least: Any, most: Any, unseen: Any, weights: Any) -> None:
    """See _between, in one pass."""
    for k in range(len(labels)):
        total = np.float32(0.0)
        for c in range(len(chosen)):
            total += shares[k, c] * chosen[c]
        weights[k] = unseen if labels[k] < 0 else np.float32(1.0) if least <= total <= most else np.float32(0.0)


def _judged(scan: LabelledScan, unseen_weight: float, judge: Callable[[Float32Array], Any]) -> Float32Array:
    """(K,) weights: `judge` of the shares (K, C) where a camera says something, `unseen_weight` elsewhere."""
    if scan.labels is None or not scan.classes:
        return np.full(len(scan.weights), unseen_weight, dtype=np.float32)
    seen = scan.labels >= 0
    shares = scan.shares
    if shares is None:
        shares = np.eye(len(scan.classes), dtype=np.float32)[scan.labels] * seen[:, None]
    return np.where(seen, judge(shares), np.float32(unseen_weight)).astype(np.float32)


def _chosen(classes: tuple[str, ...], names: tuple[str, ...]) -> Float32Array:
    """(C,) 1 for the classes that are among the names."""
    return np.array([name in names for name in classes], dtype=np.float32)
