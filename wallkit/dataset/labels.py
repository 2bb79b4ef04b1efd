"""One picture's masks -> its things with outlines, boxes and areas; and the label text, label PNG and numbers of them."""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from wallkit.core.types import Int64Array, UInt8Array
from wallkit.dataset.classes import UNLABELLED, LabelSet
from wallkit.dataset.polygons import Tracing, polygons_from_mask, yolo_line
from wallkit.dataset.rle import counts_from_mask, text_from_counts


@dataclass(frozen=True, eq=False)
class Labelled:
    """A picture and what is in it.

    Attributes:
        name: of its files, without suffix. group: the scene or log it is from; groups are never split.
        image: (H, W, 3) RGB. classes: (H, W) numbers of a label set, UNLABELLED for none; None without labels.
        things: (H, W) number of the thing that each pixel shows, -1 for none; None: parts of a class are things.
        more: what else is known of it, for the manifest.
    """

    name: str
    group: str
    image: UInt8Array
    classes: UInt8Array | None = None
    things: Int64Array | None = None
    more: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Thing:
    """One thing in a picture: its class, outlines (P, 2) of its parts, box (x, y, width, height), area, run lengths."""

    number: int
    polygons: tuple[Int64Array, ...]
    box: tuple[int, int, int, int]
    area_px: int
    counts: str


@dataclass(frozen=True)
class Labelling:
    """What becomes of masks.

    Attributes:
        merged: classes of which a picture has one thing at most: where one ends and the next begins means nothing.
        min_area_px: things seen smaller than this are left out of boxes and outlines (label PNGs have them).
    """

    labels: LabelSet = LabelSet()
    merged: tuple[str, ...] = ("floor", "ceiling")
    min_area_px: int = 40


def things_of(labelled: Labelled, labelling: Labelling) -> tuple[list[Thing], int]:
    """The things in a picture by class and number, and how many were too small."""
    if labelled.classes is None:
        return [], 0
    found: list[Thing] = []
    small = 0
    classes = labelled.classes.astype(np.int64)
    own = _parts(classes) if labelled.things is None else labelled.things + 1
    merged = np.zeros(256, dtype=bool)
    merged[[number for number, name in enumerate(labelling.labels.names) if name in labelling.merged]] = True
    keys = classes * (int(own.max(initial=0)) + 1) + np.where(merged[classes], 0, own)
    keys[classes == UNLABELLED] = -1
    dense, places = np.unique(keys, return_inverse=True)
    places = places.reshape(keys.shape)
    for place, (x0, y0, x1, y1) in enumerate(_boxes(places, len(dense))):
        if dense[place] < 0:
            continue
        window = places[y0:y1, x0:x1] == place
        area = int(window.sum())
        polygons = polygons_from_mask(window, Tracing(min_area_px=min(labelling.min_area_px, 20)))
        if area < labelling.min_area_px or not polygons:
            small += 1
            continue
        whole = np.zeros(keys.shape, dtype=bool)
        whole[y0:y1, x0:x1] = window
        number = int(classes[y0:y1, x0:x1][window][0])
        outlines = tuple(polygon + np.array([x0, y0]) for polygon in polygons)
        counts = text_from_counts(counts_from_mask(whole))
        found.append(Thing(number, outlines, (x0, y0, x1 - x0, y1 - y0), area, counts))
    return found, small


def label_text(things: list[Thing], shape: tuple[int, int]) -> str:
    """A YOLO-seg label file: a line for each part of each thing."""
    return "".join(f"{yolo_line(thing.number, part, shape)}\n" for thing in things for part in thing.polygons)


def png_from_classes(classes: UInt8Array, labels: LabelSet) -> bytes:
    """Numbers (H, W) as a PNG with a palette: viewers show colours, Pillow reads numbers."""
    from PIL import Image

    image = Image.frombytes("P", classes.shape[::-1], np.ascontiguousarray(classes).tobytes())
    image.putpalette(labels.colours.tobytes())
    packed = io.BytesIO()
    image.save(packed, "png", compress_level=3)
    return packed.getvalue()


def classes_from_png(data: bytes) -> UInt8Array:
    """(H, W) numbers of a label PNG."""
    from PIL import Image

    return np.array(Image.open(io.BytesIO(data)), dtype=np.uint8)


def class_counts(classes: UInt8Array, things: list[Thing], count: int) -> tuple[list[int], list[int]]:
    """(C,) pixels and (C,) things of every class."""
    pixels = np.bincount(classes.ravel(), minlength=256)[:count]
    things_by = np.bincount([thing.number for thing in things], minlength=count) if things else np.zeros(count, int)
    return pixels.tolist(), things_by.tolist()


# -------------------------------------------------------------------------------------------- details


def _parts(classes: Int64Array) -> Int64Array:
    """(H, W) connected parts of every class, numbered from 1."""
    import cv2

    numbers = np.zeros(classes.shape, dtype=np.int64)
    for value in np.unique(classes[classes != UNLABELLED]).tolist():
        count, parts = cv2.connectedComponents((classes == value).astype(np.uint8), connectivity=8)
        numbers = np.where(parts > 0, parts + numbers.max(initial=0), numbers)
        del count
    return numbers


def _boxes(places: Int64Array, count: int) -> list[tuple[int, int, int, int]]:
    """(x0, y0, x1, y1) of every value from 0 to count - 1, ends excluded."""
    from scipy.ndimage import find_objects

    return [
        (columns.start, rows.start, columns.stop, rows.stop)
        for rows, columns in find_objects(places.astype(np.int32) + 1, max_label=count)
    ]
