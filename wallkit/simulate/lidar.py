"""A moving robot among walls and people -> sweeps as a planar LiDAR would record them, beam by beam."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wallkit.core.geometry import compose, interpolate_poses
from wallkit.core.types import Float64Array, Int64Array, Scan
from wallkit.simulate.plan import Plan, cast


@dataclass(frozen=True)
class Lidar:
    """A planar LiDAR: field of view, rate, noise, and where it sits on the robot (T_base_lidar, planar)."""

    beams: int = 270
    fov_rad: float = 1.5 * np.pi
    rate_hz: float = 10.0
    range_min_m: float = 0.1
    range_max_m: float = 12.0
    sigma_m: float = 0.015
    sigma_per_m: float = 0.002
    mount: tuple[float, float, float] = (0.2, 0.0, 0.0)
    frame_id: str = "laser"
    # a sweep is cast in so many pieces, each from where the robot is then
    pieces: int = 12

    @property
    def bearings_rad(self) -> Float64Array:
        """(K,) bearings of the beams."""
        return np.linspace(-self.fov_rad / 2, self.fov_rad / 2, self.beams)

    @property
    def beam_interval_s(self) -> float:
        """Time between two beams: the mirror also turns where it does not look."""
        return self.fov_rad / (2 * np.pi) / self.rate_hz / self.beams


def sweep(
    rng: np.random.Generator,
    lidar: Lidar,
    plan: Plan,
    stamps_ns: Int64Array,
    poses: Float64Array,
    at_ns: int,
    discs_at: Callable[[int], Float64Array],
) -> Scan:
    """One sweep that begins at a stamp, while the robot follows poses (T, 3) at stamps (T,) and people move."""
    times_ns = at_ns + np.round(np.arange(lidar.beams) * lidar.beam_interval_s * 1e9).astype(np.int64)
    bearings, ranges = lidar.bearings_rad, np.empty(lidar.beams)
    for piece in np.array_split(np.arange(lidar.beams), lidar.pieces):
        middle_ns = int(times_ns[piece[len(piece) // 2]])
        origin = compose(interpolate_poses(stamps_ns, poses, [middle_ns])[0], np.array(lidar.mount))
        ranges[piece] = cast(plan, discs_at(middle_ns), origin[:2], origin[2] + bearings[piece], lidar.range_max_m)
    ranges += rng.standard_normal(lidar.beams) * (
        lidar.sigma_m + lidar.sigma_per_m * np.where(np.isfinite(ranges), ranges, 0)
    )
    ranges = np.where(ranges < lidar.range_min_m, np.nan, np.round(ranges, 3))
    return Scan(
        at_ns,
        lidar.frame_id,
        ranges.astype(np.float32),
        bearings.astype(np.float32),
        lidar.beam_interval_s,
        lidar.range_min_m,
        lidar.range_max_m,
    )
