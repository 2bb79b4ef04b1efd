"""Run by ANOTHER interpreter, one that has Ultralytics: `python child_script.py request.json`; never imported by wallkit.

Ultralytics is AGPL-3.0. wallkit neither imports nor ships it: what a user has installed elsewhere is asked by a file of
plain words, and answers with files. This script knows nothing of wallkit and runs under any Python from 3.8 on.
"""

from __future__ import annotations

import contextlib
import importlib
import json
import os
import sys
from typing import Any

_KEPT: list[Any] = []


def main(path: str) -> None:
    with open(path, encoding="utf-8") as file:
        request = json.load(file)
    repair_torchvision()
    answer = {"export": export, "predict": predict}[request["action"]](request)
    answer["versions"] = versions()
    with open(request["answer"], "w", encoding="utf-8") as file:
        json.dump(answer, file)


def export(request: Any) -> Any:
    """Checkpoint -> ONNX, beside the checkpoint."""
    model = yolo()(request["model"])
    before = {"task": model.task}
    written = model.export(format="onnx", imgsz=request["imgsz"], **request["arguments"])
    return {"file": os.path.abspath(str(written)), **before}


def predict(request: Any) -> Any:
    """What a checkpoint finds in pictures -> an .npz with, by number of the picture, boxes, scores, classes and masks."""
    numpy = importlib.import_module("numpy")
    model = yolo()(request["model"])
    found = {}
    for number, image in enumerate(request["images"]):
        (result,) = model.predict(
            image,
            imgsz=request["imgsz"],
            conf=request["min_score"],
            iou=request["max_overlap"],
            rect=request["rect"],
            device="cpu",
            verbose=False,
            save=False,
        )
        found[f"boxes{number}"] = result.boxes.xyxy.cpu().numpy()
        found[f"scores{number}"] = result.boxes.conf.cpu().numpy()
        found[f"classes{number}"] = result.boxes.cls.cpu().numpy()
        masks = result.masks
        found[f"masks{number}"] = numpy.zeros((0, 1, 1), bool) if masks is None else masks.data.cpu().numpy() > 0
    numpy.savez_compressed(request["found"], **found)
    return {"names": {str(key): name for key, name in model.names.items()}, "task": model.task}


def yolo() -> Any:
    return importlib.import_module("ultralytics").YOLO


def versions() -> Any:
    metadata = importlib.import_module("importlib.metadata")
    found = {"python": sys.version.split()[0]}
    for name in ("ultralytics", "torch", "onnx", "onnxslim", "torchvision"):
        with contextlib.suppress(metadata.PackageNotFoundError):
            found[name] = metadata.version(name)
    return found


def repair_torchvision() -> None:
    """Beside a PyTorch without CUDA, PyPI's torchvision lacks its compiled part; of that only `nms` is needed here.

    The schemas are torchvision's (BSD-3-Clause); the kernel is the plain algorithm.
    """
    torch = importlib.import_module("torch")
    try:
        importlib.import_module("torchvision")
        return
    except (ImportError, RuntimeError, OSError):
        for name in [n for n in sys.modules if n.split(".")[0] == "torchvision"]:
            del sys.modules[name]
    try:
        library = torch.library.Library("torchvision", "DEF")
        library.define("nms(Tensor dets, Tensor scores, float iou_threshold) -> Tensor")
        library.define("qnms(Tensor dets, Tensor scores, float iou_threshold) -> Tensor")
        library.impl("nms", nms, "CPU")
        # it unregisters what it defined when it goes
        _KEPT.append(library)
        importlib.import_module("torchvision")
        extension: Any = importlib.import_module("torchvision.extension")
        extension._has_ops = lambda: True
    except (ImportError, RuntimeError, OSError):
        # an export without NMS inside needs none of it
        pass


def nms(boxes: Any, scores: Any, limit: float) -> Any:
    torch = importlib.import_module("torch")
    order = scores.argsort(descending=True, stable=True)
    b = boxes[order]
    area = (b[:, 2] - b[:, 0]).clamp(min=0) * (b[:, 3] - b[:, 1]).clamp(min=0)
    alive = torch.ones(len(b), dtype=torch.bool)
    kept = []
    for i in range(len(b)):
        if not alive[i]:
            continue
        kept.append(i)
        low = torch.maximum(b[i, :2], b[i + 1 :, :2])
        high = torch.minimum(b[i, 2:], b[i + 1 :, 2:])
        size = (high - low).clamp(min=0)
        both = size[:, 0] * size[:, 1]
        alive[i + 1 :] &= ~(both / (area[i] + area[i + 1 :] - both) > limit)
    return order[torch.tensor(kept, dtype=torch.long)]


if __name__ == "__main__":
    main(sys.argv[1])
