"""map_server YAML + image -> OccupancyGrid, with what is odd about the pair said as findings.

Trinary, scale and raw follow Nav2's map_io.cpp (`loadMapFromFile`), which follows ROS 1's map_server.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wallkit.core.types import Float64Array, Int8Array, OccupancyGrid
from wallkit.errors import Finding, MapError, closest

# what map_saver writes for unknown; with free_thresh above (255 - 205) / 255 it reads back as free
UNKNOWN_GREY = 205
KEYS = ("image", "resolution", "origin", "mode", "negate", "occupied_thresh", "free_thresh")
MODES = ("trinary", "scale", "raw")
OCCUPIED_THRESH, FREE_THRESH = 0.65, 0.196


@dataclass(frozen=True, slots=True)
class RasterSpec:
    """The YAML beside a map image, checked."""

    image: Path
    resolution_m: float
    origin: Float64Array
    mode: str
    negate: bool
    occupied_thresh: float
    free_thresh: float


def read_raster(path: Path) -> tuple[OccupancyGrid, list[Finding]]:
    """The occupancy grid of a map_server YAML, and what a user should know about it.

    Raises:
        MapError: the YAML or its image cannot be read, or a value is impossible; with file and line.
    """
    spec, lines = read_spec(path)
    pixels = _read_image(spec.image, f"{path}:{lines.get('image', 1)}")
    cells = cells_from_pixels(pixels, spec)
    grid = OccupancyGrid(cells, spec.resolution_m, spec.origin, source=str(path))
    return grid, list(_oddities(path, lines, spec, pixels))


def read_spec(path: Path) -> tuple[RasterSpec, dict[str, int]]:
    """The checked YAML of a map, and the line of each of its keys.

    Raises:
        MapError: see read_raster.
    """
    table, lines = read_yaml(path)

    def fail(key: str, message: str, hint: str) -> MapError:
        return MapError(message, where=f"{path}:{lines.get(key, 1)}", hint=hint)

    for key in ("image", "resolution", "origin"):
        if key not in table:
            raise fail(key, f"'{key}' is missing", f"a map_server YAML has {', '.join(KEYS)}")
    mode = str(table.get("mode", "trinary")).lower()
    if mode not in MODES:
        raise fail("mode", f"mode is '{mode}'", closest(mode, MODES))
    resolution = number_in(table["resolution"])
    if resolution is None or not resolution > 0:
        raise fail(
            "resolution",
            f"resolution is {table['resolution']!r}, not a length above 0",
            "metres per pixel, for example 0.05",
        )
    origin = table["origin"]
    numbers = [number_in(v) for v in origin] if isinstance(origin, list) else []
    if len(numbers) != 3 or None in numbers:
        raise fail(
            "origin", f"origin is {origin!r}", "three numbers: [x, y, yaw] of the lower left corner, metres and radians"
        )
    thresholds = {}
    for key, default in (("occupied_thresh", OCCUPIED_THRESH), ("free_thresh", FREE_THRESH)):
        value = number_in(table.get(key, default))
        if value is None or not 0 <= value <= 1:
            raise fail(key, f"{key} is {table.get(key)!r}", "a number between 0 and 1")
        thresholds[key] = value
    if thresholds["occupied_thresh"] <= thresholds["free_thresh"]:
        raise fail(
            "occupied_thresh",
            f"occupied_thresh {thresholds['occupied_thresh']} is not above free_thresh {thresholds['free_thresh']}",
            f"the usual pair is {OCCUPIED_THRESH} and {FREE_THRESH}",
        )
    image = Path(str(table["image"]))
    image = image if image.is_absolute() else path.parent / image
    spec = RasterSpec(
        image, resolution, np.array(numbers, dtype=np.float64), mode, bool(int(table.get("negate", 0))), **thresholds
    )
    return spec, lines


def cells_from_pixels(pixels: np.ndarray, spec: RasterSpec) -> Int8Array:
    """Occupancy (H, W) int8 with row 0 at the bottom, from an image (H, W[, channels]) uint8 with row 0 at the top.

    As Nav2: the alpha channel counts as brightness in trinary mode, makes a pixel unknown in scale mode, is ignored in raw.
    """
    if pixels.ndim == 2:
        pixels = pixels[..., None]
    has_alpha = pixels.shape[2] in (2, 4)
    averaged = pixels[..., :-1] if has_alpha and spec.mode != "trinary" else pixels
    brightest = 255 * averaged.shape[2]
    # one look-up of a few hundred sums instead of floating point arithmetic over millions of pixels
    cells = _cells_from_shades(np.arange(brightest + 1) / brightest, spec)[averaged.sum(axis=2, dtype=np.uint16)]
    if has_alpha and spec.mode == "scale":
        cells[pixels[..., -1] < 255] = -1
    return np.ascontiguousarray(cells[::-1])


def _cells_from_shades(shade: Float64Array, spec: RasterSpec) -> Int8Array:
    """Occupancy of shades in [0, 1]."""
    if spec.mode == "raw":
        value = np.round(shade * 255.0)
        return np.where(value <= 100, value, -1).astype(np.int8)
    occupancy = shade if spec.negate else 1.0 - shade
    between: Float64Array | float = -1.0
    if spec.mode == "scale":
        between = np.rint((occupancy - spec.free_thresh) / (spec.occupied_thresh - spec.free_thresh) * 100.0)
    cells = np.where(occupancy > spec.occupied_thresh, 100, np.where(occupancy < spec.free_thresh, 0, between))
    return cells.astype(np.int8)


def _oddities(path: Path, lines: dict[str, int], spec: RasterSpec, pixels: np.ndarray) -> Any:
    """Findings about a map that loads but may not mean what its author thinks."""
    grey_as_occupancy = (255 - UNKNOWN_GREY) / 255
    if spec.mode == "trinary" and not spec.negate and pixels.ndim == 2 and spec.free_thresh > grey_as_occupancy:
        count = int((pixels == UNKNOWN_GREY).sum())
        if count:
            yield Finding(
                "WK-R002",
                "warning",
                str(path),
                f"free_thresh {spec.free_thresh} turns {count:,} unknown cells (grey {UNKNOWN_GREY}) into free space",
                line=lines.get("free_thresh"),
                hint=f"free_thresh: {FREE_THRESH}",
                detail={"cells": count},
            )
    if abs(spec.origin[2]) > 1e-9:
        yield Finding(
            "WK-R004",
            "info",
            str(path),
            f"the origin is turned by {spec.origin[2]:.4g} rad: honoured here, ignored by many tools",
            line=lines.get("origin"),
        )
    values = np.unique(pixels) if spec.mode != "trinary" else ()
    if 0 < len(values) <= 3:
        yield Finding(
            "WK-R007",
            "warning",
            str(path),
            f"mode is {spec.mode}, but the image has only the values {', '.join(map(str, values))}",
            line=lines.get("mode"),
            hint="mode: trinary",
        )


def read_yaml(path: Path) -> tuple[dict[str, Any], dict[str, int]]:
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise MapError(f"cannot read the map: {error}", where=path, hint="name a map_server YAML") from error
    try:
        table = YAML(typ="rt").load(text)
    except YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f"{path}:{mark.line + 1}" if mark else str(path)
        raise MapError(f"not valid YAML: {getattr(error, 'problem', error)}", where=where) from error
    if not isinstance(table, dict):
        raise MapError("not a map_server YAML: it has no keys", where=path, hint=f"it needs {', '.join(KEYS[:3])}")
    positions: Any = table.lc  # type: ignore[attr-defined]  # ruamel's own dict knows its lines
    return table, {str(key): positions.key(key)[0] + 1 for key in table}


def _read_image(image: Path, where: str) -> np.ndarray:
    import cv2

    if not image.is_file():
        raise MapError(f"the image '{image.name}' is not beside the YAML", where=where, hint=f"expected {image}")
    pixels = cv2.imdecode(np.fromfile(image, dtype=np.uint8), cv2.IMREAD_UNCHANGED) if image.stat().st_size else None
    if pixels is None:
        raise MapError(f"the image '{image.name}' cannot be decoded", where=where, hint="PGM or PNG, 8 bit")
    if pixels.dtype == np.uint16:
        pixels = (pixels // 256).astype(np.uint8)
    if pixels.dtype != np.uint8:
        raise MapError(
            f"the image '{image.name}' has {pixels.dtype} pixels", where=where, hint="save it with 8 bits per pixel"
        )
    return pixels


def number_in(value: Any) -> float | None:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return None
    return float(value) if math.isfinite(value) else None
