"""A float ONNX model and pictures to calibrate with -> the same in 8 or 16 bits, its decoding left in float.

In the last nodes of a YOLO head boxes of hundreds of pixels and probabilities below 1 share one tensor: counted with the
same 8 bits the probabilities are all 0 (onnxruntime#10787, ultralytics#25045). So everything after the last convolutions
stays as it is, and where nothing comes after them, these do. Needs the package `onnx`.
"""

from __future__ import annotations

import contextlib
import io
import logging
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Literal

from wallkit.core.types import UInt8Array
from wallkit.errors import ModelError
from wallkit.segment.fixture import onnx_package
from wallkit.segment.onnx_graph import read_graph
from wallkit.segment.onnx_segmenter import OnnxSegmenter

Kind = Literal["int8", "fp16"]
# the last of them end the tail
_WEIGHTED = ("Conv", "ConvTranspose", "Gemm")


def quantise(segmenter: OnnxSegmenter, pictures: Sequence[UInt8Array], out: Path, *, kind: Kind, work: Path) -> int:
    """Write the model in fewer bits; `work` is a folder for what is needed on the way.

    Returns:
        How many nodes stay in float.

    Raises:
        ModelError: `onnx` is not installed, the model counts with few bits already, or the tool fails.
    """
    onnx_package()
    if read_graph(segmenter.model.path).is_quantised:
        raise ModelError("counts with 8 bits already", where=segmenter.model.path, hint="give the float model")
    try:
        # onnxruntime's tools print and log much of no use to anybody
        with contextlib.redirect_stdout(io.StringIO()), _quiet_logging():
            return (_to_int8 if kind == "int8" else _to_fp16)(segmenter, pictures, out, work)
    except Exception as error:
        # its exceptions share no base
        said = (str(error).splitlines() or [type(error).__name__])[0]
        hint = "export it again with opset 18 or lower: higher ones are not known to the tool"
        raise ModelError(f"onnxruntime cannot quantise it: {said}", where=segmenter.model.path, hint=hint) from error


def decode_tail(model: Any) -> list[str]:
    """Names of the nodes that lie behind the last convolutions on the way to the outputs; else of these themselves."""
    makers = {name: node for node in model.graph.node for name in node.output}
    waiting = [output.name for output in model.graph.output]
    found: dict[str, None] = {}
    last: dict[str, None] = {}
    while waiting:
        node = makers.get(waiting.pop())
        if node is None or node.name in found:
            continue
        if node.op_type in _WEIGHTED:
            last[node.name] = None
            continue
        found[node.name] = None
        waiting += list(node.input)
    return list(found or last)


# ------------------------------------------------------------------------------------------------ details


def _to_int8(segmenter: OnnxSegmenter, pictures: Sequence[UInt8Array], out: Path, work: Path) -> int:
    """Weights as int8 for each channel, activations as uint8 by their extremes on the pictures (QDQ)."""
    import onnx
    from onnxruntime.quantization import QuantFormat, QuantType, quantize_static
    from onnxruntime.quantization.shape_inference import quant_pre_process

    ready = work / "ready.onnx"
    quant_pre_process(str(segmenter.model.path), str(ready), skip_symbolic_shape=True)
    model = onnx.load(ready)
    for number, node in enumerate(model.graph.node):
        node.name = node.name or f"node_{number}"
    tail = decode_tail(model)
    onnx.save(model, ready)
    quantize_static(
        str(ready),
        str(out),
        _reader(segmenter, pictures),
        quant_format=QuantFormat.QDQ,
        per_channel=True,
        activation_type=QuantType.QUInt8,
        weight_type=QuantType.QInt8,
        nodes_to_exclude=tail,
    )
    return len(tail)


def _to_fp16(segmenter: OnnxSegmenter, pictures: Sequence[UInt8Array], out: Path, work: Path) -> int:
    """Weights and sums in half precision; input, outputs and decoding in float."""
    import onnx
    from onnxruntime.transformers.float16 import convert_float_to_float16

    model = onnx.load(segmenter.model.path)
    for number, node in enumerate(model.graph.node):
        node.name = node.name or f"node_{number}"
    tail = decode_tail(model)
    onnx.save(convert_float_to_float16(model, keep_io_types=True, node_block_list=tail), out)
    return len(tail)


def _reader(segmenter: OnnxSegmenter, pictures: Sequence[UInt8Array]) -> Any:
    from onnxruntime.quantization import CalibrationDataReader

    name = segmenter.model.inputs[0].name

    class Reader(CalibrationDataReader):  # type: ignore[misc]
        def __init__(self) -> None:
            self.inputs: Iterator[Any] = ({name: segmenter.prepared(rgb, segmenter.frame(rgb))} for rgb in pictures)

        def get_next(self) -> Any:
            return next(self.inputs, None)

    return Reader()


@contextlib.contextmanager
def _quiet_logging() -> Iterator[None]:
    before = logging.root.manager.disable
    logging.disable(logging.WARNING)
    try:
        yield
    finally:
        logging.disable(before)
