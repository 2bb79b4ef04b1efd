"""Labelled pictures of any size -> arrays of one size, and how often each should be shown so that rare classes are seen."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from wallkit.core.types import Float64Array, UInt8Array

UNLABELLED = 255
# what the network sees beside a picture of another shape: the grey of letterboxes
GREY = 114


@dataclass(frozen=True, eq=False)
class Pictures:
    """RGB (N, H, W, 3) and the number of the class of every pixel (N, H, W), UNLABELLED for none."""

    images: UInt8Array
    classes: UInt8Array

    def __len__(self) -> int:
        return len(self.images)


def stacked(pairs: Iterable[tuple[UInt8Array, UInt8Array]], size: tuple[int, int]) -> Pictures:
    """Pictures with labels, each put into width x height as `letterboxed` does."""
    images, classes = [], []
    for image, numbers in pairs:
        boxed = letterboxed(image, numbers, size)
        images.append(boxed[0])
        classes.append(boxed[1])
    return Pictures(np.stack(images), np.stack(classes))


def letterboxed(image: UInt8Array, numbers: UInt8Array, size: tuple[int, int]) -> tuple[UInt8Array, UInt8Array]:
    """A picture (H, W, 3) and its labels (H, W), as large as fits into width x height, in the middle of grey."""
    import cv2

    width, height = size
    if image.shape[:2] == (height, width):
        return image, numbers
    gain = min(width / image.shape[1], height / image.shape[0])
    w, h = max(1, round(image.shape[1] * gain)), max(1, round(image.shape[0] * gain))
    x, y = (width - w) // 2, (height - h) // 2
    boxed = np.full((height, width, 3), GREY, dtype=np.uint8)
    labels = np.full((height, width), UNLABELLED, dtype=np.uint8)
    way = cv2.INTER_AREA if gain < 1 else cv2.INTER_LINEAR
    boxed[y : y + h, x : x + w] = cv2.resize(image, (w, h), interpolation=way)
    labels[y : y + h, x : x + w] = cv2.resize(numbers, (w, h), interpolation=cv2.INTER_NEAREST)
    return boxed, labels


def pixel_counts(classes: UInt8Array, count: int) -> Float64Array:
    """(N, C) pixels of every class in every picture."""
    return np.stack([np.bincount(one.ravel(), minlength=256)[:count] for one in classes]).astype(np.float64)


def class_weights(counts: Float64Array, *, power: float = 0.25, most: float = 5.0) -> Float64Array:
    """(C,) weights in the loss by pixels (N, C): a class's share to the -power, at most so much; 0 if never seen.

    A small power keeps the large classes sharp: by inverse shares, or their roots, the small ones flood the walls.
    """
    shares = counts.sum(axis=0) / max(float(counts.sum()), 1.0)
    weights = np.where(shares > 0, np.maximum(shares, 1e-9) ** -power, 0.0)
    mean = float((weights * shares).sum())
    return np.where(shares > 0, np.minimum(weights / max(mean, 1e-9), most), 0.0)


def showing_odds(
    counts: Float64Array, *, wanted: float = 0.35, least: float = 0.002, most: float = 4.0
) -> Float64Array:
    """(N,) odds of drawing each picture: those with rare classes more often (repeat factors of LVIS, Gupta et al., 2019).

    A class that fewer than `wanted` of all pictures show counts up to `most` times; it is shown where it fills the
    share `least` of a picture.
    """
    pixels = counts.sum(axis=1, keepdims=True)
    shows = counts > least * np.maximum(pixels, 1)
    frequency = shows.mean(axis=0)
    factors = np.clip(np.sqrt(wanted / np.maximum(frequency, 1e-6)), 1.0, most)
    odds = np.where(shows, factors[None], 1.0).max(axis=1)
    return np.asarray(odds / odds.sum())
