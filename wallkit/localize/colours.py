"""RGB in [0, 1] -> the colour spaces in which ceilings are compared, every channel about as wide as 1.

In `hsv` the hue is a circle: red at 0.99 and red at 0.01 are neighbours. That repairs half of what makes HSV fail; the other
half is that grey has no hue, so noise makes one. `cone` takes hue and saturation as a point of a disc, where greys meet.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from wallkit.core.types import Float32Array

Space = Callable[[Float32Array], Float32Array]
# the channel that is a circle of circumference 1, by space
CIRCLES = {"hsv": 0}


def rgb(colours: Float32Array) -> Float32Array:
    """As it is."""
    return colours


def hsv(colours: Float32Array) -> Float32Array:
    """Hue in [0, 1) round a circle, saturation and value in [0, 1]; the hue of a grey is 0."""
    value, least = colours.max(axis=-1), colours.min(axis=-1)
    chroma = value - least
    safe = np.where(chroma > 0, chroma, 1)
    r, g, b = np.moveaxis(colours, -1, 0)
    sector = np.where(value == r, (g - b) / safe, np.where(value == g, 2 + (b - r) / safe, 4 + (r - g) / safe))
    hue = np.where(chroma > 0, (sector / 6) % 1.0, 0.0)
    saturation = np.where(value > 0, chroma / np.where(value > 0, value, 1), 0.0)
    return np.stack([hue, saturation, value], axis=-1).astype(np.float32)


def cone(colours: Float32Array) -> Float32Array:
    """Hue and chroma as a point of a disc of diameter 1, and the value."""
    hue, saturation, value = np.moveaxis(hsv(colours), -1, 0)
    chroma = saturation * value / 2
    return np.stack([chroma * np.cos(2 * np.pi * hue), chroma * np.sin(2 * np.pi * hue), value], axis=-1).astype(
        np.float32
    )


def lab(colours: Float32Array) -> Float32Array:
    """CIE L*a*b* (D65) over 100, so that a difference of 0.01 is about what a person just sees."""
    linear = np.where(colours <= 0.04045, colours / 12.92, ((np.maximum(colours, 0.04045) + 0.055) / 1.055) ** 2.4)
    t = linear @ _XYZ_OVER_WHITE.T
    f = np.where(t > (6 / 29) ** 3, np.cbrt(np.maximum(t, 1e-9)), t * (29 / 6) ** 2 / 3 + 4 / 29)
    x, y, z = np.moveaxis(f, -1, 0)
    return np.stack([1.16 * y - 0.16, 5 * (x - y), 2 * (y - z)], axis=-1).astype(np.float32)


# sRGB's primaries (IEC 61966-2-1) over the white of D65
_XYZ_OVER_WHITE = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
) / np.array([[0.95047], [1.0], [1.08883]])

SPACES: dict[str, Space] = {"rgb": rgb, "hsv": hsv, "cone": cone, "lab": lab}
