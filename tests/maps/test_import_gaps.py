"""Where walls nearly meet, and where symbols stand: what the importers share."""

from __future__ import annotations

import math

import numpy as np
import pytest

from wallkit.core.geometry import transform_points
from wallkit.maps.draft.draft import DraftWall
from wallkit.maps.importers.fixtures import place_fixture
from wallkit.maps.importers.gaps import find_gaps, find_misses, find_near_duplicates

# an L with a hole of 0.12 m at its corner, a third wall that stops 0.08 m short of the first wall's face
AXES = np.array([[0, 0, 4, 0], [4.12, 0, 4.12, 3], [2, 0.13, 2, 3]], dtype=float)
THICK = np.full(3, 0.1)


def test_gaps_and_misses_are_found_with_their_size_and_place():
    (gap,) = find_gaps(AXES)
    assert (gap.first, gap.second) == (0, 1)
    assert gap.gap_m == pytest.approx(0.12)
    assert gap.at == pytest.approx((4.06, 0.0))
    (miss,) = find_misses(AXES, THICK)
    assert (miss.first, miss.second) == (2, 0)
    assert miss.gap_m == pytest.approx(0.08)
    assert miss.at == pytest.approx((2.0, 0.13))


@pytest.mark.parametrize("pose", [(3.0, -7.0, 0.7), (-50.0, 20.0, 2.9)])
def test_moving_everything_changes_no_gap(pose):
    moved = transform_points(pose, AXES.reshape(-1, 2)).reshape(-1, 4)
    assert [g.gap_m for g in find_gaps(moved)] == pytest.approx([0.12], abs=1e-9)
    assert [g.gap_m for g in find_misses(moved, THICK)] == pytest.approx([0.08], abs=1e-9)


def test_what_meets_what_is_wide_and_what_a_wall_joins_is_no_gap():
    closed = np.array([[0, 0, 4, 0], [4, 0, 4, 3]], dtype=float)
    passage = np.array([[0, 0, 4, 0], [4.4, 0, 8, 0]], dtype=float)
    # the short wall between its neighbours is a wall, not a gap
    short = np.array([[0, 0, 4, 0], [4, 0, 4, 0.2], [4, 0.2, 8, 0.2]], dtype=float)
    for axes in (closed, passage, short):
        assert find_gaps(axes) == []
        assert find_misses(axes, np.full(len(axes), 0.1)) == []


def test_a_corner_clicked_twice_is_a_gap_though_walls_meet_at_both():
    axes = np.array([[0, 0, 4, 0], [4, 0, 4, 3], [4.02, 0, 8, 0], [4.02, 0, 4.02, -3]], dtype=float)
    assert [gap.gap_m for gap in find_gaps(axes)] == pytest.approx([0.02])


def test_near_duplicates_are_pairs_that_are_not_the_same():
    points = np.array([[0, 0], [0.03, 0], [1, 1], [1, 1], [5, 5]], dtype=float)
    assert [(i, j) for i, j, _ in find_near_duplicates(points)] == [(0, 1)]


def test_a_symbol_gets_its_back_to_the_nearest_wall_and_clear_of_the_next_one():
    walls = (DraftWall("long", (0, 0), (6, 0), 0.2), DraftWall("cross", (3, 0), (3, 4), 0.2))
    fixture, shift_m = place_fixture("toilet", "toilet", (3.2, 0.45, 1.0), walls)
    # the cross wall's face is nearer than the long one's
    assert fixture.wall == "cross"
    assert fixture.pose == pytest.approx((3.1, 0.45, 0.0))
    assert shift_m == pytest.approx(0.25)
    # 0.1 m from a corner a toilet 0.38 m wide has to give way
    corner, _ = place_fixture(
        "toilet", "toilet", (3.3, 0.35, 0.0), (walls[0], DraftWall("cross", (3, 0), (3, 0.2), 0.2))
    )
    assert corner.wall == "long"
    assert corner.pose[0] - 0.19 >= 3.1 - 1e-3
    assert corner.pose[1:] == pytest.approx((0.1, math.pi / 2))


def test_a_symbol_far_from_walls_stays_where_it_is():
    fixture, shift_m = place_fixture("sink", "sink", (2.0, 3.0, 0.5), (DraftWall("w", (0, 0), (6, 0), 0.2),))
    assert (fixture.wall, fixture.pose, shift_m) == (None, (2.0, 3.0, 0.5), 0.0)
