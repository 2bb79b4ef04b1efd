from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.localize.ceilings import CAMERA, HEIGHT_M, UP, eye, painted, photograph
from wallkit.core.ceiling_eye import CeilingEye, smoothed
from wallkit.errors import CalibrationError, LogError


def test_a_camera_that_does_not_look_up_is_refused():
    level = UP.copy()
    level[:3, :3] = [[0, 0, 1], [-1, 0, 0], [0, -1, 0]]
    with pytest.raises(CalibrationError, match="straight above"):
        CeilingEye(CAMERA, level, HEIGHT_M)


def test_a_ceiling_below_the_camera_is_refused():
    with pytest.raises(CalibrationError, match=r"0\.9 m above the floor, is not above"):
        CeilingEye(CAMERA, UP, 0.9)


def test_a_grid_larger_than_the_picture_is_refused():
    with pytest.raises(CalibrationError, match=r"spacing_m"):
        _ = eye(spacing_m=2.0).is_seen


def test_an_image_of_another_size_is_refused():
    with pytest.raises(LogError, match="80 x 60 pixels"):
        eye().view(0, np.zeros((60, 80, 3), np.uint8))


def test_without_a_height_the_place_above_the_camera_is_all_there_is():
    pose = np.array([2.0, 4.5, 1.0])
    image = photograph(painted(), pose)
    blind = CeilingEye(CAMERA, UP, smooth_m=0.0)
    view, known = blind.view(0, image), eye(smooth_m=0.0).view(0, image)
    assert view.points_m.shape == (1, 1, 2)
    np.testing.assert_array_equal(view.centre, known.centre)
    np.testing.assert_allclose(view.centre_m, UP[:2, 3])


def test_pixels_of_a_metre_follow_from_height_and_focal_length():
    assert eye().px_per_m == pytest.approx(104.0 / (HEIGHT_M - 1.0), rel=1e-6)


def test_blurring_lends_no_colour_from_what_is_not_seen():
    ceiling = painted()
    seen = np.ones_like(ceiling.is_seen)
    seen[:, 200:] = False
    pixels = np.full_like(ceiling.pixels, 100)
    pixels[:, 200:] = 255
    blurred = smoothed(replace(ceiling, pixels=pixels, is_seen=seen), 0.1)
    assert blurred.resolution_m == 0.04  # no finer than the blur needs
    assert (blurred.pixels[blurred.is_seen] == 100).all()
    assert blurred.is_seen.mean() == 0.5
