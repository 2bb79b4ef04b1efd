"""Intersection over union, against its definition in sets of pixels."""

from __future__ import annotations

import math

import numpy as np
import pytest

from wallkit.train.score import commonest_mistake, confusion, mean_iou, pixel_accuracy, scores_of

NAMES = ("wall", "partition", "door", "sink")


def draw(seed: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    truth = rng.integers(0, 3, (40, 50)).astype(np.uint8)
    predicted = np.where(rng.random(truth.shape) < 0.7, truth, rng.integers(0, 3, truth.shape)).astype(np.uint8)
    truth[rng.random(truth.shape) < 0.1] = 255
    return predicted, truth


@pytest.mark.parametrize("seed", range(5))
def test_every_class_is_its_intersection_over_its_union(seed):
    predicted, truth = draw(seed)
    known = truth != 255
    for number, score in enumerate(scores_of(confusion(predicted, truth, 4), NAMES)[:3]):
        is_it, said = (truth == number) & known, (predicted == number) & known
        assert score.iou == pytest.approx((is_it & said).sum() / (is_it | said).sum())
        assert score.precision == pytest.approx((is_it & said).sum() / said.sum())
        assert score.recall == pytest.approx((is_it & said).sum() / is_it.sum())
        assert score.pixels == is_it.sum()


def test_wall_and_partition_together_are_one_class():
    predicted, truth = draw(1)
    together = scores_of(confusion(predicted, truth, 4), NAMES)[-1]
    is_it, said = truth <= 1, (predicted <= 1) & (truth != 255)
    assert together.name == "wall + partition"
    assert together.iou == pytest.approx((is_it & said).sum() / (is_it | said).sum())
    assert scores_of(np.eye(1, dtype=np.int64), ("wall",))[-1].name == "wall"


def test_pooled_means_that_pictures_add_up():
    pairs = [draw(seed) for seed in range(4)]
    added = sum(confusion(predicted, truth, 4) for predicted, truth in pairs)
    once = confusion(*(np.concatenate(side) for side in zip(*pairs, strict=True)), 4)
    np.testing.assert_array_equal(added, once)


def test_a_class_that_is_nowhere_has_no_score_and_no_part_in_the_mean():
    predicted, truth = draw(2)
    matrix = confusion(predicted, truth, 4)
    scores = scores_of(matrix, NAMES)
    assert math.isnan(scores[3].iou)
    assert mean_iou(matrix) == pytest.approx(np.mean([score.iou for score in scores[:3]]))
    assert math.isnan(mean_iou(np.zeros((3, 3), dtype=np.int64)))


def test_what_a_class_is_taken_for():
    truth = np.full((1, 10), 2, dtype=np.uint8)
    predicted = np.array([[2, 2, 2, 0, 0, 0, 0, 1, 1, 1]], dtype=np.uint8)
    matrix = confusion(predicted, truth, 4)
    assert commonest_mistake(matrix, 2) == (0, 0.4)
    assert pixel_accuracy(matrix) == 0.3
