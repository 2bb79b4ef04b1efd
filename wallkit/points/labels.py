"""A frame -> the scan that filters and sensor models work on: every return counts, and carries the label of its beam.

What cameras say about the returns becomes labels of beams on the way, as a simulator's labels are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numba import njit

from wallkit.core.types import BeamLabels, Frame, LabelledScan
from wallkit.points.look import Look

# why a return of a thinned scan is left out
PASSED_OVER = "passed over"
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


def labels_by_beam(frame: Frame, looks: Sequence[Look], classes: tuple[str, ...]) -> BeamLabels | None:
    """What several cameras say about a frame; where two see a return, the one that knows better where it landed counts.

    None without any.
    """
    if not looks:
        return None
    beams = frame.points.beams
    count = int(beams.max()) + 1 if len(beams) else 0
    labels, sure = np.full(count, -1), np.zeros(count, dtype=np.float32)
    shares, best = np.zeros((count, len(classes)), dtype=np.float32), np.full(count, np.inf)
    for found in looks:
        _merge(beams, found.labels, found.confidences, found.shares, found.margins_px, labels, sure, shares, best)
    return BeamLabels(frame.stamp_ns, labels, classes, sure, shares)


def thinned(frame: Frame, count: int) -> Frame:
    """The frame with at most `count` returns, spread evenly over the sweep; 0: with all of them."""
    points = frame.points
    total = len(points.ranges_m)
    if not count or total <= count:
        return frame
    at = np.arange(count) * total // count
    fewer = replace(
        points,
        xyz_m=points.xyz_m.take(at, axis=0),
        ranges_m=points.ranges_m.take(at),
        beams=points.beams.take(at),
        offsets_s=None if points.offsets_s is None else points.offsets_s.take(at),
        dropped={**points.dropped, PASSED_OVER: total - count},
    )
    return replace(frame, points=fewer)


@njit(cache=True, nogil=True)
def _merge(
    beams: Any, found: Any, sureness: Any, shown: Any, margins: Any, labels: Any, sure: Any, shares: Any, best: Any
) -> None:
    """One camera's returns (K,) into what is known of beams (B,), where it knows better than those before."""
    for k in range(len(beams)):
        beam = beams[k]
        if found[k] >= 0 and margins[k] < best[beam]:
            labels[beam], sure[beam], best[beam] = found[k], sureness[k], margins[k]
            shares[beam] = shown[k]


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
