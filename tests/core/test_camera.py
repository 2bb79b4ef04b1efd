"""The lens models against OpenCV and against their own derivatives."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from wallkit.core.camera import Camera, camera_from_info
from wallkit.core.lenses import CAMERAS
from wallkit.core.projection import project_points
from wallkit.core.types import CameraInfo
from wallkit.errors import CalibrationError

K = np.array([[612.0, 0, 319.5], [0, 605.0, 244.0], [0, 0, 1]])
COEFFICIENTS = {
    "plumb_bob": [-0.28, 0.11, 0.0011, -0.0007, -0.02],
    "rational_polynomial": [0.35, -0.08, 0.0011, -0.0007, 0.012, 0.66, -0.05, 0.03],
    "equidistant": [-0.04, 0.012, -0.008, 0.002],
}


def camera(base: str, **changes) -> Camera:
    return Camera(**{"model": base, "width": 640, "height": 480, "K": K, "D": COEFFICIENTS[base], **changes})


def points_in_view(count: int = 500) -> np.ndarray:
    rng = np.random.default_rng(4)
    return rng.uniform([-1.2, -0.9, 1.5], [1.2, 0.9, 4.0], (count, 3))


def opencv_pixels(model: str, points: np.ndarray, K: np.ndarray, D: np.ndarray) -> np.ndarray:
    project = cv2.fisheye.projectPoints if model == "equidistant" else cv2.projectPoints
    pixels, _ = project(points.reshape(1, -1, 3), np.zeros(3), np.zeros(3), K, D)
    return pixels.reshape(-1, 2)


@pytest.mark.parametrize("model", CAMERAS)
def test_project_is_opencvs(model):
    points = points_in_view()
    seen = camera(model).project(points)
    assert np.isfinite(seen).all()
    np.testing.assert_allclose(seen, opencv_pixels(model, points, K, np.array(COEFFICIENTS[model])), atol=1e-9)


@pytest.mark.parametrize("model", CAMERAS)
def test_unproject_inverts_project(model):
    points = points_in_view()
    rays = camera(model).unproject(camera(model).project(points))
    np.testing.assert_allclose(rays, points / np.linalg.norm(points, axis=1, keepdims=True), atol=1e-11)


@pytest.mark.parametrize("model", CAMERAS)
def test_project_inverts_unproject_on_the_whole_image(model):
    u, v = np.meshgrid(np.linspace(0, 639, 20), np.linspace(0, 479, 15))
    pixels = np.stack([u, v], -1)
    np.testing.assert_allclose(camera(model).project(camera(model).unproject(pixels) * 3.0), pixels, atol=1e-8)


@pytest.mark.parametrize("model", CAMERAS)
def test_jacobians_are_the_derivatives(model):
    cam, points, h = camera(model), points_in_view(50), 1e-6
    by_point = [(cam.project(points + d) - cam.project(points - d)) / (2 * h) for d in np.eye(3) * h]
    np.testing.assert_allclose(cam.point_jacobian(points), np.stack(by_point, -1), rtol=1e-5, atol=1e-5)
    steps = np.diag(np.full(len(cam.parameters), h))
    by_parameter = [
        (
            cam.with_parameters(cam.parameters + d).project(points)
            - cam.with_parameters(cam.parameters - d).project(points)
        )
        / (2 * h)
        for d in steps
    ]
    np.testing.assert_allclose(cam.parameter_jacobian(points), np.stack(by_parameter, -1), rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("model", CAMERAS)
def test_on_the_axis_everything_is_finite(model):
    cam, point = camera(model), np.array([0.0, 0.0, 2.0])
    np.testing.assert_allclose(cam.project(point), K[:2, 2])
    np.testing.assert_allclose(cam.unproject(K[:2, 2]), [0, 0, 1])
    np.testing.assert_allclose(cam.point_jacobian(point), [[306.0, 0, 0], [0, 302.5, 0]])


@pytest.mark.parametrize("model", CAMERAS)
def test_shapes_follow_the_points(model):
    cam = camera(model)
    assert cam.project(np.ones((2, 5, 3))).shape == (2, 5, 2)
    assert cam.project(np.ones((0, 3))).shape == (0, 2)
    assert cam.unproject(np.full((2, 5, 2), 300.0)).shape == (2, 5, 3)
    assert cam.point_jacobian(np.ones((2, 5, 3))).shape == (2, 5, 2, 3)


@pytest.mark.parametrize("model", ["plumb_bob", "rational_polynomial"])
def test_behind_the_camera_is_nan(model):
    cam = camera(model)
    assert np.isnan(cam.project([[0.1, 0.2, -1.0], [0.1, 0.2, 0.0]])).all()
    assert np.isnan(cam.point_jacobian([0.1, 0.2, -1.0])).all()


def test_equidistant_sees_sideways_but_not_straight_back():
    wide = camera("equidistant", D=np.zeros(4))
    np.testing.assert_allclose(wide.project([1.0, 0.0, -0.1])[0], 319.5 + 612 * (np.pi / 2 + np.arctan(0.1)))
    assert np.isnan(wide.project([0.0, 0.0, -1.0])).all()


def test_beyond_where_the_radial_map_folds_back_is_nan():
    # d(r + k1 r^3)/dr = 0 at r = 1 / sqrt(3 * 0.3): beyond, points would come back into the image
    cam = camera("plumb_bob", D=[-0.3, 0, 0, 0, 0])
    fold = 1 / np.sqrt(0.9)
    assert cam.limit == pytest.approx(fold)
    assert np.isfinite(cam.project([fold * 0.999, 0, 1])).all()
    assert np.isnan(cam.project([fold * 1.001, 0, 1])).all()
    beyond = K[0, 2] + K[0, 0] * (fold - 0.3 * fold**3) + 1
    assert np.isnan(cam.unproject([beyond, K[1, 2]])).all()


def test_a_pole_of_the_rational_model_bounds_it():
    cam = camera("rational_polynomial", D=[0, 0, 0, 0, 0, -0.25, 0, 0])
    assert cam.limit == pytest.approx(2.0)


def test_inside_counts_half_a_pixel_around_the_centres():
    cam = camera("plumb_bob")
    pixels = [[-0.5, 0], [-0.51, 0], [639.49, 479.49], [639.5, 0], [np.nan, 3]]
    assert cam.is_inside(pixels).tolist() == [True, False, True, False, False]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"D": [0.1, 0.2]}, "needs 5 coefficients, not 2"),
        ({"D": [np.nan, 0, 0, 0, 0]}, "not finite"),
        ({"K": np.full((3, 3), np.nan)}, "not finite"),
        ({"K": np.zeros((3, 3))}, "not positive"),
        ({"K": np.eye(4)}, "not 3 x 3"),
        ({"K": [[600, 3, 320], [0, 600, 240], [0, 0, 1]]}, "skew"),
        ({"width": 0}, "size 0 x 480"),
        ({"model": ""}, "missing"),
        ({"model": "plum_bob"}, "did you mean 'plumb_bob'"),
    ],
)
def test_a_camera_that_cannot_be_is_refused(changes, words):
    with pytest.raises(CalibrationError, match=words):
        camera("plumb_bob", **changes)


def test_aliases_and_padding():
    assert camera("equidistant", model="fisheye").model == "equidistant"
    assert camera("plumb_bob", D=[0.1, 0, 0, 0]).D.tolist() == [0.1, 0, 0, 0, 0]
    assert camera("plumb_bob", D=[0.1, 0, 0, 0, 0, 0, 0, 0]).D.tolist() == [0.1, 0, 0, 0, 0]


def test_arrays_are_read_only():
    with pytest.raises(ValueError, match="read-only"):
        camera("plumb_bob").K[0, 0] = 1


def test_camera_info_gives_the_same_camera():
    info = CameraInfo(
        0, "optical", 640, 480, "plumb_bob", np.array(COEFFICIENTS["plumb_bob"]), K, np.eye(3), np.eye(3, 4)
    )
    cam = camera_from_info(info)
    assert cam.frame == "optical"
    np.testing.assert_array_equal(cam.parameters, camera("plumb_bob").parameters)


@pytest.mark.parametrize("model", CAMERAS)
def test_the_compiled_projection_is_the_cameras(model):
    rng = np.random.default_rng(4)
    one = camera(model)
    T = np.eye(4)
    T[:3, :3] = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    T[:3, 3] = rng.normal(size=3)
    points = rng.uniform(-4, 4, (500, 3)).astype(np.float32)
    points[0] = np.nan
    seen = points @ T[:3, :3].T + T[:3, 3]
    pixels, depths, inside = project_points(one, T, points)
    np.testing.assert_allclose(pixels, one.project(seen), rtol=1e-9, atol=1e-7)
    np.testing.assert_allclose(depths, seen[:, 2], rtol=1e-9, atol=1e-12)
    np.testing.assert_array_equal(inside, one.is_inside(one.project(seen)))
    assert inside.sum() > 20
