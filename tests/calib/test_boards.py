"""Boards: where their corners are, how they are written, and that a printed sheet is detected at its true size."""

from __future__ import annotations

import re
from pathlib import Path

import cv2
import numpy as np
import pytest

from wallkit.calib.board import detect
from wallkit.calib.board.boards import Board, board_from, opencv_board
from wallkit.calib.board.detect import find_corners, find_roughly
from wallkit.calib.board.sheet import PAPERS, Sheet, pdf_from_sheet, sheet_of, svg_from_sheet
from wallkit.calib.camera.bundle import homography
from wallkit.errors import CalibrationError

BOARDS = [
    "chessboard:9x6:0.025",
    "chessboard:6x9:0.02",
    "charuco:5x7:0.036:0.018:6X6_250",
    "charuco:8x6:0.03:0.022:5X5_100",
    "aprilgrid:4x5:0.03:0.009:APRILTAG_36H11",
]
PX_PER_MM = 4

pytestmark = pytest.mark.opencv


def drawn(sheet: Sheet) -> np.ndarray:
    """The page as pixels, 4 a millimetre, pixel (0, 0) covering the first quarter millimetre."""
    page = np.full((round(sheet.height_mm * PX_PER_MM), round(sheet.width_mm * PX_PER_MM)), 255, np.uint8)
    for x, y, w, h in np.round(sheet.rectangles * PX_PER_MM).astype(int):
        page[y : y + h, x : x + w] = 0
    return page


@pytest.mark.parametrize("words", BOARDS)
def test_a_printed_sheet_is_found_whole_at_its_true_size(words):
    board = board_from(words)
    page = cv2.GaussianBlur(drawn(sheet_of(board)), (0, 0), 1.0)
    found = find_corners(page, board)
    assert found is not None
    assert found.ids.tolist() == list(range(len(board.object_points)))
    # the sheet is the board up to a shift: metres on the board are millimetres on the page, and nothing is turned
    on_page = (found.pixels + 0.5) / PX_PER_MM
    on_board = board.object_points[found.ids, :2] * 1e3
    shift = on_page - on_board
    assert np.abs(shift - shift.mean(axis=0)).max() < (0.3 if board.kind == "aprilgrid" else 0.15)


@pytest.mark.parametrize("words", BOARDS)
def test_toml_and_words_give_the_board_again(words, tmp_path):
    board = board_from(words)
    assert board_from(board.words) == board
    (tmp_path / "b.toml").write_text(board.toml())
    assert board_from(str(tmp_path / "b.toml")) == board


def test_a_plate_is_kept_and_its_corners_lie_around_the_pattern(tmp_path):
    board = Board("chessboard", 7, 5, 0.095, plate_m=(0.85, 0.61), plate_offset_m=(0.002, 0.0))
    (tmp_path / "b.toml").write_text(board.toml())
    assert board_from(str(tmp_path / "b.toml")) == board
    middle = np.array([3 * 0.095 + 0.002, 2 * 0.095, 0])
    np.testing.assert_allclose(board.plate_corners.mean(axis=0), middle)
    np.testing.assert_allclose(board.plate_corners[2] - board.plate_corners[0], [0.85, 0.61, 0])


@pytest.mark.parametrize("words", [w for w in BOARDS if w.startswith("charuco")])
def test_charuco_corners_are_opencvs(words):
    board = board_from(words)
    np.testing.assert_allclose(board.object_points, opencv_board(board).getChessboardCorners(), atol=1e-7)


def test_aprilgrid_corners_are_opencvs():
    board = board_from(BOARDS[-1])
    theirs = np.concatenate([np.asarray(tag).reshape(4, 3) for tag in opencv_board(board).getObjPoints()])
    np.testing.assert_allclose(board.object_points, theirs, atol=1e-6)


def turned_view(board: Board, turns: int) -> np.ndarray:
    return np.ascontiguousarray(np.rot90(cv2.GaussianBlur(drawn(sheet_of(board)), (0, 0), 1.0), turns))


@pytest.mark.parametrize("turns", [0, 1, 2, 3])
def test_a_chessboard_with_two_different_ends_begins_at_the_dark_one(turns):
    board = board_from("chessboard:9x6:0.02")
    view = turned_view(board, turns)
    found = find_corners(view, board)
    assert found is not None
    H = homography(board.object_points[:, :2], found.pixels)
    assert np.linalg.det(H / H[2, 2]) > 0  # seen from the front
    outer = H @ (-0.01, -0.01, 1)  # in the middle of the square outside the first corner
    u, v = np.round(outer[:2] / outer[2]).astype(int)
    assert view[v, u] < 60


def test_the_shrunken_search_finds_the_same_corners():
    board = board_from("chessboard:9x6:0.025")
    page = cv2.GaussianBlur(drawn(sheet_of(board)), (0, 0), 1.0)
    rough, exact = find_roughly(page, board), find_corners(page, board)
    assert rough is not None
    assert exact is not None
    assert np.abs(rough - exact.pixels).max() < 2.5


def test_nothing_is_found_where_nothing_is():
    noise = np.random.default_rng(0).integers(0, 255, (240, 320)).astype(np.uint8)
    for words in BOARDS:
        assert find_corners(noise, board_from(words)) is None


def test_the_half_window_follows_the_corner_spacing():
    board = board_from("chessboard:9x6:0.025")
    small = cv2.resize(drawn(sheet_of(board)), None, fx=0.09, fy=0.09, interpolation=cv2.INTER_AREA)
    found = find_corners(small, board)
    assert found is not None
    assert found.spacing_px == pytest.approx(25 * PX_PER_MM * 0.09, abs=0.3)
    wide = find_corners(small, board, half_window=11)
    truth = board.object_points[:, :2] * 1e3 * PX_PER_MM * 0.09

    def worst(pixels):
        shift = pixels - truth
        return np.abs(shift - np.median(shift, axis=0)).max()

    assert worst(found.pixels) < 0.1 < worst(wide.pixels)


def test_a_corner_that_begins_beside_its_window_is_found_between_the_others(monkeypatch):
    """OpenCV's refinement gives up silently there, and the corner would stay pixels away from its place."""
    board = board_from("chessboard:7x5:0.03")
    grey = cv2.GaussianBlur(drawn(sheet_of(board)), (0, 0), 1.0)
    right = find_corners(grey, board).pixels
    rough = right + np.random.default_rng(0).normal(0, 0.4, right.shape)
    rough[[3, 17]] += (13.0, -14.0)
    monkeypatch.setitem(detect._FINDERS, "chessboard", lambda grey, board: (np.arange(35), rough))
    found = find_corners(grey, board).pixels
    np.testing.assert_allclose(found, right, atol=0.05)


def test_svg_and_pdf_say_the_size_and_the_board_and_are_the_same_twice():
    board = board_from("chessboard:9x6:0.025")
    sheet = sheet_of(board, paper="A3")
    svg, pdf = svg_from_sheet(sheet).decode(), pdf_from_sheet(sheet).decode("latin-1")
    assert 'width="297mm" height="420mm"' in svg
    assert "[0 0 841.8898 1190.5512]" in pdf
    assert "/PrintScaling /None" in pdf
    for text in (svg, pdf):
        assert "100 mm" in text
        assert "corners = [9, 6]" in text
        assert "square_m = 0.025" in text
    assert svg_from_sheet(sheet_of(board, paper="A3")).decode() == svg
    # every object of the PDF begins where its table says
    for offset in re.findall(r"^(\d{10}) 00000 n", pdf, re.M):
        assert re.match(r"\d+ 0 obj", pdf[int(offset) :])


def test_paper_is_chosen_or_refused():
    assert (sheet_of(board_from("chessboard:9x6:0.02")).width_mm, 297) == (297, 297)
    assert sheet_of(board_from("chessboard:7x5:0.3")).width_mm > 2000
    with pytest.raises(CalibrationError, match=r"needs 855 x 689 .* more than A4"):
        sheet_of(board_from("chessboard:7x5:0.095"), paper="a4")
    with pytest.raises(CalibrationError, match="'B4' is not known"):
        sheet_of(board_from("chessboard:7x5:0.095"), paper="B4")


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("chessbord:9x6:0.025", "no board"),
        ("chessboard:9:0.025", "no board"),
        ("chessboard:9x6:25", "between 0.1 mm and 10 m"),
        ("chessboard:9x6:wide", "'wide'"),
        ("chessboard:2x6:0.02", "too small"),
        ("charuco:5x7:0.04:0.05:6X6_250", "do not fit"),
        ("charuco:5x7:0.04:0.02:7X6_250", "'7X6_250' is not known"),
        ("missing.toml", "cannot be read"),
    ],
)
def test_a_board_that_cannot_be_is_refused(words, says):
    with pytest.raises(CalibrationError, match=says):
        board_from(words)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("x = 1", "no \\[board\\] table"),
        ("[board", "no TOML"),
        ('[board]\nkind = "chess"', "kind = 'chess'"),
        ('[board]\nkind = "chessboard"\nsquare_m = 0.02', "lacks 'corners'"),
        ('[board]\nkind = "chessboard"\ncorners = [9]\nsquare_m = 0.02', "not \\[columns, rows\\]"),
        ('[board]\nkind = "chessboard"\ncorners = [9, 6]\nsquare_mm = 20', "did you mean 'square_m'"),
        ('[board]\nkind = "chessboard"\ncorners = [9, 6]\nsquare_m = "20 mm"', "no length"),
        ('[board]\nkind = "chessboard"\ncorners = [9, 6]\nsquare_m = 0.02\nplate_m = [0.1, 0.1]', "smaller than"),
    ],
)
def test_a_file_that_describes_no_board_is_refused_by_name(text, says, tmp_path):
    (tmp_path / "b.toml").write_text(text)
    with pytest.raises(CalibrationError, match=says) as raised:
        board_from(str(tmp_path / "b.toml"))
    assert "b.toml" in str(raised.value)


@pytest.mark.parametrize(
    "path", sorted((Path(__file__).parents[2] / "calib/boards").glob("*.toml")), ids=lambda p: p.stem
)
def test_the_boards_of_the_repository_are_whole_and_fit_the_paper_they_name(path):
    sheet = sheet_of(board_from(str(path)))
    if path.stem[-2:] in ("a3", "a4"):
        assert tuple(sorted((sheet.width_mm, sheet.height_mm))) == PAPERS[path.stem[-2:].upper()]
