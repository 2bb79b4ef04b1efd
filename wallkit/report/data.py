"""What a page is made of: everything the pipelines hand to this room."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from wallkit.core.ceiling import CeilingMap
from wallkit.core.results import Episode, Errors, Limits, Value
from wallkit.core.steps import Steps
from wallkit.core.types import Float64Array, OccupancyGrid, Trajectory

Tone = Literal["good", "bad", "unsure"]


@dataclass(frozen=True, slots=True)
class Snapshot:
    """The particles at one update: poses (N, 3) in frame map, weights (N,) that sum to 1, and why it was chosen."""

    stamp_ns: int
    poses: Float64Array
    weights: Float64Array
    label: str


@dataclass(frozen=True, slots=True)
class Setting:
    """One effective setting by dotted key, its default, and where it came from."""

    key: str
    value: Any
    default: Any
    origin: str = "default"

    @property
    def is_default(self) -> bool:
        """True if nothing was changed."""
        return bool(self.value == self.default)


@dataclass(frozen=True)
class ReportData:
    """One run, ready to be drawn.

    Attributes:
        title: what was localized, in a few words.
        verdict, tone: the answer in one sentence, and whether it is good, bad, or cannot be told (exit 0, 1, 4).
        steps: the run, one row per update; its poses are the estimate.
        run: run.json as it was written: version, argv, seed, hashes of the inputs, machine, times.
        metrics: by key; those in `headline` that exist stand at the top of the page.
        grid: the map; None leaves the walls out.
        ceiling: what it was localized by, alone or too; it lies faded behind the plan.
        truth, errors: None without a known truth.
        odometry: in its own frame; it is drawn from the first estimate on.
        episodes: stretches of wrong estimates, from `evaluate`.
        snapshots: particles at chosen updates.
        dropped: what was left out of the log and of the evaluation, and how many.
        photos: what a camera saw, and what the point filters made of the returns there.
    """

    title: str
    verdict: str
    tone: Tone
    steps: Steps
    run: Mapping[str, Any] = field(default_factory=dict)
    metrics: Mapping[str, Value] = field(default_factory=dict)
    grid: OccupancyGrid | None = None
    ceiling: CeilingMap | None = None
    truth: Trajectory | None = None
    errors: Errors | None = None
    odometry: Trajectory | None = None
    episodes: tuple[Episode, ...] = ()
    limits: Limits = field(default_factory=Limits)
    snapshots: tuple[Snapshot, ...] = ()
    dropped: Mapping[str, int] = field(default_factory=dict)
    settings: tuple[Setting, ...] = ()
    photos: tuple[Photo, ...] = ()
    headline: tuple[str, ...] = (
        "ate_rmse_m",
        "ate_median_m",
        "ate_max_m",
        "heading_error_mean_deg",
        "false_healthy",
        "availability",
        "updates_to_converge",
        "seconds_to_converge",
        "kept_share",
        "update_mean_ms",
        "cpu_percent",
        "peak_memory_mb",
    )


@dataclass(frozen=True, slots=True)
class Picture:
    """One figure: SVG bytes, what it is, what to look for, and the same for those who cannot see it."""

    name: str
    title: str
    caption: str
    alt: str
    svg: bytes


@dataclass(frozen=True)
class Photo:
    """A picture with points on it: what it shows, and JPEG bytes."""

    caption: str
    jpeg: bytes


def settings_from_tables(
    effective: Mapping[str, Any], defaults: Mapping[str, Any], origins: Mapping[str, str]
) -> tuple[Setting, ...]:
    """Nested tables of `core.config.table_from` as flat settings; `origins` are those of `core.config.build`."""
    flat_defaults = flatten(defaults)
    return tuple(
        Setting(key, value, flat_defaults.get(key), origins.get(key, "default"))
        for key, value in flatten(effective).items()
    )


def flatten(table: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """{"a": {"b": 1}} -> {"a.b": 1}; lists stay values."""
    flat: dict[str, Any] = {}
    for key, value in table.items():
        if isinstance(value, Mapping) and value:
            flat.update(flatten(value, f"{prefix}{key}."))
        else:
            flat[f"{prefix}{key}"] = value
    return flat
