"""`wallkit simulate dataset`: pictures with labels that trainers read, the same again for the same seed."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from tests.simulate.conftest import gl
from wallkit.dataset.labels import classes_from_png
from wallkit.dataset.polygons import mask_from_polygons, polygons_from_yolo
from wallkit.dataset.rle import counts_from_text, mask_from_counts
from wallkit.errors import OutputError
from wallkit.maps.draft.write import write_draft
from wallkit.maps.rules import validate
from wallkit.pipelines.simulate.buildings import random_building

__all__ = ["gl"]
WORDS = ["--images", "6", "--per-scene", "3", "--size", "160x120", "--seed", "4", "--val", "0.5", "-q"]


@pytest.fixture(scope="module")
def made(gl, tmp_path_factory):
    """A small set, and what was said."""
    out = tmp_path_factory.mktemp("made") / "set"
    words = ["simulate", "dataset", *WORDS, "-o", str(out), "--json"]
    code = "from wallkit.cli.app import main; main()"
    done = subprocess.run([sys.executable, "-c", code, *words], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return out, json.loads(done.stdout)


def test_every_picture_has_its_labels_and_no_scene_is_on_both_sides(made):
    out, said = made
    assert (said["images"], said["scenes"], said["resumed"]) == (6, 2, 0)
    groups = {}
    for split in ("train", "val"):
        names = {path.stem for path in (out / "images" / split).iterdir()}
        assert names == {path.stem for path in (out / "labels" / split).iterdir()}
        assert names == {path.stem for path in (out / "masks" / split).iterdir()}
        groups[split] = {name.rpartition("_")[0] for name in names}
        assert len(names) == 3
    assert not groups["train"] & groups["val"]
    assert (out / "contact-sheet.png").stat().st_size > 5000
    assert not list(out.parent.glob(".*"))


def test_yolo_coco_and_png_tell_the_same(made):
    out, said = made
    names = [line.split(": ")[1] for line in (out / "data.yaml").read_text().splitlines() if line.startswith("  ")]
    assert names[:4] == ["wall", "partition", "door", "toilet"]
    total = np.zeros(len(names), dtype=int)
    for split in ("train", "val"):
        coco = json.loads((out / "annotations" / f"instances_{split}.json").read_text())
        assert [category["name"] for category in coco["categories"]] == names
        for image in coco["images"]:
            stem = image["file_name"].removesuffix(".jpg")
            classes = classes_from_png((out / "masks" / split / f"{stem}.png").read_bytes())
            lines = polygons_from_yolo((out / "labels" / split / f"{stem}.txt").read_text(), classes.shape)
            own = [a for a in coco["annotations"] if a["image_id"] == image["id"]]
            for number in range(len(names)):
                total[number] += (classes == number).sum()
                things = [a for a in own if a["category_id"] == number + 1]
                by_run = np.zeros(classes.shape, dtype=bool)
                for thing in things:
                    mask = mask_from_counts(counts_from_text(thing["segmentation"]["counts"]), classes.shape)
                    assert mask.sum() == thing["area"]
                    x, y, w, h = thing["bbox"]
                    assert mask[y : y + h, x : x + w].sum() == thing["area"]
                    assert not (by_run & mask).any()
                    by_run |= mask
                # what is missing was too small for an outline
                assert not (by_run & (classes != number)).any()
                by_line = mask_from_polygons([p for n, p in lines if n == number], classes.shape)
                assert (by_line & ~by_run).sum() <= 0.02 * by_run.sum() + 20
                assert (by_run & ~by_line).sum() <= 0.02 * by_run.sum() + 60
    counted = [sum(said["statistics"][s]["classes"][name]["pixels"] for s in ("train", "val")) for name in names]
    assert counted == total.tolist()
    assert total[names.index("wall")] > 0.1 * total.sum()


@pytest.mark.long
def test_the_same_seed_gives_the_same_labels_also_by_two_processes(made, tmp_path, wallkit):
    out, _ = made
    again = wallkit("simulate", "dataset", *WORDS, "-o", tmp_path / "again", "--jobs", "2")
    assert again.code == 0, again.err
    for path in [*out.rglob("labels/*/*.txt"), *out.rglob("masks/*/*.png")]:
        assert (tmp_path / "again" / path.relative_to(out)).read_bytes() == path.read_bytes(), path


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--images", "0"], "0 pictures"),
        (["--seed", "-1"], "seed -1 is negative"),
        (["--size", "big"], "'big' is no size"),
        (["--val", "1"], "validation share of 1"),
        (["--map", "nowhere.urdf"], "nowhere.urdf: cannot read the map"),
    ],
)
def test_what_cannot_be_made_is_refused_before_anything_is(words, said, tmp_path, wallkit):
    done = wallkit("simulate", "dataset", *words, "-o", tmp_path / "set")
    assert done.code == 2
    assert said in done.err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("seed", range(4))
def test_random_buildings_are_valid_maps(seed):
    report = validate(write_draft(random_building(np.random.default_rng(seed))), select=("X", "S", "G"))
    assert [str(f) for f in report.findings if f.severity == "error"] == []
    assert report.map is not None
    assert {"wall", "door"} <= {link.class_name for link in report.map.links.values()}


def test_an_interrupted_run_goes_on_where_it_stopped(made, tmp_path, wallkit, monkeypatch):
    """Its second scene was never made: the first one is taken as it is, and the whole is what it would have been.

    What it was to replace stays until the end.
    """
    from wallkit.pipelines.simulate import dataset as pipeline

    out, _ = made
    request = pipeline.DatasetRequest(6, 4, (), (160, 120), 3, 0.5)
    real = pipeline.make_scene

    def stopped(request, folder, number):
        if number == 1:
            raise KeyboardInterrupt
        return real(request, folder, number)

    (tmp_path / "set").mkdir()
    for name in ("run.json", "old.txt"):
        (tmp_path / "set" / name).write_text("{}")
    monkeypatch.setattr(pipeline, "make_scene", stopped)
    with pytest.raises(KeyboardInterrupt):
        pipeline.simulate_dataset(request, tmp_path / "set", overwrite=True)
    assert sorted(path.name for path in (tmp_path / "set").iterdir()) == ["old.txt", "run.json"]
    (tmp_path / "set").rename(tmp_path / "kept")
    with pytest.raises(OutputError, match="an interrupted set of other settings: images 6, now 8"):
        pipeline.simulate_dataset(replace(request, images=8), tmp_path / "set")
    (tmp_path / "kept").rename(tmp_path / "set")
    done = wallkit("simulate", "dataset", *WORDS, "-o", tmp_path / "set", "--overwrite", "--json")
    assert done.code == 0, done.err
    assert done.json["resumed"] == 1
    files = {path.relative_to(out) for path in out.rglob("*")}
    assert files == {path.relative_to(tmp_path / "set") for path in (tmp_path / "set").rglob("*")}
    for path in out.rglob("masks/*/*.png"):
        assert (tmp_path / "set" / path.relative_to(out)).read_bytes() == path.read_bytes()
    assert [path.name for path in tmp_path.iterdir()] == ["set"]
