"""What a file is said to be: against the colour oracle, whose making is known, and real exports."""

from __future__ import annotations

import numpy as np
import pytest

from tests.segment.drawn import colour_oracle, constant_model
from wallkit.errors import ModelError
from wallkit.segment.inspection import anchors_of, inspect_model
from wallkit.segment.layouts import LAYOUTS
from wallkit.segment.onnx_graph import read_graph
from wallkit.segment.roles import Roles
from wallkit.segment.settings import SegmentSettings


@pytest.mark.parametrize("layout", LAYOUTS)
def test_the_graph_is_read_as_the_package_onnx_reads_it(layout, tmp_path):
    from collections import Counter

    import onnx

    path = colour_oracle(tmp_path, layout=layout).model.path
    facts, model = read_graph(path), onnx.load(path)
    assert facts.opset == model.opset_import[0].version
    assert facts.ir_version == model.ir_version
    assert facts.nodes == Counter(node.op_type for node in model.graph.node)
    sizes = [int(np.prod(constant.dims)) for constant in model.graph.initializer]
    assert facts.parameters == sum(size for size in sizes if size > 1)
    assert not facts.is_quantised


def test_every_output_is_told_in_words(tmp_path):
    found = inspect_model(colour_oracle(tmp_path).model.path)
    head, prototypes = (meaning for _, meaning in found.outputs)
    assert head == "16 anchors: centre x, y, width, height, 6 probabilities, 32 coefficients"
    assert prototypes.startswith("32 prototypes at 1/4 of the input's size")
    assert found.role_words()["wall"] == ["wall"]
    assert found.lacking(("wall", "floor", "door")) == ("floor",)
    assert found.licence == "Apache-2.0"
    assert found.notes == ()


def test_a_model_that_says_nothing_about_itself_is_noted(tmp_path):
    path = constant_model(tmp_path / "m.onnx", {"s": np.zeros((1, 2, 8, 8), np.float32)})
    notes = " ".join(inspect_model(path).notes)
    for words in ("names no classes", "names no licence", "no class counts as anything"):
        assert words in notes


def test_words_that_no_class_is_called_are_noted(tmp_path):
    path = colour_oracle(tmp_path).model.path
    listed = Roles(wall=("Wall", "doro"), movable=("sink", "fridge"))
    assert inspect_model(path, SegmentSettings(roles=listed)).notes == (
        "segment.roles.wall lists 'doro', which none of its classes is called: did you mean 'door'?",
        "segment.roles.movable lists 'fridge', which none of its classes is called",
    )


def test_anchors_of_the_usual_sizes():
    assert (anchors_of((640, 640)), anchors_of((320, 320)), anchors_of((192, 320))) == (8400, 2100, 1260)


def test_thresholds_inside_are_found_in_a_real_export(data):
    weights = data / "yolo/weights"
    thinned = inspect_model(weights / "yolov8n-seg_coco-dq_640_nms.onnx")
    assert thinned.graph.min_score == pytest.approx(0.25)
    assert thinned.graph.max_overlap == pytest.approx(0.7)
    raw = inspect_model(weights / "wallseg_yolov8n_192x320_int8qdq.onnx")
    assert (raw.graph.min_score, raw.graph.is_quantised, raw.graph.opset) == (None, True, 18)
    assert "1260 anchors (strides 8, 16, 32)" in raw.outputs[0][1]
    assert any("AGPL" in note for note in raw.notes)


@pytest.mark.parametrize("data_of", [b"", b"\xff" * 40, b"\x0a\xff\xff\xff\xff\x0f", b"text that is none"])
def test_what_is_no_onnx_is_said(tmp_path, data_of):
    path = tmp_path / "m.onnx"
    path.write_bytes(data_of)
    with pytest.raises(ModelError, match="is no ONNX file"):
        read_graph(path)
