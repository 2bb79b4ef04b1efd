"""A training set -> a YOLO-seg model, trained by another interpreter that has Ultralytics; nothing of it is imported here.

Ultralytics, and every model made with it, is AGPL-3.0: it runs as a child process with plain arguments and leaves files.
"""

from __future__ import annotations

import csv
import io
import json
import os
import subprocess
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

from wallkit.errors import ModelError
from wallkit.train.curves import Epoch

# offline, and without changing the environment it runs in
ENVIRONMENT: Mapping[str, str] = {"YOLO_OFFLINE": "1", "YOLO_AUTOINSTALL": "0", "YOLO_VERBOSE": "True"}
SETUP_HINT = "`wallkit model export --print-setup` prints the commands that make one"

# beside a PyTorch for the CPU the usual torchvision cannot load its own operators; training needs one of them
_CHILD = """
import json, sys, torch
try:
    import torchvision
except Exception:
    defs = torch.library.Library("torchvision", "DEF")
    defs.define("nms(Tensor dets, Tensor scores, float iou_threshold) -> Tensor")
    defs.define("qnms(Tensor dets, Tensor scores, float iou_threshold) -> Tensor")

    def nms(dets, scores, threshold):
        order = scores.argsort(descending=True, stable=True)
        boxes = dets[order]
        area = (boxes[:, 2] - boxes[:, 0]).clamp(min=0) * (boxes[:, 3] - boxes[:, 1]).clamp(min=0)
        alive = torch.ones(len(boxes), dtype=torch.bool)
        kept = []
        for i in range(len(boxes)):
            if not alive[i]:
                continue
            kept.append(i)
            low = torch.maximum(boxes[i, :2], boxes[i + 1 :, :2])
            high = torch.minimum(boxes[i, 2:], boxes[i + 1 :, 2:])
            sides = (high - low).clamp(min=0)
            both = sides[:, 0] * sides[:, 1]
            alive[i + 1 :] &= ~(both / (area[i] + area[i + 1 :] - both) > threshold)
        return order[torch.tensor(kept, dtype=torch.long)]

    defs.impl("nms", nms, "CPU")
    for name in [n for n in sys.modules if n.startswith("torchvision")]:
        del sys.modules[name]
    import torchvision
    import torchvision.extension
    torchvision.extension._has_ops = lambda: True
from ultralytics import YOLO
asked = json.loads(sys.argv[1])
torch.set_num_threads(asked["threads"])
model = YOLO(asked["start"])
model.train(
    data=asked["data"], imgsz=asked["imgsz"], epochs=asked["epochs"], batch=asked["batch"], seed=asked["seed"],
    project=asked["folder"], name="train", exist_ok=True, device="cpu", workers=0, plots=False, amp=False,
    deterministic=True,
)
best = YOLO(str(model.trainer.best))
print("exported", best.export(format="onnx", imgsz=asked["export_size"]))
"""


@dataclass(frozen=True)
class YoloLesson:
    """What the child is asked for.

    Attributes:
        start: a checkpoint, or a model's .yaml to begin from nothing. size: width, height of the exported network.
        is_trusting: checkpoints are pickles, which can run anything; else only plain weights are loaded.
    """

    start: str = "yolov8n-seg.yaml"
    epochs: int = 50
    batch: int = 16
    size: tuple[int, int] = (320, 256)
    threads: int = 1
    seed: int = 0
    is_trusting: bool = False


def command(python: str, data: Path, folder: Path, lesson: YoloLesson) -> list[str]:
    """The child's command line: an interpreter, a program, and one JSON argument."""
    width, height = lesson.size
    asked = {key: value for key, value in asdict(lesson).items() if key not in ("size", "is_trusting")}
    places = {"data": str(data.absolute()), "folder": str(folder.absolute())}
    sizes = {"imgsz": max(width, height), "export_size": [height, width]}
    return [python, "-c", _CHILD, json.dumps({**asked, **places, **sizes})]


def environment(lesson: YoloLesson) -> dict[str, str]:
    """The child's: offline, installing nothing, and loading only weights unless the checkpoint is trusted."""
    return {**os.environ, **ENVIRONMENT, "ULTRALYTICS_SAFE_LOAD": "0" if lesson.is_trusting else "1"}


def train_yolo(
    python: str, data: Path, folder: Path, lesson: YoloLesson, *, told: Callable[[str], None] = lambda _: None
) -> tuple[Path, Path]:
    """best.pt and best.onnx of a training in `folder`.

    Args:
        told: hears every line that the child says.

    Raises:
        ModelError: the interpreter cannot be started, has no Ultralytics, or the training fails.
    """
    try:
        child = subprocess.Popen(
            command(python, data, folder, lesson), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
            env=environment(lesson), errors="replace",
        )  # fmt: skip
    except OSError as error:
        raise ModelError(f"cannot be started ({error.strerror})", where=python, hint=SETUP_HINT) from error
    lines: list[str] = []
    assert child.stdout is not None
    with child:
        try:
            for line in child.stdout:
                lines = [*lines[-30:], line.rstrip()]
                told(line.rstrip())
        except BaseException:
            child.terminate()
            raise
    if child.returncode:
        raise _failure(python, child.returncode, lines)
    found = folder / "train" / "weights" / "best.pt", folder / "train" / "weights" / "best.onnx"
    for path in found:
        if not path.is_file():
            raise ModelError(f"training left no {path.name}", where=folder, hint="\n".join(lines[-8:]))
    return found


def epochs_of(results: str) -> tuple[Epoch, ...]:
    """The epochs of Ultralytics' results.csv: its losses added up, mask mAP50-95 in the place of the mean overlap.

    Raises:
        ModelError: it is no such table.
    """
    rows = [{key.strip(): value for key, value in row.items()} for row in csv.DictReader(io.StringIO(results))]
    if not rows or "epoch" not in rows[0]:
        raise ModelError("this is no results.csv of Ultralytics", hint="train with Ultralytics 8.4.100 or later")
    return tuple(_epoch(row) for row in rows)


def _failure(python: str, code: int, lines: list[str]) -> ModelError:
    if any("No module named 'ultralytics'" in line for line in lines):
        return ModelError("has no Ultralytics", where=python, hint=SETUP_HINT)
    hint = "the lines above are the child's own"
    if any(word in line for word in ("weights_only", "SAFE_LOAD", "UnpicklingError") for line in lines):
        hint = "the checkpoint holds more than weights; if you know who made it, pass --trust"
    return ModelError(f"training ended with {code}: " + "\n".join(lines[-8:]), where=python, hint=hint)


def _epoch(row: Mapping[str, str]) -> Epoch:
    losses = {
        part: sum(float(v) for k, v in row.items() if k.startswith(part) and "loss" in k) for part in ("train", "val")
    }
    fifty, mean = (float(row.get(f"metrics/{name}(M)", "nan")) for name in ("mAP50", "mAP50-95"))
    rate = float(row.get("lr/pg0", "nan"))
    return Epoch(int(float(row["epoch"])), losses["train"], losses["val"], mean, rate, 0, {"mask mAP50": fifty})
