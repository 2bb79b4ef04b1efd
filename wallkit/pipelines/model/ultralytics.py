"""A checkpoint and pictures -> what Ultralytics itself finds in them, run in another interpreter."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from wallkit.core.segmentation import BACKGROUND
from wallkit.core.types import UInt8Array
from wallkit.errors import ModelError
from wallkit.segment.agreement import Answer, Thing, image_mask, painted
from wallkit.segment.child import Interpreter, ask
from wallkit.segment.letterbox import letterbox
from wallkit.segment.onnx_segmenter import OnnxSegmenter


def recorded_answers(
    interpreter: Interpreter,
    model: Path,
    pictures: Sequence[UInt8Array],
    like: OnnxSegmenter,
    folder: Path,
    *,
    is_rectangle: bool,
) -> tuple[list[Answer], tuple[str, ...]]:
    """One answer for each picture, with the thresholds and input size of an ONNX model; and the checkpoint's class names.

    Args:
        is_rectangle: as its own predict does, with no more grey than it must; else on the whole input.

    Raises:
        ModelError: the checkpoint is not there, or the other interpreter fails.
    """
    if not model.is_file():
        raise ModelError("no such file", where=model)
    words = {
        "model": str(model.resolve()),
        "images": [str(_written(rgb, folder / f"{k}.png")) for k, rgb in enumerate(pictures)],
        "imgsz": max(like.size) if is_rectangle else list(like.size),
        "min_score": like.settings.min_score,
        "max_overlap": like.settings.max_overlap,
        "rect": is_rectangle,
        "found": str(folder / "found.npz"),
    }
    answer = ask(interpreter, "predict", words, folder)
    if answer.get("task") != "segment":
        raise ModelError(f"is a model of task '{answer.get('task')}', not 'segment'", where=model)
    names = tuple(name for _, name in sorted(answer["names"].items(), key=lambda item: int(item[0])))
    with np.load(folder / "found.npz") as found:
        return [_answer(found, k, rgb, names, like) for k, rgb in enumerate(pictures)], names


# ------------------------------------------------------------------------------------------------ details


def _written(rgb: UInt8Array, path: Path) -> Path:
    import cv2

    bgr = np.ascontiguousarray(rgb[..., ::-1]) if rgb.ndim == 3 else rgb
    if not cv2.imwrite(str(path), bgr):
        raise ModelError("a picture cannot be written", where=path)
    return path


def _answer(found: Any, k: int, rgb: UInt8Array, names: tuple[str, ...], like: OnnxSegmenter) -> Answer:
    """The answer to one picture."""
    shape = rgb.shape[0], rgb.shape[1]
    boxes, scores, classes, masks = (found[f"{part}{k}"] for part in ("boxes", "scores", "classes", "masks"))
    things = []
    for box, score, number, small in zip(boxes, scores, classes, masks, strict=True):
        mask = image_mask(small, letterbox(shape, small.shape))
        things.append(Thing(names[int(number)], float(score), box.astype(np.float64), mask))
    named = (*names, BACKGROUND)
    return painted(things, named, like.settings.roles.of(named), shape)
