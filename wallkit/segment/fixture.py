"""Classes with a colour each -> an ONNX that segments by colour, in any layout: a model whose answers are known beforehand.

No training and no weights: the score of a class falls with the squared distance of a pixel's colour from the class's own.
On flat-coloured pictures, of a test or of a simulated camera, it is an oracle. Needs the package `onnx`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wallkit.core.config import read_toml
from wallkit.core.segmentation import BACKGROUND
from wallkit.core.types import Float32Array
from wallkit.errors import ModelError, closest
from wallkit.segment.model_file import Size

Colours = Mapping[str, tuple[int, int, int]]
USUAL: Colours = {
    "wall": (200, 180, 160),
    "door": (160, 60, 40),
    "toilet": (250, 250, 250),
    "urinal": (40, 220, 200),
    "sink": (120, 120, 255),
    "person": (30, 30, 30),
}
# a squared distance of colours, each in [0, 1], at which the score is 0; and how fast it falls
_MARGIN, _GAIN = 0.02, 400.0
# a thing of less than this share of the picture is not found
_LEAST_SHARE = 0.002
_COEFFICIENTS = 32


def colours_of(path: Path | None) -> Colours:
    """The classes of a TOML file, `name = [r, g, b]` a line; None: the usual six.

    Raises:
        ConfigError: no TOML. ModelError: a class without a colour, two of one colour, none or too many.
    """
    if path is None:
        return USUAL
    source = read_toml(path)
    for name, colour in source.table.items():
        if not isinstance(colour, list) or len(colour) != 3 or not all(_is_byte(value) for value in colour):
            hint = "write `wall = [200, 180, 160]`: red, green and blue from 0 to 255"
            raise ModelError(f"'{name}' is {colour!r}, no colour", where=source.place([name]), hint=hint)
    found = {name: (int(c[0]), int(c[1]), int(c[2])) for name, c in source.table.items()}
    if not 0 < len(found) <= _COEFFICIENTS:
        raise ModelError(f"{len(found)} classes, but 1 to {_COEFFICIENTS} can be told apart", where=path)
    _check_apart(found, path)
    return found


def oracle(colours: Colours, size: Size, layout: str = "yolo-anchors") -> bytes:
    """An ONNX file with input [1, 3, *size] and outputs of a layout.

    Raises:
        ModelError: `onnx` is not installed, no such layout, or a size that is no multiple of 32.
    """
    if any(side < 32 or side % 32 for side in size):
        raise ModelError(f"{size[0]} x {size[1]} is no input of a YOLO model", hint="height and width: multiples of 32")
    if layout not in _BUILDERS:
        raise ModelError(f"no layout is called '{layout}'", hint=closest(layout, _BUILDERS))
    onnx = onnx_package()
    net = _Net(onnx, size, (np.array(list(colours.values())) / 255).astype(np.float32))
    task, names = _BUILDERS[layout](net), list(colours)
    if task == "semantic":
        names.append(BACKGROUND)
    given = onnx.helper.make_tensor_value_info("images", onnx.TensorProto.FLOAT, [1, 3, *size])
    graph = onnx.helper.make_graph(net.nodes, "colour_oracle", [given], net.outputs, net.constants)
    model = onnx.helper.make_model(
        graph, opset_imports=[onnx.helper.make_opsetid("", 13)], producer_name="wallkit", ir_version=8
    )
    said = {
        "description": "finds flat colours; made by `wallkit model fixture`",
        "author": "wallkit",
        "license": "Apache-2.0",
        "task": task,
        "stride": "32",
        "imgsz": str(list(size)),
        "batch": "1",
        "names": str(dict(enumerate(names))),
    }
    onnx.helper.set_model_props(model, said)
    onnx.checker.check_model(model, full_check=True)
    return bytes(model.SerializeToString())


def onnx_package() -> Any:
    """The module `onnx`.

    Raises:
        ModelError: it is not installed.
    """
    try:
        import onnx
    except ImportError as error:
        raise ModelError(
            "needs the package onnx, which is not installed", hint="pip install 'wallkit[model]'"
        ) from error
    return onnx


# ------------------------------------------------------------------------------------------------ details


@dataclass(eq=False)
class _Net:
    """A graph as it grows."""

    onnx: Any
    size: Size
    colours: Float32Array

    def __post_init__(self) -> None:
        self.nodes: list[Any] = []
        self.constants: list[Any] = []
        self.outputs: list[Any] = []

    def constant(self, name: str, values: Any) -> str:
        self.constants.append(self.onnx.numpy_helper.from_array(np.asarray(values), name))
        return name

    def add(self, kind: str, inputs: list[str], output: str, **settings: Any) -> str:
        self.nodes.append(self.onnx.helper.make_node(kind, inputs, [output], **settings))
        return output

    def output(self, name: str, shape: list[int], *, is_id: bool = False) -> None:
        kind = self.onnx.TensorProto.INT64 if is_id else self.onnx.TensorProto.FLOAT
        self.outputs.append(self.onnx.helper.make_tensor_value_info(name, kind, shape))

    def closeness(self, name: str, image: str, planes: int) -> str:
        """`planes` scores of a picture, gain * (margin - |x - colour|^2), those beyond the colours far below 0."""
        weights = np.zeros((planes, 6, 1, 1), dtype=np.float32)
        offsets = np.full(planes, -1.0, dtype=np.float32)
        for k, colour in enumerate(self.colours):
            weights[k, :3, 0, 0], weights[k, 3:, 0, 0] = 2 * _GAIN * colour, -_GAIN
            offsets[k] = _GAIN * (_MARGIN - float(colour @ colour))
        squared = self.add("Mul", [image, image], f"{name}_squared")
        both = self.add("Concat", [image, squared], f"{name}_both", axis=1)
        inputs = [both, self.constant(f"{name}_weights", weights), self.constant(f"{name}_offsets", offsets)]
        return self.add("Conv", inputs, name)

    def heads(self, transposed: bool) -> None:
        """Prototypes as output1; and boxes of the whole picture, scores and coefficients of each class, as output0."""
        height, width = self.size
        classes = len(self.colours)
        small = self.add("AveragePool", ["images"], "small", kernel_shape=[4, 4], strides=[4, 4])
        self.closeness("output1", small, _COEFFICIENTS)
        shares = self.add("GlobalAveragePool", [self.add("Sigmoid", ["output1"], "covered")], "shares")
        used = self.add("Slice", [shares, *self._range(classes)], "used")
        over = self.add("Sub", [used, self.constant("least", np.float32(_LEAST_SHARE))], "over")
        sure = self.add(
            "Sigmoid", [self.add("Mul", [over, self.constant("steep", np.float32(4000))], "steeply")], "sure"
        )
        # a head with 6 rows or fewer is taken for an end-to-end one by others
        anchors = max(16, classes)
        eye = np.eye(classes, anchors, dtype=np.float32)[None]
        box = np.array([width / 2, height / 2, width, height], dtype=np.float32)
        if transposed:
            box = np.array([0, 0, width, height], dtype=np.float32)
        boxes = np.tile(box[:, None], (1, anchors))[None]
        coefficients = np.eye(_COEFFICIENTS, anchors, dtype=np.float32)[None]
        if not transposed:
            column = self.add("Reshape", [sure, self.constant("column", np.array([1, classes, 1]))], "score")
            scores = self.add("Mul", [self.constant("eye", eye), column], "scores")
            parts = [self.constant("boxes", boxes), scores, self.constant("coefficients", coefficients)]
            self.add("Concat", parts, "output0", axis=1)
            self.output("output0", [1, 4 + classes + _COEFFICIENTS, anchors])
        else:
            row = self.add("Reshape", [sure, self.constant("row", np.array([1, 1, classes]))], "score")
            scores = self.add("MatMul", [row, self.constant("eye", eye)], "scores")
            numbers = np.minimum(np.arange(anchors, dtype=np.float32), classes - 1)[None, None]
            parts = [
                *(self.constant("boxes", boxes), scores),
                *(self.constant("numbers", numbers), self.constant("coefficients", coefficients)),
            ]
            columns = self.add("Concat", parts, "columns", axis=1)
            self.add("Transpose", [columns], "output0", perm=[0, 2, 1])
            self.output("output0", [1, anchors, 6 + _COEFFICIENTS])
        self.output("output1", [1, _COEFFICIENTS, height // 4, width // 4])

    def stuff(self, name: str) -> str:
        """Scores of all classes and, always 0, the background, at half the size."""
        small = self.add("AveragePool", ["images"], "small", kernel_shape=[2, 2], strides=[2, 2])
        classes = self.closeness("near", small, len(self.colours))
        one = self.add("Slice", [classes, *self._range(1)], "one")
        nothing = self.add("Mul", [one, self.constant("zero", np.float32(0))], "nothing")
        return self.add("Concat", [classes, nothing], name, axis=1)

    def _range(self, end: int) -> list[str]:
        """The inputs of a Slice of the first `end` channels."""
        numbers = (0, end, 1)
        return [self.constant(f"range_{end}_{k}", np.array([n])) for k, n in enumerate(numbers)]


def _anchors(net: _Net) -> str:
    net.heads(transposed=False)
    return "segment"


def _rows(net: _Net) -> str:
    net.heads(transposed=True)
    return "segment"


def _scores(net: _Net) -> str:
    net.stuff("classes")
    net.output("classes", [1, len(net.colours) + 1, net.size[0] // 2, net.size[1] // 2])
    return "semantic"


def _ids(net: _Net) -> str:
    net.add("ArgMax", [net.stuff("scores")], "classes", axis=1, keepdims=0)
    net.output("classes", [1, net.size[0] // 2, net.size[1] // 2], is_id=True)
    return "semantic"


_BUILDERS = {"yolo-anchors": _anchors, "yolo-rows": _rows, "class-scores": _scores, "class-ids": _ids}


def _is_byte(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value <= 255


def _check_apart(colours: Colours, path: Path) -> None:
    """Refuse two colours so near that each counts as the other."""
    names = list(colours)
    for i, name in enumerate(names):
        for other in names[i + 1 :]:
            gap = (np.array(colours[name]) - colours[other]) / 255
            if float(gap @ gap) < 4 * _MARGIN:
                said = (
                    f"the colours of '{name}' and '{other}' are too near each other: {colours[name]}, {colours[other]}"
                )
                raise ModelError(said, where=path, hint="let one channel differ by 75 or more")
