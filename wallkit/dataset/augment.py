"""A labelled picture -> the same in another light, mirrored, cropped, blurred or noisy; its labels go along."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wallkit.core.types import UInt8Array
from wallkit.dataset.labels import Labelled


def augmented(rng: np.random.Generator, labelled: Labelled, number: int) -> Labelled:
    """A variant: flipped in half of all cases, cropped to 70 to 100 % and back to size, brighter or darker, and some
    blurred or noisy. What was done is in its `more`."""
    import cv2

    image, classes, things = labelled.image, labelled.classes, labelled.things
    done: dict[str, float | bool | list[int]] = {}
    if rng.random() < 0.5:
        image = image[:, ::-1]
        classes = None if classes is None else np.ascontiguousarray(classes[:, ::-1])
        things = None if things is None else things[:, ::-1]
        done["flipped"] = True
    height, width = image.shape[:2]
    share = float(rng.uniform(0.7, 1.0))
    h, w = max(8, round(share * height)), max(8, round(share * width))
    y, x = int(rng.integers(0, height - h + 1)), int(rng.integers(0, width - w + 1))
    done["crop"] = [x, y, w, h]
    size = (width, height)
    cut_out = np.ascontiguousarray(image[y : y + h, x : x + w])
    image = np.asarray(cv2.resize(cut_out, size, interpolation=cv2.INTER_LINEAR), dtype=np.uint8)
    if classes is not None:
        classes = np.asarray(
            cv2.resize(classes[y : y + h, x : x + w], size, interpolation=cv2.INTER_NEAREST), dtype=np.uint8
        )
    if things is not None:
        cut = things[y : y + h, x : x + w].astype(np.float64)
        things = np.asarray(cv2.resize(cut, size, interpolation=cv2.INTER_NEAREST)).astype(np.int64)
    gain, offset = float(rng.uniform(0.7, 1.3)), float(rng.uniform(-20, 20))
    done["gain"], done["offset"] = round(gain, 3), round(offset, 1)
    light = image.astype(np.float64) * gain + offset
    if rng.random() < 0.3:
        sigma = float(rng.uniform(0.5, 1.8))
        light, done["blur_px"] = np.asarray(cv2.GaussianBlur(light, (0, 0), sigma)), round(sigma, 2)
    if rng.random() < 0.5:
        sigma = float(rng.uniform(2, 10))
        light, done["noise"] = light + rng.normal(0, sigma, light.shape), round(sigma, 1)
    pixels = np.clip(light + 0.5, 0, 255).astype(np.uint8)
    more = {**labelled.more, "from": labelled.name, "augmentation": done}
    return replace(
        labelled, name=f"{labelled.name}_aug{number}", image=pixels, classes=classes, things=things, more=more
    )


def denoised(image: UInt8Array) -> UInt8Array:
    """The picture without grain, its edges kept (bilateral filter, Tomasi and Manduchi, ICCV 1998)."""
    import cv2

    return np.asarray(cv2.bilateralFilter(image, 5, 30, 3), dtype=np.uint8)
