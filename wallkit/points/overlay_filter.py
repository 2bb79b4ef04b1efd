"""An image, its masks and the returns on it -> two pictures side by side: all returns, and what the filters made of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wallkit.core.types import BoolArray, Float32Array, Float64Array, UInt8Array

KEPT_RGB, REJECTED_RGB, BEFORE_RGB, PASSED_RGB = (0, 200, 83), (255, 23, 68), (30, 30, 30), (245, 245, 245)
NOTHING = 255
_COLOURS = {
    "wall": (105, 140, 215),
    "partition": (190, 140, 60),
    "door": (235, 120, 30),
    "glass": (0, 110, 220),
    "mirror": (120, 200, 255),
    "toilet": (117, 112, 230),
    "urinal": (231, 41, 138),
    "sink": (27, 158, 119),
    "floor": (150, 140, 120),
    "ceiling": (220, 220, 205),
    "person": (230, 25, 40),
    "movable": (250, 170, 40),
    "other": (250, 210, 40),
}
_OPACITY, _BAND_PX = 0.4, 26


def colour_of(role: str) -> tuple[int, int, int]:
    """RGB of a class's masks."""
    return _COLOURS.get(role, (128, 128, 128))


def draw_filtered(
    rgb: UInt8Array,
    ids: UInt8Array,
    classes: Sequence[str],
    pixels: Float64Array,
    weights: Float32Array,
    all_pixels: Float64Array,
    *,
    title: str = "",
) -> UInt8Array:
    """(H + bands, 2 W, 3): left the image with its masks and every return on it, right the same returns as they count.

    Args:
        rgb: (H, W, 3). ids: (H, W) place in `classes`, NOTHING where nobody can tell.
        pixels: (K, 2) of the returns that were looked up. weights: (K,): 1 is green, 0 red.
        all_pixels: (N, 2) of all returns; those that were passed over are small and pale on the left.
    """
    masked = _masked(rgb, ids, classes)
    count, kept = len(weights), int((weights >= 0.5).sum())
    pale = _with_dots(masked, all_pixels) if len(all_pixels) > count else masked
    before = _with_points(pale, pixels, np.tile(np.array(BEFORE_RGB), (count, 1)), np.ones(count, dtype=bool))
    share = weights.astype(np.float64)[:, None]
    colours = share * np.array(KEPT_RGB) + (1 - share) * np.array(REJECTED_RGB)
    after = _with_points(masked, pixels, colours, weights >= 0.5)
    shown = [classes[i] for i in np.unique(ids) if i != NOTHING]
    looked_up = f", {count} looked up (black)" if len(all_pixels) > count else ""
    words = f"{len(all_pixels)} returns in the image{looked_up}", f"{kept} kept (green), {count - kept} rejected (red)"
    top = np.concatenate([_band(masked.shape[1], text) for text in words], axis=1)
    return np.concatenate([top, np.concatenate([before, after], axis=1), _legend(2 * masked.shape[1], shown, title)])


def _masked(rgb: UInt8Array, ids: UInt8Array, classes: Sequence[str]) -> UInt8Array:
    """The image, a part of it in the colours of its masks, their borders white."""
    palette = np.zeros((256, 3))
    palette[: len(classes)] = [colour_of(name) for name in classes]
    blend = np.where((ids != NOTHING)[..., None], (1 - _OPACITY) * rgb + _OPACITY * palette[ids], rgb)
    border = np.zeros(ids.shape, dtype=bool)
    border[:, 1:] |= ids[:, 1:] != ids[:, :-1]
    border[1:] |= ids[1:] != ids[:-1]
    blend[border] = 0.4 * blend[border] + 0.6 * 255
    return np.ascontiguousarray(blend.astype(np.uint8))


def _with_dots(rgb: UInt8Array, pixels: Float64Array) -> UInt8Array:
    import cv2

    canvas, radius = rgb.copy(), max(1, round(rgb.shape[1] / 480))
    for u, v in np.round(pixels):
        cv2.circle(canvas, (int(u), int(v)), radius, PASSED_RGB, -1, cv2.LINE_AA)
    return canvas


def _with_points(rgb: UInt8Array, pixels: Float64Array, colours: Float64Array, is_kept: BoolArray) -> UInt8Array:
    """Kept returns as discs, the others as crosses: to be told apart without colour too."""
    import cv2

    canvas, radius = rgb.copy(), max(2, round(rgb.shape[1] / 240))
    places = [(int(u), int(v)) for u, v in np.round(pixels)]
    # every rim first, so that neighbours do not cover one another
    for at, kept in zip(places, is_kept, strict=True):
        if kept:
            cv2.circle(canvas, at, radius + 1, (255, 255, 255), -1, cv2.LINE_AA)
        else:
            cv2.drawMarker(canvas, at, (255, 255, 255), cv2.MARKER_TILTED_CROSS, 2 * radius + 3, 3, cv2.LINE_AA)
    for at, kept, colour in zip(places, is_kept, colours, strict=True):
        ink = tuple(int(c) for c in colour)
        if kept:
            cv2.circle(canvas, at, radius, ink, -1, cv2.LINE_AA)
        else:
            cv2.drawMarker(canvas, at, ink, cv2.MARKER_TILTED_CROSS, 2 * radius + 3, 1, cv2.LINE_AA)
    return canvas


def _band(width: int, text: str) -> UInt8Array:
    import cv2

    band = np.full((_BAND_PX, width, 3), 255, np.uint8)
    cv2.putText(band, text, (8, 18), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (40, 40, 40), 1, cv2.LINE_AA)
    return band


def _legend(width: int, shown: Sequence[str], title: str) -> UInt8Array:
    """The colours of the masks that are in the picture, and the title to their right."""
    import cv2

    band, x = np.full((_BAND_PX, width, 3), 255, np.uint8), 8
    for name in shown:
        cv2.rectangle(band, (x, 7), (x + 12, 19), colour_of(name), -1)
        cv2.putText(band, name, (x + 17, 18), cv2.FONT_HERSHEY_SIMPLEX, 0.45, (40, 40, 40), 1, cv2.LINE_AA)
        x += 17 + cv2.getTextSize(name, cv2.FONT_HERSHEY_SIMPLEX, 0.45, 1)[0][0] + 16
    room = cv2.getTextSize(title, cv2.FONT_HERSHEY_SIMPLEX, 0.45, 1)[0][0]
    if x + room < width - 8:
        cv2.putText(band, title, (width - room - 8, 18), cv2.FONT_HERSHEY_SIMPLEX, 0.45, (40, 40, 40), 1, cv2.LINE_AA)
    return band
