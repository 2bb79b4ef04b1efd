"""How well poses and returns of a log are known, and how much of it an audit looks at."""

from __future__ import annotations

from dataclasses import dataclass

from wallkit.core.config import setting


@dataclass(frozen=True)
class AuditSettings:
    """The [audit] table of wallkit.toml."""

    sigma_m: float = setting(0.02, "noise of a single return", low=0.001)
    truth_sd_m: float = setting(0.02, "standard deviation of a true position", low=0.001)
    truth_sd_deg: float = setting(0.5, "standard deviation of a true heading", low=0.01)
    localized_sd_m: float = setting(0.03, "least standard deviation of a position that localizing found", low=0.001)
    localized_sd_deg: float = setting(0.5, "least standard deviation of such a heading", low=0.01)
    view_distance_m: float = setting(0.2, "distance driven before another scan is looked at", low=0)
    view_turn_deg: float = setting(10.0, "turn before another scan is looked at", low=0)
    view_pause_s: float = setting(5.0, "time before another scan is looked at while standing", low=0.1)
    views: int = setting(1500, "most scans that are looked at, spread over the log", low=10)
    beams: int = setting(360, "most beams of a scan", low=10)
    coverage_min: float = setting(0.2, "share of the outline below which one cannot tell", low=0, high=1)
    explained_min: float = setting(0.3, "share of the returns on the map below which one cannot tell", low=0, high=1)
