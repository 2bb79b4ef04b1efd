"""What is known at the start -> the first particles."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from wallkit.core.geometry import compose, wrap_angle
from wallkit.core.types import FieldSet, Float64Array, StampedPose
from wallkit.errors import MapError

# how well a pose given by hand or by rviz is known, when it comes without a covariance
START_SD = (0.25, 0.25, np.deg2rad(10.0))

Spread = Callable[[np.random.Generator, FieldSet, int], Float64Array]


def around_pose(rng: np.random.Generator, start: StampedPose, n: int) -> Float64Array:
    """Poses (n, 3) normally distributed about a start, with its covariance or START_SD."""
    covariance = np.diag(np.square(START_SD)) if start.covariance is None else start.covariance
    poses = rng.multivariate_normal(start.pose, covariance, n, method="eigh")
    poses[:, 2] = wrap_angle(poses[:, 2])
    return poses


def over_free_space(rng: np.random.Generator, fields: FieldSet, n: int) -> Float64Array:
    """Poses (n, 3) uniform over the cells a robot could stand in, any heading.

    Raises:
        MapError: the map has no free cell.
    """
    rows, columns = np.nonzero(fields.is_free)
    if len(rows) == 0:
        raise MapError(
            "the map has no free space to start in", where=fields.source, hint="check free_thresh and negate"
        )
    cell = rng.integers(0, len(rows), n)
    return _poses_from_cells(rng, fields, columns[cell] + rng.random(n), rows[cell] + rng.random(n))


def over_everything(rng: np.random.Generator, fields: FieldSet, n: int) -> Float64Array:
    """Poses (n, 3) uniform over the whole rectangle, walls and unreachable places included, any heading.

    As the ceiling localizer did, so that one can watch the impossible ones die.
    """
    height, width = fields.shape
    return _poses_from_cells(rng, fields, rng.random(n) * width, rng.random(n) * height)


def _poses_from_cells(rng: np.random.Generator, fields: FieldSet, x: Float64Array, y: Float64Array) -> Float64Array:
    in_grid = np.stack([x * fields.resolution_m, y * fields.resolution_m, rng.uniform(-np.pi, np.pi, len(x))], axis=1)
    return compose(fields.origin, in_grid)


SPREADS: dict[str, Spread] = {
    "global": over_free_space,
    "everywhere": over_everything,
}
