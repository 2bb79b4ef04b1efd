"""A view of the ceiling and the ceiling's map -> how likely every pose is.

A model is a frozen dataclass of settings; `on(ceiling)` prepares its look-up tables once per map, and the result answers
`log_likelihood(poses, view)`. All of them are log w = -cost / temperature with a cost that is 0 for a perfect match: a
temperature says how far a camera and a map may disagree at the right place, and balances LiDAR and ceiling.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

import numpy as np

from wallkit.core.ceiling import CeilingMap, CeilingView
from wallkit.core.config import choice, setting
from wallkit.core.grid import placed
from wallkit.core.types import BoolArray, Float32Array, Float64Array
from wallkit.errors import MapError
from wallkit.localize.ceiling_kernels import UNKNOWN, colour_costs, exposed_costs, gradient_costs, histogram_costs
from wallkit.localize.colours import CIRCLES, SPACES
from wallkit.localize.kernels import in_threads

# darker than this a camera's noise is all there is
_DARK = np.float32(0.02)


class CeilingLikelihood(Protocol):
    """A model of the ceiling on one map."""

    def log_likelihood(self, poses: Float64Array, view: CeilingView) -> Float64Array:
        """(N,) float64 [nat], at most 0, for poses (N, 3) in frame map; a view that shows nothing: zeros."""
        ...


class CeilingModel(Protocol):
    """Settings of a model of the ceiling; `needs_colour` unless brightness is all it compares."""

    needs_colour: ClassVar[bool]

    def on(self, ceiling: CeilingMap, *, threads: int = 1) -> CeilingLikelihood:
        """The model on one map.

        Raises:
            MapError: the map has no colour, and the model needs some.
        """
        ...


@dataclass(frozen=True)
class CentrePixel:
    """The colour straight above the camera: log w = -|| z_robot - z_map ||_4 / T, as the first ceiling localizer weighed.

    It sees no heading and needs no lens, no scale of the image and no height of the ceiling.
    """

    needs_colour: ClassVar[bool] = True
    temperature: float = setting(1.0, "T; 1 as the original", low=1e-4)
    order: float = setting(4.0, "of the norm: 4 as the original; 1, 2 and 4 are fast", low=1, high=64)
    space: str = choice(SPACES, "rgb", "in which colours are compared")
    most: float = setting(2.0, "a difference counts at most so much", low=0.001)
    unseen: float = setting(1.0, "difference of a place outside the map or not seen in it", low=0)

    def on(self, ceiling: CeilingMap, *, threads: int = 1) -> CeilingLikelihood:
        """See CeilingModel."""
        return _Centre(self, ceiling, _image_of(ceiling, self.space), threads)


@dataclass(frozen=True)
class _Centre:
    settings: CentrePixel
    ceiling: CeilingMap
    image: Float32Array
    threads: int

    def log_likelihood(self, poses: Float64Array, view: CeilingView) -> Float64Array:
        """See CeilingLikelihood."""
        if np.isnan(view.centre).any():
            return np.zeros(len(poses))
        return _colour_log(self, poses, view.centre_m[None], view.centre[None])


@dataclass(frozen=True)
class Patch:
    """A grid of colours turned by the particle's heading: log w = -mean_k min(|| z_k - z_map,k ||, most) / T."""

    needs_colour: ClassVar[bool] = True
    temperature: float = setting(0.005, "mean difference of the grid that makes a pose e times less likely", low=1e-4)
    order: float = setting(2.0, "of the norm of a difference; 1, 2 and 4 are fast", low=1, high=64)
    space: str = choice(SPACES, "rgb", "in which colours are compared")
    exposure: float = setting(
        2.0, "a view may be so many times brighter or darker than the map, each for itself; in rgb only", low=1, high=10
    )
    most: float = setting(
        0.1, "a pixel counts at most so much: walls, and lamps that are off, must not rule", low=0.001
    )
    unseen: float = setting(0.1, "difference of a place outside the map or not seen in it", low=0)

    def on(self, ceiling: CeilingMap, *, threads: int = 1) -> CeilingLikelihood:
        """See CeilingModel."""
        _check_colour(ceiling)
        image = _packed(ceiling) if self.space == "rgb" else _image_of(ceiling, self.space)
        return _Patch(self, ceiling, image, threads)


@dataclass(frozen=True)
class _Patch:
    settings: Patch
    ceiling: CeilingMap
    image: Any
    threads: int

    def log_likelihood(self, poses: Float64Array, view: CeilingView) -> Float64Array:
        """See CeilingLikelihood."""
        if not view.is_seen.any():
            return np.zeros(len(poses))
        limit = self.settings.exposure if self.settings.space == "rgb" else None
        return _colour_log(self, poses, view.points_m[view.is_seen], view.colours[view.is_seen], limit)


@dataclass(frozen=True)
class Gradient:
    """Differences of log brightness between neighbours of the grid: what all pixels share, as exposure, drops out."""

    needs_colour: ClassVar[bool] = False
    temperature: float = setting(
        0.006, "mean difference of the gradients that makes a pose e times less likely", low=1e-4
    )
    most: float = setting(0.15, "a pair of neighbours counts at most so much", low=0.001)
    unseen: float = setting(0.1, "of a pair outside the map or not seen in it", low=0)

    def on(self, ceiling: CeilingMap, *, threads: int = 1) -> CeilingLikelihood:
        """See CeilingModel."""
        values = np.where(ceiling.is_seen, _log_brightness(_unit(ceiling.pixels)), 2 * UNKNOWN)
        image = np.ascontiguousarray(np.pad(values, 1, constant_values=2 * UNKNOWN), dtype=np.float32)
        return _Gradient(self, ceiling, image, threads)


@dataclass(frozen=True)
class _Gradient:
    settings: Gradient
    ceiling: CeilingMap
    image: Float32Array
    threads: int

    def log_likelihood(self, poses: Float64Array, view: CeilingView) -> Float64Array:
        """See CeilingLikelihood."""
        s, out = self.settings, np.zeros(len(poses))
        seen = view.is_seen.astype(np.float32)
        if not (view.is_seen[1:] & view.is_seen[:-1]).any():
            return out
        points = np.ascontiguousarray(np.moveaxis(view.points_m / np.float32(self.ceiling.resolution_m), 2, 0))
        values = _log_brightness(view.colours)
        args = (points, values, seen, np.float32(s.most), np.float32(s.unseen), self.image)
        in_threads(gradient_costs, _placed(self.ceiling, poses), args, out, self.threads)
        return np.asarray(-out / s.temperature)


@dataclass(frozen=True)
class Histogram:
    """How often each colour occurs within a circle, by the Bhattacharyya coefficient: log w = -(1 - sum sqrt(p q)) / T.

    It sees no heading and, in the large, no small error of place; it is the one to start from far away.
    """

    needs_colour: ClassVar[bool] = True
    temperature: float = setting(0.05, "1 - coefficient that makes a pose e times less likely", low=1e-4)
    bins: int = setting(6, "of each colour; a colour between two counts for both", low=2, high=12)
    cell_m: float = setting(0.1, "the map's histograms stand so far apart", low=0.01)
    unseen: float = setting(0.5, "1 - coefficient of a place outside the map or not seen in it", low=0)

    def on(self, ceiling: CeilingMap, *, threads: int = 1) -> CeilingLikelihood:
        """See CeilingModel."""
        _check_colour(ceiling)
        return _Histogram(self, ceiling, {}, threads)


@dataclass(frozen=True)
class _Histogram:
    settings: Histogram
    ceiling: CeilingMap
    # by radius in pixels: views of one log share it, so there is one table
    tables: dict[int, Float32Array]
    threads: int

    def log_likelihood(self, poses: Float64Array, view: CeilingView) -> Float64Array:
        """See CeilingLikelihood."""
        out = np.zeros(len(poses))
        grid = view.points_m.astype(np.float64)
        middle = grid.reshape(-1, 2).mean(axis=0)
        radius_m = 0.5 * float(np.hypot(*(grid[0, 0] - grid[-1, 0])))
        inside = view.is_seen & (np.hypot(*np.moveaxis(grid - middle, 2, 0)) <= radius_m + 1e-6)
        if not inside.any():
            return out
        pixels = max(1, round(radius_m / self.ceiling.resolution_m))
        if pixels not in self.tables:
            self.tables[pixels] = self._table(pixels)
        shares = _shared(view.colours[inside], self.settings.bins).mean(axis=0)
        step = max(1, round(self.settings.cell_m / self.ceiling.resolution_m))
        at = _placed(self.ceiling, poses, border=0)
        # one ring of cells that are not known
        at[2:] = at[2:] / np.float32(step) + 1
        offset = (middle / (step * self.ceiling.resolution_m)).astype(np.float32)
        args = (offset, np.sqrt(shares), np.float32(self.settings.unseen), self.tables[pixels])
        in_threads(histogram_costs, at, args, out, self.threads)
        return np.asarray(-out / self.settings.temperature)

    def _table(self, radius: int) -> Float32Array:
        """(H, W, B) roots of the shares of colours within a circle of a radius [pixels] round every cell."""
        import cv2

        step = max(1, round(self.settings.cell_m / self.ceiling.resolution_m))
        disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1, 2 * radius + 1)).astype(np.float32)
        known = self.ceiling.is_seen.astype(np.float32)
        area = cv2.filter2D(known, -1, disc, borderType=cv2.BORDER_CONSTANT)[step // 2 :: step, step // 2 :: step]
        shares = _shared(_unit(self.ceiling.pixels), self.settings.bins) * known[..., None]
        planes = [
            cv2.filter2D(np.ascontiguousarray(plane), -1, disc, borderType=cv2.BORDER_CONSTANT)
            for plane in np.moveaxis(shares, 2, 0)
        ]
        table = np.stack([plane[step // 2 :: step, step // 2 :: step] for plane in planes], axis=2)
        # a circle of which less than half is known tells nothing
        is_known = area > 0.5 * disc.sum()
        scaled = np.where(is_known[..., None], np.maximum(table, 0) / np.maximum(area, 1)[..., None], 0)
        ringed = np.pad(np.sqrt(scaled), ((1, 1), (1, 1), (0, 0)))
        return np.ascontiguousarray(ringed, dtype=np.float32)


# -------------------------------------------------------------------------------------------- details


def _colour_log(
    model: Any, poses: Float64Array, points_m: Any, colours: Float32Array, exposure: float | None = None
) -> Float64Array:
    """-mean cost / T of colours (K, 3) at places (K, 2) of frame base."""
    s, out = model.settings, np.zeros(len(poses))
    points = np.ascontiguousarray((np.asarray(points_m).T / model.ceiling.resolution_m).astype(np.float32))
    values = np.ascontiguousarray(SPACES[s.space](colours.astype(np.float32)).T)
    kernel: Any = colour_costs if exposure is None else exposed_costs
    how = s.space in CIRCLES if exposure is None else np.float32(exposure)
    args = (points, values, np.float32(s.order), how, np.float32(s.most), np.float32(s.unseen), model.image)
    in_threads(kernel, _placed(model.ceiling, poses), args, out, model.threads)
    return np.asarray(-out / s.temperature)


def _placed(ceiling: CeilingMap, poses: Float64Array, *, border: int = 1) -> Float32Array:
    return placed(ceiling, poses, border=border)


def _image_of(ceiling: CeilingMap, space: str) -> Float32Array:
    _check_colour(ceiling)
    return _bordered(SPACES[space](_unit(ceiling.pixels)), ceiling.is_seen)


def _bordered(values: Float32Array, is_seen: BoolArray) -> Float32Array:
    """(H + 2, W + 2, 4): three values and whether they are known, with an unknown border."""
    image = np.concatenate([values, is_seen[..., None].astype(np.float32)], axis=2)
    return np.ascontiguousarray(np.pad(image, ((1, 1), (1, 1), (0, 0))), dtype=np.float32)


def _packed(ceiling: CeilingMap) -> Any:
    """(H + 2, W + 2) uint32: red, green, blue and 1 where it is known, with an unknown border."""
    planes = np.dstack([ceiling.pixels, ceiling.is_seen.astype(np.uint8)])
    ringed = np.ascontiguousarray(np.pad(planes, ((1, 1), (1, 1), (0, 0))))
    return ringed.view("<u4")[..., 0].copy()


def _unit(pixels: Any) -> Float32Array:
    return np.asarray(pixels, dtype=np.float32) / np.float32(255)


def _log_brightness(colours: Float32Array) -> Float32Array:
    grey = colours @ np.array([0.299, 0.587, 0.114], dtype=np.float32)
    return np.log(np.maximum(grey, _DARK))


def _shared(colours: Float32Array, bins: int) -> Float32Array:
    """(..., 3 * bins) of colours (..., 3): each channel's share in its two nearest bins, a third for each channel."""
    at = np.clip(colours, 0, 1)[..., None] * (bins - 1) - np.arange(bins, dtype=np.float32)
    shares = np.maximum(1 - np.abs(at), 0) / np.float32(3)
    return np.asarray(shares.reshape(*colours.shape[:-1], 3 * bins), dtype=np.float32)


def _check_colour(ceiling: CeilingMap) -> None:
    """A colour model on a grey picture compares brightness alone, and calls it colour."""
    seen = ceiling.pixels[ceiling.is_seen].astype(np.int16)
    if len(seen) and int(np.ptp(seen, axis=1).max()) <= 2:
        raise MapError(
            "the ceiling's picture is grey, and this model compares colours",
            where=ceiling.source,
            hint="--set localize.ceiling.model=gradient compares brightness; or take the picture in colour",
        )


CEILINGS: dict[str, type[CeilingModel]] = {
    "centre": CentrePixel,
    "patch": Patch,
    "histogram": Histogram,
    "gradient": Gradient,
}
