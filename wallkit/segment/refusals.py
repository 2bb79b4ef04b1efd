"""A model that cannot be used -> why, in words, and what to do instead."""

from __future__ import annotations

from wallkit.errors import ModelError
from wallkit.segment.model_file import ModelFile, shape_words

_WANTED = (
    "wanted: input [1, 3, H, W] of floats; outputs [1, 4 + classes + coefficients, anchors] or [1, rows, 6 + coefficients]"
    " with prototypes [1, coefficients, h, w] (YOLO-seg), or [1, classes, h, w] scores, or [1, h, w] ids (semantic)"
)
_EXPORT = "export a model that segments, such as yolo11n-seg: `wallkit model export best.pt`"
_TASKS = {
    "detect": "it finds boxes, but makes no masks (task 'detect')",
    "classify": "it names whole pictures, and says nothing about their pixels (task 'classify')",
    "pose": "it finds key points, but makes no masks (task 'pose')",
    "obb": "it finds turned boxes, but makes no masks (task 'obb')",
}


def refusal(model: ModelFile, *, room: int | None = None) -> ModelError:
    """What to say of a model that keeps no layout; or one that does, but has `room` for another number of classes."""
    message, hint = input_reason(model) or _output_reason(model) or _names_reason(model, room)
    given = "; ".join([*(f"input {t}" for t in model.inputs), *(f"output {t}" for t in model.outputs)])
    return ModelError(f"{message} ({given})", where=model.path, hint=hint)


def input_reason(model: ModelFile) -> tuple[str, str] | None:
    """Why a model's input is not one picture in RGB, and what to do; None if it is."""
    if len(model.inputs) != 1:
        return f"it has {len(model.inputs)} inputs, not one picture", _WANTED
    given = model.inputs[0]
    if len(given.shape) != 4:
        return f"its input {shape_words(given.shape)} is no picture", _WANTED
    if given.shape[3] == 3 and given.shape[1] != 3:
        return "its input has the colours last", "export it with channels first, [1, 3, H, W]"
    if given.shape[1] != 3:
        return f"its input has {given.shape[1]} channels, not 3", _WANTED
    if given.dtype not in ("float32", "float16"):
        return f"its input is {given.dtype}, not float", "export it for RGB from 0 to 1, without preprocessing inside"
    if given.shape[0] not in (None, 1):
        return f"its input {shape_words(given.shape)} wants {given.shape[0]} pictures at once", "export it with batch 1"
    return None


def _output_reason(model: ModelFile) -> tuple[str, str] | None:
    task = str(model.literal("task") or "")
    if task in _TASKS:
        return _TASKS[task], _EXPORT
    flat = [t.shape for t in model.outputs if len(t.shape) == 3 and t.dtype.startswith("float")]
    deep = [t.shape for t in model.outputs if len(t.shape) == 4 and t.dtype.startswith("float")]
    if flat and not deep:
        return "it finds boxes, but makes no masks: there are no prototypes [1, coefficients, h, w]", _EXPORT
    if len(flat) == 1 and len(deep) == 1:
        return _swapped_reason(flat[0], deep[0], len(model.names))
    if len(deep) == 1 and not flat:
        if deep[0][1] == 1:
            return "it has one score for each pixel: which class is that?", "export scores of two classes or more"
        if model.names and deep[0][3] == len(model.names):
            return "its scores have the classes last", "export it with classes first, [1, classes, h, w]"
    if len(model.outputs) == 1 and len(model.outputs[0].shape) == 2:
        return "it names whole pictures, and says nothing about their pixels", _EXPORT
    return None


def _names_reason(model: ModelFile, room: int | None) -> tuple[str, str]:
    if room is None:
        return "its outputs keep no layout that is known", _WANTED
    said = f"its metadata names {len(model.names)} classes, but its outputs have room for {room}"
    return said, "name one class for each score in the metadata, or export it again"


def _swapped_reason(
    head: tuple[int | None, ...], prototypes: tuple[int | None, ...], classes: int
) -> tuple[str, str] | None:
    """Of a model with a head and prototypes that do not belong together as they should."""
    coefficients = prototypes[1] or 0
    if classes and head[2] == 5 + classes + coefficients:
        return (
            "its head says how sure it is that there is anything at all, as YOLOv5's does",
            "YOLOv8, YOLO11 and YOLO26 are read; train one of these",
        )
    if classes and head[2] == 4 + classes + coefficients:
        return "its head has anchors and numbers swapped", "export it as [1, 4 + classes + coefficients, anchors]"
    if (head[1] or 0) > 4 + coefficients:
        return None
    return (
        f"its head {shape_words(head)} has no room for {coefficients} coefficients, as the prototypes have",
        _WANTED,
    )
