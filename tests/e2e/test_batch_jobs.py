"""`wallkit batch` of the other jobs: simulate, map audit and calib verify end as the commands by themselves do."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from tests.e2e.board_log import BOARD, K, T, stations, write_log
from tests.maps.audit_worlds import FLOOR, with_wall
from wallkit.calib.files.store import toml_from_calibration
from wallkit.calib.verify.free import moved
from wallkit.core.calibration import Calibration
from wallkit.core.camera import Camera
from wallkit.maps.draft.write import write_draft

STORY = """
[route]
waypoints = [[3.4, 5.6], [6.2, 5.65], [8.8, 6.0], [8.6, 1.2], [6.2, 1.5]]
direct = true
speed_m_s = 0.8
[crowd]
walkers = 0
[lidar.scanner]
beams = 180
rate_hz = 4.0
range_max_m = 12.0
"""
SIMULATE = """
job = "simulate"
logs = ["story.toml"]
maps = ["true.wkmap.urdf"]
seeds = [4]
"""
AUDIT = """
job = "map audit"
logs = ["made.batch/runs/story/default/seed-4/log.mcap"]
maps = ["true.wkmap.urdf", "off.wkmap.urdf"]
truth = "log"
"""
VERIFY = """
job = "calib verify"
logs = ["board.mcap"]
calibrations = ["bumped.toml"]
board = "board.toml"
lidar_sigma = "8mm"
"""


def rows_of(out: Path) -> list[dict[str, str]]:
    return list(csv.DictReader((out / "batch.csv").read_text().splitlines()))


@pytest.mark.long
def test_simulated_logs_are_audited_against_two_maps(wallkit, tmp_path):
    (tmp_path / "true.wkmap.urdf").write_bytes(write_draft(FLOOR))
    (tmp_path / "off.wkmap.urdf").write_bytes(write_draft(with_wall("east", (10.04, 0), (10.04, 7))))
    (tmp_path / "story.toml").write_text(STORY)
    (tmp_path / "made.toml").write_text(SIMULATE)
    (tmp_path / "audit.toml").write_text(AUDIT)
    done = wallkit("batch", "made.toml", "-q", cwd=tmp_path)
    assert done.code == 0, done.out + done.err
    done = wallkit("batch", "audit.toml", "-q", "--json", cwd=tmp_path)
    assert done.code == 0, done.out + done.err
    off, true = rows_of(tmp_path / "audit.batch")
    assert (off["name"], off["verdict"], off["exit_code"]) == ("log@off/default/seed-0", "DIFFERS", "1")
    assert (true["name"], true["verdict"], true["exit_code"]) == ("log@true/default/seed-0", "AGREES", "0")
    assert float(true["metrics.explained"]) > float(off["metrics.explained"]) > 0.5
    assert done.json["measures"]["explained"]["unit"] == "share"
    document = json.loads((tmp_path / "audit.batch" / off["folder"] / "audit.json").read_text())
    assert {row["rule"] for row in document["findings"] if row["severity"] != "info"} == {"WK-A003"}
    (made,) = rows_of(tmp_path / "made.batch")
    assert 12 < float(made["metrics.path_m"]) < 14
    assert float(made["metrics.people"]) == 0


@pytest.mark.long
def test_a_bumped_calibration_fails(wallkit, tmp_path):
    camera = Camera("plumb_bob", 640, 480, K, np.zeros(5), frame="cam_optical")
    bumped = Calibration(camera, T_camera_lidar=moved(T, 2, np.radians(3.0)), lidar_frame="laser")
    (tmp_path / "bumped.toml").write_text(toml_from_calibration(bumped))
    (tmp_path / "board.toml").write_text(BOARD.toml())
    write_log(tmp_path / "board.mcap", stations(6))
    (tmp_path / "verify.toml").write_text(VERIFY)
    done = wallkit("batch", "verify.toml", "-q", cwd=tmp_path)
    assert done.code == 0, done.out + done.err
    (row,) = rows_of(tmp_path / "verify.batch")
    assert (row["verdict"], row["exit_code"]) == ("FAIL", "1")
    assert float(row["metrics.gate_agreement_with_a_fresh_solve_p"]) < 1e-6
    document = json.loads((tmp_path / "verify.batch" / row["folder"] / "verify.json").read_text())
    assert document["verdict"] == "FAIL"
