"""What is added to scores undoes what was added to them before, and never makes validation worse."""

from __future__ import annotations

import numpy as np
import pytest

from wallkit.train.balance import balancing
from wallkit.train.score import confusion, mean_iou

NAMES = ("wall", "door", "sink", "person")


def draw(seed: int, tilt: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Noisy scores of pixels of rare and common classes, with a constant on each class that does not belong there."""
    rng = np.random.default_rng(seed)
    truth = rng.choice(4, 6000, p=(0.7, 0.2, 0.06, 0.04)).astype(np.uint8)
    scores = rng.normal(0, 1.0, (len(truth), 4)) + 3.0 * np.eye(4)[truth]
    return (scores + tilt).astype(np.float32), truth


def overlap(scores: np.ndarray, truth: np.ndarray) -> float:
    return mean_iou(confusion(scores.argmax(axis=1).astype(np.uint8), truth, 4))


@pytest.mark.parametrize("seed", range(3))
def test_a_tilt_is_found_and_taken_back(seed):
    tilt = np.array([0.0, 0.0, 2.5, 2.5])
    scores, truth = draw(seed, tilt)
    added = balancing(scores, truth, NAMES)
    assert overlap(scores + added, truth) > overlap(scores, truth) + 0.15
    # on pixels it was not found on, as good as scores that were never tilted
    fresh, fresh_truth = draw(seed + 100, tilt)
    assert overlap(fresh + added, fresh_truth) > overlap(fresh - tilt, fresh_truth) - 0.02


def test_pixels_of_no_class_count_nothing():
    scores, truth = draw(1, np.array([0, 0, 2.0, 0]))
    unknown = np.concatenate([truth, np.full(2000, 255, dtype=np.uint8)])
    more = np.concatenate([scores, np.full((2000, 4), 9.0, dtype=np.float32)])
    np.testing.assert_array_equal(balancing(scores, truth, NAMES), balancing(more, unknown, NAMES))


def test_perfect_scores_are_left_alone():
    truth = np.arange(400, dtype=np.int64).astype(np.uint8) % 4
    np.testing.assert_array_equal(balancing(10 * np.eye(4, dtype=np.float32)[truth], truth, NAMES), 0)
