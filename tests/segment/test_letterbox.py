"""Where a camera's pixels lie in the network's input: against what OpenCV's resizing does with a ramp."""

from __future__ import annotations

import numpy as np
import pytest

from wallkit.segment.letterbox import Preparation, input_from_image, letterbox

SIZES = [(480, 640), (720, 1280), (1536, 2048), (530, 730), (333, 517), (640, 480), (97, 1011), (321, 320), (64, 100)]
NETS = [(320, 320), (192, 320), (640, 640), (256, 320)]


@pytest.mark.parametrize("net", NETS)
@pytest.mark.parametrize("image", SIZES)
def test_the_inverse_is_where_the_resized_ramp_says(image, net):
    """A picture whose value is its own pixel coordinate says in the input where each of its pixels came from."""
    box = letterbox(image, net)
    v, u = np.mgrid[: image[0], : image[1]].astype(np.float32)
    blob = input_from_image(np.stack([u, v, u], axis=2), box, Preparation(scale=1.0))[0]
    # OpenCV repeats the border when it enlarges, so only pixels with neighbours on both sides
    rows, columns = np.mgrid[
        box.corner[0] + 4 : box.corner[0] + box.inner[0] - 4, box.corner[1] + 4 : box.corner[1] + box.inner[1] - 4
    ]
    told = box.image_from_net(np.stack([columns, rows], axis=-1))
    np.testing.assert_allclose(blob[0][rows, columns], told[..., 0], atol=2e-3)
    np.testing.assert_allclose(blob[1][rows, columns], told[..., 1], atol=2e-3)
    np.testing.assert_allclose(box.net_from_image(told), np.stack([columns, rows], axis=-1), atol=1e-9)


def test_one_gain_for_both_axes_would_be_a_pixel_off():
    """Why each axis has its own (Ultralytics has one gain in older versions)."""
    box = letterbox((1531, 2048), (320, 320))
    one = min(320 / 1531, 320 / 2048)
    far = box.net_from_image([0, 1530])
    with_one = (far[1] - (box.corner[0] - 0.5)) / one - 0.5
    assert abs(with_one - 1530) > 1


def test_padding_is_grey_and_split_as_ultralytics_does():
    box = letterbox((181, 320), (192, 320))
    assert (box.inner, box.corner) == ((181, 320), (5, 0))
    blob = input_from_image(np.zeros((181, 320, 3), dtype=np.uint8), box)
    np.testing.assert_allclose(blob[0, :, [0, 4, 186, 191]], 114 / 255, rtol=1e-6)
    assert not blob[0, :, 5:186].any()


def test_normalisation_and_channel_order():
    rgb = np.full((32, 32, 3), (255, 51, 0), dtype=np.uint8)
    box = letterbox((32, 32), (32, 32))
    plain = input_from_image(rgb, box)[0, :, 3, 3]
    np.testing.assert_allclose(plain, [1, 0.2, 0], atol=1e-6)
    np.testing.assert_allclose(input_from_image(rgb, box, Preparation(is_bgr=True))[0, :, 3, 3], plain[::-1])
    half = Preparation(mean=(0.5, 0.5, 0.5), std=(0.5, 0.25, 0.5))
    np.testing.assert_allclose(input_from_image(rgb, box, half)[0, :, 3, 3], [1, -1.2, -1], atol=1e-6)


def test_grey_pictures_have_three_equal_channels():
    grey = np.arange(64 * 64, dtype=np.uint8).reshape(64, 64)
    blob = input_from_image(grey, letterbox((64, 64), (64, 64)))[0]
    np.testing.assert_array_equal(blob[0], blob[1])
    np.testing.assert_allclose(blob[2], grey / np.float32(255), rtol=1e-6)


def test_boxes_are_clipped_to_the_image():
    box = letterbox((240, 320), (320, 320))
    np.testing.assert_allclose(box.boxes_in_image([[-5, 40, 330, 280]]), [[0, 0, 320, 240]])
    np.testing.assert_allclose(box.boxes_in_image([[10, 50, 20, 60]]), [[10, 10, 20, 20]])
