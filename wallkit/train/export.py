"""A trained network -> an ONNX file: its contract in the metadata, its weights in half precision, its answers compared.

`images` [1, 3, H, W] RGB in [0, 1] -> `classes` [1, C, H / 2, W / 2] scores, to be sampled bilinearly. Weights are kept as
float16 and widened when the file is loaded: half the size, and the arithmetic stays float32.
"""

from __future__ import annotations

import io
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from wallkit.core.types import Float32Array
from wallkit.train.network import STRIDE, SemanticNet

OPSET = 17
# weights fewer than these are kept as they are
_SMALL = 1024


@dataclass(frozen=True)
class Exported:
    """size_bytes: of the file. drift: the most that a score differs from PyTorch's, and `agreeing` the share of places with
    the same class, on noise."""

    size_bytes: int
    drift: float
    agreeing: float


def export_onnx(
    net: SemanticNet, names: tuple[str, ...], size: tuple[int, int], path: Path, *, about: Mapping[str, str]
) -> Exported:
    """Writes the file; `about` joins its metadata (author, licence, what it was trained on)."""
    import onnx

    width, height = size
    example = torch.zeros(1, 3, height, width)
    packed = io.BytesIO()
    with warnings.catch_warnings():
        # its successor needs one more package, and gains nothing for plain convolutions
        warnings.simplefilter("ignore", DeprecationWarning)
        torch.onnx.export(
            net.to(memory_format=torch.contiguous_format).eval(), (example,), packed,
            input_names=["images"], output_names=["classes"], opset_version=OPSET, dynamo=False,
        )  # fmt: skip
    model = onnx.load_from_string(packed.getvalue())
    halve_weights(model)
    metadata = {
        "names": repr(dict(enumerate(names))),
        "task": "semantic",
        "imgsz": repr([height, width]),
        "stride": str(STRIDE),
        "channels": "3",
        **about,
    }
    onnx.helper.set_model_props(model, metadata)
    model.producer_name, model.producer_version, model.doc_string = "wallkit", about.get("version", ""), ""
    onnx.checker.check_model(model)
    partial = path.with_suffix(".partial")
    partial.write_bytes(model.SerializeToString())
    partial.replace(path)
    return Exported(path.stat().st_size, *_compared(net, path, (height, width)))


def halve_weights(model: Any) -> None:
    """Makes large float32 weights of an ONNX model float16, each widened by a Cast; the model is changed."""
    from onnx import TensorProto, helper, numpy_helper

    casts = []
    for weight in model.graph.initializer:
        values = numpy_helper.to_array(weight)
        if weight.data_type != TensorProto.FLOAT or values.size < _SMALL:
            continue
        name = weight.name
        weight.CopyFrom(numpy_helper.from_array(values.astype(np.float16), f"{name}.half"))
        casts.append(helper.make_node("Cast", [f"{name}.half"], [name], to=TensorProto.FLOAT))
    nodes = [*casts, *model.graph.node]
    del model.graph.node[:]
    model.graph.node.extend(nodes)


def _compared(net: SemanticNet, path: Path, shape: tuple[int, int]) -> tuple[float, float]:
    """How far onnxruntime and PyTorch are apart on pictures of noise: coarse and fine."""
    import onnxruntime

    rng = np.random.default_rng(0)
    session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    drift, same = 0.0, []
    for cells in (4, 16, 64):
        coarse = torch.from_numpy(rng.random((1, 3, cells, cells)).astype(np.float32))
        images = torch.nn.functional.interpolate(coarse, shape, mode="bilinear")
        with torch.no_grad():
            wanted: Float32Array = net(images).numpy()
        given = np.asarray(session.run(None, {"images": images.numpy()})[0])
        drift = max(drift, float(np.abs(given - wanted).max()))
        same.append(float((given.argmax(1) == wanted.argmax(1)).mean()))
    return drift, float(np.mean(same))
