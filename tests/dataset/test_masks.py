"""Masks as polygons, run lengths and lines of text come back as the masks they were."""

from __future__ import annotations

import numpy as np
import pytest

from wallkit.core.types import BoolArray
from wallkit.dataset.polygons import Tracing, mask_from_polygons, polygons_from_mask, polygons_from_yolo, yolo_line
from wallkit.dataset.rle import counts_from_mask, counts_from_text, mask_from_counts, text_from_counts

SHAPE = (240, 320)


def blob(rng: np.random.Generator) -> BoolArray:
    """A shape of discs and boxes with holes of discs, boxes and single scratches in it."""
    import cv2

    canvas = np.zeros(SHAPE, dtype=np.uint8)
    for value, count, largest in ((1, 5, 60), (0, 7, 22)):
        for _ in range(count):
            x, y = int(rng.integers(30, 290)), int(rng.integers(30, 210))
            a, b = (int(v) for v in rng.integers(4, largest, 2))
            if rng.random() < 0.5:
                cv2.ellipse(canvas, (x, y), (a, b), float(rng.uniform(0, 180)), 0, 360, value, -1)
            else:
                cv2.rectangle(canvas, (x, y), (x + a, y + b), value, -1)
    return canvas.astype(bool)


def iou(a: BoolArray, b: BoolArray) -> float:
    return float((a & b).sum() / (a | b).sum())


@pytest.mark.parametrize("seed", range(40))
def test_polygons_fill_to_the_mask_they_came_from(seed):
    mask = blob(np.random.default_rng(seed))
    polygons = polygons_from_mask(mask, Tracing(min_area_px=1, min_hole_px=1))
    assert iou(mask, mask_from_polygons(polygons, SHAPE)) >= 0.99


@pytest.mark.parametrize("seed", range(10))
def test_label_lines_fill_to_the_mask_they_came_from(seed):
    mask = blob(np.random.default_rng(seed))
    text = "\n".join(yolo_line(7, polygon, SHAPE) for polygon in polygons_from_mask(mask, Tracing(1, 1)))
    read = polygons_from_yolo(text, SHAPE)
    assert {number for number, _ in read} == {7}
    assert iou(mask, mask_from_polygons([polygon for _, polygon in read], SHAPE)) >= 0.99
    shares = np.array([word for line in text.splitlines() for word in line.split()[1:]], dtype=float)
    assert shares.min() > 0
    assert shares.max() < 1


@pytest.mark.parametrize(("rows", "columns"), [((40, 90), (60, 61)), ((70, 71), (10, 120))])
def test_a_line_one_pixel_thin_is_a_polygon_of_three_points(rows, columns):
    """Ultralytics takes a row of two points for a box, and then drops the picture: its labels mix both."""
    mask = np.zeros(SHAPE, dtype=bool)
    mask[slice(*rows), slice(*columns)] = True
    (polygon,) = polygons_from_mask(mask)
    assert len(polygon) == 3
    assert np.array_equal(mask_from_polygons([polygon], SHAPE), mask)


def test_a_ring_is_one_polygon_with_its_hole_open():
    mask = np.zeros(SHAPE, dtype=bool)
    mask[50:150, 60:200] = True
    mask[80:120, 90:170] = False
    mask[55:60, 65:70] = False
    (polygon,) = polygons_from_mask(mask)
    assert np.array_equal(mask_from_polygons([polygon], SHAPE), mask)
    # four corners each, each joined by a bridge there and back
    assert len(polygon) <= 3 * 4 + 2 * 8


def test_parts_are_polygons_of_their_own_and_specks_are_left_out():
    mask = np.zeros(SHAPE, dtype=bool)
    mask[10:40, 10:40] = mask[100:140, 200:260] = True
    mask[200:202, 5:9] = True
    parts = polygons_from_mask(mask, Tracing(min_area_px=20))
    assert [tuple(part.min(axis=0)) for part in parts] == [(10, 10), (200, 100)]
    assert len(polygons_from_mask(mask, Tracing(min_area_px=8))) == 3
    assert len(polygons_from_mask(mask, Tracing(min_area_px=9))) == 2


def test_an_empty_mask_has_no_polygon():
    assert polygons_from_mask(np.zeros(SHAPE, dtype=bool)) == []


def test_a_thin_line_stays():
    mask = np.zeros(SHAPE, dtype=bool)
    mask[20, 30:200] = True
    mask[20:90, 200] = True
    assert iou(mask, mask_from_polygons(polygons_from_mask(mask), SHAPE)) == 1.0


# -------------------------------------------------------------------------------------------------- run lengths


def test_run_lengths_of_a_mask_worked_by_hand():
    mask = np.array([[0, 1, 1], [1, 1, 0]], dtype=bool)
    # down the columns: 0 1 | 1 1 | 1 0
    assert counts_from_mask(mask).tolist() == [1, 4, 1]
    assert counts_from_mask(~mask).tolist() == [0, 1, 4, 1]


def test_the_text_of_run_lengths_worked_by_hand():
    # 0: '0'. 1: '1'. 40 = 01000 + more, 00001: 8 + 32 + 48 = 'X', '1'. The fourth is told as 9 - 1 = 8: '8'.
    assert text_from_counts(np.array([0, 1, 40, 9])) == "01X18"
    # 16 has its fifth bit set, which would say "negative": one more character. 5 - 16 = -11: 10101 = 21, 'E'
    assert text_from_counts(np.array([3, 16, 2, 5])) == "3`02E"


def test_the_text_is_that_of_pycocotools():
    """Made by pycocotools 2.0 (mask.encode) of a disc of radius 9 at (12, 10) on 24 x 30 pixels."""
    y, x = np.mgrid[:24, :30]
    mask = (x - 12) ** 2 + (y - 10) ** 2 <= 81
    assert text_from_counts(counts_from_mask(mask)) == "b21c08K2N2N2N2O00000O20N1000001N2N2N2N5Hj5"


@pytest.mark.parametrize("seed", range(20))
def test_run_lengths_and_their_text_come_back(seed):
    mask = blob(np.random.default_rng(seed)) ^ (np.random.default_rng(seed).random(SHAPE) < 0.01)
    counts = counts_from_mask(mask)
    assert counts.sum() == mask.size
    assert np.array_equal(counts_from_text(text_from_counts(counts)), counts)
    assert np.array_equal(mask_from_counts(counts, SHAPE), mask)


@pytest.mark.parametrize("value", [False, True])
def test_a_mask_of_one_value(value):
    mask = np.full((5, 7), value)
    counts = counts_from_mask(mask)
    assert counts.tolist() == ([0, 35] if value else [35])
    assert np.array_equal(mask_from_counts(counts_from_text(text_from_counts(counts)), (5, 7)), mask)
