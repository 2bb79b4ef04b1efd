"""Scores and true classes of validation pixels -> how much to add to each class's score so that classes overlap best.

A network that learns rare classes with larger weights says them too often. What is added is a constant of the last layer, so
it costs nothing; it is found one class after the other (coordinate ascent) on pictures that were not learnt from.
"""

from __future__ import annotations

import numpy as np

from wallkit.core.types import Float32Array, Float64Array, UInt8Array
from wallkit.train.score import TOGETHER, confusion, scores_of

_STEPS = np.array([-1.2, -0.6, -0.3, -0.15, 0.15, 0.3, 0.6, 1.2])


def balancing(scores: Float32Array, truth: UInt8Array, names: tuple[str, ...], *, rounds: int = 3) -> Float64Array:
    """(C,) to add to scores (K, C) of pixels whose classes are (K,); pixels of no class are left out.

    What is highest afterwards is the mean intersection over union of the classes there are, and of classes together.
    """
    count = len(names)
    known = truth < count
    scores, truth = scores[known], truth[known]
    added = np.zeros(count)
    best = _mean(scores.argmax(axis=1).astype(np.uint8), truth, names)
    for _ in range(rounds):
        before = best
        for number in range(count):
            shifted = scores + added.astype(np.float32)
            own = shifted[:, number].copy()
            shifted[:, number] = -np.inf
            rival = shifted.argmax(axis=1)
            margin = own - np.take_along_axis(shifted, rival[:, None], axis=1)[:, 0]
            gains = []
            for step in _STEPS.tolist():
                predicted = np.where(margin + step > 0, number, rival).astype(np.uint8)
                gains.append(_mean(predicted, truth, names))
            if max(gains) > best:
                best = max(gains)
                added[number] += _STEPS[int(np.argmax(gains))]
        if best - before < 1e-4:
            break
    return added


def _mean(predicted: UInt8Array, truth: UInt8Array, names: tuple[str, ...]) -> float:
    found = scores_of(confusion(predicted, truth, len(names)), names)
    ious = [score.iou for score in found if score.pixels or score.name in TOGETHER]
    return float(np.nanmean(ious)) if ious else 0.0
