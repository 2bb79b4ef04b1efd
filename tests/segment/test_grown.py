"""Masks that grow and shrink do so by a disc."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from wallkit.segment.class_map import class_map
from wallkit.segment.grown import grown

NAMES = ("wall", "person", "partition")


def drawn(seed):
    """Blobs of all classes, and pixels that nobody can tell."""
    rng = np.random.default_rng(seed)
    ids = np.full((60, 80), 1)
    for _ in range(6):
        u, v = (int(n) for n in rng.integers((5, 5), (75, 55)))
        cv2.circle(ids := ids.astype(np.int32), (u, v), int(rng.integers(4, 12)), int(rng.integers(-1, 3)), -1)
    return ids


def disc(radius):
    reach = int(np.ceil(radius))
    v, u = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    return (np.hypot(u, v) <= radius).astype(np.uint8)


@pytest.mark.parametrize("radius", [1.0, 2.5, 5.0])
@pytest.mark.parametrize("seed", range(3))
def test_masks_grow_and_shrink_by_a_disc(seed, radius):
    given = class_map(drawn(seed), NAMES)
    walls = ("wall", "partition")
    mask = given.mask(walls)
    known = (given.ids >= 0) & ~mask
    larger = grown(given, walls, radius)
    np.testing.assert_array_equal(larger.mask(walls), cv2.dilate(mask.astype(np.uint8), disc(radius)) > 0)
    smaller = grown(given, walls, -radius)
    eaten = cv2.dilate(known.astype(np.uint8), disc(radius), borderValue=0) > 0
    np.testing.assert_array_equal(smaller.mask(walls), mask & ~eaten)
    # who does not change sides stays what it is
    np.testing.assert_array_equal(larger.labels()[mask], given.ids[mask])
    np.testing.assert_array_equal(smaller.labels()[~mask], given.ids[~mask])
    assert (smaller.labels()[mask & eaten] == 1).all()


def test_nothing_grows_without_a_mask_or_by_nothing():
    given = class_map(np.ones((10, 10), int), NAMES)
    np.testing.assert_array_equal(grown(given, ("wall",), 3.0).labels(), given.ids)
    other = class_map(drawn(0), NAMES)
    np.testing.assert_array_equal(grown(other, ("wall",), 0.0).labels(), other.ids)
