"""`wallkit map audit` on recorded logs: verdicts, exit codes, formats; poses from truth, a run and the map itself."""

from __future__ import annotations

import json

import pytest

from tests.maps.audit_worlds import FLOOR, ROUTE, with_wall
from tests.recorded import record
from wallkit.maps.draft.write import write_draft
from wallkit.maps.importers import ImportOptions, import_map


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A log of a drive through the rooms, the map of the rooms, and one with a wall 4 cm off."""
    folder = tmp_path_factory.mktemp("audit")
    (folder / "true.wkmap.urdf").write_bytes(write_draft(FLOOR))
    (folder / "off.wkmap.urdf").write_bytes(write_draft(with_wall("east", (10.04, 0), (10.04, 7))))
    record(folder / "true.wkmap.urdf", ROUTE, folder / "drive").rename(folder / "log.mcap")
    return folder


def test_a_map_that_agrees_ends_with_0(wallkit, folder):
    done = wallkit("map", "audit", folder / "true.wkmap.urdf", folder / "log.mcap", "--truth", "log", "-q")
    assert done.code == 0, done.out
    assert "verdict  the map agrees with the log" in done.out


@pytest.mark.parametrize("poses", [("--truth", "log"), ("--init", "truth")], ids=["truth", "localized"])
def test_a_wall_that_is_off_ends_with_1_and_its_offset(wallkit, folder, poses):
    done = wallkit("map", "audit", folder / "off.wkmap.urdf", folder / "log.mcap", *poses, "--json", "-q")
    assert done.code == 1, done.out
    ((rule, detail),) = [(row["rule"], row["detail"]) for row in done.json["findings"] if row["severity"] != "info"]
    assert (rule, detail["link"]) == ("WK-A003", "east")
    (shift,) = detail["shifts"]
    assert shift["offset_m"] == pytest.approx(0.04, abs=2 * shift["sd_m"])
    assert shift["sd_m"] < 0.013
    told = "true poses" if "--truth" in poses else "by localizing"
    assert told in done.json["audit"]["poses_from"]


def test_picture_sarif_and_run_folder(wallkit, tmp_path, folder):
    log, chart = folder / "log.mcap", folder / "off.wkmap.urdf"
    done = wallkit("localize", log, "--map", chart, "--init", "truth", "-o", "run", "-q")
    assert done.code == 0, done.err
    done = wallkit("map", "audit", chart, log, "--run", "run", "--format", "sarif", "-o", "audit.svg", "-q")
    assert done.code == 1, done.err
    results = json.loads(done.out)["runs"][0]["results"]
    assert "WK-A003" in {result["ruleId"] for result in results}
    assert b"audit:shift:east" in (tmp_path / "audit.svg").read_bytes()
    again = wallkit("map", "audit", chart, log, "--run", "run", "-o", "audit.svg", "-q")
    assert again.code == 2
    assert "--overwrite" in again.err


def test_a_log_that_is_too_short_cannot_tell(wallkit, folder, tmp_path):
    truth = "# few\n" + "".join(f"{1_700_000_000 + t} 1.5 2.6 0 0 0 0 1\n" for t in (1, 1.4))
    (tmp_path / "few.tum").write_text(truth)
    done = wallkit("map", "audit", folder / "true.wkmap.urdf", folder / "log.mcap", "--truth", "few.tum", "-q")
    assert done.code == 4, done.out
    assert "cannot tell" in done.out


def test_what_cannot_be_audited_is_one_error(wallkit, folder, tmp_path):
    (tmp_path / "floor.yaml").write_text("image: floor.pgm\n")
    done = wallkit("map", "audit", "floor.yaml", folder / "log.mcap")
    assert (done.code, done.out) == (2, "")
    assert "wallkit map import" in done.err
    both = wallkit("map", "audit", folder / "true.wkmap.urdf", folder / "log.mcap", "--truth", "log", "--run", "r")
    assert both.code == 2


@pytest.mark.data
@pytest.mark.slow
def test_a_real_map_explains_its_own_log(wallkit, tmp_path, data):
    """The raster was made from the same scans with a truth good to 5 cm, so most of it agrees; its scale does."""
    log, chart = data / "logs/carmen/intel.mcap", data / "logs/carmen/intel.map.yaml"
    (draft,) = import_map(chart, ImportOptions(scan_plane_m=0.3)).drafts
    (tmp_path / "intel.wkmap.urdf").write_bytes(write_draft(draft))
    done = wallkit(
        *("map", "audit", "intel.wkmap.urdf", log, "--truth", "log", "--set", "audit.truth_sd_m=0.05", "--json", "-q")
    )
    assert done.code == 1, done.err
    told = done.json["audit"]
    assert told["explained"] > 0.9
    assert told["drift"]["scale"] == pytest.approx(1.0, abs=0.005)
    assert "WK-A004" not in {row["rule"] for row in done.json["findings"]}
