"""A labelled picture -> the same from nearer or farther, in other paint, other light and through another camera.

Simulated rooms all look somewhat alike. What may differ in a real one is changed here by the labels: each class of a
picture gets a colour cast of its own, so that a door is known by its shape and place, not by its brown.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from wallkit.core.types import Float32Array, Float64Array, UInt8Array
from wallkit.train.pictures import GREY, UNLABELLED


@dataclass(frozen=True)
class Changes:
    """How far pictures are changed; shares are probabilities, (from, to) ranges.

    Attributes:
        close, closer: how often a picture is looked at from so much nearer, at something of a class that is drawn evenly:
            robots meet people who fill the picture, rooms drawn at random hardly do.
    """

    zoom: tuple[float, float] = (0.75, 1.8)
    close: float = 0.15
    closer: tuple[float, float] = (1.8, 3.2)
    stretch: float = 0.12
    turn_deg: float = 4.0
    repainted: float = 0.6
    paint: float = 0.22
    shaded: float = 0.5
    blurred: float = 0.3
    noisy: float = 0.4
    squeezed: float = 0.3
    cluttered: float = 0.12


def changed(
    rng: np.random.Generator,
    image: UInt8Array,
    classes: UInt8Array,
    size: tuple[int, int],
    changes: Changes,
    *,
    other: int = UNLABELLED,
) -> tuple[UInt8Array, UInt8Array]:
    """A variant of a picture (H, W, 3) and its labels (H, W), of width x height.

    Args:
        other: the number of the class of things without a class, for the clutter that is put in.
    """
    image, classes = _moved(rng, image, classes, size, changes)
    light = image.astype(np.float32)
    if rng.random() < changes.repainted:
        light = _repainted(rng, light, classes, changes.paint)
    if rng.random() < changes.cluttered:
        classes = classes.copy()
        for _ in range(int(rng.integers(1, 4))):
            _clutter(rng, light, classes, other)
    if rng.random() < changes.shaded:
        light = _shaded(rng, light)
    return _recorded(rng, _developed(rng, light), changes), classes


# -------------------------------------------------------------------------------------------- details


def _moved(
    rng: np.random.Generator, image: UInt8Array, classes: UInt8Array, size: tuple[int, int], changes: Changes
) -> tuple[UInt8Array, UInt8Array]:
    """Mirrored, zoomed, stretched, turned and shifted, by one warp; beyond the picture it is grey and unlabelled."""
    import cv2

    height, width = classes.shape
    close = rng.random() < changes.close
    zoom = float(np.exp(rng.uniform(*np.log(changes.closer if close else changes.zoom)))) * size[0] / width
    stretch = float(np.exp(rng.normal(0, changes.stretch) / 2))
    turn = np.deg2rad(rng.normal(0, changes.turn_deg))
    flip = -1.0 if rng.random() < 0.5 else 1.0
    c, s = np.cos(turn), np.sin(turn)
    A = np.array([[c, -s], [s, c]]) @ np.diag([flip * zoom * stretch, zoom / stretch])
    # the middle of what is seen stays within the picture, the more freely the closer it is looked at
    slack = np.maximum(1 - np.array(size) / (zoom * np.array([width, height])), 0.1)
    middle = np.array([width, height]) * (0.5 + 0.5 * slack * rng.uniform(-1, 1, 2))
    if close:
        middle = _somewhere(rng, classes, middle)
    M = np.column_stack([A, np.array(size) / 2 - A @ middle])
    way = cv2.INTER_AREA if zoom < 0.6 else cv2.INTER_LINEAR
    moved = cv2.warpAffine(image, M, size, flags=way, borderMode=cv2.BORDER_CONSTANT, borderValue=(GREY,) * 3)
    labels = cv2.warpAffine(
        classes, M, size, flags=cv2.INTER_NEAREST, borderMode=cv2.BORDER_CONSTANT, borderValue=UNLABELLED
    )
    return np.asarray(moved, dtype=np.uint8), np.asarray(labels, dtype=np.uint8)


def _somewhere(rng: np.random.Generator, classes: UInt8Array, middle: Float64Array) -> Float64Array:
    """x, y of a pixel of one of the classes that are there; the middle where nothing is labelled."""
    there = np.unique(classes[::4, ::4])
    there = there[there != UNLABELLED]
    if not there.size:
        return middle
    rows, columns = np.nonzero(classes[::4, ::4] == rng.choice(there))
    at = int(rng.integers(len(rows)))
    return 4.0 * np.array([columns[at], rows[at]])


def _repainted(rng: np.random.Generator, light: Float32Array, classes: UInt8Array, strength: float) -> Float32Array:
    """Every class in paint of its own: its channels times something, some of them more than others."""
    import cv2

    gains = np.exp(rng.normal(0, strength, (256, 3)) + rng.normal(0, strength, (256, 1))).astype(np.float32)
    gains[rng.random(256) < 0.4] = 1.0
    gains[UNLABELLED] = 1.0
    return np.asarray(light * cv2.LUT(cv2.merge([classes] * 3), gains[None]))


def _clutter(rng: np.random.Generator, light: Float32Array, classes: UInt8Array, other: int) -> None:
    """Something unknown stands in the way: a shape in stripes, spots or one colour. Drawn into both arrays."""
    import cv2

    height, width = classes.shape
    extent = np.exp(rng.uniform(np.log(0.05), np.log(0.35), 2)) * height
    middle = rng.uniform(0, 1, 2) * (width, height)
    corners = int(rng.integers(3, 9))
    angles = np.sort(rng.uniform(0, 2 * np.pi, corners))
    outline = middle + extent * rng.uniform(0.6, 1.0, (corners, 1)) * np.column_stack([np.cos(angles), np.sin(angles)])
    mask = np.zeros((height, width), dtype=np.uint8)
    cv2.fillPoly(mask, [outline.round().astype(np.int32)], 1)
    cells = rng.uniform(0, 255, 3) + rng.normal(0, rng.uniform(0, 80), (*rng.integers(1, 24, 2), 3))
    inside = mask.astype(bool) & (classes != UNLABELLED)
    picture = cv2.resize(cells.astype(np.float32), (width, height), interpolation=cv2.INTER_LINEAR)
    light[inside] = np.clip(picture[inside], 0, 255)
    classes[inside] = other


def _shaded(rng: np.random.Generator, light: Float32Array) -> Float32Array:
    """Light that differs smoothly from place to place."""
    import cv2

    cells = np.repeat(np.exp(rng.normal(0, 0.2, (4, 5, 1))), 3, axis=2).astype(np.float32)
    return np.asarray(light * cv2.resize(cells, light.shape[1::-1], interpolation=cv2.INTER_LINEAR))


def _developed(rng: np.random.Generator, light: Float32Array) -> UInt8Array:
    """Exposure, contrast, colour cast and saturation as one matrix; gamma as a table."""
    import cv2

    saturation = float(rng.uniform(0.2, 1.6)) if rng.random() < 0.9 else 0.0
    contrast = float(rng.uniform(0.7, 1.35))
    middle = float(light[::8, ::8].mean())
    M = contrast * (saturation * np.eye(3) + (1 - saturation) / 3)
    # the middle of the picture becomes so bright, and contrast goes up or down from there
    offset = middle * (np.exp(rng.normal(0, 0.3)) - contrast)
    M = np.exp(rng.normal(0, 0.07, (3, 1))) * np.hstack([M, np.full((3, 1), offset)])
    pixels = cv2.convertScaleAbs(np.clip(cv2.transform(light, M.astype(np.float32)), 0, 255))
    table = 255 * (np.arange(256) / 255) ** float(np.exp(rng.normal(0, 0.25)))
    return np.asarray(cv2.LUT(pixels, np.round(table).astype(np.uint8)), dtype=np.uint8)


def _recorded(rng: np.random.Generator, pixels: UInt8Array, changes: Changes) -> UInt8Array:
    """Out of focus, noisy and squeezed by JPEG."""
    import cv2

    made: Any = pixels
    if rng.random() < changes.blurred:
        made = cv2.GaussianBlur(made, (0, 0), float(rng.uniform(0.3, 1.8)))
    if rng.random() < changes.noisy:
        noise = rng.standard_normal(made.shape, dtype=np.float32) * np.float32(rng.uniform(1, 15))
        made = np.clip(made + noise, 0, 255).astype(np.uint8)
    if rng.random() < changes.squeezed:
        _, data = cv2.imencode(".jpg", made, [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(25, 90))])
        made = cv2.imdecode(data, cv2.IMREAD_COLOR)
    return np.asarray(made, dtype=np.uint8)
