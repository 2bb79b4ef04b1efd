"""The size of a ceiling and a generator of chance -> one picture of the whole of it that looks the same nowhere twice.

A ceiling camera can only tell where it is by what does not repeat: lamps that hang unevenly, vents, sprinklers, detectors,
loudspeakers, stains of water, panels that were replaced.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from wallkit.core.types import Float64Array, UInt8Array
from wallkit.simulate.textures import Texture, colour, fractal

PANEL_M = 0.6
# one thing of a kind on so many square metres
_EVERY_M2 = {"vent": 14.0, "sprinkler": 9.0, "detector": 25.0, "speaker": 30.0, "stain": 12.0, "hatch": 40.0}
_MOST_PX = 4096


def ceiling_picture(
    rng: np.random.Generator, size_m: tuple[float, float], lamps: Float64Array, *, px_per_m: float = 160.0
) -> Texture:
    """The ceiling seen from below.

    Args:
        size_m: its extent in x and y; the picture's columns run along +x, its rows along +y, from the lowest corner.
        lamps: (L, 5) x, y of the centres and extents of the lamps, from the lowest corner [m], and whether each is on.
        px_per_m: less where the picture would be larger than 4096 pixels.
    """
    scale = min(px_per_m, _MOST_PX / max(size_m))
    width, height = (max(8, round(side * scale)) for side in size_m)
    base = np.array(colour(rng, 0.12, 0.03, 0.86))
    shade = 1 + 0.02 * _clouds(rng, height, width) + 0.012 * rng.standard_normal((height, width))
    if rng.random() < 0.7:
        shade = shade * _panels(rng, height, width, scale)
    pixels = np.clip(shade[..., None].astype(np.float32) * base.astype(np.float32) * 255, 0, 255).astype(np.uint8)
    area = size_m[0] * size_m[1]
    for kind, every in _EVERY_M2.items():
        for _ in range(max(1, int(rng.poisson(area / every)))):
            _put(rng, pixels, scale, kind, rng.uniform((0, 0), size_m))
    for x, y, w, h, is_on in lamps.tolist():
        _lamp(pixels, scale, (x, y, w, h), is_on=bool(is_on))
    return Texture(pixels, size_m)


def painted_picture(rng: np.random.Generator, size_m: tuple[float, float], *, px_per_m: float = 60.0) -> Texture:
    """A ceiling of colours that run into each other over metres, as the one the first ceiling localizer drove under.

    Neighbouring places look almost alike, which is what a single pixel has to tell them by.
    """
    import cv2

    scale = min(px_per_m, _MOST_PX / max(size_m))
    width, height = (max(8, round(side * scale)) for side in size_m)
    coarse = (max(8, round(size_m[1] * 2)), max(8, round(size_m[0] * 2)))
    sheets = [
        cv2.resize(fractal(rng, coarse, slope=1.6), (width, height), interpolation=cv2.INTER_CUBIC) for _ in range(3)
    ]
    hue, saturation, value = 180 * (0.5 + 0.28 * sheets[0]), 165 + 40 * sheets[1], 200 + 30 * sheets[2]
    hsv = np.stack([hue % 180, np.clip(saturation, 60, 255), np.clip(value, 90, 255)], axis=2)
    return Texture(np.asarray(cv2.cvtColor(hsv.astype(np.uint8), cv2.COLOR_HSV2RGB)), size_m)


def lamps_of(rng: np.random.Generator, size_m: tuple[float, float]) -> Float64Array:
    """(L, 4) x, y, width, height [m] of lamps from the lowest corner: in uneven rows, some missing."""
    step = float(rng.uniform(2.2, 3.4))
    kind = rng.choice(3)
    w, h = ((1.2, 0.15), (0.6, 0.6), (0.22, 0.22))[kind]
    if rng.random() < 0.5:
        w, h = h, w
    found = [
        (x + rng.uniform(-0.35, 0.35), y + rng.uniform(-0.35, 0.35), w, h)
        for x in np.arange(step / 2, size_m[0], step)
        for y in np.arange(step / 2, size_m[1], step)
        if rng.random() < 0.9
    ]
    return np.array(found or [(size_m[0] / 2, size_m[1] / 2, w, h)])


# -------------------------------------------------------------------------------------------- details


def _clouds(rng: np.random.Generator, height: int, width: int) -> Float64Array:
    """Large faint differences, drawn coarse and enlarged."""
    import cv2

    coarse = fractal(rng, (max(8, height // 16), max(8, width // 16)), slope=1.3)
    return np.asarray(cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC))


def _panels(rng: np.random.Generator, height: int, width: int, scale: float) -> Float64Array:
    """Acoustic panels, each of its own shade, between rails."""
    offset = rng.uniform(0, PANEL_M, 2)
    x, y = (np.arange(width) + 0.5) / scale + offset[0], (np.arange(height) + 0.5) / scale + offset[1]
    column, row = np.floor(x / PANEL_M).astype(int), np.floor(y / PANEL_M).astype(int)
    shades = 1 + 0.03 * rng.standard_normal((row.max() + 1, column.max() + 1))
    # every now and then one was replaced
    shades[rng.random(shades.shape) < 0.04] *= float(rng.uniform(0.85, 0.95))
    rail = max(0.024, 1.5 / scale)
    is_rail = ((x % PANEL_M) < rail)[None] | ((y % PANEL_M) < rail)[:, None]
    return np.where(is_rail, 0.8, shades[row][:, column])


def _put(rng: np.random.Generator, pixels: UInt8Array, scale: float, kind: str, at: Float64Array) -> None:
    import cv2

    def disc(radius_m: float, rgb: Any) -> None:
        centre = (at * scale * 16).astype(int).tolist()
        cv2.circle(pixels, centre, max(8, round(radius_m * scale * 16)), rgb, -1, cv2.LINE_AA, 4)

    def square(half: tuple[float, float], rgb: Any, width: int = -1) -> None:
        a, b = ((at + sign * np.array(half)) * scale for sign in (-1, 1))
        cv2.rectangle(pixels, a.astype(int).tolist(), b.astype(int).tolist(), rgb, width)

    if kind == "vent":
        side = float(rng.uniform(0.15, 0.3))
        square((side, side), (150, 152, 155))
        for k in np.linspace(0.15, 0.85, 4).tolist():
            square((side * k, side * k), (70, 72, 75), max(1, round(0.012 * scale)))
    elif kind == "sprinkler":
        disc(0.045, (185, 185, 188))
        disc(0.018, (95, 60, 50))
    elif kind == "detector":
        disc(0.07, (246, 246, 244))
        disc(0.05, (205, 205, 205))
        disc(0.012, (200, 40, 40))
    elif kind == "speaker":
        disc(0.12, (225, 225, 225))
        disc(0.10, (120, 120, 122))
    elif kind == "hatch":
        square((0.3, 0.3), (130, 130, 130), max(1, round(0.015 * scale)))
    else:
        _stain(rng, pixels, scale, at)


def _stain(rng: np.random.Generator, pixels: UInt8Array, scale: float, at: Float64Array) -> None:
    """Dried water: an uneven ring, darker at its edge."""
    radius = float(rng.uniform(0.08, 0.35))
    half = max(3, int(radius * 1.8 * scale))
    x, y = (at * scale).astype(int).tolist()
    y0, y1, x0, x1 = max(y - half, 0), min(y + half, pixels.shape[0]), max(x - half, 0), min(x + half, pixels.shape[1])
    if y1 - y0 < 2 or x1 - x0 < 2:
        return
    v, u = np.mgrid[y0:y1, x0:x1]
    angle, distance = np.arctan2(v - y, u - x), np.hypot(v - y, u - x) / scale
    wobble = sum(rng.normal(0, 0.18 / k) * np.cos(k * angle + rng.uniform(0, 6.3)) for k in range(1, 6))
    edge = distance / (radius * (1 + wobble))
    strength = np.where(edge < 1, 0.10 + 0.25 * edge**6, 0.0)
    tint = 1 - strength[..., None] * np.array([0.35, 0.55, 0.85])
    pixels[y0:y1, x0:x1] = (pixels[y0:y1, x0:x1] * tint).astype(np.uint8)


def _lamp(pixels: UInt8Array, scale: float, box: tuple[float, float, float, float], *, is_on: bool) -> None:
    import cv2

    x, y, w, h = box
    for grow, rgb in ((0.03, (150, 150, 150)), (0.0, (255, 255, 252) if is_on else (172, 174, 176))):
        a = ((x - w / 2 - grow) * scale, (y - h / 2 - grow) * scale)
        b = ((x + w / 2 + grow) * scale, (y + h / 2 + grow) * scale)
        cv2.rectangle(pixels, tuple(map(int, a)), tuple(map(int, b)), rgb, -1)
