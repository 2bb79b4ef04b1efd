"""A frame -> the scan that filters and sensor models work on: every return counts, and carries the label of its beam."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from wallkit.core.types import Frame, LabelledScan

_NOBODY, _NOTHING = np.zeros(0, dtype=np.float32), np.zeros((0, 0), dtype=np.float32)


def labelled_scan(frame: Frame) -> LabelledScan:
    """The frame's returns with weight 1, and with the labels of their beams where the frame has any."""
    points = frame.points
    weights = np.ones(len(points.ranges_m), dtype=np.float32)
    given = frame.labels
    if given is None:
        return LabelledScan(points, weights)
    if not len(given.labels):
        return LabelledScan(points, weights)
    count, classes = len(points.beams), 0 if given.shares is None else given.shares.shape[1]
    labels = np.empty(count, dtype=np.int64)
    sure = np.empty(0 if given.confidences is None else count, dtype=np.float32)
    shares = np.empty((count if classes else 0, classes), dtype=np.float32)
    # of beams: (B,) and (B, C), empty where nobody says
    of_beams = _NOBODY if given.confidences is None else np.asarray(given.confidences, dtype=np.float32)
    shown = _NOTHING if given.shares is None else np.asarray(given.shares, dtype=np.float32)
    _gather(points.beams, given.labels, of_beams, shown, labels, sure, shares)
    confidences = None if given.confidences is None else sure
    return LabelledScan(points, weights, labels, given.classes, confidences, None if given.shares is None else shares)


@njit(cache=True, nogil=True)
def _gather(beams: Any, given: Any, of_beams: Any, shown: Any, labels: Any, sure: Any, shares: Any) -> None:
    """From beams (B,) to returns (K,); a beam beyond the last is unknown."""
    for k in range(len(beams)):
        beam = beams[k]
        known = beam < len(given)
        labels[k] = given[beam] if known else -1
        if len(sure):
            sure[k] = of_beams[beam] if known else 0.0
        for c in range(shares.shape[1]):
            shares[k, c] = shown[beam, c] if known else 0.0
