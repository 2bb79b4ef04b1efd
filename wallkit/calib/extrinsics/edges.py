"""LiDAR returns on a plate of known size -> how many pixels beside the plate they are drawn.

Planes alone say nothing about a shift along the board. The run of returns on a plate ends within a beam of its sides, on
both sides alike, so the middle of the run must be drawn on the middle of the plate.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wallkit.calib.extrinsics.sightings import Sighting
from wallkit.core.camera import Camera
from wallkit.core.types import Float64Array

DEFINITION = (
    "px between the middle of each run of returns on the plate, projected with the calibration, and the middle of the"
    " plate's outline along the run, as the camera sees it"
)
_RING_GAP_RAD = np.radians(0.3)
_FEWEST = 4


@dataclass(frozen=True, eq=False)
class EdgeFit:
    """How far beside the plate the returns are drawn.

    Attributes:
        offsets_px: (V,) of each view that has one, signed along the run: positive is to the right in the picture.
        names: of those views. spacing_px: (V,) between neighbouring returns.
    """

    offsets_px: Float64Array
    names: tuple[str, ...]
    spacing_px: Float64Array

    @property
    def rms_px(self) -> float:
        """Over the views."""
        return float(np.sqrt(np.mean(self.offsets_px**2))) if len(self.offsets_px) else float("nan")

    @property
    def p95_px(self) -> float:
        """95th percentile over the views."""
        return float(np.percentile(np.abs(self.offsets_px), 95)) if len(self.offsets_px) else float("nan")


def edge_fit(
    camera: Camera, places: Sequence[Float64Array], sightings: Sequence[Sighting], plate_corners: Float64Array
) -> EdgeFit:
    """Where the returns are drawn beside plates (4, 3 corners in the board frame), each view by its own transform."""
    offsets, names, spacings = [], [], []
    for T, view in zip(places, sightings, strict=True):
        board = view.board.T_camera_board
        outline = camera.project(plate_corners @ board[:3, :3].T + board[:3, 3])
        if not np.isfinite(outline).all():
            continue
        found = [
            pair
            for run in _runs(view.points_m)
            if (pair := _offset(camera.project(run @ T[:3, :3].T + T[:3, 3]), outline)) is not None
        ]
        if found:
            offset, spacing = np.array(found).T
            offsets.append(float(np.median(offset)))
            spacings.append(float(np.median(spacing)))
            names.append(view.name)
    return EdgeFit(np.array(offsets), tuple(names), np.array(spacings))


def _runs(points: Float64Array) -> list[Float64Array]:
    """Points by ring, which is by elevation, each in the order of bearing."""
    elevation = np.arctan2(points[:, 2], np.hypot(points[:, 0], points[:, 1]))
    order = np.argsort(elevation, kind="stable")
    cuts = np.flatnonzero(np.diff(elevation[order]) > _RING_GAP_RAD) + 1
    runs = [points[group] for group in np.split(order, cuts) if len(group) >= _FEWEST]
    return [run[np.argsort(np.arctan2(run[:, 1], run[:, 0]))] for run in runs]


def _offset(pixels: Float64Array, outline: Float64Array) -> tuple[float, float] | None:
    """Signed px between the middles of a run and of the outline's cut along it, and between neighbours of the run."""
    if not np.isfinite(pixels).all():
        return None
    first, last = pixels[0], pixels[-1]
    length = float(np.linalg.norm(last - first))
    if length < 5:
        return None
    along = (last - first) / length * (1 if last[0] >= first[0] else -1)
    across = np.array([-along[1], along[0]])
    middle = (first + last) / 2
    side = (outline - middle) @ across
    where = (outline - middle) @ along
    cuts = [
        where[i] + (where[j] - where[i]) * side[i] / (side[i] - side[j])
        for i, j in ((0, 1), (1, 2), (2, 3), (3, 0))
        if (side[i] > 0) != (side[j] > 0)
    ]
    if len(cuts) != 2:
        return None
    return -(cuts[0] + cuts[1]) / 2, length / (len(pixels) - 1)
