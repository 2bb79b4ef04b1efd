"""Flat-coloured pictures for the colour oracle, and ONNX files with outputs of any shape."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from wallkit.segment.fixture import USUAL, oracle
from wallkit.segment.onnx_segmenter import OnnxSegmenter, load_segmenter
from wallkit.segment.settings import SegmentSettings

NOTHING = (90, 110, 100)


def picture(shape: tuple[int, int], things: dict[str, tuple[int, int, int, int]]) -> np.ndarray:
    """(H, W, 3) a picture with class -> (left, top, right, bottom) [px], the later ones in front."""
    rgb = np.full((*shape, 3), NOTHING, dtype=np.uint8)
    for name, (left, top, right, bottom) in things.items():
        rgb[top:bottom, left:right] = USUAL[name]
    return rgb


def colour_oracle(
    folder: Path,
    size: tuple[int, int] = (320, 320),
    layout: str = "yolo-anchors",
    settings: SegmentSettings | None = None,
) -> OnnxSegmenter:
    path = folder / f"{layout}-{size[0]}x{size[1]}.onnx"
    path.write_bytes(oracle(USUAL, size, layout))
    return load_segmenter(path, settings)


def constant_model(
    path: Path,
    outputs: dict[str, np.ndarray],
    *,
    metadata: dict[str, str] | None = None,
    given: tuple[list[int | str], int] = ([1, 3, 64, 64], 1),
) -> Path:
    """An ONNX file that answers the same to every picture; `given` is its input's shape and type (1: float, 2: uint8)."""
    from onnx import TensorProto, checker, helper, numpy_helper, save

    nodes, constants, said = [], [], []
    for name, array in outputs.items():
        constants.append(numpy_helper.from_array(array, f"{name}_is"))
        nodes.append(helper.make_node("Identity", [f"{name}_is"], [name]))
        kind = helper.np_dtype_to_tensor_dtype(array.dtype)
        said.append(helper.make_tensor_value_info(name, kind, array.shape))
    images = helper.make_tensor_value_info("images", TensorProto.FLOAT if given[1] == 1 else given[1], given[0])
    graph = helper.make_graph(nodes, "constant", [images], said, constants)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=8)
    helper.set_model_props(model, metadata or {})
    checker.check_model(model)
    save(model, path)
    return path
