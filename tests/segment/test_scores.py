"""Scores between cells: the class is that of a plain bilinear look-up, and so is how sure each cell is of its own."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import map_coordinates
from scipy.special import softmax

from wallkit.segment.letterbox import letterbox
from wallkit.segment.scores import ScoreMap

NAMES = ("wall", "door", "person", "floor")


@pytest.mark.parametrize("is_probability", [False, True])
def test_class_and_confidence_are_bilinear(is_probability):
    rng = np.random.default_rng(0)
    scores = rng.normal(0, 3, (24, 32, 4)).astype(np.float32)
    if is_probability:
        scores = softmax(scores, axis=2).astype(np.float32)
    frame = letterbox((300, 500), (96, 128))
    found = ScoreMap(NAMES, NAMES, frame, scores, is_probability)
    at = np.concatenate([rng.uniform((-20, -20), (520, 320), (4000, 2)), [[np.nan, 1], [0, np.inf], [499.49, 299.49]]])
    labels, confidences = found.classes_at(at)
    with np.errstate(invalid="ignore"):
        inside = ((at >= -0.5) & (at < (499.5, 299.5))).all(axis=1)
    cells = (frame.net_from_image(at[inside]) + 0.5) / 4 - 0.5

    def bilinear(plane):
        return map_coordinates(plane.astype(float), cells[:, ::-1].T, order=1, mode="nearest")

    between = np.stack([bilinear(scores[..., c]) for c in range(4)], axis=1)
    sure = (scores if is_probability else softmax(scores, axis=2)).max(axis=2)
    assert (labels[~inside] == -1).all()
    assert not confidences[~inside].any()
    np.testing.assert_allclose(confidences[inside], bilinear(sure), atol=1e-5)
    clear = np.diff(np.sort(between, axis=1)[:, -2:], axis=1)[:, 0] > 1e-5
    np.testing.assert_array_equal(labels[inside][clear], between.argmax(axis=1)[clear])
