"""Real models on real pictures: the same detections and masks as Ultralytics itself, and a foreign semantic net."""

from __future__ import annotations

import base64
import json
import zlib
from pathlib import Path

import numpy as np
import pytest

from wallkit.segment.onnx_segmenter import load_segmenter
from wallkit.segment.settings import SegmentSettings

REFERENCE = json.loads(Path(__file__).with_name("ultralytics.json").read_text())["pictures"]
MODELS = sorted({picture["model"] for picture in REFERENCE})


def pixels(data: Path, name: str) -> np.ndarray:
    import cv2

    folder = data / "yolo" / ("coco8-seg/images" if name.startswith("0000") else "images")
    return np.asarray(cv2.imread(str(folder / name)))[..., ::-1]


def bits(text: str, shape: tuple[int, int]) -> np.ndarray:
    packed = np.frombuffer(zlib.decompress(base64.b85decode(text)), dtype=np.uint8)
    return np.unpackbits(packed, count=shape[0] * shape[1]).reshape(shape).astype(bool)


@pytest.mark.parametrize("name", MODELS)
def test_boxes_scores_and_masks_are_ultralytics(data, name):
    """Raw head and NMS inside: every detection, boxes to 0.01 px, scores to 1e-4, masks to IoU 0.99."""
    segmenter = load_segmenter(data / "yolo/weights" / name)
    compared = 0
    for picture in (p for p in REFERENCE if p["model"] == name):
        found = segmenter.segment(pixels(data, picture["image"]))
        ours, theirs = found.detections, picture["found"]
        assert len(ours) == len(theirs), picture["image"]
        masks = found.masks(of_net=True)
        boxes = found.frame.boxes_in_image(ours.boxes)
        for k, row in enumerate(theirs):
            assert ours.labels[k] == row["class"]
            assert ours.scores[k] == pytest.approx(row["score"], abs=1e-4)
            np.testing.assert_allclose(boxes[k], row["box"], atol=0.01)
            mask = bits(row["mask"], tuple(picture["input"]))
            assert (masks[k] & mask).sum() >= 0.99 * (masks[k] | mask).sum()
            compared += 1
    assert compared > 20


def test_labels_of_points_are_those_of_the_masks_at_the_cameras_size(data):
    """Where one thing alone covers a point, its mask says the same as sampling; what is left is where things overlap."""
    found = load_segmenter(data / "yolo/weights/yolov8n-seg_coco-dq_320.onnx").segment(pixels(data, "000000000049.jpg"))
    masks, d = found.masks(), found.detections
    assert len(d) >= 3
    height, width = found.shape
    at = np.random.default_rng(0).integers(0, [width, height], size=(20_000, 2))
    labels, _ = found.classes_at(at)
    covering = masks[:, at[:, 1], at[:, 0]]
    alone = covering.sum(axis=0) == 1
    np.testing.assert_array_equal(labels[alone], d.labels[covering[:, alone].argmax(axis=0)])
    np.testing.assert_array_equal(labels[~covering.any(axis=0)], len(found.names) - 1)


def test_a_foreign_semantic_net_finds_walls_and_floor(data):
    """DeepLab of ADE20K, without names in its metadata, input from -1 to 1: the settings say what is needed."""
    names = ["" for _ in range(150)]
    for number, name in {1: "wall", 4: "floor", 6: "ceiling", 15: "door"}.items():
        names[number] = name
    half = (0.5, 0.5, 0.5)
    settings = SegmentSettings(names=tuple(names), mean=half, std=half)
    segmenter = load_segmenter(data / "yolo/weights/deeplabv3_mnv2_ade20k_257.onnx", settings)
    assert (segmenter.layout, segmenter.size) == ("class-scores", (257, 257))
    found = segmenter.segment(pixels(data, "corridor_0416.png"))
    shares = {role: found.mask({role}).mean() for role in ("wall", "floor")}
    assert shares["wall"] > 0.2
    assert shares["floor"] > 0.05
    # the floor is below the walls
    rows = [np.nonzero(found.mask({role}))[0].mean() for role in ("wall", "floor")]
    assert rows[1] > rows[0]
