"""Settings of localization by the ceiling: the [localize.ceiling] table of wallkit.toml."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from wallkit.core.config import component, setting
from wallkit.localize.ceiling import CEILINGS, CeilingModel
from wallkit.localize.ceiling_recovery import CEILING_RECOVERIES
from wallkit.localize.recovery import Recovery


@dataclass(frozen=True)
class CeilingSettings:
    """How the ceiling is seen, compared, and believed."""

    model: CeilingModel = component(CEILINGS, "patch", "how likely a view is at a pose")
    side: int = setting(9, "places along an edge of the grid that a view is sampled on", low=1, high=41)
    spacing_m: float = setting(0.15, "between two of them, on the ceiling", low=0.01)
    smooth_m: float = setting(0.04, "sigma by which image and map are blurred", low=0)
    gain: Literal["none", "log"] = setting(
        "log", "log: the brightness of each colour is learned along the log, as the light may have changed"
    )
    gain_views: float = setting(100.0, "views after which an old brightness is half forgotten", low=1)
    distance_m: float = setting(0.1, "driven before another view counts", low=0)
    turn_deg: float = setting(5.0, "or turned", low=0)
    caution: float = setting(
        0.5, "without a LiDAR: exponent of the likelihood while a hypothesis is unconfirmed", low=0.001, high=1
    )
    tolerance: float = setting(
        0.03, "a place whose colour is this near to the map's agrees (root of the mean square)", low=0
    )
    tell_apart: float = setting(
        5.0, "log odds of the last views by which a place the LiDAR takes for possible is ruled out", low=0
    )
    recovery: Recovery = component(CEILING_RECOVERIES, "seek", "without a LiDAR: what is done when views stop fitting")

    def __post_init__(self) -> None:
        if self.side % 2 == 0:
            raise ValueError(f"side is {self.side}: the grid has a middle only if it is odd")
