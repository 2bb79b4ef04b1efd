"""The sample robot's calibration in calib/: made by the Makefile's commands, verified, near the URDF it was drawn from."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from wallkit.calib.extrinsics.agreement import chance_of, stated
from wallkit.calib.extrinsics.solver import difference
from wallkit.calib.files.from_urdf import transform_from_urdf
from wallkit.calib.files.store import read_calibration
from wallkit.calib.verify.evidence import lidar_axes

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "calib"


def words_of(command):
    """The words of a command, in no order, without where its result goes."""
    return sorted(re.sub(r"\s-o \S+", "", command).split())


def test_the_files_remember_the_commands_of_the_makefile():
    lines = (ROOT / "Makefile").read_text().replace("\\\n", " ")
    typed = [words_of(m) for m in re.findall(r"&& (wallkit calib .+?)(?: \|\| .*)?\n", lines)]
    for name in ("front.toml", "laser-to-front.toml"):
        made = read_calibration(FOLDER / name).provenance
        assert words_of(made.command) in typed
        assert len(made.inputs) >= 60


def test_the_answer_is_where_the_urdf_has_it():
    found = read_calibration(FOLDER / "laser-to-front.toml")
    assert found.verdict == "PASS"
    assert (found.lidar_frame, found.camera_frame) == ("laser", "front_camera_optical")
    truth = transform_from_urdf(FOLDER / "robot.urdf", found.lidar_frame, found.camera_frame).T
    d = difference(found.T_camera_lidar, truth)
    assert np.abs(d[3:]).max() < 0.005
    known = stated(lidar_axes(found.T_camera_lidar, found.covariance), found.degrees)
    assert chance_of(d, [known]) > 0.01
