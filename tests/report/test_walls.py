"""Walls as pictures: the right cell under every pixel, turned maps, and no wall lost on the way down."""

import numpy as np
import pytest

from wallkit.core.geometry import transform_points
from wallkit.core.types import OccupancyGrid
from wallkit.report.walls import View, draw_walls, view_of

from .worlds import room

UNKNOWN, FREE, WALL = 0, 1, 2


def test_a_pixel_per_cell_is_the_grid_upside_down():
    cells = np.array([[0, 100, -1], [50, 49, 0]], dtype=np.int8)
    grid = OccupancyGrid(cells, 0.5, np.array([2.0, -1.0, 0.0]))
    picture = draw_walls(grid, View(2.0, -1.0, 3.5, 0.0), pixels=(3, 2))
    np.testing.assert_array_equal(picture, [[WALL, FREE, FREE], [FREE, WALL, UNKNOWN]])


def test_beyond_the_grid_is_unknown():
    grid = OccupancyGrid(np.zeros((2, 2), dtype=np.int8), 1.0, np.zeros(3))
    picture = draw_walls(grid, View(-1, -1, 3, 3), pixels=(4, 4))
    assert (picture == FREE).sum() == 4
    np.testing.assert_array_equal(picture[1:3, 1:3], FREE)


@pytest.mark.parametrize("yaw_rad", [0.3, np.pi / 2, 3.14])
def test_a_turned_grid_is_drawn_where_its_cells_are(yaw_rad):
    grid = room(yaw_rad)
    row, column = 60, 11  # on the left wall
    place = transform_points(grid.origin, [[(column + 0.5) * 0.05, (row + 0.5) * 0.05]])[0]
    view = View(place[0] - 0.01, place[1] - 0.01, place[0] + 0.01, place[1] + 0.01)
    np.testing.assert_array_equal(draw_walls(grid, view, pixels=(3, 3)), WALL)


def test_a_thin_wall_survives_being_made_small():
    cells = np.zeros((1000, 1000), dtype=np.int8)
    cells[:, 501] = 100
    picture = draw_walls(OccupancyGrid(cells, 0.05, np.zeros(3)), View(0, 0, 50, 50), pixels=(90, 90))
    assert (picture == WALL).any(axis=1).all()


def test_a_view_holds_its_points_and_has_the_aspect():
    view = view_of(np.array([[0.0, 0.0], [4.0, 1.0]]), margin_m=1.0, aspect=1.0)
    assert (view.left, view.right) == (-1, 5)
    assert view.size == (6, 6)
    assert view_of(np.array([[0.0, 0.0], [1.0, 9.0]]), margin_m=0.0, aspect=2.0).size == (18, 9)
