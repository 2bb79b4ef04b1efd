"""What an image shows where points land: motion between scan and image, margins, shares, and what hides what."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from wallkit.core.calibration import Calibration
from wallkit.core.camera import Camera
from wallkit.core.geometry import compose, invert_matrix, relative, transform_points
from wallkit.core.types import BeamLabels, CameraImage, Frame, Points, View
from wallkit.points.labels import PASSED_OVER, labelled_scan, labels_by_beam, thinned
from wallkit.points.look import Look, LookSettings, _share_out, look, project_frame
from wallkit.points.outlines import classes_by_outlines
from wallkit.points.project import project
from wallkit.segment.class_map import class_map

FOCAL = 300.0
K = np.array([[FOCAL, 0, 320], [0, FOCAL, 240], [0, 0, 1]])
MOUNT = np.eye(4)
MOUNT[:3, 3] = 0.2, 0.0, 0.3
# the camera looks where the LiDAR does, half a metre above it
T_CAMERA_LIDAR = np.array([[0.0, -1, 0, 0], [0, 0, -1, 0.5], [1, 0, 0, 0], [0, 0, 0, 1]])
CALIBRATION = Calibration(Camera("plumb_bob", 640, 480, K, np.zeros(5)), T_CAMERA_LIDAR, time_offset_sigma_ns=0.0)
EXACT = LookSettings(margins=0)
NO_IMAGE = CameraImage(0, "camera", "png", b"")


def frame_of(xyz_base, *, odometry=(0.0, 0, 0), offsets_s=None, **more):
    xyz = np.asarray(xyz_base, dtype=np.float32)
    ranges = np.linalg.norm(xyz - MOUNT[:3, 3], axis=1).astype(np.float32)
    points = Points(10**9, xyz, ranges, np.arange(len(xyz)), MOUNT[:2, 3], 20.0, np.zeros(0, np.float32),
                    offsets_s=None if offsets_s is None else np.asarray(offsets_s, np.float32))  # fmt: skip
    return Frame(10**9, points, np.asarray(odometry, float), **more)


def view_at(odometry, *, after_ms=0, **speeds):
    return View("/camera", NO_IMAGE, 10**9 + after_ms * 10**6, np.asarray(odometry, float), **speeds)


def located(frame, view, settings=EXACT, calibration=CALIBRATION):
    return project_frame(calibration, frame, view, invert_matrix(MOUNT), settings)


def test_equations_1_to_6_of_the_paper():
    """P_camera = T P_lidar, (u', v', w') = K P_camera, u = u'/w', v = v'/w'."""
    in_base = np.array([[3.2, 0.5, 0.3], [5.2, -1.0, 0.3]])
    projection, is_seen, margins = located(frame_of(in_base), view_at((0, 0, 0)))
    in_lidar = np.column_stack([in_base, np.ones(2)]) @ invert_matrix(MOUNT).T
    primed = (in_lidar @ T_CAMERA_LIDAR.T)[:, :3] @ K.T
    np.testing.assert_allclose(projection.pixels, primed[:, :2] / primed[:, 2:], rtol=1e-6)
    assert is_seen.all()
    assert not margins.any()


def test_points_are_moved_to_the_moment_of_the_image():
    """A thing that stands still is seen where it is from where the robot is then, whatever happened in between."""
    rng = np.random.default_rng(0)
    at_scan, at_image = np.array([1.0, 2.0, 0.7]), np.array([1.3, 2.2, 1.0])
    in_odom = transform_points(at_scan, rng.uniform((2, -1), (6, 1), (50, 2)))
    seen_then = transform_points(relative(at_scan, np.zeros(3)), in_odom)
    seen_now = transform_points(relative(at_image, np.zeros(3)), in_odom)
    np.testing.assert_allclose(compose(at_image, relative(at_image, at_scan)), at_scan, atol=1e-12)
    then = frame_of(np.column_stack([seen_then, np.full(50, 0.3)]), odometry=at_scan)
    now = frame_of(np.column_stack([seen_now, np.full(50, 0.3)]), odometry=at_image)
    moved, _, _ = located(then, view_at(at_image))
    there, _, _ = located(now, view_at(at_image))
    np.testing.assert_allclose(moved.pixels, there.pixels, atol=2e-3)
    still, _, _ = located(then, view_at(at_scan))
    assert np.abs(still.pixels - there.pixels)[:, 0].min() > 50


def test_the_margin_is_calibration_clock_and_motion_together():
    point, table = [[2.2, 0.0, 0.3]], np.array([[1.0, 6.0], [4.0, 3.0]])
    exact = replace(CALIBRATION, pixel_error_95=table)
    only = LookSettings(moving_m_s=0, time_sigma_s=0)
    (margin,) = located(frame_of(point), view_at((0, 0, 0)), only, exact)[2]
    assert margin == pytest.approx(exact.pixel_error_95_at(2.0))
    # 10 ms sigma while turning 0.5 rad/s: 1.96 sigmas of it
    late = replace(exact, time_offset_sigma_ns=10e6)
    (margin,) = located(frame_of(point), view_at((0, 0, 0), turn_rad_s=0.5), only, late)[2]
    assert margin == pytest.approx(np.hypot(exact.pixel_error_95_at(2.0), 1.96 * 0.01 * FOCAL * 0.5))
    # the beam 20 ms after the stamp, the image 70: half a metre a second is 25 mm, at 2 m
    walked = LookSettings(moving_m_s=0.5, time_sigma_s=0)
    frame = frame_of(point, offsets_s=[0.02])
    (margin,) = located(frame, view_at((0, 0, 0), after_ms=70), walked, exact)[2]
    assert margin == pytest.approx(np.hypot(exact.pixel_error_95_at(2.0), FOCAL * 0.025 / 2), rel=1e-4)
    (margin,) = located(frame_of(point), view_at((0, 0, 0)), LookSettings(unknown_error_px=5, moving_m_s=0))[2]
    assert margin == pytest.approx(5)


def half_wall(names=("wall", "person"), edge=320):
    """An image whose left half is a wall, and the right one a person; the last row is nobody's."""
    ids = np.zeros((480, 640), np.uint8)
    ids[:, edge:] = 1
    ids[-1] = 255
    return class_map(ids, names, nothing=255)


def looked(frame, view, segmentation, settings, calibration=CALIBRATION, classes_at=None):
    place = np.array([0, 1, -1])
    return look(located(frame, view, settings, calibration), classes_at or segmentation.classes_at, place, 2)


def test_shares_are_what_the_circle_shows():
    """The middle counts 0.666, six places on the circle the rest."""
    settings = LookSettings(unknown_error_px=10, moving_m_s=0, time_sigma_s=0)
    # pixels 290, 316 and 345 in u: far from, near to, and beyond the border at 319.5
    us = np.array([290.0, 316.0, 345.0])
    xyz = np.column_stack([np.full(3, 3.2), -(us - 320) / FOCAL * 3, np.full(3, 0.3)])
    found = looked(frame_of(xyz), view_at((0, 0, 0)), half_wall(), settings)
    ring = (1 - 0.666) / 6
    # of the six at 10 px the one at 0 deg and the two at 60 deg (5 px ahead) are beyond
    np.testing.assert_allclose(found.shares, [[1, 0], [0.666 + 3 * ring, 3 * ring], [0, 1]], atol=1e-6)
    assert found.labels.tolist() == [0, 0, 1]
    assert found.confidences.tolist() == [1, 1, 1]


def test_beside_the_image_and_where_nobody_can_tell_there_is_no_label():
    xyz = [[3.2, 0.2, 0.3], [3.2, 9.0, 0.3], [-3.0, 0.2, 0.3]]
    found = looked(frame_of(xyz), view_at((0, 0, 0)), half_wall(), EXACT)
    assert found.labels.tolist() == [0, -1, -1]
    assert found.is_seen.tolist() == [True, False, False]
    blind = class_map(np.full((480, 640), 255, np.uint8), ("wall", "person"), nothing=255)
    found = looked(frame_of(xyz), view_at((0, 0, 0)), blind, EXACT)
    assert found.labels.tolist() == [-1, -1, -1]
    assert not found.shares.any()


def test_a_scan_carries_shares_by_beam():
    from wallkit.core.types import BeamLabels

    shares = np.array([[1, 0], [0, 0], [0.25, 0.75]], np.float32)
    labels = BeamLabels(10**9, np.array([0, -1, 1]), ("wall", "person"), np.ones(3, np.float32), shares)
    frame = frame_of([[2, 0, 0.3], [2, 1, 0.3]], labels=labels)
    frame = replace(frame, points=replace(frame.points, beams=np.array([2, 7])))
    scan = labelled_scan(frame)
    assert scan.labels.tolist() == [1, -1]
    np.testing.assert_array_equal(scan.shares, [[0.25, 0.75], [0, 0]])


@pytest.mark.parametrize("method", ["crossing_number", "winding_number", "even_odd", "mask"])
def test_polygons_say_what_the_mask_says_but_at_its_border(method):
    rng = np.random.default_rng(2)
    segmentation = half_wall(edge=200)
    pixels = rng.uniform((5, 5), (630, 470), (500, 2))
    clear = np.abs(pixels[:, 0] - 199.5) > 1.5
    wanted, _ = segmentation.classes_at(pixels)
    found, sure = classes_by_outlines(segmentation, method)(pixels)
    np.testing.assert_array_equal(found[clear], wanted[clear])
    assert (sure[clear] == 1).all()
    assert classes_by_outlines(segmentation, method)([[-5.0, 5.0]])[0].tolist() == [-1]


def test_a_hidden_return_is_not_labelled():
    frame = frame_of([[5.2, 0.0, 0.3]], cloud_m=np.array([[5.2, 0, 0.3], [1.2, 0.0, 0.4]], np.float32))
    assert located(frame, view_at((0, 0, 0)))[1].tolist() == [True]
    # the same line of sight: from (0.2, 0, 0.8) through (2.7, 0, 0.55) to (5.2, 0, 0.3)
    frame = replace(frame, cloud_m=np.array([[5.2, 0, 0.3], [2.7, 0.0, 0.55]], np.float32))
    assert located(frame, view_at((0, 0, 0)))[1].tolist() == [False]


@pytest.mark.parametrize("samples", [1, 7])
def test_shares_are_those_of_a_loop_over_classes(samples):
    rng = np.random.default_rng(samples)
    count, class_of = 400, np.array([0, 1, 1, 2, -1])
    found = rng.choice([0, 1, 2, 3, -1], (samples, count), p=[0.7, 0.1, 0.1, 0.05, 0.05])
    sure = rng.uniform(0.2, 1, (samples, count)).astype(np.float32)
    seen = np.sort(rng.choice(500, count, replace=False))
    labels, confidences, shares = np.full(500, -1), np.zeros(500, np.float32), np.zeros((500, 3), np.float32)
    _share_out(found.ravel(), sure.ravel(), class_of, seen, samples, 0.666, labels, confidences, shares)
    weights = np.array([1.0]) if samples == 1 else np.array([0.666, *[0.334 / 6] * 6])
    shown = class_of[found]
    of_class = np.stack([(weights[:, None] * (shown == c)).sum(axis=0) for c in range(3)], axis=1)
    known = of_class.sum(axis=1)
    some = known > 0
    np.testing.assert_allclose(shares[seen][some], (of_class / np.where(some, known, 1)[:, None])[some], atol=1e-6)
    assert (labels[seen] == np.where(some, shares[seen].argmax(axis=1), -1)).all()
    of_best = weights[:, None] * (shown == labels[seen])
    expected = (of_best * sure).sum(axis=0) / np.where(some, of_best.sum(axis=0), 1)
    np.testing.assert_allclose(confidences[seen][some], expected[some], atol=1e-6)
    assert not shares[np.setdiff1d(np.arange(500), seen)].any()


def test_a_thinned_scan_is_spread_over_the_sweep_and_says_what_it_left_out():
    frame = frame_of(np.column_stack([np.arange(1, 1001), np.zeros((1000, 2))]), offsets_s=np.arange(1000) * 1e-4)
    few = thinned(frame, 240).points
    assert len(few.ranges_m) == 240
    assert few.dropped == {PASSED_OVER: 760}
    assert set(np.diff(few.beams)) == {4, 5}
    for name in ("xyz_m", "ranges_m", "offsets_s"):
        np.testing.assert_array_equal(getattr(few, name), getattr(frame.points, name)[few.beams])
    for enough in (0, 1000, 5000):
        assert thinned(frame, enough) is frame


def test_of_two_cameras_the_one_that_knows_better_counts():
    frame = frame_of(np.ones((4, 3)))
    frame = replace(frame, points=replace(frame.points, beams=np.array([1, 2, 4, 5])))

    def says(labels, margins):
        labels = np.array(labels)
        shares = np.eye(3, dtype=np.float32)[labels] * (labels >= 0)[:, None]
        nowhere = project(CALIBRATION, np.ones((4, 3)))
        return Look(nowhere, labels >= 0, np.array(margins), labels, np.full(4, 0.5, np.float32), shares)

    for order in (1, -1):
        looks = [says([0, 0, 0, -1], [1.0, 9, 5, 5]), says([1, 2, -1, -1], [5.0, 2, 1, 1])][::order]
        merged = labels_by_beam(frame, looks, ("a", "b", "c"))
        np.testing.assert_array_equal(merged.labels, [-1, 0, 2, -1, 0, -1])
        np.testing.assert_array_equal(merged.shares[[1, 2, 4]], np.eye(3)[[0, 2, 0]])
        np.testing.assert_array_equal(merged.confidences, [0, 0.5, 0.5, 0, 0.5, 0])
    assert labels_by_beam(frame, [], ("a",)) is None


def test_labels_go_from_beams_to_returns_also_where_there_are_too_few():
    frame = frame_of([[2.0, 0, 0.3], [3.0, 0, 0.3], [4.0, 0, 0.3]])
    frame = replace(frame, points=replace(frame.points, beams=np.array([2, 0, 5])))
    given = BeamLabels(0, np.array([1, 0, -1]), ("a", "b"), np.array([0.5, 0.6, 0.7]), np.eye(3, 2, dtype=np.float32))
    scan = labelled_scan(replace(frame, labels=given))
    np.testing.assert_array_equal(scan.labels, [-1, 1, -1])
    np.testing.assert_array_equal(scan.shares, [[0, 0], [1, 0], [0, 0]])
    np.testing.assert_allclose(scan.confidences, [0.7, 0.5, 0])
    bare = labelled_scan(replace(frame, labels=BeamLabels(0, np.array([1, 0, 1, 0, 0, 1]), ("a", "b"))))
    np.testing.assert_array_equal(bare.labels, [1, 1, 1])
    assert bare.shares is None
    assert bare.confidences is None
