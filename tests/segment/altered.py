"""Colour oracles that want their input another way, as wrongly exported models do."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from wallkit.segment.fixture import USUAL, oracle

# input as given = want * scale + shift, channel by channel
WANTS = {
    "bytes": (1 / 255, 0.0),
    "imagenet": (np.array([0.229, 0.224, 0.225]), np.array([0.485, 0.456, 0.406])),
    "signed": (0.5, 0.5),
}


def altered_oracle(path: Path, way: str, size: tuple[int, int] = (320, 320)) -> Path:
    """An oracle that finds its colours only when pictures are prepared that way."""
    import onnx

    if way == "bgr":
        path.write_bytes(oracle({name: (b, g, r) for name, (r, g, b) in USUAL.items()}, size))
        return path
    model = onnx.load_from_string(oracle(USUAL, size))
    scale, shift = (np.broadcast_to(v, (3,)).astype(np.float32).reshape(1, 3, 1, 1) for v in WANTS[way])
    for node in model.graph.node:
        node.input[:] = ["meant" if name == "images" else name for name in node.input]
    for name, values in (("by", scale), ("plus", shift)):
        model.graph.initializer.append(onnx.numpy_helper.from_array(np.ascontiguousarray(values), name))
    first = onnx.helper.make_node("Mul", ["images", "by"], ["scaled"])
    second = onnx.helper.make_node("Add", ["scaled", "plus"], ["meant"])
    for node in (second, first):
        model.graph.node.insert(0, node)
    onnx.save(model, path)
    return path
