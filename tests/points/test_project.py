"""Points to pixels: closed forms, what is not in the picture, and calibrations that must not be used."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from wallkit.core.calibration import Calibration, Provenance
from wallkit.core.camera import Camera
from wallkit.errors import CalibrationError
from wallkit.points.overlay import draw_points, png_bytes, span_of
from wallkit.points.project import project

K = np.array([[500.0, 0, 320], [0, 500, 240], [0, 0, 1]])
T = np.array([[0.0, -1, 0, 0.1], [0, 0, -1, 0.2], [1, 0, 0, -0.05], [0, 0, 0, 1]])
CALIBRATION = Calibration(Camera("plumb_bob", 640, 480, K, np.zeros(5)), T_camera_lidar=T)


def test_a_point_lands_where_the_pinhole_says():
    """p_camera = (0.1 - y, 0.2 - z, x - 0.05)."""
    found = project(CALIBRATION, [[2.05, 0.5, 0.3]])
    np.testing.assert_allclose(found.pixels, [[320 + 500 * (0.1 - 0.5) / 2, 240 + 500 * (0.2 - 0.3) / 2]])
    assert found.depths_m[0] == pytest.approx(2.0)
    assert found.is_inside.all()
    assert not found.is_behind.any()


def test_distortion_counts():
    D = np.array([-0.2, 0.05, 0.001, -0.002, 0.0])
    bent = replace(CALIBRATION, camera=Camera("plumb_bob", 640, 480, K, D))
    points = np.array([[2.0, 0.8, 0.1], [3.0, -1.0, -0.4]])
    seen = points @ T[:3, :3].T + T[:3, 3]
    np.testing.assert_array_equal(project(bent, points).pixels, bent.camera.project(seen))
    assert np.abs(project(bent, points).pixels - project(CALIBRATION, points).pixels).max() > 2


def test_behind_beside_and_not_a_number_are_marked_and_keep_their_row():
    found = project(CALIBRATION, [[-2.0, 0, 0], [2.0, 5.0, 0], [np.nan, 0, 0], [2.0, 0, 0]])
    assert found.is_inside.tolist() == [False, False, False, True]
    assert found.is_behind.tolist() == [True, False, True, False]
    assert np.isnan(found.pixels[0]).all()
    assert np.isfinite(found.pixels[1]).all()
    assert np.isnan(found.pixels[2]).any()


def test_no_points_no_pixels():
    assert project(CALIBRATION, np.zeros((0, 3))).pixels.shape == (0, 2)


def test_a_failed_calibration_is_refused_with_its_reason_unless_allowed():
    failed = replace(CALIBRATION, verdict="FAIL", provenance=Provenance(notes=("verify: FAIL: plane: 73 mm off",)))
    with pytest.raises(CalibrationError, match=r"verdict is FAIL \(plane: 73 mm off\)") as caught:
        project(failed, [[2.0, 0, 0]])
    assert "--allow-unverified" in caught.value.hint
    assert project(failed, [[2.0, 0, 0]], allow_unverified=True).is_inside.all()
    for verdict in ("", "PASS", "CANNOT TELL"):
        assert project(replace(CALIBRATION, verdict=verdict), [[2.0, 0, 0]]).is_inside.all()


def test_a_camera_alone_is_refused():
    with pytest.raises(CalibrationError, match="where the LiDAR is"):
        project(replace(CALIBRATION, T_camera_lidar=None), [[2.0, 0, 0]], allow_unverified=True)


def test_a_picture_shows_points_where_they_are_and_near_ones_on_top():
    # the far point is on the line of sight of the near one, and comes first
    near, centre = np.array([2.05, 0.1, 0.2]), np.array([0.05, 0.1, 0.2])
    points = np.array([centre + 3 * (near - centre), near, [2.0, 0.6, 0.2]])
    projection = project(CALIBRATION, points)
    ranges = np.linalg.norm(points, axis=1)
    picture = draw_points(np.full((480, 640), 128, np.uint8), projection, ranges, span_m=(2.0, 6.0), title="x")
    assert picture.shape[0] > 480
    assert picture.shape[1:] == (640, 3)
    u, v = np.round(projection.pixels[1]).astype(int)
    red, _, blue = picture[v, u].astype(int)
    assert red > blue + 60
    assert (picture[10, 10] == 96).all()
    assert png_bytes(picture) == png_bytes(picture)


def test_the_legend_has_round_ends_around_the_ranges():
    low, high = span_of(np.linspace(1.2, 7.3, 100))
    assert (low, high) == (1.0, 7.5)
    assert span_of(np.zeros(0))[1] > span_of(np.zeros(0))[0]
