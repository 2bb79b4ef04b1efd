"""A segmentation model and a training set -> how well each class is found, pixel by pixel."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wallkit.core.types import Int64Array, UInt8Array
from wallkit.dataset.classes import LabelSet
from wallkit.dataset.read import TrainingSet, pairs_of, read_pair
from wallkit.dataset.sheet import Tile, contact_sheet
from wallkit.errors import ModelError, closest
from wallkit.pipelines.outputs import write_whole
from wallkit.segment.onnx_segmenter import OnnxSegmenter, load_segmenter
from wallkit.segment.roles import OTHER, Roles
from wallkit.segment.settings import SegmentSettings
from wallkit.train.score import ClassScore, commonest_mistake, confusion, mean_iou, pixel_accuracy, scores_of

# what the model says of a pixel when none of its classes is one of the set's
NOTHING = "nothing"


@dataclass(frozen=True, eq=False)
class Judged:
    """What came out.

    Attributes:
        names: of the set. matrix: (C + 1, C + 1) pixels by true and predicted class, NOTHING last.
        scores: of every class, and of classes together. without: classes of the set that the model does not have.
        ms: median time per picture, all of it, and of the network alone, by the processor's clock.
    """

    names: tuple[str, ...]
    matrix: Int64Array
    scores: tuple[ClassScore, ...]
    pictures: int
    without: tuple[str, ...]
    ms: tuple[float, float]

    def short_of(self, least: Mapping[str, float]) -> dict[str, tuple[float, float]]:
        """Of classes that are found less well than asked for, how well they are, and were to be.

        Raises:
            ModelError: the set has no such class.
        """
        ious = {score.name: score.iou for score in self.scores}
        for name in least:
            if name not in ious:
                raise ModelError(f"'{name}' is no class of the set", where="--require", hint=closest(name, ious))
        return {name: (ious[name], wanted) for name, wanted in least.items() if not ious[name] >= wanted}

    @property
    def document(self) -> dict[str, Any]:
        """As --json and scores.json have it."""
        known = self.matrix[:-1]
        mistakes = {}
        for number, name in enumerate(self.names):
            worst, share = commonest_mistake(known, number)
            mistakes[name] = {"as": (*self.names, NOTHING)[worst], "share": share} if share > 0 else None
        return {
            "pictures": self.pictures,
            "mean_iou": mean_iou(self.matrix),
            "pixel_accuracy": pixel_accuracy(self.matrix),
            "classes": {
                score.name: {
                    "iou": score.iou,
                    "precision": score.precision,
                    "recall": score.recall,
                    "pixels": score.pixels,
                    "mistaken": mistakes.get(score.name),
                }
                for score in self.scores
            },
            "without": list(self.without),
            "ms_per_picture": {"all": self.ms[0], "network": self.ms[1]},
        }


def evaluate_model(
    model: Path,
    sets: Sequence[TrainingSet],
    split: str,
    settings: SegmentSettings | None = None,
    *,
    sheet: Path | None = None,
    progress: Callable[[int], None] = lambda _: None,
) -> Judged:
    """Runs the model on every picture of a part of training sets whose classes agree, pooled.

    Classes are matched by name, else by what they count as; so a model with other words can be judged.

    Args:
        sheet: where a PNG of some pictures goes, each with its labels beside the model's.

    Raises:
        ModelError: it cannot be used, or shares no class with the sets. DatasetError: a picture cannot be read.
    """
    names = sets[0].names
    pairs = pairs_of(sets, split)
    segmenter = load_segmenter(model, settings)
    table, without = matched(segmenter, names)
    count = len(names)
    matrix = np.zeros((count + 1, count + 1), dtype=np.int64)
    shown = set(np.linspace(0, len(pairs) - 1, min(len(pairs), 18)).round().astype(int).tolist()) if sheet else set()
    tiles, times = [], []
    for number, pair in enumerate(pairs):
        image, truth = read_pair(pair, count)
        begun = time.process_time()
        frame = segmenter.frame(image)
        blob = segmenter.prepared(image, frame)
        ready = time.process_time()
        answers = segmenter.answers(blob)
        ran = time.process_time()
        predicted = table[segmenter.read(answers, frame).labels()]
        times.append((time.process_time() - begun, ran - ready))
        matrix += confusion(predicted, np.where(truth < count, truth, 255), count + 1)
        if number in shown:
            tiles += [Tile(image, f"{pair[0].stem}  labels", truth), Tile(image, "model", _palette(predicted, count))]
        progress(number + 1)
    if sheet is not None:
        title = f"{model.name} on {' and '.join(one.folder.name for one in sets)}"
        write_whole(sheet, contact_sheet(tiles, LabelSet(names=names), title=title))
    total, network = (np.median(np.array(times), axis=0) * 1e3).round(2).tolist()
    return Judged(names, matrix, _scores(matrix, names), len(pairs), without, (total, network))


def minimum_of(text: str) -> tuple[str, float]:
    """A class and how well it must be found, of `wall=0.85`.

    Raises:
        ModelError: it is no such text.
    """
    name, _, number = text.rpartition("=")
    try:
        least = float(number)
    except ValueError:
        least = float("nan")
    if not name or not 0 <= least <= 1:
        raise ModelError(f"'{text}' is no demand", where="--require", hint='write "wall=0.85", an IoU from 0 to 1')
    return name.strip(), least


def matched(segmenter: OnnxSegmenter, names: Sequence[str]) -> tuple[UInt8Array, tuple[str, ...]]:
    """Of every class of the model the number in the set, len(names) for none; and the set's classes that it lacks.

    Raises:
        ModelError: not one is matched.
    """
    roles = list(Roles().of(names))
    own = {name: number for number, name in enumerate(names)}
    table = np.full(len(segmenter.names) + 1, len(names), dtype=np.uint8)
    for number, (name, role) in enumerate(zip(segmenter.names, segmenter.roles, strict=True)):
        if name in own:
            table[number] = own[name]
        elif role in roles and role != OTHER:
            table[number] = roles.index(role)
    without = tuple(name for number, name in enumerate(names) if number not in table)
    if len(without) == len(names):
        said = f"none of its classes ({', '.join(segmenter.names[:8])}) is one of the set's ({', '.join(names)})"
        raise ModelError(
            said, where=segmenter.model.path, hint='say what counts as what: --set segment.roles.wall=["NAME"]'
        )
    return table, without


def _scores(matrix: Int64Array, names: tuple[str, ...]) -> tuple[ClassScore, ...]:
    return tuple(score for score in scores_of(matrix, (*names, NOTHING)) if score.name != NOTHING)


def _palette(predicted: UInt8Array, count: int) -> UInt8Array:
    return np.where(predicted < count, predicted, 255).astype(np.uint8)
