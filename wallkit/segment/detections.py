"""What a YOLO-seg head answers -> boxes with class, score and mask coefficients, each thing once.

The raw head ([1, 4 + classes + coefficients, anchors]: cx, cy, w, h, probabilities, coefficients) names every thing many
times, so overlapping boxes of a class are thinned; heads with that inside ([1, rows, 6 + coefficients]: x1, y1, x2, y2,
score, class, coefficients) have done it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from wallkit.core.types import Float32Array, Int64Array

# as Ultralytics' predict
_MOST = 300
_MOST_CANDIDATES = 30_000


@dataclass(frozen=True, eq=False)
class Detections:
    """Things found in the network's input, the surest first.

    Attributes:
        boxes: (D, 4) float32 edges x1, y1, x2, y2 [px of the input]. scores: (D,) float32 in [0, 1].
        labels: (D,) int64 class. coefficients: (D, M) float32 of the prototypes.
    """

    boxes: Float32Array
    scores: Float32Array
    labels: Int64Array
    coefficients: Float32Array

    def __len__(self) -> int:
        return len(self.scores)


def detections_from_anchors(
    answers: Float32Array, coefficients: int, *, min_score: float, max_overlap: float
) -> Detections:
    """Of a raw head's (4 + classes + coefficients, A)."""
    scores = answers[4 : len(answers) - coefficients]
    best = scores.max(axis=0)
    found = np.flatnonzero(best > min_score)
    found = found[np.argsort(-best[found], kind="stable")[:_MOST_CANDIDATES]]
    labels = scores[:, found].argmax(axis=0)
    centres, halves = answers[:2, found], answers[2:4, found] / 2
    boxes = np.ascontiguousarray(np.concatenate([centres - halves, centres + halves]).T)
    kept = thinned(boxes, labels, max_overlap, _MOST)
    chosen = found[kept]
    return Detections(boxes[kept], best[chosen], labels[kept], np.ascontiguousarray(answers[-coefficients:, chosen].T))


def detections_from_rows(rows: Float32Array, *, min_score: float) -> Detections:
    """Of a thinned head's (R, 6 + coefficients), whose last rows are empty."""
    rows = rows[rows[:, 4] > min_score]
    rows = rows[np.argsort(-rows[:, 4], kind="stable")[:_MOST]]
    boxes, coefficients = np.ascontiguousarray(rows[:, :4]), np.ascontiguousarray(rows[:, 6:])
    return Detections(boxes, rows[:, 4], np.rint(rows[:, 5]).astype(np.int64), coefficients)


@njit(cache=True, nogil=True)
def thinned(boxes: Float32Array, labels: Int64Array, max_overlap: float, most: int) -> Int64Array:
    """Places of the boxes (B, 4), surest first, that no surer one of their class overlaps by more than an IoU."""
    kept = np.empty(min(most, len(boxes)), dtype=np.int64)
    count = 0
    for i in range(len(boxes)):
        area = max(boxes[i, 2] - boxes[i, 0], 0) * max(boxes[i, 3] - boxes[i, 1], 0)
        is_new = True
        for k in range(count):
            j = kept[k]
            if labels[i] != labels[j]:
                continue
            width = min(boxes[i, 2], boxes[j, 2]) - max(boxes[i, 0], boxes[j, 0])
            height = min(boxes[i, 3], boxes[j, 3]) - max(boxes[i, 1], boxes[j, 1])
            if width <= 0 or height <= 0:
                continue
            other = (boxes[j, 2] - boxes[j, 0]) * (boxes[j, 3] - boxes[j, 1])
            if width * height > max_overlap * (area + other - width * height):
                is_new = False
                break
        if is_new:
            kept[count] = i
            count += 1
            if count == len(kept):
                break
    return kept[:count]
