"""Segmentations on disk say what they said before, bit by bit; whatever else lies there is not believed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.segment.drawn import colour_oracle, picture
from wallkit.core.folders import cache_folder
from wallkit.core.types import CameraImage
from wallkit.segment.cache import cache_of
from wallkit.segment.layouts import LAYOUTS
from wallkit.segment.onnx_segmenter import load_segmenter
from wallkit.segment.settings import SegmentSettings

THINGS = {"wall": (20, 40, 300, 220), "person": (100, 60, 160, 240), "door": (220, 80, 260, 240)}
SHAPE = (240, 320)


def image_of(rgb) -> CameraImage:
    return CameraImage(5, "camera", "png", bytes(cv2.imencode(".png", rgb[..., ::-1])[1]))


def noisy(seed=0):
    rng = np.random.default_rng(seed)
    return np.clip(picture(SHAPE, THINGS) + rng.integers(-60, 60, (*SHAPE, 3)), 0, 255).astype(np.uint8)


def assert_same(one, other):
    at = np.random.default_rng(0).uniform((-5, -5), (325, 245), (5000, 2))
    for ours, theirs in zip(one.classes_at(at), other.classes_at(at), strict=True):
        np.testing.assert_array_equal(ours, theirs)
    np.testing.assert_array_equal(one.labels(), other.labels())
    assert (one.names, one.roles, one.shape) == (other.names, other.roles, other.shape)
    for ours, theirs in zip(one.polygons(), other.polygons(), strict=True):
        assert (ours.label, ours.confidence) == (theirs.label, theirs.confidence)


def files_in(folder: Path):
    return sorted(path for path in folder.rglob("*") if path.is_file())


@pytest.mark.parametrize("layout", [*LAYOUTS, "default"])
def test_what_is_read_again_says_the_same(layout, tmp_path):
    is_own = layout == "default"
    segmenter = load_segmenter(Path("default")) if is_own else colour_oracle(tmp_path, layout=layout)
    rgb = noisy()
    made, image = segmenter.segment(rgb), image_of(rgb)
    cache = cache_of(segmenter, str(tmp_path / "cache"))
    assert cache.find(image) is None
    cache.keep(image, made, 12.5)
    found, cost_ms = cache_of(segmenter, str(tmp_path / "cache")).find(image)
    assert cost_ms == 12.5
    assert_same(found, made)
    if hasattr(made, "masks"):
        np.testing.assert_array_equal(found.masks(), made.masks())
    (file,) = files_in(tmp_path / "cache")
    assert file.suffix == ".seg"


def test_another_image_model_or_setting_is_not_found(tmp_path):
    segmenter = colour_oracle(tmp_path, layout="class-scores")
    cache, image = cache_of(segmenter, str(tmp_path / "cache")), image_of(noisy())
    cache.keep(image, segmenter.segment(noisy()), 1.0)
    assert cache.find(image_of(noisy(1))) is None
    assert cache.find(replace(image, encoding="jpeg")) is None
    assert cache.find(replace(image, stamp_ns=9, frame_id="other")) is not None
    others = (
        colour_oracle(tmp_path, layout="class-ids"),
        colour_oracle(tmp_path, layout="class-scores", settings=SegmentSettings(min_score=0.5)),
    )
    for other in others:
        assert cache_of(other, str(tmp_path / "cache")).find(image) is None
    # how fast it is run is nothing that a segmentation depends on
    again = colour_oracle(tmp_path, layout="class-scores", settings=SegmentSettings(rate_hz=2.0, threads=2))
    assert cache_of(again, str(tmp_path / "cache")).find(image) is not None


@pytest.mark.parametrize("damage", ["empty", "cut", "flipped", "foreign", "of another image", "folder"])
def test_files_that_are_not_right_are_counted_and_made_again(damage, tmp_path):
    segmenter = colour_oracle(tmp_path, layout="yolo-anchors")
    cache, image = cache_of(segmenter, str(tmp_path / "cache")), image_of(noisy())
    made = segmenter.segment(noisy())
    cache.keep(image, made, 1.0)
    (file,) = files_in(tmp_path / "cache")
    good = file.read_bytes()
    middle = len(good) // 2
    flipped = good[:middle] + bytes([good[middle] ^ 0x55]) + good[middle + 1 :]
    bad = {"empty": b"", "cut": good[:-9], "flipped": flipped, "foreign": b"PK\x03\x04 some other file"}
    if damage in bad:
        file.write_bytes(bad[damage])
    elif damage == "folder":
        file.unlink()
        file.mkdir()
    else:
        cache.keep(image_of(noisy(1)), made, 1.0)
        other = next(path for path in files_in(tmp_path / "cache") if path != file)
        file.write_bytes(other.read_bytes())
    assert cache.find(image) is None
    cache.keep(image, made, 1.0)
    if damage == "folder":
        assert (cache.unusable, cache.unwritten) == (0, 1)
        assert cache.lines() == ["1 segmentations that could not be written to segment.cache"]
    else:
        assert (cache.unusable, cache.unwritten) == (1, 0)
        assert_same(cache.find(image)[0], made)
        assert any("damaged or foreign" in line for line in cache.lines())
    assert not [path for path in files_in(tmp_path) if path.suffix == ".partial"]


def test_no_folder_no_cache_and_the_users_own(tmp_path, monkeypatch):
    segmenter = colour_oracle(tmp_path, layout="class-ids")
    assert cache_of(segmenter, "") is None
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    monkeypatch.setattr("sys.platform", "linux")
    assert cache_folder("segmentations") == tmp_path / "home" / "wallkit" / "segmentations"
    cache_of(segmenter, "user").keep(image_of(noisy()), segmenter.segment(noisy()), 1.0)
    assert len(files_in(tmp_path / "home")) == 1
