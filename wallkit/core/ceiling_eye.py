"""A camera that looks up and its image -> a view: the colours of the ceiling at places round the robot, in metres.

A pixel's ray meets the plane of the ceiling somewhere in frame base; so a lens of any kind, mounted anywhere and a little
aslant, gives the same square grid of places. Only the place straight above the camera needs no height of the ceiling.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from wallkit.core.camera import Camera
from wallkit.core.ceiling import CeilingMap, CeilingView
from wallkit.core.types import BoolArray, Float32Array, Float64Array, UInt8Array
from wallkit.errors import CalibrationError, LogError

# the least part of the grid that an image must show
_LEAST_SEEN = 0.2


@dataclass(frozen=True, eq=False)
class CeilingEye:
    """A camera below a ceiling, and the grid that its views are sampled on.

    Attributes:
        camera: intrinsics. T_base_optical: (4, 4) where it is on the robot.
        height_m: of the ceiling above frame base; NaN when nobody knows: views show the place straight above alone.
        side: places along an edge of the grid. spacing_m: between two of them.
        smooth_m: sigma by which image and map are blurred, so that neither's grain matters.

    Raises:
        CalibrationError: the camera does not see the place above it, or the ceiling is not above the camera.
    """

    camera: Camera
    T_base_optical: Float64Array
    height_m: float = math.nan
    side: int = 9
    spacing_m: float = 0.15
    smooth_m: float = 0.04

    def __post_init__(self) -> None:
        at = self.camera.project(self.T_base_optical[2, :3])
        if not self.camera.is_inside(at):
            raise CalibrationError(
                "the camera does not see what is straight above it",
                where=self.camera.frame or "camera",
                hint="name the camera that looks up with --image, or correct its pose (tf, URDF or --camera-pose)",
            )
        if self.height_m <= self.camera_height_m:
            raise CalibrationError(
                f"the ceiling, {self.height_m:g} m above the floor, is not above the camera at {self.camera_height_m:g} m",
                where=self.camera.frame or "camera",
                hint="correct `height` in the ceiling's YAML, or the camera's pose",
            )

    @property
    def camera_height_m(self) -> float:
        return float(self.T_base_optical[2, 3])

    @property
    def centre_m(self) -> Float64Array:
        """(2,) in frame base, straight above the camera."""
        return np.asarray(self.T_base_optical[:2, 3])

    @property
    def centre_px(self) -> Float64Array:
        """(2,) where the place straight above the camera is in the image."""
        return self.camera.project(self.T_base_optical[2, :3])

    @cached_property
    def points_m(self) -> Float32Array:
        """(R, C, 2) places of the grid in frame base."""
        side = 1 if math.isnan(self.height_m) else self.side
        steps = (np.arange(side) - (side - 1) / 2) * self.spacing_m
        x, y = np.meshgrid(steps, steps, indexing="ij")
        return (np.stack([x, y], axis=2) + self.centre_m).astype(np.float32)

    @cached_property
    def pixels(self) -> Float64Array:
        """(R, C, 2) where each place is in the image; NaN where the lens does not see it."""
        if math.isnan(self.height_m):
            return self.centre_px[None, None]
        return self.pixels_of(self.points_m)

    @cached_property
    def is_seen(self) -> BoolArray:
        """(R, C) the places inside the image.

        Raises:
            CalibrationError: hardly any of them is.
        """
        inside = self.camera.is_inside(self.pixels)
        if inside.mean() < _LEAST_SEEN:
            raise CalibrationError(
                f"the image shows {inside.mean():.0%} of {self.side} x {self.side} places {self.spacing_m:g} m apart",
                where=self.camera.frame or "camera",
                hint="--set localize.ceiling.spacing_m= to a smaller one",
            )
        return inside

    @property
    def px_per_m(self) -> float:
        """Pixels of the image for a metre of ceiling, straight above."""
        if math.isnan(self.height_m):
            return math.nan
        steps = self.pixels_of(self.centre_m + np.array([(0.0, 0), (0.05, 0)]))
        return float(np.hypot(*(steps[1] - steps[0])) / 0.05)

    def pixels_of(self, points_m: Float64Array | Float32Array) -> Float64Array:
        """(..., 2) where places (..., 2) of the ceiling in frame base are in the image; NaN where the lens sees none."""
        flat = np.asarray(points_m, dtype=np.float64)
        points = np.concatenate([flat, np.full((*flat.shape[:-1], 1), self.height_m)], axis=-1)
        R, t = self.T_base_optical[:3, :3], self.T_base_optical[:3, 3]
        return self.camera.project((points - t) @ R)

    def view(self, stamp_ns: int, image: UInt8Array) -> CeilingView:
        """What an image (H, W, 3) RGB, or (H, W) grey, shows.

        Raises:
            LogError: its size is not the camera's.
        """
        import cv2

        height, width = image.shape[:2]
        if (width, height) != (self.camera.width, self.camera.height):
            raise LogError(
                f"the image has {width} x {height} pixels, its camera_info says {self.camera.width} x {self.camera.height}",
                where=self.camera.frame,
                hint="publish the camera_info of the images as they are",
            )
        if image.ndim == 2:
            image = np.repeat(image[..., None], 3, axis=2)
        sigma = self.smooth_m * self.px_per_m
        if sigma > 0.4:
            image = np.asarray(cv2.GaussianBlur(image, (0, 0), sigma))
        at = np.where(self.is_seen[..., None], self.pixels, -10).astype(np.float32)
        colours = cv2.remap(image, at[..., 0], at[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        grid = np.where(self.is_seen[..., None], colours.reshape(*at.shape[:2], 3).astype(np.float32) / 255, 0)
        u, v = self.centre_px.astype(np.float32)[:, None, None]
        centre = cv2.remap(image, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE).reshape(3) / np.float32(255)
        return CeilingView(stamp_ns, self.points_m, grid.astype(np.float32), self.is_seen, self.centre_m, centre)


def smoothed(ceiling: CeilingMap, sigma_m: float) -> CeilingMap:
    """The ceiling blurred by a Gaussian; what is not seen lends no colour. Pixels far finer than the blur are merged."""
    import cv2

    step = int(sigma_m / 2 / ceiling.resolution_m)
    if step >= 2:
        ceiling = _merged(ceiling, step)
    sigma = sigma_m / ceiling.resolution_m
    if sigma < 0.4:
        return ceiling
    known = ceiling.is_seen.astype(np.float32)
    share = np.maximum(cv2.GaussianBlur(known, (0, 0), sigma), 1e-6)
    blurred = cv2.GaussianBlur(ceiling.pixels.astype(np.float32) * known[..., None], (0, 0), sigma) / share[..., None]
    return replace(ceiling, pixels=np.clip(np.rint(blurred), 0, 255).astype(np.uint8))


def _merged(ceiling: CeilingMap, step: int) -> CeilingMap:
    """The ceiling with step x step pixels made one, their mean; a rest at the upper and right edge is left out."""
    rows, columns = (side // step for side in ceiling.shape)
    known = ceiling.is_seen[: rows * step, : columns * step].reshape(rows, step, columns, step).astype(np.float32)
    pixels = ceiling.pixels[: rows * step, : columns * step].reshape(rows, step, columns, step, 3)
    share = known.sum(axis=(1, 3))
    means = (pixels * known[..., None]).sum(axis=(1, 3)) / np.maximum(share, 1)[..., None]
    return replace(
        ceiling,
        pixels=np.rint(means).astype(np.uint8),
        is_seen=share > step * step / 2,
        resolution_m=step * ceiling.resolution_m,
    )
