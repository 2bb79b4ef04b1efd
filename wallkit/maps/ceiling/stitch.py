"""Views of a ceiling from known poses -> one picture of it: a mean over all that saw a place, the nearest counting most."""

from __future__ import annotations

import numpy as np

from wallkit.core.ceiling import CeilingMap
from wallkit.core.ceiling_eye import CeilingEye
from wallkit.core.geometry import invert, transform_points
from wallkit.core.types import Float64Array, UInt8Array

# a place so far aside, in heights of the ceiling above the camera, counts a tenth of one straight above
_ASIDE = 0.6
_FARTHEST = 0.9
_LEAST_WEIGHT = 0.05


class Stitching:
    """Sums of colours on a lattice of the floor plan.

    Args:
        low, high: (2,) extent in frame map. resolution_m: of a pixel.
        evens: whether each image is brought to the brightness of what is there already: cameras expose themselves.
    """

    def __init__(self, low: Float64Array, high: Float64Array, resolution_m: float, *, evens: bool = True) -> None:
        columns, rows = np.ceil((high - low) / resolution_m).astype(int).tolist()
        self._low, self._resolution_m, self._evens = low, resolution_m, evens
        self._sums = np.zeros((rows, columns, 3), dtype=np.float32)
        self._weights = np.zeros((rows, columns), dtype=np.float32)

    def add(self, eye: CeilingEye, image: UInt8Array, pose: Float64Array) -> None:
        """An image (H, W, 3) RGB taken at a pose (3,) of the robot in frame map."""
        import cv2

        above = eye.height_m - eye.camera_height_m
        middle = transform_points(pose, eye.centre_m[None])[0]
        at = (middle - self._low) / self._resolution_m
        reach = _FARTHEST * above / self._resolution_m
        c0, r0 = np.maximum(np.floor(at - reach), 0).astype(int).tolist()
        c1, r1 = np.minimum(np.ceil(at + reach), self._weights.shape[::-1]).astype(int).tolist()
        if c1 <= c0 or r1 <= r0:
            return
        x, y = np.meshgrid(np.arange(c0, c1) + 0.5, np.arange(r0, r1) + 0.5)
        places = np.stack([x.ravel(), y.ravel()], axis=1) * self._resolution_m + self._low
        pixels = eye.pixels_of(transform_points(invert(pose), places)).reshape(*x.shape, 2)
        aside = np.hypot(*(places - middle).T).reshape(x.shape) / above
        sees = eye.camera.is_inside(pixels) & (aside < _FARTHEST)
        weights = np.where(sees, 0.1 ** ((aside / _ASIDE) ** 2), 0).astype(np.float32)
        maps = np.where(sees[..., None], pixels, -10).astype(np.float32)
        colours = cv2.remap(image, maps[..., 0], maps[..., 1], cv2.INTER_LINEAR).astype(np.float32)
        window = (slice(r0, r1), slice(c0, c1))
        if self._evens:
            colours /= np.float32(self._brighter(colours, weights, window))
        self._sums[window] += weights[..., None] * colours
        self._weights[window] += weights

    def done(self, height_m: float, source: str) -> CeilingMap:
        """What was stitched, cut to what was seen."""
        seen = self._weights > _LEAST_WEIGHT
        rows, columns = np.flatnonzero(seen.any(axis=1)), np.flatnonzero(seen.any(axis=0))
        r, c = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
        means = self._sums[r, c] / np.maximum(self._weights[r, c], 1e-6)[..., None]
        pixels = np.where(seen[r, c][..., None], np.clip(np.rint(means), 0, 255), 0).astype(np.uint8)
        corner = self._low + np.array([columns[0], rows[0]]) * self._resolution_m
        return CeilingMap(pixels, seen[r, c], self._resolution_m, np.array([*corner, 0.0]), height_m, source)

    def _brighter(self, colours: np.ndarray, weights: np.ndarray, window: tuple[slice, slice]) -> float:
        """How many times brighter an image is than what is there; 1 where that is little."""
        both = (self._weights[window] > 0.5) & (weights > 0.3)
        if both.sum() < 200:
            return 1.0
        there = self._sums[window][both].sum(axis=1) / self._weights[window][both]
        return float(np.clip(np.median(colours[both].sum(axis=1) / np.maximum(there, 1.0)), 0.25, 4.0))
