"""Cameras from corners: against OpenCV, against the truth, and against what the real sets must give."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest

from tests.calib.drawn import BOARD, DISTORTIONS, board_poses, camera, capture_of, sweep_poses
from wallkit.calib.board.boards import Board, board_from
from wallkit.calib.board.capture import capture_from_pictures, pictures_of_files
from wallkit.calib.board.views import Capture, View, capture_from_npz, observations_of
from wallkit.calib.camera.bundle import Fit, adjust, first_fit, jacobians, moved, normal_equations
from wallkit.calib.camera.covariance import camera_spread, naive_covariance
from wallkit.calib.camera.coverage import coverage_of
from wallkit.calib.camera.cross_validation import candidates, choose, compare_halves, held_out_errors
from wallkit.calib.camera.gates import camera_gates
from wallkit.calib.camera.intrinsics import MODELS, calibrate, fit_cameras, free_parameters, robust_sigma
from wallkit.calib.camera.projection_uncertainty import projection_difference, projection_sigma
from wallkit.calib.camera.select import most_informative
from wallkit.calib.extrinsics.covariance import spread_of
from wallkit.calib.verify.gates import verdict_of
from wallkit.core.camera import Camera
from wallkit.errors import CalibrationError
from wallkit.pipelines.calib.intrinsics import reprojection_errors

LENSES = tuple(DISTORTIONS)


def opencv_fit(capture: Capture, model: str) -> tuple[float, np.ndarray]:
    """RMS and fx, fy, cx, cy, D of OpenCV, converged."""
    points = [capture.board.object_points[v.ids] for v in capture.views]
    pixels = [v.pixels for v in capture.views]
    size, stop = (capture.width, capture.height), (3, 500, 1e-14)
    if model == "equidistant":
        flags = (
            getattr(cv2, "CALIB_RECOMPUTE_EXTRINSIC", 0)
            if cv2.__version__ >= "5"
            else cv2.fisheye.CALIB_RECOMPUTE_EXTRINSIC
        )
        flags |= cv2.CALIB_FIX_SKEW if cv2.__version__ >= "5" else cv2.fisheye.CALIB_FIX_SKEW
        rms, K, D, *_ = cv2.fisheye.calibrate(
            [p[None] for p in points],
            [p[None] for p in pixels],
            size,
            np.eye(3),
            np.zeros(4),
            flags=flags,
            criteria=stop,
        )
    else:
        flags = cv2.CALIB_RATIONAL_MODEL if model == "rational_polynomial" else 0
        rms, K, D, *_ = cv2.calibrateCamera(
            [p.astype(np.float32) for p in points],
            [p.astype(np.float32) for p in pixels],
            size,
            None,
            None,
            flags=flags,
            criteria=stop,
        )
    return rms, np.concatenate([K[[0, 1, 0, 1], [0, 1, 2, 2]], np.ravel(D)[: len(DISTORTIONS[model])]])


@pytest.fixture(scope="module")
def noisy() -> Capture:
    rng = np.random.default_rng(3)
    return capture_of(board_poses(rng, 20), 0.2, rng)


@pytest.mark.parametrize("model", LENSES)
def test_without_noise_the_camera_comes_back(model):
    rng = np.random.default_rng(2)
    capture = capture_of(board_poses(rng, 12, cam=camera(model)), 0.0, rng, cam=camera(model))
    found = calibrate(capture, model)
    assert found.plain.rms_px < 1e-6
    pixels = camera(model).project(camera(model).unproject([[60, 60], [320, 240], [580, 400]]))
    np.testing.assert_allclose(found.camera.project(camera(model).unproject(pixels)), pixels, atol=1e-3)


@pytest.mark.opencv
@pytest.mark.parametrize("model", ["plumb_bob", "equidistant"])
def test_the_least_squares_optimum_is_opencvs(model):
    rng = np.random.default_rng(3)
    capture = capture_of(board_poses(rng, 15, cam=camera(model)), 0.2, rng, cam=camera(model))
    rms, parameters = opencv_fit(capture, model)
    found = calibrate(capture, model)
    assert found.plain.rms_px == pytest.approx(rms, abs=1e-5)
    np.testing.assert_allclose(found.plain.camera.parameters[:4], parameters[:4], atol=5e-3)


def test_pose_jacobian_is_the_derivative(noisy):
    seen = observations_of(noisy.views[:2], BOARD)
    poses = board_poses(np.random.default_rng(3), 2)
    _, by_pose = jacobians(camera(), poses, seen)

    def project(moves):
        after = moved(poses, moves)[seen.views]
        return camera().project(np.einsum("nij,nj->ni", after[:, :3, :3], seen.points) + after[:, :3, 3])

    for k in range(6):
        step = np.zeros((2, 6))
        step[:, k] = 1e-6
        np.testing.assert_allclose(by_pose[:, :, k], (project(step) - project(-step)) / 2e-6, rtol=1e-4, atol=1e-3)


def test_every_start_ends_in_the_same_optimum(noisy):
    found = calibrate(noisy, "plumb_bob")
    assert set(found.starts_px) == {"vanishing points", "0.5 x width", "0.8 x width", "1.2 x width"}
    assert max(found.starts_px.values()) == pytest.approx(min(found.starts_px.values()), rel=1e-9)


def test_a_fit_that_has_no_time_to_converge_says_so(noisy):
    seen, free = observations_of(noisy.views, BOARD), free_parameters("plumb_bob")
    start = first_fit(Camera("plumb_bob", 640, 480, np.diag([400.0, 400, 1]), np.zeros(5)), seen)
    assert start is not None
    assert not adjust(start, seen, free=free, max_iterations=2).is_converged
    assert adjust(start, seen, free=free).is_converged


def test_corners_and_views_that_are_wrong_are_rejected_and_named(noisy):
    views = list(noisy.views)
    views[4] = replace(views[4], pixels=views[4].pixels + np.random.default_rng(0).normal(scale=3, size=(54, 2)))
    pixels = views[7].pixels.copy()
    pixels[10] += (9, -7)
    views[7] = replace(views[7], pixels=pixels)
    found = calibrate(replace(noisy, views=tuple(views)), "plumb_bob")
    assert list(found.rejected_views) == ["004"]
    assert found.rejected_corners == 1
    clean = calibrate(noisy, "plumb_bob")
    assert (np.abs(found.camera.parameters - clean.camera.parameters) < 1.0 * clean.sigmas).all()
    assert found.plain.rms_px > 0.8  # the plain fit has both in it, and says so


def test_never_more_than_a_quarter_of_the_views_is_rejected(noisy):
    rng = np.random.default_rng(0)
    bad = tuple(replace(v, pixels=v.pixels + rng.normal(scale=5, size=(54, 2))) for v in noisy.views[:9])
    found = calibrate(replace(noisy, views=(*bad, *noisy.views[9:])), "plumb_bob")
    assert len(found.rejected_views) <= 5


def test_held_parameters_stay_zero_without_variance(noisy):
    found = calibrate(noisy, "radtan")
    assert found.camera.D[4] == 0
    assert found.sigmas[-1] == 0
    assert (found.sigmas[:-1] > 0).all()


def covered(rng: np.random.Generator, views: int, trials: int, *, bend_m: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """How often 95 % intervals hold the true fx, fy, cx, cy: those clustered by view, and the textbook's.

    Args:
        bend_m: standard deviation of how far the board's middle stands out, drawn anew in each view.
    """
    points, free = BOARD.object_points, free_parameters("k1k2")
    truth = camera("plumb_bob")
    truth = truth.with_parameters([*truth.parameters[:4], -0.25, 0.08, 0, 0, 0])
    arch = 1 - (2 * points[:, 0] / points[:, 0].max() - 1) ** 2
    clustered, naive = [], []
    for _ in range(trials):
        made = []
        for number, pose in enumerate(board_poses(rng, views)):
            bent = points + (rng.normal(scale=bend_m) * arch if bend_m else 0 * arch)[:, None] * (0, 0, 1)
            pixels = truth.project(bent @ pose[:3, :3].T + pose[:3, 3]) + rng.normal(scale=0.1, size=(54, 2))
            made.append(View(str(number), np.arange(54), pixels))
        seen = observations_of(made, BOARD)
        fit = fit_cameras("k1k2", Capture(BOARD, 640, 480, tuple(made), views), seen, near=truth)
        error = np.abs(fit.camera.parameters - truth.parameters)[:4]
        clustered.append(error < camera_spread(fit, seen, free, robust_sigma(fit)).half_widths()[:4])
        naive.append(
            error < 1.96 * np.sqrt(np.diag(naive_covariance(normal_equations(fit, seen, free), fit, free)))[:4]
        )
    return np.mean(clustered, axis=0), np.mean(naive, axis=0)


def test_intervals_hold_the_truth_as_often_as_they_say():
    clustered, _ = covered(np.random.default_rng(11), 12, 60)
    # 95 % of 60 trials are 57 +- 1.7
    assert (clustered > 0.86).all(), clustered


@pytest.mark.slow
@pytest.mark.parametrize("views", [12, 20, 40])
def test_intervals_hold_the_truth_as_often_as_they_say_in_300_captures(views):
    clustered, _ = covered(np.random.default_rng(views), views, 300)
    assert (clustered >= 0.92).all(), clustered
    assert (clustered <= 0.98).all(), clustered


def test_only_clustered_intervals_survive_bent_boards():
    """Corners of one view err together. The intervals assume a flat board, and still lose little when it is bent."""
    clustered, naive = covered(np.random.default_rng(11), 12, 40, bend_m=0.002)
    assert (clustered > 0.82).all(), clustered
    assert (naive < 0.7).all(), naive


def test_shortened_rows_say_what_whole_rows_say(noisy):
    found = calibrate(noisy, "plumb_bob")
    fit, seen, sigma = found.fit, found.seen, found.sigma_px
    by_camera, by_pose = jacobians(fit.camera, fit.poses, seen)
    root = np.sqrt(fit.weights)[:, None] / sigma
    longest = 2 * int(np.bincount(seen.views).max())
    rows, residuals = np.zeros((seen.count, longest, 9)), np.zeros((seen.count, longest))
    for view in range(seen.count):
        own = seen.views == view
        J, P = (a[own].reshape(2 * own.sum(), -1) * np.repeat(root[own], 2)[:, None] for a in (by_camera, by_pose))
        basis = np.linalg.qr(P)[0]
        without_pose = np.eye(len(P)) - basis @ basis.T
        rows[view, : len(P)] = without_pose @ J
        residuals[view, : len(P)] = without_pose @ (fit.residuals[own] * root[own]).ravel()
    scale = np.linalg.norm(rows, axis=(0, 1))
    whole = spread_of(rows / scale, residuals)
    np.testing.assert_allclose(found.covariance, whole.covariance / np.outer(scale, scale), rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(found.spread.degrees, whole.degrees, rtol=1e-6)


def test_uncertainty_of_projection_is_the_spread_of_many_fits():
    rng = np.random.default_rng(5)
    poses = board_poses(rng, 15)
    captures = [capture_of(poses, noise, rng) for noise in [0.0] + [0.2] * 15]
    truth, *fits = (fit_cameras("k1k2", c, observations_of(c.views, BOARD), near=camera()) for c in captures)
    system = normal_equations(fits[0], observations_of(captures[1].views, BOARD), free_parameters("k1k2"))
    predicted = projection_sigma(fits[0].camera, naive_covariance(system, fits[0], free_parameters("k1k2")))
    spread = np.sqrt(np.mean([projection_difference(truth.camera, f.camera).values ** 2 for f in fits], axis=0))
    # rms distance lies between one and sqrt(2) sigmas of the worst direction; 15 fits know it to 18 %
    ratio = np.nanmedian(spread / predicted.values)
    assert 0.8 < ratio < 1.6
    assert predicted.centre < predicted.outer <= predicted.worst


def test_a_turned_camera_does_not_differ():
    a = camera("equidistant")
    moved_centre = a.with_parameters(a.parameters + np.array([0, 0, 1.5, -1.0, 0, 0, 0, 0]))
    assert projection_difference(a, a).worst < 1e-9
    difference = projection_difference(a, moved_centre)
    assert difference.median < 0.2  # of 1.8 px


def test_halves_agree_when_the_model_is_right_and_not_when_views_lie(noisy):
    found = calibrate(noisy, "plumb_bob")
    halves = compare_halves(found, noisy)
    assert halves is not None
    assert halves.difference.median < 2 * halves.expected_px
    stretched = tuple(
        replace(v, pixels=(v.pixels - 320) * 1.02 + 320) if i % 2 else v for i, v in enumerate(noisy.views)
    )
    worse = compare_halves(replace(found, seen=observations_of(stretched, BOARD)), noisy)
    assert worse is not None
    assert worse.difference.median > 2 * halves.difference.median
    few = replace(noisy, views=noisy.views[:5])
    assert compare_halves(calibrate(few, "k1k2"), few) is None


@pytest.mark.parametrize("truth", ["equidistant", "k1k2"])
def test_the_model_that_made_the_views_is_chosen(truth):
    rng = np.random.default_rng(8)
    strong = {"equidistant": [0.02, -0.02, 0.01, -0.002], "k1k2": [-0.3, 0.06, 0, 0, 0]}
    K = np.array([[300.0, 0, 321], [0, 301, 238], [0, 0, 1]])
    cam = Camera(MODELS[truth].lens, 640, 480, K, np.array(strong[truth]))
    capture = capture_of(board_poses(rng, 20, cam=cam, spread=0.9), 0.05, rng, cam=cam)
    tried = candidates(capture, observations_of(capture.views, BOARD), ["k1k2", "plumb_bob", "equidistant"])
    assert choose(tried) == truth
    by_name = {c.model: c for c in tried}
    assert by_name[truth].held_out_rms_px == pytest.approx(0.05 * np.sqrt(2), rel=0.1)
    other = "k1k2" if truth == "equidistant" else "equidistant"
    assert by_name[other].held_out_rms_px > 1.02 * by_name[truth].held_out_rms_px


def test_held_out_errors_are_larger_than_those_of_the_fit(noisy):
    seen = observations_of(noisy.views[:6], BOARD)
    errors = held_out_errors("plumb_bob", noisy, seen)
    assert errors is not None
    assert np.sqrt((errors**2).mean()) > calibrate(replace(noisy, views=noisy.views[:6]), "plumb_bob").fit.rms_px


def test_the_most_informative_views_are_better_than_the_first(noisy):
    rng = np.random.default_rng(3)
    flat = np.stack([np.eye(4)] * 30)
    flat[:, :3, 3] = rng.uniform([-0.2, -0.1, 0.6], [0.0, 0.0, 0.6], (30, 3))
    capture = capture_of(np.concatenate([flat, board_poses(rng, 12)]), 0.2, rng)
    chosen, left = most_informative(capture, most=12)
    assert (len(chosen.views), left) == (12, 30)
    assert [v.name for v in chosen.views] == sorted(v.name for v in chosen.views)
    first = calibrate(replace(capture, views=capture.views[25:37]), "k1k2")
    best = calibrate(chosen, "k1k2")
    assert np.sqrt(best.naive_covariance[0, 0]) < 0.7 * np.sqrt(first.naive_covariance[0, 0])
    assert chosen.left_out[-1] == ("less informative than the 12 used", 30)


def judged(capture: Capture, model: str = "plumb_bob"):
    found = calibrate(capture, model)
    tried = candidates(capture, found.seen, [model])
    return camera_gates(found, coverage_of(found.fit, found.seen), compare_halves(found, capture), tried)


@pytest.mark.parametrize(
    "board", [BOARD, Board("charuco", 7, 5, 0.04, 0.03, dictionary="5X5_100")], ids=["chess", "charuco"]
)
def test_a_careful_capture_passes(board):
    """40 views moved to the edges and corners, as anyone can take them; a ChArUco board is half outside in some."""
    rng = np.random.default_rng(4)
    whole = capture_of(sweep_poses(rng, 40, board), 0.12, rng, board=board)
    inside = [camera().is_inside(view.pixels) for view in whole.views]
    views = [replace(v, ids=v.ids[ok], pixels=v.pixels[ok]) for v, ok in zip(whole.views, inside, strict=True)]
    gates = judged(replace(whole, views=tuple(views)))
    assert verdict_of(gates) == "PASS", [g for g in gates if g.reason]


def test_a_poor_capture_cannot_tell_and_a_wrong_one_fails():
    rng = np.random.default_rng(4)
    few = judged(capture_of(sweep_poses(rng, 6), 0.1, rng))
    assert verdict_of(few) == "CANNOT TELL"
    assert any("only 6 views" in gate.reason for gate in few)
    middle = judged(capture_of(board_poses(rng, 40, spread=0.1), 0.1, rng))
    assert verdict_of(middle) == "CANNOT TELL"
    assert "hull of the corners" in {gate.name for gate in middle if gate.verdict != "PASS"}
    assert verdict_of(judged(capture_of(sweep_poses(rng, 20), 0.8, rng))) == "FAIL"


def test_too_few_views_and_unknown_models_are_refused(noisy):
    with pytest.raises(CalibrationError, match="2 views of the board are too few"):
        calibrate(replace(noisy, views=noisy.views[:2]), "plumb_bob")
    with pytest.raises(CalibrationError, match="did you mean 'plumb_bob'"):
        calibrate(noisy, "plum_bob")


def test_every_model_is_a_lens_with_known_coefficients():
    for model in MODELS:
        assert free_parameters(model)[:4].all()
        assert free_parameters(model)[4:].sum() == len(MODELS[model].estimated)


# ----------------------------------------------------------------------------------------------------------- real data


@cache
def opencv_samples(data, side: str, half_window: int | None) -> Capture:
    files = pictures_of_files(sorted((data / "calib/opencv_leftright").glob(f"{side}*.jpg")))
    return capture_from_pictures(files, board_from("chessboard:9x6:0.025"), len(files), half_window=half_window)


@pytest.mark.opencv
@pytest.mark.parametrize(
    ("side", "rms", "K"),
    [
        ("left", 0.19624, (532.789, 532.914, 342.481, 233.913)),
        ("right", 0.20768, (537.430, 536.946, 327.611, 248.894)),
    ],
)
def test_opencvs_samples_give_the_reference(data, side, rms, K):
    found = calibrate(opencv_samples(data, side, 5), "plumb_bob").plain
    assert found.is_converged
    assert found.rms_px == pytest.approx(rms, abs=0.001)
    np.testing.assert_allclose(found.camera.parameters[:4], K, atol=0.1)


def test_pictures_of_two_cameras_do_not_pass_as_one(data):
    left, right = opencv_samples(data, "left", 5), opencv_samples(data, "right", 5)
    gates = judged(replace(left, views=(*left.views, *right.views)))
    assert verdict_of(gates) != "PASS"
    assert "halves differ by, median" in {gate.name for gate in gates if gate.verdict != "PASS"}


@pytest.mark.opencv
def test_four_numbers_are_called_reprojection_error(data):
    capture = opencv_samples(data, "left", 5)
    plain = calibrate(capture, "plumb_bob").plain
    errors = reprojection_errors(plain.residuals, observations_of(capture.views, capture.board).views)
    np.testing.assert_allclose(list(errors.values()), (0.1962, 0.1388, 0.1754, 0.0265), atol=0.001)


@pytest.mark.opencv
@pytest.mark.parametrize("side", ["left", pytest.param("right", marks=pytest.mark.slow)])
def test_the_half_window_of_the_spacing_beats_any_fixed_one(data, side):
    own = calibrate(opencv_samples(data, side, None), "plumb_bob")
    assert own.plain.rms_px < 0.19
    assert calibrate(opencv_samples(data, side, 11), "plumb_bob").plain.rms_px > 0.39


@pytest.mark.opencv
def test_four_charuco_views_are_fitted_but_cannot_pass(data):
    files = pictures_of_files([data / "calib/opencv_charuco"])
    capture = capture_from_pictures(files, board_from("charuco:5x7:0.04:0.02:6X6_250"), len(files))
    assert [len(view.ids) for view in capture.views] == [24] * 4
    found = calibrate(capture, "plumb_bob")
    assert found.plain.rms_px == pytest.approx(0.18776, abs=0.001)
    assert found.plain.camera.K[0, 0] == pytest.approx(457.29, abs=0.2)
    assert 0.03 < np.sqrt(found.naive_covariance[0, 0]) / 457.29 < 0.04
    tried = candidates(capture, found.seen, ["plumb_bob"])
    gates = camera_gates(found, coverage_of(found.fit, found.seen), compare_halves(found, capture), tried)
    assert verdict_of(gates) == "CANNOT TELL"
    assert {g.name for g in gates if g.verdict != "PASS"} >= {"views", "sigma of the focal length"}


@pytest.mark.parametrize(
    ("model", "rms"), [("equidistant", 0.12861), ("plumb_bob", 0.13629), ("rational_polynomial", 0.12506)]
)
def test_the_wide_camera_gives_the_reference(data, model, rms):
    path = data / "calib/acfr_vlp16/corners_all40_opencv4.14.npz"
    capture = capture_from_npz(path, board_from("chessboard:7x5:0.095"), (1920, 1208))
    plain: Fit = calibrate(capture, model).plain
    assert plain.is_converged
    assert plain.rms_px == pytest.approx(rms, abs=1e-5)
    if model == "plumb_bob":
        assert plain.camera.K[0, 0] == pytest.approx(1176.5, abs=0.1)


def test_the_wide_camera_is_called_a_fisheye(data):
    path = data / "calib/acfr_vlp16/corners_all40_opencv4.14.npz"
    capture = capture_from_npz(path, board_from("chessboard:7x5:0.095"), (1920, 1208))
    tried = candidates(capture, observations_of(capture.views, capture.board), ["plumb_bob", "equidistant"])
    assert choose(tried) == "equidistant"
    assert [c.grows_to_corner for c in tried] == [False, True]
