"""The installed command judges a calibration: exit codes, words, files."""

from __future__ import annotations

import re

import numpy as np
import pytest

from tests.e2e.board_log import BOARD, TAU_S, K, T
from wallkit.calib.files.store import read_calibration, toml_from_calibration
from wallkit.calib.verify.free import moved
from wallkit.core.calibration import Calibration
from wallkit.core.camera import Camera

WORDS = ("--board", "board.toml", "--lidar-sigma", "8mm")


@pytest.fixture(scope="module")
def calibration():
    """The truth, from CAD so to speak: without a covariance, made from no file."""
    camera = Camera("plumb_bob", 640, 480, K, np.zeros(5), frame="cam_optical")
    return Calibration(camera, T_camera_lidar=T, lidar_frame="laser", time_offset_ns=round(TAU_S * 1e9))


@pytest.fixture
def folder(tmp_path, calibration):
    (tmp_path / "board.toml").write_text(BOARD.toml())
    (tmp_path / "cal.toml").write_text(toml_from_calibration(calibration))
    bumped = Calibration(calibration.camera, T_camera_lidar=moved(T, 2, np.radians(3.0)), lidar_frame="laser")
    (tmp_path / "bumped.toml").write_text(toml_from_calibration(bumped))
    return tmp_path


def test_a_good_calibration_is_not_contradicted_and_the_verdict_is_stored_on_request(wallkit, board_log, folder):
    done = wallkit(
        "calib", "verify", board_log, "--calib", "cal.toml", *WORDS, "-q", "--write", "--report", "page.html"
    )
    assert done.code == 4, done.out + done.err
    ending = done.out.strip().splitlines()[-5:]
    assert any(line.startswith("CANNOT TELL: nothing contradicts") for line in ending)
    assert re.search(r"  means    a wall point at 3 m may be \d\.\d px off in the picture", done.out)
    assert ending[-1].startswith("  next     hold the board")
    assert "made from other files" in done.out
    assert not re.search(r"^FAIL", done.out, re.MULTILINE)
    stored = read_calibration(folder / "cal.toml")
    assert stored.verdict == "CANNOT TELL"
    assert any(note.startswith("verify: CANNOT TELL") for note in stored.provenance.notes)
    page = (folder / "page.html").read_text()
    assert page.count("data:image/jpeg;base64,") == 6
    assert page.count("data:image/svg+xml;base64,") == 2
    assert "CANNOT TELL" in page
    assert not re.search(r"(src|href)=\"(?!data:)", page)
    assert "<script" not in page


def test_a_bumped_calibration_fails_and_is_refused_by_others(wallkit, board_log, folder):
    before = (folder / "bumped.toml").read_bytes()
    done = wallkit("calib", "verify", board_log, "--calib", "bumped.toml", *WORDS, "-o", "judged.toml", "--json", "-q")
    assert done.code == 1, done.err
    found = done.json
    assert found["verdict"] == "FAIL"
    assert (folder / "bumped.toml").read_bytes() == before
    failed = {gate["key"]: gate["reason"] for gate in found["gates"] if gate["verdict"] == "FAIL"}
    assert "yaw" in failed["boards"]
    assert {"plane", "reprojection"} & failed.keys()
    assert read_calibration(folder / "judged.toml").verdict == "FAIL"
    refused = wallkit("calib", "overlay", board_log, "--calib", "judged.toml", "-o", "pictures", "-q")
    assert refused.code == 2
    assert "judged.toml: the calibration's verdict is FAIL (" in refused.err
    assert "--allow-unverified" in refused.err
    assert not (folder / "pictures").exists()
    words = ("-o", "pictures", "--count", "3", "--allow-unverified", "-q")
    drawn = wallkit("calib", "overlay", board_log, "--calib", "judged.toml", *words)
    assert drawn.code == 0, drawn.err
    assert len(list((folder / "pictures").glob("*.png"))) == 3


@pytest.mark.slow
def test_the_clock_of_a_calibration_is_checked(wallkit, board_log, folder, calibration):
    from dataclasses import replace

    late = replace(calibration, time_offset_ns=calibration.time_offset_ns + 90_000_000)
    (folder / "late.toml").write_text(toml_from_calibration(late))
    done = wallkit("calib", "verify", board_log, "--calib", "late.toml", *WORDS, "--json", "-q")
    assert done.code == 1, done.err
    clock = next(gate for gate in done.json["gates"] if gate["key"] == "time-offset")
    assert clock["verdict"] == "FAIL"
    assert "clock is -90" in clock["reason"]


def test_without_a_board_it_says_what_it_cannot_see(wallkit, board_log, folder):
    done = wallkit("calib", "verify", board_log, "--calib", "cal.toml", "--json", "-q")
    assert done.code in (1, 4), done.err
    reasons = [gate["reason"] for gate in done.json["gates"] if gate["key"] == "observability"]
    assert "no board was shown" in reasons[0]
    assert any("seen: yaw, left" in gate["gate"] for gate in done.json["gates"])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--calib", "none.toml", *WORDS), "none.toml: cannot be read"),
        (("--calib", "cal.toml", *WORDS, "--urdf", "robot.urdf"), "robot.urdf: cannot be read"),
        (("--calib", "cal.toml", *WORDS, "--write", "-o", "x.toml"), "choose --write or --out"),
        (("--calib", "small.toml", *WORDS), "the intrinsics are for 320 x 240"),
    ],
)
def test_mistakes_have_one_clear_message(wallkit, board_log, folder, words, said):
    small = Calibration(
        Camera("plumb_bob", 320, 240, np.array([[260.0, 0, 160], [0, 260, 120], [0, 0, 1]]), np.zeros(5))
    )
    (folder / "small.toml").write_text(toml_from_calibration(small))
    done = wallkit("calib", "verify", board_log, *words, "-q")
    assert done.code == 2, done.out + done.err
    assert said in done.err
    assert "Traceback" not in done.err


def test_dry_run_and_help_do_nothing(wallkit, board_log, folder):
    done = wallkit("calib", "verify", board_log, "--calib", "cal.toml", *WORDS, "--write", "--dry-run")
    assert done.code == 0
    assert "would judge cal.toml" in done.out
    assert read_calibration(folder / "cal.toml").verdict == ""
