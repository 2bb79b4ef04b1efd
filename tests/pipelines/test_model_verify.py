"""Comparing models that differ in one known way, and against a stand-in for another interpreter."""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import pytest

import wallkit as package
from tests.segment.altered import WANTS, altered_oracle
from tests.segment.drawn import picture
from wallkit.errors import ModelError
from wallkit.pipelines.model.pictures import PictureSource, pictures_of
from wallkit.pipelines.model.verify import VerifyRequest, verify_models
from wallkit.segment.fixture import USUAL, oracle
from wallkit.segment.other_ways import PREPARATIONS
from wallkit.segment.settings import SegmentSettings


@pytest.fixture
def pictures(tmp_path) -> Path:
    folder = tmp_path / "pictures"
    folder.mkdir()
    for k in range(3):
        things = {"wall": (20 + 30 * k, 40, 300, 220), "person": (100, 60, 150, 240), "sink": (200, 100, 280, 200)}
        cv2.imwrite(str(folder / f"{k}.png"), picture((240, 320), things)[..., ::-1])
    return folder


@pytest.fixture
def a(tmp_path) -> Path:
    path = tmp_path / "a.onnx"
    path.write_bytes(oracle(USUAL, (320, 320)))
    return path


def verified(a: Path, b: Path, folder: Path, python: Path | None = None):
    return verify_models(VerifyRequest(a, b, python), pictures_of(PictureSource((folder,))), SegmentSettings())


def test_a_model_agrees_with_the_same_in_another_layout(tmp_path, a, pictures):
    (tmp_path / "b.onnx").write_bytes(oracle(USUAL, (320, 320), "yolo-rows"))
    found = verified(a, tmp_path / "b.onnx", pictures)
    total = found.agreement
    assert (total.of_a, total.matched, min(total.ious), found.causes) == (9, 9, 1.0, ())
    assert not total.moved
    assert (total.points, found.has_lidar) == (3 * 720, False)


@pytest.mark.parametrize("way", ["bgr", *WANTS])
def test_the_preparation_that_a_model_wants_is_named(tmp_path, a, pictures, way):
    b = altered_oracle(tmp_path / "b.onnx", way)
    assert verified(a, b, pictures).causes == (f"B (b.onnx) {PREPARATIONS[way].says}",)
    assert verified(b, a, pictures).causes == (f"A (b.onnx) {PREPARATIONS[way].says}",)


def test_inputs_of_another_size_are_named(tmp_path, a, pictures):
    (tmp_path / "b.onnx").write_bytes(oracle(USUAL, (64, 64)))
    found = verified(a, tmp_path / "b.onnx", pictures)
    assert found.agreement.matched < found.agreement.of_a
    assert "the inputs differ: A 320 x 320, B 64 x 64 px" in found.causes


def test_classes_of_one_side_are_named(tmp_path, a, pictures):
    (tmp_path / "b.onnx").write_bytes(oracle({"wall": USUAL["wall"], "robot": (0, 0, 250)}, (320, 320)))
    assert verified(a, tmp_path / "b.onnx", pictures).names == ("door", "person", "robot", "sink", "toilet", "urinal")


# ------------------------------------------------------------------------------------------ another interpreter

# answers a request as Ultralytics would, by wallkit's own decoder on an ONNX file and with one known fault
STAND_IN = """#!{python}
import json, sys
sys.path.insert(0, {root!r})
import cv2, numpy as np
from dataclasses import replace
from pathlib import Path
from wallkit.segment.letterbox import letterbox
from wallkit.segment.onnx_segmenter import load_segmenter
from wallkit.segment import other_ways
request = json.load(open(sys.argv[2]))
assert request["action"] == "predict" and "child_script" in sys.argv[1]
segmenter = load_segmenter(Path({model!r}))
fault = {fault!r}
if fault == "bgr":
    segmenter = other_ways.run_another_way(segmenter, "bgr")
found = {{}}
for k, path in enumerate(request["images"]):
    rgb = cv2.imread(path)[..., ::-1]
    it = segmenter.segment(rgb)
    boxes, masks = it.frame.boxes_in_image(it.detections.boxes), it.masks(of_net=True)
    if fault == "gain":
        boxes = np.array([t.box for t in other_ways.with_one_gain(it).things]).reshape(-1, 4)
    if fault == "crop":
        masks = other_ways._masks_cropped_first(it)
    found.update({{f"boxes{{k}}": boxes, f"scores{{k}}": it.detections.scores, f"classes{{k}}": it.detections.labels}})
    found[f"masks{{k}}"] = masks
np.savez(request["found"], **found)
names = {{str(i): n for i, n in enumerate(segmenter.names[:-1])}}
json.dump({{"names": names, "task": "segment", "versions": {{}}}}, open(request["answer"], "w"))
"""


def stand_in(path: Path, model: Path, fault: str) -> Path:
    root = str(Path(package.__file__).parents[1])
    path.write_text(STAND_IN.format(python=sys.executable, root=root, model=str(model), fault=fault))
    path.chmod(0o755)
    return path


@pytest.mark.long
@pytest.mark.parametrize(
    ("fault", "cause"),
    [
        ("", None),
        ("bgr", "the checkpoint takes blue, green, red (BGR)"),
        ("crop", "crops masks to their boxes before it enlarges them"),
        ("gain", "undoes the letterbox with one gain for both axes"),
    ],
)
def test_what_the_other_program_does_differently_is_named(tmp_path, data, fault, cause):
    model = data / "yolo/weights/yolov8n-seg_coco-dq_320.onnx"
    (tmp_path / "best.pt").write_bytes(b"weights")
    python = stand_in(tmp_path / "python", model, fault)
    folder = tmp_path / "pictures"
    folder.mkdir()
    # sides that one gain does not fit: 320 of 1280 leave 159.75 of 639 rows
    image = cv2.imread(str(data / "yolo/coco8-seg/images/000000000049.jpg"))
    cv2.imwrite(str(folder / "many.png"), cv2.resize(image, (1280, 639)))
    found = verified(model, tmp_path / "best.pt", folder, python)
    assert found.rectangle is not None
    if cause is None:
        total = found.agreement
        assert (found.causes, min(total.ious), sum(total.moved.values())) == ((), 1.0, 0)
        assert max(total.box_px) < 1e-3
    else:
        assert [cause in said for said in found.causes] == [True]


def test_an_interpreter_that_fails_is_quoted(tmp_path, a, pictures, monkeypatch):
    (tmp_path / "best.pt").write_bytes(b"weights")
    python = tmp_path / "python"
    python.write_text("#!/bin/sh\necho \"ModuleNotFoundError: No module named 'ultralytics'\" >&2\nexit 1\n")
    python.chmod(0o755)
    with pytest.raises(ModelError, match="predict by Ultralytics failed: ModuleNotFoundError") as caught:
        verified(a, tmp_path / "best.pt", pictures, python)
    assert "model export --print-setup" in caught.value.hint
    with pytest.raises(ModelError, match="is no program that can be run"):
        verified(a, tmp_path / "best.pt", pictures, tmp_path / "none")
    monkeypatch.setenv("PATH", "/nowhere")
    monkeypatch.delenv("WALLKIT_YOLO_PYTHON", raising=False)
    with pytest.raises(ModelError, match="no interpreter with Ultralytics is known"):
        verified(a, tmp_path / "best.pt", pictures)
