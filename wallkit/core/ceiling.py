"""A ceiling as a metric picture, and what a camera sees of it at one moment: the nouns of localization by the ceiling.

A ceiling map lies over the floor plan: +x of the map to the right, +y up, as if one looked down through a roof of glass. A
photograph taken from the floor is its mirror image.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from wallkit.core.geometry import invert, transform_points
from wallkit.core.types import BoolArray, Float32Array, Float64Array, Int64Array, UInt8Array


@dataclass(frozen=True, eq=False)
class CeilingMap:
    """The colours of a ceiling by place.

    Attributes:
        pixels: (H, W, 3) uint8 RGB. Pixel (row 0, column 0) has its corner at the origin; rows go along the picture's +y.
        is_seen: (H, W) bool, where the colour is known.
        resolution_m: side of a pixel.
        origin: (3,) T_map_ceiling as (x, y, yaw): pose of the *corner* of pixel (0, 0).
        height_m: of the ceiling above the floor; NaN when nobody said.
        source: file it came from.
    """

    pixels: UInt8Array
    is_seen: BoolArray
    resolution_m: float
    origin: Float64Array
    height_m: float = math.nan
    source: str = ""

    @property
    def shape(self) -> tuple[int, int]:
        """(H, W) in pixels."""
        height, width = self.is_seen.shape
        return int(height), int(width)

    @property
    def size_m(self) -> tuple[float, float]:
        """Extent along the picture's x and y."""
        height, width = self.shape
        return width * self.resolution_m, height * self.resolution_m

    @property
    def corners(self) -> Float64Array:
        """(4, 2) in frame map, anticlockwise from the origin."""
        width, height = self.size_m
        return transform_points(self.origin, np.array([(0, 0), (width, 0), (width, height), (0, height)]))

    def cells_at(self, points_m: Float64Array) -> tuple[Int64Array, BoolArray]:
        """(row, column) (..., 2) of points (..., 2) of frame map, clipped to the picture, and which lie on a seen pixel."""
        flat = transform_points(invert(self.origin), np.asarray(points_m, dtype=np.float64).reshape(-1, 2))
        cells = np.floor(flat / self.resolution_m).astype(np.int64)[:, ::-1]
        clipped = np.clip(cells, 0, np.array(self.shape) - 1)
        seen = (cells == clipped).all(axis=1) & self.is_seen[clipped[:, 0], clipped[:, 1]]
        shape = np.shape(points_m)[:-1]
        return clipped.reshape(*shape, 2), seen.reshape(shape)


@dataclass(frozen=True, eq=False)
class CeilingView:
    """What a camera sees of the ceiling, sampled on a square grid that turns with the robot.

    Attributes:
        stamp_ns: of the image.
        points_m: (R, C, 2) float32 in frame base: the places on the ceiling; rows go along base x, columns along y.
        colours: (R, C, 3) float32 RGB in [0, 1]; 0 where the image does not reach.
        is_seen: (R, C) bool.
        centre_m: (2,) in frame base, the place straight above the camera. centre: (3,) its colour in [0, 1].
    """

    stamp_ns: int
    points_m: Float32Array
    colours: Float32Array
    is_seen: BoolArray
    centre_m: Float64Array
    centre: Float32Array

    def seen_from(self, T_then_now: Float64Array) -> CeilingView:
        """The same view with its places in frame base of another moment; T (3,) is the pose of this moment in that one."""
        points = transform_points(T_then_now, self.points_m.reshape(-1, 2).astype(np.float64))
        centre = transform_points(T_then_now, self.centre_m[None])[0]
        return replace(self, points_m=points.reshape(self.points_m.shape).astype(np.float32), centre_m=centre)

    def lit(self, gains: Float64Array) -> CeilingView:
        """The view as it were in the map's light: colours divided by gains (3,)."""
        by = gains.astype(np.float32)
        return replace(self, colours=self.colours / by, centre=self.centre / by)


@dataclass(frozen=True, eq=False)
class CeilingSight:
    """A view, and T_odom_base (3,) where it was taken; `gap_s`: longest silence of the odometry since the one before."""

    view: CeilingView
    odometry: Float64Array
    gap_s: float = 0.0

    @property
    def stamp_ns(self) -> int:
        return self.view.stamp_ns


def colours_at(ceiling: CeilingMap, poses: Float64Array, view: CeilingView) -> tuple[Float32Array, BoolArray]:
    """What a view would show at poses (N, 3): colours (N, P, 3) in [0, 1] and which are known (N, P)."""
    points = view.points_m.reshape(-1, 2).astype(np.float64)
    at = np.stack([transform_points(pose, points) for pose in np.atleast_2d(poses)])
    cells, seen = ceiling.cells_at(at)
    colours = ceiling.pixels[cells[..., 0], cells[..., 1]].astype(np.float32) / np.float32(255)
    return colours, seen & view.is_seen.reshape(-1)
