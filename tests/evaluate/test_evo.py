"""The same numbers as evo on the same files, and result files that evo reads. evo is called as a program (GPL)."""

import io
import json
import os
import shutil
import subprocess
import zipfile

import numpy as np
import pytest

from wallkit.core.types import Trajectory
from wallkit.errors import OutputError, WallkitError
from wallkit.evaluate.associate import interpolate_truth, match_nearest
from wallkit.evaluate.evo import evo_zip, write_evo_zip
from wallkit.evaluate.metrics import SERIES
from wallkit.evaluate.tum import read_tum, write_tum

from .worlds import disturbed, loop, moved, paired

TOLERANCE_NS = 10_000_000  # evo's --t_max_diff

COMMANDS = {
    "ate": ["evo_ape"],
    "ate_aligned": ["evo_ape", "-a"],
    "heading": ["evo_ape", "-r", "angle_deg"],
    "rpe_1m": ["evo_rpe", "-d", "1", "-u", "m"],
    "rpe_1m_heading": ["evo_rpe", "-d", "1", "-u", "m", "-r", "angle_deg"],
    "rpe_update": ["evo_rpe", "-d", "1", "-u", "f"],
    "rpe_update_heading": ["evo_rpe", "-d", "1", "-u", "f", "-r", "angle_deg"],
}


@pytest.fixture(scope="session")
def evo(tmp_path_factory):
    """Runs one of evo's programs, found on PATH or in the folder WALLKIT_EVO."""
    search = os.pathsep.join(filter(None, [os.environ.get("WALLKIT_EVO"), os.environ.get("PATH")]))
    if shutil.which("evo_ape", path=search) is None:
        pytest.skip("evo_ape is neither on PATH nor in the folder WALLKIT_EVO")
    home = tmp_path_factory.mktemp("evo_home")

    def run(program, *words, cwd):
        command = [shutil.which(program, path=search), *words]
        environment = {**os.environ, "HOME": str(home)}  # evo keeps settings there; the user's are left alone
        subprocess.run(command, cwd=cwd, env=environment, check=True, capture_output=True, text=True)

    return run


def evo_result(evo, tmp_path, series):
    """Arrays and statistics of evo's own answer for truth.tum and estimate.tum."""
    program, *flags = COMMANDS[series]
    evo(program, "tum", "truth.tum", "estimate.tum", *flags, "--no_warnings", "--save_results", "evo.zip", cwd=tmp_path)
    return opened((tmp_path / "evo.zip").read_bytes())


def opened(data):
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        arrays = {n[:-4]: np.load(io.BytesIO(archive.read(n))) for n in archive.namelist() if n.endswith(".npy")}
        return arrays, json.loads(archive.read("stats.json")), json.loads(archive.read("info.json"))


def same_answer(evo, tmp_path, series, *associations):
    estimate, truth = read_tum(tmp_path / "estimate.tum"), read_tum(tmp_path / "truth.tum")
    evo_arrays, evo_statistics, evo_info = evo_result(evo, tmp_path, series)
    evo_arrays.pop("alignment_transformation_sim3", None)  # with -a; evo_res does not need it
    for associate in associations or (match_nearest,):
        pairs = associate(estimate, truth, tolerance_ns=TOLERANCE_NS)
        arrays, statistics, info = opened(evo_zip(pairs, series))
        assert info.keys() == evo_info.keys()
        assert info["label"] == evo_info["label"]
        assert statistics.keys() == evo_statistics.keys()
        for name, value in evo_statistics.items():
            assert statistics[name] == pytest.approx(value, abs=1e-6, rel=1e-6), name
        assert arrays.keys() == evo_arrays.keys()
        for name, array in evo_arrays.items():
            np.testing.assert_allclose(arrays[name], array, atol=1e-6, rtol=1e-9, err_msg=name)


@pytest.mark.parametrize("series", SERIES)
def test_same_numbers_as_evo(evo, tmp_path, series):
    write_tum(tmp_path / "truth.tum", loop())
    write_tum(tmp_path / "estimate.tum", moved(disturbed(loop()), (0.2, -0.1, 0.02)))
    same_answer(evo, tmp_path, series)


def test_same_pairs_as_evo_when_the_rates_differ(evo, tmp_path):
    truth = loop(updates=300, step_ns=23_000_000)
    estimate = disturbed(loop(updates=80, step_ns=87_000_000), sigma_m=0.2)
    for longer, shorter in ((truth, estimate), (estimate, truth)):
        write_tum(tmp_path / "truth.tum", longer)
        write_tum(tmp_path / "estimate.tum", shorter)
        same_answer(evo, tmp_path, "ate")


@pytest.mark.data
@pytest.mark.parametrize(
    ("name", "series"),
    [
        ("csail", "ate_aligned"),
        ("intel", "ate"),
        ("aces", "rpe_1m"),
        ("freiburg-101", "heading"),
        ("seattle", "rpe_1m_heading"),
    ],
)
def test_same_numbers_as_evo_on_real_truth(evo, tmp_path, data, name, series):
    shutil.copy(data / "logs" / "carmen" / f"{name}.gt.tum", tmp_path / "truth.tum")
    write_tum(tmp_path / "estimate.tum", disturbed(read_tum(tmp_path / "truth.tum"), sigma_m=0.08, sigma_deg=2))
    same_answer(evo, tmp_path, series, match_nearest, interpolate_truth)


def test_evo_res_reads_our_file(evo, tmp_path):
    pairs = paired(disturbed(loop()), loop())
    write_evo_zip(tmp_path / "ours.zip", pairs, "ate", estimate_name="wallkit")
    evo("evo_res", "ours.zip", "--save_table", "table.csv", cwd=tmp_path)
    header, row = (line.split(",") for line in (tmp_path / "table.csv").read_text().splitlines())
    table = dict(zip(header, row, strict=True))
    assert float(table["rmse"]) == pytest.approx(np.sqrt(np.mean(SERIES["ate"](pairs).errors ** 2)), abs=1e-12)


def test_the_same_pairs_give_the_same_bytes():
    pairs = paired(disturbed(loop()), loop())
    assert evo_zip(pairs, "rpe_1m") == evo_zip(pairs, "rpe_1m")


def test_what_cannot_be_exported_is_refused(tmp_path):
    still = Trajectory(np.arange(5), np.zeros((5, 3)))
    with pytest.raises(WallkitError, match="no error series is called 'ape'"):
        evo_zip(paired(loop(), loop()), "ape")
    with pytest.raises(WallkitError, match="hardly moved"):
        evo_zip(paired(still, still), "rpe_1m")
    with pytest.raises(OutputError, match="cannot write"):
        write_evo_zip(tmp_path / "no" / "x.zip", paired(loop(), loop()), "ate")
