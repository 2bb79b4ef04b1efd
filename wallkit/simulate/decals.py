"""A thing's name and the size of one of its faces -> a picture of that face: a toilet's bowl from above, a door with handle.

A fixture stays the box that the map and the LiDAR know; what makes it a fixture is painted on. Every picture is for a face
seen from outside, upright, and fills it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from wallkit.simulate.textures import TEXTURES, Colour, Texture, colour, fractal

_PX_PER_M = 400.0
_LEAST_PX, _MOST_PX = 24, 900
_FACETS = 24
_GRAIN_PX = 128


class Canvas:
    """A face to paint on, in shares of its width and height from its upper left corner."""

    def __init__(self, rng: np.random.Generator, size_m: tuple[float, float], base: Any) -> None:
        self.size_m = size_m
        self.px = tuple(int(np.clip(round(side * _PX_PER_M), _LEAST_PX, _MOST_PX)) for side in size_m)
        # hardly seen, and most of the work if it were drawn for every pixel
        grain = fractal(rng, (_GRAIN_PX, _GRAIN_PX), slope=1.5)
        rows, columns = (np.arange(side) % _GRAIN_PX for side in self.px[::-1])
        shade = 1 + 0.006 * np.ascontiguousarray(grain[np.ix_(rows, columns)])
        self.pixels = np.clip(shade[..., None] * np.array(base) * 255, 0, 255).astype(np.uint8)

    def ellipse(self, x: float, y: float, rx: float, ry: float, rgb: Any, *, line: float = 0.0) -> None:
        """Filled, or a ring of some width [m]."""
        import cv2

        scale = 1 << 4
        centre = tuple(round(share * side * scale) for share, side in zip((x, y), self.px, strict=True))
        axes = tuple(round(share * side * scale) for share, side in zip((rx, ry), self.px, strict=True))
        width = max(1, round(line * _PX_PER_M)) if line else -1
        cv2.ellipse(self.pixels, centre, axes, 0, 0, 360, _bytes(rgb), width, cv2.LINE_AA, 4)

    def box(self, x0: float, y0: float, x1: float, y1: float, rgb: Any, *, line: float = 0.0) -> None:
        """Filled, or a frame of some width [m]."""
        import cv2

        a = (round(x0 * (self.px[0] - 1)), round(y0 * (self.px[1] - 1)))
        b = (round(x1 * (self.px[0] - 1)), round(y1 * (self.px[1] - 1)))
        width = max(1, round(line * _PX_PER_M)) if line else -1
        cv2.rectangle(self.pixels, a, b, _bytes(rgb), width)

    def hollow(self, x: float, y: float, rx: float, ry: float, rim: Any, floor: Any) -> None:
        """A bowl: ellipses from the colour of its rim to that of its floor, which sinks away."""
        rim, floor = np.array(rim), np.array(floor)
        for k in range(_FACETS + 1):
            t = k / _FACETS
            self.ellipse(x, y + 0.15 * ry * t, rx * (1 - 0.75 * t), ry * (1 - 0.75 * t), rim + t * (floor - rim))

    def done(self) -> Texture:
        """The face as painted."""
        return Texture(self.pixels, self.size_m)


Paint = Callable[[np.random.Generator, tuple[float, float], Colour], Texture]


def _bytes(rgb: Any) -> tuple[int, int, int]:
    r, g, b = (np.clip(np.asarray(rgb, dtype=float), 0, 1) * 255).astype(int).tolist()
    return r, g, b


def _toilet_top(rng: np.random.Generator, size_m: tuple[float, float], base: Colour) -> Texture:
    """Seat and bowl, or a closed lid; the picture's top is at the tank."""
    canvas = Canvas(rng, size_m, 0.82 * np.array(base))
    seat = np.array(base) if rng.random() < 0.8 else np.array(colour(rng, 0.08, 0.1, 0.25))
    canvas.ellipse(0.5, 0.52, 0.47, 0.46, 0.7 * seat)
    canvas.ellipse(0.5, 0.51, 0.46, 0.45, seat)
    if rng.random() < 0.75:
        canvas.ellipse(0.5, 0.54, 0.33, 0.34, 0.55 * seat)
        canvas.hollow(0.5, 0.54, 0.31, 0.32, 0.9 * np.array(base), (0.35, 0.42, 0.46))
    return canvas.done()


def _toilet_front(rng: np.random.Generator, size_m: tuple[float, float], base: Colour) -> Texture:
    """The bowl above, its narrower foot below."""
    canvas = Canvas(rng, size_m, 0.62 * np.array(base))
    for k in range(_FACETS):
        t = k / _FACETS
        canvas.ellipse(0.5, 0.28, 0.5 - 0.1 * t, 0.42 - 0.1 * t, (0.78 + 0.22 * t) * np.array(base))
        canvas.box(0.26 + 0.1 * t, 0.5, 0.74 - 0.1 * t, 1.0, (0.72 + 0.22 * t) * np.array(base))
    canvas.box(0.0, 0.0, 1.0, 0.12, base)
    canvas.box(0.0, 0.12, 1.0, 0.14, 0.6 * np.array(base))
    return canvas.done()


def _tank(rng: np.random.Generator, size_m: tuple[float, float], base: Colour) -> Texture:
    canvas = Canvas(rng, size_m, base)
    canvas.box(0, 0, 1, 0.1, 0.97 * np.array(base))
    canvas.box(0, 0.1, 1, 0.12, 0.6 * np.array(base))
    canvas.ellipse(0.8, 0.22, 0.06, 0.05, (0.55, 0.57, 0.6))
    return canvas.done()


def _urinal_front(rng: np.random.Generator, size_m: tuple[float, float], base: Colour) -> Texture:
    canvas = Canvas(rng, size_m, 0.93 * np.array(base))
    canvas.box(0.04, 0.02, 0.96, 0.98, base)
    canvas.hollow(0.5, 0.55, 0.40, 0.40, 0.85 * np.array(base), 0.45 * np.array(base))
    canvas.ellipse(0.5, 0.86, 0.10, 0.03, (0.30, 0.32, 0.34))
    canvas.ellipse(0.5, 0.07, 0.08, 0.035, (0.5, 0.52, 0.55))
    return canvas.done()


def _sink_top(rng: np.random.Generator, size_m: tuple[float, float], base: Colour) -> Texture:
    """Basin, drain and tap; the picture's top is at the wall."""
    canvas = Canvas(rng, size_m, base)
    canvas.ellipse(0.5, 0.58, 0.42, 0.36, 0.75 * np.array(base))
    canvas.hollow(0.5, 0.58, 0.41, 0.35, 0.92 * np.array(base), 0.62 * np.array(base))
    canvas.ellipse(0.5, 0.63, 0.04, 0.04, (0.25, 0.26, 0.28))
    canvas.box(0.47, 0.06, 0.53, 0.34, (0.62, 0.64, 0.67))
    canvas.ellipse(0.5, 0.12, 0.07, 0.07, (0.72, 0.74, 0.77))
    return canvas.done()


def _sink_front(rng: np.random.Generator, size_m: tuple[float, float], base: Colour) -> Texture:
    canvas = Canvas(rng, size_m, 0.62 * np.array(base))
    for k in range(_FACETS):
        canvas.ellipse(0.5, 0.1, 0.56, 0.85 - 0.4 * k / _FACETS, (0.72 + 0.26 * k / _FACETS) * np.array(base))
    canvas.box(0, 0, 1, 0.14, base)
    return canvas.done()


def _door(rng: np.random.Generator, size_m: tuple[float, float], base: Colour) -> Texture:
    """A leaf with its handle, now and then panels, a kick plate, a sign or a pane."""
    veneer = TEXTURES["wood" if rng.random() < 0.6 else "laminate"](rng, base).pixels
    canvas = Canvas(rng, size_m, base)
    rows, columns = (np.arange(n) * m // n for n, m in zip(canvas.pixels.shape[:2], veneer.shape[:2], strict=True))
    canvas.pixels = np.ascontiguousarray(veneer[rows][:, columns])
    dark = 0.7 * np.array(base)
    if rng.random() < 0.4:
        for y0, y1 in ((0.08, 0.45), (0.55, 0.92)):
            canvas.box(0.15, y0, 0.85, y1, dark, line=0.012)
    if rng.random() < 0.3:
        canvas.box(0.02, 0.88, 0.98, 0.99, (0.66, 0.67, 0.69))
    if rng.random() < 0.6:
        sign = colour(rng, float(rng.random()), 0.6, 0.6)
        canvas.box(0.40, 0.22, 0.60, 0.29, sign)
        canvas.box(0.46, 0.24, 0.54, 0.27, (0.95, 0.95, 0.95))
    canvas.box(0, 0, 1, 1, 0.6 * np.array(base), line=0.015)
    canvas.ellipse(0.92, 0.50, 0.03, 0.03 * size_m[0] / size_m[1], (0.35, 0.35, 0.37))
    canvas.box(0.80, 0.494, 0.93, 0.506, (0.70, 0.71, 0.73))
    return canvas.done()


def _dispenser(rng: np.random.Generator, size_m: tuple[float, float], base: Colour) -> Texture:
    canvas = Canvas(rng, size_m, base)
    canvas.box(0.06, 0.05, 0.94, 0.8, 0.92 * np.array(base))
    canvas.box(0.2, 0.86, 0.8, 0.93, (0.12, 0.12, 0.13))
    canvas.box(0.35, 0.88, 0.65, 1.0, (0.95, 0.95, 0.93))
    canvas.box(0.42, 0.2, 0.58, 0.4, (0.2, 0.3, 0.55))
    return canvas.done()


def _radiator(rng: np.random.Generator, size_m: tuple[float, float], base: Colour) -> Texture:
    canvas = Canvas(rng, size_m, base)
    fins = max(3, round(size_m[0] / 0.06))
    for k in range(fins):
        canvas.box((k + 0.72) / fins, 0.04, (k + 0.95) / fins, 0.96, 0.6 * np.array(base))
    return canvas.done()


def _bin(rng: np.random.Generator, size_m: tuple[float, float], base: Colour) -> Texture:
    canvas = Canvas(rng, size_m, base)
    canvas.box(0, 0, 1, 0.16, 0.7 * np.array(base))
    canvas.box(0.2, 0.04, 0.8, 0.12, (0.05, 0.05, 0.05))
    return canvas.done()


def _drawers(rng: np.random.Generator, size_m: tuple[float, float], base: Colour) -> Texture:
    """The front of a cupboard: doors or drawers with their handles."""
    canvas = Canvas(rng, size_m, base)
    columns = max(1, round(size_m[0] / float(rng.uniform(0.4, 0.7))))
    rows = max(1, round(size_m[1] / float(rng.uniform(0.25, 0.9))))
    for i in range(columns):
        for j in range(rows):
            x0, x1, y0, y1 = i / columns, (i + 1) / columns, j / rows, (j + 1) / rows
            canvas.box(x0, y0, x1, y1, 0.65 * np.array(base), line=0.005)
            x = x0 + 0.5 / columns
            canvas.box(x - 0.12 / columns, y0 + 0.14 / rows, x + 0.12 / columns, y0 + 0.2 / rows, (0.6, 0.6, 0.62))
    return canvas.done()


def _poster(rng: np.random.Generator, size_m: tuple[float, float], base: Colour) -> Texture:
    """A headline, a picture of shapes, lines of text: no words, but what words look like from afar."""
    paper = colour(rng, float(rng.random()), float(rng.uniform(0, 0.5)), float(rng.uniform(0.7, 1)))
    canvas = Canvas(rng, size_m, paper)
    ink = colour(rng, float(rng.random()), 0.7, float(rng.uniform(0.1, 0.6)))
    canvas.box(0.08, 0.05, float(rng.uniform(0.6, 0.92)), 0.13, ink)
    canvas.box(0.08, 0.17, 0.92, 0.6, colour(rng, float(rng.random()), 0.5, 0.7))
    for _ in range(int(rng.integers(2, 6))):
        x, y = rng.uniform(0.2, 0.8), rng.uniform(0.25, 0.52)
        canvas.ellipse(
            x, y, rng.uniform(0.04, 0.12), rng.uniform(0.03, 0.08), colour(rng, float(rng.random()), 0.6, 0.7)
        )
    for y in np.arange(0.65, 0.93, 0.035).tolist():
        canvas.box(0.08, y, float(rng.uniform(0.5, 0.92)), y + 0.014, (0.25, 0.25, 0.25))
    if rng.random() < 0.5:
        canvas.box(0, 0, 1, 1, (0.15, 0.15, 0.15), line=0.012)
    return canvas.done()


def picture(rng: np.random.Generator, name: str, size_m: tuple[float, float], base: Colour) -> Texture:
    """A face of a thing; see DECALS for the names."""
    return DECALS[name](rng, size_m, base)


DECALS: Mapping[str, Paint] = {
    "toilet_top": _toilet_top,
    "toilet_front": _toilet_front,
    "tank": _tank,
    "urinal_front": _urinal_front,
    "sink_top": _sink_top,
    "sink_front": _sink_front,
    "door": _door,
    "dispenser": _dispenser,
    "radiator": _radiator,
    "bin": _bin,
    "drawers": _drawers,
    "poster": _poster,
}
