"""`wallkit localize --ceiling`: alone, fused with a LiDAR, and refused with a reason."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from tests.e2e.ceiling_log import corridor_ceiling, write_ceiling, write_log


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    at = tmp_path_factory.mktemp("ceiling")
    write_log(at)
    return at


def metrics(folder):
    return json.loads((folder / "metrics.json").read_text())


def test_by_the_ceiling_alone_without_knowing_where_it_starts(wallkit, folder, tmp_path):
    words = ("localize", folder / "log.mcap", "--ceiling", folder / "ceiling.yaml", "--init", "everywhere", "-q")
    done = wallkit(*words, "-o", "alone")
    assert done.code == 0, done.err
    found = metrics(tmp_path / "alone")
    assert done.code == 0, done.out
    assert (found["health"], found["filter"], found["false_healthy"]) == ("LOCALIZED", "ceiling", 0)
    rows = [float(v) for v in (tmp_path / "alone" / "estimate.tum").read_text().splitlines()[-1].split()[1:3]]
    assert np.hypot(rows[0] - found["pose"]["x_m"], rows[1] - found["pose"]["y_m"]) < 1e-6
    assert found["ate_median_m"] < 0.05
    assert "faded, is the ceiling" in (tmp_path / "alone" / "report.html").read_text()


def test_a_corridor_that_looks_the_same_from_both_ends_is_resolved_by_its_ceiling(wallkit, folder, tmp_path):
    log = (folder / "log.mcap", "--map", folder / "map.yaml", "--init", "global", "-q")
    lidar = wallkit("localize", *log, "-o", "lidar")
    assert lidar.code == 4
    assert metrics(tmp_path / "lidar")["health"] != "LOCALIZED"
    assert len(metrics(tmp_path / "lidar")["modes"]) >= 2
    both = wallkit("localize", *log, "--ceiling", folder / "ceiling.yaml", "-o", "both")
    found = metrics(tmp_path / "both")
    assert both.code == 0, both.out
    assert (found["health"], found["false_healthy"]) == ("LOCALIZED", 0)
    assert found["ate_median_m"] < 0.05


def test_a_log_without_lidar_is_enough(wallkit, tmp_path):
    write_log(tmp_path, with_lidar=False)
    done = wallkit("localize", "log.mcap", "--ceiling", "ceiling.yaml", "--dry-run")
    assert done.code == 0
    assert "seen by /camera/up/image/compressed, alone" in done.out


def refused(wallkit, *words) -> str:
    done = wallkit("localize", *words, "-o", "never")
    assert (done.code, done.out) == (2, "")
    assert "Traceback" not in done.err
    return done.err


def test_bad_input_is_named_with_what_to_do(wallkit, folder, tmp_path):
    log, plan, good = folder / "log.mcap", folder / "map.yaml", corridor_ceiling()
    (tmp_path / "bare.yaml").write_text(f"image: {folder / 'ceiling.png'}\n")
    assert "wallkit ceiling fit" in refused(wallkit, log, "--ceiling", "bare.yaml")
    assert "wallkit ceiling fit" in refused(wallkit, log, "--ceiling", folder / "ceiling.png")
    grey = replace(good, pixels=np.repeat(good.pixels[..., :1], 3, axis=2))
    said = refused(wallkit, log, "--ceiling", write_ceiling(tmp_path, grey, "grey"), "--map", plan)
    assert "grey" in said
    assert "gradient" in said
    far = replace(good, origin=np.array([100.0, 0, 0]))
    said = refused(wallkit, log, "--ceiling", write_ceiling(tmp_path, far, "far"), "--map", plan)
    assert "do not overlap" in said
    assert "x 99" not in said
    no_height = replace(good, height_m=np.nan)
    said = refused(wallkit, log, "--ceiling", write_ceiling(tmp_path, no_height, "flat"))
    assert "height: 2.7" in said
    said = refused(wallkit, log, "--ceiling", folder / "ceiling.yaml", "--set", "localize.tracker=ekf", "--map", plan)
    assert "Kalman" in said
    assert "no ceiling was given" in refused(wallkit, log, "--map", plan, "--set", "localize.tracker=ceiling")


def test_grey_images_are_refused_by_a_model_of_colours(wallkit, tmp_path):
    write_log(tmp_path, with_lidar=False, grey=True)
    assert "images on /camera/up/image/compressed are grey" in refused(wallkit, "log.mcap", "--ceiling", "ceiling.yaml")
