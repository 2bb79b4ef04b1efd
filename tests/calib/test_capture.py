"""Pictures of a board: what is found, chosen and left out, and what is said when nothing is."""

from __future__ import annotations

import weakref
from itertools import islice
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.calib.drawn import BOARD, board_poses, camera, picture
from wallkit.calib.board.boards import board_from
from wallkit.calib.board.capture import capture_from_pictures, pictures_of_files
from wallkit.calib.board.detect import find_roughly
from wallkit.calib.board.frames import Picture
from wallkit.calib.board.pattern import find_pattern
from wallkit.calib.board.views import capture_from_npz
from wallkit.errors import CalibrationError

pytestmark = pytest.mark.opencv


def pictures_of(images):
    return [
        Picture(
            f"{i:04d}",
            lambda shrink, a=a: (
                a if shrink == 1 else cv2.resize(a, None, fx=1 / shrink, fy=1 / shrink, interpolation=cv2.INTER_AREA)
            ),
        )
        for i, a in enumerate(images)
    ]


@pytest.fixture(scope="module")
def drawn():
    """Five poses and their pictures, not too tilted for shrunken frames: choosing is tested here, not how far that goes."""
    tried = board_poses(np.random.default_rng(2), 12, spread=0.35)
    shown = ((pose, picture(pose)) for pose in tried)
    return list(islice(((pose, image) for pose, image in shown if find_roughly(image, BOARD) is not None), 5))


@pytest.fixture(scope="module")
def poses(drawn):
    return [pose for pose, _ in drawn]


@pytest.fixture(scope="module")
def images(drawn):
    return [image for _, image in drawn]


def test_drawn_corners_are_found_to_about_a_tenth_of_a_pixel(images, poses):
    capture = capture_from_pictures(pictures_of(images), BOARD, len(images))
    assert len(capture.views) == 5
    for view, pose in zip(capture.views, poses, strict=True):
        truth = camera().project(BOARD.object_points @ pose[:3, :3].T + pose[:3, 3])
        error = np.linalg.norm(view.pixels - truth, axis=1)
        assert np.sqrt((error**2).mean()) < 0.15


def test_a_long_log_is_thinned_to_sharp_still_and_different_frames(images):
    grey = np.full_like(images[0], 120)
    # 25 still frames of each pose, some blurred, and some without a board
    frames = [f for image in images for f in [image] * 25]
    frames[3] = cv2.GaussianBlur(frames[3], (0, 0), 2.5)
    frames[30] = frames[31] = grey
    capture = capture_from_pictures(pictures_of(frames), BOARD, len(frames))
    reasons = dict(capture.left_out)
    assert reasons["no board found"] == 2
    assert reasons["blurred"] == 1
    assert reasons["much like a view that is used"] >= 100
    assert len(capture.views) <= 12
    assert len({round(float(v.pixels[0, 0]), 1) for v in capture.views}) == 5
    assert all(v.motion_px < 0.1 for v in capture.views)


def test_moving_boards_are_left_out_when_enough_stand_still(images):
    shifted = [np.roll(images[0], 4 * i, axis=1) for i in range(10)]
    frames = [f for image in images for f in [image] * 21] + shifted
    capture = capture_from_pictures(pictures_of(frames), BOARD, len(frames))
    assert dict(capture.left_out)["moving by more than 1 px a frame"] >= 8


def test_pictures_of_two_sizes_are_refused_by_name(images):
    with pytest.raises(CalibrationError, match=r"two sizes: 0000 is 640 x 480, 0002 is 320 x 240"):
        capture_from_pictures(pictures_of([*images[:2], images[2][::2, ::2]]), BOARD, 3)


def test_a_broken_picture_costs_itself_only(images):
    def broken(shrink):
        raise CalibrationError("12 bytes are no picture")

    film = [Picture("broken", broken), *pictures_of(images)]
    capture = capture_from_pictures(film, BOARD, len(film))
    assert len(capture.views) == len(images)
    assert dict(capture.left_out) == {"cannot be decoded": 1}
    long = [Picture("broken", broken), *pictures_of(images * 25)]
    capture = capture_from_pictures(long, BOARD, len(long))
    assert dict(capture.left_out)["cannot be decoded"] == 1
    assert len(capture.views) + sum(many for _, many in capture.left_out) == len(long)
    for few in (1, 101):
        with pytest.raises(CalibrationError, match="12 bytes are no picture"):
            capture_from_pictures([Picture("broken", broken)] * few, BOARD, few)


def test_a_film_is_gone_through_once_and_little_of_it_is_kept(images):
    kept: list[weakref.ref] = []
    most = 0

    def film():
        nonlocal most
        for number in range(900):
            picture = Shown(np.roll(images[number % len(images)], number // 20, axis=1))
            kept.append(weakref.ref(picture))
            most = max(most, sum(ref() is not None for ref in kept))
            yield Picture(f"{number:04d}", picture)

    once = film()
    capture = capture_from_pictures(once, BOARD, 900)
    assert next(once, None) is None
    assert most < 200
    assert 10 < len(capture.views) <= 100
    assert len(capture.views) + sum(many for _, many in capture.left_out) == 900


class Shown:
    """A picture in memory, as long as anyone holds it."""

    def __init__(self, grey: np.ndarray) -> None:
        self.grey = grey

    def __call__(self, shrink: int) -> np.ndarray:
        return np.ascontiguousarray(self.grey[::shrink, ::shrink])


def test_no_board_at_all(images):
    grey = np.full_like(images[0], 120)
    with pytest.raises(CalibrationError, match="found in none of 3 pictures") as raised:
        capture_from_pictures(pictures_of([grey] * 3), BOARD, 3)
    assert "whole, sharp" in raised.value.hint


@pytest.mark.parametrize("declared", ["chessboard:10x7:0.03", "chessboard:8x5:0.03", "chessboard:6x5:0.03"])
def test_the_true_pattern_is_proposed_for_a_wrong_one(images, declared):
    with pytest.raises(CalibrationError, match=r"a chessboard of 9 x 6 inner corners is seen in") as raised:
        capture_from_pictures(pictures_of(images[:2]), board_from(declared), 2)
    assert "--board chessboard:9x6:0.03" in raised.value.hint


def test_a_board_that_is_cut_off_is_called_so(images, poses):
    # the board's right part lies outside the picture, by another share in each
    cut = []
    for image, pose, keep in zip(images, poses, (5, 6, 7, 5, 6), strict=True):
        edge = camera().project(pose[:3, :3] @ (keep * 0.03 - 0.015, 0.075, 0) + pose[:3, 3])[0]
        cut.append(np.roll(image, 640 - int(edge), axis=1))
        cut[-1][:, : max(0, 640 - int(edge))] = 120
    with pytest.raises(CalibrationError, match="cut off"):
        capture_from_pictures(pictures_of(cut), BOARD, len(cut))


def test_charuco_for_chessboard_and_the_wrong_dictionary_are_noticed(data):
    files = pictures_of_files([data / "calib/opencv_charuco"])
    with pytest.raises(CalibrationError, match="markers of 6X6_250"):
        capture_from_pictures(files, board_from("chessboard:5x4:0.04"), 4)
    with pytest.raises(CalibrationError, match="markers in them are of 6X6_250"):
        capture_from_pictures(files, board_from("charuco:5x7:0.04:0.02:4X4_50"), 4)


def test_the_pattern_of_the_robots_pictures_is_recognised(data):
    files = pictures_of_files([data / "calib/acfr_2d/images"])
    assert {find_pattern(file.grey(1)) for file in files[:2]} == {(11, 8)}
    assert files[0].stamp_ns == 1773380642793311604


def test_files_that_are_no_pictures(tmp_path):
    with pytest.raises(CalibrationError, match="no such file"):
        pictures_of_files([tmp_path / "gone"])
    with pytest.raises(CalibrationError, match="holds no pictures"):
        pictures_of_files([tmp_path])
    (tmp_path / "a.png").write_bytes(b"not a picture")
    files = pictures_of_files([tmp_path])
    with pytest.raises(CalibrationError, match=r"a\.png: 13 bytes are no picture"):
        capture_from_pictures(files, BOARD, 1)


def npz(path: Path, **arrays) -> Path:
    np.savez(path, **arrays)
    return path


def test_corners_from_an_archive(tmp_path):
    pixels = camera().project(BOARD.object_points + (-0.1, -0.1, 0.6))
    holes = pixels.copy()
    holes[3] = np.nan
    path = npz(tmp_path / "c.npz", **{"10": pixels, "2": holes[:, None], "image_size": (640, 480)})
    capture = capture_from_npz(path, BOARD, None)
    assert [view.name for view in capture.views] == ["2", "10"]
    assert 3 not in capture.views[0].ids
    assert (capture.width, capture.height) == (640, 480)


def test_archives_that_do_not_fit_are_refused(tmp_path):
    pixels = camera().project(BOARD.object_points + (-0.1, -0.1, 0.6))
    with pytest.raises(CalibrationError, match="how large the images are"):
        capture_from_npz(npz(tmp_path / "a.npz", a=pixels), BOARD, None)
    with pytest.raises(CalibrationError, match="view 'a' has 50 corners, not 54"):
        capture_from_npz(npz(tmp_path / "a.npz", a=pixels[:50]), BOARD, (640, 480))
    with pytest.raises(CalibrationError, match="outside an image of 320 x 240"):
        capture_from_npz(npz(tmp_path / "a.npz", a=pixels), BOARD, (320, 240))
    (tmp_path / "b.npz").write_bytes(b"x")
    with pytest.raises(CalibrationError, match="no archive"):
        capture_from_npz(tmp_path / "b.npz", BOARD, (640, 480))
