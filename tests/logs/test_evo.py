"""evo, run as the program it is, reads the results and computes the error that was put in."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import zipfile
from pathlib import Path

import numpy as np
import pytest

from tests.logs.test_writer import POSES, STAMPS, write_results


@pytest.fixture(scope="module")
def evo_folder():
    """Folder of evo's programs: named by WALLKIT_EVO, else that on the PATH."""
    program = shutil.which("evo_ape", path=os.environ.get("WALLKIT_EVO")) or shutil.which("evo_ape")
    if program is None:
        pytest.skip("evo_ape is neither on the PATH nor in the folder WALLKIT_EVO")
    return Path(program).parent


def run(program, *arguments, folder):
    environment = {**os.environ, "HOME": str(folder), "MPLBACKEND": "Agg"}
    command = [program, *arguments]
    done = subprocess.run(
        command, capture_output=True, text=True, env=environment, cwd=folder, timeout=120, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_evo_finds_the_error_that_was_put_in(evo_folder, tmp_path):
    """The truth of the drawn result lies 0.1 m beside the estimate throughout."""
    path = write_results(tmp_path / "result.mcap")
    arguments = ["mcap", path, "/ground_truth/pose", "/wallkit/pose", "--save_results", tmp_path / "ape.zip"]
    run(evo_folder / "evo_ape", *arguments, folder=tmp_path)
    with zipfile.ZipFile(tmp_path / "ape.zip") as archive:
        statistics = json.loads(archive.read("stats.json"))
    assert statistics["rmse"] == pytest.approx(0.1, abs=1e-6)
    assert statistics["max"] == pytest.approx(0.1, abs=1e-6)


def test_evo_reads_odometry_and_saves_the_estimate_unchanged(evo_folder, tmp_path):
    path = write_results(tmp_path / "result.mcap")
    text = run(
        evo_folder / "evo_traj", "mcap", path, "/wallkit/odometry", "/wallkit/pose", "--save_as_tum", folder=tmp_path
    )
    assert f"{len(STAMPS)} poses" in text
    table = np.loadtxt(next(tmp_path.glob("*wallkit_pose.tum")))
    np.testing.assert_allclose(table[:, 0], STAMPS * 1e-9, atol=1e-6)
    np.testing.assert_allclose(table[:, 1:3], POSES[:, :2], atol=1e-9)
    np.testing.assert_allclose(2 * np.arctan2(table[:, 6], table[:, 7]), POSES[:, 2], atol=1e-9)
