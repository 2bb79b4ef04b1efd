"""`wallkit calib board`, `intrinsics` and `convert` as a user runs them, from a log and from pictures, good and bad."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from tests.calib.drawn import board_poses, camera, capture_of, picture, sweep_poses
from tests.calib.film import write_film
from wallkit.calib.board.boards import board_from
from wallkit.calib.files.store import read_calibration

WORDS = "chessboard:9x6:0.03"
CAMERA_INFO = """image_width: 640
image_height: 480
camera_name: front
camera_matrix: {rows: 3, cols: 3, data: [600.0, 0, 321.0, 0, 602.0, 238.0, 0, 0, 1]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [-0.25, 0.08, 0.001, -0.0008, -0.01]}
"""


@pytest.fixture(scope="module")
def film(tmp_path_factory):
    """Twelve seconds of a board at 12 places, and bare wall at the end."""
    path = tmp_path_factory.mktemp("film") / "log.mcap"
    poses = board_poses(np.random.default_rng(1), 12, spread=0.5)
    return path, write_film(path, poses, still_s=0.7, move_s=0.3)


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    """Four pictures of the board, the middle of a folder of its own."""
    folder = tmp_path_factory.mktemp("pictures")
    for number, pose in enumerate(board_poses(np.random.default_rng(2), 4, spread=0.35)):
        cv2.imwrite(str(folder / f"{number}.png"), picture(pose))
    return folder


@pytest.fixture
def corners(tmp_path):
    """An archive of what a careful capture of 40 views would find."""
    rng = np.random.default_rng(5)
    views = capture_of(sweep_poses(rng, 40), 0.1, rng).views
    path = tmp_path / "corners.npz"
    np.savez(path, image_size=(640, 480), **{view.name: view.pixels for view in views})
    return path


def refused(done, *said: str) -> None:
    """A message and no traceback, exit 2."""
    assert done.code == 2, done.err
    assert "Traceback" not in done.err
    for words in said:
        assert words in done.err


# --------------------------------------------------------------------------------------------------------- intrinsics


def test_a_log_gives_its_camera_and_accounts_for_every_frame(wallkit, film, tmp_path):
    path, count = film
    words = ("--board", WORDS, "--model", "plumb_bob")
    done = wallkit("calib", "intrinsics", path, *words, "-o", "out.toml", "--ros", "out.yaml", "--json", "-q")
    assert done.code in {0, 4}, done.err
    said = done.json
    assert said["pictures"] == count
    left = said["left_out"]
    assert len(said["views"]) + len(said["rejected_views"]) + sum(left.values()) == count
    assert left["no board found"] >= 0.09 * count
    assert left["much like a view that is used"] > 20
    truth = dict(zip(("fx", "fy", "cx", "cy"), (600, 602, 321, 238), strict=True))
    for name, value in truth.items():
        assert said["camera"][name] == pytest.approx(value, abs=max(3 * said["interval_95"][name], 1.0))
    assert said["camera"]["frame"] == "cam_optical"
    # the film's lens is the truth
    assert said["camera_info"]["topic"] == "/cam/camera_info"
    assert said["camera_info"]["difference_median_px"] < 1.0
    assert said["camera"]["name"] == "cam"
    toml, ros = read_calibration(tmp_path / "out.toml"), read_calibration(tmp_path / "out.yaml")
    np.testing.assert_array_equal(toml.camera.parameters, ros.camera.parameters)
    assert toml.verdict == said["verdict"]
    assert list(toml.provenance.inputs) == ["log.mcap"]
    again = wallkit("calib", "intrinsics", path, *words, "-o", "again.toml", "--json", "-q")
    assert again.out == done.out


def test_corners_of_a_careful_capture_pass(wallkit, corners, tmp_path):
    done = wallkit(
        "calib",
        "intrinsics",
        corners,
        "--board",
        WORDS,
        "--model",
        "plumb_bob",
        "-o",
        "out.toml",
        "--report",
        "out.html",
    )
    assert done.code == 0, done.out + done.err
    assert "verdict  PASS" in done.out
    assert "sigma is clustered by view" in done.out
    found = read_calibration(tmp_path / "out.toml")
    assert found.verdict == "PASS"
    assert found.camera.K[0, 0] == pytest.approx(600, abs=1.5)
    page = (tmp_path / "out.html").read_text()
    assert "<strong>PASS</strong>" in page
    assert page.count("data:image/svg+xml") == 3
    assert f"{found.camera.K[0, 0]:.4f}" in page
    assert "<script" not in page
    assert 'src="http' not in page


def test_four_pictures_cannot_tell(wallkit, pictures, tmp_path):
    done = wallkit("calib", "intrinsics", pictures, "--board", WORDS, "--model", "k1k2", "--json", "-q")
    assert done.code == 4
    assert done.json["verdict"] == "CANNOT TELL"
    assert any("only 4 views" in gate["reason"] for gate in done.json["gates"])
    done = wallkit("calib", "intrinsics", pictures, "--board", WORDS, "--model", "k1k2", "--report", "out.html", "-q")
    page = (tmp_path / "out.html").read_text()
    assert "<strong>CANNOT TELL</strong>" in page
    assert "only 4 views" in page


def test_a_dry_run_writes_nothing(wallkit, pictures, tmp_path):
    done = wallkit("calib", "intrinsics", pictures, "--board", WORDS, "-o", "out.toml", "--dry-run")
    assert done.code == 0
    assert "would look for chessboard:9x6:0.03" in done.out
    assert not (tmp_path / "out.toml").exists()


def test_a_result_is_not_overwritten_unasked(wallkit, pictures, tmp_path):
    (tmp_path / "out.toml").write_text("mine")
    refused(wallkit("calib", "intrinsics", pictures, "--board", WORDS, "-o", "out.toml"), "out.toml", "--overwrite")
    assert (tmp_path / "out.toml").read_text() == "mine"


@pytest.mark.long
@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--board", "chessboard:8x5:0.03"), ("9 x 6 inner corners is seen", "--board chessboard:9x6:0.03")),
        (("--board", "chessboard:9x6"), ("'chessboard:9x6' is no board", "chessboard:9x6:0.025")),
        (("--board", "charuco:9x6:0.03:0.02:5X5_100"), ("is it a plain chessboard?", "9x6")),
        (("--board", WORDS, "--size", "640"), ("WIDTHxHEIGHT",)),
    ],
)
def test_a_wrong_board_is_told_and_leaves_no_file(wallkit, pictures, tmp_path, words, said):
    refused(wallkit("calib", "intrinsics", pictures, *words, "-o", "out.toml", "-q"), *said)
    assert not (tmp_path / "out.toml").exists()


def draw(folder, name, image) -> None:
    folder.mkdir(exist_ok=True)
    cv2.imwrite(str(folder / name), image)


def test_pictures_that_cannot_be_used_are_told_and_leave_no_file(wallkit, pictures, tmp_path):
    whole = cv2.imread(str(pictures / "0.png"), cv2.IMREAD_GRAYSCALE)
    bare = np.full_like(whole, 120)
    for number, keep in enumerate((5, 6)):
        # pushed out of the image over its right edge, by another share each time
        pose = board_poses(np.random.default_rng(2), 1, spread=0.35)[0]
        edge = int(camera().project(pose[:3, :3] @ (keep * 0.03 - 0.015, 0.075, 0) + pose[:3, 3])[0])
        cut = np.roll(whole, 640 - edge, axis=1)
        cut[:, : 640 - edge] = 120
        draw(tmp_path / "cut", f"{number}.png", cut)
    for number in range(3):
        draw(tmp_path / "bare", f"{number}.png", bare)
    draw(tmp_path / "sizes", "0.png", whole)
    draw(tmp_path / "sizes", "1.png", whole[:240, :320])
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken" / "0.png").write_bytes(b"no picture")
    cases = {
        "cut": ("cut off",),
        "bare": ("was found in none of 3 pictures", "whole, sharp"),
        "sizes": ("two sizes", "640 x 480", "320 x 240"),
        "broken": ("0.png", "no picture"),
        "gone": ("gone: no such file",),
    }
    for folder, said in cases.items():
        refused(wallkit("calib", "intrinsics", folder, "--board", WORDS, "-o", "out.toml", "-q"), *said)
        assert not (tmp_path / "out.toml").exists(), folder


# -------------------------------------------------------------------------------------------------------------- board


@pytest.mark.parametrize("words", [WORDS, "charuco:5x7:0.036:0.027:5X5_100", "aprilgrid:4x3:0.04:0.01:APRILTAG_36H11"])
def test_a_board_is_printed_and_described(wallkit, tmp_path, words):
    done = wallkit("calib", "board", words, "-o", "board.svg")
    assert done.code == 0, done.err
    assert "print it without scaling" in done.err
    (tmp_path / "board.toml").write_text(done.out)
    assert board_from(str(tmp_path / "board.toml")) == board_from(words)
    assert (tmp_path / "board.svg").read_text().startswith("<svg")
    assert wallkit("calib", "board", "board.toml", "-o", "board.pdf").code == 0
    assert (tmp_path / "board.pdf").read_bytes().startswith(b"%PDF")
    said = wallkit("calib", "board", words, "--json").json
    assert said["board"] == words
    assert said["corners"] == len(board_from(words).object_points)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("chessbord:9x6:0.025",), "'chessbord:9x6:0.025' is no board, and no such file exists"),
        (("chessboard:9x6:25",), "metres"),
        (("chessboard:9x6:0.025", "-o", "board.png"), "sheets are .svg or .pdf"),
        (("chessboard:9x6:0.1", "--paper", "A4", "-o", "board.pdf"), "more than A4"),
        (("gone.toml",), "gone.toml"),
    ],
)
def test_boards_that_cannot_be(wallkit, tmp_path, words, said):
    refused(wallkit("calib", "board", *words), said)
    assert list(tmp_path.iterdir()) == []


# ------------------------------------------------------------------------------------------------------------ convert


def test_a_calibration_goes_round_all_formats(wallkit, tmp_path):
    # Kalibr's radtan has no k3
    (tmp_path / "info.yaml").write_text(CAMERA_INFO.replace("-0.01]", "0.0]"))
    steps = [
        ("info.yaml", "kalibr", "camchain.yaml"),
        ("camchain.yaml", "toml", "own.toml"),
        ("own.toml", "ros", "back.yaml"),
    ]
    for given, form, written in steps:
        done = wallkit("calib", "convert", given, "--to", form, "-o", written)
        assert done.code == 0, done.err
    before, after = read_calibration(tmp_path / "info.yaml").camera, read_calibration(tmp_path / "back.yaml").camera
    np.testing.assert_array_equal(after.K, before.K)
    np.testing.assert_array_equal(after.D[:4], before.D[:4])
    assert (after.name, after.model) == (before.name, before.model)
    (tmp_path / "k3.yaml").write_text(CAMERA_INFO)
    refused(wallkit("calib", "convert", "k3.yaml", "--to", "kalibr"), "radtan has no k3", "--model radtan")


def test_what_a_format_has_no_place_for_is_named(wallkit, corners, tmp_path):
    wallkit("calib", "intrinsics", corners, "--board", WORDS, "--model", "radtan", "-o", "own.toml", "-q")
    done = wallkit("calib", "convert", "own.toml", "--to", "ros")
    assert done.code == 3
    assert "covariance" in done.err
    assert "distortion_model: plumb_bob" in done.out
    quiet = wallkit("calib", "convert", "own.toml", "--to", "toml")
    assert quiet.code == 0
    assert quiet.out == (tmp_path / "own.toml").read_text()


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        ("distortion_model: plumb_bob\n", "", "distortion_model"),
        ("600.0", ".nan", "nan"),
        ("-0.25", ".inf", "inf"),
        ("plumb_bob", "plum_bob", "plumb_bob"),
        ("data: [-0.25, 0.08, 0.001, -0.0008, -0.01]", "data: [-0.25, 0.08]", "2"),
        ("image_width: 640", "image_width: wide", "image size of 'wide'"),
    ],
)
def test_a_camera_info_that_cannot_be_is_told(wallkit, tmp_path, before, after, said):
    (tmp_path / "info.yaml").write_text(CAMERA_INFO.replace(before, after))
    done = wallkit("calib", "convert", "info.yaml", "-o", "out.toml")
    refused(done, "info.yaml")
    assert said in done.err.lower()
    assert not (tmp_path / "out.toml").exists()
