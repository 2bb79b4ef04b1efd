"""Two answers that differ by what was drawn: the numbers of the comparison are known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.segment.drawn import colour_oracle, picture
from wallkit.segment.agreement import Agreement, Thing, agreement, answer_of, image_mask, matches, painted
from wallkit.segment.letterbox import letterbox

NAMES = ("wall", "person", "background")


def thing(name: str, columns: tuple[int, int], score: float = 0.9) -> Thing:
    mask = np.zeros((10, 100), dtype=bool)
    mask[:, columns[0] : columns[1]] = True
    return Thing(name, score, np.array([columns[0], 0, columns[1], 10.0]), mask)


def answer(*things: Thing):
    return painted(things, NAMES, NAMES, (10, 100))


POINTS = np.array([[x, 5.0] for x in range(100)])


def test_things_are_matched_within_their_class_best_first():
    a = [thing("wall", (0, 50)), thing("wall", (10, 50)), thing("person", (60, 80))]
    b = [thing("wall", (12, 50)), thing("person", (0, 50)), thing("person", (61, 81))]
    found = matches(a, b)
    assert [(i, j) for i, j, _ in found] == [(1, 0), (2, 2)]
    assert [iou for _, _, iou in found] == pytest.approx([38 / 40, 19 / 21])


def test_missed_extra_ious_drifts_boxes_and_moved_points():
    a = answer(thing("wall", (0, 40)), thing("person", (60, 80)))
    b = answer(thing("wall", (4, 40), 0.7), thing("wall", (90, 100)))
    found = agreement([("one", a, b, POINTS)])
    assert (found.of_a, found.of_b, found.matched) == (2, 2, 1)
    assert found.ious == pytest.approx([0.9])
    assert found.drifts == pytest.approx([-0.2])
    assert found.box_px == [1.0]
    assert (found.share, found.quality) == pytest.approx((0.5, 0.45))
    assert found.role_iou() == pytest.approx({"wall": 36 / 50, "person": 0.0})
    assert dict(found.moved) == {("wall", "background"): 4, ("person", "background"): 20, ("background", "wall"): 10}
    assert found.points == 100


def test_pictures_add_up_and_the_worst_is_named():
    a, b = answer(thing("wall", (0, 40))), answer(thing("wall", (0, 30)))
    found = agreement([("good", a, a, POINTS), ("bad", a, b, POINTS), ("empty", answer(), answer(), POINTS)])
    assert (found.of_a, found.matched, found.worst) == (2, 2, ("bad", 0.75))
    assert found.role_iou()["wall"] == pytest.approx(70 / 80)


def test_nothing_to_compare_is_no_agreement():
    assert math.isnan(agreement([("empty", answer(), answer(), POINTS)]).quality)
    assert math.isnan(Agreement().share)


def test_where_things_overlap_the_surer_one_is_painted():
    both = answer(thing("wall", (0, 40), 0.6), thing("person", (30, 50), 0.8))
    labels, _ = both.segmentation.classes_at([[10, 5], [35, 5], [45, 5], [60, 5]])
    np.testing.assert_array_equal(labels, [0, 1, 1, 2])


@pytest.mark.parametrize("layout", ["yolo-anchors", "class-scores"])
def test_a_model_agrees_with_itself_entirely(tmp_path, layout):
    segmenter = colour_oracle(tmp_path, layout=layout)
    rgb = picture((240, 320), {"wall": (20, 40, 300, 220), "person": (100, 60, 160, 240)})
    one, other = (answer_of(segmenter.segment(rgb)) for _ in range(2))
    found = agreement([("it", one, other, np.array([[50.0, 100.0]]))])
    assert (found.of_a, found.matched, found.ious) == (2, 2, [1.0, 1.0])
    assert not found.moved


def test_the_nearest_pixel_of_the_input_is_taken():
    frame = letterbox((240, 320), (320, 320))
    mask = np.zeros((320, 320), dtype=bool)
    mask[40 + 10 : 40 + 20, 5:9] = True
    rows, columns = np.nonzero(image_mask(mask, frame))
    assert (rows.min(), rows.max(), columns.min(), columns.max()) == (10, 19, 5, 8)


def test_things_without_a_pixel_are_none(tmp_path):
    """A sum of 0 everywhere is no mask; Ultralytics leaves such things out, and so does the comparison."""
    found = colour_oracle(tmp_path).segment(
        picture((240, 320), {"wall": (20, 40, 300, 220), "person": (100, 60, 160, 240)})
    )
    assert len(answer_of(found).things) == 2
    found.detections.coefficients[1] = 0
    assert [one.name for one in answer_of(found).things] == [found.names[found.detections.labels[0]]]
