"""The bytes of an ONNX file -> what onnxruntime does not tell: versions, kinds of nodes, and thresholds built in.

Reads the few fields it needs of protobuf's wire format (onnx/onnx.proto), so that the package `onnx` is not needed.
"""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from math import prod
from pathlib import Path

from wallkit.errors import ModelError

_FLOAT, _DOUBLE = 1, 11


@dataclass(frozen=True)
class GraphFacts:
    """What is in a graph.

    Attributes:
        opset: version of the standard operators; None where the file does not say. ir_version: of the format.
        nodes: kind -> how many. parameters: numbers in all constants of more than one.
        min_score, max_overlap: built into the graph, which nothing outside can lower; None where there are none.
    """

    opset: int | None
    ir_version: int | None
    nodes: Mapping[str, int]
    parameters: int
    min_score: float | None
    max_overlap: float | None

    @property
    def is_quantised(self) -> bool:
        """Whether parts of it count with 8 bits."""
        return any("Quant" in kind or kind in ("ConvInteger", "MatMulInteger") for kind in self.nodes)


def read_graph(path: Path) -> GraphFacts:
    """The facts of an ONNX file.

    Raises:
        ModelError: its bytes are no ONNX.
    """
    try:
        return _model(memoryview(path.read_bytes()))
    except OSError as error:
        raise ModelError(f"cannot be read: {error.strerror}", where=path) from error
    except (ValueError, IndexError, struct.error) as error:
        raise ModelError("is no ONNX file", where=path, hint="export it again") from error


# ------------------------------------------------------------------------------------------------ details


@dataclass
class _Node:
    kind: str = ""
    inputs: list[str] = field(default_factory=list)
    outputs: list[str] = field(default_factory=list)
    value: float | None = None


def _model(data: memoryview) -> GraphFacts:
    ir_version = opset = graph = None
    for number, value in _fields(data):
        if number == 1 and isinstance(value, int):
            ir_version = value
        elif number == 7 and isinstance(value, memoryview):
            graph = value
        elif number == 8 and isinstance(value, memoryview):
            said = dict(_fields(value))
            if not bytes(said.get(1, b"")):  # type: ignore[arg-type]  # the standard domain has no name
                opset = said.get(2)
    if graph is None:
        raise ValueError("no graph")
    nodes, scalars, parameters = [], {}, 0
    for number, value in _fields(graph):
        if not isinstance(value, memoryview):
            continue
        if number == 1:
            nodes.append(_node(value))
        elif number == 5:
            name, count, scalar = _tensor(value)
            parameters += count if count > 1 else 0
            if scalar is not None:
                scalars[name] = scalar
    for node in nodes:
        if node.kind == "Constant" and node.value is not None and node.outputs:
            scalars[node.outputs[0]] = node.value
    thinning = next((node for node in nodes if node.kind == "NonMaxSuppression"), None)
    return GraphFacts(
        opset if isinstance(opset, int) else None,
        ir_version,
        dict(sorted(Counter(node.kind for node in nodes).items())),
        parameters,
        _least_score(nodes, scalars, thinning),
        None if thinning is None or len(thinning.inputs) < 4 else scalars.get(thinning.inputs[3]),
    )


def _least_score(nodes: list[_Node], scalars: Mapping[str, float], thinning: _Node | None) -> float | None:
    """Of the boxes that thinning is given: what it asks itself, or what a comparison asks of the scores before."""
    if thinning is None:
        return None
    own = scalars.get(thinning.inputs[4]) if len(thinning.inputs) > 4 else None
    asked = [
        scalars[name]
        for node in nodes
        if node.kind in ("Greater", "GreaterOrEqual")
        for name in node.inputs[1:2]
        if 0 < scalars.get(name, 0) < 1
    ]
    return max([*asked, *([own] if own else [])], default=None)


def _node(data: memoryview) -> _Node:
    node = _Node()
    for number, value in _fields(data):
        if not isinstance(value, memoryview):
            continue
        if number == 1:
            node.inputs.append(str(value, "utf-8"))
        elif number == 2:
            node.outputs.append(str(value, "utf-8"))
        elif number == 4:
            node.kind = str(value, "utf-8")
        elif number == 5:
            said = dict(_fields(value))
            tensor = said.get(5)
            if isinstance(tensor, memoryview):
                node.value = _tensor(tensor)[2]
            elif bytes(said.get(1, b"")) == b"value_float" and isinstance(said.get(2), float):  # type: ignore[arg-type]
                node.value = float(said[2])
    return node


def _tensor(data: memoryview) -> tuple[str, int, float | None]:
    """Name and number of values of a tensor, and the value of one that has a single float."""
    name, sides, kind, raw, listed = "", [], 0, b"", None
    for number, value in _fields(data):
        if number == 1:
            sides += [value] if isinstance(value, int) else list(_varints(value))  # type: ignore[arg-type]
        elif number == 2 and isinstance(value, int):
            kind = value
        elif number == 4:
            listed = value
        elif number == 8 and isinstance(value, memoryview):
            name = str(value, "utf-8")
        elif number == 9 and isinstance(value, memoryview):
            raw = value[:8].tobytes()
    count = prod(side for side in sides if isinstance(side, int))
    if count != 1 or kind not in (_FLOAT, _DOUBLE):
        return name, count, None
    if kind == _FLOAT and listed is not None:
        return name, count, listed if isinstance(listed, float) else float(struct.unpack("<f", bytes(listed)[:4])[0])
    wanted = "<f" if kind == _FLOAT else "<d"
    return name, count, float(struct.unpack(wanted, raw[: struct.calcsize(wanted)])[0])


def _fields(data: memoryview) -> Iterator[tuple[int, int | float | memoryview]]:
    """(number, value) of every field of a message: whole numbers, floats, or bytes."""
    at = 0
    while at < len(data):
        key, at = _varint(data, at)
        number, wire = key >> 3, key & 7
        if wire == 0:
            value, at = _varint(data, at)
            yield number, value
        elif wire == 2:
            length, at = _varint(data, at)
            if at + length > len(data):
                raise ValueError("cut off")
            yield number, data[at : at + length]
            at += length
        elif wire in (1, 5):
            size = 8 if wire == 1 else 4
            yield number, float(struct.unpack("<d" if wire == 1 else "<f", data[at : at + size])[0])
            at += size
        else:
            raise ValueError(f"wire type {wire}")


def _varints(data: memoryview) -> Iterator[int]:
    at = 0
    while at < len(data):
        value, at = _varint(data, at)
        yield value


def _varint(data: memoryview, at: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        byte = data[at]
        value |= (byte & 0x7F) << shift
        at += 1
        if byte < 0x80:
            return value, at
        shift += 7
        if shift > 63:
            raise ValueError("a number without end")
