"""A camera and its covariance, or two cameras -> by how many pixels a point may land elsewhere, over the image.

A small turn of the camera and a shift of its principal point look the same to whoever uses it, because a later extrinsic
calibration absorbs the turn. So the turn that fits best in the middle of the image is taken out first (mrcal, "implied
rotation"; here to first order for the covariance), and what remains is error of shape.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wallkit.calib.camera.bundle import rotations
from wallkit.core.camera import Camera
from wallkit.core.types import Float64Array

_COLUMNS, _ROWS = 24, 18
# the middle that turns are taken out in: this share of half the diagonal
_MIDDLE = 0.5
_STEPS = 10


@dataclass(frozen=True, slots=True)
class PixelMap:
    """A number of pixels over the image: us (C,), vs (R,) and values (R, C) [px]; NaN where the model sees nothing."""

    us: Float64Array
    vs: Float64Array
    values: Float64Array

    @property
    def centre(self) -> float:
        """Median over the cells nearest to the middle."""
        return self._at(0.0, 0.2)

    @property
    def outer(self) -> float:
        """Median over the cells at 80 % of the way to the corner."""
        return self._at(0.7, 0.9)

    @property
    def worst(self) -> float:
        """Largest value of all cells."""
        return float(np.nanmax(self.values))

    @property
    def median(self) -> float:
        """Median of all cells."""
        return float(np.nanmedian(self.values))

    def _at(self, low: float, high: float) -> float:
        radius = _radii(self.us, self.vs)
        return float(np.nanmedian(self.values[(radius >= low) & (radius <= high)]))


def projection_sigma(camera: Camera, covariance: Float64Array, *, range_m: float = np.inf) -> PixelMap:
    """Standard deviation [px], in its worst direction, of where points at a range land.

    Args:
        covariance: (4 + n, 4 + n) of `camera.parameters`.
        range_m: distance of the points; at a finite one a shift of the camera is taken out too, as extrinsics absorb it.
    """
    us, vs, rays = _grid(camera)
    scale = 1.0 if np.isinf(range_m) else range_m
    by_parameter = camera.parameter_jacobian(rays * scale)
    by_point = camera.point_jacobian(rays * scale)
    by_turn = np.cross((rays * scale)[:, None, :], by_point)
    absorbed = by_turn if np.isinf(range_m) else np.concatenate([by_turn, by_point], -1)
    inner = np.isfinite(by_parameter).all(axis=(1, 2)) & (_radii(us, vs).ravel() <= _MIDDLE)
    width = absorbed.shape[-1]
    held = np.linalg.lstsq(absorbed[inner].reshape(-1, width), by_parameter[inner].reshape(-1, by_parameter.shape[-1]))[
        0
    ]
    remaining = by_parameter - absorbed @ held
    spread = np.einsum("nip,pq,njq->nij", remaining, covariance, remaining)
    a, b, c = spread[:, 0, 0], spread[:, 0, 1], spread[:, 1, 1]
    largest = (a + c) / 2 + np.sqrt(((a - c) / 2) ** 2 + b**2)
    return PixelMap(us, vs, np.sqrt(np.maximum(largest, 0)).reshape(len(vs), len(us)))


def projection_difference(a: Camera, b: Camera) -> PixelMap:
    """Distance [px] between where two cameras put what the first sees at infinity, turned to agree in the middle."""
    us, vs, rays = _grid(a)
    pixels = np.stack(np.meshgrid(us, vs), -1).reshape(-1, 2)
    inner = np.isfinite(rays).all(axis=1) & (_radii(us, vs).ravel() <= _MIDDLE)
    R = np.eye(3)
    for _ in range(_STEPS):
        turned = rays @ R.T
        miss, by_point = b.project(turned) - pixels, b.point_jacobian(turned)
        use = inner & np.isfinite(miss).all(axis=1)
        by_turn = np.cross(turned[use][:, None, :], by_point[use])
        step = np.asarray(np.linalg.lstsq(by_turn.reshape(-1, 3), -miss[use].ravel())[0], dtype=np.float64)
        R = rotations(step[None])[0] @ R
    miss = b.project(rays @ R.T) - pixels
    return PixelMap(us, vs, np.hypot(miss[:, 0], miss[:, 1]).reshape(len(vs), len(us)))


def _grid(camera: Camera) -> tuple[Float64Array, Float64Array, Float64Array]:
    """Columns, rows and the unit rays (R * C, 3) of a grid of pixels over the whole image."""
    us, vs = np.linspace(0, camera.width - 1, _COLUMNS), np.linspace(0, camera.height - 1, _ROWS)
    return us, vs, camera.unproject(np.stack(np.meshgrid(us, vs), -1).reshape(-1, 2))


def _radii(us: Float64Array, vs: Float64Array) -> Float64Array:
    """(R, C) distance from the middle as a share of half the diagonal."""
    u, v = np.meshgrid(us - us.mean(), vs - vs.mean())
    return np.asarray(np.hypot(u, v) / np.hypot(u, v).max())
