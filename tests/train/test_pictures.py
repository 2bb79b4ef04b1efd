"""Pictures as a network wants them: their shape kept, rare classes seen and weighed, labels that go where pixels go."""

from __future__ import annotations

import numpy as np
import pytest

from tests.train.flat import flat
from wallkit.train.augment import Changes, changed
from wallkit.train.pictures import GREY, UNLABELLED, class_weights, letterboxed, pixel_counts, showing_odds, stacked

STILL = Changes(close=0, repainted=0, shaded=0, blurred=0, noisy=0, squeezed=0, cluttered=0)


def test_a_letterbox_keeps_the_shape_and_says_nothing_of_its_bars():
    image, numbers = flat(np.random.default_rng(0), (160, 90))
    boxed, labels = letterboxed(image, numbers, (320, 240))
    assert (boxed[:30] == GREY).all()
    assert (labels[:30] == UNLABELLED).all()
    assert (labels[210:] == UNLABELLED).all()
    np.testing.assert_array_equal(labels[30:210][::2, ::2], numbers)
    assert len(stacked([(image, numbers)], (64, 64))) == 1


def test_a_picture_of_the_right_size_stays_as_it_is():
    image, numbers = flat(np.random.default_rng(0), (320, 240))
    boxed, labels = letterboxed(image, numbers, (320, 240))
    assert boxed is image
    assert labels is numbers


def test_rare_classes_weigh_more_and_unseen_ones_nothing():
    counts = np.array([[900.0, 90.0, 10.0, 0.0]])
    weights = class_weights(counts, power=0.5, most=1e9)
    assert weights[3] == 0
    # one over the root of the share
    assert weights[2] / weights[1] == pytest.approx(3.0)
    assert class_weights(counts, power=0.5, most=2.0).max() == 2.0


def test_pictures_with_rare_classes_are_shown_more_often():
    counts = np.zeros((100, 2))
    counts[:, 0] = 1000
    counts[:4, 1] = 50
    odds = showing_odds(counts)
    assert odds.sum() == pytest.approx(1)
    # root of 0.35 / 0.04
    assert odds[0] / odds[50] == pytest.approx(np.sqrt(0.35 / 0.04))


def test_counts_are_by_picture_and_leave_out_what_is_unlabelled():
    classes = np.array([[[0, 1], [1, 255]], [[2, 2], [2, 2]]], dtype=np.uint8)
    np.testing.assert_array_equal(pixel_counts(classes, 3), [[1, 2, 0], [0, 0, 4]])


@pytest.mark.parametrize("seed", range(12))
def test_labels_go_where_the_pixels_go(seed):
    import cv2

    rng = np.random.default_rng(seed)
    image, numbers = flat(rng, (160, 120))
    moved, labels = changed(rng, image, numbers, (128, 96), STILL)
    assert moved.shape == (96, 128, 3)
    assert (labels != UNLABELLED).mean() > 0.3
    for number in np.unique(labels[labels != UNLABELLED]).tolist():
        # a class had one colour, and has one again in the new light, but where it blends into its neighbour
        inside = cv2.erode((labels == number).astype(np.uint8), np.ones((5, 5), np.uint8)).astype(bool)
        if inside.sum() > 300:
            away = np.abs(moved[inside].astype(int) - np.median(moved[inside], axis=0)).max(axis=1)
            # and where a strip of another class was too thin for a label of its own
            assert (away <= 1).mean() > 0.97


@pytest.mark.parametrize("seed", range(5))
def test_the_same_generator_gives_the_same_picture_and_inputs_are_kept(seed):
    image, numbers = flat(np.random.default_rng(seed), (160, 120))
    before = image.copy(), numbers.copy()
    first = changed(np.random.default_rng(seed), image, numbers, (160, 120), Changes(), other=5)
    again = changed(np.random.default_rng(seed), image, numbers, (160, 120), Changes(), other=5)
    np.testing.assert_array_equal(first[0], again[0])
    np.testing.assert_array_equal(first[1], again[1])
    np.testing.assert_array_equal(before[0], image)
    np.testing.assert_array_equal(before[1], numbers)


def test_clutter_is_labelled_as_other_and_stays_off_the_unlabelled():
    image, numbers = flat(np.random.default_rng(0), (160, 120))
    everywhere = Changes(cluttered=1.0, zoom=(1.0, 1.0 + 1e-9), stretch=0, turn_deg=0)
    seen = 0
    for seed in range(8):
        _, labels = changed(np.random.default_rng(seed), image, numbers, (160, 120), everywhere, other=9)
        plain = changed(
            np.random.default_rng(seed), image, numbers, (160, 120), Changes(**{**vars(everywhere), "cluttered": 0.0})
        )
        seen += int((labels == 9).sum())
        np.testing.assert_array_equal(labels == UNLABELLED, plain[1] == UNLABELLED)
    assert seen > 500


def test_a_closer_look_is_at_something_of_a_class_drawn_evenly():
    """A person of half a percent of the picture is looked at as often as the wall: in half of the looks."""
    image, numbers = flat(np.random.default_rng(0), (320, 240))
    numbers[:] = 0
    numbers[100:124, 140:156] = 1
    near = Changes(**{**vars(STILL), "close": 1.0, "stretch": 0, "turn_deg": 0})
    looks = [changed(np.random.default_rng(seed), image, numbers, (320, 240), near)[1] for seed in range(60)]
    at_the_person = sum(int(labels[118:122, 158:162].max() == 1) for labels in looks)
    assert 18 <= at_the_person <= 42
    assert max((labels == 1).mean() for labels in looks) > 4 * (numbers == 1).mean()
