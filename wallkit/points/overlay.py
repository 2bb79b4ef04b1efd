"""A picture and LiDAR points in it -> the picture with the points drawn in the colour of their range, and a legend."""

from __future__ import annotations

import numpy as np

from wallkit.core.types import BoolArray, Float64Array, UInt8Array
from wallkit.points.project import Projection

_SHADES = 256
_BAR_SHARE, _LEAST_BAR_PX = 0.07, 34


def draw_points(
    rgb: UInt8Array,
    projection: Projection,
    ranges_m: Float64Array,
    *,
    span_m: tuple[float, float] | None = None,
    title: str = "",
    ring: BoolArray | None = None,
) -> UInt8Array:
    """(H + legend, W, 3) uint8: near points are red, far ones blue, the nearest on top.

    Args:
        rgb: (H, W, 3) or (H, W) uint8. ranges_m: (K,) of the points. span_m: ranges of the legend's ends.
        title: in the legend. ring: (K,) points to draw with a ring around them.
    """
    import cv2

    canvas = np.ascontiguousarray(rgb if rgb.ndim == 3 else np.repeat(rgb[..., None], 3, axis=2)) // 4 * 3
    chosen = np.flatnonzero(projection.is_inside)
    low, high = span_m or span_of(ranges_m[chosen])
    colours = _colours(ranges_m, low, high)
    radius = max(2, round(canvas.shape[1] / 320))
    order = chosen[np.argsort(-ranges_m[chosen], kind="stable")]
    for u, v, k in zip(*np.round(projection.pixels[order]).astype(int).T, order, strict=True):
        cv2.circle(canvas, (int(u), int(v)), radius + 1, (0, 0, 0), -1, cv2.LINE_AA)
        cv2.circle(canvas, (int(u), int(v)), radius, tuple(int(c) for c in colours[k]), -1, cv2.LINE_AA)
        if ring is not None and ring[k]:
            cv2.circle(canvas, (int(u), int(v)), 2 * radius + 1, (255, 255, 255), 1, cv2.LINE_AA)
    bar = _legend(canvas.shape[1], max(_LEAST_BAR_PX, round(_BAR_SHARE * canvas.shape[0])), low, high, title)
    return np.concatenate([canvas, bar])


def span_of(ranges_m: Float64Array) -> tuple[float, float]:
    """Round ends of the legend around most of the ranges."""
    if not len(ranges_m):
        return 0.0, 10.0
    low, high = np.percentile(ranges_m, [2, 98])
    return float(np.floor(low * 2) / 2), float(max(np.ceil(high * 2) / 2, np.floor(low * 2) / 2 + 1))


def png_bytes(rgb: UInt8Array) -> bytes:
    """The picture as a PNG file, the same bytes every time."""
    import cv2

    return bytes(cv2.imencode(".png", rgb[..., ::-1])[1])


def jpeg_bytes(rgb: UInt8Array, *, width: int) -> bytes:
    """The picture as a JPEG file of at most this width, for pages."""
    import cv2

    shrink = width / rgb.shape[1]
    small = rgb if shrink >= 1 else cv2.resize(rgb, None, fx=shrink, fy=shrink, interpolation=cv2.INTER_AREA)
    return bytes(cv2.imencode(".jpg", small[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 82])[1])


def _colours(ranges_m: Float64Array, low: float, high: float) -> UInt8Array:
    """(K, 3) RGB; turbo, red is near."""
    import cv2

    shares = np.nan_to_num((high - ranges_m) / (high - low)).clip(0, 1)
    table = cv2.applyColorMap(np.arange(_SHADES, dtype=np.uint8)[:, None], cv2.COLORMAP_TURBO)[:, 0, ::-1]
    return np.asarray(table[np.round(shares * (_SHADES - 1)).astype(int)], dtype=np.uint8)


def _legend(width: int, height: int, low: float, high: float, title: str) -> UInt8Array:
    """A strip with the colours, ranges in metres under them, and the title to its right."""
    import cv2

    strip = np.full((height, width, 3), 255, np.uint8)
    scale = height / 70
    left, right, top = round(0.02 * width), round(0.5 * width), round(0.12 * height)
    shown = _colours(np.linspace(low, high, right - left), low, high)
    strip[top : round(0.42 * height), left:right] = shown[None]
    count = 5
    for i, metres in enumerate(np.linspace(low, high, count)):
        text = f"{metres:.1f} m"
        size = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, scale, 1)[0][0]
        at = left + (right - left) * i // (count - 1) - (0 if i == 0 else size if i == count - 1 else size // 2)
        cv2.putText(
            strip, text, (at, round(0.85 * height)), cv2.FONT_HERSHEY_SIMPLEX, scale, (40, 40, 40), 1, cv2.LINE_AA
        )
    place = (right + round(0.02 * width), round(0.62 * height))
    cv2.putText(strip, title, place, cv2.FONT_HERSHEY_SIMPLEX, scale, (40, 40, 40), 1, cv2.LINE_AA)
    return strip
