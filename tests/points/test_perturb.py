"""Errors put in on purpose are as large as they are said to be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.points.test_look import CALIBRATION, EXACT, FOCAL, NO_IMAGE, frame_of, located, view_at
from wallkit.core.types import View
from wallkit.points.perturb import PerturbSettings, perturbed, without_dropped


def test_nothing_set_changes_nothing():
    same = perturbed(CALIBRATION, PerturbSettings())
    np.testing.assert_array_equal(same.T_camera_lidar, CALIBRATION.T_camera_lidar)
    assert same.time_offset_ns == CALIBRATION.time_offset_ns
    assert PerturbSettings().said == ()


@pytest.mark.parametrize("deg", [0.25, 2.0, -1.0])
def test_a_turn_to_the_side_moves_the_pixel_by_f_tan(deg):
    # straight ahead of the camera: in base at the height of the camera
    ahead = frame_of([[4.2, 0.0, 0.8]])
    before, _, _ = located(ahead, view_at((0, 0, 0)))
    wrong = perturbed(CALIBRATION, PerturbSettings(rotation_deg=deg, rotation_axis=(0, 2, 0)))
    after, _, _ = located(ahead, view_at((0, 0, 0)), calibration=wrong)
    np.testing.assert_allclose(after.pixels - before.pixels, [[FOCAL * np.tan(np.deg2rad(deg)), 0]], atol=1e-4)


def test_a_shift_moves_the_pixel_by_f_t_over_z():
    ahead = frame_of([[4.2, 0.0, 0.8]])
    before, _, _ = located(ahead, view_at((0, 0, 0)))
    wrong = perturbed(CALIBRATION, PerturbSettings(translation_cm=10, translation_axis=(1, 0, 0)))
    after, _, _ = located(ahead, view_at((0, 0, 0)), calibration=wrong)
    np.testing.assert_allclose(after.pixels - before.pixels, [[FOCAL * 0.1 / 4, 0]], atol=1e-4)


@pytest.mark.parametrize("seed", range(3))
def test_a_drawn_error_is_as_large_as_set_and_the_same_again(seed):
    wrong = PerturbSettings(rotation_deg=1.5, translation_cm=7, seed=seed)
    T, U = CALIBRATION.T_camera_lidar, perturbed(CALIBRATION, wrong).T_camera_lidar
    error = U @ np.linalg.inv(T)
    assert np.rad2deg(np.arccos((np.trace(error[:3, :3]) - 1) / 2)) == pytest.approx(1.5)
    assert np.linalg.norm(error[:3, 3]) == pytest.approx(0.07)
    np.testing.assert_array_equal(U, perturbed(CALIBRATION, wrong).T_camera_lidar)
    assert np.abs(U - perturbed(CALIBRATION, replace(wrong, seed=seed + 1)).T_camera_lidar).max() > 1e-3


def test_a_clock_is_wrong_by_milliseconds():
    assert perturbed(CALIBRATION, PerturbSettings(time_offset_ms=20)).time_offset_ns == 20_000_000
    assert PerturbSettings(time_offset_ms=20, drop_share=0.5).said == ("time_offset_ms = 20", "drop_share = 0.5")


def test_the_share_of_images_is_lost_and_more_of_the_same_at_a_larger_share():
    images = [replace(NO_IMAGE, stamp_ns=k * 10**8) for k in range(4000)]
    frames = [
        frame_of([[2.0, 0, 0.3]], views=(View("/camera", image, image.stamp_ns, np.zeros(3)),)) for image in images
    ]
    lost = {}
    for share in (0.0, 0.1, 0.5, 1.0):
        left = [without_dropped(frame, PerturbSettings(drop_share=share)) for frame in frames]
        lost[share] = np.array([not frame.views for frame in left])
        assert lost[share].mean() == pytest.approx(share, abs=0.03)
    assert lost[0.5][lost[0.1]].all()
    assert without_dropped(frames[0], PerturbSettings()) is frames[0]


def test_a_narrower_view_is_a_cone_of_its_angle():
    bearings = np.deg2rad(np.linspace(-40, 40, 81))
    around = frame_of(np.column_stack([0.2 + 3 * np.cos(bearings), 3 * np.sin(bearings), np.full(81, 0.3)]))
    seen = located(around, view_at((0, 0, 0)), replace(EXACT, field_of_view_deg=61.0))[1]
    np.testing.assert_array_equal(seen, np.abs(bearings) <= np.deg2rad(30.5))
    assert located(around, view_at((0, 0, 0)), replace(EXACT, field_of_view_deg=180.0))[1].all()
    assert located(around, view_at((0, 0, 0)))[1].all()
