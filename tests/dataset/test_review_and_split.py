"""Splits, proposals, augmentation and class tables on arrays whose answer is known."""

from __future__ import annotations

import numpy as np
import pytest

from wallkit.dataset.augment import augmented
from wallkit.dataset.classes import UNLABELLED, LabelSet
from wallkit.dataset.documents import split_of_groups
from wallkit.dataset.labels import Labelled, Labelling, classes_from_png, png_from_classes, things_of
from wallkit.dataset.review import proposals, sharpness, thumbnail
from wallkit.errors import DatasetError


def texture(seed: int) -> np.ndarray:
    import cv2

    noise = np.random.default_rng(seed).integers(0, 255, (24, 32, 3)).astype(np.uint8)
    return np.asarray(cv2.resize(noise, (160, 120), interpolation=cv2.INTER_NEAREST))


@pytest.mark.parametrize(("groups", "share", "val"), [(10, 0.2, 2), (2, 0.01, 1), (2, 0.99, 1), (1, 0.2, 0), (5, 0, 0)])
def test_both_sides_have_a_group_where_there_are_two(groups, share, val):
    split = split_of_groups([f"g{k}" for k in range(groups)] * 3, share, 0)
    assert len(split) == groups
    assert sum(side == "val" for side in split.values()) == val


def test_blurred_and_repeated_pictures_are_proposed_with_reason_and_number():
    import cv2

    pictures = [texture(0), texture(0), cv2.GaussianBlur(texture(1), (0, 0), 6), texture(2), texture(0)]
    names = list("abcde")
    found = proposals(names, [sharpness(p) for p in pictures], [thumbnail(p) for p in pictures])
    assert [(p.name, p.reason) for p in found] == [("b", "duplicate"), ("c", "blurred")]
    assert found[0].number == 0


def test_light_changes_no_sharpness():
    picture = texture(3)
    assert sharpness((picture // 2).astype(np.uint8)) == pytest.approx(sharpness(picture), rel=0.05)


def test_labels_go_along_with_an_augmented_picture():
    """The picture is its own label: each class has a brightness of its own, which stays in order."""
    classes = (np.arange(160)[None] // 40 + 0 * np.arange(120)[:, None]).astype(np.uint8)
    image = np.repeat((60 + 40 * classes)[..., None], 3, axis=2).astype(np.uint8)
    labelled = Labelled("a", "g", image, classes, classes.astype(np.int64))
    flips = 0
    for number in range(20):
        made = augmented(np.random.default_rng(number), labelled, number)
        assert made.image.shape == image.shape
        assert np.array_equal(made.classes, made.things)
        means = [made.image[made.classes == c].mean() for c in np.unique(made.classes)]
        assert (np.diff(means) > 15).all()
        flips += bool(made.classes[60, 0] > made.classes[60, -1])
        assert bool(made.more["augmentation"].get("flipped")) == bool(made.classes[60, 0] > made.classes[60, -1])
    assert 0 < flips < 20


def test_things_are_told_apart_and_floors_are_one():
    labels = LabelSet()
    wall, floor = labels.names.index("wall"), labels.names.index("floor")
    classes = np.full((60, 80), UNLABELLED, dtype=np.uint8)
    classes[:30, :40] = classes[:30, 40:] = wall
    classes[40:, :] = floor
    things = np.full((60, 80), -1)
    things[:30, :40], things[:30, 40:], things[40:, :30], things[40:, 30:] = 0, 1, 2, 3
    found, small = things_of(Labelled("a", "g", np.zeros((60, 80, 3), np.uint8), classes, things), Labelling())
    assert [(t.number, t.box, t.area_px) for t in found] == [
        (wall, (0, 0, 40, 30), 1200),
        (wall, (40, 0, 40, 30), 1200),
        (floor, (0, 40, 80, 20), 1600),
    ]
    assert small == 0
    assert np.array_equal(classes_from_png(png_from_classes(classes, labels)), classes)


def test_a_class_without_a_place_is_named():
    assert LabelSet().table(["column", "window", "person"]).tolist() == [0, 7, 10]
    with pytest.raises(DatasetError, match="'dragon' has no place"):
        LabelSet().table(["wall", "dragon"])
