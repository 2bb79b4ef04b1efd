"""Views of a board -> how much of the image, of tilts and of distances they cover: what the data can and cannot tell."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wallkit.calib.board.views import Observations
from wallkit.calib.camera.bundle import Fit
from wallkit.core.types import Int64Array

CELLS = 5
_TILTED_RAD = np.deg2rad(25)


@dataclass(frozen=True, slots=True)
class Coverage:
    """What the views cover.

    Attributes:
        hull_share: area of the convex hull of all corners as a share of the image.
        cell_share: share of the 5 x 5 cells of the image with a corner. counts: (5, 5) corners in each.
        tilted_x, tilted_y: views whose board leans by more than 25 deg about the image's x axis, and about its y axis.
        size_ratio: largest by smallest size of the board in the image.
    """

    hull_share: float
    cell_share: float
    counts: Int64Array
    tilted_x: int
    tilted_y: int
    size_ratio: float


def coverage_of(fit: Fit, seen: Observations) -> Coverage:
    """The coverage of the views of a fit."""
    from scipy.spatial import ConvexHull

    camera = fit.camera
    # in two dimensions SciPy calls the area "volume"
    hull = float(ConvexHull(seen.pixels).volume) / (camera.width * camera.height)
    cells = np.clip((seen.pixels + 0.5) * CELLS / (camera.width, camera.height), 0, CELLS - 1).astype(np.int64)
    counts = np.bincount(cells[:, 1] * CELLS + cells[:, 0], minlength=CELLS**2).reshape(CELLS, CELLS)
    normals = fit.poses[:, :3, 2] * np.sign(fit.poses[:, 2, 2])[:, None]
    sizes = np.array([_size(seen, view) for view in range(seen.count)])
    return Coverage(
        hull,
        float((counts > 0).mean()),
        counts.astype(np.int64),
        int((np.abs(np.arctan2(normals[:, 1], normals[:, 2])) > _TILTED_RAD).sum()),
        int((np.abs(np.arctan2(normals[:, 0], normals[:, 2])) > _TILTED_RAD).sum()),
        float(sizes.max() / sizes.min()),
    )


def _size(seen: Observations, view: int) -> float:
    """Pixels a metre: size in the image by size on the board."""
    rows = seen.views == view
    return float(np.sqrt(seen.pixels[rows].var(axis=0).sum() / seen.points[rows].var(axis=0).sum()))
