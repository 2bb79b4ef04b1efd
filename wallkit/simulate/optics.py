"""A lens model -> the pinholes that see what it sees, and where each of its pixels is found in them.

MuJoCo renders pinholes. Without distortion one of them is the camera itself; a narrow lens is looked up in one that is
larger than it; a wide one, or one beyond 180 degrees, in up to six sides of a cube.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wallkit.core.camera import Camera
from wallkit.core.types import BoolArray, Float64Array

# farther from the axis than this a pinhole wastes its pixels: use a cube
_WIDEST_TAN = np.tan(np.deg2rad(58.0))
_MARGIN_PX = 3
# optical frame: x right, y down, z forward; the sides of a cube as T_optical_side rotations
_SIDES = {
    "forward": np.eye(3),
    "right": np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]]),
    "left": np.array([[0, 0, -1], [0, 1, 0], [1, 0, 0]]),
    "down": np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]]),
    "up": np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]),
    "back": np.array([[-1, 0, 0], [0, 1, 0], [0, 0, -1]]),
}


@dataclass(frozen=True)
class Pinhole:
    """An ideal camera [px]; pixel (0, 0) is the centre of the upper left one."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float

    @property
    def frustum(self) -> tuple[float, float, float, float]:
        """(left, right, bottom, top) at unit depth, y up."""
        left, right = (-0.5 - self.cx) / self.fx, (self.width - 0.5 - self.cx) / self.fx
        top, bottom = (self.cy + 0.5) / self.fy, (self.cy + 0.5 - self.height) / self.fy
        return left, right, bottom, top

    def finer(self, times: int) -> Pinhole:
        """The same view with so many times as many pixels each way."""
        centre = (times - 1) / 2
        return Pinhole(
            self.width * times, self.height * times, self.fx * times, self.fy * times,
            self.cx * times + centre, self.cy * times + centre,
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Optics:
    """How a camera's picture is put together.

    Attributes:
        rays: (H, W, 3) unit, in the optical frame; NaN where the model has none. sees: (H, W) of them.
        eyes: pinholes with their rotations (3, 3) R_optical_eye; their pictures stand above each other in one sheet.
        columns, rows: (H, W) float32 place of each pixel on the sheet; None where the sheet is the picture.
    """

    rays: Float64Array
    sees: BoolArray
    eyes: tuple[tuple[Pinhole, Float64Array], ...]
    columns: np.ndarray | None
    rows: np.ndarray | None


def optics_of(camera: Camera) -> Optics:
    """The route for a camera: itself, one larger pinhole, or the sides of a cube that it looks through."""
    v, u = np.mgrid[: camera.height, : camera.width].astype(np.float64)
    rays = camera.unproject(np.stack([u, v], axis=-1))
    sees = np.asarray(np.isfinite(rays).all(axis=-1))
    fx, fy, cx, cy = camera.K[[0, 1, 0, 1], [0, 1, 2, 2]].tolist()
    if camera.model != "equidistant" and not camera.D.any():
        eye = Pinhole(camera.width, camera.height, fx, fy, cx, cy)
        return Optics(rays, sees, ((eye, np.eye(3)),), None, None)
    seen = rays[sees]
    ahead = seen[:, 2] > 1e-3
    flat = seen[ahead, :2] / seen[ahead, 2:]
    if ahead.all() and np.hypot(*flat.T).max() < _WIDEST_TAN:
        return _one_larger(rays, sees, flat, fx, fy)
    return _cube(rays, sees, max(fx, fy))


def _one_larger(rays: Float64Array, sees: BoolArray, flat: Float64Array, fx: float, fy: float) -> Optics:
    low, high = flat.min(axis=0) * (fx, fy), flat.max(axis=0) * (fx, fy)
    left, top = (np.floor(low) - _MARGIN_PX).tolist()
    width, height = (np.ceil(high) - np.floor(low) + 2 * _MARGIN_PX + 1).astype(int).tolist()
    eye = Pinhole(width, height, fx, fy, -left, -top)
    with np.errstate(invalid="ignore"):
        columns = rays[..., 0] / rays[..., 2] * fx - left
        rows = rays[..., 1] / rays[..., 2] * fy - top
    return Optics(rays, sees, ((eye, np.eye(3)),), *_filled(sees, columns, rows))


def _cube(rays: Float64Array, sees: BoolArray, focal: float) -> Optics:
    """The sides of a cube that are looked through, of each the part that is, as fine as the camera is in its middle."""
    names = list(_SIDES)
    along = np.stack([rays @ _SIDES[name][:, 2] for name in names], axis=-1)
    side = np.where(sees, np.argmax(np.nan_to_num(along, nan=-2.0), axis=-1), -1)
    columns, rows = np.zeros(rays.shape[:2]), np.zeros(rays.shape[:2])
    found: list[tuple[int, BoolArray, Float64Array]] = []
    for number, name in enumerate(names):
        here = np.asarray(side == number)
        if here.any():
            turned = rays[here] @ _SIDES[name]
            found.append((number, here, turned[:, :2] / turned[:, 2:] * focal))
    # pictures of one width stand above each other
    spans = [np.ceil(np.ptp(places, axis=0)).astype(int) + 2 * _MARGIN_PX + 1 for _, _, places in found]
    width = int(max(span[0] for span in spans))
    eyes: list[tuple[Pinhole, Float64Array]] = []
    above = 0
    for (number, here, places), span in zip(found, spans, strict=True):
        left, top = np.floor(places.min(axis=0)) - _MARGIN_PX
        eyes.append((Pinhole(width, int(span[1]), focal, focal, -left, -top), _SIDES[names[number]].astype(np.float64)))
        columns[here], rows[here] = places[:, 0] - left, places[:, 1] - top + above
        above += int(span[1])
    return Optics(rays, sees, tuple(eyes), *_filled(sees, columns, rows))


def _filled(sees: BoolArray, columns: Float64Array, rows: Float64Array) -> tuple[np.ndarray, np.ndarray]:
    """Places on the sheet as OpenCV takes them; off the sheet for pixels that see nothing."""
    return np.where(sees, columns, -9.0).astype(np.float32), np.where(sees, rows, -9.0).astype(np.float32)
