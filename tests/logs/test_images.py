"""Pixels of every encoding against a picture whose pixels are known, or OpenCV's own way there and back."""

from __future__ import annotations

import sys
from fractions import Fraction

import cv2
import numpy as np
import pytest

from wallkit.core.types import CameraImage
from wallkit.errors import LogError
from wallkit.logs.images import CONVERSIONS, VideoDecoder, pixels_from_image

# flat patches, since chroma and Bayer patterns know less than every pixel
RGB = np.zeros((8, 12, 3), np.uint8)
RGB[:, :6], RGB[:, 6:] = (200, 90, 40), (30, 60, 180)
GREY = np.arange(96, dtype=np.uint8).reshape(8, 12)


def raw(encoding, pixels, padding=0):
    rows = np.ascontiguousarray(pixels).reshape(len(pixels), -1).view(np.uint8)
    padded = np.hstack([rows, np.full((len(rows), padding), 77, np.uint8)])
    return CameraImage(0, "c", encoding, padded.tobytes(), pixels.shape[0], pixels.shape[1], padded.shape[1])


def bayer(pattern):
    mosaic = np.zeros(RGB.shape[:2], np.uint8)
    for k, letter in enumerate(pattern):
        i, j = divmod(k, 2)
        mosaic[i::2, j::2] = RGB[i::2, j::2, "rgb".index(letter)]
    return mosaic


def yuv(order):
    """Packed 4:2:2 of the picture."""
    # ITU-R BT.601, studio range
    weights = np.array([[65.481, 128.553, 24.966], [-37.797, -74.203, 112.0], [112.0, -93.786, -18.214]]) / 255
    y, u, v = np.moveaxis(np.round(RGB @ weights.T + [16, 128, 128]).astype(np.uint8), -1, 0)
    packed = np.zeros((*y.shape, 2), np.uint8)
    light, chroma = (0, 1) if order == "yuyv" else (1, 0)
    packed[:, :, light] = y
    packed[:, 0::2, chroma], packed[:, 1::2, chroma] = u[:, 0::2], v[:, 0::2]
    return packed


OPAQUE = np.full((8, 12, 1), 255, np.uint8)
BGR = RGB[:, :, ::-1]
EXAMPLES = {
    "rgb8": (RGB, RGB, 0),
    "bgr8": (BGR, RGB, 0),
    "8UC3": (BGR, RGB, 0),
    "rgba8": (np.dstack([RGB, OPAQUE]), RGB, 0),
    "bgra8": (np.dstack([BGR, OPAQUE]), RGB, 0),
    "8UC4": (np.dstack([BGR, OPAQUE]), RGB, 0),
    "mono8": (GREY, GREY, 0),
    "8UC1": (GREY, GREY, 0),
    "rgb16": (RGB.astype("<u2") * 256 + 3, RGB, 0),
    "bgr16": (BGR.astype("<u2") * 256 + 3, RGB, 0),
    "mono16": (GREY.astype("<u2") * 256 + 3, GREY, 0),
    "16UC1": (GREY.astype("<u2") * 256 + 3, GREY, 0),
    "32FC1": (GREY.astype("<f4") * (1 / 95), np.uint8(GREY * (255 / 95)), 1),
    "bayer_rggb8": (bayer("rggb"), RGB, 0),
    "bayer_bggr8": (bayer("bggr"), RGB, 0),
    "bayer_gbrg8": (bayer("gbrg"), RGB, 0),
    "bayer_grbg8": (bayer("grbg"), RGB, 0),
    "yuv422": (yuv("uyvy"), RGB, 3),
    "uyvy": (yuv("uyvy"), RGB, 3),
    "yuv422_yuy2": (yuv("yuyv"), RGB, 3),
    "yuyv": (yuv("yuyv"), RGB, 3),
}


@pytest.mark.parametrize("encoding", EXAMPLES)
@pytest.mark.parametrize("padding", [0, 4])
def test_raw_pixels(encoding, padding):
    pixels, expected, tolerance = EXAMPLES[encoding]
    found = pixels_from_image(raw(encoding, pixels, padding))
    assert found.dtype == np.uint8
    assert found.shape == expected.shape
    inner = (slice(None), [0, 1, 2, 9, 10, 11]) if expected.ndim == 3 else ...
    np.testing.assert_allclose(found[inner].astype(int), expected[inner].astype(int), atol=tolerance)


def test_every_conversion_has_an_example():
    assert set(CONVERSIONS) <= {name.lower() for name in EXAMPLES}


@pytest.mark.parametrize(("encoding", "tolerance"), [("png", 0), ("jpeg", 40), ("webp", 40)])
def test_compressed_pixels(encoding, tolerance):
    def packed(pixels):
        return CameraImage(0, "c", encoding, cv2.imencode(f".{encoding}", pixels)[1].tobytes())

    np.testing.assert_allclose(
        pixels_from_image(packed(BGR)).astype(int)[:, :4], RGB.astype(int)[:, :4], atol=tolerance
    )
    if encoding != "webp":  # always in colour
        np.testing.assert_allclose(pixels_from_image(packed(GREY)).astype(int), GREY.astype(int), atol=tolerance)


def test_png_of_16_bit_and_with_transparency():
    deep = CameraImage(0, "c", "png", cv2.imencode(".png", GREY.astype(np.uint16) * 256)[1].tobytes())
    np.testing.assert_array_equal(pixels_from_image(deep), GREY)
    clear = CameraImage(0, "c", "png", cv2.imencode(".png", np.dstack([BGR, OPAQUE]))[1].tobytes())
    np.testing.assert_array_equal(pixels_from_image(clear), RGB)


def test_floats_without_a_number_are_black():
    nothing = raw("32FC1", np.full((2, 2), np.nan, np.float32))
    assert not pixels_from_image(nothing).any()


@pytest.mark.parametrize(
    ("image", "words"),
    [
        (CameraImage(0, "c", "nv99", b"", 1, 1, 1), "not known"),
        (CameraImage(0, "c", "rgb8", b"12", 1, 1, 3), "do not make an image"),
        (CameraImage(0, "c", "rgb8", b"123", 0, 0, 0), "do not make an image"),
        (CameraImage(0, "c", "rgb8", b"123456", 1, 2, 5), "do not make an image"),
        (CameraImage(0, "c", "jpeg", b"not a picture"), "are no jpeg image"),
        (CameraImage(0, "c", "png", b""), "are no png image"),
        (CameraImage(0, "c", "h264", b"abc"), r"\[video\]"),
    ],
)
def test_what_is_no_image_is_said(image, words):
    with pytest.raises(LogError, match=words):
        pixels_from_image(image)


def test_the_last_row_may_lack_its_padding():
    image = raw("mono8", GREY, padding=4)
    short = CameraImage(0, "c", "mono8", image.data[:-4], image.height, image.width, image.step)
    np.testing.assert_array_equal(pixels_from_image(short), GREY)


def test_video_without_pyav(monkeypatch):
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(LogError, match=r"needs PyAV(.|\n)*wallkit\[video\]"):
        VideoDecoder("h264")


def test_video_frames():
    av = pytest.importorskip("av", reason="PyAV is the extra [video]")
    encoder = av.CodecContext.create("h264", "w")
    encoder.width, encoder.height, encoder.pix_fmt = 64, 48, "yuv420p"
    encoder.time_base, encoder.options = Fraction(1, 10), {"tune": "zerolatency", "preset": "ultrafast"}
    decoder = VideoDecoder("h264")
    found = None
    for k in range(5):
        frame = av.VideoFrame.from_ndarray(np.full((48, 64, 3), 40 * k, np.uint8), format="rgb24")
        frame.pts = k
        for packet in encoder.encode(frame):
            pixels = decoder.pixels(CameraImage(k, "c", "h264", bytes(packet)))
            found = pixels if pixels is not None else found
    assert found is not None
    assert found.shape == (48, 64, 3)
    assert 100 < found.mean() < 180
