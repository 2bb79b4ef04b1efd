"""The worlds that tests draw, against closed forms: ranges, grids, walkers."""

from __future__ import annotations

import numpy as np
import pytest

from tests.movers import LEG_RADIUS_M, legs, walk
from tests.plan import cast, occupancy, plan_from_polylines

ROOM = plan_from_polylines([(0, 0), (4, 0), (4, 3), (0, 3), (0, 0)])
NOBODY = np.zeros((0, 3))


def test_ranges_in_a_rectangle_are_the_closed_form():
    at, bearings = np.array([1.0, 1.0]), np.linspace(-np.pi, np.pi, 361)
    c, s = np.cos(bearings), np.sin(bearings)
    with np.errstate(divide="ignore"):
        to_x = np.where(c > 0, 3.0 / c, np.where(c < 0, -1.0 / c, np.inf))
        to_y = np.where(s > 0, 2.0 / s, np.where(s < 0, -1.0 / s, np.inf))
    np.testing.assert_allclose(cast(ROOM, NOBODY, at, bearings, 10.0), np.minimum(to_x, to_y), rtol=1e-9)


def test_a_disc_hides_the_wall_and_what_is_out_of_reach_is_infinite():
    disc = np.array([[3.0, 1.0, 0.5]])
    ahead, behind = cast(ROOM, disc, np.array([1.0, 1.0]), np.array([0.0, np.pi]), 10.0)
    assert (ahead, behind) == pytest.approx((1.5, 1.0))
    assert np.isinf(cast(ROOM, NOBODY, np.array([1.0, 1.0]), np.array([0.0]), 2.9))[0]


def test_a_grid_holds_the_floor_as_free_and_its_walls_where_they_are():
    grid = occupancy(ROOM, 0.05, inside=np.array([1.0, 1.0]))
    free_m2 = np.sum(grid.cells == 0) * grid.resolution_m**2
    assert free_m2 == pytest.approx(4 * 3, rel=0.03)
    rows, columns = np.nonzero(grid.cells == 100)
    x = grid.origin[0] + (columns + 0.5) * grid.resolution_m
    y = grid.origin[1] + (rows + 0.5) * grid.resolution_m
    off = np.minimum.reduce([np.abs(x), np.abs(x - 4), np.abs(y), np.abs(y - 3)])
    assert off.max() < 1e-6
    assert grid.cells[0, 0] == -1


def test_a_walker_keeps_to_the_way_and_has_two_legs_apart():
    times = np.linspace(0, 60, 500)
    walker = walk([(0, 0), (4, 0), (4, 3)], 1.0, times)
    assert np.hypot(*np.diff(walker[:, :2], axis=0).T).max() <= (times[1] - times[0]) * 1.0 + 1e-9
    discs = legs(walker[:1], np.array([0.0]))
    assert discs.shape == (2, 3)
    assert np.all(discs[:, 2] == LEG_RADIUS_M)
    np.testing.assert_allclose(discs[:, :2].mean(axis=0), walker[0, :2], atol=1e-12)
