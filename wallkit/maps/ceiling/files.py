"""A ceiling's YAML and picture <-> CeilingMap.

The YAML is map_server's (`image`, `resolution`, `origin`) with one key more, `height` [m]. The picture lies over
the floor plan: its top is +y. Transparent pixels are places nobody has seen.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from wallkit.core.ceiling import CeilingMap
from wallkit.core.types import UInt8Array
from wallkit.errors import MapError
from wallkit.maps.grids.raster import number_in, read_yaml

PICTURES = (".png", ".jpg", ".jpeg", ".webp", ".bmp", ".tif", ".tiff")
_FIT = "`wallkit ceiling fit LOG --picture {} -o ceiling.yaml` finds it from a log that saw this ceiling"


def read_ceiling(path: Path) -> CeilingMap:
    """The ceiling of a YAML and its picture.

    Raises:
        MapError: it cannot be read, is a bare picture without a resolution, or a value is impossible; with file and line.
    """
    if path.suffix.lower() in PICTURES:
        raise MapError("a picture alone has no resolution [m per pixel]", where=path, hint=_FIT.format(path))
    table, lines = read_yaml(path)

    def fail(key: str, message: str, hint: str) -> MapError:
        return MapError(message, where=f"{path}:{lines.get(key, 1)}", hint=hint)

    name = table.get("image")
    if not isinstance(name, str):
        raise fail("image", "'image' is missing" if name is None else f"image is {name!r}", "image: ceiling.png")
    image = Path(name) if Path(name).is_absolute() else path.parent / name
    resolution = number_in(table.get("resolution"))
    if "resolution" not in table:
        raise fail("resolution", "'resolution' [m per pixel] is missing", _FIT.format(image))
    if resolution is None or not resolution > 0:
        raise fail(
            "resolution", f"resolution is {table['resolution']!r}, not a length above 0", "metres per pixel, as 0.01"
        )
    origin = table.get("origin", [0.0, 0.0, 0.0])
    numbers = [number_in(v) for v in origin] if isinstance(origin, list) else []
    if len(numbers) != 3 or None in numbers:
        raise fail("origin", f"origin is {origin!r}", "three numbers: [x, y, yaw] of the lower left corner [m, rad]")
    height = table.get("height")
    height_m = math.nan if height is None else number_in(height)
    if height_m is None or height_m <= 0:
        raise fail("height", f"height is {height!r}, not a length above 0", "metres from the floor to the ceiling")
    pixels, is_seen = _pixels_of(image, f"{path}:{lines.get('image', 1)}")
    return CeilingMap(
        pixels[::-1].copy(), is_seen[::-1].copy(), resolution, np.array(numbers, float), height_m, str(path)
    )


def read_picture(path: Path) -> UInt8Array:
    """(H, W, 4) RGBA of a picture, row 0 at the top.

    Raises:
        MapError: it cannot be read.
    """
    pixels, is_seen = _pixels_of(path, str(path))
    return np.dstack([pixels, np.where(is_seen, 255, 0).astype(np.uint8)])


def ceiling_files(ceiling: CeilingMap, image_name: str, notes: tuple[str, ...] = ()) -> tuple[bytes, bytes]:
    """The YAML and the PNG of a ceiling.

    Args:
        image_name: what the YAML calls the PNG. notes: comments above it.
    """
    x, y, yaw = (f"{v:.6g}" for v in ceiling.origin)
    lines = [*(f"# {note}" for note in notes), f"image: {image_name}", f"resolution: {ceiling.resolution_m:.8g}"]
    lines.append(f"origin: [{x}, {y}, {yaw}]")
    if math.isfinite(ceiling.height_m):
        lines.append(f"height: {ceiling.height_m:.6g}")
    return ("\n".join(lines) + "\n").encode(), png_of(ceiling)


def png_of(ceiling: CeilingMap) -> bytes:
    """The picture, +y at its top, transparent where nobody has seen it."""
    import cv2

    bgr = ceiling.pixels[::-1, :, ::-1]
    if not ceiling.is_seen.all():
        bgr = np.dstack([bgr, np.where(ceiling.is_seen[::-1], 255, 0)])
    _, data = cv2.imencode(".png", np.ascontiguousarray(bgr, dtype=np.uint8))
    return bytes(data)


def _pixels_of(image: Path, where: str) -> tuple[UInt8Array, Any]:
    """RGB (H, W, 3) and which pixels are seen (H, W), row 0 at the top."""
    import cv2

    if not image.is_file():
        raise MapError(f"there is no picture '{image}'", where=where, hint="name a PNG or JPEG of the ceiling")
    pixels = cv2.imdecode(np.fromfile(image, dtype=np.uint8), cv2.IMREAD_UNCHANGED) if image.stat().st_size else None
    if pixels is None:
        raise MapError(f"the picture '{image.name}' cannot be decoded", where=where, hint="PNG or JPEG")
    if pixels.dtype == np.uint16:
        pixels = (pixels // 256).astype(np.uint8)
    if pixels.ndim == 2:
        pixels = np.repeat(pixels[..., None], 3, axis=2)
    is_seen = pixels[..., 3] > 0 if pixels.shape[2] == 4 else np.ones(pixels.shape[:2], dtype=bool)
    return np.ascontiguousarray(pixels[..., 2::-1], dtype=np.uint8), is_seen
