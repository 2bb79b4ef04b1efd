"""A scan and where it was taken -> how far each return may be trusted, as weights in [0, 1].

Weights are no verdicts: several filters multiply, a likelihood field takes them as exponents, and the class-conditional
model as the prior that a return comes from the map.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from wallkit.core.config import section, setting
from wallkit.core.raycast import SHORT, classify_rays
from wallkit.core.types import Estimate, FieldSet, Float32Array, Health, LabelledScan
from wallkit.errors import ConfigError, closest
from wallkit.points.kept import KeptSettings
from wallkit.points.line_fit import LineFit
from wallkit.points.look import LookSettings
from wallkit.points.mask_filters import RejectDynamic, SoftMask, WallMask
from wallkit.points.perturb import PerturbSettings


class PointFilter(Protocol):
    """Settings of a point filter."""

    def on(self, fields: FieldSet) -> BoundFilter:
        """The filter on one map."""
        ...


class BoundFilter(Protocol):
    """A point filter on one map."""

    def weigh(self, scan: LabelledScan, estimate: Estimate) -> Float32Array:
        """(K,) float32 in [0, 1] for the returns of a scan; the estimate is the predicted pose, before the scan is used."""
        ...


@dataclass(frozen=True)
class Novelty:
    """Returns in front of the mapped surface are novel: people, carts, moved things (Fox, Burgard & Thrun 1999, section 4).

    It needs to know where it is, so it lets everything pass unless the estimate is LOCALIZED.
    """

    margin_m: float = setting(0.3, "a return is novel when it is this much shorter than predicted", low=0.01)
    margin_per_m: float = setting(0.03, "growth of the margin with range", low=0)
    novel_weight: float = setting(0.0, "weight of a novel return", low=0, high=1)

    def on(self, fields: FieldSet) -> BoundFilter:
        """See PointFilter."""
        return _NoveltyOnMap(self, fields)


@dataclass(frozen=True)
class _NoveltyOnMap:
    settings: Novelty
    fields: FieldSet

    def weigh(self, scan: LabelledScan, estimate: Estimate) -> Float32Array:
        """See BoundFilter."""
        weights = np.ones(len(scan.weights), dtype=np.float32)
        if estimate.health is not Health.LOCALIZED:
            return weights
        s = self.settings
        margins = {"tolerance_m": s.margin_m, "tolerance_per_m": s.margin_per_m}
        weights[classify_rays(self.fields, scan.points, estimate.pose, **margins) == SHORT] = s.novel_weight
        return weights


FILTERS: dict[str, type[PointFilter]] = {
    "wall_mask": WallMask,
    "soft_mask": SoftMask,
    "reject_dynamic": RejectDynamic,
    "line_fit": LineFit,
    "novelty": Novelty,
}
# those that look at what cameras say
WITH_CAMERA = ("wall_mask", "soft_mask", "reject_dynamic")


@dataclass(frozen=True)
class PointsSettings:
    """The [points] table of wallkit.toml."""

    filters: tuple[str, ...] = setting(
        (), "point filters applied in turn, as --filter; their weights multiply: " + ", ".join(FILTERS)
    )
    wall_mask: WallMask = section(WallMask, "only returns that land on walls in a camera's image")
    soft_mask: SoftMask = section(SoftMask, "how likely a return is from the map, by what it lands on in an image")
    reject_dynamic: RejectDynamic = section(RejectDynamic, "no returns that land on people and movable things")
    line_fit: LineFit = section(LineFit, "only returns on long straight lines")
    novelty: Novelty = section(Novelty, "returns in front of the map")
    look: LookSettings = section(LookSettings, "where in an image a return may have landed")
    perturb: PerturbSettings = section(PerturbSettings, "errors put in on purpose, to study what breaks the filters")
    kept: KeptSettings = section(KeptSettings, "when what the filters leave is too little")

    def __post_init__(self) -> None:
        for name in self.filters:
            if name not in FILTERS:
                raise ConfigError(f"no point filter is called '{name}'", hint=closest(name, FILTERS))

    @property
    def needs_camera(self) -> bool:
        """Whether one of the chosen filters looks at images."""
        return any(name in WITH_CAMERA for name in self.filters)

    def wanted(self, name: str) -> tuple[str, ...]:
        """Classes of which a filter needs one at least, or it does nothing good; none: any will do."""
        return {"wall_mask": self.wall_mask.keep, "reject_dynamic": self.reject_dynamic.reject}.get(name, ())

    def without_camera(self) -> PointsSettings:
        """The same with the filters of the LiDAR alone."""
        return replace(self, filters=tuple(name for name in self.filters if name not in WITH_CAMERA))

    def on(self, fields: FieldSet) -> tuple[BoundFilter, ...]:
        """The chosen filters on one map."""
        return tuple(getattr(self, name).on(fields) for name in self.filters)


def apply_filters(filters: Sequence[BoundFilter], scan: LabelledScan, estimate: Estimate) -> LabelledScan:
    """The scan with the product of all filters' weights."""
    for one in filters:
        scan = replace(scan, weights=scan.weights * one.weigh(scan, estimate))
    return scan
