"""Whole-map search: against brute force, and on rooms with a known number of rivals."""

from __future__ import annotations

import numpy as np
import pytest

from tests.localize.worlds import FLAT, fields_of, scan_at
from tests.plan import plan_from_polylines
from wallkit.core.geometry import compose, relative, wrap_angle
from wallkit.localize.search import _bounds, _split, find_places, prepare_search

SQUARE = plan_from_polylines([(0, 0), (6, 0), (6, 6), (0, 6), (0, 0)])
RECTANGLE = plan_from_polylines([(0, 0), (9, 0), (9, 5), (0, 5), (0, 0)])


def points_at(plan, pose, beams=120):
    return scan_at(plan, np.array(pose), beams=beams, fov_rad=2 * np.pi).points.xyz_m[:, :2].astype(float)


@pytest.mark.parametrize("pose", [(1.0, 1.5, 0.2), (7.5, 3.0, 2.6), (3.3, 6.4, -1.9)])
def test_the_true_pose_comes_first(pose):
    places = find_places(prepare_search(fields_of(FLAT)), points_at(FLAT, pose))
    off = relative(np.array(pose), places[0].pose)
    assert np.hypot(off[0], off[1]) < 0.15
    assert abs(off[2]) < np.deg2rad(3)
    assert places[0].score > 0.9


@pytest.mark.parametrize(("plan", "rivals"), [(SQUARE, 4), (RECTANGLE, 2), (FLAT, 1)])
def test_rooms_have_as_many_equal_places_as_symmetries(plan, rivals):
    places = find_places(prepare_search(fields_of(plan)), points_at(plan, (1.7, 1.2, 0.4)))
    assert sum(place.score > 0.95 * places[0].score for place in places) == rivals


def test_places_are_separated_and_sorted():
    places = find_places(prepare_search(fields_of(SQUARE)), points_at(SQUARE, (1.7, 1.2, 0.4)), keep=0.5)
    scores = [place.score for place in places]
    assert scores == sorted(scores, reverse=True)
    for i, a in enumerate(places):
        for b in places[:i]:
            off = a.pose - b.pose
            assert np.hypot(off[0], off[1]) >= 1.0 or abs(wrap_angle(off[2])) >= np.deg2rad(30)


def test_bound_of_a_block_is_never_below_the_score_of_a_pose_in_it():
    at = prepare_search(fields_of(FLAT))
    points = points_at(FLAT, (7.5, 3.0, 2.6), beams=25)
    offsets = np.stack([np.round(points[:, 0] / at.cell_m), np.round(points[:, 1] / at.cell_m)])
    offsets = offsets.astype(np.int32)[:, None, :]
    rng = np.random.default_rng(0)
    height, width = at.is_free.shape
    for level in (4, 3, 2, 1):
        size = 1 << level
        blocks = np.stack(
            [rng.integers(0, width // size, 60) * size, rng.integers(0, height // size, 60) * size, np.zeros(60)]
        )
        blocks = blocks.astype(np.int32)
        bounds = _bounds(at, level, blocks, offsets)
        for i in range(60):
            inside = blocks[:, i : i + 1]
            for finer in range(level - 1, -1, -1):
                inside = _split(at, inside, finer)
            assert bounds[i] >= _bounds(at, 0, inside, offsets).max() - 1e-12


def test_nothing_better_was_missed():
    """Every free cell and heading scored one by one: no score beats the first answer."""
    at = prepare_search(fields_of(FLAT))
    points = points_at(FLAT, (7.5, 3.0, 2.6), beams=40)
    best = find_places(at, points, headings=36)[0].score
    turns = np.arange(36) * np.pi / 18
    c, s = np.cos(turns)[:, None], np.sin(turns)[:, None]
    x, y = points.T
    offsets = np.stack([np.floor((c * x - s * y) / at.cell_m + 0.5), np.floor((s * x + c * y) / at.cell_m + 0.5)])
    rows, columns = np.nonzero(at.is_free)
    for turn in range(36):
        cells = np.stack([columns, rows, np.full(len(rows), turn)]).astype(np.int32)
        assert _bounds(at, 0, cells, offsets.astype(np.int32)).max() <= best + 1e-12


def test_a_turned_and_shifted_map_turns_and_shifts_the_answer():
    from wallkit.core.types import FieldSet

    fields = fields_of(FLAT)
    move = np.array([-20.0, 13.0, 2.2])
    moved = FieldSet(fields.distances_m, fields.is_free, fields.resolution_m, compose(move, fields.origin))
    points = points_at(FLAT, (7.5, 3.0, 2.6))
    here = find_places(prepare_search(fields), points)[0].pose
    there = find_places(prepare_search(moved), points)[0].pose
    np.testing.assert_allclose(there, compose(move, here), atol=1e-9)


def test_no_points_no_places():
    assert find_places(prepare_search(fields_of(FLAT)), np.zeros((0, 2))) == []
