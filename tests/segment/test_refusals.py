"""Models that cannot be used are refused with the reason, never read as something else."""

from __future__ import annotations

import numpy as np
import pytest

from tests.segment.drawn import colour_oracle, constant_model, picture
from wallkit.errors import ModelError
from wallkit.segment.onnx_segmenter import check_has_role, load_segmenter
from wallkit.segment.settings import SegmentSettings

F = np.float32
NAMES = {"names": "{0: 'wall', 1: 'door'}"}

REFUSED = {
    "detection only": (
        {"output0": np.zeros((1, 6, 84), F)},
        NAMES,
        r"finds boxes, but makes no masks: there are no proto",
    ),
    "task detect": ({"output0": np.zeros((1, 6, 84), F)}, {**NAMES, "task": "detect"}, r"task 'detect'"),
    "pose": ({"output0": np.zeros((1, 56, 84), F)}, {**NAMES, "task": "pose"}, r"key points"),
    "classifier": ({"output0": np.zeros((1, 1000), F)}, {}, r"names whole pictures"),
    "yolov5": (
        {"output0": np.zeros((1, 84, 39), F), "output1": np.zeros((1, 32, 16, 16), F)},
        NAMES,
        r"as YOLOv5's does",
    ),
    "swapped": (
        {"output0": np.zeros((1, 20, 39), F), "output1": np.zeros((1, 32, 16, 16), F)},
        {"names": "{0: 'a', 1: 'b', 2: 'c'}"},
        r"anchors and numbers swapped",
    ),
    "no room for the coefficients": (
        {"output0": np.zeros((1, 20, 7), F), "output1": np.zeros((1, 32, 16, 16), F)},
        NAMES,
        r"no room for 32 coefficients",
    ),
    "classes last": ({"scores": np.zeros((1, 16, 24, 2), F)}, NAMES, r"classes last"),
    "one class": ({"scores": np.zeros((1, 1, 16, 16), F)}, NAMES, r"one score for each pixel"),
    "too many names": (
        {"output0": np.zeros((1, 40, 84), F), "output1": np.zeros((1, 32, 16, 16), F)},
        NAMES,
        r"names 2 classes, but its outputs have room for 4",
    ),
    "strange": ({"x": np.zeros((2, 3, 4, 5, 6), F)}, {}, r"keep no layout that is known"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_outputs_that_are_no_segmentation(tmp_path, case):
    outputs, metadata, words = REFUSED[case]
    path = constant_model(tmp_path / "m.onnx", outputs, metadata=metadata)
    with pytest.raises(ModelError, match=words) as caught:
        load_segmenter(path)
    assert caught.value.where == str(path)
    assert caught.value.hint


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (([1, 64, 64, 3], 1), "colours last"),
        (([1, 1, 64, 64], 1), "1 channels, not 3"),
        (([1, 3, 64, 64], 2), "uint8, not float"),
        (([1, 3, 64], 1), "no picture"),
        (([4, 3, 64, 64], 1), r"input \[4, 3, 64, 64\] wants 4 pictures at once"),
    ],
)
def test_inputs_that_are_no_picture(tmp_path, given, words):
    path = constant_model(tmp_path / "m.onnx", {"scores": np.zeros((1, 2, 8, 8), F)}, metadata=NAMES, given=given)
    with pytest.raises(ModelError, match=words):
        load_segmenter(path)


def test_a_model_of_several_pictures_at_once_is_to_be_exported_again_and_an_open_number_is_one(tmp_path):
    outputs = {"s": np.zeros((1, 2, 8, 8), F)}
    with pytest.raises(ModelError) as caught:
        load_segmenter(constant_model(tmp_path / "m.onnx", outputs, metadata=NAMES, given=([4, 3, 64, 64], 1)))
    assert caught.value.hint == "export it with batch 1"
    for batch in (1, "batch", -1):
        path = constant_model(tmp_path / "m.onnx", outputs, metadata=NAMES, given=([batch, 3, 64, 64], 1))
        assert load_segmenter(path).segment(picture((64, 64), {})).shape == (64, 64)


def test_a_file_that_is_not_there_a_checkpoint_and_damaged_ones(tmp_path):
    with pytest.raises(ModelError, match="no such file"):
        load_segmenter(tmp_path / "none.onnx")
    whole = colour_oracle(tmp_path).model.path.read_bytes()
    for name, data, words in (
        ("best.pt", whole, "checkpoint"),
        ("empty.onnx", b"", "cannot load it"),
        ("text.onnx", b"<html>not found</html>", "cannot load it"),
        ("half.onnx", whole[: len(whole) // 2], "cannot load it"),
    ):
        (tmp_path / name).write_bytes(data)
        with pytest.raises(ModelError, match=words) as caught:
            load_segmenter(tmp_path / name)
        assert "Traceback" not in str(caught.value)


def test_no_damage_to_any_part_of_the_file_ends_in_another_error(tmp_path):
    """Every byte in turn (of each thirteen) set wrong: refused, or it runs."""
    whole = colour_oracle(tmp_path, (64, 64)).model.path.read_bytes()
    rgb, path, refused = picture((64, 64), {"wall": (0, 0, 40, 64)}), tmp_path / "damaged.onnx", 0
    rng = np.random.default_rng(0)
    for at in range(0, len(whole), 13):
        damaged = bytearray(whole)
        damaged[at] ^= int(rng.integers(1, 256))
        path.write_bytes(damaged)
        try:
            load_segmenter(path).segment(rgb)
        except ModelError:
            refused += 1
    assert refused > 10


@pytest.mark.parametrize(
    ("names", "words"),
    [
        ("wall, door", "the metadata's names are"),
        ("{0: 5}", "the metadata's names are"),
        ("{'a': 'b'}", "names are"),
        ("", "names are"),
    ],
)
def test_names_that_are_none(tmp_path, names, words):
    path = constant_model(tmp_path / "m.onnx", {"s": np.zeros((1, 2, 8, 8), F)}, metadata={"names": names})
    with pytest.raises(ModelError, match=words):
        load_segmenter(path)


def test_names_come_from_the_settings_where_the_metadata_has_none(tmp_path):
    path = constant_model(tmp_path / "m.onnx", {"s": np.zeros((1, 2, 8, 8), F)})
    assert load_segmenter(path).names == ("0", "1")
    assert load_segmenter(path, SegmentSettings(names=("wall", "floor"))).roles == ("wall", "floor")
    with pytest.raises(ModelError, match="3 names for 2 classes"):
        load_segmenter(path, SegmentSettings(names=("a", "b", "c")))


def test_an_open_size_needs_metadata(tmp_path):
    outputs = {"s": np.zeros((1, 2, 8, 8), F)}
    open_size = (["batch", 3, "height", "width"], 1)
    path = constant_model(tmp_path / "m.onnx", outputs, metadata=NAMES, given=open_size)
    with pytest.raises(ModelError, match="how large its input is"):
        load_segmenter(path)
    assert load_segmenter(path, size=(100, 320)).size == (128, 320)
    path = constant_model(tmp_path / "m.onnx", outputs, metadata={**NAMES, "imgsz": "[192, 320]"}, given=open_size)
    assert load_segmenter(path).size == (192, 320)
    fixed = constant_model(tmp_path / "f.onnx", outputs, metadata=NAMES)
    with pytest.raises(ModelError, match="64 x 64, not 32 x 32"):
        load_segmenter(fixed, size=(32, 32))


def test_nan_and_a_wrong_number_of_pictures_are_said(tmp_path):
    rgb = picture((64, 64), {})
    path = constant_model(tmp_path / "m.onnx", {"s": np.full((1, 2, 8, 8), np.nan, F)}, metadata=NAMES)
    with pytest.raises(ModelError, match="answers with NaN"):
        load_segmenter(path).segment(rgb)
    path = constant_model(tmp_path / "m.onnx", {"s": np.zeros((2, 2, 8, 8), F)}, metadata=NAMES)
    with pytest.raises(ModelError, match="one picture was given"):
        load_segmenter(path).segment(rgb)


def test_a_model_without_a_wall_is_told(tmp_path):
    path = constant_model(tmp_path / "m.onnx", {"s": np.zeros((1, 2, 8, 8), F)}, metadata={"names": "['cat', 'dog']"})
    segmenter = load_segmenter(path)
    with pytest.raises(ModelError, match=r"no class counts as 'wall' \(classes: cat, dog\)"):
        check_has_role(segmenter, "wall")
    check_has_role(segmenter, "movable")
