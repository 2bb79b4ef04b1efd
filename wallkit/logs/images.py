"""A recorded image, raw or compressed -> pixels as an array."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wallkit.core.types import CameraImage, UInt8Array
from wallkit.errors import LogError
from wallkit.logs.encode import COMPRESSED

VIDEO = ("h264", "h265", "vp9", "av1")
# raw encodings of ROS (sensor_msgs/image_encodings.hpp) and Foxglove: numpy type and channels
_LAYOUTS: dict[str, tuple[str, int]] = {
    "rgb8": ("u1", 3),
    "bgr8": ("u1", 3),
    "rgba8": ("u1", 4),
    "bgra8": ("u1", 4),
    "mono8": ("u1", 1),
    "8uc1": ("u1", 1),
    "8uc3": ("u1", 3),
    "8uc4": ("u1", 4),
    "rgb16": ("<u2", 3),
    "bgr16": ("<u2", 3),
    "mono16": ("<u2", 1),
    "16uc1": ("<u2", 1),
    "32fc1": ("<f4", 1),
    "bayer_rggb8": ("u1", 1),
    "bayer_bggr8": ("u1", 1),
    "bayer_gbrg8": ("u1", 1),
    "bayer_grbg8": ("u1", 1),
    "yuv422": ("u1", 2),
    "uyvy": ("u1", 2),
    "yuv422_yuy2": ("u1", 2),
    "yuyv": ("u1", 2),
}


def pixels_from_image(image: CameraImage) -> UInt8Array:
    """(H, W, 3) uint8 RGB, or (H, W) uint8 of a grey image.

    16-bit grey and colour keep their upper byte; floats (depth, in metres) are stretched from their smallest to their
    largest finite value, since they have no white.

    Raises:
        LogError: an encoding nobody knows, a video frame, or bytes that do not make an image of the stated size.
    """
    encoding = image.encoding.lower()
    where = f"image at {image.stamp_ns / 1e9:.3f} s"
    if encoding in COMPRESSED:
        return _decompressed(image, where)
    if encoding in VIDEO:
        hint = "install the extra `[video]` (PyAV) and decode the stream with `wallkit.logs.images.VideoDecoder`"
        raise LogError(f"'{image.encoding}' is a video stream, not a single image", where=where, hint=hint)
    if encoding not in _LAYOUTS:
        known = ", ".join(sorted([*COMPRESSED, *_LAYOUTS]))
        raise LogError(f"image encoding '{image.encoding}' is not known", where=where, hint=f"known: {known}")
    rows = _rows(image, *_LAYOUTS[encoding], where)
    return CONVERSIONS.get(encoding, _as_it_is)(rows)


class VideoDecoder:
    """Frames of one foxglove.CompressedVideo topic, in the order of the log -> pixels; needs PyAV (extra `[video]`)."""

    def __init__(self, codec: str) -> None:
        try:
            import av
        except ImportError as error:
            hint = "pip install 'wallkit[video]'"
            raise LogError(f"'{codec}' video needs PyAV, which is not installed", hint=hint) from error
        self._packet = av.Packet
        self._codec: Any = av.CodecContext.create("hevc" if codec == "h265" else codec, "r")

    def pixels(self, image: CameraImage) -> UInt8Array | None:
        """(H, W, 3) uint8 RGB of the newest frame; None while the stream has not reached its first key frame."""
        frames = self._codec.decode(self._packet(image.data))
        return frames[-1].to_ndarray(format="rgb24") if frames else None


def _decompressed(image: CameraImage, where: str) -> UInt8Array:
    import cv2

    data = np.frombuffer(image.data, np.uint8)
    pixels = cv2.imdecode(data, cv2.IMREAD_UNCHANGED) if len(data) else None
    if pixels is None:
        raise LogError(f"{len(data)} bytes are no {image.encoding} image", where=where)
    if pixels.dtype == np.uint16:
        pixels = _upper_byte(pixels)
    if pixels.ndim == 2:
        return np.asarray(pixels, dtype=np.uint8)
    code = cv2.COLOR_BGRA2RGB if pixels.shape[2] == 4 else cv2.COLOR_BGR2RGB
    return np.asarray(cv2.cvtColor(pixels, code), dtype=np.uint8)


def _rows(image: CameraImage, dtype: str, channels: int, where: str) -> NDArray[Any]:
    """(H, W) or (H, W, C) array of a raw image, the padding at the end of its rows left out."""
    row_bytes = image.width * channels * np.dtype(dtype).itemsize
    step = image.step or row_bytes
    if (
        image.height <= 0
        or image.width <= 0
        or step < row_bytes
        or len(image.data) < step * (image.height - 1) + row_bytes
    ):
        size = f"{image.width} x {image.height} {image.encoding} with rows of {image.step} bytes"
        raise LogError(f"{len(image.data)} bytes do not make an image of {size}", where=where)
    data = np.frombuffer(image.data, np.uint8)
    padded = np.zeros(step * image.height, np.uint8)
    padded[: len(data)] = data[: step * image.height]
    packed = np.ascontiguousarray(padded.reshape(image.height, step)[:, :row_bytes])
    pixels = packed.view(dtype).reshape(image.height, image.width, channels)
    return pixels[:, :, 0] if channels == 1 else pixels


def _as_it_is(rows: NDArray[Any]) -> UInt8Array:
    return np.asarray(rows, dtype=np.uint8)


def _upper_byte(rows: NDArray[Any]) -> UInt8Array:
    return (rows >> 8).astype(np.uint8)


def _swapped(rows: NDArray[Any]) -> UInt8Array:
    """RGB of BGR or BGRA."""
    return np.ascontiguousarray(rows[:, :, 2::-1], dtype=np.uint8)


def _stretched(rows: NDArray[Any]) -> UInt8Array:
    finite = np.isfinite(rows)
    if not finite.any():
        return np.zeros(rows.shape, np.uint8)
    low, high = float(rows[finite].min()), float(rows[finite].max())
    scaled = (np.where(finite, rows, low) - low) * (255.0 / (high - low) if high > low else 0.0)
    return scaled.astype(np.uint8)


def _opencv(code: str) -> Callable[[NDArray[Any]], UInt8Array]:
    """A conversion of OpenCV by the name of its code."""

    def convert(rows: NDArray[Any]) -> UInt8Array:
        import cv2

        return np.asarray(cv2.cvtColor(np.ascontiguousarray(rows), getattr(cv2, code)), dtype=np.uint8)

    return convert


CONVERSIONS: dict[str, Callable[[NDArray[Any]], UInt8Array]] = {
    "bgr8": _swapped,
    "8uc3": _swapped,
    "bgra8": _swapped,
    "8uc4": _swapped,
    "rgba8": lambda rows: np.ascontiguousarray(rows[:, :, :3]),
    "rgb16": _upper_byte,
    "bgr16": lambda rows: _swapped(_upper_byte(rows)),
    "mono16": _upper_byte,
    "16uc1": _upper_byte,
    "32fc1": _stretched,
    "bayer_rggb8": _opencv("COLOR_BayerRGGB2RGB"),
    "bayer_bggr8": _opencv("COLOR_BayerBGGR2RGB"),
    "bayer_gbrg8": _opencv("COLOR_BayerGBRG2RGB"),
    "bayer_grbg8": _opencv("COLOR_BayerGRBG2RGB"),
    "yuv422": _opencv("COLOR_YUV2RGB_UYVY"),
    "uyvy": _opencv("COLOR_YUV2RGB_UYVY"),
    "yuv422_yuy2": _opencv("COLOR_YUV2RGB_YUYV"),
    "yuyv": _opencv("COLOR_YUV2RGB_YUYV"),
}
