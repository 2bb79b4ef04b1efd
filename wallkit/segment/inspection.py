"""An ONNX file -> everything a user asks of a segmentation model before trusting it, in words."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path

from wallkit.core.segmentation import BACKGROUND
from wallkit.segment.model_file import Size, Tensor, shape_words
from wallkit.segment.onnx_graph import GraphFacts, read_graph
from wallkit.segment.onnx_segmenter import OnnxSegmenter, load_segmenter
from wallkit.segment.settings import SegmentSettings

_STRIDES = (8, 16, 32)


@dataclass(frozen=True, eq=False)
class Inspection:
    """What a model is.

    Attributes:
        outputs: what each output means, in the file's order.
        notes: what a user should know before relying on it.
    """

    segmenter: OnnxSegmenter
    graph: GraphFacts
    sha256: str
    size_bytes: int
    outputs: tuple[tuple[Tensor, str], ...]
    notes: tuple[str, ...]

    @property
    def licence(self) -> str:
        """As the metadata says; empty where it does not."""
        return self.segmenter.model.metadata.get("license", "")

    def role_words(self) -> dict[str, list[str]]:
        """Role -> the classes that count as it, in the order of the classes."""
        found: dict[str, list[str]] = {}
        for name, role in zip(self.segmenter.names, self.segmenter.roles, strict=True):
            found.setdefault(role, []).append(name)
        return found

    def lacking(self, roles: tuple[str, ...]) -> tuple[str, ...]:
        """Those of the roles that no class counts as."""
        return tuple(role for role in roles if role not in self.segmenter.roles)


def inspect_model(path: Path, settings: SegmentSettings | None = None) -> Inspection:
    """What the model in a file is.

    Raises:
        ModelError: it cannot be loaded, or is no segmentation model.
    """
    segmenter = load_segmenter(path, settings)
    graph = read_graph(segmenter.model.path)
    data = segmenter.model.path.read_bytes()
    outputs = tuple((tensor, _meaning(tensor, segmenter)) for tensor in segmenter.model.outputs)
    notes = tuple(_notes(segmenter, graph))
    return Inspection(segmenter, graph, hashlib.sha256(data).hexdigest(), len(data), outputs, notes)


def anchors_of(size: Size) -> int:
    """Of a YOLO head on an input (height, width)."""
    return sum((size[0] // stride) * (size[1] // stride) for stride in _STRIDES)


# ------------------------------------------------------------------------------------------------ details


def _meaning(tensor: Tensor, segmenter: OnnxSegmenter) -> str:
    used = segmenter.outputs.tensors
    if tensor not in used:
        return "not used"
    coefficients, classes = segmenter.outputs.coefficients, segmenter.outputs.classes
    if segmenter.layout.startswith("yolo") and tensor is used[1]:
        rows = tensor.shape[2]
        part = f" at 1/{segmenter.size[0] // rows} of the input's size" if rows else ""
        return f"{coefficients} prototypes{part}; a mask is where their weighted sum is positive"
    if segmenter.layout == "yolo-anchors":
        count = tensor.shape[2]
        places = "any number of" if count is None else str(count)
        strides = " (strides 8, 16, 32)" if count == anchors_of(segmenter.size) else ""
        return f"{places} anchors{strides}: centre x, y, width, height, {classes} probabilities, {coefficients} coefficients"
    if segmenter.layout == "yolo-rows":
        rows_words = "any number of" if tensor.shape[1] is None else str(tensor.shape[1])
        return f"{rows_words} rows, zeros after the last: x1, y1, x2, y2, score, class, {coefficients} coefficients"
    grid = shape_words(tensor.shape[-2:])
    return (
        f"the class of each cell of a grid {grid}"
        if segmenter.layout == "class-ids"
        else (f"scores of {classes} classes on a grid {grid}")
    )


def _notes(segmenter: OnnxSegmenter, graph: GraphFacts) -> list[str]:
    model, notes = segmenter.model, []
    if graph.min_score is not None and graph.min_score > segmenter.settings.min_score:
        notes.append(
            f"detections less sure than {graph.min_score:g} are left out inside the file; segment.min_score ="
            f" {segmenter.settings.min_score:g} cannot bring them back"
        )
    if not model.names:
        notes.append("the metadata names no classes: give them as [segment] names in wallkit.toml")
    if "license" not in model.metadata:
        notes.append("the metadata names no licence: ask who made it before passing it on")
    elif "AGPL" in model.metadata["license"]:
        notes.append("AGPL-3.0 holds for the weights too: do not ship it in a product that is not")
    if all(role in ("other", "background") for role in segmenter.roles):
        notes.append("no class counts as anything: list its words under [segment.roles] in wallkit.toml")
    return [*notes, *_unused_words(segmenter)]


def _unused_words(segmenter: OnnxSegmenter) -> list[str]:
    """Words under [segment.roles] that do nothing with this model: of another model, or typing errors."""
    names = [name for name in segmenter.names if name != BACKGROUND]
    found = []
    for role, word in segmenter.settings.roles.unused(names):
        near = get_close_matches(word, names, n=1)
        meant = f": did you mean '{near[0]}'?" if near else ""
        found.append(f"segment.roles.{role} lists '{word}', which none of its classes is called{meant}")
    return found
