"""Drawn class maps: look-ups, masks and polygons say the same."""

from __future__ import annotations

import numpy as np
import pytest

from wallkit.segment.class_map import class_map

NAMES = ("floor", "Wall-Tile", "windowpane", "robot", "person")


@pytest.fixture
def drawn():
    """A wall 40 x 60 with a window in it and a person before it; what is above nobody knows."""
    ids = np.zeros((60, 80), dtype=np.uint8)
    ids[10:50, 10:70] = 1
    ids[20:30, 20:40] = 2
    ids[30:60, 50:60] = 4
    ids[:5] = 255
    return class_map(ids, NAMES, nothing=255)


def test_look_up_mask_and_labels_agree_at_every_pixel(drawn):
    u, v = np.meshgrid(np.arange(80), np.arange(60))
    labels, confidences = drawn.classes_at(np.stack([u.ravel(), v.ravel()], axis=1))
    np.testing.assert_array_equal(labels.reshape(60, 80), drawn.labels())
    np.testing.assert_array_equal(confidences > 0, labels >= 0)
    counts = np.isin(np.array([*drawn.roles, ""])[labels], ["wall", "glass"])
    np.testing.assert_array_equal(counts.reshape(60, 80), drawn.mask({"wall", "glass"}))


def test_the_border_of_the_image_is_half_a_pixel_out(drawn):
    labels, confidences = drawn.classes_at(
        [[-0.5, 59.49], [-0.51, 30], [79.49, 30], [79.5, 30], [10, 59.5], [np.nan, 3], [3, 2]]
    )
    np.testing.assert_array_equal(labels, [0, -1, 0, -1, -1, -1, -1])
    np.testing.assert_array_equal(confidences, [1, 0, 1, 0, 0, 0, 0])


def test_polygons_fill_to_the_mask_and_keep_the_hole(drawn):
    import cv2

    (wall,) = drawn.polygons({"wall"})
    assert NAMES[wall.label] == "Wall-Tile"
    assert len(wall.rings) == 2
    filled = np.zeros((60, 80), dtype=np.uint8)
    cv2.fillPoly(filled, [ring.astype(np.int32) for ring in wall.rings], 1)
    # the hole's ring runs on the wall's own pixels
    np.testing.assert_array_equal(filled > 0, drawn.mask({"wall"}))
    assert {NAMES[p.label] for p in drawn.polygons()} == {"floor", "Wall-Tile", "windowpane", "person"}


def test_ids_without_a_name_are_unknown():
    assert class_map(np.array([[0, 1, 2, -1, 7]]), ("a", "b")).labels().tolist() == [[0, 1, -1, -1, -1]]
