"""What the outputs of a segmentation model mean, read from their shapes: LAYOUTS, and why a model has none of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wallkit.core.segmentation import BACKGROUND, Segmentation
from wallkit.errors import ModelError
from wallkit.segment.detections import Detections, detections_from_anchors, detections_from_rows
from wallkit.segment.instances import Instances
from wallkit.segment.letterbox import Letterbox
from wallkit.segment.model_file import ModelFile, Tensor
from wallkit.segment.refusals import input_reason, refusal
from wallkit.segment.scores import IdMap, ScoreMap


@dataclass(frozen=True)
class Outputs:
    """Which of a model's outputs are read, as what, and for how many classes.

    Attributes:
        tensors: in the order that the layout reads them.
        classes: that there is room for; None where the shapes do not say. coefficients: of a thing's mask; else 0.
    """

    tensors: tuple[Tensor, ...]
    classes: int | None
    coefficients: int = 0


@dataclass(frozen=True)
class View:
    """How to read the answer to one image: class names and roles, where the image lies, and which detections count."""

    names: tuple[str, ...]
    roles: tuple[str, ...]
    frame: Letterbox
    outputs: Outputs
    min_score: float = 0.25
    max_overlap: float = 0.7


@dataclass(frozen=True)
class Layout:
    """One contract.

    Attributes:
        says: in a user's words. find: the outputs that keep it, None where they do not. read: the arrays of these outputs
            as a Segmentation.
        has_background: a class is added for what no thing covers.
    """

    says: str
    find: Callable[[ModelFile], Outputs | None]
    read: Callable[[Sequence[Any], View], Segmentation]
    has_background: bool = False


def layout_of(model: ModelFile) -> tuple[str, Outputs]:
    """The name of the layout a model keeps, and its outputs.

    Raises:
        ModelError: it keeps none of them, or its names do not fit.
    """
    if input_reason(model):
        raise refusal(model)
    found = [(name, outputs) for name, layout in LAYOUTS.items() if (outputs := layout.find(model))]
    if not found:
        raise refusal(model)
    fits = [(name, outputs) for name, outputs in found if outputs.classes in (None, len(model.names))]
    if model.names and not fits:
        raise refusal(model, room=found[0][1].classes)
    return (fits or found)[0]


# ------------------------------------------------------------------------------------------ YOLO-seg


def _things(model: ModelFile) -> tuple[Tensor, Tensor] | None:
    """The head and the prototypes of a model of things."""
    flat = [t for t in model.outputs if len(t.shape) == 3 and t.dtype.startswith("float")]
    deep = [t for t in model.outputs if len(t.shape) == 4 and t.dtype.startswith("float")]
    return (flat[0], deep[0]) if len(flat) == 1 and len(deep) == 1 and deep[0].shape[1] else None


def _find_anchors(model: ModelFile) -> Outputs | None:
    pair = _things(model)
    if pair is None or pair[0].shape[1] is None:
        return None
    coefficients = int(pair[1].shape[1] or 0)
    classes = pair[0].shape[1] - 4 - coefficients
    is_rows = pair[0].shape[2] == 6 + coefficients and classes != len(model.names)
    return Outputs(pair, classes, coefficients) if classes > 0 and not is_rows else None


def _find_rows(model: ModelFile) -> Outputs | None:
    pair = _things(model)
    if pair is None or pair[0].shape[2] != 6 + int(pair[1].shape[1] or 0):
        return None
    return Outputs(pair, None, int(pair[1].shape[1] or 0))


def _read_anchors(arrays: Sequence[Any], view: View) -> Segmentation:
    limits = {"min_score": view.min_score, "max_overlap": view.max_overlap}
    return _instances(detections_from_anchors(arrays[0][0], view.outputs.coefficients, **limits), arrays[1], view)


def _read_rows(arrays: Sequence[Any], view: View) -> Segmentation:
    return _instances(detections_from_rows(arrays[0][0], min_score=view.min_score), arrays[1], view)


def _instances(found: Detections, prototypes: Any, view: View) -> Segmentation:
    if len(found) and not 0 <= found.labels.min() <= found.labels.max() < len(view.names) - 1:
        raise ModelError(
            f"the model answers with class {int(found.labels.max())}, but has {len(view.names) - 1} names",
            hint="name all classes in the metadata, or with --set segment.names",
        )
    return Instances(view.names, view.roles, view.frame, found, prototypes[0])


# ------------------------------------------------------------------------------------------ class maps


def _find_scores(model: ModelFile) -> Outputs | None:
    deep = [t for t in model.outputs if len(t.shape) == 4 and t.dtype.startswith("float")]
    named = [t for t in deep if t.shape[1] == len(model.names)]
    tensor = named[0] if named else deep[0] if len(deep) == 1 and len(model.outputs) == 1 else None
    if tensor is None or tensor.shape[1] is None or tensor.shape[1] < 2:
        return None
    return Outputs((tensor,), tensor.shape[1])


def _find_ids(model: ModelFile) -> Outputs | None:
    flat = [t for t in model.outputs if len(t.shape) - t.shape[1:-2].count(1) == 3 and "int" in t.dtype]
    return Outputs((flat[0],), None) if len(flat) == 1 else None


def _read_scores(arrays: Sequence[Any], view: View) -> Segmentation:
    scores = np.ascontiguousarray(arrays[0][0].transpose(1, 2, 0))
    sums = scores[:: max(1, len(scores) // 8)].sum(axis=2)
    is_probability = bool(scores.min() >= 0 and (np.abs(sums - 1) < 1e-2).all())
    return ScoreMap(view.names, view.roles, view.frame, scores, is_probability)


def _read_ids(arrays: Sequence[Any], view: View) -> Segmentation:
    ids = arrays[0].reshape(arrays[0].shape[-2:]).astype(np.int64)
    return IdMap(view.names, view.roles, view.frame, np.where((ids >= 0) & (ids < len(view.names)), ids, -1))


LAYOUTS: Mapping[str, Layout] = {
    "yolo-anchors": Layout(
        "YOLO-seg, raw head: [1, 4 + classes + coefficients, anchors] and prototypes [1, coefficients, h, w]",
        _find_anchors,
        _read_anchors,
        has_background=True,
    ),
    "yolo-rows": Layout(
        "YOLO-seg, thinned inside (NMS or end-to-end): [1, rows, 6 + coefficients] and prototypes [1, coefficients, h, w]",
        _find_rows,
        _read_rows,
        has_background=True,
    ),
    "class-scores": Layout("semantic, a score of every class: [1, classes, h, w]", _find_scores, _read_scores),
    "class-ids": Layout("semantic, the class itself: whole numbers [1, h, w]", _find_ids, _read_ids),
}


def class_names(model: ModelFile, layout: str, outputs: Outputs, given: tuple[str, ...] = ()) -> tuple[str, ...]:
    """Of all classes: from the metadata, else as given, else their numbers; with the background where things are found.

    Raises:
        ModelError: as many are given as do not fit, or a model that needs them has none.
    """
    names = model.names or given
    if names and outputs.classes not in (None, len(names)):
        said = f"{len(names)} names for {outputs.classes} classes"
        raise ModelError(said, where=model.path, hint="give one name for each class with --set segment.names")
    if not names and outputs.classes is None:
        hint = "give them in wallkit.toml: [segment] names = [...]"
        raise ModelError("the classes have no names in the metadata", where=model.path, hint=hint)
    named = names or tuple(str(number) for number in range(outputs.classes or 0))
    return (*named, BACKGROUND) if LAYOUTS[layout].has_background else named
