"""Fewer bits: where the decoding begins, and that a smaller model still sees what the float one saw."""

from __future__ import annotations

import numpy as np
import pytest

from tests.segment.drawn import colour_oracle, picture
from wallkit.errors import ModelError
from wallkit.pipelines.model.pictures import Picture, PictureSource, pictures_of
from wallkit.pipelines.model.quantize import quantise_model
from wallkit.segment.fixture import USUAL, oracle
from wallkit.segment.onnx_graph import read_graph
from wallkit.segment.onnx_segmenter import load_segmenter
from wallkit.segment.quantize import decode_tail
from wallkit.segment.settings import SegmentSettings


def drawn(count: int) -> list[Picture]:
    rng = np.random.default_rng(5)
    found = []
    for k in range(count):
        left, top = rng.integers(0, 100, size=2).tolist()
        things = {"wall": (left, top, left + 150, top + 200), "sink": (200, 20, 300, 90 + top)}
        found.append(Picture(str(k), picture((320, 320), things)))
    return found


def test_the_tail_is_what_lies_behind_the_last_convolution():
    import onnx

    model = onnx.load_from_string(oracle(USUAL, (64, 64)))
    for number, node in enumerate(model.graph.node):
        node.name = f"{node.op_type}-{number}"
    tail = {name.split("-")[0] for name in decode_tail(model)}
    assert tail == {"Sigmoid", "GlobalAveragePool", "Slice", "Sub", "Mul", "Reshape", "Concat"}
    kinds = [name.split("-")[0] for name in decode_tail(model)]
    # the picture's own squares and their Concat come before
    assert kinds.count("Concat") == 1


@pytest.mark.parametrize("kind", ["int8", "fp16"])
def test_an_oracle_in_fewer_bits_finds_the_same(tmp_path, kind):
    path = colour_oracle(tmp_path, layout="class-scores").model.path
    out = tmp_path / "small.onnx"
    done = quantise_model(path, out, drawn(8), SegmentSettings(), kind=kind, min_match=0.9)
    assert (done.is_written, done.calibrated, done.judged, done.is_judged_by_same) == (True, 4, 4, False)
    assert np.mean(done.agreement.ious) > 0.9
    assert read_graph(out).is_quantised == (kind == "int8")
    # names, licence and size are carried over
    assert load_segmenter(out).names == load_segmenter(path).names
    assert load_segmenter(out).model.metadata["license"] == "Apache-2.0"


def test_a_model_that_sees_too_little_afterwards_is_not_written(tmp_path):
    """Of a share of 2 or more nobody can find so many again: whatever came out, it is not enough."""
    path = colour_oracle(tmp_path).model.path
    done = quantise_model(path, tmp_path / "small.onnx", drawn(2), SegmentSettings(), min_match=1.01)
    assert (done.is_written, done.is_judged_by_same) == (False, True)
    assert not (tmp_path / "small.onnx").exists()


def test_what_cannot_be_judged_or_is_small_already_is_refused(tmp_path):
    path = colour_oracle(tmp_path, layout="class-scores").model.path
    empty = [Picture("empty", picture((320, 320), {}))]
    with pytest.raises(ModelError, match="finds nothing on these pictures"):
        quantise_model(path, tmp_path / "small.onnx", empty, SegmentSettings())
    quantise_model(path, tmp_path / "small.onnx", drawn(6), SegmentSettings())
    with pytest.raises(ModelError, match="counts with 8 bits already"):
        quantise_model(tmp_path / "small.onnx", tmp_path / "smaller.onnx", drawn(6), SegmentSettings())


@pytest.mark.slow
def test_a_real_model_keeps_most_of_what_it_finds(tmp_path, data):
    """Twelve rooms and corridors; the whole graph in 8 bits finds nothing at all (see quantize.py)."""
    pictures = pictures_of(PictureSource((data / "yolo/images", data / "yolo/coco8-seg/images")))
    path = data / "yolo/weights/yolov8n-seg_coco-dq_320.onnx"
    done = quantise_model(path, tmp_path / "small.onnx", pictures, SegmentSettings(), min_match=0.8)
    assert done.is_written
    assert np.mean(done.agreement.ious) > 0.9
    assert done.bytes_after < 0.35 * done.bytes_before
