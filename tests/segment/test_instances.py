"""Masks of things from prototypes: crop, overlap and upsampling in closed form."""

from __future__ import annotations

import numpy as np

from wallkit.segment.detections import Detections, detections_from_anchors, detections_from_rows, thinned
from wallkit.segment.instances import Instances
from wallkit.segment.letterbox import letterbox


def things(boxes, scores, labels, coefficients, prototypes, *, net=(32, 32)):
    return Instances(
        ("wall", "person", "background"),
        ("wall", "person", "background"),
        letterbox(net, net),
        Detections(
            *(np.array(a, dtype=np.float32) for a in (boxes, scores)),
            np.array(labels),
            np.array(coefficients, np.float32),
        ),
        np.array(prototypes, dtype=np.float32),
    )


def test_a_mask_ends_at_its_box_half_open():
    """x1 <= x < x2 in pixels of the input, as Ultralytics crops."""
    found = things([[4.5, 8, 20, 24.2]], [1], [0], [[1]], np.ones((1, 8, 8)))
    (mask,) = found.masks(of_net=True)
    rows, columns = np.nonzero(mask)
    assert (columns.min(), columns.max(), rows.min(), rows.max()) == (5, 19, 8, 24)
    labels, _ = found.classes_at([[4.4, 10], [4.5, 10], [19.9, 10], [20, 10]])
    np.testing.assert_array_equal(labels, [2, 0, 0, 2])


def test_masks_are_upsampled_before_they_are_cropped():
    """A cell beyond the box still counts between cells; cropping the small grid first would smear the edge inwards."""
    prototypes = np.full((1, 8, 8), -1.0)
    prototypes[0, :, 2:] = 3.0
    found = things([[0, 0, 12, 32]], [1], [0], [[1]], prototypes)
    (mask,) = found.masks(of_net=True)
    # the zero lies a quarter of a cell after the centre of cell 1, at x = 5.5; pixel 7 has -1 + 4 * (7.5 / 4 - 1.5)
    columns = np.flatnonzero(mask[16])
    assert (columns.min(), columns.max()) == (7, 11)


def test_sampling_is_the_bilinear_sum_of_pytorchs_interpolate():
    """Against the formula of `interpolate(mode="bilinear", align_corners=False)`, written down plainly."""
    rng = np.random.default_rng(4)
    prototypes, coefficients = rng.normal(size=(5, 8, 8)).astype(np.float32), rng.normal(size=(3, 5))
    found = things([[0, 0, 32, 32]] * 3, [0.9, 0.8, 0.7], [0, 1, 0], coefficients, prototypes)
    sums = np.einsum("dm,mhw->dhw", coefficients, prototypes)
    at = np.clip((np.arange(32) + 0.5) / 4 - 0.5, 0, 7)
    low, share = np.floor(at).astype(int), at % 1
    high = np.minimum(low + 1, 7)
    rows = sums[:, low] * (1 - share)[None, :, None] + sums[:, high] * share[None, :, None]
    whole = rows[:, :, low] * (1 - share) + rows[:, :, high] * share
    np.testing.assert_array_equal(found.masks(of_net=True), whole > 0)
    u, v = np.meshgrid(np.arange(32), np.arange(32))
    labels, sure = found.classes_at(np.stack([u.ravel(), v.ravel()], axis=1))
    chances = np.array([0.9, 0.8, 0.7])[:, None, None] / (1 + np.exp(-whole))
    best = np.where(whole > 0, chances, 0)
    expected = np.where(best.max(axis=0) > 0, np.array([0, 1, 0])[best.argmax(axis=0)], 2)
    np.testing.assert_array_equal(labels.reshape(32, 32), expected)
    np.testing.assert_array_equal(found.labels(), expected)
    left = np.where(expected == 2, np.prod(1 - chances, axis=0), best.max(axis=0))
    np.testing.assert_allclose(sure.reshape(32, 32), left, rtol=1e-4)


def test_overlapping_boxes_of_a_class_are_thinned_and_others_kept():
    boxes = np.array([[0, 0, 10, 10], [0, 0, 10, 8], [0, 0, 10, 6.9], [0, 0, 10, 10]], dtype=np.float32)
    kept = thinned(boxes, np.array([0, 0, 0, 1]), 0.7, 300)
    # overlaps with the first: 0.8 and 0.69
    np.testing.assert_array_equal(kept, [0, 2, 3])
    np.testing.assert_array_equal(thinned(boxes, np.array([0, 0, 0, 1]), 0.7, 1), [0])
    assert thinned(boxes[:0], np.zeros(0, dtype=np.int64), 0.7, 300).shape == (0,)


def test_the_two_heads_say_the_same():
    rng = np.random.default_rng(1)
    anchors = np.zeros((4 + 3 + 2, 6), dtype=np.float32)
    anchors[:4] = rng.uniform(5, 25, size=(4, 6))
    anchors[4:7] = rng.uniform(size=(3, 6))
    anchors[7:] = rng.normal(size=(2, 6))
    raw = detections_from_anchors(anchors, 2, min_score=0.4, max_overlap=1.0)
    rows = np.zeros((9, 8), dtype=np.float32)
    for k, a in enumerate(anchors.T):
        centre, half = a[:2], a[2:4] / 2
        rows[k] = [*(centre - half), *(centre + half), a[4:7].max(), a[4:7].argmax(), *a[7:]]
    inside = detections_from_rows(rows, min_score=0.4)
    for name in ("boxes", "scores", "labels", "coefficients"):
        np.testing.assert_allclose(getattr(inside, name), getattr(raw, name), rtol=1e-6)
    assert len(raw) == (anchors[4:7].max(axis=0) > 0.4).sum()
