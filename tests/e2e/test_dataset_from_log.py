"""`wallkit dataset from-log`: recordings as a dataset, with what a person dropped left out, and everything counted."""

from __future__ import annotations

import csv
import json
import subprocess
import sys

import numpy as np
import pytest

from tests.maps.random_maps import clean_map
from tests.simulate.conftest import gl
from wallkit.dataset.labels import classes_from_png
from wallkit.dataset.read import pairs_of, read_training_sets
from wallkit.evaluate.tum import read_tum

__all__ = ["gl"]
STORY = """
duration_s = 3
[route]
random_stops = 3
[crowd]
walkers = 1
[lidar.scanner]
beams = 60
[[cameras]]
name = "front"
width = 96
height = 72
rate_hz = 3
masks = "raster"
"""


@pytest.fixture(scope="module")
def logs(gl, tmp_path_factory):
    """Two short logs with pictures and oracle labels."""
    folder = tmp_path_factory.mktemp("logs")
    (folder / "m.wkmap.urdf").write_bytes(clean_map(np.random.default_rng(6), turned=False))
    (folder / "story.toml").write_text(STORY)
    for seed in ("1", "2"):
        words = [
            "simulate",
            "log",
            "m.wkmap.urdf",
            "--scenario",
            "story.toml",
            "--seed",
            seed,
            "-o",
            f"run{seed}",
            "-q",
        ]
        code = "from wallkit.cli.app import main; main()"
        done = subprocess.run(
            [sys.executable, "-c", code, *words], cwd=folder, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
    return folder


@pytest.mark.long
def test_logs_become_a_dataset_after_a_review(logs, tmp_path, wallkit):
    paths = [logs / "run1/log.mcap", logs / "run2/log.mcap"]
    looked = wallkit("dataset", "from-log", *paths, "--review", "-o", tmp_path / "look", "--json", "-q")
    assert looked.code == 0, looked.err
    rows = list(csv.DictReader((tmp_path / "look/drops.csv").read_text().splitlines()))
    assert looked.json["seen"] == 18
    assert sum(looked.json["proposed"].values()) == len(rows)
    assert {path.name for path in (tmp_path / "look").iterdir()} == {"drops.csv", "review.png", "run.json"}

    # what a person does: keep what was proposed, drop another
    before = wallkit("dataset", "from-log", *paths, "--val", "0.5", "-o", tmp_path / "all", "--json", "-q")
    assert before.json["written"] == 18
    names = sorted(path.stem for path in (tmp_path / "all").glob("images/*/*.jpg"))
    lines = ["name,drop,reason,number", *(f"{row['name']},no,," for row in rows), f"{names[5]},yes,a thumb,"]
    (tmp_path / "mine.csv").write_text("\n".join(lines) + "\n")
    words = ["--drops", tmp_path / "mine.csv", "--val", "0.5", "--augment", "2", "-o", tmp_path / "set", "--json", "-q"]
    done = wallkit("dataset", "from-log", *paths, *words)
    assert done.code == 0, done.err
    said = done.json
    assert (said["written"], said["labelled"], said["dropped"]) == (17, 17, {"a thumb": 1})
    out = tmp_path / "set"
    kept = {path.stem for path in out.glob("images/*/*.jpg")}
    assert kept == set(names) - {names[5]}
    assert {path.stem for path in (out / "scans").iterdir()} == kept
    assert sorted(said["splits"].values()) == ["train", "val"]
    for split in ("train", "val"):
        groups = {path.stem.partition("_")[0] for path in (out / "images" / split).iterdir()}
        assert groups == {name for name, where in said["splits"].items() if where == split}
    train = len(list((out / "images/train").iterdir()))
    assert said["augmented"] == len(list((out / "augmented/images/train").iterdir())) == 2 * train
    plain, other = read_training_sets((out, out / "augmented"))
    assert other.of("val") == plain.of("val")
    assert len(pairs_of((plain, other), "all")) == 17 + 2 * train


@pytest.mark.long
def test_poses_scans_and_labels_are_those_of_the_log(logs, tmp_path, wallkit):
    done = wallkit("dataset", "from-log", logs / "run1/log.mcap", "-o", tmp_path / "set", "--json")
    assert done.code == 0, done.err
    assert "nothing to validate on" in done.err or done.json["splits"] == {"run1": "train"}
    manifest = json.loads((tmp_path / "set/manifest.json").read_text())
    truth = read_tum(logs / "run1/truth.tum")
    for picture in manifest["pictures"]:
        at = int(np.argmin(np.abs(truth.stamps_ns - picture["stamp_ns"])))
        assert np.hypot(*(np.array(picture["pose"][:2]) - truth.poses[at, :2])) < 0.05
        assert abs(picture["scan_late_s"]) <= 0.051
        with np.load(tmp_path / "set/scans" / f"{picture['name']}.npz") as scan:
            assert len(scan["ranges_m"]) == len(scan["angles_rad"]) == 60
            late = (int(scan["stamp_ns"]) - picture["stamp_ns"]) * 1e-9
        assert late == pytest.approx(picture["scan_late_s"], abs=1e-6)
        mask = classes_from_png((tmp_path / "set/masks/train" / f"{picture['name']}.png").read_bytes())
        assert mask.shape == (72, 96)
        assert (mask == 0).mean() > 0.02
    cameras = json.loads((tmp_path / "set/cameras.json").read_text())
    assert cameras["run1"]["/camera/front/camera_info"]["width"] == 96


@pytest.mark.long
def test_a_log_without_masks_has_no_labels(logs, tmp_path, wallkit):
    story = (logs / "story.toml").read_text().replace('masks = "raster"', 'masks = "none"')
    (tmp_path / "plain.toml").write_text(story)
    words = ["simulate", "log", logs / "m.wkmap.urdf", "--scenario", "plain.toml", "-o", "run3", "-q"]
    assert wallkit(*words).code == 0
    done = wallkit("dataset", "from-log", "run3/log.mcap", "--val", "0", "-o", "set", "--json", "-q")
    assert (done.code, done.json["written"], done.json["labelled"]) == (0, 9, 0), done.err
    assert not {"labels", "masks", "annotations", "data.yaml"} & {path.name for path in (tmp_path / "set").iterdir()}
    both = wallkit("dataset", "from-log", "run3/log.mcap", logs / "run1/log.mcap", "-o", "both")
    assert "9 pictures have no labels" in both.err


@pytest.mark.long
@pytest.mark.parametrize(
    ("drops", "said"),
    [
        ("name,drop,reason,number\nrun1_front_7,yes,,\n", "drops.csv:2: names 'run1_front_7'"),
        ("a,b\n", "drops.csv: is no drop list"),
    ],
)
def test_a_drop_list_that_does_not_fit_is_refused(logs, tmp_path, wallkit, drops, said):
    (tmp_path / "drops.csv").write_text(drops)
    done = wallkit("dataset", "from-log", logs / "run1/log.mcap", "--drops", "drops.csv", "-o", tmp_path / "set")
    assert (done.code, said in done.err) == (2, True), done.err
    assert {path.name for path in tmp_path.iterdir()} == {"drops.csv"}


def test_a_log_without_images_is_refused(tmp_path, wallkit):
    (tmp_path / "m.wkmap.urdf").write_bytes(clean_map(np.random.default_rng(6), turned=False))
    words = ["--set", "duration_s=1", "--set", "crowd.walkers=0", "--set", "lidar.scanner.beams=20"]
    assert wallkit("simulate", "log", "m.wkmap.urdf", *words, "-o", "run").code == 0
    done = wallkit("dataset", "from-log", "run/log.mcap", "-o", "set")
    assert (done.code, "holds no images" in done.err) == (2, True), done.err
    assert not (tmp_path / "set").exists()


def test_a_classes_file_with_an_impossible_name_is_refused(tmp_path, wallkit):
    (tmp_path / "c.toml").write_text('names = ["wall", "other"]\n[of]\ndoor = "dor"\n')
    done = wallkit("simulate", "dataset", "--classes", "c.toml", "-o", "set")
    assert (done.code, "'dor', which is no name" in done.err) == (2, True), done.err
