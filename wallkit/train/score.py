"""Classes of pixels as predicted and as they are -> how well each class is found (intersection over union, pooled)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from wallkit.core.types import Float64Array, Int64Array, UInt8Array

# classes that count as one, beside the classes themselves: to a LiDAR and a filter a panel is a wall
TOGETHER: Mapping[str, tuple[str, ...]] = {"wall + partition": ("wall", "partition")}


@dataclass(frozen=True)
class ClassScore:
    """Of one class, over all pixels of all pictures.

    Attributes:
        iou, precision, recall: in [0, 1]; NaN where nothing is of the class, neither truly nor as predicted.
        pixels: how many truly are.
    """

    name: str
    iou: float
    precision: float
    recall: float
    pixels: int


def confusion(predicted: UInt8Array, truth: UInt8Array, count: int) -> Int64Array:
    """(C, C) pixels by true class (rows) and predicted class; pixels whose truth is no class are left out."""
    known = truth < count
    pairs = truth[known].astype(np.int64) * count + predicted[known]
    return np.bincount(pairs, minlength=count * count).reshape(count, count)


def scores_of(matrix: Int64Array, names: Sequence[str]) -> tuple[ClassScore, ...]:
    """Of every class, and of classes together where the names have them all."""
    found = [_score(name, matrix, [number]) for number, name in enumerate(names)]
    for together, parts in TOGETHER.items():
        if all(part in names for part in parts):
            found.append(_score(together, matrix, [list(names).index(part) for part in parts]))
    return tuple(found)


def mean_iou(matrix: Int64Array) -> float:
    """Over the classes that are truly there."""
    ious = [_score("", matrix, [number]).iou for number in range(len(matrix)) if matrix[number].sum()]
    return float(np.mean(ious)) if ious else float("nan")


def pixel_accuracy(matrix: Int64Array) -> float:
    """Share of pixels whose class is right; NaN without pixels."""
    return _ratio(float(np.trace(matrix)), float(matrix.sum()))


def commonest_mistake(matrix: Int64Array, number: int) -> tuple[int, float]:
    """What a class is taken for most when it is not seen as itself, and the share of its pixels."""
    others: Float64Array = matrix[number].astype(np.float64)
    others[number] = 0
    worst = int(np.argmax(others))
    return worst, _ratio(float(others[worst]), float(matrix[number].sum()))


def _score(name: str, matrix: Int64Array, numbers: list[int]) -> ClassScore:
    both = float(matrix[np.ix_(numbers, numbers)].sum())
    true, said = float(matrix[numbers].sum()), float(matrix[:, numbers].sum())
    return ClassScore(name, _ratio(both, true + said - both), _ratio(both, said), _ratio(both, true), int(true))


def _ratio(part: float, whole: float) -> float:
    return part / whole if whole else float("nan")
