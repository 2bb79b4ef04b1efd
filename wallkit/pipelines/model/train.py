"""Training sets -> wallkit's own network, trained by PyTorch: an ONNX file, its curves, scores and pictures of its masks."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import wallkit
from wallkit.dataset.read import TrainingSet, pairs_of, read_pair, read_training_sets
from wallkit.errors import ModelError
from wallkit.pipelines.model.evaluate import Judged, evaluate_model
from wallkit.pipelines.outputs import check_out, put_in_place
from wallkit.pipelines.run_folder import write_json
from wallkit.pipelines.unfinished import Unfinished, unfinished_of
from wallkit.train.curves import Epoch, csv_of, draw_curves
from wallkit.train.pictures import Pictures, stacked
from wallkit.train.score import ClassScore, scores_of

if TYPE_CHECKING:
    from wallkit.train.learn import Lesson

LICENCE = "Apache-2.0"
_MULTIPLE = 16
# of the epochs that are done, beside the results to be
_CHECKPOINT = "checkpoint.pt"


@dataclass(frozen=True)
class TrainRequest:
    """What to train on, and how; None takes the default of `train.learn.Lesson`.

    Attributes:
        datasets: folders whose classes agree. size: width, height of the network's input.
    """

    datasets: tuple[Path, ...]
    size: tuple[int, int] = (256, 192)
    epochs: int | None = None
    batch: int | None = None
    rate: float | None = None
    threads: int = 1
    seed: int = 0


@dataclass(frozen=True)
class Trained:
    """What was written. resumed: epochs that an interrupted run had done."""

    model: Path
    epochs: tuple[Epoch, ...]
    judged: Judged
    size_bytes: int
    parameters: int
    resumed: int


def train_model(
    request: TrainRequest, out: Path, *, overwrite: bool = False, told: Callable[[Epoch, int], None] = lambda *_: None
) -> Trained:
    """A folder with model.onnx, curves.csv and .png, scores.json, masks.png and run.json.

    A run that is interrupted goes on after its last whole epoch when it is started again, on as many threads as one likes.

    Args:
        told: hears of every epoch that is done, and of how many there will be.

    Raises:
        OutputError, DatasetError: see check_request. ModelError: PyTorch or onnx is not installed.
    """
    sets = check_request(request, out, overwrite=overwrite)
    lesson = lesson_of(request)
    from wallkit.train.export import export_onnx
    from wallkit.train.learn import learn
    from wallkit.train.network import parameters_of

    names = sets[0].names
    width, height = request.size
    # a quarter larger than the network sees them, so that closer looks are sharp
    train = _pictures(sets, "train", (width + width // 4, height + height // 4))
    val = _pictures(sets, "val", request.size)
    fingerprint = _fingerprint(sets, lesson)
    unfinished = _unfinished(out)
    unfinished.open(fingerprint)
    working, checkpoint = unfinished.folder, unfinished.folder / _CHECKPOINT
    fresh: list[int] = []

    def hear(epoch: Epoch) -> None:
        fresh.append(epoch.number)
        told(epoch, lesson.epochs)

    with unfinished.kept_if_begun():
        learnt = learn(train, val, names, lesson, checkpoint, told=hear)
    parameters = parameters_of(learnt.net)
    about = _about(sets, scores_of(learnt.matrix, names), parameters)
    exported = export_onnx(learnt.net, names, lesson.size, working / "model.onnx", about=about)
    judged = evaluate_model(working / "model.onnx", sets, "val", sheet=working / "masks.png")
    (working / "curves.csv").write_text(csv_of(learnt.epochs), encoding="utf-8")
    pictures = f"{len(train)} pictures, {len(val)} of other scenes for validation"
    draw_curves(learnt.epochs, working / "curves.png", title=f"{parameters / 1e6:.2f} M parameters on {pictures}")
    write_json(working / "scores.json", {"schema": 1, **judged.document})
    balanced = dict(zip(names, learnt.added.round(3).tolist(), strict=True))
    record = {
        "schema": 1,
        "command": "model train",
        **fingerprint,
        "threads": lesson.threads,
        "added_to_scores": balanced,
        "export": asdict(exported),
    }
    write_json(working / "run.json", record)
    unfinished.close()
    put_in_place(working, out)
    resumed = lesson.epochs - len(fresh)
    return Trained(out / "model.onnx", learnt.epochs, judged, exported.size_bytes, parameters, resumed)


def check_request(request: TrainRequest, out: Path, *, overwrite: bool) -> tuple[TrainingSet, ...]:
    """The training sets; refuses what cannot be done before anything is.

    Raises:
        OutputError: `out` cannot be used, or an interrupted training of other settings is there.
        ModelError: PyTorch or onnx is not installed, or settings that are none.
        DatasetError: a set cannot be read, has no pictures for validation, or its classes are not those of the first.
    """
    check_out(out, overwrite=overwrite)
    for side in request.size:
        if side % _MULTIPLE or not 64 <= side <= 1280:
            width, height = request.size
            hint = f"--size 256x192; sides are multiples of {_MULTIPLE} from 64 to 1280"
            raise ModelError(f"a network for pictures of {width} x {height}", hint=hint)
    if request.rate is not None and not 0 < request.rate <= 1:
        raise ModelError(f"a learning rate of {request.rate:g}", hint="--rate 0.003; above 0, at most 1")
    sets = read_training_sets(request.datasets)
    check_libraries()
    if (unfinished := _unfinished(out)).has_begun:
        unfinished.check(_fingerprint(sets, lesson_of(request)), overwrite=overwrite)
    return sets


def check_libraries() -> None:
    """Refuse to start without PyTorch.

    Raises:
        ModelError: it, or onnx, is not installed.
    """
    from importlib.util import find_spec

    missing = [name for name in ("torch", "onnx") if find_spec(name) is None]
    if missing:
        cpu = "pip install torch --index-url https://download.pytorch.org/whl/cpu"
        hint = f"pip install 'wallkit[train]'   (no GPU? first {cpu}: a tenth of the size)"
        raise ModelError(f"training needs {' and '.join(missing)}, not installed here", hint=hint)


def lesson_of(request: TrainRequest) -> Lesson:
    """The request as settings of the training."""
    from wallkit.train.learn import Lesson

    asked = {"epochs": request.epochs, "batch": request.batch, "rate": request.rate}
    given: dict[str, Any] = {name: value for name, value in asked.items() if value is not None}
    return replace(Lesson(), size=request.size, threads=request.threads, seed=request.seed, **given)


# -------------------------------------------------------------------------------------------- details


def _unfinished(out: Path) -> Unfinished:
    return unfinished_of(out, "training", _CHECKPOINT)


def _pictures(sets: tuple[TrainingSet, ...], split: str, size: tuple[int, int]) -> Pictures:
    return stacked((read_pair(pair, len(sets[0].names)) for pair in pairs_of(sets, split)), size)


def _about(sets: tuple[TrainingSet, ...], scores: tuple[ClassScore, ...], parameters: int) -> dict[str, str]:
    """What the file says of itself."""
    kinds = sorted({one.kind for one in sets})
    shown = {score.name: round(score.iou, 3) for score in scores if score.iou == score.iou}
    return {
        "description": f"wallkit's own semantic network, {parameters} parameters, trained on {' and '.join(kinds)} pictures",
        "author": "wallkit",
        "version": wallkit.__version__,
        "license": LICENCE,
        "datasets": repr([one.sha256 for one in sets]),
        "validation_iou": repr(shown),
    }


def _fingerprint(sets: tuple[TrainingSet, ...], lesson: Lesson) -> dict[str, Any]:
    """Everything that decides what is learnt, but for the machine and its threads."""
    import torch

    plain = {
        "wallkit": wallkit.__version__,
        "torch": torch.__version__,
        "datasets": [{"folder": one.folder.name, "manifest_sha256": one.sha256} for one in sets],
        "names": list(sets[0].names),
        "lesson": {key: value for key, value in asdict(lesson).items() if key != "threads"},
    }
    return dict(json.loads(json.dumps(plain)))
