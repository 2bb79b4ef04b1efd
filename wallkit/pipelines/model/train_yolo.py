"""A training set -> a YOLO-seg model and its curves, by an interpreter that has Ultralytics."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from wallkit.dataset.read import TrainingSet, folders_of, read_training_sets
from wallkit.pipelines.outputs import check_out, result_folder
from wallkit.pipelines.run_folder import sha256, write_json
from wallkit.segment.child import Interpreter, find_interpreter
from wallkit.train.curves import Epoch, csv_of, draw_curves
from wallkit.train.yolo import YoloLesson, epochs_of, train_yolo

# what YOLO's grids need of a picture's sides
_MULTIPLE = 32


@dataclass(frozen=True)
class YoloRequest:
    """What to train on, and from which start; None takes the default of `YoloLesson`.

    Attributes:
        python: the interpreter with Ultralytics; None for the one that `find_interpreter` knows.
        is_trusting: whether the checkpoint may run anything.
    """

    datasets: tuple[Path, ...]
    python: Path | None
    start: str
    size: tuple[int, int] = (320, 256)
    epochs: int | None = None
    batch: int | None = None
    threads: int = 1
    seed: int = 0
    is_trusting: bool = False

    @property
    def lesson(self) -> YoloLesson:
        """As the child is asked; sides rounded up to what YOLO takes."""
        width, height = (-(-side // _MULTIPLE) * _MULTIPLE for side in self.size)
        usual = YoloLesson()
        epochs, batch = self.epochs or usual.epochs, self.batch or usual.batch
        return YoloLesson(self.start, epochs, batch, (width, height), self.threads, self.seed, self.is_trusting)


@dataclass(frozen=True)
class YoloTrained:
    """model: the ONNX file; the checkpoint lies beside it as .pt."""

    model: Path
    epochs: tuple[Epoch, ...]


def train_yolo_model(
    request: YoloRequest, out: Path, *, overwrite: bool = False, told: Callable[[str], None] = lambda _: None
) -> YoloTrained:
    """A folder with model.onnx, model.pt, curves.csv, curves.png and run.json.

    Raises:
        OutputError, DatasetError: see check_yolo. ModelError: the child cannot train.
    """
    interpreter, sets = check_yolo(request, out, overwrite=overwrite)
    names = " and ".join(one.folder.name for one in sets)
    with result_folder(out, overwrite=overwrite) as folder:
        python = str(interpreter.python)
        checkpoint, onnx = train_yolo(python, _data(sets, folder), folder, request.lesson, told=told)
        results = (folder / "train" / "results.csv").read_text("utf-8")
        shutil.copy(onnx, folder / "model.onnx")
        shutil.copy(checkpoint, folder / "model.pt")
        epochs = epochs_of(results)
        (folder / "curves.csv").write_text(csv_of(epochs), encoding="utf-8")
        words = {"measure": "average precision of masks", "mean_label": "mAP50-95"}
        draw_curves(epochs, folder / "curves.png", title=f"{request.start} on {names}", **words)
        (folder / "data.yaml").unlink()
        shutil.rmtree(folder / "train")
        record = {
            "schema": 1,
            "command": "model train",
            "licence": "AGPL-3.0",
            "start": request.start,
            "datasets": [{"folder": one.folder.name, "manifest_sha256": one.sha256} for one in sets],
            "sha256": sha256(folder / "model.onnx"),
        }
        write_json(folder / "run.json", record)
    return YoloTrained(out / "model.onnx", epochs)


def check_yolo(request: YoloRequest, out: Path, *, overwrite: bool) -> tuple[Interpreter, tuple[TrainingSet, ...]]:
    """Who trains on which sets; refuses what cannot be done before anything is.

    Raises:
        OutputError: `out` cannot be used. DatasetError: a set cannot be read, or has other classes.
        ModelError: no interpreter.
    """
    check_out(out, overwrite=overwrite)
    interpreter = find_interpreter(request.python, is_trusting=request.is_trusting)
    return interpreter, read_training_sets(request.datasets)


def _data(sets: tuple[TrainingSet, ...], folder: Path) -> Path:
    """A data.yaml with whole paths: Ultralytics takes relative ones from a folder of its own."""
    lines = ["names:", *(f"  {number}: {name}" for number, name in enumerate(sets[0].names))]
    for split in ("train", "val"):
        lines += [f"{split}:", *(f"  - {place}" for place in folders_of(sets, split))]
    path = folder / "data.yaml"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path
