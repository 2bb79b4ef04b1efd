"""`wallkit simulate log`: a log with truth that the rest of wallkit reads, the same again for the same seed."""

from __future__ import annotations

import json

import numpy as np
import pytest

from tests.maps.random_maps import clean_map
from wallkit.core.geometry import pose_from_matrix
from wallkit.core.types import Odometry, PointCloud, Scan, StampedPose
from wallkit.evaluate.tum import read_tum
from wallkit.logs.reader import open_log
from wallkit.maps.read import load_map
from wallkit.pipelines.simulate.world import world_from_map

STORY = """
title = "a short one"
duration_s = 6

[route]
random_stops = 4

[crowd]
walkers = 2
carts = 1

[lidar.scanner]
beams = 240

[lidar.timing]
latency_s = 0.02
drops = 0.1

[[missing]]
link = "LINK"

[[extra]]
name = "box"
size = [0.4, 0.4, 0.6]
at = [X, Y, 0]
"""


@pytest.fixture(scope="module")
def building(tmp_path_factory):
    """A map, and a scenario in it."""
    folder = tmp_path_factory.mktemp("building")
    path = folder / "floor.wkmap.urdf"
    path.write_bytes(clean_map(np.random.default_rng(6), turned=False))
    semantic_map = load_map(path)
    link = next(name for name, link in semantic_map.links.items() if link.class_name == "furniture")
    room = world_from_map(semantic_map).rooms[1]
    x, y = np.mean(room.floor, axis=0)
    text = STORY.replace("LINK", link).replace("X", f"{x:.3f}").replace("Y", f"{y:.3f}")
    (folder / "story.toml").write_text(text)
    return folder


def values(path, kind):
    return [m.value for m in open_log([path]).messages() if isinstance(m.value, kind)]


def test_a_log_is_whole_and_the_same_again(wallkit, building, tmp_path):
    words = (
        "simulate",
        "log",
        building / "floor.wkmap.urdf",
        "--scenario",
        building / "story.toml",
        "--seed",
        3,
        "--json",
    )
    first = wallkit(*words, "-o", tmp_path / "a")
    assert first.code == 0, first.err
    again = wallkit(*words, "-o", tmp_path / "b")
    assert again.code == 0, again.err
    for name in ("log.mcap", "truth.tum", "manifest.json"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes(), name
    assert first.json["duration_s"] == pytest.approx(6.0)
    assert first.json["people"] == 2
    manifest = json.loads((tmp_path / "a/manifest.json").read_text())
    assert manifest["scenario"]["crowd"]["carts"] == 1
    assert manifest["dropped"]["lidar"] + manifest["messages"]["/scan"] == 60
    other = wallkit(*words[:-3], "--seed", 4, "-o", tmp_path / "c")
    assert other.code == 0, other.err
    assert (tmp_path / "c/log.mcap").read_bytes() != (tmp_path / "a/log.mcap").read_bytes()
    info = wallkit("log", "info", tmp_path / "a/log.mcap")
    assert info.code == 0, info.err
    # refused twice over: the folder is not empty, and it is no file
    assert wallkit(*words, "-o", tmp_path / "a").code == 2


def test_what_is_in_it_fits_together(wallkit, building, tmp_path):
    done = wallkit(
        *("simulate", "log", building / "floor.wkmap.urdf", "--set", "duration_s=4", "--set", "crowd.walkers=0"),
        *("--set", "lidar.scanner.beams=180", "-o", tmp_path / "run"),
    )
    assert done.code == 0, done.err
    path = tmp_path / "run/log.mcap"
    truth, poses = read_tum(tmp_path / "run/truth.tum"), values(path, StampedPose)
    assert len(poses) == 200
    np.testing.assert_allclose(poses[0].pose, truth.poses[0], atol=1e-6)
    assert len(values(path, Odometry)) == 80
    scans, oracles = values(path, Scan), values(path, PointCloud)
    assert len(scans) == len(oracles) == 40
    for scan, oracle in zip(scans[::10], oracles[::10], strict=True):
        assert oracle.stamp_ns == scan.stamp_ns
        assert len(oracle.points_m) == np.isfinite(scan.ranges_m).sum()
    static = open_log([path]).static
    lidar = next(t for t in static.transforms if t.child == "laser")
    np.testing.assert_allclose(pose_from_matrix(lidar.matrix), [0.18, 0, 0], atol=1e-9)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--set", "crowd.walkes=2"), "did you mean 'walkers'"),
        (("--set", 'missing=[{link="nothing"}]'), "[[missing]] names 'nothing', which is not in the map"),
        (("--set", 'doors=[{joint="gate"}]'), "[[doors]] names 'gate', which is no door"),
        (("--set", "route.waypoints=[[1,1],[99,99]]"), "m from an obstacle"),
        (("--set", 'meshes=[{of="wall", file="my.obj"}]'), "[[meshes]] of 'wall' has file = 'my.obj': no such file"),
        (("--set", "lidar.frame=lazer"), "there is no frame 'lazer'"),
        (("--robot", "nothing.urdf"), "there is no such robot"),
        (("--seed", "-1"), "seed -1 is negative"),
    ],
)
def test_what_cannot_be_simulated_is_refused_in_one_message(wallkit, building, tmp_path, words, message):
    done = wallkit("simulate", "log", building / "floor.wkmap.urdf", *words, "-o", tmp_path / "out")
    assert done.code == 2
    assert message in done.err
    assert "Traceback" not in done.err
    assert not (tmp_path / "out").exists()
