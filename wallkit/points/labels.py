"""A frame -> the scan that filters and sensor models work on: every return counts, and carries the label of its beam."""

from __future__ import annotations

import numpy as np

from wallkit.core.types import Frame, LabelledScan


def labelled_scan(frame: Frame) -> LabelledScan:
    """The frame's returns with weight 1, and with the labels of their beams where the frame has any."""
    points = frame.points
    weights = np.ones(len(points.ranges_m), dtype=np.float32)
    given = frame.labels
    if given is None:
        return LabelledScan(points, weights)
    if not len(given.labels):
        return LabelledScan(points, weights)
    known = points.beams < len(given.labels)
    if known.all():
        sure = None if given.confidences is None else given.confidences[points.beams].astype(np.float32, copy=False)
        shares = None if given.shares is None else given.shares[points.beams]
        return LabelledScan(points, weights, given.labels[points.beams], given.classes, sure, shares)
    beams = np.where(known, points.beams, 0)
    labels = np.where(known, given.labels[beams], -1)
    confidences = None if given.confidences is None else given.confidences[beams].astype(np.float32)
    shares = None if given.shares is None else np.where(known[:, None], given.shares[beams], np.float32(0.0))
    return LabelledScan(points, weights, labels, given.classes, confidences, shares)
