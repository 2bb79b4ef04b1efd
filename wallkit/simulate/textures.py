"""A name and a generator of chance -> a picture of a surface with its size in metres, that repeats without a seam.

Nothing is downloaded: paint is filtered noise, tiles are tiles with grout, and every colour is drawn.
"""

from __future__ import annotations

import colorsys
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from wallkit.core.types import Float64Array, UInt8Array

Colour = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Texture:
    """pixels (h, w, 3) RGB, row 0 on top; size_m (width, height) of the piece of surface it shows.

    begins_m: where on it, right and up from its lower left corner, the surface begins.
    """

    pixels: UInt8Array
    size_m: tuple[float, float]
    begins_m: tuple[float, float] = (0.0, 0.0)


Make = Callable[[np.random.Generator, Colour], Texture]


def colour(rng: np.random.Generator, hue: float, saturation: float, value: float, *, spread: float = 0.04) -> Colour:
    """An RGB colour in [0, 1] about a hue, saturation and brightness."""
    h, s, v = np.array([hue, saturation, value]) + rng.normal(0, spread, 3)
    return colorsys.hsv_to_rgb(h % 1.0, float(np.clip(s, 0, 1)), float(np.clip(v, 0.05, 1)))


def fractal(
    rng: np.random.Generator, shape: tuple[int, int], *, slope: float = 1.5, least: float = 1.0
) -> Float64Array:
    """(h, w) noise of mean 0 and deviation 1 whose power falls with frequency; its edges meet.

    Args:
        slope: amplitude ~ frequency^-slope: 0 is grain, 2 are clouds. least: no waves longer than 1 / least of the picture.
    """
    fy, fx = np.fft.fftfreq(shape[0])[:, None] * shape[0], np.fft.rfftfreq(shape[1])[None] * shape[1]
    frequency = np.hypot(fy, fx)
    gain = np.where(frequency >= least, 1 / np.maximum(frequency, 1.0) ** slope, 0.0)
    waves = np.fft.irfft2(np.fft.rfft2(rng.standard_normal(shape)) * gain, s=shape)
    return np.asarray(waves / max(float(waves.std()), 1e-12))


# -------------------------------------------------------------------------------------------- kinds of surface


def _flat(shade: Float64Array, base: Colour) -> UInt8Array:
    """A colour times a shade (h, w) around 1."""
    return np.asarray(np.clip(shade[..., None] * np.array(base) * 255, 0, 255).astype(np.uint8))


def _paint(rng: np.random.Generator, base: Colour) -> Texture:
    """Rolled paint: faint clouds, a grain, and a few scuffs."""
    shade = 1 + 0.012 * fractal(rng, (256, 256), slope=1.6) + 0.008 * rng.standard_normal((256, 256))
    return Texture(_scuffed(rng, _flat(shade, base), int(rng.integers(0, 4))), (2.4, 2.4))


def _plaster(rng: np.random.Generator, base: Colour) -> Texture:
    """Plaster: clouds one can see, and a coarse grain."""
    rough = fractal(rng, (384, 384), slope=0.6, least=8)
    shade = 1 + 0.045 * fractal(rng, (384, 384), slope=1.4) + 0.03 * rough
    return Texture(_flat(shade, base), (2.0, 2.0))


def _scuffed(rng: np.random.Generator, pixels: UInt8Array, count: int) -> UInt8Array:
    import cv2

    marked = pixels.copy()
    size = np.array(pixels.shape[1::-1])
    for _ in range(count):
        at = rng.uniform(0.1, 0.8, 2) * size
        end = at + rng.normal(0, 0.05, 2) * size
        dark = (0.8 * pixels[0, 0]).astype(int).tolist()
        cv2.line(marked, at.astype(int).tolist(), end.astype(int).tolist(), dark, 1, cv2.LINE_AA)
    return marked


def _grid(
    rng: np.random.Generator,
    base: Colour,
    *,
    tile_m: tuple[float, float],
    count: tuple[int, int],
    grout_m: float,
    px_per_m: float,
    jitter: float,
    shift: float = 0.0,
    second: Colour | None = None,
) -> Texture:
    """Tiles in columns and rows with grout between; each a little different; every other row shifted; or a chessboard."""
    columns, rows = count
    width, height = (round(n * side * px_per_m) for n, side in zip(count, tile_m, strict=True))
    v = (np.arange(height) + 0.5)[:, None] / height * rows
    row = np.floor(v).astype(int)
    u = ((np.arange(width) + 0.5)[None] / width * columns + shift * (row % 2)) % columns
    column = np.floor(u).astype(int)
    edge_x = np.minimum(u - column, 1 - (u - column)) * tile_m[0]
    edge_y = np.minimum(v - row, 1 - (v - row)) * tile_m[1]
    is_grout = np.minimum(edge_x, edge_y) < grout_m / 2
    shades = 1 + jitter * rng.standard_normal((rows, columns))
    shade = shades[row, column] * (1 + 0.02 * fractal(rng, (height, width), slope=1.2, least=4))
    # the edge of a tile catches the light
    shade = shade * np.where(np.minimum(edge_x, edge_y) < grout_m, 0.96, 1.0)
    pixels = _flat(shade, base)
    if second is not None:
        other = (row + column) % 2 == 1
        pixels = np.where(other[..., None], _flat(shade, second), pixels)
    grout = np.array(colour(rng, 0.1, 0.05, float(rng.uniform(0.45, 0.85))))
    grain = 1 + 0.06 * rng.standard_normal((height, width, 1))
    pixels = np.where(is_grout[..., None], np.clip(grain * grout * 255, 0, 255), pixels)
    return Texture(pixels.astype(np.uint8), (columns * tile_m[0], rows * tile_m[1]))


def _tiles(rng: np.random.Generator, base: Colour) -> Texture:
    side = float(rng.choice([0.10, 0.15, 0.20, 0.30]))
    tall = side * float(rng.choice([1.0, 1.0, 0.5]))
    n = round(1.2 / side)
    return _grid(rng, base, tile_m=(side, tall), count=(n, 2 * n), grout_m=0.004, px_per_m=340, jitter=0.02)


def _floor_tiles(rng: np.random.Generator, base: Colour) -> Texture:
    side = float(rng.choice([0.2, 0.3, 0.4, 0.6]))
    second = None
    if rng.random() < 0.35:
        r, g, b = (0.6 * c for c in base)
        second = (r, g, b)
    return _grid(
        rng, base, tile_m=(side, side), count=(4, 4), grout_m=0.006, px_per_m=128 / side, jitter=0.03, second=second
    )


def _brick(rng: np.random.Generator, base: Colour) -> Texture:
    return _grid(rng, base, tile_m=(0.25, 0.075), count=(6, 20), grout_m=0.011, px_per_m=340, jitter=0.09, shift=0.5)


def _planks(rng: np.random.Generator, base: Colour) -> Texture:
    """Floor boards along the picture, with grain along them."""
    texture = _grid(rng, base, tile_m=(1.2, 0.14), count=(2, 10), grout_m=0.003, px_per_m=240, jitter=0.08, shift=0.37)
    h, w = texture.pixels.shape[:2]
    grain = fractal(rng, (h, w), slope=0.9, least=2)
    lines = np.fft.irfft(np.fft.rfft(grain, axis=1) * (np.arange(w // 2 + 1) < 8), n=w, axis=1)
    shade = 1 + 0.06 * lines / lines.std()
    return Texture(np.clip(texture.pixels * shade[..., None], 0, 255).astype(np.uint8), texture.size_m)


def _terrazzo(rng: np.random.Generator, base: Colour) -> Texture:
    """Chips of stone in cement."""
    import cv2

    n = 512
    pixels = _flat(1 + 0.02 * fractal(rng, (n, n)), base)
    for _ in range(900):
        chip = (np.clip(np.array(base) * rng.uniform(0.45, 1.3) + rng.normal(0, 0.04, 3), 0, 1) * 255).astype(int)
        at, axes = rng.integers(0, n, 2), np.maximum(rng.normal(5, 2.5, 2), 1).astype(int)
        angle = int(rng.integers(180))
        # what hangs over an edge comes in at the other one
        for dx in (-n, 0, n):
            for dy in (-n, 0, n):
                x, y = int(at[0] + dx), int(at[1] + dy)
                if -20 < x < n + 20 and -20 < y < n + 20:
                    cv2.ellipse(pixels, (x, y), axes.tolist(), angle, 0, 360, chip.tolist(), -1, cv2.LINE_AA)
    return Texture(pixels, (1.3, 1.3))


def _carpet(rng: np.random.Generator, base: Colour) -> Texture:
    shade = 1 + 0.10 * rng.standard_normal((256, 256)) + 0.03 * fractal(rng, (256, 256))
    squares = (np.arange(256) // 128)[:, None] ^ (np.arange(256) // 128)[None]
    return Texture(_flat(shade * (1 - 0.05 * squares * (rng.random() < 0.6)), base), (1.0, 1.0))


def _concrete(rng: np.random.Generator, base: Colour) -> Texture:
    shade = 1 + 0.07 * fractal(rng, (384, 384), slope=1.3) + 0.02 * rng.standard_normal((384, 384))
    return Texture(_flat(shade, base), (3.0, 3.0))


def _wood(rng: np.random.Generator, base: Colour) -> Texture:
    """Veneer, the grain upright."""
    across = fractal(rng, (256, 256), slope=1.0, least=2)
    rings = np.sin(2 * np.pi * (np.arange(256)[None] / 256 * 12) + 0.8 * across)
    streaks = np.fft.irfft(np.fft.rfft(across, axis=0) * (np.arange(129) < 4)[:, None], n=256, axis=0)
    return Texture(_flat(1 + 0.035 * rings + 0.05 * streaks / streaks.std(), base), (0.9, 2.1))


def _laminate(rng: np.random.Generator, base: Colour) -> Texture:
    return Texture(_flat(1 + 0.01 * rng.standard_normal((128, 128)), base), (0.6, 0.6))


def _metal(rng: np.random.Generator, base: Colour) -> Texture:
    """Brushed steel."""
    lines = np.repeat(rng.standard_normal((256, 1)), 256, axis=1) + 0.4 * rng.standard_normal((256, 256))
    return Texture(_flat(1 + 0.03 * lines, base), (0.5, 0.5))


def _wainscot(rng: np.random.Generator, base: Colour) -> Texture:
    """Two paints and a rail: made for the whole height of a wall, its lower edge on the floor."""
    height_m, px_per_m = 3.2, 100
    rows, rail = round(height_m * px_per_m), float(rng.uniform(0.9, 1.3))
    z = (rows - np.arange(rows) - 0.5) / px_per_m
    lower = np.array(colour(rng, float(rng.random()), float(rng.uniform(0.1, 0.45)), float(rng.uniform(0.35, 0.75))))
    column = np.where((z < rail)[:, None], lower, np.array(base))
    column = np.where((np.abs(z - rail) < 0.03)[:, None], 0.55 * lower, column)
    column = np.where((z < 0.08)[:, None], 0.4 * lower, column)
    shade = 1 + 0.012 * fractal(rng, (rows, 256), slope=1.6) + 0.006 * rng.standard_normal((rows, 256))
    return Texture(np.clip(column[:, None] * shade[..., None] * 255, 0, 255).astype(np.uint8), (2.56, height_m))


def _ceiling_grid(rng: np.random.Generator, base: Colour) -> Texture:
    """Acoustic panels in a grid of rails, their holes; the same every 1.2 m: the hard case for a ceiling camera."""
    n, side = 480, 1.2
    pixels = _flat(1 + 0.01 * rng.standard_normal((n, n)), base)
    holes = rng.integers(0, n, (5000, 2))
    pixels[holes[:, 1], holes[:, 0]] = (pixels[holes[:, 1], holes[:, 0]] * 0.7).astype(np.uint8)
    for at in (0, n // 2):
        for rail in (pixels[at : at + 9], pixels[:, at : at + 9]):
            rail[:] = (np.array(colour(rng, 0.1, 0.02, 0.78, spread=0.0)) * 255).astype(np.uint8)
    return Texture(pixels, (side, side))


TEXTURES: Mapping[str, Make] = {
    "paint": _paint,
    "plaster": _plaster,
    "tiles": _tiles,
    "floor_tiles": _floor_tiles,
    "brick": _brick,
    "planks": _planks,
    "terrazzo": _terrazzo,
    "carpet": _carpet,
    "concrete": _concrete,
    "wood": _wood,
    "laminate": _laminate,
    "metal": _metal,
    "wainscot": _wainscot,
    "ceiling_grid": _ceiling_grid,
}
