"""Small worlds drawn for the tests: plans, their fields, and scans with exact truth."""

from __future__ import annotations

import numpy as np

from tests.plan import Plan, cast, occupancy, plan_from_polylines
from wallkit.core.geometry import compose
from wallkit.core.types import FieldSet, Float64Array, LabelledScan, Points
from wallkit.maps.grids.fields import fields_from_grid

NOBODY = np.zeros((0, 3))

# an L-shaped room with a pillar and a niche: one pose explains a scan, not several
FLAT = plan_from_polylines(
    [(0, 0), (9, 0), (9, 5), (5, 5), (5, 8), (0, 8), (0, 3), (-1, 3), (-1, 2), (0, 2), (0, 0)],
    [(2, 5), (2.6, 5), (2.6, 5.6), (2, 5.6), (2, 5)],
)
INSIDE = np.array([1.0, 1.0])


def fields_of(plan: Plan, resolution_m: float = 0.05, inside: Float64Array = INSIDE) -> FieldSet:
    """The fields of a plan drawn as thin walls."""
    return fields_from_grid(occupancy(plan, resolution_m, inside=inside), wall_depth_m=0.0)


def scan_at(
    plan: Plan,
    pose: Float64Array,
    *,
    beams: int = 180,
    fov_rad: float = 1.5 * np.pi,
    reach_m: float = 12.0,
    discs: Float64Array = NOBODY,
    sigma_m: float = 0.0,
    mount: tuple[float, float, float] = (0.0, 0.0, 0.0),
    rng: np.random.Generator | None = None,
) -> LabelledScan:
    """What a LiDAR on the robot sees at a true pose (3,), every return with weight 1."""
    lidar = compose(pose, np.array(mount))
    bearings = np.linspace(-fov_rad / 2, fov_rad / 2, beams)
    ranges = cast(plan, discs, lidar[:2], lidar[2] + bearings, reach_m)
    if rng is not None:
        ranges = ranges + sigma_m * rng.standard_normal(beams)
    back = np.flatnonzero(np.isfinite(ranges))
    turned = mount[2] + bearings
    xy = np.array(mount[:2]) + ranges[back, None] * np.column_stack([np.cos(turned[back]), np.sin(turned[back])])
    points = Points(
        0,
        np.column_stack([xy, np.zeros(len(back))]).astype(np.float32),
        ranges[back].astype(np.float32),
        back,
        np.array(mount[:2]),
        reach_m,
        np.delete(turned, back).astype(np.float32),
    )
    return LabelledScan(points, np.ones(len(back), dtype=np.float32))
