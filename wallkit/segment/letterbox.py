"""A camera's image -> the network's input, and pixels of the one as pixels of the other.

The image is shrunk to fit, kept in shape, and what is left over is grey, as YOLO nets are trained. The sides of the shrunk
image are whole pixels, so each axis has a gain of its own: one gain for both is off by up to 1.4 px on a 2048-pixel image.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from wallkit.core.types import Float32Array, Float64Array, UInt8Array

# Ultralytics' grey
GREY = 114
Fit = Literal["letterbox", "stretch"]


@dataclass(frozen=True)
class Letterbox:
    """Where a camera's image lies in the network's input; sizes are (height, width) [px].

    Attributes:
        image: the camera's. net: the network's input. inner: the shrunk image. corner: its top row and left column in it.
    """

    image: tuple[int, int]
    net: tuple[int, int]
    inner: tuple[int, int]
    corner: tuple[int, int]

    @property
    def gains(self) -> tuple[float, float]:
        """Pixels of the input per pixel of the image, along u and v."""
        return self.inner[1] / self.image[1], self.inner[0] / self.image[0]

    def net_from_image(self, pixels: ArrayLike) -> Float64Array:
        """(..., 2) pixels of the input where the image's pixels (..., 2) lie; both count from the centre of the first."""
        at = np.asarray(pixels, dtype=np.float64)
        return (at + 0.5) * self.gains + (self.corner[1] - 0.5, self.corner[0] - 0.5)

    def image_from_net(self, pixels: ArrayLike) -> Float64Array:
        """(..., 2) the inverse of `net_from_image`."""
        at = np.asarray(pixels, dtype=np.float64)
        return (at - (self.corner[1] - 0.5, self.corner[0] - 0.5)) / self.gains - 0.5

    def boxes_in_image(self, boxes: ArrayLike) -> Float64Array:
        """(D, 4) edges x1, y1, x2, y2 in the image, counted from the image's edge, of boxes (D, 4) in the input."""
        edges = np.asarray(boxes, dtype=np.float64).reshape(-1, 2, 2)
        moved = (edges - (self.corner[1], self.corner[0])) / self.gains
        return np.clip(moved, 0, (self.image[1], self.image[0])).reshape(-1, 4)


@dataclass(frozen=True)
class Preparation:
    """How a network wants its input; the default is what YOLO nets want.

    Attributes:
        mean, std: of R, G, B in [0, 1]: the input is (value - mean) / std. scale: of a byte to that value.
        is_bgr: channels in reverse order. fit: kept in shape with grey around it, or stretched to the whole input.
    """

    mean: tuple[float, float, float] = (0.0, 0.0, 0.0)
    std: tuple[float, float, float] = (1.0, 1.0, 1.0)
    scale: float = 1 / 255
    is_bgr: bool = False
    fit: Fit = "letterbox"


def letterbox(image: tuple[int, int], net: tuple[int, int], fit: Fit = "letterbox") -> Letterbox:
    """Where an image (height, width) goes in an input (height, width), rounded as Ultralytics does."""
    if fit == "stretch":
        return Letterbox(image, net, net, (0, 0))
    gain = min(net[0] / image[0], net[1] / image[1])
    inner = max(round(image[0] * gain), 1), max(round(image[1] * gain), 1)
    top, left = (round((outer - side) / 2 - 0.1) for outer, side in zip(net, inner, strict=True))
    return Letterbox(image, net, inner, (top, left))


def input_from_image(rgb: UInt8Array, box: Letterbox, preparation: Preparation = Preparation()) -> Float32Array:
    """(1, 3, H, W) float32 input of an image (H, W, 3) RGB or (H, W) grey."""
    import cv2

    pixels = rgb if rgb.ndim == 3 else np.repeat(rgb[..., None], 3, axis=2)
    if box.inner != box.image:
        pixels = np.asarray(cv2.resize(pixels, box.inner[::-1], interpolation=cv2.INTER_LINEAR))
    channels = (2, 1, 0) if preparation.is_bgr else (0, 1, 2)
    rows, columns = (slice(at, at + side) for at, side in zip(box.corner, box.inner, strict=True))
    gains = np.float32(preparation.scale) / np.array(preparation.std, dtype=np.float32)
    offsets = np.array(preparation.mean, dtype=np.float32) / np.array(preparation.std, dtype=np.float32)
    blob = np.empty((1, 3, *box.net), dtype=np.float32)
    for plane, channel in enumerate(channels):
        whole = blob[0, plane]
        if box.inner != box.net:
            whole.fill(GREY * gains[plane])
        np.multiply(pixels[..., channel], gains[plane], out=whole[rows, columns])
        if offsets[plane]:
            whole -= offsets[plane]
    return blob
